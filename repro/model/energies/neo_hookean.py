"""The paper's energy (17): w = (I - 3) / 2."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from repro.model.energies.energy import Energy
from repro.scene import Growth

#: At this stretch of a free surface, a crease of any size lowers the energy.
CREASE = 0.647
#: Below this stretch, small waves of every length lower the energy.
BIOT = 0.544


@dataclass(frozen=True)
class NeoHookean(Energy):
    """An incompressible neo-Hookean solid.

    At a constant J the energy in the plane is that of an incompressible neo-Hookean solid. Its free
    surface creases at CREASE (Hong, Zhao and Suo, Appl. Phys. Lett. 95, 2009; Hohlfeld and
    Mahadevan, Phys. Rev. Lett. 106, 2011) and is unstable to waves of every length at BIOT (Biot,
    Appl. Sci. Res. A 12, 1963). ``docs/scope.md`` derives both for this energy.
    """

    crease: ClassVar[float | None] = CREASE
    biot: ClassVar[float | None] = BIOT

    @staticmethod
    def of(growth: Growth) -> NeoHookean:
        """The energy. Its only constant is mu_L."""
        return NEO_HOOKEAN

    def stiffness(self, invariant: np.ndarray) -> float:
        """1 everywhere."""
        return 1.0

    def curvature(self, invariant: np.ndarray) -> None:
        """Zero everywhere."""

    def growth_stiffness(self, theta: np.ndarray) -> float:
        """1 everywhere."""
        return 1.0


NEO_HOOKEAN = NeoHookean()
