"""Curved triangulation: the straight one of :mod:`repro.fem.mesh` with a node in the middle of every edge."""

from __future__ import annotations

from collections.abc import Callable, Hashable
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from repro.curved import elements
from repro.errors import MeshError
from repro.fem.linear import node_order
from repro.fem.mesh import PoreMesh, triangle_areas


@dataclass(frozen=True, eq=False)
class CurvedMesh:
    """Triangles with six nodes over ``ends`` x [0, width].

    points: (N, 2) um, corners first; cells: (T, 6) nodes, corners counterclockwise, then middles; corners: how many;
    biomass: (T,); loop: (2 M,) nodes of the aggregate's boundary, counterclockwise, corner and middle in turn.
    """

    points: np.ndarray
    cells: np.ndarray
    corners: int
    biomass: np.ndarray
    loop: np.ndarray
    width: float
    ends: tuple[float, float]
    topology: dict = field(default_factory=dict, repr=False)
    placed: dict = field(default_factory=dict, init=False, repr=False)

    @cached_property
    def places(self) -> elements.Places:
        """Weights and slopes on every triangle."""
        return elements.places(self.points[self.cells])

    @cached_property
    def straight(self) -> PoreMesh:
        """The triangles between the corners alone."""
        found = PoreMesh(self.points[: self.corners], self.cells[:, :3], self.biomass, self.loop[::2], self.width,
                         self.ends, self.once("straight", dict))
        return found

    def once(self, key: Hashable, make: Callable):
        """``make()``, worked out once for these connections."""
        if key not in self.topology:
            self.topology[key] = make()
        return self.topology[key]

    def here(self, key: Hashable, make: Callable):
        """``make()``, worked out once for these places of the nodes."""
        if key not in self.placed:
            self.placed[key] = make()
        return self.placed[key]

    @property
    def body(self) -> np.ndarray:
        """Nodes of the aggregate, ascending: corners first."""
        return self.once("body", lambda: np.unique(self.cells[self.biomass]))

    @property
    def body_cells(self) -> np.ndarray:
        """(t, 6) biomass triangles in the numbering of ``body``."""
        return self.once("body cells", lambda: np.searchsorted(self.body, self.cells[self.biomass]))

    @property
    def body_loop(self) -> np.ndarray:
        """``loop`` in the numbering of ``body``."""
        return np.searchsorted(self.body, self.loop)

    @property
    def order(self) -> np.ndarray:
        """Nodes in elimination order."""
        return self.once("order", lambda: node_order(len(self.points), self.cells))

    @property
    def inlet(self) -> np.ndarray:
        """Nodes of the inlet from the lower wall up, corner and middle in turn."""
        return self.once("inlet", lambda: self._line(self.ends[0]))

    @property
    def outlet(self) -> np.ndarray:
        """Nodes of the outlet from the lower wall up."""
        return self.once("outlet", lambda: self._line(self.ends[1]))

    @property
    def walls(self) -> np.ndarray:
        """Nodes of both walls."""
        return self.once("walls", lambda: np.flatnonzero((self.points[:, 1] == 0) | (self.points[:, 1] == self.width)))

    def _line(self, level: float) -> np.ndarray:
        nodes = np.flatnonzero(self.points[:, 0] == level)
        return nodes[np.argsort(self.points[nodes, 1])]

    def weights(self) -> np.ndarray:
        """(N,) integrals of the nodal functions over the aggregate, um2."""
        return elements.weights(self.places.dx[self.biomass], self)

    def area(self) -> float:
        """Of the aggregate, um2."""
        return float(self.places.dx[self.biomass].sum())

    def moved(self, points: np.ndarray) -> CurvedMesh:
        """The same triangles with their nodes at ``points`` (N, 2)."""
        return replace(self, points=points)

    @property
    def edge_ends(self) -> np.ndarray:
        """(E, 2) corners at the ends of every edge, the middle of which is node ``corners`` + its number."""
        return self.once("edge ends", self._edge_ends)

    def _edge_ends(self) -> np.ndarray:
        found = np.empty((len(self.points) - self.corners, 2), int)
        found[self.cells[:, 3:] - self.corners] = np.stack([self.cells[:, :3], self.cells[:, elements.NEXT]], axis=2)
        return found

    def with_middles(self, field: np.ndarray) -> np.ndarray:
        """(N, ...) a linear field (corners, ...) at the middles of the edges too."""
        a, b = self.edge_ends.T
        return np.concatenate([field, 0.5 * (field[a] + field[b])])

    def turned_over(self, which: np.ndarray | slice = slice(None)) -> np.ndarray:
        """(T,) is the map of a triangle (of those in ``which``) not one to one where it is integrated, or at its nodes?
        """
        return elements.determinant(elements.jacobian(self.points[self.cells[which]], CHECKED)).min(axis=1) <= 0

    @property
    def bent(self) -> np.ndarray:
        """Triangles with a node of the aggregate: the other ones of a mesh that has followed it are straight."""
        return self.once("bent", lambda: np.flatnonzero(np.isin(self.cells, self.body).any(axis=1)))

    def strained_arcs(self) -> np.ndarray:
        """(M,) has an arc of the outline a triangle beside it that is turned over?"""
        return np.isin(self.loop[1::2], self.cells[self.turned_over(), 3:])

    def checked(self) -> CurvedMesh:
        """Itself. Raises MeshError where a triangle is turned over."""
        bad = np.flatnonzero(self.turned_over())
        if len(bad):
            x, y = self.points[self.cells[bad[0]]].mean(axis=0)
            raise MeshError(f"a curved triangle near x = {x:.4g}, y = {y:.4g} um is turned over; "
                            "try a larger numerics.refinement or a shorter growth.time_step")
        return self

    def acceptable(self) -> bool:
        """The paper's criterion (3.5) for the straight triangles, and none at the aggregate turned over."""
        return self.straight.acceptable() and not self.turned_over(self.bent).any()


#: Derivatives of the nodal functions at the six nodes and at the points of the quadrature.
CHECKED = np.concatenate([elements.AT_NODES, elements.DERIVATIVES])


def curved(straight: PoreMesh, middles: np.ndarray | None) -> CurvedMesh:
    """Nodes in the middles of all edges; on the aggregate's boundary those given, (M, 2) um, after each loop node."""
    edges = np.sort(straight.triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    pairs, which = np.unique(edges, axis=0, return_inverse=True)
    count = len(straight.points)
    points = np.vstack([straight.points, straight.points[pairs].mean(axis=1)])
    cells = np.column_stack([straight.triangles, count + which.reshape(-1, 3)])
    loop = np.empty(0, int)
    if len(straight.loop):
        key = pairs[:, 0] * count + pairs[:, 1]
        rim = np.sort(np.column_stack([straight.loop, np.roll(straight.loop, -1)]), axis=1)
        between = count + np.searchsorted(key, rim[:, 0] * count + rim[:, 1])
        points[between] = middles
        loop = np.column_stack([straight.loop, between]).ravel()
    return CurvedMesh(points, cells, count, straight.biomass, loop, straight.width, straight.ends)


def unlocked(straight: PoreMesh) -> PoreMesh:
    """The same nodes without triangles that have two edges on the boundary of their region, fluid or biomass.

    Linear pressures on such a corner leave quadratic displacements too little freedom; the corner's inner edge is
    exchanged for the other diagonal where that is possible.
    """
    triangles = straight.triangles.copy()
    for corner in _cornered(triangles, straight.biomass):
        _flip(straight.points, triangles, straight.biomass, corner)
    return replace(straight, triangles=triangles, topology={})


def _region_edges(triangles: np.ndarray, biomass: np.ndarray) -> np.ndarray:
    """(T, 3) is edge i -> i + 1 on the boundary of the triangle's own region?"""
    edges = np.sort(triangles[:, [[0, 1], [1, 2], [2, 0]]], axis=2).reshape(-1, 2)
    keys = np.column_stack([edges, np.repeat(biomass, 3)])
    _, which, counts = np.unique(keys, axis=0, return_inverse=True, return_counts=True)
    return (counts[which.ravel()] == 1).reshape(-1, 3)


def _cornered(triangles: np.ndarray, biomass: np.ndarray) -> np.ndarray:
    return np.flatnonzero(_region_edges(triangles, biomass).sum(axis=1) == 2)


def _flip(points: np.ndarray, triangles: np.ndarray, biomass: np.ndarray, corner: int) -> None:
    """Exchange the inner edge of a cornered triangle for the other diagonal of it and its neighbour, in place."""
    inner = int(np.flatnonzero(~_region_edges(triangles, biomass)[corner])[0]) if (
        _region_edges(triangles, biomass)[corner].sum() == 2) else -1
    if inner < 0:
        return
    c, a, b = np.roll(triangles[corner], -inner)
    sharing = np.flatnonzero((triangles == a).any(axis=1) & (triangles == c).any(axis=1) & (biomass == biomass[corner]))
    beside = int(sharing[sharing != corner][0])
    d = int(triangles[beside][(triangles[beside] != a) & (triangles[beside] != c)][0])
    pair = np.array([[a, b, d], [b, c, d]])
    if triangle_areas(points, pair).min() > 0:
        triangles[corner], triangles[beside] = pair
