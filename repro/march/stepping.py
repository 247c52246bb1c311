"""Steps as long as the growth allows (``numerics.time = "midpoint"``): second order in time.

The midpoint rule carries (9)-(10) over a step with the rates of the shape half way. Euler's rule
would take those of the start: the mean over the aggregate of their difference, times the step, is
what ``numerics.tolerance`` bounds; the error of the midpoint rule is of higher order, and what a
tolerance makes of it is measured in ``make bench``. A step ends when the film between the aggregate
and the opposite wall is first too thin (2.3.3), and at the times of the scene's tables; rows and
the run's end leave all steps as they are.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from repro.errors import RunEnd, StageError, Unresolved
from repro.march import midpoint
from repro.march.loop import SAME_TIME, Scheme, Step, laid_out
from repro.march.pace import EXCESS, STRETCH, Pace, allowed, fitted, following
from repro.model import remeshing
from repro.model.contact_lines import SearchOptions
from repro.model.pore import Pore, Solved
from repro.scene import Scene, needed

#: The first step that is tried, in parts of growth.time_step.
FIRST = 8.0
#: A step that fails or errs too much is tried again, shorter, until it is this part of it; one of
#: this length may err by more than the tolerance, which is counted and told.
SHORTEST = 1e-3
#: Rows after t = 0 where there are no ``output.times``, at least.
LEAST = 24
#: Contact is met when the film is no thinner than this part of what it may be.
LANDED = 0.999


def rows(scene: Scene) -> tuple[float, ...]:
    """Times (h) of rows besides the ends of steps: growth.end, and multiples of growth.time_step
    times a power of two, the largest (1/4, 1/2, 1, 2 ...) with LEAST of them or more."""
    growth = needed(scene.growth, "[growth]")
    if growth.end <= SAME_TIME:
        return ()
    power = math.floor(math.log2(growth.end / (LEAST * growth.time_step)) + 1e-9)
    apart = max(growth.time_step * 2.0**power, 2 * SAME_TIME)
    times = [round(k * apart, 9) for k in range(1, int(growth.end / apart) + 1)]
    return (*(time for time in times if growth.end - time > SAME_TIME), growth.end)


def _advance(scene: Scene, now: Pore, solved: Solved, asked: Pace) -> tuple[Step, Solved, Pace]:
    """One step: the next one, whenever the run ends, or where growth.end lies within that, one to
    growth.end."""
    taken, after, pace = _accepted(scene, now, solved, asked)
    if taken.pore.time - needed(scene.growth, "[growth]").end > SAME_TIME:
        return *_cut(scene, taken), asked
    return replace(taken, before=None), after, pace


def _cut(scene: Scene, passing: Step) -> tuple[Step, Solved]:
    """A step to growth.end from where a step begins that passes it, and what is solved after it;
    within it, times are those of the one that passes."""
    end = needed(scene.growth, "[growth]").end
    now, solved = needed(passing.before, "the start of a step")
    while True:
        try:
            found = midpoint.attempt(scene, now, solved, end - now.time)
            break
        except Unresolved as error:
            finer = _on_finer_elements(scene, now)
            if finer is None:
                raise remeshing.advised(scene, now, error) from None
            now, solved = finer
    taken, after = _solved(scene, _ending_at(needed(found.step, "a shorter step"), end))
    return replace(taken, before=None, within=passing.within), after


def _accepted(scene: Scene, now: Pore, solved: Solved,
              asked: Pace) -> tuple[Step, Solved, Pace]:
    """The first step that is good enough, what is solved after it, and the pace of the next."""
    tolerance = scene.numerics.tolerance
    time_step = needed(scene.growth, "[growth]").time_step
    shortest = SHORTEST * time_step
    length = asked.length
    corner = scene.corner(now.time)
    left = corner - now.time
    duration = fitted(length, left, STRETCH)
    while True:
        most = np.inf if duration <= shortest else EXCESS * tolerance / duration
        try:
            cut = duration > shortest
            search = SearchOptions(landing=LANDED if cut else 0.0, patient=not cut)
            found = midpoint.attempt(scene, now, solved, duration, most, search)
            estimate = found.change * duration
            if found.step:
                end = _end_of(now, duration, corner)
                taken, after = _solved(scene, _ending_at(found.step, end))
                if found.gaps is not None:  # contact alone made the step short
                    return taken, after, asked
                tried = replace(asked, length=length)
                pace = following(tried, duration, estimate, tolerance)
                return taken, after, replace(pace, length=max(pace.length, shortest))
            if found.gaps:
                film = needed(scene.growth, "[growth]").minimum_film
                length = duration * _to_contact(*found.gaps, film)
            else:
                length = max(duration * allowed(estimate, tolerance), shortest)
        except Unresolved as error:
            finer = _on_finer_elements(scene, now)
            if finer is None and duration <= time_step:
                raise remeshing.advised(scene, now, error) from None
            if finer is None:
                length = duration / 2
            else:
                now, solved = finer
        except (RunEnd, StageError, FloatingPointError):
            if duration <= shortest:
                raise
            length = duration / 2
        duration = fitted(length, left)


def _on_finer_elements(scene: Scene, now: Pore) -> tuple[Pore, Solved] | None:
    """The start of a step on elements half as large at the aggregate, and what is solved there;
    None where they may not be halved again."""
    finer = remeshing.graded(scene, now)
    if finer is None:
        return None
    found, solved = remeshing.resolved(scene, finer)
    return replace(found, concentrations=solved.concentrations), solved


def _solved(scene: Scene, taken: Step) -> tuple[Step, Solved]:
    """A step with what is solved after it, on a mesh graded to a front where that is needed."""
    after, solved = remeshing.resolved(scene, taken.pore)
    if after is not taken.pore:
        taken = replace(taken, pore=laid_out(after), remeshed=True)
    return taken, solved


def _to_contact(before: float, after: float, film: float) -> float:
    """The part of a step after which the gap (um), from before to after it, is just under that of
    the film."""
    aim = 0.5 * (1 + LANDED) * film
    part = (before - aim) / (before - after) if after < before else 0.0
    return min(0.95, max(0.02, part))


def _end_of(now: Pore, duration: float, corner: float) -> float:
    """The end (h) of a step: the corner of the scene's tables that it comes to, to the last bit."""
    end = now.time + duration
    return corner if abs(corner - end) <= SAME_TIME else end


def _ending_at(taken: Step, end: float) -> Step:
    """The step with the time (h) of its end."""
    return replace(taken, pore=laid_out(replace(taken.pore, time=end)))

#: The midpoint rule; where there are no ``output.times``, every step is reported, and :func:`rows`.
SCHEME = Scheme(_advance, rows, FIRST)
