"""Saved fields read back: the outline of the aggregate, and the pore as it was, to go on computing from there."""

from __future__ import annotations

from dataclasses import dataclass, replace

import meshio
import numpy as np

from repro.fem.mesh import Mesh
from repro.fem.outline import BOTTOM, FREE, TOP, Outline
from repro.fem.space import Space
from repro.model import biomass, remeshing
from repro.model.pore import Pore, Solved, material, solve
from repro.model.transport import Concentrations
from repro.scene import Scene
from verification.claims.levels import cached
from verification.claims.runs import fields, row_number, scene, series
from verification.claims.states import saved_mesh


@dataclass(frozen=True, eq=False)
class Body:
    """The aggregate in saved fields.

    grid: the mesh, with its loop; fields: as saved; triangles: (t, 3) of the biomass; outline: closed polygon.
    """

    grid: Mesh
    fields: meshio.Mesh
    triangles: np.ndarray
    outline: Outline

    def cell(self, name: str) -> np.ndarray:
        """(t,) values of saved cell data on the biomass triangles."""
        return self.fields.cell_data_dict[name]["triangle"][self.grid.biomass]

    def node(self, name: str) -> np.ndarray:
        """(N,) or (N, 3) values of saved point data."""
        return self.fields.point_data[name]


def body(run: tuple[str, ...], time: float) -> Body:
    """The aggregate of a run in its row at a time (h). Raises KeyError where there is none."""
    return read_body(fields(run, row_number(run, time)), scene(*run).pore.width)


def read_body(saved: meshio.Mesh, width: float) -> Body:
    """The aggregate in saved fields: its boundary is the edges that belong to one biomass triangle only."""
    grid = saved_mesh(saved, width)
    triangles = grid.triangles[grid.biomass]
    loop = boundary_loop(triangles)
    points = grid.points[loop]
    wall = np.where(points[:, 1] == 0, BOTTOM, np.where(points[:, 1] == width, TOP, FREE))
    origin = saved.point_data["position_t0_um"][loop, :2]
    fixed = (wall == BOTTOM) & (points[:, 0] == 0)
    with_loop = replace(grid, topology=replace(grid.topology, loop=loop))
    return Body(with_loop, saved, triangles, Outline(points, wall, fixed, origin))


def boundary_loop(triangles: np.ndarray) -> np.ndarray:
    """(M,) nodes of the boundary of counterclockwise triangles (t, 3) that form one piece, counterclockwise."""
    edges = np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])
    inner = set(map(tuple, edges[:, ::-1]))
    following = {a: b for a, b in map(tuple, edges) if (a, b) not in inner}
    loop = [min(following)]
    while following[loop[-1]] != loop[0]:
        loop.append(following[loop[-1]])
    return np.array(loop)


def pore(run: tuple[str, ...], time: float) -> Pore:
    """The pore of a run, before it meets the opposite wall, as it was at a time (h)."""
    found, density = body(run, time), scene(*run).kinetics.maximum_density
    grid, outline = found.grid, found.outline
    if (outline.wall == TOP).any():
        raise ValueError(f"{run} at t = {time} h: the fixed point on the upper wall is not saved")
    space = Space(grid, scene(*run).numerics.order)
    state = Concentrations(found.node("acceptor_mg_per_L"), found.node("donor_mg_per_L"))
    reference = found.node("position_t0_um")[grid.body, :2]
    active, inert = (density * biomass.at_points(space, found.node(name)) * space.reaction.dx
                     for name in ("active_biomass", "inert_biomass"))
    pressure = found.node("pressure_MPa") / scene(*run).growth.shear_modulus
    return Pore(time, space, outline.wall, outline.fixed, active, inert, found.cell("theta")[:, None],
                material(space, reference), pressure, state)


@cached
def solved_pore(run: tuple[str, ...], time: float) -> tuple[Pore, Solved]:
    """The pore of a run at a time (h) and what is solved in it."""
    now = pore(run, time)
    return now, solve(scene(*run), now)


def remeshed(chosen: Scene, now: Pore, solved: Solved) -> tuple[Pore, Solved]:
    """The same aggregate in a new mesh of the extent that the scene asks for, solved."""
    new, _ = remeshing.remesh(chosen, now, now, solved.flow.mean_velocity)
    return new, solve(chosen, new)


def stress(found: Body, modulus: float) -> np.ndarray:
    """(t, 4) Cauchy stress over mu_L (MPa) on the biomass triangles: xx, yy, zz, xy."""
    return np.stack([found.cell(f"stress_{part}_MPa") for part in ("xx", "yy", "zz", "xy")], axis=1) / modulus


def in_plane(stresses: np.ndarray) -> np.ndarray:
    """(t,) half the difference of the two principal stresses in the plane, which is what can change the shape."""
    xx, yy, _, xy = stresses.T
    return np.hypot(0.5 * (xx - yy), xy)


def equivalent(stresses: np.ndarray) -> np.ndarray:
    """(t,) equivalent (von Mises) stress: of the whole deviator, the direction across the plane included."""
    xx, yy, zz, xy = stresses.T
    return np.sqrt(0.5 * ((xx - yy) ** 2 + (yy - zz) ** 2 + (zz - xx) ** 2) + 3 * xy**2)


@cached
def bodies(run: tuple[str, ...]) -> tuple[Body, ...]:
    """The aggregate in every row of a run."""
    return tuple(read_body(fields(run, k), scene(*run).pore.width) for k in range(len(series(*run)["time_h"])))
