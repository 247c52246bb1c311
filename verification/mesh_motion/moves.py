"""One motion of a mesh, straight or curved, and what the cases measure on it."""

from __future__ import annotations

import numpy as np

from repro.fem.mesh import Mesh
from repro.fem.space import Space
from repro.model import mesh_motion
from verification import norms

#: gamma of (35) and c of the stabilisation as scenes have them, and the gammas that cases compare (E13).
GAMMA, STABILISATION = 1.0, 100.0
GAMMAS = (0.1, GAMMA, 10.0)
#: Straight triangles, as linear elements have them, and curved ones, as those of order 2 and 3.
GEOMETRIES = {1: "straight", 2: "curved"}


def moved(grid: Mesh, points: np.ndarray, gamma: float = GAMMA) -> np.ndarray:
    """(N, 2) nodes of the mesh after its aggregate's have moved to theirs of ``points`` (N, 2)."""
    return mesh_motion.move(grid, points[grid.body], gamma, STABILISATION)


def sample(grid: Mesh, field: np.ndarray, where: np.ndarray) -> np.ndarray:
    """A field (N, m) at the mesh's own nodes, at points (K, 2)."""
    return norms.field_at(Space(grid, grid.geometry), field, where)
