"""The derivative in Newton's method: factorised anew for every step, or used again while it still does enough.

With the derivative of an earlier iterate the defect falls by about the same factor in every step, instead of by its
square: cheaper by far on a large mesh, where factorising is what a step costs.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

#: A factorisation is used again where the last step with it left no more than this part of the defect.
ENOUGH = 0.01


@dataclass(eq=False)
class Jacobian:
    """The derivative in one solution by Newton's method. reused: is it used again? factors: it, factorised."""

    reused: bool
    factors: Any = None
    _defect: float = 0.0

    def stale(self, defect: float) -> bool:
        """At an iterate with a relative defect: must the derivative be factorised anew?"""
        last, self._defect = self._defect, defect
        return self.factors is None or not self.reused or defect > ENOUGH * last
