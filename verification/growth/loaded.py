"""Dead loads on a body, the f0 and t0 of (20), as nodal forces of straight and of curved triangles."""

from __future__ import annotations

import numpy as np

from repro.fem import elements
from repro.fem.mesh import Mesh
from repro.model import growth
from verification.growth.bodies import Supported, integrated


def equilibrium(held: Supported, theta: np.ndarray, forces: np.ndarray, start: np.ndarray) -> growth.Equilibrium:
    """Equilibrium under theta (t, q) and nodal forces (n, 2), over mu_L, that do not depend on the shape, from places
    (n, 2) near it with the held ones on their targets, and without pressure. Raises GrowthError where there is none."""
    return growth.equilibrium(held.body, theta, start, held.resting, held.held, start, forces=forces)


def body_force(held: Supported, density) -> np.ndarray:
    """(n, 2) nodal forces of a force density(X, Y) (..., 2) per area of t = 0."""
    where, weight, of = integrated(held)
    local = np.einsum("tq,qa,tqi->tai", weight, of.values, density(*where))
    return _summed(held.cells, local, len(held.reference))


def traction(held: Supported, grid: Mesh, stress) -> np.ndarray:
    """(n, 2) nodal forces of S N per length of t = 0, stress(X, Y) (..., 2, 2), on the straight right end of the
    rectangle ``grid`` that is the whole body."""
    order = held.geometry
    edges = grid.topology.dofs(order).outlet
    points, weights = np.polynomial.legendre.leggauss(5)
    along = (points + 1) / 2
    shape = elements.values(order, np.column_stack([along, 0 * along]))[:, elements.ON_EDGE[order]]
    where = np.einsum("qa,eai->eqi", shape, held.reference[edges])
    length = held.reference[edges[:, -1], 1] - held.reference[edges[:, 0], 1]
    pull = stress(where[..., 0], where[..., 1])[..., 0]
    return _summed(edges, np.einsum("e,q,qa,eqi->eai", length / 2, weights, shape, pull), len(held.reference))


def _summed(nodes: np.ndarray, local: np.ndarray, count: int) -> np.ndarray:
    """(count, 2) sums at nodes (k, a) of local forces (k, a, 2)."""
    return np.column_stack([np.bincount(nodes.ravel(), local[..., i].ravel(), count) for i in (0, 1)])
