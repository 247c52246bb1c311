"""One motion of a mesh, and what the cases measure on it."""

from __future__ import annotations

import numpy as np
from matplotlib.tri import LinearTriInterpolator, Triangulation

from repro.fem.mesh import PoreMesh
from repro.model import mesh_motion

#: gamma of (35) and c of the stabilisation as scenes have them, and the gammas that cases compare (E13).
GAMMA, STABILISATION = 1.0, 100.0
GAMMAS = (0.1, GAMMA, 10.0)


def moved(grid: PoreMesh, points: np.ndarray, gamma: float = GAMMA) -> np.ndarray:
    """(N, 2) nodes of the mesh after its aggregate's have moved to theirs of ``points`` (N, 2)."""
    return mesh_motion.move(grid, points[grid.body], gamma, STABILISATION)


def sample(grid: PoreMesh, field: np.ndarray, where: np.ndarray) -> np.ndarray:
    """A nodal field (N, m) at points (K, 2), by matplotlib's search; not-a-number outside the mesh."""
    known = Triangulation(*grid.points.T, grid.triangles)
    return np.column_stack([LinearTriInterpolator(known, part)(*where.T).filled(np.nan) for part in field.T])
