"""Fully developed flow in a channel with a permeable layer along the lower wall (Brinkman 1949).

In the layer, 0 < y < h, of permeability k, u'' - u / k = -G; above it, h < y < W, u'' = -G, with G = -dphi/dx (times
g / nu_water). u and u' are continuous at y = h, and u(0) = u(W) = 0. With d = sqrt(k)

    layer: u = G k + A exp(-y / d) + B exp((y - h) / d),     above: u = -G (y - h)^2 / 2 + a (y - h) + b,

The four conditions determine the four constants; both exponentials are at most one.
"""
import numpy as np


def _constants(width, layer, permeability):
    """A, B, a, b for G = 1."""
    d, gap = np.sqrt(permeability), width - layer
    far = np.exp(-layer / d)
    matrix = [[1, far, 0, 0],  # u(0) = 0
              [far, 1, 0, -1],  # u at h
              [-far / d, 1 / d, -1, 0],  # u' at h
              [0, 0, gap, 1]]  # u(W) = 0
    return np.linalg.solve(matrix, [-permeability, -permeability, 0, gap**2 / 2])


def gradient(width, layer, permeability):
    """G = -dphi/dx (times g / nu) for a mean velocity of one."""
    A, B, a, b = _constants(width, layer, permeability)
    d, gap = np.sqrt(permeability), width - layer
    lower = permeability * layer + (A + B) * d * -np.expm1(-layer / d)
    upper = -gap**3 / 6 + a * gap**2 / 2 + b * gap
    return width / (lower + upper)


def velocity(y, width, layer, permeability):
    """u_x at heights y for a mean velocity of one."""
    A, B, a, b = _constants(width, layer, permeability)
    d, y = np.sqrt(permeability), np.asarray(y, float)
    inside = permeability + A * np.exp(-y / d) + B * np.exp(np.minimum(y - layer, 0.0) / d)
    above = -(y - layer) ** 2 / 2 + a * (y - layer) + b
    return gradient(width, layer, permeability) * np.where(y < layer, inside, above)
