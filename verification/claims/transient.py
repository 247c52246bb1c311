"""C21: the steps of the paper's transient scheme."""

from __future__ import annotations

import numpy as np

from repro.model import gear
from repro.model.kinetics import Sink
from repro.model.transport import Concentrations
from verification.claims import Finding, at_least, at_most, between, claim, without_limit
from verification.claims.levels import cached
from verification.claims.restored import solved_pore
from verification.claims.runs import BASE

#: Control tolerances over the supply: one with which steps range as the paper says, which prints none; a reference's.
LIKE_PAPER, EXACT = 1e-5, 1e-7
#: A shape update (h).
UPDATE, FIRST, PLOTTED = 0.2, 0.0, 19.2
#: Seconds in an hour.
HOUR = 3600.0


@claim("C21", "3.3.2", "predictor-corrector control: steps from minutes to about a second, accurate to 0.1 %; not "
       "stable for long steps (steps saved by the control)", "python -m verification.claims C21", (BASE,))
def step_control() -> Finding:
    """Steps and errors of the transport of one shape update (12 min at every level) of base at t = 0 and 19.2 h.

    The error is the largest of both concentrations (over the supply) and of the biomass made (relative), against a
    tolerance of 1e-7.
    """
    early, late, ours = update(FIRST, LIKE_PAPER), update(PLOTTED, LIKE_PAPER), update(PLOTTED, gear.TOLERANCE)
    error = max(deviation(time, tolerance) for time in (FIRST, PLOTTED) for tolerance in (LIKE_PAPER, gear.TOLERANCE))
    alone, alike = deviation(PLOTTED, None, UPDATE), equal_steps()
    checks = (without_limit(between("longest step at t = 0 (s)", "a few minutes", HOUR * max(early.steps), 120, 600,
                                    "a few minutes: 2 to 10, of the 12 of an update")),
              without_limit(between("shortest step at 19.2 h (s)", "the order of a second", HOUR * min(late.steps), 0.3,
                                    3, "the order of a second: within a factor of about three")),
              at_most("error with the control (%)", "0.1", 100 * error, 0.1, "as stated"),
              at_least("error of one step of 12 min (%)", "not stable", 100 * alone, 0.1, "over what is kept"),
              without_limit(at_least("equal steps for the control's error, over its own", "steps saved",
                                     alike / len(ours.steps), 1.5, "a third of the steps at least")))
    change = (f"the tolerance of the control is not printed: with {LIKE_PAPER:g} of the supply steps range like the "
              f"paper's; the default, {gear.TOLERANCE:g}, keeps 0.1 % with steps of {HOUR * min(ours.steps):.0f} "
              "s and more")
    note = (f"Steps of an update with {LIKE_PAPER:g}: {len(early.steps)} at t = 0, {len(late.steps)} at 19.2 h (equal "
            f"steps as short as the shortest: {UPDATE / min(late.steps):.0f}); with the default {len(ours.steps)}, "
            f"where equal steps with its error are {alike}. One step of 12 min is off by {100 * alone:.2g} %, but "
            "does not blow up.")
    return Finding(checks, change=change, note=note)


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
