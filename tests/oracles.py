"""Slow formulas straight from the paper: one triangle, node or difference at a time, without imports from `repro`.

Meshes are (points, triangles): (N, 2) um and (T, 3) nodes. Nothing is vectorised or cached.
"""

import numpy as np


def derivative(function, place, step):
    """Derivative of ``function(array) -> number or array`` by each entry of the array: central differences of order 4.

    The error is about step^4 / 30 times the fifth derivative, plus 1e-16 / step of the function's size.
    """
    rows = []
    for index in np.ndindex(place.shape):
        unit = np.zeros(place.shape)
        unit[index] = step
        f = [np.asarray(function(place + k * unit)) for k in (-2, -1, 1, 2)]
        rows.append((f[0] - 8 * f[1] + 8 * f[2] - f[3]) / (12 * step))
    return np.moveaxis(np.array(rows), 0, -1).reshape(*np.shape(rows[0]), *place.shape)


def rates(acceptor, donor, half_a, half_d, k, Y, b, f_d, d_c, F):
    """(F1, F2, F3, F4) / X_A as printed in (7)-(10), with d_c f_d b for d_f d_b [E3]."""
    m_a, m_d = acceptor / (acceptor + half_a), donor / (donor + half_d)
    return (-m_a * (k * F * m_d + d_c * f_d * b), -k * m_a * m_d, m_a * (k * Y * m_d - b), m_a * b * (1 - f_d))


def extent(places, width, length):
    """Extent of the meshed part (3.1): ten thicknesses or one and a half widths, whichever is less, beyond the first
    and the last point, and never past the pore's ends, which lie half its length from the origin."""
    thickness = max(y for _, y in places)
    reach = 10 * thickness if 10 * thickness < 1.5 * width else 1.5 * width
    left, right = min(x for x, _ in places) - reach, max(x for x, _ in places) + reach
    return (left if left > -length / 2 else -length / 2), (right if right < length / 2 else length / 2)
