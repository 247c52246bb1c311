"""Newton's method: one driver, full or modified (the derivative of an earlier iterate is kept).

With the derivative of an earlier iterate the defect falls by about the same factor in every step,
instead of by its square: cheaper by far on a large mesh, where factorising is what a step costs.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol, TypeVar

import numpy as np

from repro.fem.assembly import Factored

#: Modified Newton: a factorisation is kept while each step cuts the defect to this part or less.
ENOUGH = 0.01
#: Where round-off keeps the defect from falling: the least fall of a step that still counts.
STALLED = 0.1


class Iterate(Protocol):
    """An iterate with what is known of it."""

    @property
    def defect(self) -> float:
        """Largest residual of a row over the size of its terms."""

    @property
    def complete(self) -> bool:
        """Does it meet its constraints?"""


It = TypeVar("It", bound=Iterate)


class System(Protocol[It]):
    """What the driver asks of a system of equations."""

    def factored(self, iterate: It) -> Factored:
        """The derivative at an iterate, factorised."""

    def advanced(self, iterate: It, factors: Factored, fresh: bool) -> It:
        """The next iterate; fresh: the derivative is that of this iterate."""


@dataclass(frozen=True)
class Newton:
    """tolerance: of the defect; round_off: a defect that is enough where it does not fall any more;
    most: iterations; reused: is the derivative kept while it does enough?"""

    tolerance: float
    round_off: float
    most: int
    reused: bool = False

    def solve(self, system: System[It], iterate: It) -> tuple[It, int, bool]:
        """The last iterate, how many steps led to it, and whether it has converged."""
        factors: Factored | None = None
        last = np.inf
        for count in range(self.most):
            defect = iterate.defect
            stalled = STALLED * last < defect <= self.round_off
            if iterate.complete and (defect <= self.tolerance or stalled):
                return iterate, count, True
            if not self.reused or defect > ENOUGH * last:
                factors = None
            fresh = factors is None
            factors = factors or system.factored(iterate)
            last = defect
            iterate = system.advanced(iterate, factors, fresh)
        return iterate, self.most, False


def relative(residual: np.ndarray, size: np.ndarray) -> float:
    """Largest residual against the size of its row's terms."""
    return float(np.max(np.abs(residual) / np.maximum(size, np.finfo(float).tiny), initial=0.0))
