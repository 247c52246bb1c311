"""Closing of films on curved elements: contact lines lie anywhere on an arc (2.3.3).

The contact surfaces are the smallest ones that leave no film and no wedge too thin. If the
aggregate already spans the pore, Newton's method (:mod:`repro.model.contact_newton`) solves for
shape and lines at once. A search (:class:`repro.model.contact_lines.Line`) starts the first
contact, and replaces Newton's method if that fails. Each trial of the search is an equilibrium.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from math import inf

import numpy as np

from repro.errors import GrowthError, LinearError, failing_as
from repro.fem.division import Division
from repro.fem.outline import Outline
from repro.fem.space import Space
from repro.fem.walls import FREE, Wall
from repro.model import contact_lines, growth
from repro.model.contact_lines import Advances, Clearance, Contact, Line, contact_with
from repro.model.contact_newton import BESIDE, Coupled, Placed
from repro.model.mechanics import (
    CONTACT_ROUNDS,
    Closing,
    Expansion,
    constraints,
    equilibrium,
    supports_of,
    with_new_surfaces,
)
from repro.model.pore import Pore
from repro.model.solid import Shape, material

#: Largest number of times that contact lines retreat after failed trials.
RETREATS = 6
#: Accepted defect of Newton's method for all parts of theta except the last.
PARTLY = 1e-3
#: Newton's method replaces the search if the next steps of all lines are shorter than this (arcs).
CLOSE_ENOUGH = 0.5
#: Trial lengths of the first contact on each side of the nearest point, over the least film.
FIRST_LENGTHS = np.array([1.0, 0.5, 0.25])


@dataclass(eq=False)
class ByLines(Closing):
    """The closing on arcs.

    Each trial is an equilibrium with the lines at given advances. It starts from the last trial,
    extrapolated in the advance of the line that moves most. iterations: of Newton's method so far.
    """

    iterations: int = field(init=False, default=0)

    def __post_init__(self) -> None:
        keys = self.mechanics.keys
        walls = self.grown.walls
        self._rule = Clearance(walls, keys.minimum_film, keys.minimum_contact_angle,
                               self.mechanics.numerics.tolerance)
        self._start = self.start.mesh.points, self.start.pressure
        self._trials = [(np.zeros(0), *self._start)]
        self._divided: Division | None = None
        self._solid_shape: Shape | None = None

    @property
    def _advances(self) -> dict[tuple[int, int], float]:
        """{(wall, direction): um}, advances of the aggregate's lines in the first trial."""
        number = self.grown.number
        return {key[1:]: length for key, length in self.search.advances.items() if key[0] == number}

    def close(self) -> Expansion:
        grown = self.grown
        search = self.search
        film = self._rule.film
        wall = grown.body.wall
        lines = contact_lines.lines_of(grown.boundary)
        _place_lines(grown.boundary, lines, self._advances)
        gaps = inf, inf
        shape = None
        predicted = grown.body.spans and bool(self._advances)
        if predicted and not search.stationary:
            shape = self.settle(wall, lines)
        if shape is None:
            shape = self.solve(wall, lines)
            gaps = (grown.boundary.gap(self._rule.walls),
                    shape.pore.boundary.gap(self._rule.walls))
            if gaps[1] < film:
                search.refuse_late(gaps, film)
                wall, lines, shape = self._touch(shape)
            if not search.stationary:
                settled = self.settle(wall, lines) if predicted else None
                shape = settled or self._search(wall, lines, shape)
        rest = with_new_surfaces(shape.pore)
        return replace(shape, pore=rest, iterations=self.iterations, gaps=gaps)

    def _search(self, wall: np.ndarray, lines: Sequence[Line], shape: Expansion) -> Expansion:
        """Move lines until all are accepted, or until Newton's method solves for them."""
        settles = True
        for _ in range(CONTACT_ROUNDS):
            outline = shape.pore.boundary
            for line in lines:
                line.record(*self._rule.beyond(outline, line.end_on(outline), line.direction))
            if all(line.accepted for line in lines):
                return shape
            for line in lines:
                if not line.accepted:
                    line.step()
            if settles and all(abs(line.advance - line.trials[-1][0]) < CLOSE_ENOUGH
                               for line in lines):
                settles = False
                settled = self.settle(wall, lines)
                if settled is not None:
                    return settled
            shape = self.solve(wall, lines)
        raise GrowthError(f"the contact lines still move after {CONTACT_ROUNDS} trials")

    def _touch(self, shape: Expansion) -> tuple[np.ndarray, list[Line], Expansion]:
        """The first contact of a shape with the nearest wall: walls (M,), contact lines, and the
        equilibrium with them.

        Contact extends at least one thickness of the least film on each side of the nearest point,
        because a force at a single point would indent an elastic body without limit. If there is
        then no equilibrium because the body is too pointed, contact extends half of this length, or
        a quarter. Raises GrowthError if all lengths fail or if the tip is too thin.
        """
        film = self._rule.film
        outline = replace(self.grown.boundary, points=shape.position[self.grown.region.loop])
        nearest, *_ = outline.untouched(self._rule.walls)
        lengths = film * FIRST_LENGTHS
        width = _tip_width(outline, nearest, film * nearest.part)
        if width < 2 * lengths[-1]:
            raise GrowthError(f"the tip that touches the wall is only {width:.2g} um wide at a "
                              f"depth of {film:.2g} um, the least film; the rule for films (2.3.3) "
                              "does not apply to this thin tip, and no setting helps")
        for length in lengths:
            wall, lines = _first_contact(outline, nearest, length)
            _place_lines(replace(self.grown.boundary, wall=wall), lines, self._advances)
            try:
                return wall, lines, self.solve(wall, lines)
            except (GrowthError, LinearError) as error:
                failure = error
        raise failure

    def solve(self, wall: np.ndarray, lines: Sequence[Line]) -> Expansion:
        """The equilibrium with walls (M,) of the grown pore's outline and the lines' advances.

        If the equilibrium fails, the lines retreat half way to an advance that was too short.
        Raises GrowthError or LinearError if this does not help.
        """
        for _ in range(RETREATS):
            try:
                return self._solve(wall, lines)
            except (GrowthError, LinearError) as error:
                failure = error
                if not [line for line in lines if line.retreat()]:
                    break
        raise failure

    def _solve(self, wall: np.ndarray, lines: Sequence[Line]) -> Expansion:
        advances = np.array([line.advance for line in lines])
        locked, division, forces = self._locked(self.grown, contact_with(wall, lines))
        first = self._first(locked, division, advances)
        shape, iterations = equilibrium(self.mechanics, locked, first, forces,
                                        patient=self.search.patient)
        self.iterations += iterations
        divisions = () if division is None else (division,)
        expansion = Expansion(shape, iterations, divisions=divisions,
                              advances=self._lengths(wall, lines))
        trial = advances, expansion.position, shape.pressure[: self.grown.mesh.corners]
        self._trials = [*self._trials[-1:], trial]
        return expansion

    def settle(self, wall: np.ndarray, lines: Sequence[Line]) -> Expansion | None:
        """Equilibrium with walls (M,) of the grown pore's outline and lines at zero clearance.

        Newton's method solves for shape and lines at once. If it fails, the result is None, and the
        lines do not change. Theta goes to its target in parts, as in :func:`growth.equilibrium`.
        """
        start = [line.advance for line in lines]
        grown = self.grown
        solid, target_J = grown.body.strained
        points, pressures = self._trials[-1][1:]
        J = solid.strained(points[grown.region.nodes]).J
        try:
            for part in _parts(target_J / J):
                theta = grown.body.theta * (J / target_J) ** (1 - part)
                partly = grown.with_body(theta=theta)
                coupled = Coupled(partial(self._place, partly, wall, lines), lines, points,
                                  pressures)
                coupled.solve(growth.NEWTON if part == 1 else PARTLY)
                self.iterations += coupled.iterations
                points, pressures = coupled.placed.on_parent(coupled.position, coupled.pressure)
        except (GrowthError, LinearError, np.linalg.LinAlgError):
            for line, advance in zip(lines, start):
                line.advance = advance
            return None
        placed = coupled.placed
        shape = placed.pore.placed(coupled.position, coupled.pressure)
        divisions = () if placed.division is None else (placed.division,)
        return Expansion(shape, self.iterations, divisions=divisions,
                         advances=self._lengths(wall, lines))

    def _lengths(self, wall: np.ndarray, lines: Sequence[Line]) -> Advances:
        """{(number, wall, direction): um}, the advances of the lines."""
        outline = replace(self.grown.boundary, wall=wall)
        return {(self.grown.number, *line.key): contact_lines.to_length(outline, line)
                for line in lines}

    def _place(self, grown: Pore, wall: np.ndarray, lines: Sequence[Line]) -> Placed:
        """A grown pore with lines at their advances."""
        locked, division, forces = self._locked(grown, contact_with(wall, lines))
        solid, theta = locked.body.strained
        reference = grown.mesh.from_region(grown.region, grown.body.unstrained)
        prescribed, target = constraints(locked, locked)
        system = growth.System(solid, prescribed, forces=forces,
                               supports=supports_of(solid, locked, forces))
        return Placed(grown, locked, division, reference, system, theta, target, self._rule)

    def _locked(self, grown: Pore, contact: Contact) -> tuple[Pore, Division | None,
                                                              np.ndarray | None]:
        """A grown pore with a contact, its division, and the forces on its nodes.

        If the same arcs are divided as in the last call, its connections are reused.
        """
        if not len(contact.arcs):
            return grown.with_body(wall=contact.wall), None, self.forces
        if self._divided is not None and np.array_equal(self._divided.arcs, contact.arcs):
            self._divided = self._divided.at(contact.t)
        else:
            self._divided = Division(self.grown.mesh, contact.arcs, contact.t, self.grown.number)
            self._solid_shape = None
        division = self._divided
        locked = divided(grown, division, contact, self._solid_shape)
        self._solid_shape = locked.body.solid.shape
        if self.forces is None:
            return locked, division, None
        loads = division.divided_loads(grown.mesh.from_region(grown.region, self.forces))
        return locked, division, loads[locked.region.nodes]

    def _guesses(self, advances: np.ndarray) -> Iterator[tuple[np.ndarray, np.ndarray]]:
        """Positions (N, 2) um and pressures (corners,) from which a trial may start, best first.

        They are the last two shapes, extrapolated in the advance of the line that moves most; the
        last shape; and the start.
        """
        last, points, pressure = self._trials[-1]
        before, points_before, pressure_before = self._trials[0]
        if len(self._trials) == 2 and len(before) == len(advances):
            line = np.argmax(np.abs(last - before))
            if last[line] != before[line]:
                part = (advances[line] - last[line]) / (last[line] - before[line])
                part = min(max(part, -1.0), 1.0)
                yield (points + part * (points - points_before),
                       pressure + part * (pressure - pressure_before))
        yield points, pressure
        yield self._start

    def _first(self, locked: Pore, division: Division | None, advances: np.ndarray) -> Pore:
        """The pore from which a trial starts: the best guess in which no triangle is turned over.

        A divided arc may have a kink where its contact begins. The undivided arc smooths the kink.
        This can turn a triangle over.
        """
        for points, pressure in self._guesses(advances):
            if division is not None:
                points = division.nodal(points)
                pressure = division.at_corners(pressure)
            if locked.body.solid.strained(points[locked.region.nodes]).J.min() > 0:
                break
        return replace(locked.moved(points), pressure=pressure)


def _place_lines(outline: Outline, lines: Sequence[Line],
                 advances: Mapping[tuple[int, int], float]) -> None:
    """Set each line's advance from {(wall, direction): um}, but at least to its least advance."""
    for line in lines:
        length = advances.get(line.key, 0.0)
        line.advance = max(line.least, contact_lines.to_arcs(outline, line, length))
        if 0 < line.advance < contact_lines.LEAST_PART:
            line.advance = BESIDE


def _tip_width(outline: Outline, wall: Wall, depth: float) -> float:
    """Width (um) of the aggregate at a depth (um) behind the point that is nearest to a wall."""
    x = outline.points[:, 0]
    height = -wall.normal * outline.points[:, 1]
    tip = int(np.argmax(height))
    sides = []
    for direction in (1, -1):
        walk = (tip + direction * np.arange(len(x))) % len(x)
        behind = int(np.argmax(height[walk] < height[tip] - depth))
        last = walk[behind - 1 : behind + 1][::-1]
        sides.append(np.interp(height[tip] - depth, height[last], x[last]))
    return float(abs(sides[0] - sides[1]))


def _first_contact(outline: Outline, nearest: Wall,
                   length: float) -> tuple[np.ndarray, list[Line]]:
    """Walls (M,) and contact lines of a first contact.

    The corner next to the nearest point joins the wall. The lines are at a length (um) on each side
    of the nearest point.
    """
    x = outline.points[:, 0]
    _, tip = outline.nearest(nearest)
    arc = int(np.argmin((nearest.normal * outline.arcs(outline.points)[:, :, 1]).min(axis=1)))
    ends = np.array([2 * arc, (2 * arc + 2) % len(x)])
    corner = int(ends[np.argmin(np.abs(x[ends] - tip))])
    wall = outline.wall.copy()
    wall[corner] = nearest.number
    touching = replace(outline, wall=wall)
    lines = contact_lines.lines_of(touching)
    for line in lines:
        if line.wall == nearest.number:
            outwards = np.sign(x[(corner + line.direction) % len(x)] - x[corner])
            advance = length + outwards * (tip - x[corner])
            line.start_from(contact_lines.to_arcs(touching, line, max(advance, 0.0)))
    return wall, lines


@failing_as(GrowthError)
def _parts(growing: np.ndarray) -> np.ndarray:
    """The parts of a growth theta / J (t, q), up to 1."""
    count = growth.GradDiv.parts(growing)
    return np.arange(1, count + 1) / count


def divided(grown: Pore, division: Division, contact: Contact,
            shape: Shape | None = None) -> Pore:
    """The pore on the divided mesh, with the walls of a contact.

    shape: connections of the aggregate on the divided mesh, if known.
    """
    space = Space(division.mesh)
    table = grown.space.table
    body = grown.body
    region = space.mesh.regions[division.number]
    origin = grown.mesh.points.copy()
    origin[grown.region.nodes] = body.reference
    reference = division.nodal(origin)[region.nodes]
    solid = (replace(body.solid, shape=shape, reference=reference) if shape
             else material(space, region, reference, body.solid.energy))
    configuration = body.configuration.carried(lambda positions: division.nodal(
        grown.mesh.from_region(grown.region, positions))[region.nodes])
    expanded = division.amounts(body.theta * body.solid.at.dx, table)
    at_line = np.where(contact.first != FREE, contact.first, contact.second)
    wall = contact.wall.copy()
    wall[2 * contact.arcs + 1] = contact.first
    none = np.zeros(len(contact.arcs), bool)
    locked = grown.with_body(wall=division.along_loop(wall, at_line, contact.second),
                             fixed=division.along_loop(body.fixed, none, none), solid=solid,
                             active=division.amounts(body.active, table),
                             inert=division.amounts(body.inert, table),
                             theta=expanded / solid.at.dx, configuration=configuration)
    return replace(locked, space=space, pressure=division.at_corners(grown.pressure))
