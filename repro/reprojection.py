"""Reprojection of the biomass after growth, (30)-(34), and transfer of fields to a new mesh (3.5, [E8]).

The mass of a nodal field X on the aggregate is sum_i S_i X_i, with S_i = sum of |tau| / 3 over the biomass triangles at
node i: the integral of the linear field. (34) keeps each node's mass when the triangles change their areas. To a new
mesh the paper interpolates linearly, which drifts; the conserving transfer is the Galerkin projection

    (X_new, N_i) = (X_old, N_i)  for every new N_i, integrated exactly over the common pieces of both meshes,

which keeps the total, constants and linear fields to round-off as long as both meshes cover the same polygon.
"""

from __future__ import annotations

import numpy as np
import shapely

from repro import linear
from repro.assembly import ElementSystem, mass
from repro.errors import TransferError
from repro.mesh import triangle_areas
from repro.timing import timed

#: The common pieces of two meshes must cover both to this relative accuracy.
COVER = 1e-9


def reproject(field: np.ndarray, before: np.ndarray, after: np.ndarray) -> np.ndarray:
    """(34): X'_i = X_i S_i / S'_i, with lumped areas S before and after (um2), zero where there is no biomass."""
    there = after > 0
    return np.where(there, field * before / np.where(there, after, 1.0), 0.0)


def locate(points: np.ndarray, triangles: np.ndarray, where: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Triangle (K,) that holds, or is nearest to, each of the points ``where`` (K, 2), and its three weights (K, 3)."""
    tree = shapely.STRtree(shapely.polygons(points[triangles]))
    found = tree.nearest(shapely.points(where))
    return found, barycentric(points, triangles[found], where)


def barycentric(points: np.ndarray, corners: np.ndarray, where: np.ndarray) -> np.ndarray:
    """(..., 3) values of the nodal functions of triangles ``corners`` (..., 3) at ``where`` (..., 2)."""
    a, b, c = (points[corners[..., i]] for i in range(3))

    def cross(u, v):
        return u[..., 0] * v[..., 1] - u[..., 1] * v[..., 0]

    double = cross(b - a, c - a)
    a, b, c = (corner - where for corner in (a, b, c))
    return np.stack([cross(b, c), cross(c, a), cross(a, b)], -1) / double[..., None]


@timed("transfer")
def interpolate(points: np.ndarray, triangles: np.ndarray, fields: np.ndarray, where: np.ndarray) -> np.ndarray:
    """Linear interpolation of nodal fields (N, m) at points (K, 2), the paper's transfer; bounded by the nodal values
    (a point outside takes the value of the nearest point of the mesh)."""
    found, weight = locate(points, triangles, where)
    weight = np.clip(weight, 0.0, 1.0)
    weight /= weight.sum(axis=1, keepdims=True)
    return np.einsum("ka,kam->km", weight, fields[triangles[found]])


def supermesh(points, triangles, new_points, new_triangles) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Common pieces of two meshes: (p, 3, 2) corners of triangles, and the old and new triangle (p,) each lies in."""
    boxes = shapely.STRtree(shapely.polygons(points[triangles]))
    new, old = boxes.query(shapely.polygons(new_points[new_triangles]))
    pieces = clip(points[triangles[old]], new_points[new_triangles[new]])
    fans = np.stack([np.repeat(pieces[:, :1], pieces.shape[1] - 2, axis=1), pieces[:, 1:-1], pieces[:, 2:]], axis=2)
    edge = fans[:, :, 1:] - fans[:, :, :1]
    pair, fan = np.nonzero(edge[..., 0, 0] * edge[..., 1, 1] != edge[..., 0, 1] * edge[..., 1, 0])
    return fans[pair, fan], old[pair], new[pair]


def clip(polygons: np.ndarray, windows: np.ndarray) -> np.ndarray:
    """Convex polygons (p, k, 2) cut to counterclockwise triangles (p, 3, 2), pair by pair: (p, k + 3, 2).

    Sutherland and Hodgman's algorithm: each side of the window in turn keeps what is to its left. Polygons with fewer
    corners repeat one of them, empty ones are a single point.
    """
    for side in range(3):
        start, along = windows[:, side, None], windows[:, (side + 1) % 3, None] - windows[:, side, None]
        depth = along[..., 0] * (polygons[..., 1] - start[..., 1]) - along[..., 1] * (polygons[..., 0] - start[..., 0])
        after, depth_after = np.roll(polygons, -1, axis=1), np.roll(depth, -1, axis=1)
        crosses = (depth < 0) != (depth_after < 0)
        part = np.where(crosses, depth, 0.0) / np.where(crosses, depth - depth_after, 1.0)
        crossing = polygons + part[..., None] * (after - polygons)
        both = np.stack([polygons, crossing], axis=2).reshape(len(polygons), -1, 2)
        kept = np.stack([depth >= 0, crosses], axis=2).reshape(len(polygons), -1)
        polygons = _packed(both, kept, polygons.shape[1] + 1)
    return polygons


def _packed(points: np.ndarray, kept: np.ndarray, room: int) -> np.ndarray:
    """The kept points (p, k, 2) moved to the front, in order, and the first of them repeated behind: (p, room, 2)."""
    front = np.argsort(~kept, axis=1, kind="stable")[:, :room]
    count = kept.sum(axis=1)[:, None]
    chosen = np.where(np.arange(room) < count, front, front[:, :1])
    return np.take_along_axis(points, chosen[..., None], axis=1)


def project(points, triangles, fields, new_points, new_triangles) -> np.ndarray:
    """Galerkin projection of nodal fields (N, m) onto the nodes of another mesh of the same polygon: (K, m).

    Raises TransferError where the two meshes do not cover the same area.
    """
    corners, old, new = supermesh(points, triangles, new_points, new_triangles)
    edge = corners[:, 1:] - corners[:, :1]
    area = 0.5 * np.abs(edge[:, 0, 0] * edge[:, 1, 1] - edge[:, 0, 1] * edge[:, 1, 0])
    areas = [triangle_areas(p, t).sum() for p, t in ((points, triangles), (new_points, new_triangles))]
    if max(abs(area.sum() / a - 1) for a in areas) > COVER:
        raise TransferError(f"the old mesh covers {areas[0]:.12g} um2, the new one {areas[1]:.12g} um2, "
                            f"their common pieces {area.sum():.12g} um2; try a shorter growth.time_step")
    middles = 0.5 * (corners + np.roll(corners, -1, axis=1))
    old_weight = barycentric(points, np.repeat(triangles[old][:, None], 3, 1), middles)
    new_weight = barycentric(new_points, np.repeat(new_triangles[new][:, None], 3, 1), middles)
    values = np.einsum("pqa,pam->pqm", old_weight, fields[triangles[old]])
    load = np.einsum("p,pqa,pqm->pam", area / 3, new_weight, values)
    right = np.zeros((len(new_points), fields.shape[1]))
    np.add.at(right, new_triangles[new], load)
    return _solve_mass(new_points, new_triangles, right)


def _solve_mass(points: np.ndarray, triangles: np.ndarray, right: np.ndarray) -> np.ndarray:
    """Solve with the mass matrix of the linear nodal functions for each column of (K, m); every node has a triangle."""
    rank = np.argsort(linear.node_order(len(points), triangles))
    system = ElementSystem(triangles, rank, np.zeros(len(points), bool))
    solver, solution = linear.Solver(system.matrix(mass(triangle_areas(points, triangles)))), np.empty_like(right)
    for column, load in enumerate(right.T):
        solution[system.order, column] = solver.solve(load[system.order])
    return solution
