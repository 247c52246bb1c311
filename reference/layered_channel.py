"""Fully developed flow in a channel with two layers of different viscosity: a film of biomass along the lower wall.

Layer B, 0 < y < h, has viscosity lambda; layer F, h < y < W, has one (without the factor nu/g). With G = -dphi/dx the
same in both, lambda u'' = -G below and u'' = -G above, u(0) = u(W) = 0, and u and the shear stress nu u' are continuous
at y = h (the flow is along x, so the Laplacian and the traction form of [E2] agree). Integrated once, nu u' = s -
G y with the same s in both layers:

    B: u = (s y - G y^2/2) / lambda,        F: u = G (W^2 - y^2)/2 - s (W - y).

Equal at h: s (h/lambda + W - h) = G (h^2/lambda + W^2 - h^2) / 2. The mean velocity is their integral over W.
"""
import numpy as np


def stress(width, layer, ratio):
    """s / G, the stress on the lower wall."""
    return 0.5 * (layer**2 / ratio + width**2 - layer**2) / (layer / ratio + width - layer)


def _unit_velocity(y, width, layer, ratio):
    s = stress(width, layer, ratio)
    return np.where(y < layer, (s * y - y**2 / 2) / ratio, (width**2 - y**2) / 2 - s * (width - y))


def gradient(width, layer, ratio):
    """G = -dphi/dx (times g/nu) for a mean velocity of one."""
    s, gap = stress(width, layer, ratio), width - layer
    lower = (s * layer**2 / 2 - layer**3 / 6) / ratio
    upper = (width**2 * gap - (width**3 - layer**3) / 3) / 2 - s * gap**2 / 2
    return width / (lower + upper)


def velocity(y, width, layer, ratio):
    """u_x at heights y for a mean velocity of one."""
    return gradient(width, layer, ratio) * _unit_velocity(np.asarray(y, float), width, layer, ratio)
