"""Interface of the elastic energies."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import ClassVar

import numpy as np

from repro.scene import Growth


class Energy(ABC):
    """Energy mu_L w(I) per volume at t = 0, with the isochoric invariant I = J^(-2/3) tr C.

    In plane strain tr C = F : F + 1. Let a = 2 dw/dI and c = 4 d2w/dI2. The stress and the tangent
    of :mod:`repro.model.growth` contain A = a J^(-2/3). The tangent also contains the term
    c (G : dF) G with G = J^(-2/3) (F - tr C / 3 H). The shear modulus is mu_L if a = 1 at I = 3.

    crease: elastic stretch at which a free surface creases; biot: elastic stretch below which waves
    of every length lower the energy. Both are None if no limits are derived for the energy. A run
    with this energy never ends as a fold.
    """

    crease: ClassVar[float | None] = None
    biot: ClassVar[float | None] = None

    @property
    def invariant_limit(self) -> float:
        """Upper limit of I, which I does not reach."""
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
        """(...) a after growth by theta (...) without a change of shape. The modulus for small
        further strains is a theta^(-2/3) mu_L."""
        return self.stiffness(theta ** (-2 / 3) * (2 * theta + 1))
