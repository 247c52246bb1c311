"""Random meshes whose edges follow lines or a circle between fluid and biomass, unrelated from draw to draw.

An edge between neighbours on such a curve is Delaunay's if no other node lies in the circle around it: nodes nearer to
the curve than CLEARANCE are left out. That no triangle lies across it is checked.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.spatial import Delaunay

from repro.fem.mesh import Mesh, curved, triangle_areas
from verification import meshes

#: The least distance of a node from the curve, over the element size: over a half, as edges on the curve are not quite
#: as long as an element.
CLEARANCE = 0.6
#: The package's own mesher draws nothing: unrelated meshes of about a size come from slightly different refinements.
SPREAD = (1.0, 0.9, 1.1)


def channel(ends, width: float, size: float, is_biomass, *, across=(), along=(), seed: int = 0) -> Mesh:
    """A rectangle cut by the lines x in ``across`` and y in ``along``; ``is_biomass(x, y)`` of triangles' middles."""
    points, _ = meshes.rectangle(ends, width, size, across=across, along=along, seed=seed)

    def beside(where):
        return np.hstack([where[:, [axis]] - np.array(lines) for axis, lines in ((0, across), (1, along))])

    apart = np.abs(beside(points)).min(axis=1)
    return _mesh(points[(apart == 0) | (apart > CLEARANCE * size)], beside, size, is_biomass, ends, width)


def disc(ends, width: float, size: float, centre, radius: float, seed: int) -> Mesh:
    """A rectangle with a disc of biomass inside, a polygon of edges of about ``size``, which is the mesh's loop."""
    points, _ = meshes.rectangle(ends, width, size, seed=seed)
    parts = round(2 * np.pi * radius / size)
    angle = 2 * np.pi * (np.arange(parts) + np.random.default_rng(seed).uniform()) / parts
    circle = centre + radius * np.column_stack([np.cos(angle), np.sin(angle)])

    def beside(where):
        return np.hypot(*(where - centre).T)[:, None] - radius

    points = np.vstack([points[np.abs(beside(points)[:, 0]) > CLEARANCE * size], circle])
    loop = np.arange(len(points) - parts, len(points))
    return _mesh(points, beside, size, lambda x, y: np.hypot(x - centre[0], y - centre[1]) < radius, ends, width, loop)


def round_disc(ends, width: float, size: float, centre, radius: float, seed: int) -> Mesh:
    """The same of six-node triangles, middles of the polygon's edges on the circle."""
    straight = disc(ends, width, size, centre, radius, seed)
    start = straight.points[straight.loop] - centre
    middle = start + np.roll(start, -1, axis=0)
    return curved(straight, centre + radius * middle / np.hypot(*middle.T)[:, None]).checked()


def _mesh(points, beside, size: float, is_biomass, ends, width: float, loop=()) -> Mesh:
    """Delaunay's triangles, counterclockwise, without those that round-off makes flat along the rim; ``beside(points)``
    (N, k) are distances from the curves, of one sign on each side. Raises ValueError where a triangle lies across."""
    triangles = Delaunay(points).simplices
    areas = triangle_areas(points, triangles)
    triangles[areas < 0] = triangles[areas < 0][:, ::-1]
    triangles = triangles[np.abs(areas) > 1e-9 * size**2]
    sides = beside(points)[triangles]
    if ((sides.min(axis=1) < -1e-9 * size) & (sides.max(axis=1) > 1e-9 * size)).any():
        raise ValueError("a triangle lies across the curve between fluid and biomass")
    biomass = is_biomass(*points[triangles].mean(axis=1).T)
    return Mesh.of(points, triangles, biomass, np.array(loop, int), width, tuple(map(float, ends)))


def root_mean_square(measure: Callable[[int], dict[str, float]], draws: int) -> dict[str, float]:
    """Each error over several random meshes of one size: ``measure(draw)`` gives {field: error}."""
    rows = [measure(draw) for draw in range(draws)]
    return {name: float(np.sqrt(np.mean([row[name] ** 2 for row in rows]))) for name in rows[0]}
