"""Dual Monod kinetics (2.2): uptake of the substrates (7)-(8), growth and decay (9)-(10).

With m_A = C_A / (C_A + K_sA) and m_D alike:

    F1 = -X_A m_A (k F m_D + d_c f_d b)        F3 = X_A m_A (k Y m_D - b)
    F2 = -k X_A m_A m_D                        F4 = X_A m_A b (1 - f_d)

[E3]: the demand of decay is d_c f_d b. [E1]: F is the 1.52 of Table 1 by default, not COD - Y d_c =
1.5138. So, for whatever concentrations, F3 + F4 = -Y F2 + (F1 - F F2) / d_c: biomass is made of
donor, and what decays takes acceptor.

Uptake and growth are functions of max(C, 0). The transient scheme's linearisation alone asks for
the *extended* uptake, which goes on linearly below zero in its own substrate and takes the other as
zero: it stays monotone.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias, TypeVar

import numpy as np

from repro.scene import Kinetics, Substrates

#: A number, or an array of them: results are shaped alike.
Values = TypeVar("Values", np.ndarray, float)
Slopes: TypeAlias = tuple[tuple[np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray]]


def monod(concentration: Values, half_saturation: float) -> tuple[Values, Values]:
    """m = C / (C + K) and dm/dC for C >= 0 (mg/L); below zero their tangent at zero, C / K and
    1 / K."""
    bounded = np.maximum(concentration, 0.0) + half_saturation
    return concentration / bounded, half_saturation / bounded**2


def decay_demand(kinetics: Kinetics) -> float:
    """d_c f_d b (1/h): the acceptor that decay takes up per active biomass at m_A = 1 [E3]."""
    return kinetics.decay_oxygen_demand * kinetics.degradable_fraction * kinetics.decay_coefficient


def fractions(acceptor: Values, donor: Values, substrates: Substrates) -> tuple[Values, Values]:
    """m_A and m_D of max(C, 0)."""
    return (monod(np.maximum(acceptor, 0.0), substrates.acceptor.half_saturation)[0],
            monod(np.maximum(donor, 0.0), substrates.donor.half_saturation)[0])


def uptake(acceptor: Values, donor: Values, substrates: Substrates, kinetics: Kinetics,
           extended: bool = False) -> tuple[Values, Values]:
    """Uptake per active biomass (1/h): -F1/X_A and -F2/X_A at C_A and C_D (mg/L).

    extended: goes on linearly below zero, see the module's docstring.
    """
    if not extended:
        return _of_fractions(*fractions(acceptor, donor, substrates), kinetics)
    m_a = monod(acceptor, substrates.acceptor.half_saturation)[0]
    m_d = monod(donor, substrates.donor.half_saturation)[0]
    k = kinetics.maximum_utilization_rate
    demand = kinetics.acceptor_to_donor_ratio
    per_acceptor = k * demand * np.maximum(m_d, 0.0) + decay_demand(kinetics)
    return m_a * per_acceptor, k * np.maximum(m_a, 0.0) * m_d


def uptake_slopes(acceptor: np.ndarray, donor: np.ndarray, substrates: Substrates,
                  kinetics: Kinetics, extended: bool = False) -> Slopes:
    """Derivatives of :func:`uptake`: ((dq_A/dC_A, dq_A/dC_D), (dq_D/dC_A, dq_D/dC_D)), 1/h per
    mg/L."""
    m_a, d_a = monod(acceptor, substrates.acceptor.half_saturation)
    m_d, d_d = monod(donor, substrates.donor.half_saturation)
    k = kinetics.maximum_utilization_rate
    demand = kinetics.acceptor_to_donor_ratio
    other_a = np.maximum(m_a, 0.0)
    other_d = np.maximum(m_d, 0.0)
    cross_a = np.where(acceptor > 0, d_a, 0.0)
    cross_d = np.where(donor > 0, d_d, 0.0)
    if not extended:
        m_a, d_a = other_a, cross_a
        m_d, d_d = other_d, cross_d
    per_acceptor = k * demand * other_d + decay_demand(kinetics)
    of_acceptor = d_a * per_acceptor, m_a * k * demand * cross_d
    of_donor = k * cross_a * m_d, k * other_a * d_d
    return of_acceptor, of_donor


def growth_rate(acceptor: Values, donor: Values, substrates: Substrates,
                kinetics: Kinetics) -> Values:
    """F3 / X_A (1/h), net growth of active biomass (9)."""
    m_a, m_d = fractions(acceptor, donor, substrates)
    most = kinetics.maximum_utilization_rate * kinetics.yield_coefficient
    return m_a * (most * m_d - kinetics.decay_coefficient)


def inert_rate(acceptor: Values, substrates: Substrates, kinetics: Kinetics) -> Values:
    """F4 / X_A (1/h), inert remains left by decay (10)."""
    m_a = monod(np.maximum(acceptor, 0.0), substrates.acceptor.half_saturation)[0]
    return m_a * kinetics.decay_coefficient * (1 - kinetics.degradable_fraction)


def mean_growth(exponent: np.ndarray) -> np.ndarray:
    """(e^z - 1) / z, the mean over a step of what grows by e^z in it."""
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
    Returns the new two.
    """
    mean = mean_growth(growth * step)
    return active * (1 + growth * step * mean), inert + active * mean * remains * step


@dataclass(frozen=True, eq=False)
class Sink:
    """Active biomass that takes up substrates, as it is or as it grows over a time.

    active: (r, q) um2 mg/L, masses at the points of the reaction; duration: h, the time over which
    it grows meanwhile, zero: as it is. Over a time its mean mass takes part, at the growth rate of
    the very concentrations that are sought: what is taken up and what is made are one integral.

    All of it is a function of the fractions m_A and m_D, (2, r, q).
    """

    active: np.ndarray
    duration: float = 0.0

    def _exponent(self, fractions: np.ndarray, kinetics: Kinetics) -> np.ndarray:
        """(r, q) growth of ln X_A over the time."""
        m_a, m_d = fractions
        most = kinetics.maximum_utilization_rate * kinetics.yield_coefficient
        return self.duration * m_a * (most * m_d - kinetics.decay_coefficient)

    def uptake(self, fractions: np.ndarray, kinetics: Kinetics) -> np.ndarray:
        """(r, 2, q) um2 mg/L/h, taken up of the acceptor and of the donor."""
        m_a, m_d = fractions
        mass = self.active
        if self.duration > 0:
            mass = self.active * mean_growth(self._exponent(fractions, kinetics))
        return mass[:, None] * np.stack(_of_fractions(m_a, m_d, kinetics), axis=1)

    def slopes(self, fractions: np.ndarray, kinetics: Kinetics) -> np.ndarray:
        """(2, 2, r, q) um2 mg/L/h, derivatives of :meth:`uptake`, of acceptor and donor, by m_A and
        m_D."""
        m_a, m_d = fractions
        k = kinetics.maximum_utilization_rate
        demand = kinetics.acceptor_to_donor_ratio
        of_acceptor = [k * demand * m_d + decay_demand(kinetics), k * demand * m_a]
        by = np.stack([of_acceptor, [k * m_d, k * m_a]])
        if self.duration == 0:
            return self.active * by
        most = k * kinetics.yield_coefficient
        exponent = self._exponent(fractions, kinetics)
        mean = mean_growth(exponent)
        rise = mean_growth_slope(exponent, mean)
        growth = self.duration * np.stack([most * m_d - kinetics.decay_coefficient, most * m_a])
        rates = np.stack(_of_fractions(m_a, m_d, kinetics))
        return self.active * (mean * by + rise * rates[:, None] * growth[None])


def _of_fractions(m_a: Values, m_d: Values, kinetics: Kinetics) -> tuple[Values, Values]:
    """Uptake of acceptor and donor per active biomass (1/h)."""
    k = kinetics.maximum_utilization_rate
    per_acceptor = k * kinetics.acceptor_to_donor_ratio * m_d + decay_demand(kinetics)
    return m_a * per_acceptor, k * m_a * m_d
