"""Mesh generation (3.1): this module places the boundary nodes, and Mmg fills the inside.

Mmg (through mmgpy) starts from a constrained Delaunay triangulation (shapely) and keeps all
prescribed edges.
"""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from itertools import combinations
from typing import TypeAlias

import numpy as np
import shapely
from mmgpy import MmgMesh2D

from repro.errors import MeshError
from repro.fem import sizing as sizes_of
from repro.fem import welds
from repro.fem.linear import DEFAULT, Method
from repro.fem.mesh import Mesh, curved, triangle_areas
from repro.fem.outline import Outline
from repro.fem.sizing import Sizing
from repro.fem.walls import Wall, Walls
from repro.timing import timed

#: Ratio of the element sizes in the first of two meshing passes to the final ones.
FIRST_PASS = 2.0
#: Limit on the ratio of adjacent edges, enforced by Mmg.
HGRAD = 1.5
#: The nodes of a triangle count as collinear if its area is below this times its longest edge
#: squared.
SLIVER = 1e-12
#: Largest number of rounds in which arcs are halved, if they bend too much for the triangles beside
#: them.
HALVINGS = 12

#: Nodes of a polygon, and the number of the aggregate that it encloses; zero for the fluid.
Polygon: TypeAlias = tuple[np.ndarray, int]
#: Points, triangles, and region of each triangle: 1 fluid, 2 the first aggregate, 3 the next.
Regions: TypeAlias = tuple[np.ndarray, np.ndarray, np.ndarray]


@timed("meshing")
def generate_around(outlines: Sequence[Outline], ends: tuple[float, float], sizing: Sizing,
                    geometry: int = 1, method: Method = DEFAULT) -> tuple[Mesh, list[Outline]]:
    """Generate a mesh around aggregates; also returns the outlines with the mesh's nodes.

    ends: x of inlet and outlet (um); geometry: 1 for straight triangles, 2 for curved ones, as in
    the outlines; method: solver of the linear systems on the mesh. Raises MeshError if an outline
    crosses itself, another outline, a wall or an end of the channel, or if a curved triangle is
    turned over.
    """
    sizing = sizes_of.with_contact_gradation(outlines, sizing)
    outlines = welds.coarsened(outlines, sizing)
    for _ in range(HALVINGS):
        outlines = [sizes_of.split(outline, beside)
                    for outline, beside in sizes_of.each_beside(outlines, sizing)]
        outlines = welds.matched(outlines, sizing)
        corners = [outline.corners for outline in outlines]
        for polygon in corners:
            check_outline(polygon, ends, sizing.walls)
        check_apart(corners)
        mesh = around(corners, ends, sizing, method)
        if geometry == 1:
            return mesh, outlines
        if not outlines:
            return curved(mesh, None), outlines
        mesh = curved(unlocked(mesh), [outline.points[1::2] for outline in outlines])
        strained = mesh.strained_arcs()
        if not any(arcs.any() for arcs in strained):
            break
        outlines = [sizes_of.cut(outline, [(arc, 0.5) for arc in np.flatnonzero(arcs).tolist()])
                    for outline, arcs in zip(outlines, strained)]
    return mesh.checked(), outlines


@dataclass(frozen=True, eq=False)
class ElementSizes:
    """Element sizes of a mesh: sizes (K,) um are prescribed at the sources (K, 2) um."""

    sources: np.ndarray
    sizes: np.ndarray
    sizing: Sizing

    @staticmethod
    def around(outlines: Sequence[Outline], sizing: Sizing) -> ElementSizes:
        """Sizes for outlines. Without outlines all elements have the largest size."""
        sources = [np.empty((0, 2))]
        sizes = [np.empty(0)]
        for outline, beside in sizes_of.each_beside(outlines, sizing):
            near, size = sizes_of.size_sources(outline, beside)
            sources.append(near)
            sizes.append(size)
        return ElementSizes(np.concatenate(sources), np.concatenate(sizes), sizing)

    def at(self, where: np.ndarray) -> np.ndarray:
        """(N,) um, sizes at points (N, 2) um."""
        return sizes_of.graded_size(where, self.sources, self.sizes, self.sizing)

    def path(self, *corners: np.ndarray) -> np.ndarray:
        """(N, 2) um, nodes on straight lines from corner (2,) to corner, without the last corner.
        """
        lines = [sizes_of.graded_line(start, end, self.sources, self.sizes, self.sizing)
                 for start, end in zip(corners, corners[1:])]
        return np.vstack([line[:-1] for line in lines])


def around(outlines: Sequence[Outline], ends: tuple[float, float], sizing: Sizing,
           method: Method = DEFAULT) -> Mesh:
    """Generate a mesh of straight triangles around polygons, and keep the polygons' nodes.

    Arguments are those of :func:`generate_around`.
    """
    element_sizes = ElementSizes.around(outlines, sizing)
    points, polygons = _boundaries(outlines, ends, element_sizes)
    (points, triangles, region), places = _fill(points, polygons, element_sizes.at)
    # The outlines' points come first among the prescribed ones.
    loops = tuple(places[own] for own in welds.shared_points(outlines)[1])
    return Mesh.of(points, triangles, region - 1, loops, sizing.walls, ends, method)


def check_outline(outline: Outline, ends: tuple[float, float], walls: Walls) -> None:
    """Raise MeshError if an outline crosses itself, a wall or an end of the meshed part."""
    polygon = shapely.Polygon(outline.points)
    if not polygon.is_valid:
        raise MeshError("the outline of the aggregate crosses itself, and contact is modelled only "
                        f"with walls: {shapely.is_valid_reason(polygon)}")
    for wall in walls:
        gap = wall.gap(outline.points)
        if gap.min() < 0:
            x, y = outline.points[gap.argmin()]
            raise MeshError(f"the aggregate passes the wall y = {wall.y:g} um at x = {x:.4g}, "
                            f"y = {y:.4g} um")
    if not (ends[0] < outline.upstream and outline.downstream < ends[1]):
        raise MeshError(f"the aggregate, x from {outline.upstream:.4g} to "
                        f"{outline.downstream:.4g} um, leaves the meshed part, "
                        f"x from {ends[0]:.4g} to {ends[1]:.4g} um")


def check_apart(outlines: Sequence[Outline]) -> None:
    """Raise MeshError if two outlines touch elsewhere than in a weld."""
    united, _ = welds.united(outlines, welds.shared_points(outlines)[1])
    if not all(shapely.Polygon(outline.points).is_valid for outline in united):
        raise MeshError("two welded aggregates touch outside their weld")
    for outline, other in combinations(united, 2):
        if shapely.Polygon(outline.points).intersects(shapely.Polygon(other.points)):
            raise MeshError("two aggregates touch outside a weld")


def _boundaries(outlines: Sequence[Outline], ends: tuple[float, float],
                element_sizes: ElementSizes) -> tuple[np.ndarray, list[Polygon]]:
    """All prescribed points (K, 2) um, and the polygons between them."""
    walls = element_sizes.sizing.walls
    if not outlines:
        corners = _around(walls, ends)
        rim = element_sizes.path(*corners, corners[0])
        return rim, [(np.arange(len(rim)), 0)]
    points, own = welds.shared_points(outlines)
    store = _PointStore(points)
    fluid = _Fluid(*welds.united(outlines, own), walls, ends, element_sizes, store).polygons()
    bodies = [(nodes, number) for number, nodes in enumerate(own, 1)]
    return store.points, [*fluid, *bodies]


def _around(walls: Sequence[Wall], ends: tuple[float, float]) -> np.ndarray:
    """(4, 2) um, corners of the meshed part, counterclockwise from the start of the first wall."""
    first, second = walls
    start, end = ends[:: int(first.normal)]
    return np.array([(start, first.y), (end, first.y), (end, second.y), (start, second.y)])


class _Fluid:
    """The fluid around aggregates, as polygons.

    Aggregates that touch both walls separate the polygons.
    """

    def __init__(self, outlines: Sequence[Outline], own: Sequence[np.ndarray], walls: Walls,
                 ends: tuple[float, float],
                 element_sizes: ElementSizes, store: _PointStore):
        self._outlines = outlines
        self._own = own
        # Each polygon starts along the wall of the first aggregate's seed.
        self._walls = outlines[0].seat.walls(walls)
        self._corners = _around(self._walls, ends)
        self._sizes = element_sizes
        self._store = store
        self._along = [self._order(wall) for wall in self._walls]

    def _order(self, wall: Wall) -> list[int]:
        """Aggregates that touch a wall, counterclockwise around the fluid."""
        touching = [number for number, outline in enumerate(self._outlines)
                    if outline.touches(wall.number).any()]
        return sorted(touching, key=lambda number: wall.normal * self._point(number, wall, 0)[0])

    def polygons(self) -> list[Polygon]:
        """The polygons, in their order along the first wall."""
        first, opposite = self._along
        spanning: list[int | None] = [number for number in first if number in opposite]
        return [(self._between(before, after), 0)
                for before, after in zip([None, *spanning], [*spanning, None])]

    def _between(self, before: int | None, after: int | None) -> np.ndarray:
        """The polygon between two aggregates that touch both walls. None stands for an end of the
        mesh in place of an aggregate."""
        first, opposite = self._walls
        corners = self._corners
        along = self._on_wall(0, before, after, corners[0], corners[1])
        start = next(along)  # the first piece along the wall gets the first new numbers
        around = [self._side(after, first, opposite, corners[1], corners[2]),
                  *self._on_wall(1, after, before, corners[2], corners[3]),
                  self._side(before, opposite, first, corners[3], corners[0])]
        ring = [start, *along, *around]
        if before is not None:  # the ring begins at this aggregate
            ring = ring[-1:] + ring[:-1]
        return np.concatenate(ring)

    def _on_wall(self, place: int, before: int | None, after: int | None, start: np.ndarray,
                 end: np.ndarray) -> Iterator[np.ndarray]:
        """Consecutive nodes, in pieces, along a wall and around its aggregates, without the last
        node."""
        wall = self._walls[place]
        order = self._along[place]
        beside = order[0 if before is None else order.index(before) + 1:
                       len(order) if after is None else order.index(after)]
        skipped = 0
        if before is not None:
            start, skipped = self._point(before, wall, 1), 1
        for number in beside:
            yield self._store.add(self._sizes.path(start, self._point(number, wall, 0))[skipped:])
            yield self._surface(number, wall, wall)
            start, skipped = self._point(number, wall, 1), 1
        if after is not None:
            end = self._point(after, wall, 0)
        yield self._store.add(self._sizes.path(start, end)[skipped:])

    def _side(self, number: int | None, wall: Wall, other: Wall, start: np.ndarray,
              end: np.ndarray) -> np.ndarray:
        """Nodes from wall to wall: along the side of an aggregate, or along an end of the mesh
        without the last node."""
        if number is None:
            return self._store.add(self._sizes.path(start, end))
        return self._surface(number, wall, other)

    def _surface(self, number: int, wall: Wall, other: Wall) -> np.ndarray:
        """Nodes of an aggregate from its first node on a wall to its last node on ``other``, which
        may be the same wall."""
        outline = self._outlines[number]
        first, _ = _contact(outline, wall)
        _, last = _contact(outline, other)
        count = len(outline.points)
        clockwise = (first - np.arange((first - last) % count + 1)) % count
        return self._own[number][clockwise]

    def _point(self, number: int, wall: Wall, last: int) -> np.ndarray:
        """(2,) um, the first (last = 0) or last (last = 1) point of an aggregate on a wall, in the
        direction of the fluid's boundary."""
        outline = self._outlines[number]
        return outline.points[_contact(outline, wall)[last]]


def _contact(outline: Outline, wall: Wall) -> tuple[int, int]:
    """The outline's first and last node on a wall, in the direction of the fluid's boundary."""
    nodes = np.flatnonzero(outline.touches(wall.number))
    along = wall.normal * outline.points[nodes, 0]
    return int(nodes[np.argmin(along)]), int(nodes[np.argmax(along)])


class _PointStore:
    """A growing list of points; ``add`` returns the indices of the added points."""

    def __init__(self, points: np.ndarray):
        self.points = points

    def add(self, points: np.ndarray) -> np.ndarray:
        first = len(self.points)
        self.points = np.vstack([self.points, points])
        return np.arange(first, len(self.points))


def _fill(points: np.ndarray, polygons: list[Polygon],
          size_at: Callable[[np.ndarray], np.ndarray]) -> tuple[Regions, np.ndarray]:
    """Triangles inside the polygons, and the indices of the prescribed points among the new points.

    size_at(points): element sizes (um). The first pass uses sizes at the prescribed points, the
    second pass uses sizes at all points of the first one.
    """
    triangles = [_constrained_delaunay(points, nodes) for nodes, _ in polygons]
    region = np.repeat([1 + number for _, number in polygons], [len(t) for t in triangles])
    rim = np.vstack([np.column_stack([nodes, np.roll(nodes, -1)]) for nodes, _ in polygons])
    rim = np.unique(np.sort(rim, axis=1), axis=0)
    sizes = FIRST_PASS * size_at(points)
    try:
        coarse, indices = _mmg(points, np.vstack(triangles), region, rim, points, sizes)
        return _mmg(*coarse, indices[rim], points, size_at(coarse[0]))
    except MeshError:
        raise
    except RuntimeError as error:
        raise MeshError(f"no mesh can be generated: {error}") from error


def _mmg(points: np.ndarray, triangles: np.ndarray, region: np.ndarray, rim: np.ndarray,
         prescribed: np.ndarray, sizes: np.ndarray) -> tuple[Regions, np.ndarray]:
    """Run one pass of Mmg. It keeps the edges ``rim`` (K, 2).

    Also returns the indices of the prescribed points among the new points.
    """
    mmg = MmgMesh2D()
    mmg.set_mesh_size(vertices=len(points), triangles=len(triangles), quadrilaterals=0,
                      edges=len(rim))
    mmg.set_vertices(points)
    mmg.set_triangles(triangles.astype(np.int32), region.astype(np.int64))
    mmg.set_edges(rim.astype(np.int32))
    mmg.set_required_edges(np.arange(len(rim), dtype=np.int32))
    mmg.set_required_vertices(np.unique(rim).astype(np.int32))
    mmg["metric"] = sizes[:, None]
    with _restore_signals():
        mmg.remesh(verbose=-1, hgrad=HGRAD, nosurf=True)
    points = mmg.get_vertices()
    triangles, region = mmg.get_triangles_with_refs()
    indices = _find(points, prescribed)
    points[indices] = prescribed
    return (points, triangles.astype(np.int64), region), indices


@contextmanager
def _restore_signals() -> Iterator[None]:
    """Restore the handlers of SIGINT and SIGTERM, which Mmg resets."""
    handlers = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield
    finally:
        if threading.current_thread() is threading.main_thread():
            for number, handler in handlers.items():
                signal.signal(number, handler)


def _constrained_delaunay(points: np.ndarray, nodes: np.ndarray) -> np.ndarray:
    """(K, 3) counterclockwise triangles between the nodes of one polygon."""
    pieces = shapely.constrained_delaunay_triangles(shapely.Polygon(points[nodes]))
    corners = shapely.get_coordinates(pieces).reshape(-1, 4, 2)[:, :3]
    keys = _complex(points[nodes])
    ascending = np.argsort(keys)
    local = ascending[np.searchsorted(keys[ascending], _complex(corners.reshape(-1, 2)))]
    triangles = nodes[local].reshape(-1, 3)
    turned = triangle_areas(points, triangles) < 0
    triangles[turned] = triangles[turned][:, ::-1]
    return _without_slivers(points, triangles)


def _without_slivers(points: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """The triangulation (K, 3) without collinear triangles, which Mmg refuses.

    The longest edge of a collinear triangle is exchanged for the other diagonal.
    """
    corners = points[triangles]
    lengths = np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=2)
    flat = triangle_areas(points, triangles) < SLIVER * lengths.max(axis=1) ** 2
    for triangle in np.flatnonzero(flat):
        _exchange(points, triangles, int(triangle), int(lengths[triangle].argmax()))
    return triangles


def _complex(points: np.ndarray) -> np.ndarray:
    """(N,) complex numbers x + i y of points (N, 2), which can be sorted."""
    return np.ascontiguousarray(points).view(complex)[:, 0]


def _find(new_points: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Indices of the prescribed points in the new mesh. Raises MeshError if one has moved."""
    tree = shapely.STRtree(shapely.points(new_points))
    (_, nearest), distance = tree.query_nearest(shapely.points(points), return_distance=True,
                                              all_matches=False)
    if distance.max() > 1e-9 * np.ptp(points[:, 0]) or len(np.unique(nearest)) < len(points):
        raise MeshError(f"the mesher moved a boundary node by {distance.max():.3g} um")
    return nearest


def unlocked(straight: Mesh) -> Mesh:
    """Exchange diagonals so that no triangle has two edges on the boundary of its region.

    A region is the fluid or an aggregate. A triangle with two such edges locks: its linear pressure
    leaves the quadratic displacement too little freedom. If possible, its inner edge is exchanged
    for the other diagonal.
    """
    triangles = straight.triangles.copy()
    region = straight.topology.region
    cornered = np.flatnonzero(_region_edges(triangles, region).sum(axis=1) == 2)
    for corner in cornered.tolist():
        outer = _region_edges(triangles, region)[corner]
        if outer.sum() == 2:  # an exchange before may have changed it
            _exchange(straight.points, triangles, corner, int(np.flatnonzero(~outer)[0]))
    return replace(straight, topology=replace(straight.topology, cells=triangles))


def _region_edges(triangles: np.ndarray, region: np.ndarray) -> np.ndarray:
    """(T, 3) True where edge i -> i + 1 is on the boundary of the triangle's region."""
    edges = np.sort(triangles[:, [[0, 1], [1, 2], [2, 0]]], axis=2).reshape(-1, 2)
    keys = (edges[:, 0] * (edges.max() + 1) + edges[:, 1]) * (region.max() + 1)
    keys += np.repeat(region, 3)
    _, edge_numbers, counts = np.unique(keys, return_inverse=True, return_counts=True)
    return (counts[edge_numbers] == 1).reshape(-1, 3)


def _exchange(points: np.ndarray, triangles: np.ndarray, triangle: int, edge: int) -> None:
    """Exchange, in place, an edge of a triangle for the other diagonal.

    The triangle and its neighbour form a quadrilateral. The edge stays if a new triangle would be
    turned over.
    """
    c, a, b = np.roll(triangles[triangle], -edge)
    sharing = np.flatnonzero((triangles == a).any(axis=1) & (triangles == c).any(axis=1))
    beside = int(sharing[sharing != triangle][0])
    d = int(triangles[beside][(triangles[beside] != a) & (triangles[beside] != c)][0])
    pair = np.array([[a, b, d], [b, c, d]])
    if triangle_areas(points, pair).min() > 0:
        triangles[triangle], triangles[beside] = pair
