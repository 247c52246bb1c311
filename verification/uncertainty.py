"""Numerical uncertainty of a computed number, from its values on three or more meshes, or time steps.

The Grid Convergence Index (Roache 1994, 1998) bounds the distance of a number f from its limit f_0 as the size h of the
elements, or of the steps, goes to zero. With f_i = f_0 + a h_i^p on sizes h_i,

    GCI = Fs |a| h^p,    which on two sizes is    Fs |f_2 - f_1| / (r^p - 1),    r = h_2 / h_1

Three values give f_0, a and the observed order p (Celik et al. 2008 find p by iteration: ratios r need not be equal).
Values on unrelated meshes scatter about this law. Four or more of them are fitted by least squares, and the bar
includes the standard deviation s of the fit and the number's own distance from it (Eca & Hoekstra 2014):

    Fs = 1.25    bar = 1.25 |a| h^p + s + |f - fit|                         where the observed order is reasonable
    Fs = 3       bar = 3 (max f - min f) h^q / (h_max^q - h_min^q)          where it is not: q is the formal order

An observed order is reasonable under two conditions. It lies between half an order under the lowest formal order
(0.5 if that is one, Eca & Hoekstra's bound) and half an order over the highest, because an order scatters by some
tenths on unrelated meshes. And the values scatter about the law (s) less than they differ, on average, from one size to
the next. If the observed order exceeds the lowest formal one, the law is fitted with the formal order: if the values of
a first-order law scatter by a tenth of the error, the observed order is as often near two, and a bar with it covers
three errors in four, not nineteen in twenty. In the second case q is the lowest formal order, and the range of all
values covers oscillation and noise, as in Eca & Hoekstra's estimator for data that do not converge monotonically. The
factors are those that Roache gives for at least three sizes and for two.

    P. J. Roache, J. Fluids Eng. 116 (1994) 405; Verification and Validation in Computational Science and Engineering,
    Hermosa, 1998. I. B. Celik et al., J. Fluids Eng. 130 (2008) 078001. L. Eca, M. Hoekstra, J. Comput. Phys. 262
    (2014) 104.
"""

from dataclasses import dataclass
from math import nan

import numpy as np
from scipy.optimize import minimize_scalar

#: How far an order may be from a formal one.
BAND = 0.5
#: Roache's factors of safety.
OBSERVED, FORMAL = 1.25, 3.0
FEWEST = 3
#: Relative difference below which values are equal up to round-off.
SAME = 1e-12
#: Range of the search for the observed order; a minimum at either end does not count as an observed order.
SOUGHT = np.linspace(0.05, 8.0, 160)


@dataclass(frozen=True)
class Estimate:
    """bar: half width, in the number's unit; order: the observed one, not-a-number where none fits; factor: Fs. A
    number that is equal on all sizes has a bar and a factor of zero."""

    bar: float
    order: float
    factor: float


@dataclass(frozen=True)
class Bar:
    """Interval of a number. mesh, step: the estimates behind it, None if mesh or step is not varied; both are None if
    low and high are the extremes of all values."""

    low: float
    high: float
    mesh: Estimate | None = None
    step: Estimate | None = None


def estimate(sizes, values, formal: tuple[float, float]) -> Estimate:
    """The bar of the first of the values (k,) on sizes (k,), in any unit; formal: lowest and highest formal order.

    Raises ValueError for fewer than three sizes, equal ones, or a value that is not finite.
    """
    h, f = np.asarray(sizes, float), np.asarray(values, float)
    if len(h) != len(f) or len(np.unique(h)) < max(FEWEST, len(h)) or h.min() <= 0 or not np.isfinite(f).all():
        raise ValueError(f"{FEWEST} or more sizes that differ, and a finite value on each, are needed: {h}, {f}")
    if np.ptp(f) <= SAME * np.abs(f).max():
        return Estimate(0.0, nan, 0.0)
    order, (lowest, highest) = observed_order(h, f), formal
    if lowest - BAND <= order <= highest + BAND:
        used = min(order, lowest)
        slope, residuals = fit(h, f, used)
        if (scatter := deviation(residuals)) < np.ptp(f) / (len(f) - 1):
            return Estimate(float(OBSERVED * abs(slope) * h[0] ** used + scatter + abs(residuals[0])), order, OBSERVED)
    reach = h[0] ** lowest / (h.max() ** lowest - h.min() ** lowest)
    return Estimate(float(FORMAL * np.ptp(f) * reach), order, FORMAL)


def observed_order(h: np.ndarray, f: np.ndarray) -> float:
    """p of the least-squares fit of f_0 + a h^p; not-a-number if the best fit is at an end of SOUGHT."""
    def misfit(order: float) -> float:
        return float(np.sum((fit(h, f, order)[1] / np.ptp(f)) ** 2))
    best = int(np.argmin([misfit(order) for order in SOUGHT]))
    if best in (0, len(SOUGHT) - 1):
        return nan
    return float(minimize_scalar(misfit, bounds=(SOUGHT[best - 1], SOUGHT[best + 1]), method="bounded",
                                 options={"xatol": 1e-10}).x)


def fit(h: np.ndarray, f: np.ndarray, order: float) -> tuple[float, np.ndarray]:
    """a and f - f_0 - a h^order (k,) of the least-squares fit."""
    x = h**order - np.mean(h**order)
    slope = float(x @ f / (x @ x))
    return slope, f - np.mean(f) - slope * x


def deviation(residuals: np.ndarray) -> float:
    """Standard deviation of a fit of three unknowns from its residuals (k,)."""
    return float(np.sqrt(residuals @ residuals / max(len(residuals) - FEWEST, 1)))


def combined(value: float, mesh: Estimate | None, step: Estimate | None) -> Bar:
    """Sum of the bars of mesh and step: their errors may be dependent and have the same sign."""
    half = sum(part.bar for part in (mesh, step) if part)
    return Bar(value - half, value + half, mesh, step)


def spread(values) -> Bar:
    """Range of all values, for a count or a number without a limit."""
    return Bar(min(values), max(values))
