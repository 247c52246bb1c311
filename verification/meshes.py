"""Meshes of rectangles for cases whose geometry is simpler than the paper's: random, and unrelated from size to size.

They are made without the package's mesher: nodes on the given lines, a jittered lattice between them, one Delaunay
triangulation. Half-discs are the package's own.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial import Delaunay

from repro.fem import mesher, outline, sizing
from repro.fem.mesh import Mesh, triangle_areas

#: Displacement of the lattice's nodes, and the least distance of a lattice node from a line, over the element size.
JITTER, CLEARANCE = 0.22, 0.45


def rectangle(ends, width: float, size: float, *, across=(), along=(), seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """(points, triangles) of ends x [0, width] in elements of ``size``; edges follow the lines x in ``across`` and
    y in ``along``. Boundary nodes are on their line to the last bit."""
    random = np.random.default_rng(seed)
    x_lines, y_lines = np.array([ends[0], *across, ends[1]]), np.array([0.0, *along, width])
    xs, ys = _stations(x_lines, size), _stations(y_lines, size)
    rim = [np.column_stack([xs, np.full(len(xs), y)]) for y in y_lines]
    rim += [np.column_stack([np.full(len(ys), x), ys]) for x in x_lines]
    points = np.vstack([np.unique(np.vstack(rim), axis=0), _inside(x_lines, y_lines, size, random)])
    triangles = Delaunay(points).simplices
    areas = triangle_areas(points, triangles)
    triangles[areas < 0] = triangles[areas < 0][:, ::-1]
    return points, triangles[np.abs(areas) > 1e-9 * size**2]


def _stations(lines: np.ndarray, size: float) -> np.ndarray:
    """Equal parts of about ``size`` between consecutive lines."""
    pieces = [np.linspace(a, b, max(1, round((b - a) / size)) + 1)[:-1] for a, b in zip(lines, lines[1:])]
    return np.append(np.concatenate(pieces), lines[-1])


def _inside(x_lines, y_lines, size: float, random) -> np.ndarray:
    """A jittered triangular lattice, without what comes near a line."""
    rows = np.arange(y_lines[0], y_lines[-1], size * np.sqrt(0.75))
    columns = np.arange(x_lines[0], x_lines[-1], size)
    x, y = np.meshgrid(columns, rows)
    x = x + 0.5 * size * (np.arange(len(rows)) % 2)[:, None]
    points = np.column_stack([x.ravel(), y.ravel()]) + size * random.uniform(0, 1, 2)
    points += size * random.uniform(-JITTER, JITTER, points.shape)
    gaps = [np.abs(points[:, [axis]] - lines).min(axis=1) for axis, lines in ((0, x_lines), (1, y_lines))]
    within = (points < [x_lines[-1], y_lines[-1]]).all(axis=1)
    return points[within & (np.minimum(*gaps) > CLEARANCE * size)]


def channel(ends, width: float, size: float, is_biomass, *, across=(), along=(), seed: int = 0) -> Mesh:
    """A straight mesh of a rectangle; ``is_biomass(x, y)`` says which triangles, by their middles, are biomass."""
    points, triangles = rectangle(ends, width, size, across=across, along=along, seed=seed)
    middle = points[triangles].mean(axis=1)
    return Mesh.of(points, triangles, is_biomass(*middle.T), np.empty(0, int), width, tuple(map(float, ends)))


def half_disc(radius: float, refinement: float, ends, width: float, *, geometry: int = 1, lean: float = 0.0) -> Mesh:
    """The package's mesh around a half-disc on the lower wall, straight (geometry 1) or curved (2), sheared by
    ``lean``; a film of 2 um is the thinnest that is resolved."""
    seed = outline.half_disc(radius, sizing.ACROSS_AGGREGATE * refinement, geometry)
    points = seed.points + lean * seed.points[:, [1]] * [1.0, 0.0]
    sheared = outline.Outline(points, seed.wall, seed.fixed, points, geometry)
    return mesher.generate(sheared, ends, sizing.Sizing(width, refinement, 2.0), geometry)[0]
