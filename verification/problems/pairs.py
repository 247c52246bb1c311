"""Pairs of meshes of one rectangle for each relation that a transfer must handle, and norms on meshes."""

from collections.abc import Iterator

import numpy as np
from scipy.spatial import Delaunay
from skfem import ElementTriP2, MeshTri

from verification.problems import meshes
from verification.problems.meshes import upright

ENDS, WIDTH = (0.0, 40.0), 25.0
#: Displacements (um) of nodes, and the distance (um) of nodes from the rim that makes slivers of this width.
ASIDE, SLIVER = (1e-14, 1e-9, 1e-4), 1e-6
Grid = tuple[np.ndarray, np.ndarray]


def grid(size: float, seed: int) -> Grid:
    """Points and triangles of a random mesh."""
    return meshes.rectangle(ENDS, WIDTH, size, seed=seed)


def pairs() -> Iterator[tuple[str, Grid, Grid]]:
    """(relation of the meshes, old mesh, new mesh)."""
    first, other = grid(5.0, 1), grid(4.0, 2)
    yield "unrelated", first, other
    yield "the same, in another order", first, (first[0], np.roll(first[1], 1, axis=1)[::-1])
    yield "every triangle cut in four", first, cut_in_four(first)
    yield "four triangles made one", cut_in_four(first), first
    for distance in ASIDE:
        yield f"nodes {distance:g} um aside", first, aside(first, distance)
    yield "slivers on slivers", slivers(3), slivers(4)


def cut_in_four(coarse: Grid) -> Grid:
    """Each triangle cut in four. The meshes share all nodes and edges."""
    fine = MeshTri(coarse[0].T.copy(), coarse[1].T.copy()).refined()
    return upright(fine.p.T.copy(), fine.t.T.copy())


def aside(old: Grid, distance: float) -> Grid:
    """The mesh with inner nodes moved by at most ``distance``. All edges cross at grazing angles."""
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
    """Integral of a nodal field (N,) times weight(x, y), exact for polynomial weights of degree five."""
    where, area, shape = meshes.quadrature(*mesh)
    return np.sum(area * (field[mesh[1]] @ shape.T) * weight(*np.moveaxis(where, 2, 0)))


def square(mesh: Grid, field: np.ndarray) -> float:
    """Integral of the square of a nodal field (N,)."""
    _, area, shape = meshes.quadrature(*mesh)
    return np.sum(area * (field[mesh[1]] @ shape.T) ** 2)


def curved_weights(nodes: np.ndarray, barycentric: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """(t, q) um2, weights of a quadrature at barycentric points (q, 3) on triangles with nodes (t, 6, 2).

    The nodes are the corners, then the middles of 01, 12 and 20, as in scikit-fem.
    """
    gradients = [ElementTriP2().lbasis(barycentric[:, 1:].T, k)[1] for k in range(6)]
    return np.linalg.det(np.einsum("tai,akq->tqik", nodes, gradients)) * weights
