"""Dual Monod kinetics (2.2): sinks of the substrates (7)-(8), growth and decay of the biomass (9)-(10).

With m_A = C_A / (C_A + K_sA) and m_D alike:

    F1 = -X_A m_A (k F m_D + d_c f_d b)        F3 = X_A m_A (k Y m_D - b)
    F2 = -k X_A m_A m_D                        F4 = X_A m_A b (1 - f_d)

[E3]: the demand of decay is d_c f_d b. [E1]: F is the 1.52 of Table 1 by default, not COD - Y d_c = 1.5138.

Below zero, which no solution is but an iterate can be, each sink goes on linearly in its own substrate and takes the
other as zero: it stays monotone, so that Newton's method has no negative root to fall into.
"""

from __future__ import annotations

import numpy as np


def fraction(concentration, half_saturation: float):
    """m of :func:`monod` alone."""
    return concentration / (np.maximum(concentration, 0.0) + half_saturation)


def monod(concentration, half_saturation: float):
    """m = C / (C + K) and dm/dC for C >= 0; below zero their tangent at zero, C / K and 1 / K. Shapes as C's (mg/L)."""
    bounded = np.maximum(concentration, 0.0) + half_saturation
    return concentration / bounded, half_saturation / bounded**2


def _both(acceptor, donor, substrates):
    """:func:`monod` of the acceptor and of the donor."""
    return monod(acceptor, substrates.acceptor.half_saturation), monod(donor, substrates.donor.half_saturation)


def _fractions(acceptor, donor, substrates):
    """:func:`fraction` of the acceptor and of the donor."""
    return fraction(acceptor, substrates.acceptor.half_saturation), fraction(donor, substrates.donor.half_saturation)


def decay_demand(kinetics) -> float:
    """d_c f_d b (1/h): the acceptor that decay takes up per active biomass at m_A = 1 [E3]."""
    return kinetics.decay_oxygen_demand * kinetics.degradable_fraction * kinetics.decay_coefficient


def uptake(acceptor, donor, substrates, kinetics):
    """Uptake per active biomass (1/h): -F1/X_A, -F2/X_A and their derivatives (1/h per mg/L).

    acceptor, donor: C_A and C_D (mg/L). Returns (q_A, q_D, ((dq_A/dC_A, dq_A/dC_D), (dq_D/dC_A, dq_D/dC_D))).
    """
    (m_a, d_a), (m_d, d_d) = _both(acceptor, donor, substrates)
    k, demand, decay = kinetics.maximum_utilization_rate, kinetics.acceptor_to_donor_ratio, decay_demand(kinetics)
    other_a, slope_a = np.maximum(m_a, 0.0), np.where(acceptor > 0, d_a, 0.0)
    other_d, slope_d = np.maximum(m_d, 0.0), np.where(donor > 0, d_d, 0.0)
    per_acceptor = k * demand * other_d + decay
    jacobian = ((d_a * per_acceptor, m_a * k * demand * slope_d), (k * slope_a * m_d, k * other_a * d_d))
    return m_a * per_acceptor, k * other_a * m_d, jacobian


def paired_uptake(acceptor, donor, substrates, kinetics):
    """(q_A, q_D) as :func:`uptake`'s (1/h), but with one rate r = k m_A m_D for both substrates below zero too, where
    quadratic functions may go by a little: what is taken up of one stays in proportion to the other. r is zero where
    both are negative.
    """
    m_a, m_d = _fractions(acceptor, donor, substrates)
    rate = _paired_most(m_a, m_d, kinetics) * m_a * m_d
    return kinetics.acceptor_to_donor_ratio * rate + decay_demand(kinetics) * m_a, rate


def paired_slopes(acceptor, donor, substrates, kinetics):
    """Derivatives of :func:`paired_uptake` (1/h per mg/L): ((dq_A/dC_A, dq_A/dC_D), (dq_D/dC_A, dq_D/dC_D))."""
    (m_a, d_a), (m_d, d_d) = _both(acceptor, donor, substrates)
    demand, k = kinetics.acceptor_to_donor_ratio, _paired_most(m_a, m_d, kinetics)
    by_a, by_d = k * d_a * m_d, k * m_a * d_d
    return (demand * by_a + decay_demand(kinetics) * d_a, demand * by_d), (by_a, by_d)


def _paired_most(m_a, m_d, kinetics):
    """k (1/h), and zero where both fractions are negative."""
    return np.where((m_a < 0) & (m_d < 0), 0.0, kinetics.maximum_utilization_rate)


def growth_rate(acceptor, donor, substrates, kinetics):
    """F3 / X_A (1/h), net growth of active biomass (9)."""
    m_a, m_d = _fractions(acceptor, donor, substrates)
    return m_a * (kinetics.maximum_utilization_rate * kinetics.yield_coefficient * m_d - kinetics.decay_coefficient)


def inert_rate(acceptor, substrates, kinetics):
    """F4 / X_A (1/h), inert remains left by decay (10)."""
    m_a = fraction(acceptor, substrates.acceptor.half_saturation)
    return m_a * kinetics.decay_coefficient * (1 - kinetics.degradable_fraction)


def grow(active, inert, growth, remains, step: float):
    """(9)-(10) integrated over a step (h) at constant rates: X_A grows by exp(growth step), exactly.

    active, inert: X_A, X_I (mg/L); growth, remains: F3/X_A and F4/X_A (1/h). Returns the new X_A, X_I.
    """
    exponent = growth * step
    small = np.abs(exponent) < 1e-12
    mean = np.where(small, 1.0, np.expm1(exponent) / np.where(small, 1.0, exponent))
    return active * np.exp(exponent), inert + active * mean * remains * step
