"""Kinetics (2.2): uptake of the substrates (7)-(8), growth and decay of biomass (9)-(10).

With the fractions m_A(C_A) and m_D(C_D) of a law of uptake (:mod:`repro.model.uptake_law`):

    F1 = -X_A m_A (k F m_D + d_c f_d b)        F3 = X_A m_A (k Y m_D - b)
    F2 = -k X_A m_A m_D                        F4 = X_A m_A b (1 - f_d)

[E3]: the demand of decay is d_c f_d b. [E1]: F is the 1.52 of Table 1 by default, not COD - Y d_c =
1.5138. So, for all fractions, F3 + F4 = -Y F2 + (F1 - F F2) / d_c: donor becomes biomass, and decay
takes up acceptor.

Uptake and growth are functions of max(C, 0). Only the linearisation of the transient scheme uses
the extension of a law below zero: the uptake of a substrate continues linearly below zero in its
own concentration and takes the other one as zero.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from repro.model.uptake_law import UptakeLaw, Values, uptake_law
from repro.scene import Kinetics, Substrates


@dataclass(frozen=True, eq=False)
class RateLaw:
    """The rates (7)-(10) per active biomass, 1/h.

    Parameters
    ----------
    constants : Kinetics
        k, Y, b, f_d, d_c and F.
    both : UptakeLaw
        The law of uptake of acceptor and donor at once.
    """

    constants: Kinetics
    both: UptakeLaw

    def fractions(self, acceptor: Values, donor: Values) -> tuple[Values, Values]:
        """m_A and m_D at C_A and C_D (mg/L), arrays or numbers."""
        of_acceptor, of_donor = self.both
        return of_acceptor.fraction(acceptor), of_donor.fraction(donor)

    def uptake(self, acceptor: Values, donor: Values) -> tuple[Values, Values]:
        """-F1 / X_A and -F2 / X_A at C_A and C_D (mg/L)."""
        return self.uptake_at(*self.fractions(acceptor, donor))

    def growth_rate(self, acceptor: Values, donor: Values) -> Values:
        """F3 / X_A, net growth of active biomass (9), at C_A and C_D (mg/L)."""
        m_a, m_d = self.fractions(acceptor, donor)
        return m_a * self.growth_per_acceptor(m_d)

    def inert_rate(self, acceptor: Values) -> Values:
        """F4 / X_A, inert remains of decay (10), at C_A (mg/L)."""
        of_acceptor, _ = self.both
        m_a = of_acceptor.fraction(acceptor)
        constants = self.constants
        return m_a * constants.decay_coefficient * (1 - constants.degradable_fraction)

    def uptake_at(self, m_a: Values, m_d: Values) -> tuple[Values, Values]:
        """-F1 / X_A and -F2 / X_A at the fractions."""
        return m_a * self.per_acceptor(m_d), self.per_donor(m_a) * m_d

    def own_uptake(self, substrate: int, acceptor: Values, donor: Values) -> tuple[Values, Values]:
        """Uptake of the acceptor (0) or the donor (1) at C_A and C_D, extended below zero in that
        substrate's concentration, and its derivative by this concentration."""
        concentration, other = (acceptor, donor) if substrate == 0 else (donor, acceptor)
        laws = tuple(self.both)
        fraction, slope = laws[substrate].extended(concentration)
        of_other = laws[1 - substrate].fraction(other)
        per_own = self.per_acceptor(of_other) if substrate == 0 else self.per_donor(of_other)
        return fraction * per_own, slope * per_own

    def uptake_slopes(self, m_a: np.ndarray, m_d: np.ndarray) -> np.ndarray:
        """(2, 2, ...) derivatives of :meth:`uptake_at` by m_A and m_D."""
        k = self.constants.maximum_utilization_rate
        demand = k * self.constants.acceptor_to_donor_ratio
        return np.stack([[self.per_acceptor(m_d), demand * m_a], [k * m_d, self.per_donor(m_a)]])

    def growth_slopes(self, m_a: np.ndarray, m_d: np.ndarray) -> np.ndarray:
        """(2, ...) derivatives of F3 / X_A by m_A and m_D."""
        return np.stack([self.growth_per_acceptor(m_d), self.fastest_growth * m_a])

    def per_acceptor(self, m_d: Values) -> Values:
        """-F1 / X_A per m_A: k F m_D + d_c f_d b."""
        k = self.constants.maximum_utilization_rate
        return k * self.constants.acceptor_to_donor_ratio * m_d + decay_demand(self.constants)

    def per_donor(self, m_a: Values) -> Values:
        """-F2 / X_A per m_D: k m_A."""
        return self.constants.maximum_utilization_rate * m_a

    def growth_per_acceptor(self, m_d: Values) -> Values:
        """F3 / X_A per m_A: k Y m_D - b."""
        return self.fastest_growth * m_d - self.constants.decay_coefficient

    @property
    def fastest_growth(self) -> float:
        """k Y, growth at m_A = m_D = 1 without decay."""
        return self.constants.maximum_utilization_rate * self.constants.yield_coefficient


def rate_law(substrates: Substrates, kinetics: Kinetics) -> RateLaw:
    """The rates of a scene."""
    return RateLaw(kinetics, uptake_law(substrates, kinetics))


def decay_demand(kinetics: Kinetics) -> float:
    """d_c f_d b (1/h): the acceptor that decay takes up per active biomass at m_A = 1 [E3]."""
    return kinetics.decay_oxygen_demand * kinetics.degradable_fraction * kinetics.decay_coefficient


def mean_growth(exponent: np.ndarray) -> np.ndarray:
    """(e^z - 1) / z, the mean over a step of a quantity that grows by the factor e^z."""
    zero = exponent == 0
    z = np.where(zero, 1.0, exponent)
    return np.where(zero, 1.0, np.expm1(z) / z)


def mean_growth_slope(exponent: np.ndarray, mean: np.ndarray) -> np.ndarray:
    """Derivative by z of :func:`mean_growth`, whose value is ``mean``."""
    small = np.abs(exponent) < 1e-4
    z = np.where(small, 1.0, exponent)
    return np.where(small, 0.5 + exponent / 3, (np.exp(z) - mean) / z)


def grow(active: np.ndarray, inert: np.ndarray, growth: np.ndarray, remains: np.ndarray,
         step: float) -> tuple[np.ndarray, np.ndarray]:
    """(9)-(10) integrated exactly over a step (h) at constant rates: X_A grows by exp(growth step).

    active, inert: X_A, X_I, mg/L, or masses of them; growth, remains: F3/X_A and F4/X_A (1/h).
    Returns the new X_A and X_I.
    """
    mean = mean_growth(growth * step)
    return active * (1 + growth * step * mean), inert + active * mean * remains * step


@dataclass(frozen=True, eq=False)
class Sink:
    """Active biomass that takes up substrates, at an instant or while it grows over a time.

    active: (r, q) um2 mg/L, masses at the points of the reaction; duration: h, the time over which
    it grows, or zero. Over a time the mean mass takes up substrates. It grows at the rates of the
    concentrations being solved for, so that uptake and growth are one integral.

    All methods are functions of the fractions m_A and m_D, (2, r, q).
    """

    active: np.ndarray
    duration: float = 0.0

    def _exponent(self, fractions: np.ndarray, law: RateLaw) -> np.ndarray:
        """(r, q) growth of ln X_A over the time."""
        m_a, m_d = fractions
        return self.duration * m_a * law.growth_per_acceptor(m_d)

    def uptake(self, fractions: np.ndarray, law: RateLaw) -> np.ndarray:
        """(r, 2, q) um2 mg/L/h, uptake of the acceptor and of the donor."""
        mass = self.active
        if self.duration > 0:
            mass = self.active * mean_growth(self._exponent(fractions, law))
        return mass[:, None] * np.stack(law.uptake_at(*fractions), axis=1)

    def slopes(self, fractions: np.ndarray, law: RateLaw) -> np.ndarray:
        """(2, 2, r, q) um2 mg/L/h, derivatives of :meth:`uptake`, of acceptor and donor, by m_A and
        m_D."""
        by = law.uptake_slopes(*fractions)
        if self.duration == 0:
            return self.active * by
        exponent = self._exponent(fractions, law)
        mean = mean_growth(exponent)
        rise = mean_growth_slope(exponent, mean)
        growth = self.duration * law.growth_slopes(*fractions)
        rates = np.stack(law.uptake_at(*fractions))
        return self.active * (mean * by + rise * rates[:, None] * growth[None])
