"""Newton's method for an aggregate's shape and the positions of its contact lines together.

The unknowns are positions, pressures and the advance s of each contact line. The equations are the
equilibrium, R = 0, and zero clearance beyond each line, c = 0 (2.3.3). A line at its least advance
stays there as long as its clearance is not negative. K is the derivative of R by the shape. If a
line advances, the shape moves by K^-1 (-dR/ds), one more solution with the factors of K. dR/ds is a
difference quotient over the triangles beside the line. dc/ds is a difference quotient of the
clearance on the moved outline.

The clearance is a minimum over the free surface, and it jumps when a film closes. The method may
therefore fail. The search of :mod:`repro.model.contact_lines` then replaces it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from repro.errors import GrowthError, failing_as
from repro.fem import division as dividing
from repro.fem.assembly import Factored
from repro.fem.division import Division
from repro.fem.newton import REQUIRED_REDUCTION, solved
from repro.fem.outline import Outline
from repro.model import contact_lines, growth
from repro.model.contact_lines import CLOSE, FIRST_TRIAL, LEAST_PART, Clearance, Line
from repro.model.pore import Pore
from repro.model.solid import Shape
from repro.polling import poll
from repro.scene import needed

#: Largest number of iterations before the method gives up.
MOST_ITERATIONS = 20
#: (n, defect): the method also gives up if the defect after n iterations is larger. In 19 pores
#: this would have stopped seven of 414 solutions that converged. It saves a quarter of the
#: processor time of 63 that did not.
EARLY = 12, 0.5
#: Differences of an advance (arcs) for the derivatives of the residual (first) and the clearance.
SMALL = 1e-5
MODEST = 0.02
#: Longest step (arcs) of a line.
LONGEST = 2.0
#: A line does not move if its clearance is at most this.
AT_REST = CLOSE / 2
#: A line beside a corner lies at this distance (arcs) before or beyond it.
BESIDE = 1.01 * LEAST_PART
#: Two advances are equal if they differ by less than this (arcs).
SAME = 1e-9
#: Step (arcs) of a line away from a corner at which it is not at rest.
DEPARTURE = 0.3
#: A line leaves or crosses a corner only if the defect of the shape is smaller than this.
NEAR = 0.05
#: Trial lengths of a step, until no triangle is turned over and the defect rises by at most RISE.
#: If it always rises by more, the last length without a triangle turned over is used. In ``wide``
#: to 45 h, 0 solutions fail in ``fast`` and 2 in ``accurate``. Without this limit 3 and 9 fail.
#: With a limit of 2, 2 and 4 fail; with a limit of 10, 2 and 5.
LENGTHS = 1.0, 0.5, 0.25, 0.125, 0.0625
RISE = 4.0


@dataclass(frozen=True, eq=False)
class Placed:
    """An aggregate with its contact lines at given positions.

    grown: the pore before its expansion; pore: the same on the divided mesh, with its contact;
    division: None if no arc is divided; reference: (N, 2) um, nodes of the grown pore in the
    configuration from which strain counts; system: of the equilibrium; theta: (t, q) expansion
    since this configuration; target: (n, 2) um, positions that contain the prescribed coordinates;
    rule: for the free surface.
    """

    grown: Pore
    pore: Pore
    division: Division | None
    reference: np.ndarray
    system: growth.System
    theta: np.ndarray
    target: np.ndarray
    rule: Clearance

    def clearances(self, position: np.ndarray, lines: Sequence[Line]) -> np.ndarray:
        """(2, L) clearance and reach beyond L lines (:meth:`Clearance.beyond`), for positions
        (n, 2) um."""
        pore = self.pore
        points = position[pore.region.own_loop]
        outline = Outline(points, pore.body.wall, pore.body.fixed, points, 2)
        return np.array([self.rule.beyond(outline, line.end_on(outline), line.direction)
                         for line in lines]).T

    def within_arc(self, line: Line) -> bool:
        """Does a line divide an arc?"""
        return self.division is not None and self._arc(line) in self.division.arcs

    def _arc(self, line: Line) -> int:
        return contact_lines.divided_arc(len(self.grown.body.wall), line)

    def slope(self, line: Line, position: np.ndarray, pressure: np.ndarray) -> np.ndarray:
        """(2n + corners,) derivative of the residual by the advance (arcs) of a line within an arc.

        Nodal values are constant. The change of a support's load with the line is neglected.
        """
        division = needed(self.division, "a divided arc")
        number = int(np.searchsorted(division.arcs, self._arc(line)))
        rows, triangle = division.halves(number)
        solid = self.system.solid
        shape = Shape(solid.shape.cells[rows], solid.shape.corners, solid.shape.degree)
        moved = triangle.divided_at(division.t[number] + SMALL * line.direction)
        nodes = self.reference[self.grown.mesh.cells[triangle.cell]]
        reference = solid.reference.copy()
        reference[shape.cells] = moved.nodes(nodes)
        after = replace(solid, shape=shape, reference=reference)
        amount = (self.grown.body.theta * self.grown.body.solid.at.dx)[rows[0]]
        parts = dividing.split(amount, moved, self.grown.space.table)
        change = (self.system.partial_residual(after, np.stack(parts) / after.at.dx, position,
                                               pressure)
                  - self.system.partial_residual(replace(solid, shape=shape), self.theta[rows],
                                                 position, pressure))
        return change / SMALL

    def on_parent(self, position: np.ndarray,
                  pressure: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Positions (N, 2) um and pressures (corners,) on the grown pore's mesh, from those of the
        divided aggregate, (n, 2) um and (corners of the aggregate,)."""
        shape = self.pore.placed(position, pressure)
        if self.division is None:
            return shape.mesh.points, shape.pressure
        points = self.division.restricted(shape.mesh.points)
        return points, shape.pressure[: self.grown.mesh.corners]

    def divided(self, points: np.ndarray,
                pressures: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Invert :meth:`on_parent`."""
        if self.division is not None:
            points = self.division.nodal(points)
            pressures = self.division.at_corners(pressures)
        region = self.pore.region
        return points[region.nodes], pressures[region.corner_nodes]

    def iterate(self, position: np.ndarray, pressure: np.ndarray) -> growth.Iterate:
        """The equilibrium's residual at positions (n, 2) um and pressures of the divided aggregate.
        """
        return self.system.under(self.theta, self.target, position, pressure)

    def same_arcs(self, other: Placed) -> bool:
        """Are the same arcs divided?"""
        if self.division is None or other.division is None:
            return self.division is other.division
        return np.array_equal(self.division.arcs, other.division.arcs)


class Coupled:
    """Newton's method for the shape and the lines of an aggregate."""

    def __init__(self, place: Callable[[], Placed], lines: Sequence[Line], points: np.ndarray,
                 pressures: np.ndarray):
        """place: returns the aggregate with the lines at their present advances; points: (N, 2) um,
        and pressures: (corners,), start of the iteration at the nodes of the grown pore."""
        self._place = place
        self._lines = lines
        self.placed = place()
        self.position, self.pressure = self.placed.divided(points, pressures)
        self.iterations = 0
        self._factors: Factored | None = None
        for line in lines:
            line.newton_minimum = 0.0

    @failing_as(GrowthError)
    def solve(self, tolerance: float = growth.NEWTON) -> None:
        """Solve to a defect of ``tolerance``, or to round-off.

        Raises GrowthError if there is no convergence.
        """
        previous = np.inf
        moving = True
        iterate = self.placed.iterate(self.position, self.pressure)
        while True:
            poll()
            in_equilibrium = iterate.complete and solved(self.placed.system, iterate, previous,
                                                         tolerance)
            if in_equilibrium and self._accepts():
                return
            hopeless = self.iterations == EARLY[0] and iterate.defect > EARLY[1]
            if hopeless or self.iterations == MOST_ITERATIONS or in_equilibrium and not moving:
                raise GrowthError("Newton's method for the contact lines stands at a defect of "
                                  f"{iterate.defect:.2g} after {self.iterations} iterations")
            if iterate.defect > REQUIRED_REDUCTION * previous:
                self._factors = None
            previous = iterate.defect
            moving, iterate = self._step(iterate)
            self.iterations += 1

    def _accepts(self) -> bool:
        """Are all lines in place?"""
        clearances, _ = self.placed.clearances(self.position, self._lines)
        return all(_fits(line, clearance, CLOSE)
                   for line, clearance in zip(self._lines, clearances))

    def _step(self, iterate: growth.Iterate) -> tuple[bool, growth.Iterate]:
        """Make one step of shape and lines that keeps det F > 0.

        Returns whether lines move, and the iterate after the step. A step that raises the defect by
        more than RISE is shortened.
        """
        lag = iterate.lag
        carried = np.concatenate([lag[:, 0], lag[:, 1], np.zeros(len(self.pressure))])
        factors = self._factors or self.placed.system.factored(iterate)
        change = factors.solve(-iterate.residual, carried)
        steps, change = self._with_lines(iterate, factors, change)
        start = [line.advance for line in self._lines]
        trial = None
        for length in LENGTHS:
            for line, before, step in zip(self._lines, start, steps):
                line.advance = _place(line, before, length * step) if step else before
            position = self.position + length * _nodal(change, self.position)
            pressure = self.pressure + length * change[self.position.size:]
            placed = self._place() if steps.any() else self.placed
            if not placed.same_arcs(self.placed):
                position, pressure = placed.divided(*self.placed.on_parent(position, pressure))
            if placed.system.strained(position).J.min() > 0:
                after = placed.iterate(position, pressure)
                trial = placed, position, pressure, [line.advance for line in self._lines]
                if after.defect <= RISE * iterate.defect:
                    break
        if trial is None:
            raise GrowthError("no step of contact lines keeps det F > 0")
        placed, self.position, self.pressure, advances = trial
        for line, advance in zip(self._lines, advances):
            line.advance = advance
        self._factors = factors if placed is self.placed else None
        self.placed = placed
        return bool(steps.any()), after

    def _with_lines(self, iterate: growth.Iterate, factors: Factored,
                    change: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Steps (L,) of the lines (arcs), and the change of all unknowns with these steps.

        change: of all unknowns, with lines at rest. If a line within an arc is to move, the first
        iteration moves no line: the shape is far from the walls, and its clearances are poor
        predictions.
        """
        ahead = self.position + _nodal(change, self.position)
        clearances, reaches = self.placed.clearances(ahead, self._lines)
        steps = np.zeros(len(self._lines))
        moving = [k for k, line in enumerate(self._lines)
                  if not _fits(line, clearances[k], AT_REST)]
        within = [k for k in moving if self.placed.within_arc(self._lines[k])]
        near = iterate.defect < NEAR
        if self.iterations == 0 and within:
            return steps, change
        for k in moving:
            line = self._lines[k]
            if near and clearances[k] < 0 and _before_corner(line.advance):
                line.newton_minimum = round(line.advance) + BESIDE
        if self.iterations == 0 or near:
            for k in set(moving) - set(within):
                reach = FIRST_TRIAL * reaches[k] if self.iterations == 0 else DEPARTURE
                steps[k] = _leave_corner(self._lines[k], clearances[k], reach)
        if within:
            slopes = {k: factors.solve(-self.placed.slope(self._lines[k], self.position,
                                                          self.pressure)) for k in within}
            moves = {k: _nodal(slope, self.position) for k, slope in slopes.items()}
            steps[within] = self._to_roots(ahead, moves, clearances[within], near)
            change = change + sum(steps[k] * slopes[k] for k in within)
        return steps, change

    def _to_roots(self, position: np.ndarray, moves: dict[int, np.ndarray],
                  clearances: np.ndarray, near: bool) -> np.ndarray:
        """Steps (arcs) of the lines to the roots of their clearances.

        moves: {line: (n, 2) um per arc}. If a line stops before its root, the steps of the other
        lines are solved for again. A line just beyond a corner rests there if its root lies between
        BESIDE before and BESIDE beyond the corner. near: is the shape close to equilibrium?
        """
        lines = [self._lines[k] for k in moves]
        rises = np.array([self.placed.clearances(position + MODEST * move, lines)[0] - clearances
                          for move in moves.values()]).T / MODEST
        steps = np.zeros(len(lines))
        free = np.ones(len(lines), bool)
        while free.any():
            rest = clearances + rises[:, ~free] @ steps[~free]
            steps[free] = np.linalg.solve(rises[np.ix_(free, free)], -rest[free])
            for line, step in zip(lines, steps):
                if near and _beyond_corner(line.advance) and -2 * BESIDE < step < 0:
                    line.newton_minimum = line.advance
            ends = np.array([_place(line, line.advance, step, near) - line.advance
                             for line, step in zip(lines, steps)])
            stopped = free & (ends != steps)
            if not stopped.any():
                break
            steps[stopped] = ends[stopped]
            free &= ~stopped
        return steps


def _nodal(change: np.ndarray, position: np.ndarray) -> np.ndarray:
    """(n, 2) um, displacements in a change of all unknowns."""
    return change[: position.size].reshape(2, -1).T


def _fits(line: Line, clearance: float, close: float) -> bool:
    """Is a line in place, with a clearance of zero up to ``close``?

    At the smallest allowed advance the clearance may be larger.
    """
    smallest = line.advance <= max(line.least, line.newton_minimum)
    return clearance >= -close and (smallest or clearance <= close)


def _leave_corner(line: Line, clearance: float, reach: float) -> float:
    """The step (arcs) of a line away from a corner at which it is not at rest."""
    if clearance > 0:
        return max(-DEPARTURE, line.least - line.advance)
    if line.newton_minimum:
        return line.newton_minimum - line.advance
    return min(max(reach, DEPARTURE), LONGEST)


def _before_corner(advance: float) -> bool:
    """Is an advance (arcs) at a corner or just before it?

    The distance may exceed BESIDE, because a step to this distance may be shortened.
    """
    return -1.5 * LEAST_PART <= advance - round(advance) < LEAST_PART


def _beyond_corner(advance: float) -> bool:
    """Is an advance (arcs) just beyond a corner?"""
    return abs(advance - round(advance) - BESIDE) < SAME


def _place(line: Line, start: float, step: float, near: bool = True) -> float:
    """The advance (arcs) of a line after a step (arcs) from ``start``.

    If the step ends closer than LEAST_PART to a corner, the line stops on its own side of it, at
    the distance BESIDE. If it is there already, it crosses the corner. near: is the shape close to
    equilibrium? Otherwise a line beside a corner does not cross it.
    """
    place = max(start + min(max(step, -LONGEST), LONGEST), line.least, line.newton_minimum)
    corner = round(place)
    if abs(place - corner) >= LEAST_PART:
        return place
    beyond = start > corner
    if abs(start - corner) <= BESIDE + SAME:
        if not near:
            return start
        beyond = place > start
    return corner + BESIDE if beyond else max(corner - BESIDE, line.least)
