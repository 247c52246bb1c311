"""Shape of an aggregate that grows: an incompressible neo-Hookean body in plane strain, by quadratic curved triangles.

(21) over the shear modulus, per volume of t = 0, with a term that is zero where J = theta:

    Pi = integral of 1/2 (J^(-2/3) tr C - 3) + P (J - theta) + kappa/2 (J - theta)^2,      tr C = F : F + 1

With c = dJ/dF and p = P + kappa (J - theta), the equilibrium is

    (J^(-2/3) F + (p - J^(-5/3) tr C / 3) c, grad v) = 0,     (J - theta, q) = 0

for quadratic places and linear P. J^(1/3) + J^(-2/3) / 2 is concave in J: kappa = 3 theta^(-5/3) outweighs that where
J = theta holds in the mean only. The flat side slides on its wall (v_y = 0), and the origin stays.
"""
import numpy as np
from skfem import Basis, BilinearForm, ElementTriP1, ElementTriP2, ElementVector, LinearForm, asm, bmat, condense, solve
from skfem.helpers import ddot, det, grad

#: kappa theta^(5/3); Newton stops at a step this small over the body's size, and is given up after that many.
STIFFENING, SMALL, MOST = 3.0, 1e-11, 12
#: c_ik = e_ij e_kl F_jl of a plane F.
TURN = np.array([[0.0, 1.0], [-1.0, 0.0]])


class Body:
    """The half-disc of ``radius`` at t = 0 on a grid; dx (T, Q) its volumes at the points of quadrature."""

    def __init__(self, grid, radius, order):
        self.start = radius * grid.seed
        mesh, inside = grid.mesh(self.start), np.flatnonzero(grid.body)
        self.basis = Basis(mesh, ElementVector(ElementTriP2()), elements=inside, intorder=order)
        self.lower = self.basis.with_element(ElementTriP1())
        self.numbers = np.hstack([self.basis.nodal_dofs, self.basis.facet_dofs])
        self.dx = self.basis.dx
        self.free = self._free()

    def _free(self):
        """Numbers of the unknowns: x and y of the aggregate's nodes but for what the wall and the origin hold; P."""
        (x, y), tiny = self.start, 1e-9 * np.abs(self.start).max()
        held = [self.numbers[1, np.abs(y) < tiny], self.numbers[0, np.hypot(x, y) < tiny]]
        moved = np.setdiff1d(np.unique(self.basis.element_dofs), np.concatenate(held))
        return np.concatenate([moved, self.basis.N + np.unique(self.lower.element_dofs)])

    def grown(self, theta, places, pressure):
        """(places (2, K), P) in equilibrium under theta (T, Q), from a start.

        Raises RuntimeError where Newton's method does not converge.
        """
        place = np.zeros(self.basis.N)
        place[self.numbers] = places
        for _ in range(MOST):
            step = self._step(theta, place, pressure)
            place, pressure = place + step[: self.basis.N], pressure + step[self.basis.N:]
            if np.abs(step[: self.basis.N]).max() < SMALL * np.abs(place).max():
                return place[self.numbers], pressure
        last = np.abs(step[: self.basis.N]).max()
        raise RuntimeError(f"the aggregate still moves by {last:.2g} um after {MOST} iterations")

    def _step(self, theta, place, pressure):
        """Newton's step of places and P."""
        F = grad(self.basis.interpolate(place))
        J, kappa = det(F), STIFFENING * theta ** (-5 / 3)
        p = self.lower.interpolate(pressure) + kappa * (J - theta)
        stress, slope, c = _law(F, J, p, kappa)
        K, B = asm(_stiffness, self.basis, slope=slope), asm(_coupling, self.basis, self.lower, c=c)
        right = -np.concatenate([asm(_force, self.basis, stress=stress), asm(_load, self.lower, value=J - theta)])
        return solve(*condense(bmat([[K, B.T], [B, None]], "csc"), right, I=self.free))


def _law(F, J, p, kappa):
    """S = J^(-2/3) F + (p - J^(-5/3) tr C / 3) c (2, 2, ...), its derivative (2, 2, 2, 2, ...) by F, and c = dJ/dF."""
    c, trace = np.einsum("ij,kl,jl...->ik...", TURN, TURN, F), ddot(F, F) + 1
    rest = p - J ** (-5 / 3) * trace / 3
    mixed = np.einsum("ik...,jl...->ikjl...", F, c)
    slope = np.einsum("ij,kl,...->ikjl...", np.eye(2), np.eye(2), J ** (-2 / 3))
    slope += (kappa + 5 / 9 * J ** (-8 / 3) * trace) * np.einsum("ik...,jl...->ikjl...", c, c)
    slope -= 2 / 3 * J ** (-5 / 3) * (mixed + np.einsum("ikjl...->jlik...", mixed))
    slope += np.einsum("ij,kl,...->ikjl...", TURN, TURN, rest)
    return J ** (-2 / 3) * F + rest * c, slope, c


@LinearForm
def _force(v, w):
    return ddot(w["stress"], grad(v))


@BilinearForm
def _stiffness(u, v, w):
    return ddot(np.einsum("ikjl...,jl...->ik...", w["slope"], grad(u)), grad(v))


@BilinearForm
def _coupling(u, q, w):
    return ddot(w["c"], grad(u)) * q


@LinearForm
def _load(q, w):
    return w["value"] * q
