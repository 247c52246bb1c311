"""Norms of the error of fields of order 1, 2 or 3 on triangles, and what they are at points.

Values of linear fields at many points: matplotlib's trapezoid map finds the triangle of each in logarithmic time.
"""

from __future__ import annotations

import numpy as np
from matplotlib.tri import Triangulation
from skfem import Basis, ElementTriP1, MeshTri
from skfem.quadrature import get_quadrature_tri

from repro.fem import elements, transfer
from repro.fem.mesh import Mesh
from repro.fem.space import Space

WEIGHTS = get_quadrature_tri(6)
#: Degree of the rule for fields of any order: products of two cubic ones, and places on curved triangles.
FINE = 10


def quadrature(points: np.ndarray, triangles: np.ndarray):
    """Points (t, q, 2), weights (t, q) and nodal functions (q, 3) of a rule of degree six."""
    (s, t), weight = WEIGHTS
    shape = np.column_stack([1 - s - t, s, t])
    corner = points[triangles]
    a, b = corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]
    double = np.abs(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])
    return np.einsum("qa,tai->tqi", shape, corner), double[:, None] * weight, shape


def l2_error(points, triangles, values, exact) -> float:
    """L2 norm of a nodal field (N,) or (N, m) less exact(x, y), over that of exact(x, y)."""
    where, weight, shape = quadrature(points, triangles)
    truth = exact(where[..., 0], where[..., 1])
    found = np.einsum("qa,ta...->tq...", shape, np.asarray(values)[triangles])
    weight = weight.reshape(weight.shape + (1,) * (truth.ndim - 2))
    return float(np.sqrt(np.sum(weight * (found - truth) ** 2) / np.sum(weight * truth**2)))


def fine(space: Space, chosen=slice(None)):
    """Points (t, q, 2) um, weights (t, q) um2 and functions (q, k) of a space, of a rule of degree ten on the triangles
    ``chosen``, straight or curved."""
    mesh, of = space.mesh, elements.table(space.order, space.mesh.geometry, FINE)
    nodes = mesh.points[mesh.cells[chosen]]
    return np.einsum("qa,tai->tqi", of.shape, nodes), elements.weights(nodes, of), of.values


def field_error(space: Space, values: np.ndarray, exact, chosen=slice(None)) -> float:
    """As :func:`l2_error` of values (count,) or (count, m) at the nodes of a space, over the triangles ``chosen``."""
    where, weight, shape = fine(space, chosen)
    truth = exact(where[..., 0], where[..., 1])
    found = np.einsum("qa,ta...->tq...", shape, values[space.cells[chosen]])
    weight = weight.reshape(weight.shape + (1,) * (truth.ndim - 2))
    return float(np.sqrt(np.sum(weight * (found - truth) ** 2) / np.sum(weight * truth**2)))


def field_at(space: Space, values: np.ndarray, where: np.ndarray) -> np.ndarray:
    """Values (count,) or (count, m) of a space at points (K, 2); those that round-off puts outside are moved in."""
    return transfer.located(space.mesh.points, space.mesh.cells, where).field(values, space.cells, space.order)


def sample(points, triangles, values, where) -> np.ndarray:
    """A nodal field (N,) or (N, m) at points (K, 2) of the mesh, by scikit-fem's search for the triangle of each."""
    weights = Basis(MeshTri(points.T.copy(), triangles.T.copy()), ElementTriP1()).probes(where.T)
    return weights @ np.asarray(values)


def mean_size(mesh: Mesh) -> float:
    """Side of the square of mean triangle area twice over: the spacing of a lattice of as many nodes, um."""
    return float(np.sqrt(2 * mesh.areas.mean()))


def sampled(grid: Mesh, values: np.ndarray, where: np.ndarray) -> np.ndarray:
    """A nodal field (N,) or (N, m) at points (K, 2) of the mesh; points that round-off puts outside are moved in."""
    near = 1e-9 * grid.width
    inside = np.clip(where, grid.points.min(axis=0) + near, grid.points.max(axis=0) - near)
    triangle = Triangulation(*grid.points.T, grid.triangles).get_trifinder()(*inside.T)
    if triangle.min() < 0:
        raise ValueError("a point is in no triangle of the mesh")
    first = grid.triangles[triangle, 0]
    rest = np.einsum("kai,ki->ka", grid.gradients[triangle, 1:], inside - grid.points[first])
    weights = np.column_stack([1 - rest.sum(axis=1), rest])
    return np.einsum("ka,ka...->k...", weights, np.asarray(values)[grid.triangles[triangle]])
