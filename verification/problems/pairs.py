"""Pairs of meshes of one rectangle, related to each other in every way that a transfer may meet, and norms on them.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from scipy.spatial import Delaunay, cKDTree
from skfem import ElementTriP1, ElementTriP2, ElementTriP3, MeshTri, MeshTri2

from repro.fem.mesh import Mesh, triangle_areas
from repro.fem.space import Space
from verification.problems import meshes

ENDS, WIDTH = (0.0, 40.0), 25.0
AREA = (ENDS[1] - ENDS[0]) * WIDTH
#: Distances (um) by which nodes are set aside, and at which others lie from the rim: slivers of that width.
ASIDE, SLIVER = (1e-14, 1e-9, 1e-4), 1e-6
Grid = tuple[np.ndarray, np.ndarray]
#: Triangles in which a place is looked for.
NEAR = 16
ELEMENTS = {1: ElementTriP1(), 2: ElementTriP2(), 3: ElementTriP3()}


def grid(size: float, seed: int) -> Grid:
    """Points and triangles of a random mesh."""
    return meshes.rectangle(ENDS, WIDTH, size, seed=seed)


def pairs() -> Iterator[tuple[str, Grid, Grid]]:
    """(how the two are related, old mesh, new mesh)."""
    first, other = grid(5.0, 1), grid(4.0, 2)
    yield "unrelated", first, other
    yield "the same, in another order", first, (first[0], np.roll(first[1], 1, axis=1)[::-1])
    yield "every triangle cut in four", first, cut_in_four(first)
    yield "four triangles made one", cut_in_four(first), first
    for distance in ASIDE:
        yield f"nodes {distance:g} um aside", first, aside(first, distance)
    yield "slivers on slivers", slivers(3), slivers(4)


def upright(points: np.ndarray, triangles: np.ndarray) -> Grid:
    """The same triangles, counterclockwise; those without area left out."""
    area = triangle_areas(points, triangles)
    turned = np.where(area[:, None] < 0, triangles[:, ::-1], triangles)
    return points, turned[area != 0]


def cut_in_four(coarse: Grid) -> Grid:
    """All nodes and edges are shared."""
    fine = MeshTri(coarse[0].T.copy(), coarse[1].T.copy()).refined()
    return upright(fine.p.T.copy(), fine.t.T.copy())


def aside(old: Grid, distance: float) -> Grid:
    """Inner nodes moved by no more than ``distance``: all edges cross at grazing angles."""
    points = old[0].copy()
    inner = (points > 0).all(axis=1) & (points < [ENDS[1], WIDTH]).all(axis=1)
    points[inner] += np.random.default_rng(5).uniform(-distance, distance, (inner.sum(), 2))
    return points, old[1]


def slivers(seed: int) -> Grid:
    """Delaunay triangles of random nodes, some of them next to the rim."""
    random = np.random.default_rng(seed)
    inner = random.uniform([1.0, 1.0], [ENDS[1] - 1, WIDTH - 1], (60, 2))
    inner[:6, 1], inner[6:12, 0] = SLIVER, ENDS[1] - SLIVER
    corners = np.array([[x, y] for x in ENDS for y in (0.0, WIDTH)])
    points = np.vstack([corners, inner])
    return upright(points, Delaunay(points).simplices)


def integral(mesh: Grid, field: np.ndarray, weight=lambda x, y: 1 + 0 * x) -> float:
    """Integral of a nodal field (N,) times weight(x, y), exact where the weight is a polynomial of degree five."""
    where, area, shape = meshes.quadrature(*mesh)
    values = np.einsum("qa,ta->tq", shape, field[mesh[1]])
    return float(np.sum(area * values * weight(where[..., 0], where[..., 1])))


def square(mesh: Grid, field: np.ndarray) -> float:
    """Integral of the square of a nodal field (N,)."""
    _, area, shape = meshes.quadrature(*mesh)
    return float(np.sum(area * np.einsum("qa,ta->tq", shape, field[mesh[1]]) ** 2))


def curved_weights(nodes: np.ndarray, barycentric: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """(t, q) um2, weights of a quadrature on triangles with nodes (t, 6, 2): corners, then middles of 01, 12 and 20, as
    scikit-fem has them; barycentric: (q, 3) the points."""
    by = [ELEMENTS[2].lbasis(barycentric[:, 1:].T, k)[1] for k in range(6)]
    return np.linalg.det(np.einsum("tai,akq->tqik", nodes, by)) * weights


def sample(space: Space, values: np.ndarray, where: np.ndarray) -> np.ndarray:
    """A field (count, ...) at places (K, 2) by scikit-fem's mesh and maps; each place is tried in the NEAR triangles
    with the nearest middles. The field's nodes are known by where they are."""
    mapping, element = _fem(space.mesh).mapping(), ELEMENTS[space.order]
    middles = mapping.F(np.full((2, 1), 1 / 3))[:, :, 0].T
    cells = cKDTree(middles).query(where, k=NEAR)[1]
    local = np.stack([_local(mapping, where, cell) for cell in cells.T], axis=1)
    depth = np.minimum(local.min(axis=2), 1 - local.sum(axis=2))
    best = depth.argmax(axis=1)[:, None]
    if np.take_along_axis(depth, best, axis=1).min() < -1e-6:
        raise ValueError("a place lies in none of the triangles near it")
    cell = np.take_along_axis(cells, best, axis=1)[:, 0]
    place = np.take_along_axis(local, best[..., None], axis=1)[:, 0]
    nodes = mapping.F(np.asarray(element.doflocs).T, tind=cell)
    numbers = cKDTree(space.points).query(np.moveaxis(nodes, 0, 2))[1]
    shape = [element.lbasis(place.T, k)[0] for k in range(numbers.shape[1])]
    return np.einsum("ka,ka...->k...", np.column_stack(np.broadcast_arrays(*shape)), values[numbers])


def _local(mapping, where: np.ndarray, cell: np.ndarray) -> np.ndarray:
    """(K, 2) on the unit triangle, by Newton's method on scikit-fem's map; far outside where that fails."""
    local = np.full((len(where), 2), 1 / 3)
    for _ in range(20):
        apart = mapping.F(local.T[:, :, None], tind=cell)[:, :, 0].T - where
        inverse = mapping.invDF(local.T[:, :, None], tind=cell)[..., 0]
        local = np.clip(local - np.einsum("ijk,kj->ki", inverse, apart), -2.0, 3.0)
    return np.where(np.abs(apart).max(axis=1, keepdims=True) < 1e-9, local, -9.0)


def _fem(mesh: Mesh) -> MeshTri:
    """The mesh of scikit-fem, whose middles have numbers of their own."""
    corners = mesh.points[: mesh.corners]
    found = MeshTri(corners.T.copy(), mesh.triangles.T.copy(), sort_t=False)
    if mesh.geometry == 1:
        return found
    found = MeshTri2.from_mesh(found)
    ours = cKDTree(mesh.with_middles(corners)).query(found.doflocs.T)[1]
    return MeshTri2(mesh.points[ours].T.copy(), found.t)
