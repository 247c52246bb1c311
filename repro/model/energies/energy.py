"""What growth asks of an elastic energy."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import ClassVar

import numpy as np

from repro.scene import Growth


class Energy(ABC):
    """Energy mu_L w(I) per volume at t = 0, of I = J^(-2/3) tr C, which does not depend on J.

    In plane strain tr C = F : F + 1. With a = 2 dw/dI and c = 4 d2w/dI2, the stress and the tangent
    of :mod:`repro.model.growth` have A = a J^(-2/3), and the tangent has the further term
    c (G : dF) G, where G = J^(-2/3) (F - tr C / 3 H). The shear modulus mu_L requires a = 1 at
    I = 3.

    crease, biot: elastic stretches of a free surface at which it creases, and below which waves of
    every length lower the energy. An energy without them has no derived limits, and no run with it
    ends as a fold.
    """

    crease: ClassVar[float | None] = None
    biot: ClassVar[float | None] = None

    @property
    def invariant_limit(self) -> float:
        """I is smaller than this."""
        return np.inf

    @staticmethod
    @abstractmethod
    def of(growth: Growth) -> Energy:
        """The energy of a scene's section [growth]."""

    @abstractmethod
    def stiffness(self, invariant: np.ndarray) -> np.ndarray | float:
        """(...) a = 2 dw/dI at I (...)."""

    @abstractmethod
    def curvature(self, invariant: np.ndarray) -> np.ndarray | None:
        """(...) c = 4 d2w/dI2 at I (...); None if it is zero everywhere."""

    def growth_stiffness(self, theta: np.ndarray) -> np.ndarray | float:
        """(...) a after growth by theta (...) without a change of shape. Small strains then have
        the modulus a theta^(-2/3) mu_L."""
        return self.stiffness(theta ** (-2 / 3) * (2 * theta + 1))
