"""Gent's energy: w = -(J_m / 2) ln(1 - (I - 3) / J_m). It stiffens towards a limit of I."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from repro.errors import GrowthError
from repro.model.energies.energy import Energy
from repro.scene import Growth


@dataclass(frozen=True)
class Gent(Energy):
    """A solid whose I stays below 3 + J_m (Gent, Rubber Chem. Technol. 69, 1996).

    limit: J_m. Growth by theta alone gives I = theta^(-2/3) (2 theta + 1), because F33 = 1. So
    theta = 36 needs J_m above 3.7, and theta = 1000 needs J_m above 17.
    """

    limit: float

    @staticmethod
    def of(growth: Growth) -> Gent:
        """The energy with the limit J_m of a scene."""
        return Gent(growth.limiting_invariant)

    @property
    def invariant_limit(self) -> float:
        """Upper limit of I, which I does not reach."""
        return 3 + self.limit

    def stiffness(self, invariant: np.ndarray) -> np.ndarray:
        """J_m / (J_m + 3 - I). Raises GrowthError where I is not below its limit."""
        return self.limit / self._room(invariant)

    def curvature(self, invariant: np.ndarray) -> np.ndarray:
        """2 J_m / (J_m + 3 - I)^2."""
        return 2 * self.limit / self._room(invariant) ** 2

    def _room(self, invariant: np.ndarray) -> np.ndarray:
        """(...) distance of I from its limit. Raises GrowthError if it is not positive."""
        room = self.invariant_limit - invariant
        if room.min() <= 0:
            raise GrowthError(f"the strain reaches the limit of Gent's energy: I - 3 is "
                              f"{np.max(invariant) - 3:.3g}, and growth.limiting_invariant is "
                              f"{self.limit:g}")
        return room
