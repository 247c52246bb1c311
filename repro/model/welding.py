"""Two aggregates that meet and weld: their surfaces join, and share their motion from then on.

The welded aggregates are one elastic body with two references. They share the displacements and the
pressure of the nodes of the weld, and each triangle keeps the reference and the theta of its own
aggregate, so that both keep the strain that they had when they joined. A film between them closes
as one at a wall does (2.3.3): it must be as thick as the least film, or as tan(angle) times the
distance along its middle line from the line, whichever is less. Pairs of opposite nodes
(:mod:`repro.fem.welds`) join, one after the other, until no film is too thin. They go half of the
way each, and then to equilibrium. Contact lines on walls advance by nodes, too.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from repro.errors import GrowthError
from repro.fem import welds
from repro.fem.forms import Basis, basis
from repro.fem.walls import FREE, WELD
from repro.model import growth, remeshing
from repro.model.closing_by_nodes import closing_nodes
from repro.model.contact_lines import ANGLE_FROM, PART_OF_ANGLE, ROUND_OFF
from repro.model.mechanics import (
    CONTACT_ROUNDS,
    Expansion,
    Mechanics,
    constraints,
    surface_supports,
    with_new_surfaces,
)
from repro.model.pore import Pore
from repro.model.remeshing import Remeshing
from repro.model.solid import Shape, Solid
from repro.model.support import Support


@dataclass(frozen=True, eq=False)
class WeldedSolid(Solid):
    """Welded aggregates; in_triangles: (t, k, 2) um, the reference of each triangle's nodes."""

    in_triangles: np.ndarray = field(kw_only=True)

    @cached_property
    def at(self) -> Basis:
        """The displacements' functions in the references."""
        return basis(self.shape.cells, len(self.reference), self.in_triangles, self.shape.table)


def join(mechanics: Mechanics, rules: Remeshing, pore: Pore, speed: float) -> Pore:
    """The pore after two aggregates have met: they are welded over the least film's length on both
    sides of the point where they are nearest. speed: as for :func:`remeshing.remesh`."""
    film = mechanics.keys.minimum_film
    outlines = welds.facing(*pore.outlines, film)
    facing, _ = remeshing.remesh(rules, pore, pore, speed, outlines=outlines)
    shape = Welding(mechanics, facing, facing).close(film)
    return remeshing.remesh(rules, facing, shape.pore, speed)[0]


@dataclass(eq=False)
class Welding:
    """Closing of the film between two aggregates that are welded, or that have met.

    grown: the pore with its new theta, in the old shape; start: a pore on the same mesh with the
    shape and pressure from which the search starts; forces: (n, 2) um on the nodes of all
    aggregates, over mu_L.
    """

    mechanics: Mechanics
    grown: Pore
    start: Pore
    forces: np.ndarray | None = None
    patient: bool = True

    def __post_init__(self) -> None:
        mesh = self.grown.mesh
        outlines = self.grown.outlines
        self._walks = welds.notches(*outlines)
        lengths = [[welds.lengths_from(outline, walk) for outline, walk in zip(outlines, walks)]
                   for walks in self._walks]
        #: Corners of each notch that are opposite each other, and their lengths from the line.
        self._lengths = [each[0][: welds.opposite_corners(*each)] for each in lengths]
        loops = mesh.topology.loops
        self._pairs = [np.column_stack([loop[walk[: mesh.geometry * (len(own) - 1) + 1]]
                                        for loop, walk in zip(loops, walks)])
                       for walks, own in zip(self._walks, self._lengths)]
        self._iterations = 0

    def equilibrium(self) -> Pore:
        """The equilibrium with the weld and the contact of the start."""
        return self._equilibrium(self.start, [0, 0], [0, 0])

    def close(self, reach: float = 0.0) -> Expansion:
        """The shape in which no film between the aggregates and no wedge at a wall is too thin.

        reach: length (um) from the point of the first contact that joins. Raises GrowthError.
        """
        film = self.mechanics.keys.minimum_film
        angle = self.mechanics.keys.minimum_contact_angle
        size = self.grown.mesh.geometry
        joined = [size * int(np.abs(own - reach).argmin()) for own in self._lengths]
        shape = replace(self.grown, space=self.start.space, pressure=self.start.pressure)
        before = [0, 0] if not reach else [-1, -1]
        for _ in range(CONTACT_ROUNDS):
            if joined != before:
                shape = self._equilibrium(shape, before, joined)
            shape = self._equilibrium(shape, joined, joined)
            before = joined
            joined = [count + size * self._violates(shape, number, film, np.tan(angle))
                      for number, count in enumerate(joined)]
            walls = [self._closing(shape, number, film, angle) for number in range(2)]
            touched = [np.where(wall != FREE, wall, body.wall)
                       for wall, body in zip(walls, shape.bodies)]
            if joined == before and not any((wall != FREE).any() for wall in walls):
                return Expansion(self._marked(shape, joined), self._iterations)
            shape = replace(shape, bodies=tuple(
                replace(body, wall=wall) for body, wall in zip(shape.bodies, touched)))
        raise GrowthError(f"the weld still grows after {CONTACT_ROUNDS} rounds")

    def _joined_pairs(self, counts: Sequence[int]) -> np.ndarray:
        """(k, 2) nodes of the pairs that have joined, by their counts in both notches."""
        return np.concatenate([pairs[: count + 1] for pairs, count in zip(self._pairs, counts)])

    def _equilibrium(self, shape: Pore, tied: Sequence[int], joined: Sequence[int]) -> Pore:
        """The equilibrium with pairs that are tied, and others that are placed half way between
        their nodes."""
        grown = self.grown
        mesh = grown.mesh
        alias = np.arange(len(mesh.points))
        pairs = self._joined_pairs(tied)
        alias[pairs[:, 1]] = pairs[:, 0]
        cells = alias[mesh.cells[mesh.biomass]]
        nodes, own_cells = np.unique(cells, return_inverse=True)
        number = np.searchsorted(nodes, alias)
        corners = int(np.count_nonzero(nodes < mesh.corners))
        prescribed = np.zeros((len(mesh.points), 2), bool)
        target = shape.mesh.points.copy()
        reference = mesh.points.copy()
        in_triangles, thetas = [], []
        supports: list[Support] = []
        for k, region in enumerate(mesh.regions):
            solid, theta = grown.bodies[k].strained
            in_triangles.append(solid.reference[region.own_cells])
            thetas.append(theta)
            reference[region.nodes] = solid.reference
            seen = shape.focused(k)
            locked, places = constraints(grown.focused(k), seen)
            prescribed[region.nodes] |= locked
            target[region.nodes] = np.where(locked, places, target[region.nodes])
            for support in surface_supports(solid, seen):
                load = np.zeros(len(nodes))
                np.add.at(load, number[region.nodes], support.load)
                supports.append(Support(int(number[region.nodes[support.point]]), load))
        placed = self._joined_pairs(joined)
        apart = placed[alias[placed[:, 1]] != alias[placed[:, 0]]]
        prescribed[apart] = True
        target[apart] = shape.mesh.points[apart].mean(axis=1)[:, None]
        solid = WeldedSolid(
            Shape(own_cells.reshape(cells.shape), corners, grown.space.gradient_degree,
                  mesh.topology.method), reference[nodes], energy=grown.bodies[0].solid.energy,
            in_triangles=mesh.by_triangle(in_triangles))
        forces = None
        if self.forces is not None:
            forces = np.zeros((len(nodes), 2))
            np.add.at(forces, number[mesh.body], self.forces)
        rest = growth.equilibrium(
            solid, mesh.by_triangle(thetas), shape.mesh.points[nodes], shape.pressure[nodes[:corners]],
            prescribed[nodes], target[nodes], forces=forces, supports=supports,
            modified_newton=self.mechanics.numerics.scheme.modified_newton, patient=self.patient)
        self._iterations += rest.iterations
        points = shape.mesh.points.copy()
        points[mesh.body] = rest.position[number[mesh.body]]
        pressure = shape.pressure.copy()
        body_corners = mesh.topology.body_corners
        pressure[body_corners] = rest.pressure[number[body_corners]]
        return replace(shape.moved(points), pressure=pressure)

    def _violates(self, shape: Pore, number: int, film: float, slope: float) -> bool:
        """Does a corner of a notch violate the rule?"""
        geometry = shape.mesh.geometry
        one, two = np.swapaxes(shape.mesh.points[self._pairs[number][::geometry]], 0, 1)
        before = self.grown.mesh.points[self._pairs[number][::geometry]]
        middle = 0.5 * (one + two)
        pieces = np.linalg.norm(np.diff(middle, axis=0), axis=1)
        joined = np.linalg.norm(one - two, axis=1) == 0
        first = int(np.flatnonzero(joined)[-1])
        along = np.concatenate([[0.0], np.cumsum(pieces)])
        along = along - along[first]
        tangent = np.gradient(before.mean(axis=1), axis=0)
        normal = np.column_stack([-tangent[:, 1], tangent[:, 0]])
        normal /= np.linalg.norm(normal, axis=1)[:, None]
        across = np.einsum("ki,ki->k", normal, before[:, 1] - before[:, 0])
        side = np.sign(across[np.argmax(np.abs(across))])
        gap = side * np.einsum("ki,ki->k", normal, two - one)
        needs = np.minimum(film, slope * along)
        needs[along < ANGLE_FROM * (1 - ROUND_OFF) * film / slope] *= PART_OF_ANGLE
        bad = np.flatnonzero((gap < needs) & ~joined & (along > 0))
        if len(bad) and bad[-1] == len(gap) - 1:
            raise GrowthError("the weld advances beyond the nodes that are opposite each other")
        return len(bad) > 0

    def _closing(self, shape: Pore, number: int, film: float, angle: float) -> np.ndarray:
        """(M,) wall that each node of an aggregate must join next, or FREE; whole arcs join."""
        seen = shape.focused(number)
        outline = seen.boundary
        wall = closing_nodes(outline, seen.walls, film, angle)
        if outline.geometry == 2:
            middles = wall[1::2]
            before = np.where(middles != FREE, middles, wall[::2])
            wall[::2] = np.where(before != FREE, before, np.roll(middles, 1))
        return wall

    def _marked(self, shape: Pore, joined: Sequence[int]) -> Pore:
        """The pore with the nodes that have joined marked as welded."""
        pairs = self._joined_pairs(joined)
        bodies = [replace(body, wall=np.where(np.isin(loop, pairs[:, number]), WELD, body.wall))
                  for number, (body, loop) in enumerate(zip(shape.bodies,
                                                            shape.mesh.topology.loops))]
        marked = replace(shape, bodies=tuple(bodies))
        for number in range(2):
            marked = with_new_surfaces(marked.focused(number))
        return marked.focused(None)
