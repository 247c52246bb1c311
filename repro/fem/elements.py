"""Linear elements on straight triangles, quadratic ones on curved triangles, at quadrature points.

Shape functions, their derivatives and the quadratures are scikit-fem's (``ElementTriP1``,
``ElementTriP2``). Elements are isoparametric, like its ``MeshTri2``: the functions of order
1 or 2 also map the unit triangle, x(s, t) = sum_a x_a N_a(s, t), and gradients are
grad N = N_,st (x_,st)^-1.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache
from typing import TYPE_CHECKING

import numpy as np
from skfem import ElementTriP1, ElementTriP2
from skfem.element import ElementH1
from skfem.quadrature import get_quadrature_line, get_quadrature_tri

if TYPE_CHECKING:
    from repro.fem.mesh import Mesh, Topology
    from repro.fem.space import Lumped, Quadrature, Space

#: The corner at the other end of the edges 01, 12 and 20.
NEXT = [1, 2, 0]
#: Number of straight lines that replace an arc to compute distances. They err by up to 1/256 of the
#: arc's sag.
ON_ARC = 16
#: Largest number of Newton steps that locate a point in a curved triangle.
NEWTON_STEPS = 12
#: Newton's method stops after a step shorter than this on the unit triangle. The error is then of
#: the order of its square.
CLOSE = 1e-8


@dataclass(frozen=True)
class Element:
    """Linear functions on straight triangles, whose nodes are the corners.

    degree: of the quadrature on triangles and edges, for products of two functions and a nearly
    linear coefficient; gradient_degree: of the quadrature for products of gradients, lower for
    linear functions because their gradients are constant; sides: nodes of the edges 01, 12 and 20;
    edge_weights: weights of an edge's nodes in the Newton-Cotes rule; lines: number of straight
    lines that replace an edge to compute distances.
    """

    functions: ElementH1
    degree: int
    gradient_degree: int
    sides: tuple[tuple[int, ...], ...]
    edge_weights: tuple[float, ...]
    lines: int

    @property
    def parts(self) -> int:
        """Number of parts into which its nodes divide an edge."""
        return len(self.sides[0]) - 1

    def along(self, start: np.ndarray, end: np.ndarray) -> np.ndarray:
        """(K, parts, ...) nodes of straight edges from ``start`` (K, ...) to ``end`` (K, ...),
        without the last node of each edge."""
        shares = np.arange(self.parts) / self.parts
        return np.stack([(1 - share) * start + share * end for share in shares], axis=1)

    def middles(self, corners: np.ndarray) -> np.ndarray:
        """(T, k - 3, ...) values at the nodes inside edges of a field that is linear on edges, from
        values (T, 3, ...) at the corners."""
        return corners[:, :0]

    def arcs(self, values: np.ndarray) -> np.ndarray:
        """(edges, 3, ...) of values (M, ...) at the nodes of a loop, at the start, middle and end
        of each edge."""
        after = np.roll(values, -1, axis=0)
        return np.stack([values, 0.5 * (values + after), after], axis=1)

    def on_edge(self, s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(..., parts + 1) shape functions of an edge's nodes at s in [0, 1], and derivatives."""
        return np.stack([1 - s, s], axis=-1), np.stack([0 * s - 1, 0 * s + 1], axis=-1)

    def local(self, nodes: np.ndarray, where: np.ndarray) -> np.ndarray:
        """(K, 2) coordinates on the unit triangle of points (K, 2) um in triangles (K, k, 2) um."""
        return barycentric(nodes, where)[:, 1:]

    def straightened(self, topology: Topology) -> Topology:
        """The topology of the straight triangles between the corners."""
        return topology

    def with_nodes(self, straight: Mesh) -> Mesh:
        """The mesh of straight triangles, with the nodes of this element."""
        return straight

    def integration(self, space: Space) -> Lumped | Quadrature:
        """The rule of a space that integrates the reaction."""
        return space.at_nodes


class Curved(Element):
    """Quadratic functions on curved triangles, whose nodes are the corners, then the middles of the
    edges 01, 12 and 20."""

    def middles(self, corners: np.ndarray) -> np.ndarray:
        """See :meth:`Element.middles`."""
        return 0.5 * (corners + corners[:, NEXT])

    def arcs(self, values: np.ndarray) -> np.ndarray:
        """See :meth:`Element.arcs`."""
        ends = np.concatenate([values[2::2], values[:1]])
        return np.stack([values[::2], values[1::2], ends], axis=1)

    def on_edge(self, s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """See :meth:`Element.on_edge`."""
        return parabola(s), np.stack([4 * s - 3, 4 - 8 * s, 4 * s - 1], axis=-1)

    def local(self, nodes: np.ndarray, where: np.ndarray) -> np.ndarray:
        """See :meth:`Element.local`. Newton's method inverts x(s, t). Where it does not converge,
        the result is far outside the unit triangle."""
        local = np.clip(barycentric(nodes[:, :3], where)[:, 1:], -2.0, 3.0)
        rest = np.arange(len(where))
        for _ in range(NEWTON_STEPS):
            guess = local[rest]
            corners = nodes[rest]
            functions, gradients = evaluated(2, guess)
            offset = (functions[:, None] @ corners)[:, 0] - where[rest]
            J = np.swapaxes(corners, 1, 2) @ gradients
            det = determinant(J)
            det = np.where(np.abs(det) > 1e-12 * np.abs(det).max(), det, np.inf)
            ds = J[:, 1, 1] * offset[:, 0] - J[:, 0, 1] * offset[:, 1]
            dt = J[:, 0, 0] * offset[:, 1] - J[:, 1, 0] * offset[:, 0]
            step = np.stack([ds, dt], axis=1) / det[:, None]
            local[rest] = np.clip(guess - step, -2.0, 3.0)
            rest = rest[np.abs(step).max(axis=1) >= CLOSE]
            if len(rest) == 0:
                break
        offset = np.einsum("ka,kai->ki", values(2, local), nodes) - where
        lost = np.hypot(*offset.T) > 1e-6 * np.ptp(nodes, axis=(1, 2))
        return np.where(lost[:, None], 99.0, local)

    def straightened(self, topology: Topology) -> Topology:
        """See :meth:`Element.straightened`."""
        return replace(topology, cells=np.ascontiguousarray(topology.triangles),
                       loops=tuple(loop[::2].copy() for loop in topology.loops))

    def with_nodes(self, straight: Mesh) -> Mesh:
        """See :meth:`Element.with_nodes`. The middle of edge i is node ``corners`` + i."""
        topology = straight.topology
        count = straight.corners
        points = np.vstack([straight.points, straight.points[topology.edges].mean(axis=1)])
        cells = np.column_stack([topology.triangles, count + topology.cell_edges])
        loops = tuple(np.column_stack([loop, count + topology.edge_numbers(
            loop, np.roll(loop, -1))]).ravel() for loop in topology.loops)
        return replace(straight, points=points,
                       topology=replace(topology, cells=cells, loops=loops))

    def integration(self, space: Space) -> Quadrature:
        """Integration at the quadrature points."""
        return space.at_points


#: {order: linear element on straight triangles, or quadratic element on curved triangles}.
ELEMENTS: dict[int, Element] = {
    1: Element(ElementTriP1(), degree=2, gradient_degree=1, sides=((0, 1), (1, 2), (2, 0)),
               edge_weights=(1 / 2, 1 / 2), lines=1),
    2: Curved(ElementTriP2(), degree=6, gradient_degree=6,
              sides=((0, 3, 1), (1, 4, 2), (2, 5, 0)), edge_weights=(1 / 6, 4 / 6, 1 / 6),
              lines=ON_ARC),
}


def order_of(cells: np.ndarray) -> int:
    """Order of elements with nodes (T, 3 or 6): each edge has one node more than its order."""
    return cells.shape[1] // 3


def element_of(cells: np.ndarray) -> Element:
    """The element with nodes (T, 3 or 6)."""
    return ELEMENTS[order_of(cells)]


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
    return along[:, element.sides[0]], weights


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


def parabola(t: np.ndarray) -> np.ndarray:
    """(..., 3) shape functions of start, middle and end of an arc at t in [0, 1]."""
    return np.stack([(1 - t) * (1 - 2 * t), 4 * t * (1 - t), t * (2 * t - 1)], axis=-1)


def barycentric(corners: np.ndarray, where: np.ndarray) -> np.ndarray:
    """(..., 3) barycentric coordinates of points (..., 2) in triangles (..., 3, 2)."""
    a, b, c = (corners[..., i, :] for i in range(3))

    def cross(u: np.ndarray, v: np.ndarray) -> np.ndarray:
        return u[..., 0] * v[..., 1] - u[..., 1] * v[..., 0]

    double = cross(b - a, c - a)
    a, b, c = (corner - where for corner in (a, b, c))
    return np.stack([cross(b, c), cross(c, a), cross(a, b)], -1) / double[..., None]


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
