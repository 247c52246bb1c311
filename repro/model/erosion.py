"""Erosion: the aggregates' free surfaces recede along their normal with one of these speeds.

    constant            v
    thickness squared   k z^2, z: distance from the wall of the seed (Wanner and Gujer 1986, Xavier
                        et al. 2005)
    shear               k max(tau - tau_c, 0), tau: shear of the water on the surface

``growth.erosion.law`` selects one by :func:`law_of`. The midpoint rule advances the surface. The
surface first recedes for half of the time. The speed and the normals of this half-way surface then
move the original surface for the whole time. The error of a step is of third order in its length.
The biomass outside the new surface leaves the pore.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
import shapely

from repro.errors import ErosionError, failing_as
from repro.fem import elements, recession
from repro.fem.mesh import Region, beside
from repro.fem.outline import Outline
from repro.fem.space import Space
from repro.fem.walls import FREE, Wall
from repro.model import remeshing
from repro.model.flow import MPA_PER_UM, Flow
from repro.model.pore import Pore
from repro.model.remeshing import Remeshing
from repro.model.solving import Solver
from repro.scene import Erosion as Keys
from repro.scene import Flow as Drive
from repro.scene import Scene, at_time, needed
from repro.timing import timed

#: Function: (M,) MPa, shear of the water at the nodes of an outline close to the surface.
Shear: TypeAlias = Callable[[Outline], np.ndarray]


@dataclass(frozen=True)
class Constant:
    """Constant speed; speed: v, um/h."""

    speed: float
    follows_water = False

    def speeds(self, outline: Outline, wall: Wall, shear: Shear) -> np.ndarray:
        """(M,) um/h at the nodes of an outline; wall: of its seed."""
        return np.full(len(outline.points), self.speed)


@dataclass(frozen=True)
class ThicknessSquared:
    """Speed k z^2; coefficient: k, 1/(um h)."""

    coefficient: float
    follows_water = False

    def speeds(self, outline: Outline, wall: Wall, shear: Shear) -> np.ndarray:
        """(M,) um/h at the nodes of an outline; wall: of its seed."""
        return self.coefficient * wall.gap(outline.points) ** 2


@dataclass(frozen=True)
class ByShear:
    """Speed k max(tau - tau_c, 0); coefficient: k, um/(h MPa); critical: tau_c, MPa."""

    coefficient: float
    critical: float
    follows_water = True

    def speeds(self, outline: Outline, wall: Wall, shear: Shear) -> np.ndarray:
        """(M,) um/h at the nodes of an outline; wall: of its seed."""
        return self.coefficient * np.maximum(shear(outline) - self.critical, 0.0)


Law: TypeAlias = Constant | ThicknessSquared | ByShear


def law_of(keys: Keys) -> Law:
    """The law of a scene's erosion."""
    if keys.law == "constant":
        return Constant(needed(keys.speed, "a speed"))
    if keys.law == "shear":
        return ByShear(needed(keys.shear_coefficient, "a coefficient"), keys.critical_shear)
    return ThicknessSquared(needed(keys.thickness_coefficient, "a coefficient"))


@dataclass(frozen=True, eq=False)
class Erosion:
    """Data of erosion.

    law: speed of the surfaces; solver: flow around them; remeshing: meshes after erosion.
    """

    law: Law
    solver: Solver
    remeshing: Remeshing

    @classmethod
    def of(cls, scene: Scene) -> Erosion:
        """The erosion of a scene with [growth.erosion]."""
        keys = needed(scene.growing.growth.erosion, "[growth.erosion]")
        return cls(law_of(keys), Solver.of(scene), Remeshing.of(scene))

    @timed("erosion")
    @failing_as(ErosionError)
    def erode(self, pore: Pore, duration: float, speed: float) -> Pore:
        """The pore after its surfaces have receded for a duration (h), on a new mesh.

        speed: mean velocity, um/h, as for :func:`remeshing.remesh`. Raises ErosionError if a
        surface recedes too far.
        """
        walls = pore.mesh.walls
        shears = self._shears(pore, pore.outlines)
        whole = [self._prepared(pore, *each, duration) for each in zip(pore.outlines, shears)]
        halves = [recession.moved(outline, duration / 2 * self._velocities(pore, outline, shear))
                  for outline, shear in zip(whole, shears)]
        shears = self._shears(pore, halves)
        receded = [recession.moved(outline, duration * self._velocities(pore, half, shear))
                   for outline, half, shear in zip(whole, halves, shears)]
        for outline in receded:
            recession.refuse_invalid(outline, walls)
        return remeshing.within(self.remeshing, pore, receded, speed)

    def rate(self, pore: Pore, number: int, water: Flow | None) -> float:
        """Biomass (um2 mg/L/h) that an aggregate loses, at the density X_m.

        number: the aggregate's index; water: the flow in ``pore``, None without [flow].
        """
        outline = pore.outlines[number]

        def shear(_: Outline) -> np.ndarray:
            drive = at_time(needed(self.solver.drive, "[flow]"), pore.time)
            return surface_shear(pore.space, needed(water, "[flow]"), drive, outline,
                                 pore.mesh.regions[number])

        passed = recession.swept(outline, self._speeds(pore, outline, shear))
        return self.remeshing.maximum_density * passed

    def _speeds(self, pore: Pore, outline: Outline, shear: Shear) -> np.ndarray:
        """(M,) um/h at the nodes of an outline."""
        own, *_ = outline.seat.walls(pore.mesh.walls)
        return self.law.speeds(outline, own, shear)

    def _velocities(self, pore: Pore, outline: Outline, shear: Shear) -> np.ndarray:
        """(M, 2) um/h of the nodes of an outline."""
        return self._speeds(pore, outline, shear)[:, None] * recession.directions(outline)

    def _prepared(self, pore: Pore, outline: Outline, shear: Shear, duration: float) -> Outline:
        """The outline after arcs that shrink too much in a duration (h) have joined neighbours."""
        while True:
            moves = duration * self._velocities(pore, outline, shear)
            fewer = recession.merged(outline, moves)
            if fewer is None:
                return outline
            outline = fewer

    def _shears(self, pore: Pore, outlines: Sequence[Outline]) -> list[Shear]:
        """The shear of the water on each outline, at the time of a pore."""
        if not self.law.follows_water:
            return [lambda outline: np.zeros(len(outline.points))] * len(outlines)
        space = pore.space
        if outlines is not pore.outlines:
            mesh, outlines = self.remeshing.meshing.around(outlines, pore.front)
            space = Space(mesh)
        drive = at_time(needed(self.solver.drive, "[flow]"), pore.time)
        water = self.solver.solve_flow(space, drive)
        return [_along(outline, surface_shear(space, water, drive, outline, region))
                for outline, region in zip(outlines, space.mesh.regions)]


def _along(outline: Outline, shear: np.ndarray) -> Shear:
    """Interpolate a shear (M,) MPa at the nodes of an outline along the outline."""
    ring = shapely.LinearRing(outline.points)
    along = np.append(0.0, np.cumsum(outline.edge_lengths()))

    def at(other: Outline) -> np.ndarray:
        places = shapely.line_locate_point(ring, shapely.points(other.points))
        return np.interp(places, along, np.append(shear, shear[0]))

    return at


def surface_shear(space: Space, water: Flow, drive: Drive, outline: Outline,
                  region: Region) -> np.ndarray:
    """(M,) MPa, shear rho nu |t . (grad u + grad u^T) n| of the water at the nodes of a surface.

    The velocity gradient is a linear fit in the triangle beside each arc, because the map of a
    curved triangle at a contact line may be nearly singular at a node. A corner has the mean of the
    values of both arcs. The shear is zero at nodes within a contact surface.
    """
    mesh = space.mesh
    free = np.flatnonzero(outline.edge_wall == FREE)
    edges = outline.arcs(region.loop)[free][:, ::2].astype(int)
    wet = mesh.cells[~mesh.biomass]
    owner, places = beside(wet, edges)
    cells = wet[owner]
    table = space.gradient_table
    _, gradients = elements.mapped(mesh.points[cells], table)
    grad = np.einsum("eai,eqka->eqik", water.velocity[cells], gradients)
    fitted = np.einsum("cq,eqik->ecik", elements.linear_fit(table), grad)
    start, end = np.moveaxis(np.take_along_axis(fitted, places[:, :, None, None], axis=1), 1, 0)
    rate = np.stack([start, 0.5 * (start + end), end], axis=1)
    rate = rate + np.swapaxes(rate, 2, 3)
    normal = recession.normals(outline)[free]
    along = np.stack([-normal[..., 1], normal[..., 0]], axis=-1)
    shear = np.abs(np.einsum("eqi,eqij,eqj->eq", along, rate, normal))
    viscosity = MPA_PER_UM * drive.density * drive.kinematic_viscosity
    nodes = outline.arcs(np.arange(len(outline.points))).astype(int)[free]
    total = np.bincount(nodes.ravel(), shear.ravel(), len(outline.points))
    count = np.bincount(nodes.ravel(), minlength=len(outline.points))
    return viscosity * total / np.maximum(count, 1)
