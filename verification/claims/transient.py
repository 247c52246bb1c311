"""C21: the steps of the paper's transient scheme."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from repro.model import gear
from repro.model.kinetics import Sink
from repro.model.transport import Concentrations
from verification.claims import OF_SCHEME, Finding, at_least, at_most, claim, without_limit
from verification.claims.levels import ALONE, cached
from verification.claims.restored import solved_pore
from verification.claims.runs import BASE

#: Control tolerance over the supply of a reference.
EXACT = 1e-7
#: A shape update (h).
UPDATE, FIRST, PLOTTED = 0.2, 0.0, 19.2
#: Seconds in an hour.
HOUR = 3600.0
#: A disturbance of the profiles, and after how many steps it is looked at.
DISTURBED, LATER = 0.01, (3, 6)


@claim("C21", "3.3.2", "predictor-corrector control: steps from minutes to about a second, accurate to 0.1 %; not "
       "stable for long steps (steps saved by the control)", about=OF_SCHEME, steps=ALONE,
       fixed="an update of 12 min is the paper's, and the steps within it are asked")
def step_control() -> Finding:
    """Errors of the transport of one shape update (12 min) of base at t = 0 and 19.2 h, and what becomes of a
    disturbance of the profiles in long equal steps where no biomass grows.

    The error is the largest of both concentrations (over the supply) and of the biomass made (relative), against a
    tolerance of 1e-7. Unstable is a disturbance that grows from step to step: one that dies out, however wrong a long
    step may be, is none. The range of the steps hangs on the tolerance of the control, which is not printed, so that it
    proves nothing and is told alone.
    """
    ours = update(PLOTTED, gear.TOLERANCE)
    error = max(deviation(time, gear.TOLERANCE) for time in (FIRST, PLOTTED))
    alone, alike, growth = deviation(PLOTTED, None, UPDATE), equal_steps(), growth_of_a_disturbance(UPDATE, True)
    checks = (at_most("error with the control (%)", "0.1", 100 * error, 0.1, "as stated"),
              without_limit(at_least("growth of a disturbance in a step of 12 min, both substrates predicted",
                                     "not stable", growth, 1.0, "it grows", date="2026-11-22")),
              without_limit(at_least("equal steps for the control's error, over its own", "steps saved",
                                     alike / len(ours.steps), 1.5, "a third of the steps at least")))
    damped = growth_of_a_disturbance(UPDATE, False)
    reason = (f"in equal steps of 12 min a disturbance changes by a factor of {growth:.2g} a step where each substrate "
              f"sees the other's prediction, and of {damped:.2g} where the donor sees the corrected acceptor: backward "
              f"differences are stable, long steps are wrong ({100 * alone:.2g} %) but do not blow up")
    early = update(FIRST, gear.TOLERANCE)
    note = (f"With the default tolerance of {gear.TOLERANCE:g}, {len(early.steps)} steps of "
            f"{HOUR * min(early.steps):.0f} to {HOUR * max(early.steps):.0f} s at t = 0 and {len(ours.steps)} of "
            f"{HOUR * min(ours.steps):.0f} to {HOUR * max(ours.steps):.0f} s at 19.2 h, where equal steps with its "
            f"error are {alike}. One step of 12 min is off by {100 * alone:.2g} %; a disturbance changes in it by a "
            f"factor of {growth:.2g} with both substrates predicted, of {damped:.2g} as we have it.")
    return Finding(checks, reason=reason, note=note)


def growth_of_a_disturbance(step: float, simultaneous: bool) -> float:
    """Factor a step (h) by which a disturbance of the acceptor in base at 19.2 h changes, biomass neither growing nor
    decaying; simultaneous: both substrates see the other's prediction."""
    now, solved = solved_pore(BASE, PLOTTED)
    still = replace(solved.problem.kinetics, yield_coefficient=1e-12, decay_coefficient=1e-15)
    problem = replace(solved.problem, kinetics=still)
    rest = gear.settle(problem, Sink(now.active), solved.concentrations)
    start = replace(rest, acceptor=(1 - DISTURBED) * rest.acceptor)
    sizes = [disturbance(problem, now, start, rest, count, step, simultaneous) for count in LATER]
    return float((sizes[1] / sizes[0]) ** (1 / (LATER[1] - LATER[0])))


def disturbance(problem, now, start: Concentrations, rest: Concentrations, count: int, step: float,
                simultaneous: bool) -> float:
    """Largest distance (mg/L) from the profiles at rest after so many equal steps (h)."""
    found = gear.advance(problem, now.active, now.inert, start, count * step, fixed_step=step,
                         simultaneous=simultaneous).concentrations
    return max(float(np.abs(getattr(found, name) - getattr(rest, name)).max()) for name in ("acceptor", "donor"))


def equal_steps() -> int:
    """Fewest equal steps whose error at 19.2 h is not above that of the control with its default tolerance."""
    bound = deviation(PLOTTED, gear.TOLERANCE)
    return next(n for n in range(2, 1000) if deviation(PLOTTED, None, UPDATE / n) <= bound)


@cached
def update(time: float, tolerance: float | None, fixed_step: float | None = None) -> gear.Advance:
    """The transient of 12 min in base's geometry at a time (h), from settled profiles."""
    now, solved = solved_pore(BASE, time)
    return gear.advance(solved.problem, now.active, now.inert, settled(time), UPDATE,
                        tolerance=tolerance or gear.TOLERANCE, fixed_step=fixed_step)


@cached
def settled(time: float) -> Concentrations:
    """Profiles of the transient scheme with F3 = F4 = 0 (3.3.2) in base's geometry at a time (h)."""
    now, solved = solved_pore(BASE, time)
    return gear.settle(solved.problem, Sink(now.active), solved.concentrations)


def deviation(time: float, tolerance: float | None, fixed_step: float | None = None) -> float:
    """Error of an update: of both concentrations over the supply, and of the biomass made; the largest."""
    now, solved = solved_pore(BASE, time)
    problem, both = solved.problem, (update(time, tolerance, fixed_step), update(time, EXACT))
    errors = [np.abs(np.subtract(*(getattr(found.concentrations, name) for found in both))).max() / substrate.supply
              for name, substrate in zip(("acceptor", "donor"), problem.both)]
    made = [float((found.active + found.inert - now.active - now.inert).sum()) for found in both]
    return float(max(*errors, abs(made[0] / made[1] - 1)))
