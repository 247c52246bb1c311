"""Step-size control of the midpoint rule, by the error estimates of the last two steps.

The estimate of a step of length h is c h^2, so the tolerance allows the length
h (tolerance / estimate)^(1/2). As the aggregate approaches the opposite wall, c grows by about the
same factor from step to step. The controller also divides the next step by the square root of this
factor, so that few steps are rejected (Gustafsson's controller: Hairer and Wanner, Solving Ordinary
Differential Equations II, section IV.8).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

#: Limit of the ratio of consecutive steps, and of its inverse.
FASTER = 5.0
#: Least length of a step over growth.time_step. A step that fails or misses the tolerance is
#: shortened and repeated, down to this length. A step of this length that misses the tolerance is
#: accepted, and a warning reports it.
SHORTEST = 1e-3
#: Ratio of a step's length to the length that the tolerance allows.
SAFETY = 0.9
#: Largest accepted estimate over the tolerance. A step may exceed the length that the tolerance
#: allows by the square root of this.
EXCESS = 2.0
STRETCH = EXCESS**0.5


@dataclass(frozen=True)
class StepControl:
    """State of the step-size control.

    length: h, of the next attempted step; duration (h) and estimate: of the last accepted step,
    zero before the first step.
    """

    length: float
    duration: float = 0.0
    estimate: float = 0.0


def fit_to_interval(length: float, remaining: float, stretch: float = 1.0) -> float:
    """Length (h) of a step of about ``length`` (h) that leaves no tiny rest of ``remaining`` (h).

    The step may be up to ``stretch`` times as long as ``length`` if it is then the last step.
    """
    if stretch * length >= remaining * (1 - 1e-9):
        return remaining
    return min(length, remaining / 2) if 2 * length > remaining else length


def allowed_ratio(estimate: float, tolerance: float, largest: float = FASTER) -> float:
    """Ratio of the length that the tolerance allows to the length of the step with ``estimate``."""
    if estimate <= 0:
        return largest
    return min(largest, max(1 / FASTER, SAFETY * (tolerance / estimate) ** 0.5))


def exceeds_tolerance(control: StepControl, tolerance: float) -> bool:
    """Does the last step miss the tolerance? Only a step of the least length may."""
    return control.estimate > EXCESS * tolerance * (1 + 1e-9)


def next_step_size(control: StepControl, duration: float, estimate: float,
                   tolerance: float) -> StepControl:
    """Step control after an accepted step of ``duration`` (h).

    The next step is at most FASTER times as long. If the planned step was shortened, the next step
    may be as long as the planned one.
    """
    largest = max(FASTER, control.length / duration)
    factor = allowed_ratio(estimate, tolerance, largest)
    if control.estimate > 0 and estimate > 0:
        rise = max(1.0, (estimate / control.estimate) ** 0.5 * control.duration / duration)
        factor = min(factor, max(1 / FASTER, allowed_ratio(estimate, tolerance, np.inf) / rise))
    return StepControl(duration * factor, duration, estimate)
