"""Closed forms of the growing neo-Hookean body (14)-(24), plane strain, F33 = 1. Pressures and stresses over mu_L.

**Homogeneous F.** The energy 1/2 (J^(-2/3) tr C - 3) + P (J - theta), tr C = F : F + 1, gives the Cauchy stress

    sigma = J^-1 dPsi/dF F^T = J^(-5/3) (F F^T - tr C / 3 I) + P I.

**Free uniform growth.** F = sqrt(theta) I, sigma = 0: P = -theta^(-5/3) (theta - (2 theta + 1)/3)
= -theta^(-5/3) (theta - 1) / 3. Uniform growth has no in-plane shear, but a pressure, since x3 cannot expand [E11].

**Growth confined to one direction.** F = diag(1, theta) between fixed sides, sigma_yy = 0 on the free end:
P = -theta^(-5/3) (theta^2 - (theta^2 + 2)/3) = -2 theta^(-5/3) (theta^2 - 1) / 3.

**Growing half-cylinder.** theta = theta(R) in a half-disc that slides on its flat side, which is the upper half of a
disc that grows radially: r = r(R), F = diag(r', r/R, 1), J = r' r / R = theta, hence

    r(R)^2 = 2 integral_0^R theta R dR.

With sigma_rr - sigma_tt = theta^(-5/3) (r'^2 - (r/R)^2) from above, equilibrium d sigma_rr/dr = (sigma_tt - sigma_rr)/r
and sigma_rr = 0 on the rim R = R_0,

    sigma_rr(R) = integral_R^R0 theta^(-5/3) (r'^2 - (r/R)^2) r'/r dR,   P = sigma_rr - theta^(-5/3) (r'^2 - tr C / 3).

For theta = a + c (R/R_0)^2: r^2 = a R^2 + c R^4 / (2 R_0^2). The integral is taken by Gauss-Legendre quadrature.
"""
import numpy as np


def cauchy(F, P):
    """Cauchy stress (3, 3) of a homogeneous plane deformation F (2, 2), F33 = 1, at pressure P."""
    gradient = np.eye(3)
    gradient[:2, :2] = F
    B = gradient @ gradient.T  # the left Cauchy-Green tensor
    return np.linalg.det(gradient) ** (-5 / 3) * (B - np.trace(B) / 3 * np.eye(3)) + P * np.eye(3)


def free_growth_pressure(theta):
    """P of a body that grows uniformly and freely by theta."""
    return -(theta ** (-5 / 3)) * (theta - 1) / 3


def confined_growth_pressure(theta):
    """P of a body that grows uniformly by theta in one direction."""
    return -2 * theta ** (-5 / 3) * (theta**2 - 1) / 3


def cylinder_radius(R, inner, increase, outer):
    """r(R) for theta = inner + more (R / outer)^2."""
    return R * np.sqrt(inner + increase * R**2 / (2 * outer**2))


def cylinder_pressure(R, inner, increase, outer, points=50):
    """P(R), R (n,), for theta = inner + more (R / outer)^2; outer is R_0."""
    s, weight = np.polynomial.legendre.leggauss(points)
    half = 0.5 * (outer - np.asarray(R, float))[:, None]
    along = np.asarray(R, float)[:, None] + half * (1 + s)
    radial, hoop, theta = _stretches(along, inner, increase, outer)
    shear = theta ** (-5 / 3) * (radial**2 - hoop**2)
    sigma = np.sum(weight * half * shear * radial / (hoop * along), axis=1)
    radial, hoop, theta = _stretches(np.asarray(R, float), inner, increase, outer)
    return sigma - theta ** (-5 / 3) * (radial**2 - (radial**2 + hoop**2 + 1) / 3)


def _stretches(R, inner, increase, outer):
    """r', r/R and theta."""
    theta = inner + increase * (R / outer) ** 2
    hoop = np.sqrt(inner + increase * R**2 / (2 * outer**2))
    return theta / hoop, hoop, theta
