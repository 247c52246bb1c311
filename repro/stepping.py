"""Steps of the length that the growth asks for (``numerics.time = "midpoint"``): second order in time.

The midpoint rule carries (9)-(10) over a step with the rates of the shape half way. Euler's rule would take those of
the start: the mean over the aggregate of their difference, times the step, is what ``numerics.tolerance`` bounds; the
error of the midpoint rule is of higher order, and what a tolerance makes of it is measured in ``make bench``. A step
ends at each reported time, and when the film between the aggregate and the opposite wall is first too thin (2.3.3).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from repro import loop, midpoint
from repro.coupling import Attempt
from repro.curved import coupling as curved
from repro.errors import StageError
from repro.loop import SAME_TIME, Instant, PoreEnd, Scheme, State, Step, laid_out
from repro.pore import Solved

#: A step that fails or errs too much is tried again, shorter, until it is this part of growth.time_step.
SHORTEST = 1e-3
#: Limits of the ratio of consecutive steps, and what is kept of the length that the estimate allows.
FASTER, SLOWER, SAFETY = 2.0, 0.2, 0.9
#: An estimate up to so many tolerances is accepted.
EXCESS = 1.5
#: Contact is met when the film is no thinner than this part of what it may be.
LANDED = 0.995


def steps(scene, state: State | None = None) -> Iterator[tuple[State, Instant | None]]:
    """:func:`repro.loop.steps` of the midpoint rule; without ``output.times`` every step is reported."""
    scheme = curved if scene.numerics.elements == "quadratic" else midpoint

    def advance(*now) -> tuple[Step, Solved, float]:
        taken, solved, length = _advance(scheme, *now)
        return replace(taken, before=None), solved, length

    return loop.steps(scene, Scheme(scheme.seeded, scheme.solve, _targets, advance), state)


def _targets(scene) -> list[float]:
    """Times (h) at which a step must end."""
    return sorted({time for time in scene.output.times or () if time > 0} | {scene.growth.end})


def _advance(scheme, scene, now, solved, time: float, length: float):
    """The first step that is good enough, what is solved after it, and the length (h) to try next."""
    tolerance, shortest, asked = scene.numerics.tolerance, SHORTEST * scene.growth.time_step, length
    while True:
        duration = _fitted(length, time - now.time)
        try:
            found = scheme.attempt(scene, now, solved, duration)
            factor = _factor(found.change * duration, tolerance)
            if duration <= shortest or _good(found, factor):
                taken = _ending_at(found.step, now.time + duration, time)
                following = asked if found.gaps else _next(length, duration, factor)  # contact alone made it short
                return taken, scheme.solve(scene, taken.pore), following
            length = duration * (_to_contact(found.gaps) if _overshoots(found) else factor)
        except (PoreEnd, StageError, FloatingPointError):
            if duration <= shortest:
                raise
            length = duration / 2


def _fitted(length: float, left: float) -> float:
    """A step of about ``length`` that leaves no crumb of the time that is left."""
    if length >= left * (1 - 1e-9):
        return left
    return min(length, left / 2) if 2 * length > left else length


def _factor(estimate: float, tolerance: float) -> float:
    """By what to multiply the step, from its estimate."""
    if estimate <= 0:
        return FASTER
    return min(FASTER, max(SLOWER, SAFETY * (tolerance / estimate) ** 0.5))


def _good(found: Attempt, factor: float) -> bool:
    return factor >= SAFETY / EXCESS**0.5 and not _overshoots(found)


def _next(length: float, duration: float, factor: float) -> float:
    """A step that was cut short to end at a reported time says nothing against the length before."""
    return max(length, duration * factor) if duration < length and factor > 1 else duration * factor


def _overshoots(found: Attempt) -> bool:
    """Does the step end with a film much thinner than it may be, when contact is first made?"""
    return found.gaps is not None and found.gaps[1] < LANDED * found.gaps[2]


def _to_contact(gaps: tuple[float, float, float]) -> float:
    """The part of the step after which the film, thinning at a constant rate, is just too thin."""
    before, after, film = gaps
    aim = 0.5 * (1 + LANDED) * film
    return min(0.95, max(0.02, (before - aim) / (before - after)))


def _ending_at(taken: Step, end: float, time: float) -> Step:
    """The step with the time of its end, the reported one where they are the same."""
    exact = time if abs(time - end) <= SAME_TIME else end
    return replace(taken, pore=laid_out(replace(taken.pore, time=exact)))
