"""Triangles of the meshed part of the pore (3.1): one mesh for fluid and biomass.

A curved triangle has six nodes: corners, then the middles of the edges 01, 12 and 20
(isoparametric). A :class:`Topology` has the properties that depend only on the connections. A moved
mesh keeps the topology. A :class:`Mesh` is immutable, so it computes once each property that
depends on the coordinates of its nodes.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass, field, replace
from functools import cache, cached_property

import numpy as np
from skfem import MeshTri

from repro.errors import MeshError
from repro.fem import elements
from repro.fem.assembly import ElementSystem
from repro.fem.brief import brief
from repro.fem.elements import Element
from repro.fem.linear import DEFAULT, Method, node_order
from repro.fem.walls import Wall, Walls, on_any, whole_width, width_between

#: A new mesh is needed if more than POOR_ALLOWED triangles have a quality below POOR (3.5).
POOR = 0.6
POOR_ALLOWED = 6


@dataclass(frozen=True, eq=False)
class Dofs:
    """Nodes of a mesh.

    cells: (T, 3 or 6) nodes of each triangle, corners first; count: number of all nodes; inlet,
    outlet: (E, 2 or 3) nodes of each edge, from the lower wall up; walls: nodes on both walls.
    """

    cells: np.ndarray
    count: int
    inlet: np.ndarray
    outlet: np.ndarray
    walls: np.ndarray

    @cached_property
    def elimination(self) -> np.ndarray:
        """(count,) nodes in elimination order."""
        return node_order(self.count, self.cells)

    @cached_property
    def places(self) -> np.ndarray:
        """(count,) position of each node in the elimination order."""
        places = np.empty(self.count)
        places[self.elimination] = np.arange(self.count)
        return places

    @cached_property
    def beside_inlet(self) -> tuple[np.ndarray, np.ndarray]:
        """(E,) triangle beside each edge of the inlet, and (E, 2 or 3) local indices of the edge's
        nodes in this triangle."""
        return beside(self.cells, self.inlet)

    @cached_property
    def beside_outlet(self) -> tuple[np.ndarray, np.ndarray]:
        """Like :attr:`beside_inlet`, for the outlet."""
        return beside(self.cells, self.outlet)


def beside(cells: np.ndarray, edges: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(E,) triangle of ``cells`` (T, 3 or 6) beside each edge (E, e), and (E, e) local indices of
    the edge's nodes in this triangle."""
    first = np.flatnonzero(np.isin(cells[:, :3], edges[:, [0, -1]]).sum(axis=1) >= 2)
    near = cells[first, :3]
    has_start = (near == edges[:, None, None, 0]).any(axis=2)
    has_end = (near == edges[:, None, None, -1]).any(axis=2)
    owner = first[(has_start & has_end).argmax(axis=1)]
    return owner, np.argmax(cells[owner][:, :, None] == edges[:, None, :], axis=1)


@dataclass(frozen=True, eq=False)
class Region:
    """One aggregate among the triangles of a mesh.

    triangles: (t,) numbers of its triangles; cells: (t, 3 or 6) nodes of these triangles; corners:
    number of corners in the mesh; loop: (M,) nodes of the aggregate's boundary, counterclockwise.
    On curved triangles corners and middles alternate.
    """

    triangles: np.ndarray
    cells: np.ndarray
    corners: int
    loop: np.ndarray

    @cached_property
    def nodes(self) -> np.ndarray:
        """(n,) nodes of the aggregate and its boundary, ascending: corners first."""
        return np.unique(self.cells)

    @cached_property
    def own_cells(self) -> np.ndarray:
        """(t, 3 or 6) ``cells`` as indices into ``nodes``."""
        return np.searchsorted(self.nodes, self.cells)

    @cached_property
    def own_loop(self) -> np.ndarray:
        """(M,) ``loop`` as indices into ``nodes``."""
        return np.searchsorted(self.nodes, self.loop)

    @cached_property
    def corner_nodes(self) -> np.ndarray:
        """Corners among ``nodes``."""
        return self.nodes[self.nodes < self.corners]

    @cached_property
    def beside_loop(self) -> tuple[np.ndarray, np.ndarray]:
        """(edges,) triangle of the aggregate beside each edge of ``loop``, and (edges,) number of
        this edge in the triangle: 0 for 01, 1 for 12, 2 for 20."""
        line = self.loop[:: elements.order_of(self.cells)]
        owner, places = beside(self.cells, np.column_stack([line, np.roll(line, -1)]))
        return owner, places[:, 0]


@dataclass(frozen=True, eq=False)
class Connections:
    """Triangles by their nodes.

    cells: (T, 3 or 6) nodes, corners counterclockwise, then middles; corners: number of corners.
    """

    cells: np.ndarray
    corners: int

    @property
    def geometry(self) -> int:
        """1: straight triangles with linear functions, 2: curved ones with quadratic functions."""
        return elements.order_of(self.cells)

    @property
    def element(self) -> Element:
        """Their nodes and functions."""
        return elements.element_of(self.cells)

    @property
    def triangles(self) -> np.ndarray:
        """(T, 3) corners."""
        return self.cells[:, :3]


@dataclass(frozen=True, eq=False)
class Topology(Connections):
    """Connections of a mesh.

    region: (T,) number of each triangle's aggregate from 1 on, 0 in the fluid; loops: (M,) nodes of
    the boundary of each aggregate, as in :class:`Region`; inlet, outlet: corners from the lower
    wall up; walls: corners on both walls; method: solver of the linear systems.
    """

    region: np.ndarray
    loops: tuple[np.ndarray, ...]
    inlet: np.ndarray
    outlet: np.ndarray
    walls: np.ndarray
    method: Method = DEFAULT
    _systems: dict[Hashable, ElementSystem] = field(init=False, repr=False, default_factory=dict)

    @cached_property
    def straight(self) -> Topology:
        """Topology of the straight triangles between the corners."""
        return self.element.straightened(self)

    @cached_property
    def biomass(self) -> np.ndarray:
        """(T,) True in the aggregates."""
        return self.region > 0

    @cached_property
    def regions(self) -> tuple[Region, ...]:
        """The aggregates."""
        regions = []
        for number, loop in enumerate(self.loops, 1):
            triangles = np.flatnonzero(self.region == number)
            regions.append(Region(triangles, self.cells[triangles], self.corners, loop))
        return tuple(regions)

    @cached_property
    def body(self) -> np.ndarray:
        """Nodes of the aggregates, their boundaries included, ascending: corners first."""
        return np.unique(self.cells[self.biomass])

    @cached_property
    def body_cells(self) -> np.ndarray:
        """(t, 3 or 6) nodes of the biomass triangles as indices into ``body``."""
        return np.searchsorted(self.body, self.cells[self.biomass])

    @cached_property
    def body_corners(self) -> np.ndarray:
        """Corners of the aggregates."""
        return self.body[self.body < self.corners]

    @cached_property
    def fluid(self) -> np.ndarray:
        """Corners of the fluid, the interface included, ascending."""
        return np.unique(self.triangles[~self.biomass])

    @cached_property
    def bent(self) -> np.ndarray:
        """Triangles with a node of an aggregate. In a moved mesh all other triangles are straight.
        """
        return np.flatnonzero(np.isin(self.cells, self.body).any(axis=1))

    @cached_property
    def _edges(self) -> tuple[np.ndarray, np.ndarray]:
        ends = np.stack([self.triangles, self.triangles[:, elements.NEXT]], axis=2)
        pairs = np.sort(ends.reshape(-1, 2), axis=1)
        edges, numbers = np.unique(pairs, axis=0, return_inverse=True)
        return edges, numbers.reshape(-1, 3)

    @property
    def edges(self) -> np.ndarray:
        """(E, 2) corners at the ends of every edge, in ascending order."""
        return self._edges[0]

    @property
    def cell_edges(self) -> np.ndarray:
        """(T, 3) numbers of the edges 01, 12 and 20 of each triangle."""
        return self._edges[1]

    def edge_numbers(self, first: np.ndarray, second: np.ndarray) -> np.ndarray:
        """(K,) numbers of the edges between the corners ``first`` (K,) and ``second`` (K,)."""
        keys = self.edges @ (self.corners, 1)
        return np.searchsorted(
            keys, np.minimum(first, second) * self.corners + np.maximum(first, second))

    @cached_property
    def dofs(self) -> Dofs:
        """Nodes of the ends and of the walls."""
        walls = np.concatenate([self.walls, self._inside_edges_on_walls()])
        return Dofs(self.cells, int(self.cells.max()) + 1, self._edges_of(self.inlet),
                    self._edges_of(self.outlet), walls)

    @cached_property
    def _sides(self) -> np.ndarray:
        """(T, 3, e) nodes of the edges 01, 12 and 20 of each triangle."""
        return self.cells[:, np.array(self.element.sides)]

    def _joins(self, corners: np.ndarray) -> np.ndarray:
        """(T, 3) True where an edge joins two of some corners."""
        chosen = np.zeros(self.corners, bool)
        chosen[corners] = True
        return chosen[self._sides[:, :, [0, -1]]].all(axis=2)

    def _edges_of(self, line: np.ndarray) -> np.ndarray:
        """(E, e) nodes of the edges of a line of corners, in its order and direction."""
        edges = self._sides[self._joins(line)]
        place = np.empty(self.corners, int)
        place[line] = np.arange(len(line))
        start = place[edges[:, 0]]
        end = place[edges[:, -1]]
        forward = np.where((start < end)[:, None], edges, edges[:, ::-1])
        return forward[np.argsort(np.minimum(start, end))]

    def _inside_edges_on_walls(self) -> np.ndarray:
        """Nodes inside the edges that have one triangle and both corners on a wall, ascending.

        If the inlet or the outlet is a single edge, this edge joins both walls and does not count.
        """
        inside = self._sides[:, :, 1:-1]
        across = self._joins(self.inlet) | self._joins(self.outlet)
        nodes = np.sort(inside[self._joins(self.walls) & ~across].ravel())
        return nodes[np.bincount(inside.ravel(), minlength=1 + nodes.max(initial=0))[nodes] == 1]

    def system(self, key: Hashable, make: Callable[[], ElementSystem]) -> ElementSystem:
        """The sparse system of a key on these connections; ``make`` builds it on first use."""
        if key not in self._systems:
            self._systems[key] = make()
        return self._systems[key]


@brief
@dataclass(frozen=True, eq=False)
class Mesh:
    """Triangles of fluid and biomass between two walls and two ends.

    points: (N, 2) um, coordinates of the nodes, corners first; ends: x (um) of inlet and outlet.
    """

    points: np.ndarray
    topology: Topology
    walls: Walls
    ends: tuple[float, float]

    @staticmethod
    def of(points: np.ndarray, cells: np.ndarray, region: np.ndarray,
           loops: tuple[np.ndarray, ...], walls: Walls, ends: tuple[float, float],
           method: Method = DEFAULT) -> Mesh:
        """Build the mesh of triangles with nodes (T, 3 or 6), corners numbered first.

        region, loops: as in :class:`Topology`; with one aggregate ``region`` may be boolean.
        """
        count = int(cells[:, :3].max()) + 1
        x, y = points[:count].T
        on_walls = np.flatnonzero(on_any(walls, points[:count]))

        def line(level: float) -> np.ndarray:
            nodes = np.flatnonzero(x == level)
            return nodes[np.argsort(y[nodes])]

        topology = Topology(cells, count, region.astype(int), loops, line(ends[0]), line(ends[1]),
                            on_walls, method)
        return Mesh(points, topology, walls, ends)

    @property
    def width(self) -> float:
        """W, from wall to wall (um)."""
        return width_between(self.walls)

    @property
    def whole_width(self) -> float:
        """Width (um) of the pore: W, or 2 W if one wall is a plane of symmetry."""
        return whole_width(self.walls)

    @property
    def geometry(self) -> int:
        """1: straight triangles, 2: curved ones."""
        return self.topology.geometry

    @property
    def element(self) -> Element:
        """Nodes and functions of the triangles."""
        return self.topology.element

    @property
    def cells(self) -> np.ndarray:
        """(T, 3 or 6) nodes."""
        return self.topology.cells

    @property
    def triangles(self) -> np.ndarray:
        """(T, 3) corners."""
        return self.topology.triangles

    @property
    def corners(self) -> int:
        """Number of nodes that are corners."""
        return self.topology.corners

    @property
    def biomass(self) -> np.ndarray:
        """(T,) True in the aggregates."""
        return self.topology.biomass

    @property
    def regions(self) -> tuple[Region, ...]:
        """The aggregates."""
        return self.topology.regions

    @property
    def loop(self) -> np.ndarray:
        """(M,) nodes of the boundaries of the aggregates, one after the other."""
        return np.concatenate([np.empty(0, int), *self.topology.loops])

    @property
    def body(self) -> np.ndarray:
        """Nodes of the aggregates."""
        return self.topology.body

    @cached_property
    def straight(self) -> Mesh:
        """The mesh of the straight triangles between the corners."""
        return replace(self, points=self.points[: self.corners], topology=self.topology.straight)

    @cached_property
    def sides(self) -> np.ndarray:
        """(T, 3, 2) um: side i of a triangle is opposite its corner i."""
        return sides(self.points, self.triangles)

    @cached_property
    def areas(self) -> np.ndarray:
        """(T,) signed areas of the triangles between the corners, um2."""
        return triangle_areas(self.points, self.triangles)

    @cached_property
    def quality(self) -> np.ndarray:
        """(T,) 4 sqrt(3) |tau| / sum h_i^2: one for an equilateral triangle (3.5)."""
        return 4 * np.sqrt(3) * self.areas / np.sum(self.sides**2, axis=(1, 2))

    @cached_property
    def circumdiameter(self) -> np.ndarray:
        """(T,) h_tau, the diameter of the circumscribed circle (3.4), um."""
        return np.prod(np.linalg.norm(self.sides, axis=2), axis=1) / (2 * np.abs(self.areas))

    @cached_property
    def gradients(self) -> np.ndarray:
        """(T, 3, 2) gradients, 1/um, of the barycentric coordinates between the corners."""
        return gradients(self.points, self.triangles)

    @cached_property
    def fem(self) -> MeshTri:
        """The triangles between the corners for scikit-fem, corners in the same order."""
        return MeshTri(self.points[: self.corners].T.copy(), self.triangles.T.copy(), sort_t=False)

    def on_wall(self, wall: Wall, side: int) -> np.ndarray:
        """(T,) True where the side 01, 12 or 20 of a triangle lies on a wall."""
        ends = self.triangles[:, [side, elements.NEXT[side]]]
        farther = wall.gap(self.points[ends]).max(axis=1)
        return np.isin(ends, self.topology.walls).all(axis=1) & (farther < self.width / 2)

    def nodes_on(self, wall: Wall) -> np.ndarray:
        """Nodes on a wall."""
        nodes = self.topology.dofs.walls
        return nodes[wall.gap(self.points[nodes]) < self.width / 2]

    def area(self) -> float:
        """Area of the aggregates, um2."""
        of = elements.table(self.geometry, self.element.degree)
        return float(elements.weights(self.points[self.cells[self.biomass]], of).sum())

    def with_middles(self, field: np.ndarray) -> np.ndarray:
        """(N, ...) values at all nodes of a field (corners, ...) that is linear on every edge."""
        nodal = np.empty((len(self.points), *field.shape[1:]), field.dtype)
        nodal[: self.corners] = field
        nodal[self.cells[:, 3:]] = self.element.middles(field[self.triangles])
        return nodal

    def from_body(self, values: np.ndarray, outside: np.ndarray | float = 0.0) -> np.ndarray:
        """(N, k) values at all nodes, from values (n, k) at the aggregates' nodes.

        outside: values in the fluid, (N, k) or a number.
        """
        nodal = np.full((len(self.points), values.shape[1]), outside)
        nodal[self.body] = values
        return nodal

    def from_region(self, region: Region, values: np.ndarray) -> np.ndarray:
        """(N, k) at all nodes: ``values`` (n, k) at one aggregate's nodes, zero elsewhere."""
        nodal = np.zeros((len(self.points), values.shape[1]))
        nodal[region.nodes] = values
        return nodal

    def of_region(self, region: Region, values: np.ndarray) -> np.ndarray:
        """(n, k) values at the nodes of one aggregate, from values at the nodes of all of them."""
        return values[np.searchsorted(self.body, region.nodes)]

    def by_triangle(self, values: Sequence[np.ndarray],
                    regions: Sequence[Region] | None = None) -> np.ndarray:
        """(T, ...) values in the triangles of aggregates in mesh order, from values (t, ...) in
        each of them; regions: of the aggregates, all by default."""
        triangles = np.concatenate([region.triangles for region in regions or self.regions])
        return np.concatenate(values)[np.argsort(triangles)]

    def moved(self, points: np.ndarray) -> Mesh:
        """The same triangles with their nodes at ``points`` (N, 2) um. Nodes on walls and ends must
        stay on them."""
        return replace(self, points=points)

    def turned_over(self, selected: np.ndarray | slice = slice(None)) -> np.ndarray:
        """(T,) True where the map of a triangle is not one to one at a node or a quadrature point.

        selected: the triangles to test, all by default.
        """
        corners = self.points[self.cells[selected]]
        J = elements.jacobian(corners, checked_map_derivatives(self.geometry))
        return elements.determinant(J).min(axis=1) <= 0

    def strained_arcs(self) -> tuple[np.ndarray, ...]:
        """For each aggregate of a curved mesh, (arcs,) True where a triangle beside an arc of its
        boundary is turned over."""
        bad = self.cells[self.turned_over(), 3:]
        return tuple(np.isin(loop[1::2], bad) for loop in self.topology.loops)

    def checked(self) -> Mesh:
        """The mesh itself. Raises MeshError if a triangle is turned over."""
        bad = np.flatnonzero(self.turned_over())
        if len(bad):
            x, y = self.points[self.cells[bad[0]]].mean(axis=0)
            raise MeshError(f"a triangle near x = {x:.4g}, y = {y:.4g} um is turned over")
        return self

    @property
    def poor(self) -> int:
        """Number of triangles with a quality below POOR."""
        return int(np.count_nonzero(self.quality < POOR))

    def acceptable(self, poor: int = 0) -> bool:
        """Does the mesh meet the paper's criterion (3.5), and is no triangle turned over?

        poor: number of poor triangles to allow, if it is larger than POOR_ALLOWED.
        """
        straight = self.areas.min() > 0 and self.poor <= max(poor, POOR_ALLOWED)
        return bool(straight) and not self.turned_over(self.topology.bent).any()


@cache
def checked_map_derivatives(geometry: int) -> np.ndarray:
    """Derivatives of the maps' shape functions at a triangle's nodes and quadrature points."""
    of = elements.table(geometry, elements.ELEMENTS[geometry].gradient_degree)
    at_nodes = elements.derivatives(geometry, elements.nodes(geometry))
    return np.concatenate([at_nodes, of.derivatives])


def triangle_areas(points: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """(T,) signed areas of triangles with corners points (N, 2)."""
    a, b, c = (points[triangles[:, i]] for i in range(3))
    u = b - a
    v = c - a
    return 0.5 * (u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0])


def sides(points: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """(T, 3, 2) sides of triangles with corners points (N, 2), each opposite its corner."""
    corner = points[triangles]
    return np.take(corner, [2, 0, 1], axis=1) - np.take(corner, [1, 2, 0], axis=1)


def gradients(points: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """(T, 3, 2) gradients of the barycentric coordinates."""
    side = sides(points, triangles)
    double = 2 * triangle_areas(points, triangles)[:, None]
    return np.stack([-side[:, :, 1] / double, side[:, :, 0] / double], axis=2)


def curved(straight: Mesh, middles: Sequence[np.ndarray] | None) -> Mesh:
    """The mesh with a node in the middle of every edge.

    middles: for each aggregate, (M, 2) um, middles of its boundary's edges in the order of the
    loop. If None, all middles are those of the straight edges.
    """
    mesh = elements.ELEMENTS[2].with_nodes(straight)
    points = mesh.points.copy()
    for loop, between in zip(mesh.topology.loops, middles or ()):
        points[loop[1::2]] = between
    return mesh.moved(points)
