"""The aggregate and the pore of a run at an instant, and the stresses in it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import meshio
import numpy as np
import shapely

from repro import results
from repro.fem.mesh import Mesh
from repro.fem.outline import Outline, parabola
from repro.march.loop import Instant
from repro.model import remeshing
from repro.model.pore import Pore, Solved, solve
from repro.scene import Scene
from verification.claims.levels import cached
from verification.claims.runs import history, instant, scene

#: Points of an arc of an outline, as a polygon.
PER_ARC = 8


@dataclass(frozen=True, eq=False)
class Body:
    """The aggregate of a pore, and the fields that a run would save of it."""

    scene: Scene
    pore: Pore
    solved: Solved

    @cached_property
    def fields(self) -> meshio.Mesh:
        """As saved."""
        return results.fields(self.scene, self.pore, self.solved)

    @property
    def grid(self) -> Mesh:
        """The mesh."""
        return self.pore.mesh

    @property
    def outline(self) -> Outline:
        """The aggregate's boundary."""
        return self.pore.boundary

    @property
    def triangles(self) -> np.ndarray:
        """(t, 3 or 6) of the biomass."""
        return self.grid.cells[self.grid.biomass]

    @cached_property
    def areas(self) -> np.ndarray:
        """(T,) um2, of curved triangles too."""
        return self.pore.space.at.dx.sum(axis=1)

    def cell(self, name: str) -> np.ndarray:
        """(t,) values of cell data on the biomass triangles."""
        return self.fields.cell_data[name][0][self.grid.biomass]

    def node(self, name: str) -> np.ndarray:
        """(N,) or (N, 3) values of point data."""
        return self.fields.point_data[name]


def body_of(said: Scene, found: Instant) -> Body:
    """The aggregate at an instant."""
    return Body(said, found.pore, found.solved)


@cached
def body(run: tuple[str, ...], time: float) -> Body:
    """The aggregate of a run in its row at a time (h). Raises KeyError where there is none."""
    return body_of(scene(*run), instant(run, time))


@cached
def bodies(run: tuple[str, ...]) -> tuple[Body, ...]:
    """The aggregate in every row of a run."""
    found = history(*run)
    return tuple(body_of(found.scene, each) for each in found.instants)


def polygon(outline: Outline) -> shapely.Polygon:
    """The area inside an outline; arcs by PER_ARC chords."""
    if outline.geometry == 1:
        return shapely.Polygon(outline.points)
    t = np.arange(PER_ARC) / PER_ARC
    return shapely.Polygon(np.einsum("qa,eai->eqi", parabola(t), outline.arcs(outline.points)).reshape(-1, 2))


def interface_length(found: Body) -> float:
    """Length (um) of the line between fluid and aggregate."""
    outline = found.outline
    return float(outline.edge_lengths()[outline.interface_edges()].sum())


def solved_pore(run: tuple[str, ...], time: float) -> tuple[Pore, Solved]:
    """The pore of a run at a time (h) and what is solved in it."""
    found = instant(run, time)
    return found.pore, found.solved


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
