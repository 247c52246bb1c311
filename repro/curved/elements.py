"""Quadratic triangles (isoparametric): nodal functions, quadrature, and gradients where the nodes are.

With s, t on the unit triangle and L = (1 - s - t, s, t): the corner functions are L_i (2 L_i - 1), those of the middles
4 L_0 L_1, 4 L_1 L_2, 4 L_2 L_0. Places are x(s, t) = sum_a x_a N_a(s, t), gradients grad N = N_,st (x_,st)^-1.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from skfem.quadrature import get_quadrature_tri

from repro.model.growth import inverse_transpose

#: Degree of the quadrature: products of two quadratic functions and a coefficient that is nearly linear.
DEGREE = 6
#: The six nodes on the unit triangle.
NODES = np.array([[0, 0], [1, 0], [0, 1], [0.5, 0], [0.5, 0.5], [0, 0.5]], float)
#: The corner at the other end of each edge.
NEXT = [1, 2, 0]


def linear_functions(where: np.ndarray) -> np.ndarray:
    """(q, 3) at points (q, 2) of the unit triangle."""
    s, t = where.T
    return np.column_stack([1 - s - t, s, t])


def functions(where: np.ndarray) -> np.ndarray:
    """(q, 6) quadratic nodal functions at points (q, 2) of the unit triangle."""
    L = linear_functions(where)
    return np.concatenate([L * (2 * L - 1), 4 * L * L[:, NEXT]], axis=1)


#: Derivatives of L by s and t.
SLOPES = np.array([[-1.0, -1.0], [1.0, 0.0], [0.0, 1.0]])


def derivatives(where: np.ndarray) -> np.ndarray:
    """(q, 6, 2) derivatives of the quadratic functions by s and t."""
    L = linear_functions(where)[..., None]
    return np.concatenate([(4 * L - 1) * SLOPES, 4 * (L * SLOPES[NEXT] + L[:, NEXT] * SLOPES)], axis=1)


def _rule(degree: int):
    where, weight = get_quadrature_tri(degree)
    return where.T, weight


POINTS, WEIGHTS = _rule(DEGREE)
AT_NODES = derivatives(NODES)
QUADRATIC, LINEAR, DERIVATIVES = functions(POINTS), linear_functions(POINTS), derivatives(POINTS)


def jacobian(nodes: np.ndarray, slopes: np.ndarray = DERIVATIVES) -> np.ndarray:
    """(T, q, 2, 2) d x_i / d (s, t)_k of triangles with nodes (T, 6, 2)."""
    return by_component(np.moveaxis(nodes, 2, 0)[:, None] @ slopes.transpose(2, 1, 0))


def by_component(tensor: np.ndarray) -> np.ndarray:
    """(T, q, 2, 2) of (2, 2, T, q), each component of which stays together in memory: arithmetic on them is faster."""
    return np.ascontiguousarray(tensor).transpose(2, 3, 0, 1)


def determinant(matrix: np.ndarray) -> np.ndarray:
    """(...) of (..., 2, 2)."""
    return matrix[..., 0, 0] * matrix[..., 1, 1] - matrix[..., 0, 1] * matrix[..., 1, 0]


@dataclass(frozen=True, eq=False)
class Places:
    """dx: (T, q) um2, weights of the integral; slopes: (T, q, 2, k) derivatives of k nodal functions by x and by y,
    1/um."""

    dx: np.ndarray
    slopes: np.ndarray

    @property
    def rows(self) -> np.ndarray:
        """(T, 2 q, k) the same slopes, one row for each point and direction."""
        return self.slopes.reshape(len(self.dx), -1, self.slopes.shape[3])

    @property
    def weighted(self) -> np.ndarray:
        """(T, 2 q, k) the rows times dx."""
        return np.repeat(self.dx, 2, axis=1)[:, :, None] * self.rows


def places(nodes: np.ndarray, bends: np.ndarray = DERIVATIVES, slopes: np.ndarray = DERIVATIVES,
           weights: np.ndarray = WEIGHTS) -> Places:
    """Weights and slopes on triangles with nodes (T, 6, 2) um, none of them turned over.

    bends: (q, 6, 2) derivatives of the places' functions by s and t, slopes: (q, k, 2) of the fields', weights: (q,) of
    the points where they are taken; by default quadratic both, in the quadrature.
    """
    turned, det = inverse_transpose(jacobian(nodes, bends))
    by_point = np.swapaxes(turned, 0, 1).reshape(len(slopes), -1, 2)  # of all triangles: a few products of matrices
    found = (by_point @ np.swapaxes(slopes, 1, 2)).reshape(len(slopes), len(nodes), 2, -1)
    return Places(det * weights, np.ascontiguousarray(np.swapaxes(found, 0, 1)))


def stiffness(at: Places) -> np.ndarray:
    """(T, k, k) of (grad u, grad v)."""
    return np.swapaxes(at.rows, 1, 2) @ at.weighted


def load(coefficient: np.ndarray) -> np.ndarray:
    """(T, 6) of (c, v) with c dx (T, q)."""
    return coefficient @ QUADRATIC


def at_points(values: np.ndarray, cells: np.ndarray) -> np.ndarray:
    """(T, q) a nodal field (N,) in the points of the quadrature."""
    return values[cells] @ QUADRATIC.T


def weights(dx: np.ndarray, mesh) -> np.ndarray:
    """(N,) integrals of the nodal functions over the biomass triangles of a mesh, with dx (t, q) there."""
    return np.bincount(mesh.cells[mesh.biomass].ravel(), load(dx).ravel(), len(mesh.points))
