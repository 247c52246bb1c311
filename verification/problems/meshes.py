"""Random meshes of rectangles, and norms of the errors of fields.

Meshes of different sizes are unrelated. They do not use the package's mesher: nodes lie on given lines and on a
jittered lattice between them, and one Delaunay triangulation connects them. Meshes of half-discs are the package's.

Edges may follow lines or a circle between fluid and biomass. An edge between neighbours on such a curve is a Delaunay
edge if no other node lies in the circle around it, so nodes nearer to the curve than CLEARANCE are left out. A mesh
with a triangle across the curve is refused.

Fields of order 1 or 2 have norms of their errors and values at points.
"""

from itertools import pairwise, product

import numpy as np
from scipy.spatial import Delaunay, cKDTree

from repro.fem import elements, mesher, outline, sizing, transfer
from repro.fem.mesh import Mesh, curved, triangle_areas
from repro.fem.space import Space
from repro.fem.walls import channel_walls

#: Displacement of the lattice's nodes, and the least distance of a lattice node from a line, over the element size.
JITTER, CLEARANCE = 0.22, 0.45


def rectangle(ends, width: float, size: float, *, across=(), along=(), seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """(points, triangles) of ends x [0, width] in elements of ``size``.

    Edges follow the lines x in ``across`` and y in ``along``. Boundary nodes are on their line to the last bit.
    """
    random = np.random.default_rng(seed)
    x_lines, y_lines = np.array([ends[0], *across, ends[1]]), np.array([0.0, *along, width])
    on_lines = [*product(_stations(x_lines, size), y_lines), *product(x_lines, _stations(y_lines, size))]
    return _delaunays(np.vstack([np.unique(on_lines, axis=0), _inside(x_lines, y_lines, size, random)]), size)


def upright(points: np.ndarray, triangles: np.ndarray, least: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """The triangles counterclockwise, without those whose area is at most ``least``."""
    area = triangle_areas(points, triangles)
    turned = np.where(area[:, None] < 0, triangles[:, ::-1], triangles)
    return points, turned[np.abs(area) > least]


def _delaunays(points: np.ndarray, size: float) -> tuple[np.ndarray, np.ndarray]:
    """Delaunay triangles, without the flat ones that round-off leaves along the rim."""
    return upright(points, Delaunay(points).simplices, 1e-9 * size**2)


def _stations(lines: np.ndarray, size: float) -> np.ndarray:
    """Coordinates that divide the intervals between lines into equal parts of about ``size``."""
    return np.unique(np.hstack([np.linspace(a, b, max(1, round((b - a) / size)) + 1) for a, b in pairwise(lines)]))


def _signed_distances(points: np.ndarray, across, along) -> np.ndarray:
    """(N, k) signed distances of points from the lines x in ``across`` and y in ``along``."""
    return np.hstack([points[:, [0]] - np.array(across), points[:, [1]] - np.array(along)])


def _inside(x_lines, y_lines, size: float, random) -> np.ndarray:
    """A jittered triangular lattice, without the points near a line."""
    rows = np.arange(y_lines[0], y_lines[-1], size * np.sqrt(0.75))
    columns = np.arange(x_lines[0], x_lines[-1], size)
    x, y = np.meshgrid(columns, rows)
    x = x + 0.5 * size * (np.arange(len(rows)) % 2)[:, None]
    points = np.column_stack([x.ravel(), y.ravel()]) + size * random.uniform(0, 1, 2)
    points += size * random.uniform(-JITTER, JITTER, points.shape)
    within = (points < [x_lines[-1], y_lines[-1]]).all(axis=1)
    return points[within & (np.abs(_signed_distances(points, x_lines, y_lines)).min(axis=1) > CLEARANCE * size)]


def channel(ends, width: float, size: float, is_biomass, *, across=(), along=(), seed: int = 0) -> Mesh:
    """A straight mesh of a rectangle. ``is_biomass(x, y)`` of the middles marks the triangles of biomass."""
    points, triangles = rectangle(ends, width, size, across=across, along=along, seed=seed)
    return _mesh(points, triangles, is_biomass, ends, width)


def plug(ends, width: float, half: float, size: float, make=channel, seed: int = 0) -> Mesh:
    """Biomass from wall to wall for |x| < half (um); make: :func:`channel` or :func:`cut`."""
    return make(ends, width, size, lambda x, y: np.abs(x) < half, across=(-half, half), seed=seed)


def space_on(grid: Mesh, order: int) -> Space:
    """A space of an order on a mesh. Order 2 takes straight triangles as curved ones."""
    return Space(grid if order == grid.geometry else curved(grid, None))


def half_disc(radius: float, refinement: float, ends, width: float, *, geometry: int = 1) -> Mesh:
    """The package's mesh around a half-disc on the lower wall.

    Triangles are straight (geometry 1) or curved (2). The thinnest resolved film is 2 um thick.
    """
    return around(seed(radius, refinement, geometry), refinement, ends, width)[0]


def seed(radius: float, refinement: float, order: int = 1) -> outline.Outline:
    """The outline of a half-disc: straight edges for order 1, arcs for order 2."""
    return outline.half_disc(radius, sizing.ACROSS_AGGREGATE * refinement, order)


def around(seed: outline.Outline, refinement: float, ends, width: float) -> tuple[Mesh, outline.Outline]:
    """The package's mesh around an outline, and the outline with its split edges."""
    sizes = sizing.Sizing(channel_walls(width), refinement, 2.0)
    mesh, (split,) = mesher.generate_around([seed], ends, sizes, seed.geometry)
    return mesh, split


def half_disc_space(radius: float, refinement: float, ends, width: float, order: int) -> Space:
    """A space of an order on the package's mesh around a half-disc."""
    return Space(half_disc(radius, refinement, ends, width, geometry=order))


#: The least distance of a node from the curve over the element size. It exceeds 0.5 because edges on the curve are a
#: little shorter than an element.
CURVE_CLEARANCE = 0.6
def cut(ends, width: float, size: float, is_biomass, *, across=(), along=(), seed: int = 0) -> Mesh:
    """A rectangle cut by the lines x in ``across`` and y in ``along``, with ``is_biomass(x, y)`` of the middles."""
    points, _ = rectangle(ends, width, size, across=across, along=along, seed=seed)

    def signed_distances(where):
        return _signed_distances(where, across, along)

    apart = np.abs(signed_distances(points)).min(axis=1)
    points = points[(apart == 0) | (apart > CURVE_CLEARANCE * size)]
    return _delaunay(points, signed_distances, size, is_biomass, ends, width)


def disc(ends, width: float, size: float, centre, radius: float, seed: int) -> Mesh:
    """A rectangle with a disc of biomass. The disc is a polygon with edges of about ``size``, the loop of the mesh."""
    points, _ = rectangle(ends, width, size, seed=seed)
    parts = round(2 * np.pi * radius / size)
    angle = 2 * np.pi * (np.arange(parts) + np.random.default_rng(seed).uniform()) / parts
    circle = centre + radius * np.column_stack([np.cos(angle), np.sin(angle)])

    def signed_distances(where):
        return np.hypot(*(where - centre).T)[:, None] - radius

    points = np.vstack([points[np.abs(signed_distances(points)[:, 0]) > CURVE_CLEARANCE * size], circle])
    loop = np.arange(len(points) - parts, len(points))
    return _delaunay(points, signed_distances, size, lambda x, y: np.hypot(x - centre[0], y - centre[1]) < radius, ends,
                     width, loop)


def round_disc(ends, width: float, size: float, centre, radius: float, seed: int) -> Mesh:
    """:func:`disc` with six-node triangles. The middles of the polygon's edges lie on the circle."""
    straight = disc(ends, width, size, centre, radius, seed)
    start = straight.points[straight.loop] - centre
    middle = start + np.roll(start, -1, axis=0)
    return curved(straight, [centre + radius * middle / np.hypot(*middle.T)[:, None]]).checked()


def _delaunay(points, signed_distances, size: float, is_biomass, ends, width: float, loop=()) -> Mesh:
    """A mesh of Delaunay triangles. Raises ValueError if a triangle lies across a curve.

    ``signed_distances(points)`` (N, k) are distances from the curves, with one sign on each side.
    """
    _, triangles = _delaunays(points, size)
    sides = signed_distances(points)[triangles]
    if ((sides.min(axis=1) < -1e-9 * size) & (sides.max(axis=1) > 1e-9 * size)).any():
        raise ValueError("a triangle lies across the curve between fluid and biomass")
    return _mesh(points, triangles, is_biomass, ends, width, loop)


def _mesh(points, triangles, is_biomass, ends, width: float, loop=()) -> Mesh:
    biomass = is_biomass(*points[triangles].mean(axis=1).T)
    return Mesh.of(points, triangles, biomass, (np.array(loop, int),), channel_walls(width), tuple(map(float, ends)))


#: Degree of the quadrature for fields of any order on curved triangles, and for fields of order 1.
FINE, LINEAR = 10, 6


def quadrature_points(nodes: np.ndarray, table: elements.Table) -> tuple[np.ndarray, np.ndarray]:
    """Points (t, q, 2) um and weights (t, q) um2 of a table on triangles with nodes (t, g, 2) in either orientation."""
    return np.einsum("qa,tai->tqi", table.values, nodes), np.abs(elements.weights(nodes, table))


def quadrature(points: np.ndarray, triangles: np.ndarray):
    """Points (t, q, 2), weights (t, q) and nodal functions (q, 3) on straight triangles."""
    table = elements.table(1, LINEAR)
    return *quadrature_points(points[triangles], table), table.values


def fine(space: Space, chosen=slice(None), degree: int = FINE):
    """Points (t, q, 2) um, weights (t, q) um2 and functions (q, k) of a space.

    The quadrature has the given degree on the triangles ``chosen``, straight or curved.
    """
    mesh, table = space.mesh, elements.table(space.order, degree)
    return *quadrature_points(mesh.points[mesh.cells[chosen]], table), table.values


def fine_linear(space: Space) -> np.ndarray:
    """(q, 3) linear functions of the corners, those of a pressure, at the points of :func:`fine`."""
    return elements.table(space.order, FINE).linear


def relative(computed: np.ndarray, exact: np.ndarray, weight: np.ndarray) -> float:
    """Relative L2 difference of values from exact ones, both (t, q) or (t, q, m), with weights (t, q)."""
    return np.sqrt(np.sum(weight.T * (computed - exact).T ** 2) / np.sum(weight.T * exact.T**2))


def distance(at, values: np.ndarray, exact) -> float:
    """:func:`relative` of a field with values (t, k) or (t, k, m) at the nodes of triangles.

    at: points, weights and functions (q, k).
    """
    where, weight, shape = at
    return relative(np.einsum("qa,ta...->tq...", shape, values), exact(*np.moveaxis(where, 2, 0)), weight)


def l2_error(points, triangles, values, exact) -> float:
    """Relative L2 error of a nodal field (N,) or (N, m) against exact(x, y)."""
    return distance(quadrature(points, triangles), values[triangles], exact)


def field_error(space: Space, values: np.ndarray, exact, chosen=slice(None)) -> float:
    """Relative L2 error of values (count,) or (count, m) at the nodes of a space, over the triangles ``chosen``."""
    return distance(fine(space, chosen), values[space.cells[chosen]], exact)


def field_at(space: Space, values: np.ndarray, where: np.ndarray) -> np.ndarray:
    """(K, ...) values of a field (count, ...) of a space at points (K, 2).

    The package locates the triangle of each point. The map of the triangle confirms it, and the coordinates of the
    nodes give their numbers. Raises ValueError if a point lies elsewhere.
    """
    return _values_at(space.mesh, space.order, space.points, values, where)


def _values_at(mesh: Mesh, order: int, points: np.ndarray, values: np.ndarray, where: np.ndarray) -> np.ndarray:
    at = transfer.located(mesh.points, mesh.cells, where)
    nodes = mesh.points[mesh.cells[at.triangle]]
    mapped = np.einsum("ka,kai->ki", elements.values(mesh.geometry, at.local), nodes)
    if np.abs(mapped - where).max() > 1e-6:
        raise ValueError("a point does not lie in the triangle that was located")
    dof_points = np.einsum("da,kai->kdi", elements.values(mesh.geometry, elements.nodes(order)), nodes)
    numbers = cKDTree(points).query(dof_points)[1]
    return np.einsum("kd,kd...->k...", elements.values(order, at.local), values[numbers])


def section_means(space: Space, values: np.ndarray, x: np.ndarray, count: int = 16) -> np.ndarray:
    """(K, ...) means of a field (count, ...) of a space over the sections x (K,) of its mesh, by Gauss's rule."""
    place, weight = np.polynomial.legendre.leggauss(count)
    y = 0.5 * space.mesh.width * (1 + place)
    values_on_lines = field_at(space, values, np.column_stack([np.repeat(x, count), np.tile(y, len(x))]))
    return np.einsum("kp...,p->k...", values_on_lines.reshape(len(x), count, *values_on_lines.shape[1:]), 0.5 * weight)


def along_edges(order: int, count: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Gauss's rule on an edge from 0 to 1: points (q,), weights (q,), and functions of its nodes (q, order + 1)."""
    points, weights = np.polynomial.legendre.leggauss(count)
    along = (points + 1) / 2
    functions = elements.values(order, np.column_stack([along, 0 * along]))
    return along, weights / 2, functions[:, elements.ELEMENTS[order].sides[0]]


def mean_size(mesh: Mesh, chosen=slice(None)) -> float:
    """Mean size (um) of the triangles ``chosen``: the root of twice their mean area."""
    return np.sqrt(2 * mesh.areas[chosen].mean())
