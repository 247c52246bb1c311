"""Newton's method, full or modified (with the derivative of an earlier iterate).

With the derivative of an earlier iterate the defect decreases linearly instead of quadratically.
The modified method is still far cheaper on a large mesh: there the factorisation dominates the cost
of an iteration.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol, TypeVar

import numpy as np

from repro.fem.assembly import Factored
from repro.polling import poll

#: The modified method keeps a factorisation as long as each iteration reduces the defect to at most
#: this part.
REQUIRED_REDUCTION = 0.01
#: The iteration stalls if the defect stays above this part of the previous one.
STALLED = 0.1


class Iterate(Protocol):
    """One Newton iterate with its residual and constraint state."""

    @property
    def defect(self) -> float:
        """Largest residual of a row, relative to the magnitude of its terms."""

    @property
    def complete(self) -> bool:
        """Does the iterate satisfy its constraints?"""


State = TypeVar("State", bound=Iterate)


class System(Protocol[State]):
    """Interface of a system of equations."""

    def factored(self, iterate: State) -> Factored:
        """Factorise the derivative at an iterate."""

    def advanced(self, iterate: State, factors: Factored, fresh: bool) -> State:
        """The next iterate; fresh: was the derivative computed at this iterate?"""

    def at_round_off(self, iterate: State) -> bool:
        """Can round-off explain the residual of an iterate?"""


@dataclass(frozen=True)
class Newton:
    """Newton's method.

    tolerance: of the defect; an iteration that stalls is also accepted at round-off; most: largest
    number of iterations; modified_newton: does the method keep the derivative while it suffices?;
    early: (n, defect): the method gives up if the defect after n iterations is larger.
    """

    tolerance: float
    most: int
    modified_newton: bool = False
    early: tuple[int, float] | None = None

    def solve(self, system: System[State], iterate: State) -> tuple[State, int, bool]:
        """The last iterate, the number of steps, and whether it converged."""
        factors: Factored | None = None
        previous = np.inf
        for count in range(self.most):
            poll()
            defect = iterate.defect
            if iterate.complete and solved(system, iterate, previous, self.tolerance):
                return iterate, count, True
            if self.early and count == self.early[0] and defect > self.early[1]:
                return iterate, count, False
            if not self.modified_newton or defect > REQUIRED_REDUCTION * previous:
                factors = None
            fresh = factors is None
            factors = factors or system.factored(iterate)
            previous = defect
            iterate = system.advanced(iterate, factors, fresh)
        return iterate, self.most, False


def solved(system: System[State], iterate: State, previous: float, tolerance: float) -> bool:
    """Is the defect of an iterate within a tolerance, or does round-off keep it above?

    previous: defect of the previous iterate.
    """
    defect = iterate.defect
    return defect <= tolerance or defect > STALLED * previous and system.at_round_off(iterate)


def relative(residual: np.ndarray, size: np.ndarray) -> float:
    """Largest residual, relative to the magnitude of its row's terms."""
    return float(np.max(np.abs(residual) / np.maximum(size, np.finfo(float).tiny), initial=0.0))
