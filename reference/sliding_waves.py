"""A closed form of the mesh motion (35) in a strip between two walls along which the mesh slides.

For any harmonic psi, d = s grad psi - (1 + 2 gamma) (psi, 0) has div d = -2 gamma psi_s and lap d = 2 grad psi_s, so
that P = -div d / gamma = 2 psi_s solves both equations of (35). With

    psi = sinh(k s) cos(k y),   k = pi / W,

d_y and the normal derivative of d_x vanish on the walls y = 0 and y = W. d_x and the normal derivative of d_y vanish
on the end s = 0. The mesh slides along walls and end, as in 3.5.
"""
import numpy as np


def displacement(s, y, width, gamma, reach):
    """(2, n) d at the distance s from the end and the height y, over sinh(k reach)."""
    k = np.pi / width
    psi, along = np.sinh(k * s) * np.cos(k * y), np.cosh(k * s) * np.cos(k * y)
    across = -np.sinh(k * s) * np.sin(k * y)
    return np.array([k * s * along - (1 + 2 * gamma) * psi, k * s * across]) / np.sinh(k * reach)
