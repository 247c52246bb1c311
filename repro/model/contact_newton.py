"""Newton's method for the shape of an aggregate and the places of its contact lines at once.

The unknowns are positions, pressures and the advance s of each contact line. The equations are the
equilibrium, R = 0, and the clearance beyond each line, c = 0 (2.3.3). A line at its least advance
stays there while its clearance is not negative. With the derivative K of R by the shape, the shape
moves by K^-1 (-dR/ds) with a line: one more solution with the factors of K. dR/ds is a difference
quotient over the triangles beside the line, and dc/ds one over the moved outline.

The clearance is a minimum over the free surface, and jumps where a film closes. The method then
fails, and the search with whole equilibria (:mod:`repro.model.contact_lines`) takes over.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from repro.errors import GrowthError
from repro.model import growth
from repro.model.contact_lines import CLOSE, FIRST_TRIAL, LEAST_PART, Line

#: Iterations after which the search with whole equilibria takes over.
MOST_ITERATIONS = 20
#: Difference of an advance (arcs) for the derivative of the residual.
SMALL = 1e-5
#: Difference of an advance (arcs) for the derivative of the clearance.
MODEST = 0.02
#: Longest step (arcs) of a line.
LONGEST = 2.0
#: Lines stop where all clearances are within this.
AT_REST = CLOSE / 2
#: A line whose place is at a corner lies at this distance (arcs) beyond it.
BESIDE = 1.01 * LEAST_PART
#: Halvings of a step that turns a triangle over.
HALVINGS = 5

#: Clearance and reach beyond each line, (L,) each, on the aggregate with nodes (n, 2) um.
Clearances = Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]


@dataclass(frozen=True, eq=False)
class Placed:
    """An aggregate whose lines have a place.

    system: of its equilibrium; theta: (t, q); target: (n, 2) um, prescribed coordinates; ahead: by
    the number of a line within an arc, the residual after the line has advanced by SMALL, in the
    triangles beside it less that before; clearances: of all lines.
    """

    system: growth.System
    theta: np.ndarray
    target: np.ndarray
    ahead: dict[int, Callable[[np.ndarray, np.ndarray], np.ndarray]]
    clearances: Clearances


def accepted(line: Line, clearance: float) -> bool:
    """Is a line where it should be? Beside a corner it is as near to its place as may be."""
    if clearance < -CLOSE:
        return False
    return line.advance <= line.least or clearance <= CLOSE or line.at_corner


def rests(line: Line, clearance: float) -> bool:
    """Is the clearance so small that a line need not move?"""
    if clearance < -AT_REST:
        return False
    return line.advance <= line.least or clearance <= AT_REST or line.at_corner


def line_steps(lines: Sequence[Line], placed: Placed, position: np.ndarray,
               moves: dict[int, np.ndarray], near: bool, first: bool, present, reach) -> np.ndarray:
    """(L,) arcs, steps of the lines to the root of their clearances.

    moves: (n, 2) um per arc, of the nodes with each line within an arc; near: is the shape so near
    to its equilibrium that a line at a corner may leave it?
    """
    steps = np.zeros(len(lines))
    least = np.array([line.least - line.advance for line in lines])
    if near:
        for k in range(len(lines)):
            if k not in moves and present[k] < -AT_REST:
                steps[k] = max(FIRST_TRIAL * reach[k], 0.1) if first else 0.3
                lines[k].floor = lines[k].advance + BESIDE
            elif k not in moves and present[k] > AT_REST and least[k] < 0:
                steps[k] = max(-0.1, least[k])
    active = [k for k in moves if not rests(lines[k], present[k])]
    numbers = list(active)
    rise = {}
    for k in active:
        rise[k] = np.zeros(len(lines))
        moved = placed.clearances(position + MODEST * moves[k], numbers)[0]
        rise[k][numbers] = (moved - present[numbers]) / MODEST
    while active:
        square = np.array([rise[k][active] for k in active]).T
        steps[active] = np.linalg.solve(square, -present[active])
        ends = [clipped(line, step) for line, step in zip(lines, steps)]
        stopped = [k for k in active if ends[k] != steps[k]]
        for k in stopped:
            steps[k] = ends[k]
            present = present + steps[k] * rise[k]
        active = [k for k in active if k not in stopped]
        if not stopped:
            break
    return steps


def clipped(line: Line, step: float) -> float:
    """The step of a line, bounded, and to a place that it may have.

    A line lies at least LEAST_PART from a corner. If its place is nearer, it lies beyond.
    """
    place = max(line.advance + min(max(step, -LONGEST), LONGEST), line.least, line.floor)
    corner = round(place)
    if abs(place - corner) < LEAST_PART and place > line.least:
        place = corner + BESIDE
    return place - line.advance


def advance(line: Line, step: float) -> None:
    """Move a line by a step (arcs)."""
    if step == 0:
        return
    line.advance += step
    line.at_corner = abs(line.advance - round(line.advance) - BESIDE) < 1e-9
