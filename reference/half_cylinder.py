"""Stokes flow along a wall over a half-cylinder on it: its drag, lift and moment.

The wall is y = 0, the half-cylinder r = 1, and far away the velocity is u_x = y - c y^2 (the first
terms of any flow along a wall: shear, and a pressure gradient -2 c times the viscosity). The stream
function is y^2 / 2 - c y^3 / 3 plus a sum over all biharmonic functions that decay and have no
slip on the wall and the flow's symmetry about x = 0: with even p = 0, 2, ... and odd p = 1, 3, ...

    A_p r^-p (cos p t - cos (p + 2) t)      B_p r^-p ((p + 2) sin p t - p sin (p + 2) t)

These are the eigenfunctions of a wedge of 180 degrees, whose exponents are integers. No slip on
r = 1 gives the coefficients, by least squares over the half-circle; where it meets the wall the
stream function grows as the distance to the power 3.74, so that the coefficients decay
algebraically.

With w the vorticity, the wall r = 1 at rest bears the traction -p e_r + w e_t (viscosity one). Each
term has w = -4 (p + 1) A_p r^-q cos q t and the pressure 4 (p + 1) A_p r^-q sin q t, or w = -4 p
(p + 1) B_p r^-q sin q t and the pressure -4 p (p + 1) B_p r^-q cos q t, with q = p + 2: vorticity
and pressure are harmonic conjugates.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np

#: Number of coefficients, and of points of the half-circle for each of them.
TERMS, POINTS = 60, 4


@dataclass(frozen=True, eq=False)
class HalfCylinder:
    """curvature: c of the far flow; even, odd: the coefficients A_0, A_2, ... and B_1, B_3, ..."""

    curvature: float
    even: np.ndarray
    odd: np.ndarray

    def stream(self, x, y) -> np.ndarray:
        """The stream function at places outside the half-cylinder."""
        r, t = np.hypot(x, y), np.arctan2(y, x)
        total = y**2 / 2 - self.curvature * y**3 / 3
        for A, p in zip(self.even, 2 * np.arange(len(self.even))):
            total = total + A * r**-p * (np.cos(p * t) - np.cos((p + 2) * t))
        for B, p in zip(self.odd, 1 + 2 * np.arange(len(self.odd))):
            total = total + B * r**-p * ((p + 2) * np.sin(p * t) - p * np.sin((p + 2) * t))
        return total

    def vorticity(self, r, t) -> np.ndarray:
        """dv/dx - du/dy."""
        total = -1 + 2 * self.curvature * r * np.sin(t)
        for A, p in zip(self.even, 2 * np.arange(len(self.even))):
            total = total - 4 * (p + 1) * A * r ** -(p + 2.0) * np.cos((p + 2) * t)
        for B, p in zip(self.odd, 1 + 2 * np.arange(len(self.odd))):
            total = total - 4 * p * (p + 1) * B * r ** -(p + 2.0) * np.sin((p + 2) * t)
        return total

    def pressure(self, r, t) -> np.ndarray:
        """Pressure over the viscosity, zero at x = 0."""
        total = -2 * self.curvature * r * np.cos(t)
        for A, p in zip(self.even, 2 * np.arange(len(self.even))):
            total = total + 4 * (p + 1) * A * r ** -(p + 2.0) * np.sin((p + 2) * t)
        for B, p in zip(self.odd, 1 + 2 * np.arange(len(self.odd))):
            total = total - 4 * p * (p + 1) * B * r ** -(p + 2.0) * np.cos((p + 2) * t)
        return total

    def load(self) -> tuple[float, float, float]:
        """Force along x and y, and moment about the middle (counterclockwise), over the viscosity."""
        t, weight = _half_circle(4 * (len(self.even) + len(self.odd)))
        p, w = self.pressure(1.0, t), self.vorticity(1.0, t)
        along = weight @ (-p * np.cos(t) - w * np.sin(t))
        across = weight @ (-p * np.sin(t) + w * np.cos(t))
        return float(along), float(across), float(weight @ w)


def _half_circle(count: int) -> tuple[np.ndarray, np.ndarray]:
    """Points of the half-circle, and their weights (Gauss)."""
    place, weight = np.polynomial.legendre.leggauss(count)
    return np.pi * (place + 1) / 2, np.pi * weight / 2


@cache
def solve(curvature: float = 0.0, terms: int = TERMS) -> HalfCylinder:
    """The flow over the half-cylinder."""
    t, weight = _half_circle(POINTS * terms)
    even, odd = 2 * np.arange(terms // 2), 1 + 2 * np.arange(terms // 2)
    value = np.column_stack([*(np.cos(p * t) - np.cos((p + 2) * t) for p in even),
                             *((p + 2) * np.sin(p * t) - p * np.sin((p + 2) * t) for p in odd)])
    slope = -np.concatenate([even, odd]) * value
    y = np.sin(t)
    shear_flow = -(y**2 / 2 - curvature * y**3 / 3)
    shear_flow_slope = -(y**2 - curvature * y**3)
    root = np.sqrt(weight)
    scale = np.maximum(1.0, np.concatenate([even + 1, (odd + 1) * odd]))
    matrix = np.vstack([value * root[:, None], slope * root[:, None]]) / scale
    right = np.concatenate([shear_flow * root, shear_flow_slope * root])
    coefficients = np.linalg.lstsq(matrix, right, rcond=None)[0] / scale
    return HalfCylinder(curvature, coefficients[: len(even)], coefficients[len(even):])
