"""Linear elements on straight triangles, quadratic ones on curved triangles, at quadrature points.

Shape functions, their derivatives and the quadratures are scikit-fem's (``ElementTriP1``,
``ElementTriP2``). Elements are isoparametric, like its ``MeshTri2``: the functions of order
1 or 2 also map the unit triangle, x(s, t) = sum_a x_a N_a(s, t), and gradients are
grad N = N_,st (x_,st)^-1.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
from skfem import ElementTriP1, ElementTriP2
from skfem.element import ElementH1
from skfem.quadrature import get_quadrature_line, get_quadrature_tri

#: The corner at the other end of the edges 01, 12 and 20.
NEXT = [1, 2, 0]


@dataclass(frozen=True)
class Element:
    """The functions of an order, and the quadrature that they need.

    degree: of the quadrature on triangles and edges, for products of two functions and a nearly
    linear coefficient; gradient_degree: of the quadrature for products of gradients, lower for
    linear functions because their gradients are constant; on_edge: indices of the triangle's
    functions that belong to edge 01; edge_weights: weights of this edge's nodes in the
    Newton-Cotes rule.
    """

    functions: ElementH1
    degree: int
    gradient_degree: int
    on_edge: tuple[int, ...]
    edge_weights: tuple[float, ...]


#: {order: linear element on straight triangles, or quadratic element on curved triangles}.
ELEMENTS = {
    1: Element(ElementTriP1(), degree=2, gradient_degree=1, on_edge=(0, 1),
               edge_weights=(1 / 2, 1 / 2)),
    2: Element(ElementTriP2(), degree=6, gradient_degree=6, on_edge=(0, 3, 1),
               edge_weights=(1 / 6, 4 / 6, 1 / 6)),
}


def order_of(cells: np.ndarray) -> int:
    """Order of elements with nodes (T, 3 or 6)."""
    return 1 if cells.shape[1] == 3 else 2


def nodes(order: int) -> np.ndarray:
    """(k, 2) coordinates of an element's nodes on the unit triangle."""
    return np.asarray(ELEMENTS[order].functions.doflocs)


def evaluated(order: int, where: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Shape functions (q, k) at points (q, 2) of the unit triangle, and their derivatives by s and
    t, (q, k, 2)."""
    element = ELEMENTS[order].functions
    places = np.ascontiguousarray(where.T)
    count = len(element.doflocs)
    values = np.empty((len(where), count))
    gradients = np.empty((len(where), count, 2))
    for k in range(count):
        value, gradient = element.lbasis(places, k)
        values[:, k] = value
        gradients[:, k, 0], gradients[:, k, 1] = gradient
    return values, gradients


def values(order: int, where: np.ndarray) -> np.ndarray:
    """(q, k) shape functions at points (q, 2) of the unit triangle."""
    return evaluated(order, where)[0]


def derivatives(order: int, where: np.ndarray) -> np.ndarray:
    """(q, k, 2) derivatives of the shape functions by s and t."""
    return evaluated(order, where)[1]


def quadrature(degree: int) -> tuple[np.ndarray, np.ndarray]:
    """Points (q, 2) of the unit triangle and their weights (q,), exact for polynomials of a degree.

    The rules are scikit-fem's, except for a degree of at most one. It needs only the centroid, but
    scikit-fem uses three points.
    """
    if degree <= 1:
        return np.full((1, 2), 1 / 3), np.full(1, 0.5)
    where, weights = get_quadrature_tri(degree)
    return where.T, weights


@dataclass(frozen=True, eq=False)
class Table:
    """Functions of an order at quadrature points of the unit triangle.

    weights: (q,); values: (q, k), derivatives: (q, k, 2) of the functions; linear: (q, 3)
    barycentric coordinates.
    """

    weights: np.ndarray
    values: np.ndarray
    derivatives: np.ndarray
    linear: np.ndarray


@cache
def table(order: int, degree: int) -> Table:
    """Functions of an order at the points of the quadrature of a degree."""
    return _tabulated(order, *quadrature(degree))


@cache
def vertex_table(order: int) -> Table:
    """Like :func:`table`, but at the corners with equal weights. This lumps the integrals."""
    return _tabulated(order, nodes(1), np.full(3, 1 / 6))


def _tabulated(order: int, where: np.ndarray, weights: np.ndarray) -> Table:
    return Table(weights, *evaluated(order, where), values(1, where))


@cache
def linear_fit(of: Table) -> np.ndarray:
    """(3, q) matrix of the least-squares fit of a linear function.

    The matrix maps values at the points of a table to values at the corners.
    """
    return np.linalg.pinv(of.linear)


@cache
def edge_table(order: int) -> tuple[np.ndarray, np.ndarray]:
    """(p, e) shape functions of an edge's e nodes at its p quadrature points, and (p,) weights."""
    element = ELEMENTS[order]
    (s,), weights = get_quadrature_line(element.degree)
    along = values(order, np.column_stack([s, 0 * s]))
    return along[:, element.on_edge], weights


@cache
def side_table(order: int, side: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Shape functions (p, k) of a triangle at the quadrature points of its side 01, 12 or 20.

    Also returns the weights (p,) and the derivatives (p, k) along the side.
    """
    (s,), weights = get_quadrature_line(ELEMENTS[order].degree)
    corners = nodes(1)
    direction = corners[NEXT[side]] - corners[side]
    where = corners[side] + s[:, None] * direction
    return values(order, where), weights, derivatives(order, where) @ direction


def by_component(tensor: np.ndarray) -> np.ndarray:
    """(T, q, 2, 2) view of (2, 2, T, q): contiguous components make arithmetic faster."""
    return np.ascontiguousarray(tensor).transpose(2, 3, 0, 1)


def determinant(matrix: np.ndarray) -> np.ndarray:
    """(...) determinants of matrices (..., 2, 2)."""
    return matrix[..., 0, 0] * matrix[..., 1, 1] - matrix[..., 0, 1] * matrix[..., 1, 0]


def inverse_transpose(matrix: np.ndarray, det: np.ndarray) -> np.ndarray:
    """(..., 2, 2) transposed inverses of matrices with determinants (...)."""
    cofactors = np.empty_like(matrix)
    cofactors[..., 0, 0] = matrix[..., 1, 1]
    cofactors[..., 1, 1] = matrix[..., 0, 0]
    cofactors[..., 0, 1] = -matrix[..., 1, 0]
    cofactors[..., 1, 0] = -matrix[..., 0, 1]
    return cofactors / det[..., None, None]


def jacobian(corners: np.ndarray, derivatives: np.ndarray) -> np.ndarray:
    """(T, q, 2, 2) d x_i / d (s, t)_k of triangles with nodes (T, k, 2).

    derivatives: (q, k, 2), as in a :class:`Table`.
    """
    return by_component(corners.transpose(2, 0, 1)[:, None] @ derivatives.transpose(2, 1, 0))


def mapped(corners: np.ndarray, tabulated: Table) -> tuple[np.ndarray, np.ndarray]:
    """Weights (T, q) um2 of the points, and gradients (T, q, 2, k) 1/um of the functions.

    corners: (T, k, 2) um, nodes of triangles. No triangle may be turned over.
    """
    J = jacobian(corners, tabulated.derivatives)
    det = determinant(J)
    turned = inverse_transpose(J, det)
    # A few products of large matrices take less time than many of small ones.
    by_point = np.swapaxes(turned, 0, 1).reshape(len(tabulated.weights), -1, 2)
    by_function = by_point @ np.swapaxes(tabulated.derivatives, 1, 2)
    gradients = by_function.reshape(len(tabulated.weights), len(corners), 2, -1)
    return det * tabulated.weights, np.ascontiguousarray(np.swapaxes(gradients, 0, 1))


def weights(corners: np.ndarray, tabulated: Table) -> np.ndarray:
    """(T, q) um2, the weights dx of :func:`mapped`, without the gradients."""
    return determinant(jacobian(corners, tabulated.derivatives)) * tabulated.weights
