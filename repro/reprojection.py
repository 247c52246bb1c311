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
    return np.stack([cross(b - where, c - where), cross(c - where, a - where), cross(a - where, b - where)], -1) / double[..., None]


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
    old, new = shapely.polygons(points[triangles]), shapely.polygons(new_points[new_triangles])
    new_index, old_index = shapely.STRtree(old).query(new, predicate="intersects")
    pieces = shapely.intersection(old[old_index], new[new_index])
    keep = shapely.get_type_id(pieces) == shapely.GeometryType.POLYGON
    rings, piece = shapely.get_coordinates(pieces[keep], return_index=True)
    first = np.searchsorted(piece, np.arange(np.count_nonzero(keep)))
    fan = np.flatnonzero((np.arange(len(rings)) - first[piece] >= 1) & (np.append(piece[1:], -1) == piece))
    fan = fan[np.append(piece[2:], [-1, -1])[fan] == piece[fan]]
    corners = np.stack([rings[first[piece[fan]]], rings[fan], rings[fan + 1]], axis=1)
    return corners, old_index[keep][piece[fan]], new_index[keep][piece[fan]]


@timed("transfer")
def project(points, triangles, fields, new_points, new_triangles) -> np.ndarray:
    """Galerkin projection of nodal fields (N, m) onto the nodes of another mesh of the same polygon: (K, m).

    Raises TransferError where the two meshes do not cover the same area.
    """
    corners, old, new = supermesh(points, triangles, new_points, new_triangles)
    edge = corners[:, 1:] - corners[:, :1]
    area = 0.5 * np.abs(edge[:, 0, 0] * edge[:, 1, 1] - edge[:, 0, 1] * edge[:, 1, 0])
    areas = [triangle_areas(p, t).sum() for p, t in ((points, triangles), (new_points, new_triangles))]
    if max(abs(area.sum() / a - 1) for a in areas) > COVER:
        raise TransferError(f"old mesh {areas[0]:.12g} um2, new mesh {areas[1]:.12g} um2, in common {area.sum():.12g} um2")
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
