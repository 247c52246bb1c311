"""Steps with error control by the midpoint rule (steps = "midpoint"), second order in time.

The midpoint rule integrates (9)-(10) over a step with the rates of the shape half way. Euler's rule
would use the rates at the start. ``numerics.tolerance`` bounds the mean difference of these rates
over the aggregate, times the length of the step. The error of the midpoint rule is of higher order;
``make bench`` measures it for each tolerance. A step ends when the film between the aggregate and
the opposite wall first becomes too thin (2.3.3), and at the times of the scene's tables. Rows and
the end of the run do not change the steps. If a row cannot be interpolated, separate steps lead to
it. These steps are shortened and graded like all others.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np

from repro.errors import RunEnd, StageError, Unresolved
from repro.march import midpoint
from repro.march.loop import Stepping, before_jump
from repro.march.midpoint import Attempt
from repro.march.state import SAME_TIME, InterpolatedState, StepResult, contiguous
from repro.march.step_control import (
    EXCESS,
    SHORTEST,
    STRETCH,
    StepControl,
    allowed_ratio,
    fit_to_interval,
    next_step_size,
)
from repro.model.contact_lines import SearchOptions
from repro.model.pore import Pore
from repro.model.remeshing import GeneratedMesh
from repro.model.solving import Solved
from repro.model.stages import Stages
from repro.scene import Growth, needed

#: Length of the first attempted step over growth.time_step.
FIRST = 8.0
#: Least number of rows after t = 0 if the scene has no ``output.times``.
LEAST = 24
#: Least film at the end of a step that makes the first contact, over growth.minimum_film.
LANDED = 0.999


def rows(growth: Growth) -> tuple[float, ...]:
    """Times (h) of rows besides the ends of steps: growth.end, and multiples of an interval.

    The interval is growth.time_step times a power of two (1/4, 1/2, 1, 2 ...). It is the longest
    interval that gives at least LEAST rows.
    """
    if growth.end <= SAME_TIME:
        return ()
    power = math.floor(math.log2(growth.end / (LEAST * growth.time_step)) + 1e-9)
    interval = max(growth.time_step * 2.0**power, 2 * SAME_TIME)
    times = [round(k * interval, 9) for k in range(1, int(growth.end / interval) + 1)]
    return (*(time for time in times if growth.end - time > SAME_TIME), growth.end)


def _advance(stages: Stages, previous: Pore, solved: Solved,
             planned: StepControl) -> tuple[StepResult, Solved, StepControl]:
    """Advance one full step, or a step to growth.end if growth.end lies within the full step.

    If the step to growth.end fails, shorter steps lead to it. The length of the full step does not
    depend on growth.end or on the requested rows.
    """
    corner = stages.tables.corner(previous.time)
    step, after, control = _find_step(stages, previous, solved, planned, corner)
    within = partial(_row, stages, previous, solved, planned, step.within)
    if step.pore.time - stages.growth.end > SAME_TIME:
        try:
            step, after = _cut(stages, previous, solved, stages.growth.end)
            control = planned
        except (StageError, FloatingPointError):
            half = (stages.growth.end - previous.time) / 2
            step, after, control = _find_step(stages, previous, solved,
                                              replace(planned, length=half), stages.growth.end)
    return replace(step, within=within), after, control


def _row(stages: Stages, previous: Pore, solved: Solved, control: StepControl,
         within: Callable[[float], InterpolatedState], time: float) -> InterpolatedState:
    """The state at a time (h) within a step, interpolated, or by separate steps if that fails."""
    try:
        return within(time)
    except (StageError, FloatingPointError):
        pass
    while time - previous.time > SAME_TIME:
        step, solved, control = _find_step(stages, previous, solved, control, time)
        previous = replace(step.pore, concentrations=solved.concentrations)
    return InterpolatedState(replace(previous, time=time), solved)


def _attempt_of(stages: Stages) -> Callable[..., Attempt]:
    """How a step is attempted: :func:`midpoint.attempt`, or :func:`eroding.attempt` with erosion.
    """
    if stages.erosion is None:
        return midpoint.attempt
    from repro.march import eroding  # a scene without erosion does not load it
    return eroding.attempt


def _cut(stages: Stages, previous: Pore, solved: Solved, time: float,
         meshes: tuple[GeneratedMesh, ...] = ()) -> tuple[StepResult, Solved]:
    """Make a step to a time (h) before the end of a step that is accepted."""
    attempt = _attempt_of(stages)
    while True:
        try:
            trial = attempt(stages, previous, solved, time - previous.time, meshes=meshes)
            break
        except Unresolved:
            finer = _halve_elements(stages, previous)
            if finer is None:
                raise
            previous, solved = finer
    return _solve_after(stages, _end_at(needed(trial.step, "a shorter step"), time))


def _find_step(stages: Stages, previous: Pore, solved: Solved, control: StepControl,
               corner: float) -> tuple[StepResult, Solved, StepControl]:
    """Shorten a step until it is accepted. The step ends at ``corner`` (h) or before.

    Failures shorten the step to 1/2, 1/8, 1/128 ... of its length, down to the shortest length:
    each factor is the square of the previous one. Close to a fold every length fails, and so only
    few are tried. If a step passes an end of the run, it is halved instead, so that the last state
    is close to this end.

    Returns the step, the solution after it, and the next step control. Raises StageError,
    FloatingPointError or RunEnd if the shortest step fails.
    """
    attempt = _attempt_of(stages)
    tolerance = stages.tolerance
    time_step = stages.growth.time_step
    shortest = SHORTEST * time_step
    length = control.length
    remaining = corner - previous.time
    duration = fit_to_interval(length, remaining, STRETCH)
    factor = 0.5
    while True:
        last = duration <= shortest
        largest_change = np.inf if last else EXCESS * tolerance / duration
        try:
            search = SearchOptions(landing=0.0 if last else LANDED, patient=last)
            trial = attempt(stages, previous, solved, duration, largest_change, search)
            estimate = trial.change * duration
            if trial.step:
                end = _end_of(previous, duration, corner)
                step, after = _solve_after(stages, _end_at(trial.step, end))
                if trial.gaps is not None:  # contact shortened the step, not the error
                    return step, after, control
                attempted = replace(control, length=length)
                next_control = next_step_size(attempted, duration, estimate, tolerance)
                next_length = max(next_control.length, shortest)
                return step, after, replace(next_control, length=next_length)
            if trial.gaps:
                film = stages.growth.minimum_film
                length = duration * _part_to_contact(*trial.gaps, film)
            else:
                length = max(duration * allowed_ratio(estimate, tolerance), shortest)
        except Unresolved:
            finer = _halve_elements(stages, previous)
            if finer is None and duration <= time_step:
                raise
            if finer is None:
                length = duration / 2
            else:
                previous, solved = finer
        except RunEnd:
            if last:
                raise
            length = duration / 2
        except (StageError, FloatingPointError):
            if last:
                raise
            length = max(duration * factor, shortest)
            factor *= factor
        duration = fit_to_interval(length, remaining)


def _halve_elements(stages: Stages, previous: Pore) -> tuple[Pore, Solved] | None:
    """Halve the elements at the aggregate at the start of a step, and solve on the new mesh.

    Returns None if they have been halved as often as allowed.
    """
    finer = stages.grading.finer(previous)
    if finer is None:
        return None
    graded, solved = stages.grading.solve(finer)
    return replace(graded, concentrations=solved.concentrations), solved


def _solve_after(stages: Stages, step: StepResult) -> tuple[StepResult, Solved]:
    """Solve after a step, just before a jump of the tables at its end.

    If a front of the substrates is too sharp for the mesh, a graded mesh replaces it.
    """
    before = before_jump(stages.tables, step.pore)
    after, solved = stages.grading.solve(before)
    if after is not before:
        after = replace(after, time=step.pore.time)
        step = replace(step, pore=contiguous(after), remeshed=True)
    return step, solved


def _part_to_contact(before: float, after: float, film: float) -> float:
    """Fraction of a step after which the gap (um) is just below the least film (um).

    before, after: gaps (um) at the start and the end of the step.
    """
    aim = 0.5 * (1 + LANDED) * film
    part = (before - aim) / (before - after) if after < before else 0.0
    return min(0.95, max(0.02, part))


def _end_of(previous: Pore, duration: float, corner: float) -> float:
    """Time (h) of a step's end; exactly ``corner`` (h) if the step ends there."""
    end = previous.time + duration
    return corner if abs(corner - end) <= SAME_TIME else end


def _end_at(step: StepResult, end: float) -> StepResult:
    """Set the time (h) of a step's end."""
    return replace(step, pore=contiguous(replace(step.pore, time=end)))

#: The midpoint rule. Without ``output.times`` it reports every step and the times of :func:`rows`.
STEPPING = Stepping(_advance, _cut, rows, FIRST)
