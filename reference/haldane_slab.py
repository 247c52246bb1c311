"""Steady diffusion into a slab of biomass by Haldane's law: all solutions, by scipy's integration from the middle.

The slab |x| < l, with D_B inside, lies between two films of fluid of thickness a and diffusivity D. The concentration
on their far sides is C_s. Inside, D_B C'' = s C / (K + C + C^2 / K_i), and C' = 0 in the middle by symmetry.

The concentration C_0 in the middle determines the profile, and C_s(C_0) = C(l) + a D_B C'(l) / D with it. C rises from
the middle, so 0 < C_0 < C_s. C_s(C_0) need not be monotone: each C_0 with the given C_s is a solution. They are
ordered: two profiles with different C_0 cross nowhere where C_s(C_0) has one sign of its slope between them.
"""
from functools import partial

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

#: Concentrations in the middle among which the solutions are bracketed, over the supply.
SCANNED = np.concatenate([np.logspace(-8, -2, 61), np.linspace(0.01, 1.0, 400)[1:]])


def profile(middle, sink, half_saturation, inhibition, half, in_slab):
    """x -> (C, C'), for 0 <= x <= half, with C = middle at x = 0; sink is s, inhibition is K_i."""
    def derivative(_, y):
        return [y[1], sink / in_slab * y[0] / (half_saturation + y[0] + y[0] ** 2 / inhibition)]

    return solve_ivp(derivative, (0.0, half), [middle, 0.0], method="DOP853", rtol=1e-11, atol=1e-13 * middle,
                     dense_output=True).sol


def solutions(supply, sink, half_saturation, inhibition, half, in_slab, film=0.0, diffusivity=1.0):
    """All solutions, x -> C(x) for |x| <= half, by rising C in the middle."""
    law = sink, half_saturation, inhibition, half, in_slab

    def excess(middle):
        surface, slope = profile(middle, *law)(half)
        return surface + film * in_slab / diffusivity * slope - supply

    values = [excess(middle * supply) for middle in SCANNED]
    signs = np.flatnonzero(np.diff(np.sign(values)))
    middles = [brentq(excess, SCANNED[k] * supply, SCANNED[k + 1] * supply, xtol=1e-13 * supply) for k in signs]
    return [partial(_values, profile(middle, *law), half) for middle in middles]


def _values(inside, half, x):
    return inside(np.minimum(np.abs(x), half).ravel())[0].reshape(np.shape(x))
