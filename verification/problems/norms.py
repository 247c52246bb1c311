"""Norms of the error of fields of order 1, 2 or 3 on triangles, and what they are at points."""

from __future__ import annotations

import numpy as np
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


def relative(found: np.ndarray, exact: np.ndarray, weight: np.ndarray) -> float:
    """L2 of values less exact (t, q) or (t, q, m), with weights (t, q), over that of exact."""
    weight = weight.reshape(weight.shape + (1,) * (exact.ndim - weight.ndim))
    return float(np.sqrt(np.sum(weight * (found - exact) ** 2) / np.sum(weight * exact**2)))


def l2_error(points, triangles, values, exact) -> float:
    """L2 norm of a nodal field (N,) or (N, m) less exact(x, y), over that of exact(x, y)."""
    where, weight, shape = quadrature(points, triangles)
    found = np.einsum("qa,ta...->tq...", shape, np.asarray(values)[triangles])
    return relative(found, exact(where[..., 0], where[..., 1]), weight)


def fine(space: Space, chosen=slice(None), degree: int = FINE):
    """Points (t, q, 2) um, weights (t, q) um2 and functions (q, k) of a space, of a rule of a degree on the triangles
    ``chosen``, straight or curved."""
    mesh, of = space.mesh, elements.table(space.order, space.mesh.geometry, degree)
    nodes = mesh.points[mesh.cells[chosen]]
    return np.einsum("qa,tai->tqi", of.shape, nodes), elements.weights(nodes, of), of.values


def field_error(space: Space, values: np.ndarray, exact, chosen=slice(None)) -> float:
    """As :func:`l2_error` of values (count,) or (count, m) at the nodes of a space, over the triangles ``chosen``."""
    where, weight, shape = fine(space, chosen)
    found = np.einsum("qa,ta...->tq...", shape, values[space.cells[chosen]])
    return relative(found, exact(where[..., 0], where[..., 1]), weight)


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
