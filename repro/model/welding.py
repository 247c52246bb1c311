"""Welding of two aggregates: their surfaces join, and move together from then on.

The welded aggregates are one elastic body with two references. They share the positions and the
pressures of the nodes of the weld. Each triangle keeps the reference and the theta of its own
aggregate, so both aggregates keep the strain that they had before. A film between them closes by
the same rule as a film at a wall (2.3.3): the gap must be at least min(film, tan(angle) d), where d
is the distance from the end of the weld along the middle line of the film. Pairs of opposite nodes
(:mod:`repro.fem.welds`) join, one after the other, until no film is too thin. The two nodes of a
pair first move to the point half way between them, and then to equilibrium. The last arcs that have
joined are divided where the weld may end without a film that is too thin. Contact lines on walls
advance by nodes.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import cached_property
from math import ceil, inf, log2

import numpy as np

from repro.errors import GrowthError, LinearError
from repro.fem import welds
from repro.fem.division import Division
from repro.fem.forms import Basis, basis
from repro.fem.mesh import Mesh, Region
from repro.fem.outline import Outline
from repro.fem.walls import FREE, WELD
from repro.model import growth, remeshing
from repro.model.closing_by_lines import divided
from repro.model.closing_by_nodes import closing_nodes
from repro.model.contact_lines import ANGLE_FROM, AT_PLACES, PART_OF_ANGLE, ROUND_OFF, Contact
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

#: The last arc of a weld is halved until a part is shorter than this times numerics.tolerance of
#: the arc: a sixteenth in ``fast``. Lengths then err by 0.8 % or less, and by up to 1.4 % with an
#: eighth (``coupling-weld``).
ARC_PART = 10.0


@dataclass(frozen=True, eq=False)
class WeldedSolid(Solid):
    """Welded aggregates; in_triangles: (t, k, 2) um, reference of each triangle's own nodes."""

    in_triangles: np.ndarray = field(kw_only=True)

    @cached_property
    def at(self) -> Basis:
        """The functions of the displacements in the references."""
        return basis(self.shape.cells, len(self.reference), self.in_triangles, self.shape.table)


def join(mechanics: Mechanics, rules: Remeshing, pore: Pore, pair: tuple[int, int],
         speed: float) -> Pore:
    """The pore after two aggregates have met and joined, without fluid forces; pair: their indices.

    The weld extends by the thickness of the least film on each side of the nearest points. speed:
    as for :func:`remeshing.remesh`. Raises GrowthError or MeshError.
    """
    film = mechanics.keys.minimum_film
    outlines = list(pore.outlines)
    weld = max(WELD, 1 + max(int(outline.wall.max()) for outline in outlines))
    first, second = pair
    outlines[first], outlines[second] = welds.facing(outlines[first], outlines[second], film, weld)
    facing, _ = remeshing.remesh(rules, pore, pore, speed, outlines=outlines)
    shape = Welding(mechanics, facing, facing, pair, reach=film).close()
    return remeshing.remesh(rules, facing, shape.pore, speed)[0]


@dataclass(eq=False)
class Notch:
    """The water at one end of a weld.

    pairs: (k, 2) opposite nodes of the mesh, from the line on; before: (k, 2, 2) um, their
    positions in the old shape; size: number of nodes from corner to corner; film: least film (um);
    slope: tangent of the least angle; joined: number of pairs of corners beyond the old line that
    have joined, in the present trial; last_too_few: largest number of pairs for which a film is too
    thin; first_enough: smallest number for which no film is too thin; step: the next trial has
    at most this many pairs fewer.
    """

    pairs: np.ndarray
    before: np.ndarray
    size: int
    film: float
    slope: float
    joined: int = 0
    first_enough: float = inf
    step: int = 1

    def __post_init__(self) -> None:
        self.last_too_few = self.joined - 1

    @property
    def tied(self) -> np.ndarray:
        """(k, 2) pairs that have joined."""
        return self.pairs[: self.size * self.joined + 1]

    @property
    def _last(self) -> int:
        """The largest number of pairs that may join."""
        return (len(self.pairs) - 1) // self.size - 1

    def advance(self, points: np.ndarray) -> None:
        """Go to the next trial; points: (N, 2) um, of the mesh in the present trial.

        While a film is too thin, all pairs up to it join. Then fewer pairs join, until the smallest
        number without a thin film is known. Raises GrowthError if there are no further pairs.
        """
        if not self.too_thin(points, self.joined):
            self.first_enough = self.joined
        else:
            self.last_too_few = self.joined
            if self.first_enough <= self.joined:  # the other notch has moved since
                self.first_enough, self.step = inf, 1
        if self.first_enough < inf:
            middle = int(self.last_too_few + self.first_enough + 1) // 2
            self.joined = max(middle, int(self.first_enough) - self.step)
            self.step *= 2
        elif self.last_too_few < self._last:
            self.joined += 1
            self.predict(points)
        else:
            raise GrowthError("the weld advances beyond the nodes that are opposite each other")

    def predict(self, points: np.ndarray) -> None:
        """Join pairs until no film is too thin in a given shape; points: (N, 2) um, of its mesh."""
        while self.joined < self._last and self.too_thin(points, self.joined):
            self.joined += 1

    def too_thin(self, points: np.ndarray, joined: int) -> bool:
        """Is a film thinner than the rule requires? Close to the line the rule requires less, as in
        :mod:`repro.model.contact_lines`."""
        free = self.pairs[self.size * joined:]
        one, two = _along_arcs(points[free])
        before = _along_arcs(self.before[self.size * joined:])
        along = np.cumsum(np.linalg.norm(np.diff(0.5 * (one + two), axis=0), axis=1))
        tangent = np.gradient(before.mean(axis=0), axis=0)
        normal = np.column_stack([-tangent[:, 1], tangent[:, 0]])
        normal /= np.linalg.norm(normal, axis=1)[:, None]
        across = np.einsum("ki,ki->k", normal, before[1] - before[0])
        normal *= np.sign(across[np.argmax(np.abs(across))])
        gap = np.einsum("ki,ki->k", normal, two - one)[1:]
        needs = np.minimum(self.film, self.slope * along)
        needs[along < ANGLE_FROM * (1 - ROUND_OFF) * self.film / self.slope] *= PART_OF_ANGLE
        return bool((gap < needs).any())


def _along_arcs(nodes: np.ndarray) -> np.ndarray:
    """(2, p, 2) um, points along both surfaces: the first node, then PLACES of each arc.

    nodes: (k, 2, 2) um, of the arcs of both surfaces.
    """
    arcs = np.stack([nodes[:-2:2], nodes[1:-1:2], nodes[2::2]], axis=1)
    points = np.einsum("ta,kasi->skti", AT_PLACES[1:], arcs).reshape(2, -1, 2)
    return np.concatenate([nodes[None, 0].swapaxes(0, 1), points], axis=1)


@dataclass(frozen=True, eq=False)
class Union:
    """The nodes of two aggregates, with the two nodes of a tied pair as one.

    nodes: (n,) nodes of the mesh, ascending; number: (N,) index in ``nodes`` of each node of the
    aggregates, or of the node to which it is tied; cells: (t, k) triangles as indices into
    ``nodes``; corners: number of corners among ``nodes``.
    """

    nodes: np.ndarray
    number: np.ndarray
    cells: np.ndarray
    corners: int

    @staticmethod
    def of(mesh: Mesh, regions: Sequence[Region], tied: np.ndarray) -> Union:
        """The union of the aggregates in two regions of a mesh; tied: (k, 2) pairs of nodes."""
        alias = np.arange(len(mesh.points))
        alias[tied[:, 1]] = tied[:, 0]
        cells = mesh.by_triangle([region.cells for region in regions], regions)
        nodes, own_cells = np.unique(alias[cells], return_inverse=True)
        return Union(nodes, np.searchsorted(nodes, alias), own_cells.reshape(cells.shape),
                     int(np.count_nonzero(nodes < mesh.corners)))

    def summed(self, nodes: np.ndarray, values: np.ndarray) -> np.ndarray:
        """(n, ...) sums at the union's nodes of values (k, ...) at nodes (k,) of the mesh."""
        total = np.zeros((len(self.nodes), *values.shape[1:]))
        np.add.at(total, self.number[nodes], values)
        return total


@dataclass(eq=False)
class Welding:
    """Closing of the film between two aggregates that are welded, or that have just met.

    grown: the pore with its new theta, in the old shape; start: a pore on the same mesh with the
    shape and pressure from which the search starts; pair: indices of the two aggregates; forces:
    (N, 2) um at the nodes of the mesh, over mu_L, None for no forces; reach: um, half of the first
    length of the weld if the aggregates have just met, zero otherwise; patient: as in
    :class:`SearchOptions`.
    """

    mechanics: Mechanics
    grown: Pore
    start: Pore
    pair: tuple[int, ...]
    forces: np.ndarray | None = None
    reach: float = 0.0
    patient: bool = True

    def __post_init__(self) -> None:
        self._iterations = 0
        self._notches = [self._notch(walks) for walks in welds.notches(*self._outlines)]

    @property
    def _outlines(self) -> list[Outline]:
        """The boundaries of both aggregates."""
        return [self.grown.outlines[number] for number in self.pair]

    @property
    def _loops(self) -> list[np.ndarray]:
        """(M,) nodes of the boundary of each aggregate."""
        return [self.grown.mesh.topology.loops[number] for number in self.pair]

    @property
    def _regions(self) -> list[Region]:
        """The regions of both aggregates."""
        return [self.grown.mesh.regions[number] for number in self.pair]

    def _notch(self, walks: Sequence[np.ndarray]) -> Notch:
        """The notch with the nodes ``walks`` on both outlines (:func:`welds.notches`)."""
        mesh = self.grown.mesh
        keys = self.mechanics.keys
        size = mesh.geometry
        lengths = [welds.lengths_from(*each) for each in zip(self._outlines, walks)]
        nodes = size * (welds.opposite_corners(*lengths) - 1) + 1
        pairs = np.column_stack([loop[walk[:nodes]] for loop, walk in zip(self._loops, walks)])
        return Notch(pairs, mesh.points[pairs], size, keys.minimum_film,
                     np.tan(keys.minimum_contact_angle),
                     int(np.abs(lengths[0] - self.reach).argmin()))

    def equilibrium(self) -> Pore:
        """The equilibrium with the weld and the contact of ``start``."""
        return self._equilibrium(self.start, self._tied())

    def close(self) -> Expansion:
        """The shape in which no film between the aggregates and no wedge at a wall is too thin.

        Raises GrowthError if there is no equilibrium or the weld does not come to rest.
        """
        shape = self.grown  # other aggregates have their new shapes there
        for number, region in zip(self.pair, self._regions):
            shape = shape.focused(number).placed(self.start.mesh.points[region.nodes],
                                                 self.start.pressure[region.corner_nodes])
        tied = np.empty((0, 2), int) if self.reach else self._tied()
        if not self.reach:
            for notch in self._notches:
                notch.predict(shape.mesh.points)
        for _ in range(CONTACT_ROUNDS):
            shape = self._joined(shape, tied)
            tied = self._tied()
            for notch in self._notches:
                notch.advance(shape.mesh.points)
            walls = [self._closing(shape, number) for number in self.pair]
            at_rest = np.array_equal(self._tied(), tied)
            if at_rest and not any((wall != FREE).any() for wall in walls):
                return self._within_arcs(shape)
            for number, wall in zip(self.pair, walls):
                seen = shape.focused(number)
                shape = seen.with_body(wall=np.where(wall != FREE, wall, seen.body.wall))
        raise GrowthError(f"the weld still grows after {CONTACT_ROUNDS} rounds")

    def _within_arcs(self, shape: Pore) -> Expansion:
        """The shape with each end of the weld within the last arcs that have joined.

        shape: the equilibrium with these arcs. It is the result if there is no equilibrium with a
        shorter weld, or if its films are too thin.
        """
        entire = Expansion(self._marked(shape), self._iterations)
        inside = [k for k, notch in enumerate(self._notches) if notch.joined and not self.reach]
        if not inside:
            return entire
        too_short = np.zeros(len(inside))
        enough = np.ones(len(inside))
        with suppress(GrowthError, LinearError):
            for _ in range(ceil(-log2(ARC_PART * self.mechanics.numerics.tolerance))):
                t = 0.5 * (too_short + enough)
                thin, _ = self._ending_at(shape, inside, t)
                too_short = np.where(thin, t, too_short)
                enough = np.where(thin, enough, t)
            shorter = [k for k, t in zip(inside, enough) if t < 1]
            if shorter:
                thin, expansion = self._ending_at(shape, shorter, enough[enough < 1])
                if not thin.any():
                    return expansion
        return replace(entire, iterations=self._iterations)

    def _ending_at(self, shape: Pore, inside: Sequence[int],
                   t: np.ndarray) -> tuple[np.ndarray, Expansion]:
        """For each notch, is a film too thin if the weld ends within its last arcs?

        Also returns the equilibrium. Arguments are those of :meth:`_divided`.
        """
        trial, start, divisions = self._divided(shape, inside, t)
        rest = trial._equilibrium(start, trial._tied())
        self._iterations += trial._iterations
        notches = [trial._notches[k] for k in inside]
        thin = np.array([notch.too_thin(rest.mesh.points, notch.joined) for notch in notches])
        return thin, Expansion(trial._marked(rest), self._iterations, divisions=divisions)

    def _divided(self, shape: Pore, inside: Sequence[int],
                 t: np.ndarray) -> tuple[Welding, Pore, tuple[Division, ...]]:
        """The closing on a mesh with the last arcs of notches divided, and the shape on this mesh.

        inside: indices of the notches; t: where their arcs are divided, from the line to the free
        surface.
        """
        grown = self.grown
        for number in self.pair:
            rest = shape.bodies[number]
            grown = grown.focused(number).with_body(wall=rest.wall, fixed=rest.fixed)
        points = shape.mesh.points
        pressure = shape.pressure
        forces = self.forces
        divisions = []
        for side, number in enumerate(self.pair):
            arcs, at = zip(*[self._last_arc(k, side, part) for k, part in zip(inside, t)])
            order = np.argsort(arcs)
            division = Division(grown.mesh, np.array(arcs)[order], np.array(at)[order], number)
            free = np.full(len(arcs), FREE)
            contact = Contact(grown.bodies[number].wall, division.arcs, division.t, free, free)
            grown = divided(grown.focused(number), division, contact)
            points = division.nodal(points)
            pressure = division.at_corners(pressure)
            forces = None if forces is None else division.divided_loads(forces)
            divisions.append(division)
        start = replace(grown.moved(points), pressure=pressure)
        trial = replace(self, grown=grown, start=start, forces=forces)
        for k, notch in enumerate(self._notches):
            nodes = len(notch.pairs) + notch.size * (k in inside)
            walks = welds.notches(*trial._outlines)[k]
            pairs = np.column_stack([loop[walk[:nodes]] for loop, walk in zip(trial._loops, walks)])
            trial._notches[k] = replace(notch, pairs=pairs, before=grown.mesh.points[pairs])
        return trial, start, tuple(divisions)

    def _last_arc(self, k: int, side: int, t: float) -> tuple[int, float]:
        """The last joined arc of a notch on one outline, and the place along the loop that is
        ``t`` along the arc from the line."""
        middle = self._notches[k].pairs[2 * self._notches[k].joined - 1, side]
        loop = self._loops[side]
        node = int(np.flatnonzero(loop == middle)[0])
        forward = loop[(node + 1) % len(loop)] == self._notches[k].pairs[
            2 * self._notches[k].joined, side]
        return node // 2, t if forward else 1 - t

    def _tied(self) -> np.ndarray:
        """(k, 2) nodes of all pairs that have joined."""
        return np.concatenate([notch.tied for notch in self._notches])

    def _joined(self, shape: Pore, tied: np.ndarray) -> Pore:
        """The equilibrium after further pairs have joined half way between their nodes.

        tied: (k, 2) pairs that had joined before. If this fails because the triangles beside the
        new pairs are too small, the new pairs are first prescribed half way, and the aggregates
        take the equilibrium with them.
        """
        pairs = self._tied()
        if not np.isin(pairs[:, 1], tied[:, 1]).all():
            points = shape.mesh.points.copy()
            points[pairs] = points[pairs].mean(axis=1)[:, None]
            with suppress(GrowthError, LinearError):
                return self._equilibrium(shape.moved(points), pairs)
            shape = self._equilibrium(shape, tied[np.isin(tied[:, 1], pairs[:, 1])], pairs)
        return self._equilibrium(shape, pairs)

    def _equilibrium(self, shape: Pore, tied: np.ndarray,
                     placed: np.ndarray | None = None) -> Pore:
        """The equilibrium with tied pairs (k, 2).

        placed: (j, 2) pairs whose nodes are prescribed half way between them, None for no pairs.
        """
        grown = self.grown
        mesh = grown.mesh
        union = Union.of(mesh, self._regions, tied)
        seen = [shape.focused(number) for number in self.pair]
        prescribed, target = self._prescribed(seen)
        if placed is not None:
            prescribed[placed] = True
            target[placed] = shape.mesh.points[placed].mean(axis=1)[:, None]
        nodes = union.nodes
        inside = np.union1d(*[region.nodes for region in self._regions])
        forces = None if self.forces is None else union.summed(inside, self.forces[inside])
        target_J = [grown.bodies[number].strained[1] for number in self.pair]
        rest = growth.equilibrium(
            self._solid(union), mesh.by_triangle(target_J, self._regions),
            shape.mesh.points[nodes], shape.pressure[nodes[: union.corners]], prescribed[nodes],
            target[nodes], forces=forces, supports=self._supports(seen, union),
            modified_newton=self.mechanics.numerics.scheme.modified_newton, patient=self.patient)
        self._iterations += rest.iterations
        for number, region in zip(self.pair, self._regions):
            shape = shape.focused(number).placed(rest.position[union.number[region.nodes]],
                                                 rest.pressure[union.number[region.corner_nodes]])
        return shape

    def _solid(self, union: Union) -> WeldedSolid:
        """The welded aggregates, with each triangle in the reference of its own aggregate."""
        mesh = self.grown.mesh
        reference = mesh.points.copy()
        in_triangles = []
        for region, number in zip(self._regions, self.pair):
            own = self.grown.bodies[number].strained[0].reference
            in_triangles.append(own[region.own_cells])
            reference[region.nodes] = own
        shape = Shape(union.cells, union.corners, self.grown.space.gradient_degree,
                      mesh.topology.method)
        energy = self.grown.bodies[self.pair[0]].solid.energy
        return WeldedSolid(shape, reference[union.nodes], energy=energy,
                           in_triangles=mesh.by_triangle(in_triangles, self._regions))

    def _prescribed(self, seen: Sequence[Pore]) -> tuple[np.ndarray, np.ndarray]:
        """(N, 2) True where a coordinate of a node is prescribed, and (N, 2) um, positions of the
        nodes with these coordinates; seen: the shape with its focus on each aggregate."""
        mesh = self.grown.mesh
        prescribed = np.zeros((len(mesh.points), 2), bool)
        target = seen[0].mesh.points.copy()
        for number, region, shape in zip(self.pair, self._regions, seen):
            locked, places = constraints(self.grown.focused(number), shape)
            prescribed[region.nodes] |= locked
            target[region.nodes] = np.where(locked, places, target[region.nodes])
        return prescribed, target

    def _supports(self, seen: Sequence[Pore], union: Union) -> list[Support]:
        """The supports of all contact surfaces; seen: as for :meth:`_prescribed`."""
        supports = []
        for number, region, shape in zip(self.pair, self._regions, seen):
            solid, _ = self.grown.bodies[number].strained
            supports += [Support(int(union.number[region.nodes[support.point]]),
                                 union.summed(region.nodes, support.load))
                         for support in surface_supports(solid, shape)]
        return supports

    def _closing(self, shape: Pore, number: int) -> np.ndarray:
        """(M,) wall that each node of an aggregate must join next, or FREE; only entire arcs join.

        A film at a wall without contact stays open, because it ends the run.
        """
        seen = shape.focused(number)
        outline = seen.boundary
        keys = self.mechanics.keys
        touched = tuple(wall for wall in seen.walls if (outline.wall == wall.number).any())
        wall = closing_nodes(outline, touched, keys.minimum_film, keys.minimum_contact_angle)
        if outline.geometry == 2:
            middles = wall[1::2]
            before = np.where(middles != FREE, middles, wall[::2])
            wall[::2] = np.where(before != FREE, before, np.roll(middles, 1))
        return wall

    def _marked(self, shape: Pore) -> Pore:
        """The pore with the nodes that have joined marked as welded."""
        for number, loop, tied in zip(self.pair, self._loops, self._tied().T):
            seen = shape.focused(number)
            weld = welds.weld_of(seen.body.wall)
            marked = seen.with_body(wall=np.where(np.isin(loop, tied), weld, seen.body.wall))
            shape = with_new_surfaces(marked)
        return shape.focused(None)
