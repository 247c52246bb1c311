"""Welding of two aggregates: their surfaces join, and move together from then on.

The welded aggregates are one elastic body with two references. They share the positions and the
pressures of the nodes of the weld. Each triangle keeps the reference and the theta of its own
aggregate, so both aggregates keep the strain that they had before. A film between them closes by
the same rule as a film at a wall (2.3.3): the gap must be at least min(film, tan(angle) d), where d
is the distance from the end of the weld along the middle line of the film. Pairs of opposite nodes
(:mod:`repro.fem.welds`) join, one after the other, until no film is too thin. The two nodes of a
pair first move to the point half way between them, and then to equilibrium. Corners beside contact
lines join a wall in the same search (:class:`Front`). The last arcs that have joined are divided
where welds and contacts may end without a film that is too thin.

Welded aggregates land on a wall that none of them touches (:func:`land`).
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import cached_property
from math import ceil, inf, log2
from typing import ClassVar

import numpy as np

from repro.errors import GrowthError, LinearError, MeshError
from repro.fem import welds
from repro.fem.division import Division
from repro.fem.forms import Basis, basis
from repro.fem.mesh import Mesh, Region
from repro.fem.outline import Outline
from repro.fem.walls import FREE, WELD, Wall, numbered, touched
from repro.model import growth, remeshing
from repro.model.closing_by_lines import FIRST_LENGTHS, divided
from repro.model.contact_lines import (
    ANGLE_FROM,
    AT_PLACES,
    CLOSE,
    MEET,
    PART_OF_ANGLE,
    ROUND_OFF,
    Advances,
    Clearance,
    Contact,
    surface_ends,
)
from repro.model.mechanics import (
    CONTACT_ROUNDS,
    Expansion,
    Mechanics,
    constraints,
)
from repro.model.pore import Pore
from repro.model.remeshing import Remeshing
from repro.model.solid import Shape, Solid
from repro.model.support import Support, lengths_along

#: The last arc of a weld or a contact is halved until a part is shorter than this times
#: numerics.tolerance of the arc: a sixteenth in ``fast``. Lengths then err by 0.8 % or less, and by
#: up to 1.4 % with an eighth (``coupling-weld``).
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
    """The pore after two aggregates have met and joined; pair: their indices.

    The weld begins at the nearest points, and extends by the thickness of the least film on each
    side. If both aggregates touch a wall, it extends from this wall. If there is no equilibrium
    with this length, the weld has half of it, or a quarter. speed: as for
    :func:`remeshing.remesh`. Raises GrowthError, LinearError or MeshError.
    """
    return _with_first_length(mechanics, rules, pore, speed, pair[0],
                              lambda length: _facing(rules, pore, pair, speed, length))


def land(mechanics: Mechanics, rules: Remeshing, pore: Pore, place: tuple[int, int],
         speed: float) -> Pore:
    """The pore after a welded aggregate has touched a wall; place: its index and the wall's number.

    Contact begins at the nearest point, and extends as a new weld does. Arguments and errors are
    otherwise those of :func:`join`.
    """
    return _with_first_length(mechanics, rules, pore, speed, place[0],
                              lambda length: _landing(rules, pore, place, speed, length))


def _with_first_length(mechanics: Mechanics, rules: Remeshing, pore: Pore, speed: float,
                       number: int, begin: Callable[[float], Pore]) -> Pore:
    """The pore with a new weld or a new contact of the aggregate with the index ``number``.

    begin: begin(length) returns the pore on a new mesh. The mesh has the first node of the weld or
    the contact, and a corner at this length (um) on each side of the node. Other arguments are
    those of :func:`join`.
    """
    for length in mechanics.keys.minimum_film * FIRST_LENGTHS:
        try:
            start = begin(length)
            group = start.group_of(number)
            shape = Welding(mechanics, start, start, group, reach=length).close()
            return remeshing.remesh(rules, start, shape.pore, speed)[0]
        except (GrowthError, LinearError, MeshError) as error:
            failure = error
    raise failure


def _facing(rules: Remeshing, pore: Pore, pair: tuple[int, int], speed: float,
            length: float) -> Pore:
    """The pore with the first node of a weld of two aggregates (:func:`_with_first_length`)."""
    outlines = list(pore.outlines)
    weld = WELD + max([0, *(number for each in outlines for number in welds.welds_of(each.wall))])
    first, second = pair
    wall, = pore.common_walls(pair) or (FREE,)
    outlines[first], outlines[second] = welds.facing(
        outlines[first], outlines[second], length, weld, wall)
    facing, _ = remeshing.remesh(rules, pore, pore, speed, outlines=outlines)
    return with_one_point(facing, facing.group_of(first))


def _landing(rules: Remeshing, pore: Pore, place: tuple[int, int], speed: float,
             length: float) -> Pore:
    """The pore with the first node on a wall (:func:`_with_first_length`), still off the wall."""
    number, wall = place
    outlines = list(pore.outlines)
    outlines[number], point = welds.landing(outlines[number], numbered(pore.mesh.walls, wall),
                                            length)
    landing, _ = remeshing.remesh(rules, pore, pore, speed, outlines=outlines)
    outline = landing.outlines[number]
    numbers = outline.wall.copy()
    numbers[np.linalg.norm(outline.points - point, axis=1).argmin()] = wall
    return landing.focused(number).with_body(wall=numbers).focused(None)


def with_one_point(pore: Pore, group: Sequence[int]) -> Pore:
    """The pore with one fixed point on each wall that welded aggregates touch (2.3.3).

    Their contact surfaces with one wall are one surface. It keeps its only fixed point. If it has
    none or two, the corner nearest to its middle becomes the fixed point.
    """
    fixed = {number: pore.bodies[number].fixed for number in group}
    for wall in pore.mesh.walls:
        on = {number: pore.outlines[number].touches(wall.number) for number in group}
        points = sum(np.count_nonzero(fixed[number] & on[number]) for number in group)
        if points == 1 or not (wall.keeps_point and any(each.any() for each in on.values())):
            continue
        x = {number: np.where(on[number], pore.outlines[number].points[:, 0], np.nan)
             for number in group}
        along = np.concatenate([each[::pore.mesh.geometry] for each in x.values()])
        middle = 0.5 * (np.nanmin(along) + np.nanmax(along))
        nearest = along[np.nanargmin(np.abs(along - middle))]
        chosen = next(number for number in group if (x[number] == nearest).any())
        for number in group:
            fixed[number] = np.where(on[number], (number == chosen) & (x[number] == nearest),
                                     fixed[number])
    bodies = [replace(body, fixed=fixed.get(number, body.fixed))
              for number, body in enumerate(pore.bodies)]
    return replace(pore, bodies=tuple(bodies))


@dataclass(eq=False, kw_only=True)
class Front(ABC):
    """The water at one end of a weld, or beside a contact line.

    sides: the aggregates beside it, as indices into their group; size: number of nodes from corner
    to corner; new: has the weld or the contact just begun? joined: number of corners beyond the old
    line that have joined, in the present trial; last_too_few: largest number for which a film is
    too thin; first_enough: smallest number for which no film is too thin; step: the next trial has
    at most this many corners fewer.
    """

    new: bool
    joined: int = 0
    first_enough: float = inf
    step: float = 1.0
    sides: tuple[int, ...]
    size: int
    no_more_corners: ClassVar[str]

    def __post_init__(self) -> None:
        self.last_too_few = self.joined - 1

    @property
    @abstractmethod
    def nodes(self) -> np.ndarray:
        """(k, sides) nodes of the mesh beyond the line, on each side."""

    @property
    def joined_nodes(self) -> np.ndarray:
        """(j, sides) nodes that have joined."""
        return self.nodes[: self.size * self.joined + 1]

    @property
    def _last(self) -> int:
        """The largest number of corners that may join."""
        return (len(self.nodes) - 1) // self.size - 1

    def advance(self, points: np.ndarray) -> None:
        """Go to the next trial; points: (N, 2) um, of the mesh in the present trial.

        While a film is too thin, at least one more corner joins (:meth:`predict`). Then fewer
        corners join, until the smallest number without a thin film is known. Raises GrowthError if
        no further corner can join.
        """
        if not self.too_thin(points, self.joined):
            self.first_enough = self.joined
        else:
            self.last_too_few = self.joined
            if self.first_enough <= self.joined:  # another front has moved since
                self.first_enough, self.step = inf, 1.0
        if self.first_enough < inf:
            middle = int(self.last_too_few + self.first_enough + 1) // 2
            self.joined = max(middle, int(self.first_enough) - int(self.step))
            self.step *= 1.5
        else:
            self.join_next()
            self.predict(points)

    def join_next(self) -> None:
        """Join one more corner. Raises GrowthError if there is none."""
        if self.joined == self._last:
            raise GrowthError(self.no_more_corners)
        self.joined += 1

    def predict(self, points: np.ndarray) -> None:
        """Join one corner fewer than would close all thin films of a shape.

        points: (N, 2) um, nodes of its mesh. A joined corner opens the films beside it, so the last
        corner is usually not needed.
        """
        joined = self.joined
        while joined < self._last and self.too_thin(points, joined):
            joined += 1
        self.joined = max(joined - 1, self.joined)

    @abstractmethod
    def too_thin(self, points: np.ndarray, joined: int) -> bool:
        """Is a film thinner than the rule requires, if a number of corners have joined?

        points: (N, 2) um, nodes of the mesh.
        """


@dataclass(eq=False)
class Notch(Front):
    """The water at one end of a weld.

    weld: its number; pairs: (k, 2) opposite nodes of the mesh, from the line on; before: (k, 2, 2)
    um, their positions in the old shape; film: least film (um); slope: tangent of the least angle.
    """

    weld: int
    pairs: np.ndarray
    before: np.ndarray
    film: float
    slope: float
    no_more_corners: ClassVar[str] = ("the weld advances beyond the nodes that are opposite each "
                                      "other")

    @property
    def nodes(self) -> np.ndarray:
        """(k, 2) pairs of opposite nodes."""
        return self.pairs

    def too_thin(self, points: np.ndarray, joined: int) -> bool:
        """Is a film between the aggregates too thin? Close to the line the rule requires less, as
        in :mod:`repro.model.contact_lines`."""
        free = self.pairs[self.size * joined:]
        one, two = _along_arcs(points[free])
        before = _along_arcs(self.before[self.size * joined:])
        along = np.cumsum(np.linalg.norm(np.diff(0.5 * (one + two), axis=0), axis=1))
        tangent = np.gradient(before.mean(axis=0), axis=0)
        normal = np.column_stack([-tangent[:, 1], tangent[:, 0]])
        normal /= np.linalg.norm(normal, axis=1)[:, None]
        across = np.einsum("ki,ki->k", normal, before[1] - before[0])
        normal *= np.sign(across[1])
        gap = np.einsum("ki,ki->k", normal, two - one)[1:]
        needs = np.minimum(self.film, self.slope * along)
        needs[along < ANGLE_FROM * (1 - ROUND_OFF) * self.film / self.slope] *= PART_OF_ANGLE
        return bool((gap < needs).any())


@dataclass(eq=False)
class WallLine(Front):
    """The water beside a contact line of a welded aggregate.

    wall: the wall; outline: of the aggregate in the old shape; walk: (k,) its nodes from the line
    on; direction: 1 or -1, along the outline; loop: (M,) nodes of the mesh on the outline; rule:
    for films at the walls.
    """

    wall: Wall
    outline: Outline
    walk: np.ndarray
    direction: int
    loop: np.ndarray
    rule: Clearance
    no_more_corners: ClassVar[str] = MEET

    @property
    def nodes(self) -> np.ndarray:
        """(k, 1) nodes of the mesh beyond the line."""
        return self.loop[self.walk, None]

    def marked(self, numbers: np.ndarray, joined: int) -> np.ndarray:
        """Numbers (M,) of the outline's nodes, after corners have joined the wall."""
        marked = numbers.copy()
        marked[self.walk[1: self.size * joined + 1]] = self.wall.number
        return marked

    def too_thin(self, points: np.ndarray, joined: int) -> bool:
        """Is the clearance beyond the line negative (:class:`Clearance`)?"""
        outline = replace(self.outline, points=points[self.loop],
                          wall=self.marked(self.outline.wall, joined))
        line = int(self.walk[self.size * joined])
        return self.rule.beyond(outline, line, self.direction)[0] < -CLOSE


def _along_arcs(nodes: np.ndarray) -> np.ndarray:
    """(2, p, 2) um, points along both surfaces: the first node, then PLACES of each arc.

    nodes: (k, 2, 2) um, of the arcs of both surfaces.
    """
    arcs = np.stack([nodes[:-2:2], nodes[1:-1:2], nodes[2::2]], axis=1)
    points = np.einsum("ta,kasi->skti", AT_PLACES[1:], arcs).reshape(2, -1, 2)
    return np.concatenate([nodes[None, 0].swapaxes(0, 1), points], axis=1)


@dataclass(frozen=True, eq=False)
class Union:
    """The nodes of welded aggregates, with the two nodes of a tied pair as one.

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
        """The union of the aggregates in regions of a mesh; tied: (k, 2) pairs of nodes."""
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
    """Closing of the films between aggregates that are welded, or that have just met.

    grown: the pore with its new theta, in the old shape; start: a pore on the same mesh with the
    shape and pressure from which the search starts; group: indices of the aggregates; forces:
    (N, 2) um at the nodes of the mesh, over mu_L, None for no forces; reach: um, by which a new
    weld extends on each side of its node; patient, within_arcs: as in :class:`SearchOptions`.
    """

    mechanics: Mechanics
    grown: Pore
    start: Pore
    group: tuple[int, ...]
    forces: np.ndarray | None = None
    reach: float = 0.0
    patient: bool = True
    within_arcs: bool = True

    def __post_init__(self) -> None:
        self._iterations = 0
        self._notches = [self._notch(sides, walks) for sides, walks in self._walks()]
        self._lines = list(self._wall_lines())

    @property
    def _fronts(self) -> list[Front]:
        """The ends of welds, then the contact lines."""
        return [*self._notches, *self._lines]

    @property
    def _outlines(self) -> list[Outline]:
        """The boundaries of the aggregates."""
        return [self.grown.outlines[number] for number in self.group]

    @property
    def _loops(self) -> list[np.ndarray]:
        """(M,) nodes of the boundary of each aggregate."""
        return [self.grown.mesh.topology.loops[number] for number in self.group]

    @property
    def _regions(self) -> list[Region]:
        """The regions of the aggregates."""
        return [self.grown.mesh.regions[number] for number in self.group]

    def _walks(self) -> Iterator[tuple[tuple[int, int], Sequence[np.ndarray]]]:
        """The two aggregates of each notch, and the nodes on both outlines (:func:`welds.notches`).
        """
        outlines = self._outlines
        for first, second in welds.pairs([outline.wall for outline in outlines]):
            for walks in welds.notches(outlines[first], outlines[second]):
                yield (first, second), walks

    def _notch(self, sides: tuple[int, int], walks: Sequence[np.ndarray]) -> Notch:
        """The notch between two aggregates; walks: as :meth:`_walks` yields them."""
        mesh = self.grown.mesh
        keys = self.mechanics.keys
        outlines = [self._outlines[side] for side in sides]
        weld = welds.common(*outlines)
        new = np.count_nonzero(outlines[0].welded(weld)) == 1
        walks = welds.in_notch(outlines, walks, keys.minimum_film)
        joined = self._within_reach(outlines[0], walks[0]) if new else 0
        pairs = np.column_stack([self._loops[side][walk] for side, walk in zip(sides, walks)])
        pairs = pairs[: self._before_valley(mesh.points[pairs]) + 1]
        return Notch(weld, pairs, mesh.points[pairs], keys.minimum_film,
                     np.tan(keys.minimum_contact_angle), sides=sides, size=mesh.geometry, new=new,
                     joined=joined)

    def _wall_lines(self) -> Iterator[WallLine]:
        """The contact lines beside which there is a free surface."""
        mesh = self.grown.mesh
        keys = self.mechanics.keys
        rule = Clearance(mesh.walls, keys.minimum_film, keys.minimum_contact_angle,
                         self.mechanics.numerics.tolerance)
        for side, (outline, loop) in enumerate(zip(self._outlines, self._loops)):
            for wall in mesh.walls:
                new = np.count_nonzero(outline.touches(wall.number)) == 1
                for node, direction in surface_ends(outline, wall.number):
                    if outline.wall[node] == wall.number:  # no weld begins there
                        walk = outline.free_walk(node, direction)
                        joined = self._within_reach(outline, walk) if new else 0
                        yield WallLine(wall, outline, walk, direction, loop, rule, sides=(side,),
                                       size=mesh.geometry, new=new, joined=joined)

    def _within_reach(self, outline: Outline, walk: np.ndarray) -> int:
        """Number of corners from the first node of a walk to the one nearest to ``reach``."""
        return int(np.abs(welds.lengths_from(outline, walk) - self.reach).argmin())

    def _before_valley(self, nodes: np.ndarray) -> int:
        """Index of the last pair of corners that may join; nodes: (k, 2, 2) um, opposite pairs.

        A film behind thicker water does not close, because the water would be enclosed. It ends the
        run instead (:mod:`repro.march.ends`), unless even the thicker water is a film that closes.
        """
        film = np.linalg.norm(nodes[:, 1] - nodes[:, 0], axis=1)
        thicker = 1 + self.mechanics.numerics.tolerance
        least = thicker * np.maximum(film, self.mechanics.keys.minimum_film)
        behind = np.maximum.accumulate(film) > least
        last = int(np.argmax(film[: np.argmax(behind)])) if behind.any() else len(film) - 1
        return last - last % self.grown.mesh.geometry

    def equilibrium(self) -> Pore:
        """The equilibrium with the weld and the contact of ``start``."""
        return self._equilibrium(self.start, self._tied())

    def close(self) -> Expansion:
        """The shape in which no film between the aggregates and no wedge at a wall is too thin.

        Raises GrowthError if there is no equilibrium or the weld does not come to rest.
        """
        shape = self.grown  # other aggregates have their new shapes there
        for number, region in zip(self.group, self._regions):
            shape = shape.focused(number).placed(self.start.mesh.points[region.nodes],
                                                 self.start.pressure[region.corner_nodes])
        tied = np.concatenate([np.empty((0, 2), int),
                               *(notch.joined_nodes for notch in self._notches if not notch.new)])
        for front in self._fronts:
            if not front.new:
                front.predict(shape.mesh.points)
        equilibria: dict[tuple[int, ...], Pore] = {}
        for _ in range(CONTACT_ROUNDS):
            joins = tuple(front.joined for front in self._fronts)
            shape = equilibria[joins] if joins in equilibria else self._joined(shape, tied)
            equilibria[joins] = shape
            tied = self._tied()
            for front in self._fronts:
                front.advance(shape.mesh.points)
            if joins == tuple(front.joined for front in self._fronts):
                return self._within_arcs(shape)
        raise GrowthError(f"the weld or its contact lines still move after {CONTACT_ROUNDS} rounds")

    def _within_arcs(self, shape: Pore) -> Expansion:
        """The shape with each end of a weld and each contact line within the last arcs that joined.

        shape: the equilibrium with these arcs. It is the result if ``within_arcs`` is False, if an
        equilibrium with divided arcs fails, or if no division leaves films that are thick enough.
        """
        entire = Expansion(self._marked(shape), self._iterations, advances=self._advances)
        inside = [k for k, front in enumerate(self._fronts) if front.joined and not front.new]
        if not (inside and self.within_arcs):
            return entire
        too_short = np.zeros(len(inside))
        enough = np.ones(len(inside))
        rounds = ceil(-log2(ARC_PART * self.mechanics.numerics.tolerance))
        longer = 0.5**rounds
        with suppress(GrowthError, LinearError):
            for _ in range(rounds):
                t = 0.5 * (too_short + enough)
                thin = self._ending_at(shape, inside, t)[0][inside]
                too_short = np.where(thin, t, too_short)
                enough = np.where(thin, enough, t)
            while (within := enough < 1).any():
                shorter = [k for k, each in zip(inside, within) if each]
                thin, expansion = self._ending_at(shape, shorter, enough[within])
                if not thin.any():
                    return expansion
                enough[within] += longer * thin[shorter]  # another one has become shorter since
                longer *= 2
                if others := [k for k in np.flatnonzero(thin) if k not in shorter]:
                    tied = self._tied()
                    for k in others:
                        self._fronts[k].join_next()
                    return self._within_arcs(self._joined(shape, tied))
        return replace(entire, iterations=self._iterations)

    def _ending_at(self, shape: Pore, inside: Sequence[int],
                   t: np.ndarray) -> tuple[np.ndarray, Expansion]:
        """For each front, is a film too thin if some of them lie within their last arcs?

        Also returns the equilibrium. Arguments are those of :meth:`_divided`.
        """
        trial, start, divisions = self._divided(shape, inside, t)
        rest = trial._equilibrium(start, trial._tied())
        self._iterations += trial._iterations
        thin = np.array([front.too_thin(rest.mesh.points, front.joined)
                         for front in trial._fronts])
        return thin, Expansion(trial._marked(rest), self._iterations, divisions=divisions,
                               advances=trial._advances)

    def _divided(self, shape: Pore, inside: Sequence[int],
                 t: np.ndarray) -> tuple[Welding, Pore, tuple[Division, ...]]:
        """The closing on a mesh with the last arcs of fronts divided, and the shape on this mesh.

        inside: indices of the fronts; t: where their arcs are divided, from the line to the free
        surface.
        """
        grown = self.grown
        points = shape.mesh.points
        pressure = shape.pressure
        forces = self.forces
        divisions = []
        for side, number in enumerate(self.group):
            own = [self._last_arc(k, side, part) for k, part in zip(inside, t)
                   if side in self._fronts[k].sides]
            if not own:
                continue
            arcs, at = zip(*own)
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
        for k, (notch, (sides, walks)) in enumerate(zip(self._notches, trial._walks())):
            nodes = len(notch.pairs) + notch.size * (k in inside)
            pairs = np.column_stack([trial._loops[side][walk[:nodes]]
                                     for side, walk in zip(sides, walks)])
            trial._notches[k] = replace(notch, pairs=pairs, before=grown.mesh.points[pairs])
        for line, own_line in zip(self._lines, trial._lines, strict=True):
            own_line.joined = line.joined
        return trial, start, tuple(divisions)

    def _last_arc(self, k: int, side: int, t: float) -> tuple[int, float]:
        """The last joined arc of a front on one outline, and the place along the loop that is
        ``t`` along the arc from the line."""
        front = self._fronts[k]
        middle, end = front.joined_nodes[-2:, front.sides.index(side)]
        loop = self._loops[side]
        node = int(np.flatnonzero(loop == middle)[0])
        forward = loop[(node + 1) % len(loop)] == end
        return node // 2, t if forward else 1 - t

    def _tied(self) -> np.ndarray:
        """(k, 2) nodes of all pairs that have joined."""
        return np.concatenate([notch.joined_nodes for notch in self._notches])

    @property
    def _advances(self) -> Advances:
        """{(index of the aggregate, wall, direction): um}, advances of the contact lines."""
        return {(self.group[line.sides[0]], line.wall.number, line.direction):
                float(welds.lengths_from(line.outline, line.walk)[line.joined])
                for line in self._lines}

    def _walls(self) -> list[np.ndarray]:
        """(M,) number of each aggregate's nodes, after corners have joined walls."""
        walls = [outline.wall for outline in self._outlines]
        for line in self._lines:
            side, = line.sides
            walls[side] = line.marked(walls[side], line.joined)
        return walls

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
        seen = [shape.focused(number).with_body(wall=wall)
                for number, wall in zip(self.group, self._walls())]
        prescribed, target = self._prescribed(seen)
        if placed is not None:
            prescribed[placed] = True
            target[placed] = shape.mesh.points[placed].mean(axis=1)[:, None]
        nodes = union.nodes
        inside = np.unique(np.concatenate([region.nodes for region in self._regions]))
        forces = None if self.forces is None else union.summed(inside, self.forces[inside])
        target_J = [grown.bodies[number].strained[1] for number in self.group]
        rest = growth.equilibrium(
            self._solid(union), mesh.by_triangle(target_J, self._regions),
            shape.mesh.points[nodes], shape.pressure[nodes[: union.corners]], prescribed[nodes],
            target[nodes], forces=forces, supports=self._supports(seen, union),
            modified_newton=self.mechanics.numerics.scheme.modified_newton, patient=self.patient)
        self._iterations += rest.iterations
        for number, region in zip(self.group, self._regions):
            shape = shape.focused(number).placed(rest.position[union.number[region.nodes]],
                                                 rest.pressure[union.number[region.corner_nodes]])
        return shape

    def _solid(self, union: Union) -> WeldedSolid:
        """The welded aggregates, with each triangle in the reference of its own aggregate."""
        mesh = self.grown.mesh
        reference = mesh.points.copy()
        in_triangles = []
        for region, number in zip(self._regions, self.group):
            own = self.grown.bodies[number].strained[0].reference
            in_triangles.append(own[region.own_cells])
            reference[region.nodes] = own
        shape = Shape(union.cells, union.corners, self.grown.space.gradient_degree,
                      mesh.topology.method)
        energy = self.grown.bodies[self.group[0]].solid.energy
        return WeldedSolid(shape, reference[union.nodes], energy=energy,
                           in_triangles=mesh.by_triangle(in_triangles, self._regions))

    def _prescribed(self, seen: Sequence[Pore]) -> tuple[np.ndarray, np.ndarray]:
        """(N, 2) True where a coordinate of a node is prescribed, and (N, 2) um, positions of the
        nodes with these coordinates; seen: the shape with its focus on each aggregate."""
        mesh = self.grown.mesh
        prescribed = np.zeros((len(mesh.points), 2), bool)
        target = seen[0].mesh.points.copy()
        for number, region, shape in zip(self.group, self._regions, seen):
            locked, places = constraints(self.grown.focused(number), shape)
            prescribed[region.nodes] |= locked
            target[region.nodes] = np.where(locked, places, target[region.nodes])
        return prescribed, target

    def _supports(self, seen: Sequence[Pore], union: Union) -> list[Support]:
        """The supports of all contact surfaces; seen: as for :meth:`_prescribed`."""
        supports = []
        for wall in self.grown.mesh.walls:
            lengths = np.zeros(len(union.nodes))
            points = []
            for number, region, shape in zip(self.group, self._regions, seen):
                outline = shape.boundary
                solid, _ = self.grown.bodies[number].strained
                edges = region.own_loop[outline.edges_on(wall.number)]
                lengths += union.summed(region.nodes, lengths_along(edges, solid.reference))
                fixed = outline.fixed & outline.touches(wall.number)
                points.extend(union.number[region.loop[fixed]].tolist())
            if lengths.any() and points:
                supports.append(Support(points[0], lengths / lengths.sum()))
        return supports

    def _marked(self, shape: Pore) -> Pore:
        """The pore with the numbers of all nodes that have joined."""
        for side, (number, loop, wall) in enumerate(zip(self.group, self._loops, self._walls())):
            for notch in self._notches:
                if side in notch.sides:
                    joined = np.isin(loop, notch.joined_nodes[:, notch.sides.index(side)])
                    wall = np.where(joined, touched(wall) + notch.weld, wall)
            shape = shape.focused(number).with_body(wall=wall)
        return with_one_point(shape.focused(None), self.group)
