"""Steps as long as the growth allows (``numerics.time = "midpoint"``): second order in time.

The midpoint rule carries (9)-(10) over a step with the rates of the shape half way. Euler's rule
would take those of the start: the mean over the aggregate of their difference, times the step, is
what ``numerics.tolerance`` bounds; the error of the midpoint rule is of higher order, and what a
tolerance makes of it is measured in ``make bench``. A step ends at each reported time, and when the
film between the aggregate and the opposite wall is first too thin (2.3.3).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from repro.errors import StageError, Unresolved
from repro.march import loop, midpoint
from repro.march.loop import SAME_TIME, Instant, PoreEnd, Scheme, State, Step, laid_out
from repro.march.pace import EXCESS, STRETCH, Pace, allowed, fitted, following
from repro.model import remeshing
from repro.model.pore import Pore, Solved
from repro.scene import Scene, needed

#: The first step that is tried, in parts of growth.time_step.
FIRST = 8.0
#: A step that fails or errs too much is tried again, shorter, until it is this part of it.
SHORTEST = 1e-3
#: Contact is met when the film is no thinner than this part of what it may be.
LANDED = 0.995


def steps(scene: Scene, state: State | None = None) -> Iterator[tuple[State, Instant | None]]:
    """:func:`repro.march.loop.steps` by the midpoint rule; every step is reported where there are
    no ``output.times``."""
    return loop.steps(scene, Scheme(_targets, _advance, FIRST), state)


def _targets(scene: Scene) -> list[float]:
    """Times (h) at which a step must end."""
    end = needed(scene.growth, "[growth]").end
    return sorted({time for time in scene.output.times or () if time > 0} | {end})


def _advance(scene: Scene, now: Pore, solved: Solved, time: float,
             asked: Pace) -> tuple[Step, Solved, Pace]:
    """One step towards a time (h), without the state before it."""
    taken, after, pace = _accepted(scene, now, solved, time, asked)
    return replace(taken, before=None), after, pace


def _accepted(scene: Scene, now: Pore, solved: Solved, time: float,
              asked: Pace) -> tuple[Step, Solved, Pace]:
    """The first step that is good enough, what is solved after it, and the pace of the next."""
    tolerance = scene.numerics.tolerance
    time_step = needed(scene.growth, "[growth]").time_step
    shortest = SHORTEST * time_step
    length = asked.length
    duration = fitted(length, time - now.time, STRETCH)
    while True:
        most = np.inf if duration <= shortest else EXCESS * tolerance / duration
        try:
            found = midpoint.attempt(scene, now, solved, duration, most)
            estimate = found.change * duration
            if found.step and (duration <= shortest or not _overshoots(found)):
                taken, after = _solved(scene, _ending_at(found.step, now.time + duration, time))
                if found.gaps is not None:  # contact alone made the step short
                    return taken, after, asked
                tried = replace(asked, length=length)
                return taken, after, following(tried, duration, estimate, tolerance)
            if found.step and found.gaps:
                length = duration * _to_contact(found.gaps)
            else:
                length = duration * allowed(estimate, tolerance)
        except Unresolved as error:
            finer = remeshing.graded(scene, now)
            if finer is None and duration <= time_step:
                raise remeshing.advised(scene, now, error) from None
            if finer is None:
                length = duration / 2
            else:
                now, solved = remeshing.resolved(scene, finer)
                now = replace(now, concentrations=solved.concentrations)
        except (PoreEnd, StageError, FloatingPointError):
            if duration <= shortest:
                raise
            length = duration / 2
        duration = fitted(length, time - now.time)


def _solved(scene: Scene, taken: Step) -> tuple[Step, Solved]:
    """A step with what is solved after it, on a mesh graded to a front where that is needed."""
    after, solved = remeshing.resolved(scene, taken.pore)
    if after is not taken.pore:
        taken = replace(taken, pore=laid_out(after), remeshed=True)
    return taken, solved


def _overshoots(found: midpoint.Attempt) -> bool:
    """Does the step end with a film much thinner than it may be, when contact is first made?"""
    return found.gaps is not None and found.gaps[1] < LANDED * found.gaps[2]


def _to_contact(gaps: tuple[float, float, float]) -> float:
    """The part of the step after which the film, thinning at a constant rate, is just too thin."""
    before, after, film = gaps
    aim = 0.5 * (1 + LANDED) * film
    part = (before - aim) / (before - after) if after < before else 0.0
    return min(0.95, max(0.02, part))


def _ending_at(taken: Step, end: float, time: float) -> Step:
    """The step with the time of its end, the reported one where they are the same."""
    exact = time if abs(time - end) <= SAME_TIME else end
    return replace(taken, pore=laid_out(replace(taken.pore, time=exact)))
