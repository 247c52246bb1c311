"""New meshes (3.1): boundary, interface and contact nodes are placed first, Mmg fills the inside.

Mmg (through mmgpy) starts from a constrained Delaunay triangulation (shapely) and keeps every edge
that it was given.
"""

from __future__ import annotations

import signal
import threading
from contextlib import contextmanager
from dataclasses import replace

import numpy as np
import shapely
from mmgpy import MmgMesh2D
from scipy.spatial import cKDTree

from repro.errors import MeshError
from repro.fem import sizing as sizes_of
from repro.fem.linear import DEFAULT, Method
from repro.fem.mesh import Mesh, curved, triangle_areas
from repro.fem.outline import BOTTOM, TOP, Outline
from repro.fem.sizing import Sizing
from repro.timing import timed

#: Sizes of the first of two meshing passes over the wanted ones, and Mmg's own limit on the ratio
#: of adjacent edges.
FIRST_PASS, HGRAD = 2.0, 1.5
#: Rounds in which arcs that bend too much for the triangles beside them are halved.
HALVINGS = 6


@timed("meshing")
def generate(outline: Outline | None, ends: tuple[float, float], sizing: Sizing, geometry: int = 1,
             method: Method = DEFAULT) -> tuple[Mesh, Outline | None]:
    """A new mesh around the aggregate, and the outline with the nodes that the mesh has on it.

    outline: None for a clean channel; ends: x of inlet and outlet (um); geometry: 1, straight
    triangles, 2, curved ones, as the outline's edges are; method: of the linear systems on the
    mesh. Raises MeshError where the outline crosses itself or the channel's ends, or where a curved
    triangle is turned over.
    """
    if outline is None:
        straight = around(None, ends, sizing, method)
        return (straight if geometry == 1 else curved(straight, None)), None
    for _ in range(HALVINGS):
        outline = sizes_of.split(outline, sizing)
        check_outline(outline.corners, ends, sizing.width)
        mesh = around(outline.corners, ends, sizing, method)
        if geometry == 1:
            return mesh, outline
        mesh = curved(unlocked(mesh), outline.points[1::2])
        strained = mesh.strained_arcs()
        if not strained.any():
            break
        outline = sizes_of.halved(outline, strained)
    return mesh.checked(), outline


def around(outline: Outline | None, ends: tuple[float, float], sizing: Sizing, method: Method = DEFAULT) -> Mesh:
    """A new straight mesh around a polygon whose nodes stay as they are; arguments: those of
    :func:`generate`."""
    width = sizing.width
    sources, sizes = np.empty((0, 2)), np.empty(0)
    if outline is not None:
        sources, sizes = sizes_of.size_sources(outline, sizing)
    wanted = sources, sizes, sizing
    points, polygons = _boundaries(outline, ends, width, wanted)
    triangles, region, found, points = _fill(points, polygons, lambda where: sizes_of.graded_size(where, *wanted))
    loop = found[: 0 if outline is None else len(outline.points)]  # its points come first among the prescribed ones
    return Mesh.of(points, triangles, region == 2, loop, width, ends, method)


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
        return sizes_of.graded_line(start, end, *wanted)

    left, right = ends
    corners = [(left, 0.0), (right, 0.0), (right, width), (left, width)]
    if outline is None:
        rim = np.vstack([line(a, b)[:-1] for a, b in zip(corners, corners[1:] + corners[:1])])
        return rim, [(np.arange(len(rim)), False)]
    bottom, top = (np.flatnonzero(outline.wall == w) for w in (BOTTOM, TOP))
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


def _fill(points, polygons, size_at):
    """Triangles (T, 3) inside the polygons, of the size (um) that ``size_at(points)`` asks for;
    their regions (T,); where the prescribed points went; and all points.

    The first pass knows the wanted size at the prescribed points alone, the second one at every
    point of the first.
    """
    triangles = [_constrained_delaunay(points, nodes) for nodes, _ in polygons]
    region = np.repeat([1 + biomass for _, biomass in polygons], [len(t) for t in triangles])
    rim = np.vstack([np.column_stack([nodes, np.roll(nodes, -1)]) for nodes, _ in polygons])
    rim = np.unique(np.sort(rim, axis=1), axis=0)
    coarse, found = _mmg(points, np.vstack(triangles), region, rim, points, FIRST_PASS * size_at(points))
    fine, found = _mmg(coarse[0], coarse[1], coarse[2], found[rim], points, size_at(coarse[0]))
    return fine[1], fine[2], found, fine[0]


def _mmg(points, triangles, region, rim, prescribed, sizes):
    """One pass of Mmg, which keeps the rim: points, triangles and region, and where the prescribed
    points went."""
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
    """Indices of the prescribed points in the new mesh. Raises MeshError where one has moved."""
    distance, found = cKDTree(new_points).query(points)
    if distance.max() > 1e-9 * np.ptp(points[:, 0]) or len(np.unique(found)) < len(points):
        raise MeshError(f"the mesher moved a boundary node by {distance.max():.3g} um")
    return found


def unlocked(straight: Mesh) -> Mesh:
    """The same nodes without triangles that have two edges on the boundary of their region.

    A region is the fluid or the biomass. Linear pressures in such a corner leave quadratic
    displacements too little freedom; the corner's
    inner edge is exchanged for the other diagonal where that is possible.
    """
    triangles = straight.triangles.copy()
    for corner in _cornered(triangles, straight.biomass):
        _flip(straight.points, triangles, straight.biomass, corner)
    return replace(straight, topology=replace(straight.topology, cells=triangles))


def _region_edges(triangles: np.ndarray, biomass: np.ndarray) -> np.ndarray:
    """(T, 3) is edge i -> i + 1 on the boundary of the triangle's own region?"""
    edges = np.sort(triangles[:, [[0, 1], [1, 2], [2, 0]]], axis=2).reshape(-1, 2)
    keys = np.column_stack([edges, np.repeat(biomass, 3)])
    _, which, counts = np.unique(keys, axis=0, return_inverse=True, return_counts=True)
    return (counts[which.ravel()] == 1).reshape(-1, 3)


def _cornered(triangles: np.ndarray, biomass: np.ndarray) -> np.ndarray:
    return np.flatnonzero(_region_edges(triangles, biomass).sum(axis=1) == 2)


def _flip(points: np.ndarray, triangles: np.ndarray, biomass: np.ndarray, corner: int) -> None:
    """Exchange, in place, the inner edge of a cornered triangle for the other diagonal of the
    quadrilateral that it forms with its neighbour."""
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
