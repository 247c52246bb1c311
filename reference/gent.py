"""Closed forms of a growing body with Gent's energy, plane strain, F33 = 1. Pressures and stresses over mu_L.

**Homogeneous F.** Gent (Rubber Chem. Technol. 69, 1996) has the energy -(J_m / 2) ln(1 - (I - 3) / J_m) of I = J^(-2/3)
tr C. It stiffens the neo-Hookean stress by a = J_m / (J_m + 3 - I):

    sigma = a J^(-5/3) (F F^T - tr C / 3 I) + P I.

As J_m grows it becomes the neo-Hookean body (`neo_hookean.py`). In pure shear by a stretch s without growth, sigma_xx -
sigma_yy = a (s^2 - s^-2), with a = J_m / (J_m - (s - 1/s)^2): the stress grows without bound as s - 1/s comes to
J_m^(1/2).

**Growing half-cylinder.** As in `neo_hookean.py`, r(R)^2 = 2 integral_0^R theta R dR does not depend on the energy, and

    sigma_rr(R) = integral_R^R0 a theta^(-5/3) (r'^2 - (r/R)^2) r'/r dR
    P = sigma_rr - a theta^(-5/3) (r'^2 - tr C / 3)
"""
import numpy as np


def energy(F, limit):
    """Energy over mu_L of F (..., 2, 2); limit: J_m."""
    return -limit / 2 * np.log(1 - (_invariant(F) - 3) / limit)


def cauchy(F, P, limit):
    """Cauchy stress (3, 3) of a homogeneous plane deformation F (2, 2) at a pressure P."""
    gradient = np.eye(3)
    gradient[:2, :2] = F
    B = gradient @ gradient.T
    stiffening = limit / (limit + 3 - _invariant(F))
    shape = B - np.trace(B) / 3 * np.eye(3)
    return stiffening * np.linalg.det(gradient) ** (-5 / 3) * shape + P * np.eye(3)


def cylinder_pressure(R, inner, increase, outer, limit, points=80):
    """P(R), R (n,), for theta = inner + increase (R / outer)^2, by Gauss-Legendre quadrature."""
    R = np.asarray(R, float)
    s, weight = np.polynomial.legendre.leggauss(points)
    half = 0.5 * (outer - R)[:, None]
    along = R[:, None] + half * (1 + s)
    radial, hoop, shear = _stretches(along, inner, increase, outer, limit)
    sigma = np.sum(weight * half * shear * (radial**2 - hoop**2) * radial / (hoop * along), axis=1)
    radial, hoop, shear = _stretches(R, inner, increase, outer, limit)
    return sigma - shear * (radial**2 - (radial**2 + hoop**2 + 1) / 3)


def _stretches(R, inner, increase, outer, limit):
    """r', r/R and a theta^(-5/3)."""
    theta = inner + increase * (R / outer) ** 2
    hoop = np.sqrt(inner + increase * R**2 / (2 * outer**2))
    radial = theta / hoop
    invariant = theta ** (-2 / 3) * (radial**2 + hoop**2 + 1)
    return radial, hoop, limit / (limit + 3 - invariant) * theta ** (-5 / 3)


def _invariant(F):
    return np.linalg.det(F) ** (-2 / 3) * (np.sum(np.asarray(F) ** 2, axis=(-2, -1)) + 1)
