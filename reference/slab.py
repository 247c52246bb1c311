"""Steady diffusion into a slab of biomass that takes up one substrate: (7) in one dimension, in closed form.

The slab |x| < l, with D_B inside, lies between two films of fluid of thickness a and diffusivity D. The concentration
on their far sides is C_s. With C_0 at the surface and N the flux through one side, D (C_s - C_0) / a = N. Inside,
D_B C'' = kappa C (first order, C << K_s), = s where C > 0 (zero order, C >> K_s), or = s C / (C + K_s) (Monod).

First order: C = C_0 cosh(phi x / l) / cosh(phi) with Thiele's modulus phi = l sqrt(kappa / D_B), hence N = C_0 D_B / l
phi tanh(phi). The uptake relative to that at the supply, kappa C_s l, is tanh(phi) / phi without films.

Zero order: C = s (|x| - l + p)^2 / (2 D_B) down to the depth p, and zero below it; N = s p. With C_0 = s p^2 /
(2 D_B) the film gives p^2 + 2 b p = 2 D_B C_s / s, b = a D_B / D: without films p = sqrt(2 D_B C_s / s). This
requires p < l.

Monod, exhausted before the middle: the equation times C', integrated from C = C' = 0, gives D_B C'^2 / 2 = s G(C) with

    G(C) = C - K ln(1 + C / K),      N = sqrt(2 s D_B G(C_0)),

and a second integration gives C. As C_0 / K grows, N tends to that of zero order from below; the relative difference
is K / (2 C_0) ln(1 + C_0 / K).
"""
import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import brentq


def _with_films(x, half, film, supply, surface, inside):
    """``inside`` at |x| < half, linear in the films."""
    beyond = np.abs(x) - half
    slope = (supply - surface) / film if film else 0.0
    return np.where(beyond < 0, inside, surface + slope * np.maximum(beyond, 0.0))


def first_order(x, supply, uptake, half, in_slab, film=0.0, diffusivity=1.0):
    """(C(x), effectiveness): uptake is kappa (1/h); half is l, film is a, diffusivity is D."""
    phi = half * np.sqrt(uptake / in_slab)
    surface = supply / (1 + film * in_slab / (half * diffusivity) * phi * np.tanh(phi))
    inside = surface * np.cosh(phi * np.clip(x / half, -1, 1)) / np.cosh(phi)
    return _with_films(x, half, film, supply, surface, inside), surface / supply * np.tanh(phi) / phi


def penetration(supply, sink, in_slab, film=0.0, diffusivity=1.0):
    """Penetration depth p; sink is s."""
    b = film * in_slab / diffusivity
    return np.sqrt(b**2 + 2 * in_slab * supply / sink) - b


def zero_order(x, supply, sink, half, in_slab, film=0.0, diffusivity=1.0):
    """C(x); p = N / s is :func:`penetration`."""
    depth = penetration(supply, sink, in_slab, film, diffusivity)
    inside = sink * np.maximum(np.abs(x) - half + depth, 0.0) ** 2 / (2 * in_slab)
    return _with_films(x, half, film, supply, sink * depth**2 / (2 * in_slab), inside)


def _share(ratio):
    """K G(C) / C^2 as a function of C / K. It tends to 1/2 at C / K = 0, where the logarithm would cancel."""
    small = np.minimum(ratio, 1e-3)
    large = np.maximum(ratio, 1e-3)
    series = 1 / 2 - small / 3 + small**2 / 4 - small**3 / 5
    return np.where(ratio < 1e-3, series, (large - np.log1p(large)) / large**2)


def monod(x, supply, sink, half_saturation, half, in_slab, film=0.0, diffusivity=1.0):
    """(C(x), N / s): sink is s, half_saturation is K; N / s is the depth that zero order would penetrate."""
    def entering(c):
        return c * np.sqrt(2 * sink * in_slab * _share(c / half_saturation) / half_saturation)

    surface = supply
    if film:
        surface = brentq(lambda c: diffusivity * (supply - c) / film - entering(c), 0.0, supply, xtol=1e-14 * supply)
    profile = solve_ivp(lambda _, y: -entering(np.exp(y)) / np.exp(y) / in_slab, (0.0, half), [np.log(surface)],
                      method="DOP853", rtol=1e-9, atol=1e-9, dense_output=True)
    depth = np.clip(half - np.abs(x), 0.0, half)
    inside = np.exp(profile.sol(np.ravel(depth))[0]).reshape(np.shape(depth))
    return _with_films(x, half, film, supply, surface, inside), float(entering(surface)) / sink
