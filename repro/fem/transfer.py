"""Transfer of fields from one mesh to another (3.5, [E8]).

Interpolation evaluates a field of any order at points in the old triangles, straight or curved. The
paper uses it; the total drifts. The conserving transfer of linear fields is the Galerkin projection

    (X_new, N_i) = (X_old, N_i)  for every new N_i,

integrated exactly over the common pieces of both meshes. If both meshes cover the same polygon, the
projection keeps the total, constants and linear fields to round-off. It may overshoot where a field
is steep.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely

from repro.errors import OriginFolded, TransferError, failing_as
from repro.fem import elements, linear
from repro.fem.assembly import ElementSystem
from repro.fem.elements import barycentric
from repro.fem.forms import mass
from repro.fem.mesh import Mesh, Region, checked_map_derivatives, triangle_areas
from repro.timing import timed

#: The common pieces of two meshes must cover both to this relative accuracy.
COVER = 1e-9
#: The map of a triangle to t = 0 counts as folded if its least determinant is below this part of
#: its largest one.
FOLD = 0.02


@dataclass(frozen=True, eq=False)
class Located:
    """Points located in old triangles.

    triangle: (K,) number of the triangle; local: (K, 2) coordinates on its unit triangle.
    """

    triangle: np.ndarray
    local: np.ndarray

    def field(self, values: np.ndarray, cells: np.ndarray) -> np.ndarray:
        """(K, ...) field at these points, from values (N, ...) at the nodes of ``cells`` (T, k)."""
        weights = elements.values(elements.order_of(cells), self.local)
        return np.einsum("ka,ka...->k...", weights, values[cells[self.triangle]])


@timed("transfer")
@failing_as(TransferError)
def located(points: np.ndarray, cells: np.ndarray, where: np.ndarray) -> Located:
    """Locate points (K, 2) um in triangles (T, 3 or 6).

    Among the triangles whose box contains the point, the one in which it lies deepest is chosen. A
    point slightly outside all triangles moves to the edge of the nearest one. Raises TransferError
    if a point is far from all triangles.
    """
    nodes = points[cells]
    size = np.ptp(nodes, axis=1).max(axis=1)
    low = nodes.min(axis=1) - 0.1 * size[:, None]
    high = nodes.max(axis=1) + 0.1 * size[:, None]
    place, cell = shapely.STRtree(shapely.box(*low.T, *high.T)).query(shapely.points(where))
    local = elements.element_of(cells).local(nodes[cell], where[place])
    depth = elements.values(1, local).min(axis=1)
    best = np.lexsort((-depth, place))
    first = best[np.unique(place[best], return_index=True)[1]]
    if len(first) < len(where):
        x, y = where[np.setdiff1d(np.arange(len(where)), place)[0]]
        raise TransferError(f"x = {x:.4g}, y = {y:.4g} um of the new mesh is not in the old one")
    return Located(cell[first], _inside(local[first]))


def _inside(local: np.ndarray) -> np.ndarray:
    """Points (K, 2) on the unit triangle; points outside move to its edge."""
    L = np.clip(elements.values(1, local), 0.0, None)
    s, t = (L / L.sum(axis=1, keepdims=True))[:, 1:].T
    return np.column_stack([s, np.minimum(t, 1 - s)])  # 1 - s - t is not negative to the last bit


def interpolate(points: np.ndarray, cells: np.ndarray, fields: np.ndarray,
                where: np.ndarray) -> np.ndarray:
    """(K, m) values at points (K, 2) of fields (N, m) at the mesh's nodes.

    This is the paper's transfer; on straight triangles it is bounded.
    """
    return located(points, cells, where).field(fields, cells)


def interpolated(points: np.ndarray, triangles: np.ndarray, fields: np.ndarray,
                 new_points: np.ndarray, new_triangles: np.ndarray) -> np.ndarray:
    """(K, m) values of linear fields (N, m) at the nodes of another mesh.

    Arguments are those of :func:`project`.
    """
    return interpolate(points, triangles, fields, new_points)


def unfolded(mesh: Mesh, origin: np.ndarray, region: Region) -> np.ndarray:
    """Coordinates (N, 2) um of the nodes at t = 0, corrected so that no triangle of an aggregate is
    turned over.

    If a triangle is turned over, its middles move half way between its corners. Neighbours share
    these middles, so they are tested again. Raises OriginFolded if a triangle with straight edges
    is turned over.
    """
    cells = region.cells
    derivatives = checked_map_derivatives(mesh.geometry)
    while True:
        det = elements.determinant(elements.jacobian(origin[cells], derivatives))
        bad = cells[det.min(axis=1) <= FOLD * det.max(axis=1)]
        if len(bad) == 0:
            return origin
        straight = origin.copy()
        straight[bad[:, 3:]] = elements.element_of(cells).middles(origin[bad[:, :3]])
        if (straight == origin).all():
            x, y = mesh.points[bad[0]].mean(axis=0)
            raise OriginFolded(f"after a remesh the places at t = 0 fold near x = {x:.4g}, "
                               f"y = {y:.4g} um")
        origin = straight


def supermesh(points: np.ndarray, triangles: np.ndarray, new_points: np.ndarray,
              new_triangles: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Common pieces of two meshes: corners (p, 3, 2), and numbers (p,) of the old and the new
    triangle that contain each piece."""
    boxes = shapely.STRtree(shapely.polygons(points[triangles]))
    new, old = boxes.query(shapely.polygons(new_points[new_triangles]))
    pieces = clip(points[triangles[old]], new_points[new_triangles[new]])
    last = pieces.shape[1] - 1
    first = np.repeat(pieces[:, :1], last - 1, axis=1)
    fans = np.stack([first, pieces[:, 1:last], pieces[:, 2: last + 1]], axis=2)
    edge = fans[:, :, 1:] - fans[:, :, :1]
    pair, fan = np.nonzero(edge[..., 0, 0] * edge[..., 1, 1] != edge[..., 0, 1] * edge[..., 1, 0])
    return fans[pair, fan], old[pair], new[pair]


def clip(polygons: np.ndarray, windows: np.ndarray) -> np.ndarray:
    """Intersect convex polygons (p, k, 2) with counterclockwise triangles (p, 3, 2), pair by pair.

    Returns (p, m, 2): polygons with fewer than m corners repeat a corner, and empty polygons repeat
    a point. m is from 3 to k + 3; it is larger if round-off makes corners on a line of the window
    change sides more than twice. Sutherland and Hodgman's algorithm: each side of the window in
    turn cuts off what lies on its right.
    """
    for side in range(3):
        start = windows[:, side, None]
        along = windows[:, (side + 1) % 3, None] - start
        way = polygons - start
        depth = along[..., 0] * way[..., 1] - along[..., 1] * way[..., 0]
        after = np.roll(polygons, -1, axis=1)
        depth_after = np.roll(depth, -1, axis=1)
        crosses = (depth < 0) != (depth_after < 0)
        part = np.where(crosses, depth, 0.0) / np.where(crosses, depth - depth_after, 1.0)
        crossing = polygons + part[..., None] * (after - polygons)
        both = np.stack([polygons, crossing], axis=2).reshape(len(polygons), -1, 2)
        mask = np.stack([depth >= 0, crosses], axis=2).reshape(len(polygons), -1)
        polygons = _packed(both, mask)
    return polygons


def _packed(points: np.ndarray, mask: np.ndarray) -> np.ndarray:
    """(p, width, 2) points (p, k, 2) selected by ``mask`` (p, k), padded with the first of them."""
    count = mask.sum(axis=1)[:, None]
    width = max(3, int(count.max(initial=0)))
    front = np.argsort(~mask, axis=1, kind="stable")[:, :width]
    chosen = np.where(np.arange(width) < count, front, front[:, :1])
    return np.take_along_axis(points, chosen[..., None], axis=1)


def project(points: np.ndarray, triangles: np.ndarray, fields: np.ndarray,
            new_points: np.ndarray, new_triangles: np.ndarray) -> np.ndarray:
    """(K, m) Galerkin projection of nodal fields (N, m) onto another mesh of the same polygon.

    Raises TransferError where the two meshes do not cover the same area.
    """
    pieces = _pieces(points, triangles, new_points, new_triangles)
    right = _loads(pieces, points, triangles, fields, new_points, new_triangles)
    return _solve_mass(new_points, new_triangles, right)


@dataclass(frozen=True, eq=False)
class Pieces:
    """Common pieces of two meshes.

    corners: (p, 3, 2) um; old, new: (p,) numbers of the triangles that contain each piece; area:
    (p,) um2.
    """

    corners: np.ndarray
    old: np.ndarray
    new: np.ndarray
    area: np.ndarray


def _pieces(points: np.ndarray, triangles: np.ndarray, new_points: np.ndarray,
            new_triangles: np.ndarray) -> Pieces:
    """Common pieces of two meshes. Raises TransferError if they do not cover the same area."""
    corners, old, new = supermesh(points, triangles, new_points, new_triangles)
    edge = corners[:, 1:] - corners[:, :1]
    area = 0.5 * np.abs(edge[:, 0, 0] * edge[:, 1, 1] - edge[:, 0, 1] * edge[:, 1, 0])
    before = triangle_areas(points, triangles).sum()
    after = triangle_areas(new_points, new_triangles).sum()
    if max(abs(area.sum() / before - 1), abs(area.sum() / after - 1)) > COVER:
        raise TransferError(f"the old mesh covers {before:.12g} um2, the new one {after:.12g} um2, "
                         f"their common pieces {area.sum():.12g} um2")
    return Pieces(corners, old, new, area)


def _loads(pieces: Pieces, points: np.ndarray, triangles: np.ndarray, fields: np.ndarray,
           new_points: np.ndarray, new_triangles: np.ndarray) -> np.ndarray:
    """(K, m) integrals of the old fields (N, m) times each new nodal function."""
    old = triangles[pieces.old]
    new = new_triangles[pieces.new]
    middles = 0.5 * (pieces.corners + np.roll(pieces.corners, -1, axis=1))
    old_weight = barycentric(np.repeat(points[old][:, None], 3, 1), middles)
    new_weight = barycentric(np.repeat(new_points[new][:, None], 3, 1), middles)
    values = np.einsum("pqa,pam->pqm", old_weight, fields[old])
    load = np.einsum("p,pqa,pqm->pam", pieces.area / 3, new_weight, values)
    right = np.zeros((len(new_points), fields.shape[1]))
    np.add.at(right, new, load)
    return right


def _solve_mass(points: np.ndarray, triangles: np.ndarray, right: np.ndarray) -> np.ndarray:
    """(K, m) solutions with the mass matrix of linear functions, for right sides (K, m).

    Every node must belong to a triangle.
    """
    rank = np.argsort(linear.node_order(len(points), triangles))
    system = ElementSystem(triangles, rank, np.zeros(len(points), bool))
    solver = linear.Solver(system.matrix(mass(triangle_areas(points, triangles))))
    solution = np.empty_like(right)
    for column, load in enumerate(right.T):
        solution[system.order, column] = solver.solve(load[system.order])
    return solution
