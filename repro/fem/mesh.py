"""Triangulation of the meshed part of the pore (3.1): one mesh of triangles for fluid and biomass.

Boundary, interface and contact nodes are placed by :mod:`repro.fem.geometry`; Mmg (through mmgpy) fills the inside from a
constrained Delaunay triangulation (shapely) and keeps every edge that it was given.
"""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable, Hashable
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
import shapely
from mmgpy import MmgMesh2D
from scipy.spatial import cKDTree
from skfem import MeshTri

from repro.errors import MeshError
from repro.fem import geometry
from repro.fem.geometry import Outline, Sizing
from repro.timing import timed

#: Remesh when more than POOR_ALLOWED triangles have a quality under POOR (3.5).
POOR, POOR_ALLOWED = 0.6, 6
#: Sizes of the first of two meshing passes over the wanted ones, and Mmg's own limit on the ratio of adjacent edges.
FIRST_PASS, HGRAD = 2.0, 1.5


@dataclass(frozen=True, eq=False)
class PoreMesh:
    """Triangles of fluid and biomass over ``ends`` x [0, width].

    points: (N, 2) um; triangles: (T, 3) nodes, counterclockwise; biomass: (T,) True in the aggregate;
    loop: (M,) nodes of the aggregate's boundary, counterclockwise, empty in a clean channel; topology: what has been
    worked out from the connections alone, kept while the mesh moves; placed: what holds for its nodes where they are.
    """

    points: np.ndarray
    triangles: np.ndarray
    biomass: np.ndarray
    loop: np.ndarray
    width: float
    ends: tuple[float, float]
    topology: dict = field(default_factory=dict, repr=False)
    placed: dict = field(default_factory=dict, repr=False, init=False)

    @cached_property
    def edges(self) -> np.ndarray:
        """(T, 3, 2) um: edge i of a triangle is opposite its node i."""
        corner = self.points[self.triangles]
        return np.take(corner, [2, 0, 1], axis=1) - np.take(corner, [1, 2, 0], axis=1)

    @cached_property
    def areas(self) -> np.ndarray:
        """(T,) signed areas, um2."""
        return triangle_areas(self.points, self.triangles)

    @cached_property
    def quality(self) -> np.ndarray:
        """(T,) 4 sqrt(3) |tau| / sum h_i^2: one for an equilateral triangle (3.5)."""
        return 4 * np.sqrt(3) * self.areas / np.sum(self.edges**2, axis=(1, 2))

    @cached_property
    def circumdiameter(self) -> np.ndarray:
        """(T,) h_tau, the diameter of the circumscribed circle (3.4), um."""
        return np.prod(np.linalg.norm(self.edges, axis=2), axis=1) / (2 * np.abs(self.areas))

    @cached_property
    def gradients(self) -> np.ndarray:
        """(T, 3, 2) gradients of the three nodal functions on each triangle, 1/um."""
        return gradients(self.points, self.triangles)

    @cached_property
    def fem(self) -> MeshTri:
        """The same mesh for scikit-fem, the nodes of each triangle in the same order."""
        return MeshTri(self.points.T.copy(), self.triangles.T.copy(), sort_t=False)

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
        """Nodes of the aggregate, its boundary included, ascending."""
        return self.once("body", lambda: np.unique(self.triangles[self.biomass]))

    @property
    def body_loop(self) -> np.ndarray:
        """(M,) ``loop`` in the numbering of ``body``."""
        return np.searchsorted(self.body, self.loop)

    @property
    def body_triangles(self) -> np.ndarray:
        """(t, 3) biomass triangles in the numbering of ``body``."""
        return self.once("body triangles", lambda: np.searchsorted(self.body, self.triangles[self.biomass]))

    @property
    def fluid(self) -> np.ndarray:
        """Nodes of the fluid, the interface included, ascending."""
        return self.once("fluid", lambda: np.unique(self.triangles[~self.biomass]))

    @property
    def inlet(self) -> np.ndarray:
        """Nodes of the inlet from the lower wall up."""
        return self.once("inlet", lambda: self._line(0, self.ends[0]))

    @property
    def outlet(self) -> np.ndarray:
        """Nodes of the outlet from the lower wall up."""
        return self.once("outlet", lambda: self._line(0, self.ends[1]))

    @property
    def walls(self) -> np.ndarray:
        """Nodes of both walls."""
        return self.once("walls", lambda: np.flatnonzero((self.points[:, 1] == 0) | (self.points[:, 1] == self.width)))

    def _line(self, axis: int, level: float) -> np.ndarray:
        nodes = np.flatnonzero(self.points[:, axis] == level)
        return nodes[np.argsort(self.points[nodes, 1 - axis])]

    def lumped(self, where: np.ndarray | None = None) -> np.ndarray:
        """(N,) sum of |tau| / 3 over the triangles ``where`` around each node, um2."""
        chosen = slice(None) if where is None else where
        weight = np.repeat(self.areas[chosen] / 3, 3)
        return np.bincount(self.triangles[chosen].ravel(), weight, len(self.points))

    def moved(self, points: np.ndarray) -> PoreMesh:
        """The same triangles with their nodes at ``points`` (N, 2), nodes of walls and ends still on their lines."""
        return replace(self, points=points)

    def acceptable(self) -> bool:
        """Does the mesh pass the paper's criterion (3.5), with no triangle turned over?"""
        return bool(self.areas.min() > 0 and np.count_nonzero(self.quality < POOR) <= POOR_ALLOWED)


def triangle_areas(points: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """(T,) signed areas of triangles with corners points (N, 2)."""
    a, b, c = (points[triangles[:, i]] for i in range(3))
    return 0.5 * ((b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) - (b[:, 1] - a[:, 1]) * (c[:, 0] - a[:, 0]))


def gradients(points: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """(T, 3, 2) gradients of the linear nodal functions."""
    corner = points[triangles]
    edge = np.take(corner, [2, 0, 1], axis=1) - np.take(corner, [1, 2, 0], axis=1)
    double = 2 * triangle_areas(points, triangles)[:, None]
    return np.stack([-edge[:, :, 1] / double, edge[:, :, 0] / double], axis=2)


@timed("meshing")
def generate(outline: Outline | None, ends: tuple[float, float], sizing: Sizing):
    """A new mesh around the aggregate, and the outline with the nodes that the mesh has on it.

    outline: None for a clean channel; ends: x of inlet and outlet (um).
    Returns (PoreMesh, Outline | None). Raises MeshError where the outline crosses itself or the channel's ends.
    """
    if outline is not None:
        check_outline(outline, ends, sizing.width)
        outline = geometry.refine_outline(outline, geometry.interface_sizes(outline, sizing), sizing)
    return around(outline, ends, sizing), outline


def around(outline: Outline | None, ends, sizing: Sizing) -> PoreMesh:
    """A new mesh around an outline whose nodes stay as they are; arguments as those of :func:`generate`."""
    width = sizing.width
    sources, sizes = np.empty((0, 2)), np.empty(0)
    if outline is not None:
        sources, sizes = geometry.size_sources(outline, sizing)
    wanted = sources, sizes, sizing
    points, polygons = _boundaries(outline, ends, width, wanted)
    mesh = _fill(points, polygons, lambda where: geometry.graded_size(where, *wanted), ends, width)
    loop = mesh.loop[: 0 if outline is None else len(outline.points)]  # its points come first among the prescribed ones
    return replace(mesh, loop=loop)


def check_outline(outline: Outline, ends: tuple[float, float], width: float) -> None:
    """Raises MeshError where an outline crosses itself or leaves the meshed part."""
    polygon = shapely.Polygon(outline.points)
    if not polygon.is_valid:
        raise MeshError(f"the outline of the aggregate crosses itself: {shapely.is_valid_reason(polygon)}; "
                        "try a shorter growth.time_step")
    inside = ends[0] < outline.upstream and outline.downstream < ends[1]
    if not inside or outline.points[:, 1].min() < 0 or outline.points[:, 1].max() > width:
        raise MeshError(f"the aggregate, x from {outline.upstream:.4g} to {outline.downstream:.4g} um, "
                        f"leaves the meshed part, x from {ends[0]:.4g} to {ends[1]:.4g} um")


def _boundaries(outline, ends, width, wanted):
    """All prescribed points (K, 2) and the polygons [(indices, is biomass)] that they bound."""
    def line(start, end):
        return geometry.graded_line(start, end, *wanted)

    left, right = ends
    corners = [(left, 0.0), (right, 0.0), (right, width), (left, width)]
    if outline is None:
        rim = np.vstack([line(a, b)[:-1] for a, b in zip(corners, corners[1:] + corners[:1])])
        return rim, [(np.arange(len(rim)), False)]
    bottom, top = (np.flatnonzero(outline.wall == w) for w in (geometry.BOTTOM, geometry.TOP))
    x = outline.points[:, 0]
    west, east = bottom[np.argmin(x[bottom])], bottom[np.argmax(x[bottom])]
    store = _PointStore(outline.points)
    if len(top) == 0:
        start = store.add(line(corners[0], outline.points[west])[:-1])
        around = store.add(np.vstack([line(a, b)[:-1] for a, b in zip(corners[1:], corners[2:] + corners[:1])]))
        end = store.add(line(outline.points[east], corners[1])[1:-1])
        fluid = np.concatenate([start, _backwards(west, east, len(x)), end, around])
        polygons = [(fluid, False)]
    else:
        north_west, north_east = top[np.argmin(x[top])], top[np.argmax(x[top])]
        polygons = []
        first = store.add(line(corners[0], outline.points[west])[:-1])
        close = store.add(np.vstack([line(outline.points[north_west], corners[3])[1:-1],
                                     line(corners[3], corners[0])[:-1]]))
        polygons.append((np.concatenate([first, _backwards(west, north_west, len(x)), close]), False))
        out = store.add(np.vstack([line(outline.points[east], corners[1])[1:-1], line(corners[1], corners[2])[:-1],
                                   line(corners[2], outline.points[north_east])[:-1]]))
        polygons.append((np.concatenate([_backwards(north_east, east, len(x)), out]), False))
    return store.points, polygons + [(np.arange(len(x)), True)]


class _PointStore:
    """A growing list of points; ``add`` returns the indices of what it adds."""

    def __init__(self, points: np.ndarray):
        self.points = points

    def add(self, points: np.ndarray) -> np.ndarray:
        first = len(self.points)
        self.points = np.vstack([self.points, points])
        return np.arange(first, len(self.points))


def _backwards(first: int, last: int, count: int) -> np.ndarray:
    """Loop indices from first to last, both included, walking clockwise."""
    return (first - np.arange((first - last) % count + 1)) % count


def _fill(points, polygons, size_at, ends, width) -> PoreMesh:
    """Triangles inside the polygons, of the size that ``size_at(points)`` wants (um).

    The first pass knows the wanted size at the prescribed points alone, the second one at every point of the first.
    """
    triangles = [_constrained_delaunay(points, nodes) for nodes, _ in polygons]
    region = np.repeat([1 + biomass for _, biomass in polygons], [len(t) for t in triangles])
    rim = np.vstack([np.column_stack([nodes, np.roll(nodes, -1)]) for nodes, _ in polygons])
    rim = np.unique(np.sort(rim, axis=1), axis=0)
    coarse, found = _mmg(points, np.vstack(triangles), region, rim, points, FIRST_PASS * size_at(points))
    fine, found = _mmg(coarse[0], coarse[1], coarse[2], found[rim], points, size_at(coarse[0]))
    return PoreMesh(fine[0], fine[1], fine[2] == 2, found, width, ends)


def _mmg(points, triangles, region, rim, prescribed, sizes):
    """One pass of Mmg that keeps the rim: (points, triangles, region), and where the prescribed points went."""
    mmg = MmgMesh2D()
    mmg.set_mesh_size(vertices=len(points), triangles=len(triangles), quadrilaterals=0, edges=len(rim))
    mmg.set_vertices(points)
    mmg.set_triangles(triangles.astype(np.int32), region.astype(np.int64))
    mmg.set_edges(rim.astype(np.int32))
    mmg.set_required_edges(np.arange(len(rim), dtype=np.int32))
    mmg.set_required_vertices(np.unique(rim).astype(np.int32))
    mmg["metric"] = sizes[:, None]
    with _signals_kept():
        mmg.remesh(verbose=-1, hgrad=HGRAD, nosurf=True)
    points, (triangles, region) = mmg.get_vertices(), mmg.get_triangles_with_refs()
    found = _find(points, prescribed)
    points[found] = prescribed
    return (points, triangles.astype(np.int64), region), found


@contextmanager
def _signals_kept():
    """Mmg resets what the process does on Ctrl-C and on termination; put it back."""
    kept = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield
    finally:
        if threading.current_thread() is threading.main_thread():
            for number, handler in kept.items():
                signal.signal(number, handler)


def _constrained_delaunay(points: np.ndarray, nodes: np.ndarray) -> np.ndarray:
    """(K, 3) counterclockwise triangles between the given nodes of one polygon."""
    pieces = shapely.constrained_delaunay_triangles(shapely.Polygon(points[nodes]))
    corners = shapely.get_coordinates(pieces).reshape(-1, 4, 2)[:, :3]
    distance, local = cKDTree(points[nodes]).query(corners.reshape(-1, 2))
    triangles = nodes[local].reshape(-1, 3)
    turned = triangle_areas(points, triangles) < 0
    triangles[turned] = triangles[turned][:, ::-1]
    return triangles


def _find(new_points: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Indices in the new mesh of the prescribed points. Raises MeshError where one of them has moved."""
    distance, found = cKDTree(new_points).query(points)
    if distance.max() > 1e-9 * np.ptp(points[:, 0]) or len(np.unique(found)) < len(points):
        raise MeshError(f"the mesher moved a boundary node by {distance.max():.3g} um")
    return found
