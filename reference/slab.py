"""Steady diffusion into a slab of biomass that takes up one substrate: (7) in one dimension, in closed form.

The slab |x| < l, with D_B inside, lies between two films of fluid of thickness a and diffusivity D. The concentration
on their far sides is C_s. With C_0 at the surface and N the flux through one side, D (C_s - C_0) / a = N. Inside,
D_B C'' = kappa C (first order, C << K_s), or = s where C > 0 (zero order, C >> K_s).

First order: C = C_0 cosh(phi x / l) / cosh(phi) with Thiele's modulus phi = l sqrt(kappa / D_B), hence N = C_0 D_B / l
phi tanh(phi). The uptake relative to that at the supply, kappa C_s l, is tanh(phi) / phi without films.

Zero order: C = s (|x| - l + p)^2 / (2 D_B) down to the depth p, and zero below it; N = s p. With C_0 = s p^2 /
(2 D_B) the film gives p^2 + 2 b p = 2 D_B C_s / s, b = a D_B / D: without films p = sqrt(2 D_B C_s / s). This
requires p < l.
"""
import numpy as np


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
