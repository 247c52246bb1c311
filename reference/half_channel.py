"""Fully developed flow from a wall, y = 0, to the middle of a channel of width 2 W, with a layer on each wall.

The layer, 0 < y < h, is lambda times as viscous as water. Above it, h < y < W, is water. By symmetry u' = 0 at y = W,
so with G = -dphi/dx (times g / nu_water) the stress at y is G (W - y):

    above:      u = u_h + G ((W - h) z - z^2 / 2),   z = y - h
    the layer:  u = G (W y - y^2 / 2) / lambda

The mean velocity is the integral of u over W.
"""
import numpy as np


def velocity(y, width, layer, ratio):
    """u_x at heights y, for a mean velocity of one; the layer is lambda = ``ratio`` times as viscous as water."""
    y = np.asarray(y, float)
    within = np.minimum(y, layer)
    inside = (width * within - within**2 / 2) / ratio
    return gradient(width, layer, ratio) * (inside + _above(y, width, layer))


def gradient(width, layer, ratio):
    """G = -dphi/dx (times g / nu), for a mean velocity of one."""
    lower = (width * layer**2 / 2 - layer**3 / 6) / ratio
    surface = (width * layer - layer**2 / 2) / ratio
    return width / (lower + _flux_above(surface, width, layer))


def _above(y, width, layer):
    """u - u_h in the water, zero in the layer, for G = 1."""
    z = np.maximum(y - layer, 0.0)
    return (width - layer) * z - z**2 / 2


def _flux_above(surface, width, layer):
    """Integral of u over the water, for G = 1 and u_h = ``surface``."""
    return surface * (width - layer) + (width - layer) ** 3 / 3
