"""Where velocity and concentrations live on curved triangles: quadratic at the mesh's own nodes, or cubic.

With L the barycentric coordinates the cubic functions (Lagrange, ten a triangle) are L_i (3 L_i - 1) (3 L_i - 2) / 2 of
the corners, 9/2 L_i L_j (3 L_i - 1) of the nodes at the edges' thirds, and 27 L_0 L_1 L_2 of the centre. Places are
quadratic either way, x(s, t) = sum_a x_a N_a(s, t); the head is of one order less than the velocity (Taylor-Hood).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from skfem.quadrature import get_quadrature_line, get_quadrature_tri

from repro.curved import elements
from repro.curved.mesh import CurvedMesh
from repro.fem.linear import node_order

#: Degrees of the quadratures on triangles and on edges: products of two functions and a coefficient nearly linear.
DEGREES = {2: (elements.DEGREE, 6), 3: (8, 9)}


def cubic_functions(where: np.ndarray) -> np.ndarray:
    """(q, 10) at points (q, 2) of the unit triangle: corners, both nodes of the edges 01, 12, 20, centre."""
    L = elements.linear_functions(where)
    M = L[:, elements.NEXT]
    edges = 4.5 * L * M
    return np.concatenate([L * (3 * L - 1) * (3 * L - 2) / 2, _paired(edges * (3 * L - 1), edges * (3 * M - 1)),
                           27 * L.prod(axis=1, keepdims=True)], axis=1)


def cubic_derivatives(where: np.ndarray) -> np.ndarray:
    """(q, 10, 2) derivatives of the cubic functions by s and t."""
    L, by = elements.linear_functions(where)[..., None], elements.SLOPES
    M, by_m = L[:, elements.NEXT], by[elements.NEXT]
    near = 4.5 * ((6 * L - 1) * M * by + L * (3 * L - 1) * by_m)
    far = 4.5 * ((6 * M - 1) * L * by_m + M * (3 * M - 1) * by)
    centre = 27 * sum(L[:, [(i + 1) % 3]] * L[:, [(i + 2) % 3]] * by[i] for i in range(3))
    return np.concatenate([(27 * L**2 - 18 * L + 2) / 2 * by, _paired(near, far), centre], axis=1)


def _paired(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """(q, 6, ...) of two (q, 3, ...), in turn."""
    return np.stack([first, second], axis=2).reshape(len(first), 6, *first.shape[2:])


@dataclass(frozen=True, eq=False)
class Functions:
    """Nodal functions of an order in the points of its quadratures.

    weights: (q,); values: (q, k), slopes: (q, k, 2) of the fields; shape: (q, 6), bends: (q, 6, 2) of the places;
    head: (q, h); along: (p, e) of an edge's nodes in the points of a line, line_weights: (p,).
    """

    weights: np.ndarray
    values: np.ndarray
    slopes: np.ndarray
    shape: np.ndarray
    bends: np.ndarray
    head: np.ndarray
    along: np.ndarray
    line_weights: np.ndarray

    @cached_property
    def products(self) -> np.ndarray:
        """(q, k k) of two nodal functions."""
        return (self.values[:, :, None] * self.values[:, None, :]).reshape(len(self.weights), -1)


def _functions(order: int) -> Functions:
    area, line = DEGREES[order]
    (s,), line_weights = get_quadrature_line(line)
    if order == 2:
        along = np.column_stack([(1 - s) * (1 - 2 * s), 4 * s * (1 - s), s * (2 * s - 1)])
        places = elements.QUADRATIC, elements.DERIVATIVES
        return Functions(elements.WEIGHTS, *places, *places, elements.LINEAR, along, line_weights)
    where, weights = get_quadrature_tri(area)
    shape, bends = elements.functions(where.T), elements.derivatives(where.T)
    edge = cubic_functions(np.column_stack([s, 0 * s]))[:, [0, 3, 4, 1]]
    return Functions(weights, cubic_functions(where.T), cubic_derivatives(where.T), shape, bends, shape, edge,
                     line_weights)


FUNCTIONS = {order: _functions(order) for order in DEGREES}
#: The mesh's six nodes from ten cubic ones, and the ten from six quadratic ones.
THIRDS = np.array([[0, 0], [1, 0], [0, 1], [1, 0], [2, 0], [2, 1], [1, 2], [0, 2], [0, 1], [1, 1]]) / [
    [1], [1], [1], *[[3]] * 7]
DOWN, UP = cubic_functions(elements.NODES), elements.functions(THIRDS)


@dataclass(frozen=True, eq=False)
class Space:
    """Fields of one order on a mesh.

    cells: (T, k) nodes, k = 6 or 10; count: of all nodes, the mesh's corners first; order: (count,) in elimination
    order; inlet, outlet: (E, 3 or 4) nodes of their edges, from the lower wall up; walls: nodes of both.
    """

    mesh: CurvedMesh
    of: Functions
    cells: np.ndarray
    count: int
    order: np.ndarray
    inlet: np.ndarray
    outlet: np.ndarray
    walls: np.ndarray

    @property
    def cubic(self) -> bool:
        """Or quadratic."""
        return self.of is FUNCTIONS[3]

    @property
    def head_cells(self) -> np.ndarray:
        """(T, h) nodes of the head."""
        return self.mesh.cells if self.cubic else self.mesh.cells[:, :3]

    @property
    def at(self) -> elements.Places:
        """Weights and slopes on every triangle."""
        if not self.cubic:
            return self.mesh.places
        rule = self.of.bends, self.of.slopes, self.of.weights
        return self.mesh.here("cubic places", lambda: elements.places(self.mesh.points[self.mesh.cells], *rule))

    @property
    def stiffness(self) -> np.ndarray:
        """(T, k, k) of (grad u, grad v)."""
        return self.mesh.here(("stiffness", self.cubic), lambda: elements.stiffness(self.at))

    @property
    def biomass_cells(self) -> np.ndarray:
        """(t, k) nodes of the biomass triangles."""
        return self.mesh.once(("biomass cells", self.cubic), lambda: self.cells[self.mesh.biomass])

    @cached_property
    def points(self) -> np.ndarray:
        """(count, 2) um."""
        return self.of_mesh(self.mesh.points)

    def of_mesh(self, field: np.ndarray) -> np.ndarray:
        """(count, ...) a quadratic field (N, ...) at these nodes."""
        if not self.cubic:
            return field
        found = np.empty((self.count, *field.shape[1:]))
        found[self.cells] = np.einsum("ab,tb...->ta...", UP, field[self.mesh.cells])
        return found

    def to_mesh(self, field: np.ndarray) -> np.ndarray:
        """(N, ...) of a field (count, ...) at the mesh's nodes."""
        if not self.cubic:
            return field
        found = np.empty((len(self.mesh.points), *field.shape[1:]))
        found[self.mesh.cells] = np.einsum("ab,tb...->ta...", DOWN, field[self.cells])
        return found

    def at_points(self, values: np.ndarray, cells: np.ndarray) -> np.ndarray:
        """(..., t, q) fields (..., count) in the points of the quadrature of triangles with nodes (t, k)."""
        return values[..., cells] @ self.of.values.T

    def mass(self, coefficient: np.ndarray) -> np.ndarray:
        """(t, k, k) of (c u, v) with c dx (t, q)."""
        k = self.cells.shape[1]
        return (coefficient @ self.of.products).reshape(-1, k, k)

    def load(self, coefficient: np.ndarray) -> np.ndarray:
        """(t, ..., k) of (c, v) with c dx (t, ..., q), all in one product of two matrices."""
        flat = coefficient.reshape(-1, coefficient.shape[-1])
        return (flat @ self.of.values).reshape(*coefficient.shape[:-1], -1)

    def end_nodes(self, edges: np.ndarray) -> np.ndarray:
        """Nodes of an end's edges, each once."""
        return np.append(edges[:, :-1].ravel(), edges[-1, -1])


def space(mesh: CurvedMesh, order: int) -> Space:
    """Quadratic (order 2) or cubic (3) fields on a mesh."""
    parts = mesh.once(("space", order), lambda: _quadratic(mesh) if order == 2 else _cubic(mesh))
    return Space(mesh, FUNCTIONS[order], *parts)


def _ends(mesh: CurvedMesh) -> list[np.ndarray]:
    """(E, 3) corner, middle, corner of the edges of the inlet, and of the outlet."""
    return [np.column_stack([line[:-2:2], line[1:-1:2], line[2::2]]) for line in (mesh.inlet, mesh.outlet)]


def _quadratic(mesh: CurvedMesh) -> tuple:
    return mesh.cells, len(mesh.points), mesh.order, *_ends(mesh), mesh.walls


def _cubic(mesh: CurvedMesh) -> tuple:
    """An edge's nodes take its middle's number, the one near the corner with the lower number, and that and the count
    of edges; so the head's nodes are among the first ones."""
    corners, edges = mesh.corners, len(mesh.points) - mesh.corners

    def thirds(a, middle, b):
        """The edge's node near a, and the one near b."""
        return middle + edges * (a > b), middle + edges * (a < b)

    a = mesh.cells[:, :3]
    near, far = thirds(a, mesh.cells[:, 3:], a[:, elements.NEXT])
    centre = corners + 2 * edges + np.arange(len(a))
    cells = np.column_stack([a, np.stack([near, far], axis=2).reshape(-1, 6), centre])
    ends = [np.column_stack([a, *thirds(a, middle, b), b]) for a, middle, b in (each.T for each in _ends(mesh))]
    middles = mesh.walls[mesh.walls >= corners]
    count = corners + 2 * edges + len(a)
    return cells, count, node_order(count, cells), *ends, np.concatenate([mesh.walls, middles + edges])
