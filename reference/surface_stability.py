"""Stability of a block that grows between side walls, by an exactly divergence-free element.

The block 0 < x < L, 0 < y < H slides on its bottom and on its sides, and its top is free. It grows by theta into
F = diag(1, theta), whose top has the elastic stretch theta^(-1/2). Its energy is, with the pressure P of
`neo_hookean.confined_growth_pressure` and the cofactor c of F, to second order in G = grad u,

    1/2 integral of J^(-2/3) (G : G - 4/3 (c : G / J) F : G + 5/9 tr C (c : G / J)^2 - 2/3 tr C det G / J) + 2 P det G,

under the constraint c : G = 0. The state is stable if this is positive for every u except zero. In plane strain the
terms with c : G vanish where the constraint holds exactly. It holds at every point for quartic positions and
discontinuous cubic pressures on triangles (Scott and Vogelius, RAIRO Modél. Math. Anal. Numér. 19, 1985).

A half-space is stable down to Biot's stretch, the root of (1 + l^4)^2 = 4 l^2 below one.
"""
import numpy as np
from scipy.linalg import eigh, null_space
from scipy.optimize import brentq
from skfem import Basis, BilinearForm, ElementDG, ElementTriP3, ElementTriP4, ElementVector, MeshTri, asm
from skfem.helpers import ddot, grad

from reference.neo_hookean import confined_growth_pressure


def biot():
    """Biot's stretch: a half-space is neutral to waves of every length."""
    return brentq(lambda stretch: (1 + stretch**4) ** 2 - 4 * stretch**2, 0.3, 0.8, xtol=1e-14)


@BilinearForm
def _energy(u, v, w):
    """Second variation at F = diag(1, theta) and P."""
    theta, P = w["theta"], w["P"]
    G, D = grad(u), grad(v)
    trace = theta**2 + 2
    j, k = (theta * A[0, 0] + A[1, 1] for A in (G, D))
    f, g = (A[0, 0] + theta * A[1, 1] for A in (G, D))
    mixed = G[0, 0] * D[1, 1] + G[1, 1] * D[0, 0] - G[0, 1] * D[1, 0] - G[1, 0] * D[0, 1]
    integrand = ddot(G, D) - 2 / 3 * (j * g + k * f) / theta + 5 / 9 * trace * j * k / theta**2
    return theta ** (-2 / 3) * (integrand - trace / 3 * mixed / theta) + P * mixed


@BilinearForm
def _constraint(u, q, w):
    G = grad(u)
    return (w["theta"] * G[0, 0] + G[1, 1]) * q


def mesh(across, up, length=1.0, height=1.0):
    """Right-angled triangles with parallel diagonals, so that no inner vertex is singular."""
    return MeshTri.init_tensor(np.linspace(0, length, across + 1), np.linspace(0, height, up + 1))


def divergence_free(block):
    """(energy, constraint) of the quartic element: functions of theta that return dense matrices of free unknowns."""
    basis = Basis(block, ElementVector(ElementTriP4()), intorder=8)
    lower = basis.with_element(ElementDG(ElementTriP3()))
    x, y = basis.doflocs
    component = np.zeros(basis.N, int)
    for numbers in (basis.nodal_dofs, basis.facet_dofs, basis.interior_dofs):
        component[numbers[1::2]] = 1
    sides = (x == x.min()) | (x == x.max())
    free = np.flatnonzero(~np.where(component == 0, sides, y == y.min()))

    def energy(theta):
        return asm(_energy, basis, theta=theta, P=confined_growth_pressure(theta)).toarray()[np.ix_(free, free)]

    return energy, lambda theta: asm(_constraint, basis, lower, theta=theta).toarray()[:, free]


def critical_stretch(energy, constraint, low=1.05, high=6.0, accuracy=1e-4):
    """theta^(-1/2) at which the least eigenvalue of energy(theta) on the kernel of constraint(theta) is zero, by
    bisection between the expansions ``low`` and ``high``."""
    if least(energy(low), constraint(low)) <= 0 or least(energy(high), constraint(high)) >= 0:
        raise ValueError(f"the stability does not change between theta = {low:g} and {high:g}")
    while high - low > accuracy * low:
        middle = 0.5 * (low + high)
        if least(energy(middle), constraint(middle)) > 0:
            low = middle
        else:
            high = middle
    return (0.5 * (low + high)) ** -0.5


def least(energy, constraint):
    """The least eigenvalue of the symmetric matrix ``energy`` on the kernel of ``constraint``; both are dense."""
    kernel = null_space(constraint)
    return eigh(kernel.T @ energy @ kernel, eigvals_only=True, subset_by_index=[0, 0])[0]
