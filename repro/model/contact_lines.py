"""Positions of the contact lines on the aggregate's boundary (2.3.3), for curved triangles.

A contact line is an end of a contact surface. Its advance is the number of arcs of the boundary
that have joined the wall beyond its previous position. A fractional advance divides an arc. The
clearance beyond a line is the minimum over the free surface of

    gap / min(film, tan(angle) d) - 1

where d is the distance from the line along the wall. If the clearance is negative, a film or a
wedge is too thin. Beside the line the surface opens like the square root of d, and the angle of the
first arc depends on the length of this arc. The angle is therefore tested from the distance
ANGLE_FROM film / tan(angle) on. A converged surface comes nearest to the wall beyond this distance.
Closer to the line the rule uses PART_OF_ANGLE tan(angle), so that no arc passes the wall.

The contact surface is the smallest one without a negative clearance, so each line advances until
its clearance vanishes. It does not cross a valley: a second contact would enclose the water of the
valley, and ends the run (:func:`would_enclose`). The secant method, safeguarded by bisection, moves
all lines at once. Each trial is an equilibrium of the aggregate.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from math import inf
from typing import TypeAlias

import numpy as np

from repro.errors import GrowthError
from repro.fem.outline import Outline, arc_derivatives, parabola
from repro.fem.walls import FREE, Wall, Walls, numbered, touched

#: A clearance up to this size counts as zero. A line then errs by about CLOSE * film / tan(angle).
#: With 2e-3 this error was 0.01 um, up to 0.2 % of a short contact length
#: (``growth-gold-contact``). With 1e-4 the first length of ``exact`` errs by 0.07 instead of 0.11
#: %, but the search that replaces Newton's method depends on round-off where it does not reach it.
CLOSE = 5e-4
#: Least distance from a line at which the angle is tested, over film / tan(angle). The converged
#: surfaces of reference/gold come nearest to the wall at 0.31 to 1 of film / tan(angle).
ANGLE_FROM = 0.2
#: Relative round-off of a distance.
ROUND_OFF = 1e-9
#: Closer to the line than ANGLE_FROM, the rule's tan(angle) is multiplied by this. A converged
#: surface is steeper.
PART_OF_ANGLE = 0.1
#: Upper bound of the clearance, and its value if no free surface faces the wall.
AMPLE = 10.0
#: The clearance counts as discontinuous if an advance that is too short and one that is far enough
#: differ by less than this (arcs).
SAME_PLACE = 5e-3
#: Smallest part of a divided arc (arcs).
LEAST_PART = 0.02
#: Length of the first step over the distance to the farthest point that is too near to the wall.
FIRST_TRIAL = 0.7
#: If the first trial goes too far, the second one goes back by this fraction of the interval.
FIRST_RETREAT = 0.2
#: Factor on secant steps until a trial goes far enough.
BEYOND = 1.05
#: Longest step (arcs), until a trial goes far enough, if no surface beyond the line is too near.
LEAST_REACH = 0.5
#: Least distance of a secant step from the ends of the interval, as a fraction of the interval.
INSIDE = 0.03
MEET = "two contact lines meet and trap fluid between them"
#: Parameters of an arc at which the clearance is computed. The second one tests the angle at the
#: line.
PLACES = np.append([0.0, 1e-3], np.linspace(0.0, 1.0, 9)[1:])
AT_PLACES = parabola(PLACES)


#: {(number, wall, direction): advance (um)} of the contact lines of all aggregates.
Advances: TypeAlias = Mapping[tuple[int, int, int], float]


@dataclass(frozen=True)
class SearchOptions:
    """Options of the search for contact lines.

    landing: the search fails if the film at the first contact is thinner than this fraction of the
    least film; stationary: do lines stay at their first trial, and nodes on the walls of the
    start?; patient: is a failed equilibrium tried again in smaller parts?; advances: {(index of the
    aggregate, wall, direction): um along its outline}, first trial of each line; line_size: um,
    size of the triangles beside the lines with the opposite wall, infinite to keep the mesh;
    within_arcs: do welds and their contact lines end within arcs?
    """

    landing: float = 0.0
    stationary: bool = False
    patient: bool = True
    advances: Advances = field(default_factory=dict)
    line_size: float = inf
    within_arcs: bool = True

    def refuse_late(self, gaps: tuple[float, float], film: float) -> None:
        """Raise FirstContact if the second gap is below ``landing`` times the least film.

        gaps: um, before and after the step; film: um, the least film.
        """
        if gaps[1] < self.landing * film:
            raise FirstContact(gaps)


PATIENT = SearchOptions()


class FirstContact(Exception):
    """A step ends too long after the first contact: the film is much thinner than the least film.

    gaps: um, the thickness of the film at the start and at the end of the step.
    """

    def __init__(self, gaps: tuple[float, float]):
        super().__init__(gaps)
        self.gaps = gaps


@dataclass(frozen=True)
class Clearance:
    """The rule for a free surface: walls of the pore, least film (um), least angle (rad).

    tolerance: of :func:`would_enclose`.
    """

    walls: Walls
    film: float
    angle: float
    tolerance: float = 0.0

    def beyond(self, outline: Outline, node: int, direction: int) -> tuple[float, float]:
        """The clearance beyond a contact line, and the distance up to which it is negative.

        Parameters
        ----------
        outline : Outline
            An outline of arcs.
        node : int
            Corner of the outline at the contact line.
        direction : int
            1 or -1: direction along the outline from the line to the free surface.

        Returns
        -------
        clearance : float
            At most AMPLE; AMPLE if no free surface faces the wall.
        reach : float
            Number of arcs from the line to the farthest point with a negative clearance; zero
            without such a point.
        """
        arcs, last = _free_arcs(outline, node, direction)
        outwards = outward_sign(outline, node, direction)
        wall = numbered(self.walls, outline.wall[node])
        # Elsewhere the clearance is AMPLE. An arc lies within its control points.
        ends = wall.film(arcs[:, [0, 2]])
        control = 2 * wall.film(arcs[:, 1]) - ends.mean(axis=1)
        near = np.flatnonzero(np.minimum(ends.min(axis=1), control) < (AMPLE + 1) * self.film)
        line = arcs[0, 0, 0]
        place, points = self._places(arcs[near], near, outwards, line)
        distance = outwards * (points[:, 0] - line)
        gap = wall.film(points)
        needs = np.minimum(self.film, np.tan(self.angle) * distance)
        tested_from = ANGLE_FROM * (1 - ROUND_OFF) * self.film / np.tan(self.angle)
        needs[distance < tested_from] *= PART_OF_ANGLE
        facing = place > 0
        if outline.wall[last] == wall.number:
            # Free surface between two lines of one wall belongs to the nearer line.
            facing &= distance <= np.abs(points[:, 0] - outline.points[last, 0])
        ratio = np.full(len(gap), AMPLE)
        beside = facing & (needs > 0)
        ratio[beside] = np.minimum(gap[beside] / needs[beside] - 1, AMPLE)
        through = facing & (needs <= 0) & (gap < 0)
        ratio[through] = gap[through] / self.film
        if ratio.min() < 0:
            along, gap, _ = surface_beyond(outline, wall, node, direction)
            behind = np.flatnonzero(would_enclose(along, gap, self.film, self.tolerance))
            if len(behind):
                arc, k = divmod(behind[0], len(PLACES))
                ratio[place >= arc + PLACES[k]] = AMPLE
        return float(ratio.min()), float(place[ratio < 0].max(initial=0.0))

    def _places(self, arcs: np.ndarray, numbers: np.ndarray, outwards: float,
                line: float) -> tuple[np.ndarray, np.ndarray]:
        """Points of arcs at which the rule is tested: (K,) arcs from the line, (K, 2) um.

        arcs: (k, 3, 2) um; numbers: (k,) of the arcs, counted from the line; outwards: sign of x
        away from the line; line: um, x of the line. The points are PLACES of each arc, the points
        where the test of the angle begins, and the points where the rule changes from the angle to
        the film.
        """
        points = AT_PLACES @ arcs
        place = numbers[:, None] + PLACES
        places, all_points = [place.ravel()], [points.reshape(-1, 2)]
        nodes = outwards * (arcs[..., 0] - line) * np.tan(self.angle) / self.film
        for change in (ANGLE_FROM, 1.0):
            beyond = nodes @ AT_PLACES.T - change
            arc, k = np.nonzero(beyond[:, :-1] * beyond[:, 1:] < 0)
            part = beyond[arc, k] / (beyond[arc, k] - beyond[arc, k + 1])
            t = PLACES[k] + part * np.diff(PLACES)[k]
            first, second = arc_derivatives(nodes[arc])
            for _ in range(3):  # Newton's method; the interpolated t is close
                error = np.einsum("ka,ka->k", parabola(t), nodes[arc]) - change
                t = t - error / (first + second * t)
            places.append(numbers[arc] + t)
            all_points.append(np.einsum("ka,kai->ki", parabola(t), arcs[arc]))
        return np.concatenate(places), np.vstack(all_points)


def would_enclose(along: np.ndarray, film: np.ndarray, least: float,
                  tolerance: float) -> np.ndarray:
    """(K,) True where contact with a wall would enclose water between a point and a contact line.

    The film there is less than twice the least one, and a circle that touches the wall fits into
    the water before it. The circle's diameter exceeds this film and the least one by more than the
    tolerance. A point with the film h at the distance d along the wall bounds the diameter by
    h + d^2 / h.

    along, film: (K,) um, of a free surface from the line on; along is positive outside the contact
    surface. least: um, least film; tolerance: relative.
    """
    thin = (along > 0) & (film < 2 * least)
    needed = (1 + tolerance) * np.maximum(film, least)
    if not (thin & (np.maximum.accumulate(film) > needed)).any():
        return np.zeros(len(film), bool)
    height = np.maximum(film, ROUND_OFF * least)
    middle, roof = (0.5 * (values[1:] + values[:-1]) for values in (along, film))
    circles = np.minimum(roof, np.min(height + (middle[:, None] - along) ** 2 / height, axis=1))
    thickest = np.maximum.accumulate(np.append(0.0, np.where(middle > 0, circles, 0.0)))
    return thin & (thickest > needed)


def surface_beyond(outline: Outline, wall: Wall, node: int,
                   direction: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(K,) um along the wall, (K,) um film and (K, 2) um of points of the free surface beyond a
    contact line: the PLACES of arcs, or the nodes of straight edges.

    node, direction: of the line, as :func:`surface_ends` returns them.
    """
    if outline.geometry == 1:
        points = outline.points[outline.free_walk(node, direction)]
    else:
        points = (AT_PLACES @ _free_arcs(outline, node, direction)[0]).reshape(-1, 2)
    along = outward_sign(outline, node, direction) * (points[:, 0] - outline.points[node, 0])
    return along, wall.film(points), points


def outward_sign(outline: Outline, node: int, direction: int) -> float:
    """1 or -1, the sign of x away from a contact surface at its end.

    node, direction: of the end, as :func:`surface_ends` returns them.
    """
    inside = (node - direction) % len(outline.points)
    return float(np.sign(outline.points[node, 0] - outline.points[inside, 0]))


def second_contacts(outline: Outline, walls: Walls, least: float,
                    tolerance: float) -> Iterator[tuple[Wall, float, np.ndarray]]:
    """Each wall that the outline would touch in a second place so that water is enclosed
    (:func:`would_enclose`), the least film (um) there, and its point (2,) um on the outline."""
    for wall in walls:
        for node, direction in surface_ends(outline, wall.number):
            along, film, points = surface_beyond(outline, wall, node, direction)
            behind = would_enclose(along, film, least, tolerance)
            last = outline.free_walk(node, direction)[-1]
            if outline.touches(wall.number)[last]:  # points belong to the nearer line
                behind &= along <= np.abs(points[:, 0] - outline.points[last, 0])
            if behind.any():
                thinnest = np.argmin(np.where(behind, film, inf))
                yield wall, float(film[thinnest]), points[thinnest]


def _free_arcs(outline: Outline, node: int, direction: int) -> tuple[np.ndarray, int]:
    """(K, 3, 2) um, nodes of the free arcs beyond a contact line, from the line on; and the index
    of the last node."""
    walk = outline.free_walk(node, direction)
    nodes = outline.points[walk]
    return np.stack([nodes[:-2:2], nodes[1:-1:2], nodes[2::2]], axis=1), int(walk[-1])


def surface_ends(outline: Outline, wall: int) -> list[tuple[int, int]]:
    """(node, direction) of each end of the contact surfaces with a wall. The next node in this
    direction is not on the wall."""
    on = outline.touches(wall)
    if not on.any():
        return []
    last = on & ~np.append(on[1:], on[0])
    first = on & ~np.append(on[-1], on[:-1])
    forward = [(int(i), 1) for i in np.flatnonzero(last)]
    return forward + [(int(i), -1) for i in np.flatnonzero(first)]


@dataclass
class Line:
    """A contact line in a search.

    wall: number of its wall; node: of the outline, at the previous position of the line; direction:
    1 or -1, along the outline from the line to the free surface; advance: arcs, of the present
    trial; accepted: is the present trial accurate enough?; reach: arcs beyond the line up to which
    the surface is too near to the wall; least: smallest allowed advance; last_too_short: largest
    advance known to be too short; first_far_enough: smallest one known to be far enough; stalls:
    has the last trial halved neither the interval between these two nor the clearance?; trials: the
    last two, as (advance, clearance); newton_minimum: smallest advance that Newton's method allows,
    just beyond the last corner at which the line rests or was too short.
    """

    wall: int
    node: int
    direction: int
    advance: float = 0.0
    accepted: bool = False
    reach: float = 0.0
    least: float = 0.0
    last_too_short: float = 0.0
    first_far_enough: float = np.inf
    stalls: bool = False
    trials: list[tuple[float, float]] = field(default_factory=list)
    newton_minimum: float = 0.0

    @property
    def interval(self) -> float:
        """Length (arcs) of the interval that contains the line."""
        return self.first_far_enough - self.last_too_short

    @property
    def key(self) -> tuple[int, int]:
        """Wall and direction. They identify a line of an aggregate."""
        return self.wall, self.direction

    def end_on(self, outline: Outline) -> int:
        """The node at the line in the outline of a trial."""
        ends = surface_ends(outline, self.wall)
        return next(node for node, direction in ends if direction == self.direction)

    def record(self, clearance: float, reach: float) -> None:
        """Update the interval and the trials with the clearance at the present advance."""
        self.reach = reach
        if not self.trials or self.trials[-1][0] != self.advance:
            self.trials = [*self.trials[-1:], (self.advance, clearance)]
        else:
            self.trials[-1] = self.advance, clearance
        too_short = clearance < -CLOSE
        before = self.interval
        worse = len(self.trials) == 2 and abs(clearance) > abs(self.trials[0][1]) / 2
        if too_short:
            self.last_too_short = self.advance
            # If another line has moved since, an advance that was far enough may be too short.
            if self.first_far_enough <= self.advance:
                self.first_far_enough = np.inf
        else:
            self.first_far_enough = self.advance
            self.last_too_short = min(self.last_too_short, self.advance)
        self.stalls = worse and self.interval > before / 2
        jumps = self.first_far_enough <= max(self.last_too_short + SAME_PLACE,
                                             self.least + LEAST_PART)
        smallest = self.advance <= self.least
        self.accepted = not too_short and (smallest or clearance <= CLOSE or jumps)

    def start_from(self, advance: float) -> None:
        """Set the smallest allowed advance and the first trial to an advance (arcs)."""
        self.least = advance
        self.last_too_short = advance
        self.advance = advance

    def retreat(self) -> bool:
        """Go half of the way back to ``last_too_short``. Returns whether the line has moved."""
        distance = self.advance - self.last_too_short
        if self.accepted or distance < LEAST_PART:
            return False
        self.advance = self.last_too_short + distance / 2
        return True

    def step(self) -> None:
        """Go to the next trial."""
        if self.first_far_enough == np.inf:
            most = self.advance + max(self.reach, LEAST_REACH)
            least = self.advance + LEAST_PART
            self.advance = min(max(self._secant(BEYOND), least), most)
        elif self.stalls:
            self.advance = (self.last_too_short + self.first_far_enough) / 2
        else:
            margin = INSIDE * self.interval
            self.advance = min(max(self._secant(1.0), self.last_too_short + margin),
                               self.first_far_enough - margin)

    def _secant(self, factor: float) -> float:
        """The advance (arcs) at the root of the secant through the last two trials.

        factor: of the step to the root. With one trial, or if the secant falls, FIRST_TRIAL or
        FIRST_RETREAT determines the step.
        """
        advance, clearance = self.trials[-1]
        if len(self.trials) == 2:
            before, clearance_before = self.trials[0]
            rise = (clearance - clearance_before) / (advance - before)
            if rise > 0:
                return advance - factor * clearance / rise
        if self.first_far_enough == np.inf:
            return advance + FIRST_TRIAL * self.reach
        return self.first_far_enough - FIRST_RETREAT * self.interval


def arc_ends(outline: Outline, line: Line) -> np.ndarray:
    """(K + 1,) um, ends of the K free arcs beyond a line, measured along the chords."""
    arcs, _ = _free_arcs(outline, line.node, line.direction)
    chords = np.linalg.norm(arcs[:, 2] - arcs[:, 0], axis=1)
    return np.concatenate([[0.0], np.cumsum(chords)])


def to_length(outline: Outline, line: Line) -> float:
    """The advance of a line as a length (um) along its previous outline."""
    ends = arc_ends(outline, line)
    return float(np.interp(line.advance, np.arange(len(ends)), ends))


def to_arcs(outline: Outline, line: Line, length: float) -> float:
    """The advance (arcs) of a line for a length (um) along its previous outline."""
    ends = arc_ends(outline, line)
    return float(np.interp(length, ends, np.arange(len(ends))))


def point_at(outline: Outline, line: Line, length: float) -> np.ndarray:
    """(2,) um, the point at a length (um) beyond a line on its previous outline."""
    arcs, _ = _free_arcs(outline, line.node, line.direction)
    advance = to_arcs(outline, line, length)
    arc = min(int(advance), len(arcs) - 1)
    return parabola(np.array(advance - arc)) @ arcs[arc]


def speeds(advances: Sequence[Advances], number: int, duration: float) -> np.ndarray | None:
    """(K, 2, 2) um/h, speeds of an aggregate's lines in K parts of a step, by wall and direction.

    advances: um, in each part; duration: h, of each part. Returns None if all lines are on one
    wall.
    """
    keys = [key for key in advances[-1] if key[0] == number]
    walls = {wall for _, wall, _ in keys}
    if len(walls) < 2:
        return None
    by_line = np.zeros((len(advances), max(walls), 2))
    for key in keys:
        _, wall, direction = key
        by_line[:, wall - 1, (1 - direction) // 2] = [part.get(key, 0.0) for part in advances]
    return by_line / duration


def advances_at(by_line: np.ndarray, number: int,
                duration: float) -> dict[tuple[int, int, int], float]:
    """{(number, wall, direction): um}, advances of an aggregate's lines in a duration (h).

    by_line: (2, 2) um/h, speeds in one part of a step, as :func:`speeds` returns them.
    """
    return {(number, wall, direction): float(by_line[wall - 1, (1 - direction) // 2] * duration)
            for wall in range(1, len(by_line) + 1) for direction in (1, -1)}


def lines_of(outline: Outline) -> list[Line]:
    """All contact lines of an outline, in the order of the numbers of their walls."""
    walls = set(touched(outline.wall).tolist()) - {FREE}
    return [Line(wall, node, direction) for wall in sorted(walls)
            for node, direction in surface_ends(outline, wall)]


@dataclass(frozen=True, eq=False)
class Contact:
    """Contact of an outline whose arcs are divided at contact lines.

    wall: (M,) of the nodes of the undivided outline; arcs: (d,) numbers of the divided arcs,
    ascending; t: (d,) parameter of each division; first, second: (d,) walls of both parts.
    """

    wall: np.ndarray
    arcs: np.ndarray
    t: np.ndarray
    first: np.ndarray
    second: np.ndarray


def divided_arc(outline_nodes: int, line: Line) -> int:
    """Number of the arc in which a line lies; outline_nodes: number of nodes of the outline."""
    arcs = int(np.floor(line.advance))
    along = arcs if line.direction == 1 else -arcs - 1
    return (line.node // 2 + along) % (outline_nodes // 2)


def contact_with(wall: np.ndarray, lines: Sequence[Line]) -> Contact:
    """The contact after the lines have advanced from walls (M,).

    Raises GrowthError if two lines meet.
    """
    joined = wall.copy()
    count = len(wall)
    cuts = {}
    for line in lines:
        arcs = int(np.floor(line.advance))
        t = line.advance - arcs
        if t > 1 - LEAST_PART:
            arcs += 1
        nodes = (line.node + line.direction * np.arange(1, 2 * arcs + 2)) % count
        if (joined[nodes] != FREE).any():
            raise GrowthError(MEET)
        joined[nodes[:-1]] = line.wall
        if LEAST_PART <= t <= 1 - LEAST_PART:
            forward = line.direction == 1
            number = divided_arc(count, line)
            if number in cuts:
                raise GrowthError(MEET)
            cuts[number] = ((t, line.wall, FREE) if forward else (1 - t, FREE, line.wall))
    divided = sorted(cuts)
    places, first, second = (np.array([cuts[number][k] for number in divided]) for k in range(3))
    return Contact(joined, np.array(divided, int), places, first, second)
