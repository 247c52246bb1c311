"""Stokes flow past semicircles on one or both walls of a channel, by exact solutions fitted to the walls.

The stream function of a flow that repeats with the period L is

    psi = a y^2 + b y^3 - 2 y Re f(z) + Im g(z),    z = x + i y,

with analytic f and g of the period L. This satisfies the Stokes equations exactly. The pressure (times 1 / nu) is
6 b x + 4 Re f'(z), so the loss over a period is -6 b L. Both f and g are series of cos k z and sin k z (k = 2 pi n / L)
and of powers of cot(pi z / L), whose poles lie in the middle of the semicircle, outside of the water. The flow is its
own mirror image in x = 0, so in f the coefficients of even functions are real and those of odd ones imaginary; in g it
is the reverse. Least squares find them: the velocity vanishes on walls and semicircle. With semicircles on both walls
the plane between them has no normal velocity and no shear.

J.-T. Jeong and J. Son, European Journal of Mechanics B/Fluids (2016), doi 10.1016/j.euromechflu.2016.09.022, fit a
Fourier series of the stream function in this way. The poles are an addition: without them the series has to be
continued into a thick semicircle.

Near a gap e that is much narrower than the radius R, the loss tends to that of lubrication theory (:func:`film`).
"""
from math import pi, sqrt

import numpy as np

#: Waves and powers of cot in each of f and g, and points on each boundary.
WAVES, POWERS, POINTS = 60, 60, 400


def excess_loss(radius: float, facing: bool = False, clear: float = 4.0) -> tuple[float, float]:
    """Loss of one semicircle, or of two that face each other, in addition to that of a clean channel.

    radius: over the width of the channel; facing: two semicircles; clear: clean length of a period, in widths.

    Returns the length of a clean channel, in widths, that loses as much, and the largest velocity on the walls over
    the mean velocity, which is the error of the boundary conditions.
    """
    height, period = (0.5, clear + 2 * radius) if facing else (1.0, clear + 2 * radius)
    rows, values = _conditions(radius, height, period, facing)
    scale = np.linalg.norm(rows, axis=0)
    solution = np.linalg.lstsq(rows / scale, values, rcond=1e-14)[0] / scale
    residual = np.abs(rows @ solution - values)[1:].max()
    return -6 * solution[1] * period / 12 - period, residual


def film(radius: float, gap: float, terms: int = 2) -> float:
    """Loss in the film between a semicircle and a wall, as the length of a clean channel, by lubrication theory.

    The integral of (1 + 4/5 h'^2) / h^3 with the gap h = e + x^2 / (2 R) + x^4 / (8 R^3), up to the first power of
    e / R; terms = 1: its limit, the integral of 1 / (e + x^2 / (2 R))^3. Lengths are in widths.
    """
    limit = 3 * pi / 8 * sqrt(2 * radius) * gap**-2.5
    return limit if terms == 1 else limit * (1 + (8 / 15 - 1 / 4) * gap / radius)


def _conditions(radius: float, height: float, period: float, facing: bool) -> tuple[np.ndarray, np.ndarray]:
    """Rows of the conditions and their values: the flux, then velocities on the circle, the walls and the plane."""
    size = radius, period, height
    clustered = (1 - np.cos(np.linspace(0, pi, POINTS))) / 2
    circle = radius * np.exp(1j * pi / 2 * clustered)
    wall = radius + (period / 2 - radius) * clustered + 0j
    top = period / 2 * clustered + 1j * height
    fixed = np.concatenate([circle, wall] if facing else [circle, wall, top])
    u, v, _, _ = _terms(fixed, *size)
    blocks = [u, v]
    if facing:
        _, normal, shear, _ = _terms(top, *size)
        blocks += [normal, shear]
    flux = np.diff(_terms(period / 2 + np.array([0, 1j * height]), *size)[3], axis=0)
    rows = np.vstack([flux, *blocks])
    return rows, np.eye(len(rows))[0] * height


def _terms(z: np.ndarray, radius: float, period: float, height: float) -> tuple[np.ndarray, ...]:
    """u, v, du/dy and psi of each term at points z."""
    y = z.imag[:, None]
    f, df, ddf = _series(z, radius, period, height)
    g, dg, ddg = 1j * f[:, 1:], 1j * df[:, 1:], 1j * ddf[:, 1:]
    zero = np.zeros_like(y)
    u = np.hstack([2 * y, 3 * y**2, -2 * f.real + 2 * y * df.imag, dg.real])
    v = np.hstack([zero, zero, 2 * y * df.real, -dg.imag])
    shear = np.hstack([zero + 2, 6 * y, 4 * df.imag + 2 * y * ddf.real, -ddg.imag])
    psi = np.hstack([y**2, y**3, -2 * y * f.real, g.imag])
    return u, v, shear, psi


def _series(z: np.ndarray, radius: float, period: float, height: float) -> tuple[np.ndarray, ...]:
    """Each function of the series with its first and second derivative, with the factor i where it is odd."""
    z = z[:, None]
    k = 2 * pi * np.arange(1, WAVES + 1) / period
    size = np.cosh(k * height)
    even, odd = np.cos(k * z) / size, 1j * np.sin(k * z) / size
    constant = np.ones_like(z)
    c, power = 1 / np.tan(pi * z / period), np.arange(1, POWERS + 1)
    slope = -pi / period * (1 + c**2)
    factor = np.where(power % 2, 1j, 1) * (pi * radius / period) ** power
    values = np.hstack([constant, even, odd, factor * c**power])
    first = np.hstack([0 * constant, 1j * k * odd, 1j * k * even, factor * power * c ** (power - 1) * slope])
    bend = (power - 1) * c ** np.maximum(power - 2, 0) + (power + 1) * c**power
    second = np.hstack([0 * constant, -(k**2) * even, -(k**2) * odd, -pi / period * factor * power * bend * slope])
    return values, first, second
