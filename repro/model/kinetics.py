"""Kinetics (2.2): uptake of the substrates (7)-(8), growth and decay of biomass (9)-(10).

m_A(C_A) and m_D(C_D) are the fractions of a law of uptake (:mod:`repro.model.uptake_law`):

    F1 = -X_A m_A (k F m_D + d_c f_d b)        F3 = X_A m_A (k Y m_D - b)
    F2 = -k X_A m_A m_D                        F4 = X_A m_A b (1 - f_d)

[E3]: the demand of decay is d_c f_d b. [E1]: F is the 1.52 of Table 1 by default, not COD - Y d_c =
1.5138. So, for all fractions, F3 + F4 = -Y F2 + (F1 - F F2) / d_c: donor becomes biomass, and decay
takes up acceptor.

A substrate that the scene does not model is not limiting: its fraction is 1, and it has no
equation. With kinetics.decay = "unlimited", biomass also decays where m_A is below 1. The further
decay adds

    F3: -X_A (1 - m_A) b        F4: X_A (1 - m_A) b (1 - f_d)

The *unmet* demand is the demand that no modelled substrate meets. It consists of the demand for a
substrate that is not modelled, and of d_c f_d b (1 - m_A) X_A from the further decay. The identity
above is valid with the unmet demand added to -F1 and -F2.

Uptake and growth are functions of max(C, 0). Only the linearisation of the transient scheme extends
a law below zero: the uptake of a substrate is then linear in its own concentration, and a negative
concentration of the other substrate counts as zero.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from repro.fem.space import Space
from repro.model.uptake_law import UptakeLaw, Values, uptake_law
from repro.scene import Kinetics, Substrates

#: Least thickness of a front of zero order over the square root of a triangle's area: 0.22 of the
#: edge of an equilateral triangle. With 1/4, a concentration in member 25 of
#: `verification.problems.family` is below zero by 0.15 % of the supply on elements halved twice.
THINNEST = 1 / 3

@dataclass(frozen=True, eq=False)
class RateLaw:
    """The rates (7)-(10) per active biomass, 1/h.

    Parameters
    ----------
    constants : Kinetics
        k, Y, b, f_d, d_c and F.
    uptake_law : UptakeLaw
        The law of uptake of all modelled substrates.
    modelled : slice
        Indices of the modelled substrates in (acceptor, donor).

    Notes
    -----
    Methods take the concentrations (mg/L) of the modelled substrates in this order, as arrays or
    numbers.
    """

    constants: Kinetics
    uptake_law: UptakeLaw
    modelled: slice

    def on(self, space: Space, substrates: Substrates) -> RateLaw:
        """The law with half saturations K that a space's elements resolve, if the law is sharp.

        The front of an uptake q X_m has the thickness (D K / (q X_m))^1/2. K is chosen so that this
        is ``THINNEST`` times the square root of the area of a triangle, or of the area around a
        node. A concentration C penetrates to the depth (2 D C / (q X_m))^1/2. The square of
        thickness over depth is K / (2 C).
        """
        if not self.uptake_law.sharp:
            return self
        squares = THINNEST**2 * space.reaction.dx.sum(axis=1)[:, None]
        uptakes = self.constants.maximum_density * np.array(self.uptake_at(1.0, 1.0)[self.modelled])
        inside = [kind.diffusivity_in_aggregate for kind in substrates.modelled.values()]
        smallest = (uptakes / inside)[:, None, None] * squares
        return replace(self, uptake_law=replace(self.uptake_law, half_saturation=smallest))

    def fractions(self, *concentrations: Values) -> tuple[Any, Any]:
        """m_A and m_D; 1 for a substrate that is not modelled."""
        pair: list[Any] = [np.ones_like(concentrations[0])] * 2
        pair[self.modelled] = [law.fraction(c) for law, c in zip(self.uptake_law, concentrations)]
        return pair[0], pair[1]

    def completed(self, fractions: np.ndarray) -> np.ndarray:
        """(2, ...) m_A and m_D, from the fractions of the modelled substrates."""
        if len(fractions) == 2:
            return fractions
        pair = np.ones((2, *fractions.shape[1:]))
        pair[self.modelled] = fractions
        return pair

    def uptake(self, *concentrations: Values) -> tuple[Values, Values]:
        """-F1 / X_A and -F2 / X_A (1/h)."""
        return self.uptake_at(*self.fractions(*concentrations))

    def growth_rate(self, *concentrations: Values) -> Values:
        """F3 / X_A (1/h), net growth of active biomass (9)."""
        return self.growth_at(*self.fractions(*concentrations))

    def inert_rate(self, *concentrations: Values) -> Values:
        """F4 / X_A (1/h), inert remains of decay (10)."""
        m_a, _ = self.fractions(*concentrations)
        decay = m_a * self.constants.decay_coefficient + self.further_decay * (1 - m_a)
        return decay * (1 - self.constants.degradable_fraction)

    def growth_at(self, m_a: Values, m_d: Values) -> Values:
        """F3 / X_A (1/h) at the fractions m_A and m_D."""
        return m_a * self.growth_per_acceptor(m_d) - self.further_decay * (1 - m_a)

    def uptake_at(self, m_a: Values, m_d: Values) -> tuple[Values, Values]:
        """-F1 / X_A and -F2 / X_A (1/h) at the fractions m_A and m_D."""
        return m_a * self.per_acceptor(m_d), self.per_donor(m_a) * m_d

    def own_uptake(self, substrate: int, *concentrations: Values) -> tuple[Values, Values]:
        """Uptake of one substrate, extended below zero in its own concentration, and the derivative
        by this concentration; substrate: its index among the modelled substrates."""
        fraction, slope = tuple(self.uptake_law)[substrate].extended(concentrations[substrate])
        m_a, m_d = self.fractions(*concentrations)
        is_acceptor = self.modelled.start + substrate == 0
        per_own = self.per_acceptor(m_d) if is_acceptor else self.per_donor(m_a)
        return fraction * per_own, slope * per_own

    def unmet_at(self, m_a: Values, m_d: Values) -> np.ndarray:
        """(2, ...) 1/h, unmet demand for acceptor and donor, per active biomass."""
        unmet = np.stack(self.uptake_at(m_a, m_d))
        unmet[self.modelled] = 0.0
        constants = self.constants
        per_decay = constants.decay_oxygen_demand * constants.degradable_fraction
        unmet[0] += per_decay * self.further_decay * (1 - m_a)
        return unmet

    def uptake_slopes(self, m_a: np.ndarray, m_d: np.ndarray) -> np.ndarray:
        """(2, 2, ...) derivatives of :meth:`uptake_at` by m_A and m_D."""
        k = self.constants.maximum_utilization_rate
        demand = k * self.constants.acceptor_to_donor_ratio
        return np.stack([[self.per_acceptor(m_d), demand * m_a], [k * m_d, self.per_donor(m_a)]])

    def growth_slopes(self, m_a: np.ndarray, m_d: np.ndarray) -> np.ndarray:
        """(2, ...) derivatives of F3 / X_A by m_A and m_D."""
        by_acceptor = self.growth_per_acceptor(m_d) + self.further_decay
        return np.stack([by_acceptor, self.fastest_growth * m_a])

    def per_acceptor(self, m_d: Values) -> Values:
        """-F1 / X_A per m_A: k F m_D + d_c f_d b."""
        k = self.constants.maximum_utilization_rate
        return k * self.constants.acceptor_to_donor_ratio * m_d + decay_demand(self.constants)

    def per_donor(self, m_a: Values) -> Values:
        """-F2 / X_A per m_D: k m_A."""
        return self.constants.maximum_utilization_rate * m_a

    def growth_per_acceptor(self, m_d: Values) -> Values:
        """F3 / X_A per m_A, without the further decay: k Y m_D - b."""
        return self.fastest_growth * m_d - self.constants.decay_coefficient

    @property
    def further_decay(self) -> float:
        """Rate (1/h) of the further decay at m_A = 0: b if decay is unlimited, else 0."""
        return self.constants.decay_coefficient if self.constants.decay == "unlimited" else 0.0

    @property
    def fastest_growth(self) -> float:
        """k Y (1/h), growth at m_A = m_D = 1 without decay."""
        return self.constants.maximum_utilization_rate * self.constants.yield_coefficient


def rate_law(substrates: Substrates, kinetics: Kinetics) -> RateLaw:
    """The rates of a scene."""
    return RateLaw(kinetics, uptake_law(substrates, kinetics), substrates.places)


def decay_demand(kinetics: Kinetics) -> float:
    """d_c f_d b (1/h): uptake of acceptor by decay, per active biomass, at m_A = 1 [E3]."""
    return kinetics.decay_oxygen_demand * kinetics.degradable_fraction * kinetics.decay_coefficient


def mean_growth(exponent: np.ndarray) -> np.ndarray:
    """(e^z - 1) / z, the mean over a step of a quantity that grows by the factor e^z."""
    zero = exponent == 0
    z = np.where(zero, 1.0, exponent)
    return np.where(zero, 1.0, np.expm1(z) / z)


def mean_growth_slope(exponent: np.ndarray, mean: np.ndarray) -> np.ndarray:
    """Derivative of :func:`mean_growth` by z; mean: value of :func:`mean_growth`."""
    small = np.abs(exponent) < 1e-4
    z = np.where(small, 1.0, exponent)
    return np.where(small, 0.5 + exponent / 3, (np.exp(z) - mean) / z)


def grow(active: np.ndarray, inert: np.ndarray, growth: np.ndarray, remains: np.ndarray,
         step: float) -> tuple[np.ndarray, np.ndarray]:
    """Integrate (9)-(10) exactly over a step (h) at constant rates: X_A grows by exp(growth step).

    active, inert: X_A and X_I, as densities (mg/L) or masses; growth, remains: F3/X_A and F4/X_A
    (1/h). Returns the new X_A and X_I.
    """
    mean = mean_growth(growth * step)
    return active * (1 + growth * step * mean), inert + active * mean * remains * step


@dataclass(frozen=True, eq=False)
class Sink:
    """Active biomass that takes up substrates, at one time or during a step.

    active: (r, q) um2 mg/L, masses at the points of the reaction, at the start of the step;
    duration: h, of the step, zero for one time. During a step the mean mass takes up substrates.
    The mass grows at the rates of the concentrations being solved for, so that uptake and growth
    are one integral.

    All methods are functions of the fractions (s, r, q) of the modelled substrates.
    """

    active: np.ndarray
    duration: float = 0.0

    def _exponent(self, fractions: np.ndarray, law: RateLaw) -> np.ndarray:
        """(r, q) growth of ln X_A during the step, at m_A and m_D."""
        return self.duration * law.growth_at(*fractions)

    def _mass(self, fractions: np.ndarray, law: RateLaw) -> np.ndarray:
        """(r, q) um2 mg/L, the active mass, or its mean over the step, at m_A and m_D."""
        if self.duration == 0:
            return self.active
        return self.active * mean_growth(self._exponent(fractions, law))

    def uptake(self, fractions: np.ndarray, law: RateLaw) -> np.ndarray:
        """(r, s, q) um2 mg/L/h, uptake of the modelled substrates."""
        pair = law.completed(fractions)
        rates = law.uptake_at(*pair)[law.modelled]
        return self._mass(pair, law)[:, None] * np.stack(rates, axis=1)

    def unmet(self, fractions: np.ndarray, law: RateLaw) -> np.ndarray:
        """(2,) um2 mg/L/h, the unmet demand for acceptor and donor."""
        pair = law.completed(fractions)
        return (self._mass(pair, law) * law.unmet_at(*pair)).sum(axis=(1, 2))

    def slopes(self, fractions: np.ndarray, law: RateLaw) -> np.ndarray:
        """(s, s, r, q) um2 mg/L/h, derivatives of :meth:`uptake` by the fractions."""
        pair = law.completed(fractions)
        by = law.uptake_slopes(*pair)
        if self.duration > 0:
            exponent = self._exponent(pair, law)
            mean = mean_growth(exponent)
            rise = mean_growth_slope(exponent, mean)
            growth = self.duration * law.growth_slopes(*pair)
            rates = np.stack(law.uptake_at(*pair))
            by = mean * by + rise * rates[:, None] * growth[None]
        return self.active * by[law.modelled, law.modelled]
