"""Fully developed flow from a wall, y = 0, to the middle of a channel of width 2 W, with a layer on each wall.

The layer, 0 < y < h, is lambda times as viscous as water, or has the permeability k and the viscosity of water. Above
it, h < y < W, is water. By symmetry u' = 0 at y = W, so with G = -dphi/dx (times g / nu_water) the stress at y is
G (W - y), except for the drag:

    above:              u = u_h + G ((W - h) z - z^2 / 2),   z = y - h
    a viscous layer:    u = G (W y - y^2 / 2) / lambda
    a permeable layer:  u'' - u / k = -G, u(0) = 0, u'(h) = G (W - h):  u = G k + A exp(-y / d) + B exp((y - h) / d)

with d = sqrt(k). The mean velocity is the integral of u over W.
"""
import numpy as np


class Viscous:
    """A layer lambda times as viscous as water; velocities for a mean velocity of one."""

    @staticmethod
    def velocity(y, width, layer, ratio):
        """u_x at heights y."""
        y = np.asarray(y, float)
        within = np.minimum(y, layer)
        inside = (width * within - within**2 / 2) / ratio
        return Viscous.gradient(width, layer, ratio) * (inside + _above(y, width, layer))

    @staticmethod
    def gradient(width, layer, ratio):
        """G = -dphi/dx (times g / nu)."""
        lower = (width * layer**2 / 2 - layer**3 / 6) / ratio
        surface = (width * layer - layer**2 / 2) / ratio
        return width / (lower + _flux_above(surface, width, layer))


class Permeable:
    """A layer with the drag of a permeability; velocities for a mean velocity of one."""

    @staticmethod
    def velocity(y, width, layer, permeability):
        """u_x at heights y."""
        y = np.asarray(y, float)
        A, B = _constants(width, layer, permeability)
        d, within = np.sqrt(permeability), np.minimum(y, layer)
        inside = permeability + A * np.exp(-within / d) + B * np.exp((within - layer) / d)
        return Permeable.gradient(width, layer, permeability) * (inside + _above(y, width, layer))

    @staticmethod
    def gradient(width, layer, permeability):
        """G = -dphi/dx (times g / nu)."""
        A, B = _constants(width, layer, permeability)
        d = np.sqrt(permeability)
        lower = permeability * layer + (A + B) * d * -np.expm1(-layer / d)
        surface = permeability + A * np.exp(-layer / d) + B
        return width / (lower + _flux_above(surface, width, layer))


def _constants(width, layer, permeability):
    """A, B for G = 1."""
    d, far = np.sqrt(permeability), np.exp(-layer / np.sqrt(permeability))
    return np.linalg.solve([[1, far], [-far, 1]], [-permeability, d * (width - layer)])


def _above(y, width, layer):
    """u - u_h in the water, zero in the layer, for G = 1."""
    z = np.maximum(y - layer, 0.0)
    return (width - layer) * z - z**2 / 2


def _flux_above(surface, width, layer):
    """Integral of u over the water, for G = 1 and u_h = ``surface``."""
    return surface * (width - layer) + (width - layer) ** 3 / 3
