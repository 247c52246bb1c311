"""Bodies of the cases, and their growth from t = 0 in steps."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import numpy as np

from repro.fem import geometry, mesh
from repro.model import growth
from verification import meshes

#: Radius of the half-discs (um), and the factor by which theta is raised at a time.
RADIUS, FACTOR = 20.0, 1.5
LENGTH, HEIGHT = 10.0, 7.0


@cache
def half_disc(refinement: float) -> tuple[growth.Body, np.ndarray]:
    """(body, nodes of its arc without the corners (M,)): a half-disc on the wall on which it slides, its middle fixed,
    in a mesh of the package's own."""
    outline = geometry.seed(RADIUS, refinement)
    grid, outline = mesh.generate(outline, (-60.0, 60.0), geometry.Sizing(50.0, refinement, 2.0))
    rim, free = grid.body_loop, outline.wall == geometry.FREE
    held = np.zeros((len(grid.body), 2), bool)
    held[rim[outline.fixed], 0] = True
    held[rim[~free], 1] = True
    return growth.Body(grid.points[grid.body], grid.body_triangles, held), rim[free]


def rectangle(size: float, seed: int) -> tuple[np.ndarray, np.ndarray, dict[str, np.ndarray]]:
    """(points, triangles, nodes of each side (N,)) of a random mesh of LENGTH x HEIGHT um."""
    points, triangles = meshes.rectangle((0.0, LENGTH), HEIGHT, size, seed=seed)
    x, y = points.T
    return points, triangles, {"left": x == 0, "right": x == LENGTH, "bottom": y == 0, "top": y == HEIGHT}


def middles(body: growth.Body) -> np.ndarray:
    """(t, 2) middles of a body's triangles at t = 0."""
    return body.reference[body.triangles].mean(axis=1)


def size(body: growth.Body) -> float:
    """Side of the square of mean triangle area twice over, um."""
    return float(np.sqrt(2 * mesh.triangle_areas(body.reference, body.triangles).mean()))


def grown(body: growth.Body, theta: np.ndarray, path: Callable | None = None) -> growth.Equilibrium:
    """Equilibrium under theta (t,), raised by FACTOR at a time; ``path(part)`` are the prescribed places (n, 2) under
    theta^part, those of t = 0 if there is none."""
    position, pressure = body.reference, np.zeros(len(body.reference))
    parts = int(np.ceil(np.log(max(theta.max(), 1 / theta.min())) / np.log(FACTOR)))
    for part in np.arange(1, parts + 1) / parts:
        prescribed = path(part) if path else body.reference
        found = growth.equilibrium(body, theta**part, position, pressure, prescribed)
        position, pressure = found.position, found.pressure
    return found
