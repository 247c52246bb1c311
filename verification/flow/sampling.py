"""Values of linear fields at many points: matplotlib's trapezoid map finds the triangle of each in logarithmic time."""

from __future__ import annotations

import numpy as np
from matplotlib.tri import Triangulation

from repro.fem.mesh import Mesh


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
