"""The mesh of the next step: moved with the aggregate, or made anew with the fields carried over (3.1, 3.5)."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from repro.errors import MeshError
from repro.fem import geometry, mesh, reprojection
from repro.model import mesh_motion, pore
from repro.model.pore import Pore, Solved
from repro.model.transport import Concentrations


def new_mesh(scene, now: Pore, expanded: Pore, solved: Solved) -> tuple[Pore, bool]:
    """The mesh moved with the aggregate, or a new one, and which of them it is.

    New where the paper says so: the extent is too short (3.1), or the moved mesh would not be acceptable (3.5); and
    where a moved mesh cannot do: contact has changed, or interface edges are twice too long for the narrowest film.
    """
    moved = followed(scene, now, expanded)
    if moved is not None:
        return replace(expanded, mesh=moved, concentrations=solved.concentrations), False
    return remesh(scene, now, expanded, solved), True


def followed(scene, now: Pore, expanded: Pore) -> mesh.PoreMesh | None:
    """The mesh moved with the aggregate, None where a new one is due."""
    outline, width = expanded.outline, scene.pore.width
    stale = (geometry.extent_too_short(outline, now.mesh.ends, width, scene.pore.length)
             or (expanded.wall != now.wall).any() or geometry.too_coarse(outline, pore.sizing(scene)))
    if stale:
        return None
    moved = now.mesh.moved(mesh_motion.move(now.mesh, expanded.mesh.points[now.mesh.body],
                                            scene.numerics.mesh_compressibility, scene.numerics.flow_stabilisation))
    return moved if moved.acceptable() else None


def anew(scene, outline: geometry.Outline) -> tuple[mesh.PoreMesh, geometry.Outline]:
    """A new mesh around the aggregate with the extent of 3.1, and the outline with the nodes that it has on it."""
    ends = geometry.meshed_extent(outline, scene.pore.width, scene.pore.length, scene.numerics.extent == "full")
    return mesh.generate(outline, ends, pore.sizing(scene))


def remesh(scene, now: Pore, expanded: Pore, solved: Solved) -> Pore:
    """A new mesh around the aggregate with the extent of 3.1; fields, and places at t = 0, are carried over.

    theta restarts as J times the density over X_m: the expansion that brings each triangle's density back to X_m, so
    that the error of the constraint is worked off at the next update and does not accumulate [E7].
    """
    grid, outline = anew(scene, expanded.outline)
    carried = _carried(scene.numerics.transfer, expanded, grid)
    carried["origin"][grid.loop] = outline.origin
    theta = _expansion(grid, carried["origin"]) * _density(scene, grid, carried)
    return replace(expanded, mesh=grid, wall=outline.wall, fixed=outline.fixed, theta=theta,
                   concentrations=_carried_substrates(scene, now, grid, solved), **carried)


def _carried(transfer: str, expanded: Pore, grid: mesh.PoreMesh) -> dict[str, Any]:
    """X_A and X_I by the chosen transfer; places at t = 0 and pressure by linear interpolation."""
    old, triangles = expanded.mesh.body, expanded.mesh.body_triangles
    body, new, new_triangles = expanded.mesh.points[old], grid.points[grid.body], grid.body_triangles
    biomass = np.column_stack([expanded.active, expanded.inert])[old]
    others = np.column_stack([expanded.origin, expanded.pressure])[old]
    if transfer == "conserving":
        masses = reprojection.project(body, triangles, biomass, new, new_triangles)
    elif transfer == "bounded":
        masses = reprojection.project_bounded(body, triangles, biomass, new, new_triangles)
    else:
        masses = reprojection.interpolate(body, triangles, biomass, new)
    others = reprojection.interpolate(body, triangles, others, new)
    count = len(grid.points)
    active, inert, pressure, origin = np.zeros(count), np.zeros(count), np.zeros(count), grid.points.copy()
    active[grid.body], inert[grid.body] = masses.T
    origin[grid.body], pressure[grid.body] = others[:, :2], others[:, 2]
    return {"active": active, "inert": inert, "origin": origin, "pressure": pressure}


def _expansion(grid: mesh.PoreMesh, origin: np.ndarray) -> np.ndarray:
    """J (t,) of each biomass triangle: its area over the area it had at t = 0 (3.5)."""
    reference = mesh.triangle_areas(origin, grid.triangles[grid.biomass])
    if reference.min() <= 0:
        worst = grid.points[grid.triangles[grid.biomass][np.argmin(reference)]].mean(axis=0)
        raise MeshError(f"after a remesh the places at t = 0 fold near x = {worst[0]:.4g}, y = {worst[1]:.4g} um; "
                        "try a larger numerics.refinement")
    return grid.areas[grid.biomass] / reference


def _density(scene, grid: mesh.PoreMesh, carried) -> np.ndarray:
    """(t,) mean of (X_A + X_I) / X_m over the nodes of each biomass triangle."""
    total = (carried["active"] + carried["inert"]) / scene.kinetics.maximum_density
    return total[grid.triangles[grid.biomass]].mean(axis=1)


def _carried_substrates(scene, now: Pore, grid: mesh.PoreMesh, solved: Solved) -> Concentrations:
    """C_A and C_D on a new mesh: interpolated; beyond the old ends (26) upstream, constant downstream, and the supply
    where nothing flows."""
    old, state, speed = now.mesh, solved.concentrations, solved.flow.mean_velocity if solved.flow else 0.0
    fields = np.column_stack([state.acceptor, state.donor])
    fields = reprojection.interpolate(old.points, old.triangles, fields, grid.points)
    x = grid.points[:, 0]
    before, beyond = x < old.ends[0], (x < old.ends[0]) | (x > old.ends[1])
    for column, substrate in enumerate((scene.substrates.acceptor, scene.substrates.donor)):
        if speed == 0:
            fields[beyond, column] = substrate.supply
        else:
            fall = np.exp(speed * (x[before] - old.ends[0]) / substrate.diffusivity)
            fields[before, column] = substrate.supply - (substrate.supply - fields[before, column]) * fall
    return Concentrations(fields[:, 0], fields[:, 1])
