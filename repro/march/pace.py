"""How long a step of the midpoint rule is: what its estimate allows, foreseen from the step before.

The estimate of a step of length h is c h^2, so that the tolerance allows h (tolerance /
estimate)^(1/2). The closer the aggregate comes to the opposite wall the faster c grows, by about
the same factor from step to step: that factor is taken off the next step too (Gustafsson's
controller: Hairer and Wanner, Solving Ordinary Differential Equations II, section IV.8), so that
few steps are tried in vain.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

#: Limits of the ratio of consecutive steps.
FASTER = 5.0
SLOWER = 0.2
#: A step is this part of the length that the estimate allows.
SAFETY = 0.9
#: An estimate of up to so many tolerances is accepted: a step may exceed its ideal length by the
#: root of it.
EXCESS = 2.0
STRETCH = EXCESS**0.5


@dataclass(frozen=True)
class Pace:
    """length: h, to try next; duration (h) and estimate: of the last step taken, zero where there
    is none."""

    length: float
    duration: float = 0.0
    estimate: float = 0.0


def fitted(length: float, left: float, stretch: float = 1.0) -> float:
    """A step of about ``length`` that leaves no crumb of the time that is left; up to ``stretch``
    times as long where that makes it the last."""
    if stretch * length >= left * (1 - 1e-9):
        return left
    return min(length, left / 2) if 2 * length > left else length


def allowed(estimate: float, tolerance: float, most: float = FASTER) -> float:
    """By what to multiply the step, from its estimate."""
    if estimate <= 0:
        return most
    return min(most, max(SLOWER, SAFETY * (tolerance / estimate) ** 0.5))


def missed(pace: Pace, tolerance: float) -> bool:
    """Does the last step err by more than is accepted? The shortest one is taken all the same."""
    return pace.estimate > EXCESS * tolerance * (1 + 1e-9)


def following(pace: Pace, duration: float, estimate: float, tolerance: float) -> Pace:
    """After a step that was taken: longer by FASTER at most, or as long as what was asked for and
    cut short to end at a reported time."""
    most = max(FASTER, pace.length / duration)
    factor = allowed(estimate, tolerance, most)
    if pace.estimate > 0 and estimate > 0:
        rise = max(1.0, (estimate / pace.estimate) ** 0.5 * pace.duration / duration)
        factor = min(factor, max(SLOWER, allowed(estimate, tolerance, np.inf) / rise))
    return Pace(duration * factor, duration, estimate)
