"""Dead loads on a body, the f0 and t0 of (20): repro's discrete equations with them on the right-hand side."""

from __future__ import annotations

import numpy as np

from repro.model import growth
from verification import norms


class Loaded(growth.System):
    """Residual and tangent of a body under nodal forces (n, 2), over mu_L, that do not depend on its shape."""

    def __init__(self, body: growth.Body, stabilising: np.ndarray, forces: np.ndarray):
        super().__init__(body, stabilising)
        self.load = np.concatenate([forces[:, 0], forces[:, 1], np.zeros(len(forces))])

    def residual(self, position: np.ndarray, pressure: np.ndarray, theta: np.ndarray):
        """That of the body less the load, and the size of its terms."""
        total, size = super().residual(position, pressure, theta)
        return total - self.load, size


def equilibrium(body: growth.Body, theta: np.ndarray, forces: np.ndarray, start: np.ndarray) -> growth.Equilibrium:
    """Equilibrium under theta (t,) and nodal forces (n, 2) by repro's Newton method, from places (n, 2) near it with
    the held ones on their targets, and without pressure. Raises GrowthError where there is none."""
    system = Loaded(body, growth.stabilisation(start, body.triangles, theta), forces)
    return growth.Equilibrium(*growth._newton(system, theta, start, np.zeros(len(start)), start))


def body_force(body: growth.Body, density) -> np.ndarray:
    """(n, 2) nodal forces of a force density(X, Y) (..., 2) per area of t = 0."""
    where, weight, shape = norms.quadrature(body.reference, body.triangles)
    local = np.einsum("tq,qa,tqi->tai", weight, shape, density(where[..., 0], where[..., 1]))
    return _summed(body.triangles, local, len(body.reference))


def traction(body: growth.Body, side: np.ndarray, stress) -> np.ndarray:
    """(n, 2) nodal forces of S N per length of t = 0, stress(X, Y) (..., 2, 2), on the straight side x = constant to
    the right whose nodes are marked (n,)."""
    nodes = np.flatnonzero(side)
    nodes = nodes[np.argsort(body.reference[nodes, 1])]
    edges = np.column_stack([nodes[:-1], nodes[1:]])
    points, weights = np.polynomial.legendre.leggauss(5)
    shape = np.column_stack([1 - points, 1 + points]) / 2
    where = np.einsum("qa,eai->eqi", shape, body.reference[edges])
    length = np.diff(body.reference[nodes, 1])
    pull = stress(where[..., 0], where[..., 1])[..., 0]
    return _summed(edges, np.einsum("e,q,qa,eqi->eai", length / 2, weights, shape, pull), len(body.reference))


def _summed(nodes: np.ndarray, local: np.ndarray, count: int) -> np.ndarray:
    """(count, 2) sums at nodes (k, a) of local forces (k, a, 2)."""
    return np.column_stack([np.bincount(nodes.ravel(), local[..., i].ravel(), count) for i in (0, 1)])
