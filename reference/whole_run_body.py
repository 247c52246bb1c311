"""Shape of a growing aggregate: an incompressible neo-Hookean body in plane strain on quadratic curved triangles.

The energy is (21) over the shear modulus, per volume at t = 0, with a term that is zero where J = theta:

    Pi = integral of 1/2 (J^(-2/3) tr C - 3) + P (J - theta) + kappa/2 (J - theta)^2,      tr C = F : F + 1

With c = dJ/dF and p = P + kappa (J - theta), the equilibrium is

    (J^(-2/3) F + (p - J^(-5/3) tr C / 3) c, grad v) = 0,     (J - theta, q) = 0

for quadratic positions and linear P. J^(1/3) + J^(-2/3) / 2 is concave in J, and J = theta holds in the mean only.
kappa = 3 theta^(-5/3) compensates the concavity. The flat side slides on its wall (v_y = 0), and the origin stays in
place. :mod:`reference.quadratic_growth` computes the Newton steps.
"""
import numpy as np
from skfem import Basis, ElementTriP1, ElementTriP2, ElementVector

from reference.quadratic_growth import newton_step

#: Newton's method converges when its step over the body's size is this small, and fails after this number of steps.
TOLERANCE, MAX_ITERATIONS = 1e-11, 12


class Body:
    """The half-disc of ``radius`` at t = 0 on a grid; dx (T, Q): volumes of its quadrature points."""

    def __init__(self, grid, radius, order):
        self.start = radius * grid.seed
        mesh, inside = grid.mesh(self.start), np.flatnonzero(grid.body)
        self.basis = Basis(mesh, ElementVector(ElementTriP2()), elements=inside, intorder=order)
        self.lower = self.basis.with_element(ElementTriP1())
        self.numbers = np.hstack([self.basis.nodal_dofs, self.basis.facet_dofs])
        self.dx = self.basis.dx
        self.free = self._free()

    def _free(self):
        """Numbers of the unknowns: P, and x and y of the aggregate's nodes without those fixed by wall and origin."""
        (x, y), tiny = self.start, 1e-9 * np.abs(self.start).max()
        constrained = [self.numbers[1, np.abs(y) < tiny], self.numbers[0, np.hypot(x, y) < tiny]]
        free_nodes = np.setdiff1d(np.unique(self.basis.element_dofs), np.concatenate(constrained))
        return np.concatenate([free_nodes, self.basis.N + np.unique(self.lower.element_dofs)])

    def grown(self, theta, places, pressure):
        """(places (2, K), P) in equilibrium under theta (T, Q); Newton's method starts from the arguments.

        Raises RuntimeError if Newton's method does not converge.
        """
        place = np.zeros(self.basis.N)
        place[self.numbers] = places
        for _ in range(MAX_ITERATIONS):
            step = newton_step(self.basis, self.lower, theta, 1.0, place, pressure, I=self.free)
            place, pressure = place + step[: self.basis.N], pressure + step[self.basis.N:]
            if np.abs(step[: self.basis.N]).max() < TOLERANCE * np.abs(place).max():
                return place[self.numbers], pressure
        last = np.abs(step[: self.basis.N]).max()
        raise RuntimeError(f"the aggregate still moves by {last:.2g} um after {MAX_ITERATIONS} iterations")
