"""Meshes of rectangles for cases whose geometry is simpler than the paper's: random, and unrelated from size to size.

They are made without the package's mesher: nodes on the given lines, a jittered lattice between them, one Delaunay
triangulation. Half-discs are the package's own.

Random meshes whose edges follow lines or a circle between fluid and biomass, unrelated from draw to draw.

An edge between neighbours on such a curve is Delaunay's if no other node lies in the circle around it: nodes nearer to
the curve than CLEARANCE are left out. That no triangle lies across it is checked.

Norms of the error of fields of order 1, 2 or 3 on triangles, and what they are at points.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise, product

import numpy as np
from scipy.spatial import Delaunay, cKDTree

from repro.fem import elements, mesher, outline, sizing, transfer
from repro.fem.mesh import Mesh, curved, triangle_areas
from repro.fem.space import Space

#: Displacement of the lattice's nodes, and the least distance of a lattice node from a line, over the element size.
JITTER, CLEARANCE = 0.22, 0.45


def rectangle(ends, width: float, size: float, *, across=(), along=(), seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """(points, triangles) of ends x [0, width] in elements of ``size``; edges follow the lines x in ``across`` and
    y in ``along``. Boundary nodes are on their line to the last bit."""
    random = np.random.default_rng(seed)
    x_lines, y_lines = np.array([ends[0], *across, ends[1]]), np.array([0.0, *along, width])
    on_lines = [*product(_stations(x_lines, size), y_lines), *product(x_lines, _stations(y_lines, size))]
    return _delaunays(np.vstack([np.unique(on_lines, axis=0), _inside(x_lines, y_lines, size, random)]), size)


def upright(points: np.ndarray, triangles: np.ndarray, least: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """The same triangles, counterclockwise; those of no more area than ``least`` left out."""
    area = triangle_areas(points, triangles)
    turned = np.where(area[:, None] < 0, triangles[:, ::-1], triangles)
    return points, turned[np.abs(area) > least]


def _delaunays(points: np.ndarray, size: float) -> tuple[np.ndarray, np.ndarray]:
    """Delaunay's triangles, without those that round-off makes flat along the rim."""
    return upright(points, Delaunay(points).simplices, 1e-9 * size**2)


def _stations(lines: np.ndarray, size: float) -> np.ndarray:
    """Equal parts of about ``size`` between consecutive lines."""
    return np.unique(np.hstack([np.linspace(a, b, max(1, round((b - a) / size)) + 1) for a, b in pairwise(lines)]))


def _beside(points: np.ndarray, across, along) -> np.ndarray:
    """(N, k) distances of points from the lines x in ``across`` and y in ``along``, with their signs."""
    return np.hstack([points[:, [0]] - np.array(across), points[:, [1]] - np.array(along)])


def _inside(x_lines, y_lines, size: float, random) -> np.ndarray:
    """A jittered triangular lattice, without what comes near a line."""
    rows = np.arange(y_lines[0], y_lines[-1], size * np.sqrt(0.75))
    columns = np.arange(x_lines[0], x_lines[-1], size)
    x, y = np.meshgrid(columns, rows)
    x = x + 0.5 * size * (np.arange(len(rows)) % 2)[:, None]
    points = np.column_stack([x.ravel(), y.ravel()]) + size * random.uniform(0, 1, 2)
    points += size * random.uniform(-JITTER, JITTER, points.shape)
    within = (points < [x_lines[-1], y_lines[-1]]).all(axis=1)
    return points[within & (np.abs(_beside(points, x_lines, y_lines)).min(axis=1) > CLEARANCE * size)]


def channel(ends, width: float, size: float, is_biomass, *, across=(), along=(), seed: int = 0) -> Mesh:
    """A straight mesh of a rectangle; ``is_biomass(x, y)`` says which triangles, by their middles, are biomass."""
    points, triangles = rectangle(ends, width, size, across=across, along=along, seed=seed)
    return _meshed(points, triangles, is_biomass, ends, width)


def plug(ends, width: float, half: float, size: float, make=channel, seed: int = 0) -> Mesh:
    """Biomass from wall to wall for |x| < half (um); make: :func:`channel` or :func:`cut`."""
    return make(ends, width, size, lambda x, y: np.abs(x) < half, across=(-half, half), seed=seed)


def space_on(straight: Mesh, order: int) -> Space:
    """Functions of an order on a straight mesh: those of order 2 and 3 on its triangles as curved ones."""
    return Space(straight if order == 1 else curved(straight, None), order)


def half_disc(radius: float, refinement: float, ends, width: float, *, geometry: int = 1, lean: float = 0.0) -> Mesh:
    """The package's mesh around a half-disc on the lower wall, straight (geometry 1) or curved (2 and 3), sheared by
    ``lean``; a film of 2 um is the thinnest that is resolved."""
    upright = seed(radius, refinement, geometry)
    points = upright.points + lean * upright.points[:, [1]] * [1.0, 0.0]
    return around(replace(upright, points=points, origin=points), refinement, ends, width)[0]


def seed(radius: float, refinement: float, order: int = 1) -> outline.Outline:
    """A half-disc for elements of an order: of straight edges or, from order 2 on, of arcs."""
    return outline.half_disc(radius, sizing.ACROSS_AGGREGATE * refinement, min(order, 2))


def around(seed: outline.Outline, refinement: float, ends, width: float) -> tuple[Mesh, outline.Outline]:
    """The package's mesh around an outline, and the outline as its edges are split."""
    return mesher.generate(seed, ends, sizing.Sizing(width, refinement, 2.0), seed.geometry)


def half_disc_space(radius: float, refinement: float, ends, width: float, order: int) -> Space:
    """Functions of an order on the package's mesh around a half-disc."""
    return Space(half_disc(radius, refinement, ends, width, geometry=order), order)


#: The least distance of a node from the curve, over the element size: over a half, as edges on the curve are not quite
#: as long as an element.
CURVE_CLEARANCE = 0.6
#: The package's own mesher draws nothing: unrelated meshes of about a size come from slightly different refinements.
SPREAD = (1.0, 0.9, 1.1)


def cut(ends, width: float, size: float, is_biomass, *, across=(), along=(), seed: int = 0) -> Mesh:
    """A rectangle cut by the lines x in ``across`` and y in ``along``; ``is_biomass(x, y)`` of triangles' middles."""
    points, _ = rectangle(ends, width, size, across=across, along=along, seed=seed)

    def beside(where):
        return _beside(where, across, along)

    apart = np.abs(beside(points)).min(axis=1)
    return _delaunay(points[(apart == 0) | (apart > CURVE_CLEARANCE * size)], beside, size, is_biomass, ends, width)


def disc(ends, width: float, size: float, centre, radius: float, seed: int) -> Mesh:
    """A rectangle with a disc of biomass inside, a polygon of edges of about ``size``, which is the mesh's loop."""
    points, _ = rectangle(ends, width, size, seed=seed)
    parts = round(2 * np.pi * radius / size)
    angle = 2 * np.pi * (np.arange(parts) + np.random.default_rng(seed).uniform()) / parts
    circle = centre + radius * np.column_stack([np.cos(angle), np.sin(angle)])

    def beside(where):
        return np.hypot(*(where - centre).T)[:, None] - radius

    points = np.vstack([points[np.abs(beside(points)[:, 0]) > CURVE_CLEARANCE * size], circle])
    loop = np.arange(len(points) - parts, len(points))
    return _delaunay(points, beside, size, lambda x, y: np.hypot(x - centre[0], y - centre[1]) < radius, ends, width,
                     loop)


def round_disc(ends, width: float, size: float, centre, radius: float, seed: int) -> Mesh:
    """The same of six-node triangles, middles of the polygon's edges on the circle."""
    straight = disc(ends, width, size, centre, radius, seed)
    start = straight.points[straight.loop] - centre
    middle = start + np.roll(start, -1, axis=0)
    return curved(straight, centre + radius * middle / np.hypot(*middle.T)[:, None]).checked()


def _delaunay(points, beside, size: float, is_biomass, ends, width: float, loop=()) -> Mesh:
    """A mesh of Delaunay's triangles; ``beside(points)`` (N, k) are distances from the curves, of one sign on each
    side. Raises ValueError where a triangle lies across."""
    _, triangles = _delaunays(points, size)
    sides = beside(points)[triangles]
    if ((sides.min(axis=1) < -1e-9 * size) & (sides.max(axis=1) > 1e-9 * size)).any():
        raise ValueError("a triangle lies across the curve between fluid and biomass")
    return _meshed(points, triangles, is_biomass, ends, width, loop)


def _meshed(points, triangles, is_biomass, ends, width: float, loop=()) -> Mesh:
    biomass = is_biomass(*points[triangles].mean(axis=1).T)
    return Mesh.of(points, triangles, biomass, np.array(loop, int), width, tuple(map(float, ends)))


#: Degree of the rule for fields of any order, products of two cubic ones and places on curved triangles; and of that
#: for fields of order 1.
FINE, LINEAR = 10, 6


def places(nodes: np.ndarray, of: elements.Table) -> tuple[np.ndarray, np.ndarray]:
    """Points (t, q, 2) um and weights (t, q) um2 of a table on triangles with nodes (t, g, 2), whichever way round."""
    return np.einsum("qa,tai->tqi", of.shape, nodes), np.abs(elements.weights(nodes, of))


def quadrature(points: np.ndarray, triangles: np.ndarray):
    """Points (t, q, 2), weights (t, q) and nodal functions (q, 3) of a rule on straight triangles."""
    of = elements.table(1, 1, LINEAR)
    return *places(points[triangles], of), of.values


def fine(space: Space, chosen=slice(None), degree: int = FINE):
    """Points (t, q, 2) um, weights (t, q) um2 and functions (q, k) of a space, of a rule of a degree on the triangles
    ``chosen``, straight or curved."""
    mesh, of = space.mesh, elements.table(space.order, space.mesh.geometry, degree)
    return *places(mesh.points[mesh.cells[chosen]], of), of.values


def relative(found: np.ndarray, exact: np.ndarray, weight: np.ndarray) -> float:
    """L2 of values less exact (t, q) or (t, q, m), with weights (t, q), over that of exact; transposed, the weights are
    those of each component."""
    return np.sqrt(np.sum(weight.T * (found - exact).T ** 2) / np.sum(weight.T * exact.T**2))


def distance(at, values: np.ndarray, exact) -> float:
    """:func:`relative` of a field with values (t, k) or (t, k, m) at the nodes of triangles; at: points, weights and
    functions (q, k)."""
    where, weight, shape = at
    return relative(np.einsum("qa,ta...->tq...", shape, values), exact(*np.moveaxis(where, 2, 0)), weight)


def l2_error(points, triangles, values, exact) -> float:
    """L2 norm of a nodal field (N,) or (N, m) less exact(x, y), over that of exact(x, y)."""
    return distance(quadrature(points, triangles), values[triangles], exact)


def field_error(space: Space, values: np.ndarray, exact, chosen=slice(None)) -> float:
    """The same of values (count,) or (count, m) at the nodes of a space, over the triangles ``chosen``."""
    return distance(fine(space, chosen), values[space.cells[chosen]], exact)


def field_at(space: Space, values: np.ndarray, where: np.ndarray) -> np.ndarray:
    """(K, ...) values (count, ...) of a space at points (K, 2), in the triangles that the package finds. That a point
    lies there is seen by the triangle's map, and which nodes a triangle has by where they are."""
    mesh = space.mesh
    at = transfer.located(mesh.points, mesh.cells, where)
    nodes = mesh.points[mesh.cells[at.triangle]]
    there = np.einsum("ka,kai->ki", elements.values(mesh.geometry, at.local), nodes)
    if np.abs(there - where).max() > 1e-6:
        raise ValueError("a place does not lie in the triangle that was found")
    own = np.einsum("da,kai->kdi", elements.values(mesh.geometry, elements.nodes(space.order)), nodes)
    numbers = cKDTree(space.points).query(own)[1]
    return np.einsum("kd,kd...->k...", elements.values(space.order, at.local), values[numbers])


def section_means(space: Space, values: np.ndarray, x: np.ndarray, count: int = 16) -> np.ndarray:
    """(K, ...) means of values (count, ...) of a space over the sections x (K,) of its mesh, by Gauss's rule."""
    place, weight = np.polynomial.legendre.leggauss(count)
    y = 0.5 * space.mesh.width * (1 + place)
    found = field_at(space, values, np.column_stack([np.repeat(x, count), np.tile(y, len(x))]))
    return np.einsum("kp...,p->k...", found.reshape(len(x), count, *found.shape[1:]), 0.5 * weight)


def along_edges(order: int, count: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Gauss's rule on edges from 0 to 1: places (q,), weights (q,), and functions of an edge's nodes (q, order + 1)."""
    points, weights = np.polynomial.legendre.leggauss(count)
    along = (points + 1) / 2
    return along, weights / 2, elements.values(order, np.column_stack([along, 0 * along]))[:, elements.ON_EDGE[order]]


def mean_size(mesh: Mesh, chosen=slice(None)) -> float:
    """Side of the square of mean area twice over, of the triangles ``chosen``: the spacing of a lattice of as many
    nodes, um."""
    return np.sqrt(2 * mesh.areas[chosen].mean())
