"""Refinement studies: errors on at least four unrelated meshes or steps, orders between neighbours, judged two-sidedly.

An order above its band fails like one below it: a surprise has to be explained before it is expected.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import inf

import numpy as np

from verification.case import rounded

FEWEST = 4
#: Half width of the band around an expected order: errors on unrelated meshes scatter by a tenth or two, which between
#: neighbours whose sizes differ by a factor of 2 is an order of 0.2 or 0.3.
BAND = 0.3


@dataclass(frozen=True, eq=False)
class Study:
    """Errors (k,) on a series of sizes (k,), falling: orders between neighbours must lie from low to high.

    ceiling: the last error must not exceed it; origin: where the expected order comes from.
    """

    quantity: str
    sizes: np.ndarray
    errors: np.ndarray
    low: float
    high: float
    origin: str
    ceiling: float = inf

    def __post_init__(self):
        if len(self.sizes) < FEWEST or len(self.sizes) != len(self.errors) or not (np.diff(self.sizes) < 0).all():
            raise ValueError(f"{self.quantity}: a study takes {FEWEST} or more falling sizes, and an error of each")

    @property
    def orders(self) -> np.ndarray:
        """(k - 1,) log of the ratio of errors over log of the ratio of sizes; not-a-number where an error is not
        positive and finite."""
        good = np.isfinite(self.errors) & (np.asarray(self.errors) > 0)
        logs = np.log(np.where(good, self.errors, 1.0))
        slopes = np.diff(logs) / np.diff(np.log(self.sizes))
        return np.where(good[1:] & good[:-1], slopes, np.nan)

    @property
    def holds(self) -> bool:
        """Are all orders in the band, and is the last error under its ceiling?"""
        orders = self.orders
        return bool(((self.low <= orders) & (orders <= self.high)).all() and self.errors[-1] <= self.ceiling)

    @property
    def measured(self) -> str:
        """Orders to a tenth, and the last error to one digit."""
        return f"order {', '.join(f'{order:.1f}' for order in self.orders)}; last error {self._last}"

    @property
    def _last(self) -> str:
        error = float(self.errors[-1])
        if np.isfinite(self.ceiling):
            return rounded(error, self.ceiling / 20)
        return f"{error:.0e}"

    @property
    def expected(self) -> str:
        """The band, and the ceiling where there is one."""
        band = f"order {self.low:.3g} to {self.high:.3g}"
        return band if self.ceiling == inf else f"{band}; at most {self.ceiling:.3g}"


def study(quantity: str, sizes, errors, order: float, origin: str, *, ceiling: float = inf,
          band: float = BAND) -> Study:
    """A study whose orders are expected within ``band`` of ``order``."""
    return Study(quantity, np.asarray(sizes, float), np.asarray(errors, float), order - band, order + band, origin,
                 ceiling)


def refine(measure: Callable[..., dict[str, float]], sizes, *given) -> dict[str, np.ndarray]:
    """Errors of each field on each size: ``measure(size, *given)`` gives {field: error}."""
    rows = [measure(size, *given) for size in sizes]
    return {name: np.array([row[name] for row in rows]) for name in rows[0]}
