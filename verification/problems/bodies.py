"""Bodies of the cases, of straight and of curved triangles; their growth from t = 0 in steps; norms over them.

A kind is the order of the elements of a scene: 1, straight triangles; 2 and 3, curved ones, integrated to degree 6, 8.

Dead loads on a body, the f0 and t0 of (20), as nodal forces of straight and of curved triangles.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

import numpy as np

from reference import neo_hookean
from repro.fem import elements
from repro.fem.mesh import Mesh, curved
from repro.fem.outline import FREE
from repro.fem.outline import half_disc as half_disc_outline
from repro.fem.sizing import ACROSS_AGGREGATE
from repro.fem.space import Space
from repro.model import growth, pore
from verification.problems import meshes

#: Radius of the half-discs (um), and the factor by which theta is raised at a time.
RADIUS, FACTOR = 20.0, 1.5
LENGTH, HEIGHT = 10.0, 7.0
KINDS = (1, 2, 3)
WORDS = {1: "straight", 2: "curved", 3: "curved, of cubic scenes"}
#: Every kind, by label.
EVERY = {WORDS[kind]: (kind,) for kind in KINDS}
#: Ends of the mesh around a half-disc, at either side of it (um).
ENDS = {1: 60.0, 2: 95.0, 3: 95.0}
#: Degree of the quadrature of norms, and how far middles of inner edges are moved at random (of the elements' size).
DEGREE, BENT = 6, 0.075


def moduli(F: np.ndarray, P: np.ndarray) -> np.ndarray:
    """(n, i, K, j, L) d S_iK / d F_jL over mu_L of deformations (n, 2, 2) with pressures (n,), S the first Piola
    stress: read from the element tangents of n unit triangles, whose second and third nodal function have unit vectors
    for gradients, and whose area is one half."""
    count = len(F)
    corners = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
    shape = growth.Shape(np.arange(3 * count).reshape(count, 3), 3 * count, elements.GRADIENT_DEGREES[1])
    body = growth.Body(shape, np.tile(corners, (count, 1)))
    system = growth.System(body, np.zeros((3 * count, 2), bool), stabilising=np.zeros((count, 3, 3)))
    position = (corners @ np.swapaxes(F, 1, 2)).reshape(-1, 2)
    found = system.tangent(position, np.repeat(P, 3))[:, :6, :6].reshape(count, 2, 3, 2, 3)
    return 2 * found[:, :, 1:, :, 1:]


@dataclass(frozen=True, eq=False)
class Supported:
    """A body in its reference configuration, and which coordinates are held, (n, 2)."""

    body: growth.Body
    held: np.ndarray

    @property
    def reference(self) -> np.ndarray:
        """(n, 2) um."""
        return self.body.reference

    @property
    def cells(self) -> np.ndarray:
        """(t, 3 or 6) nodes."""
        return self.body.shape.cells

    @property
    def geometry(self) -> int:
        """1: straight; 2: curved."""
        return self.body.shape.geometry

    @property
    def corners(self) -> int:
        """How many nodes are corners."""
        return self.body.shape.corners

    @property
    def points(self) -> np.ndarray:
        """(t, q, 2) um, where growth is taken, at t = 0."""
        return meshes.places(self.reference[self.cells], self.body.shape.table)[0]

    def field(self, function: Callable) -> np.ndarray:
        """(t, q) of a function of X and Y there."""
        return np.broadcast_to(function(*np.moveaxis(self.points, 2, 0)), self.body.at.dx.shape).astype(float)

    def constant(self, value: float) -> np.ndarray:
        """(t, q) of one value."""
        return np.full(self.body.at.dx.shape, float(value))

    @property
    def resting(self) -> np.ndarray:
        """(corners,) no pressure."""
        return np.zeros(self.corners)


def on_mesh(grid: Mesh, kind: int, reference: np.ndarray, held: np.ndarray) -> Supported:
    """The aggregate of a mesh, as scenes have it, with its nodes' places at t = 0 and what is held (n, 2)."""
    return Supported(pore.material(Space(grid, kind), reference), held)


@cache
def half_disc(refinement: float, kind: int = 1) -> tuple[Supported, np.ndarray]:
    """(body, nodes of its arc without the corners (M,)): a half-disc on the wall on which it slides, its middle fixed,
    in a mesh of the package's own."""
    geometry = min(kind, 2)
    seed = half_disc_outline(RADIUS, ACROSS_AGGREGATE * refinement, geometry)
    grid, outline = meshes.around(seed, refinement, (-ENDS[kind], ENDS[kind]), 50.0)
    rim, free = grid.topology.body_loop, outline.wall == FREE
    held = np.zeros((len(grid.body), 2), bool)
    held[rim[outline.fixed], 0] = True
    held[rim[~free], 1] = True
    return on_mesh(grid, kind, grid.points[grid.body], held), rim[free]


@cache
def rectangle(size: float, seed: int, kind: int = 1, length: float = LENGTH, height: float = HEIGHT,
              bent: float = BENT):
    """(mesh, nodes of each side {name: (n,)}) of a random mesh of LENGTH x HEIGHT um; middles of the inner edges of
    curved triangles are moved at random by a part of the elements' size."""
    grid = meshes.channel((0.0, length), height, size, lambda x, y: x >= 0, seed=seed)
    if kind > 1:
        grid = _bent(curved(grid, None), bent * size, seed)
    x, y = grid.points.T
    return grid, {"left": x == 0, "right": x == length, "bottom": y == 0, "top": y == height}


def _bent(grid: Mesh, most: float, seed: int) -> Mesh:
    (left, low), (right, high) = grid.points.min(axis=0), grid.points.max(axis=0)
    x, y = grid.points.T
    rim = (x == left) | (x == right) | (y == low) | (y == high)
    inner = np.flatnonzero((np.arange(len(x)) >= grid.corners) & ~rim)
    points = grid.points.copy()
    points[inner] += np.random.default_rng(seed + 1).uniform(-most, most, (len(inner), 2))
    return grid.moved(points).checked()


@dataclass(frozen=True)
class HalfCylinder:
    """Closed forms of a half-disc of RADIUS that grows by theta = inner + (outer - inner) (R / RADIUS)^2."""

    inner: float
    outer: float

    def theta(self, x, y):
        """Of what was at X, Y."""
        return self.inner + (self.outer - self.inner) * (x**2 + y**2) / RADIUS**2

    def radius(self, R):
        """um, of what was at R."""
        return neo_hookean.cylinder_radius(R, self.inner, self.outer - self.inner, RADIUS)

    def place(self, x, y) -> np.ndarray:
        """(..., 2) um."""
        R = np.maximum(np.hypot(x, y), 1e-12)
        return np.stack([x, y], axis=-1) * (self.radius(R) / R)[..., None]

    def pressure(self, x, y) -> np.ndarray:
        """P over mu_L; the middle takes what is beside it."""
        R = np.maximum(np.hypot(x, y), 1e-6 * RADIUS)
        flat = neo_hookean.cylinder_pressure(R.ravel(), self.inner, self.outer - self.inner, RADIUS)
        return flat.reshape(np.shape(R))


def size(held: Supported) -> float:
    """Side of the square of mean triangle area twice over, um."""
    return np.sqrt(2 * held.body.at.dx.sum() / len(held.cells))


def grown(held: Supported, theta: np.ndarray, path: Callable | None = None, factor: float = FACTOR
          ) -> growth.Equilibrium:
    """Equilibrium under theta (t, q), raised by a factor at a time; ``path(part)`` are the prescribed places (n, 2)
    under theta^part, those of t = 0 if there is none."""
    position, pressure = held.reference, held.resting
    parts = max(1, int(np.ceil(np.log(max(theta.max(), 1 / theta.min())) / np.log(factor))))
    for part in np.arange(1, parts + 1) / parts:
        prescribed = path(part) if path else held.reference
        found = growth.equilibrium(held.body, theta**part, position, pressure, held.held, prescribed)
        position, pressure = found.position, found.pressure
    return found


def system(held: Supported, position: np.ndarray, theta: np.ndarray) -> growth.System:
    """The equations of a body, nothing prescribed; on straight triangles stabilised as at a last known shape
    ``position`` (n, 2) of expansion theta."""
    stabilising = None
    if held.geometry == 1:
        stabilising = growth.gradient_stabilisation(position, held.cells, theta[:, 0])
    return growth.System(held.body, np.zeros_like(held.held), stabilising=stabilising)


def integrated(held: Supported) -> tuple[np.ndarray, np.ndarray, elements.Table]:
    """Where norms are taken: X, Y (t, q, 2), weights (t, q) um2 and the table."""
    of = elements.table(held.geometry, held.geometry, DEGREE)
    return *meshes.places(held.reference[held.cells], of), of


def place_error(held: Supported, position: np.ndarray, exact: Callable) -> float:
    """L2 over the body at t = 0 of places (n, 2) less exact(X, Y) (..., 2), over that of exact."""
    where, weight, of = integrated(held)
    return meshes.distance((where, weight, of.values), position[held.cells], exact)


def pressure_error(held: Supported, pressure: np.ndarray, exact: Callable, chosen=slice(None)) -> float:
    """L2 over the body at t = 0, or over its triangles ``chosen``, of pressures (corners,) less exact(X, Y)."""
    where, weight, of = integrated(held)
    return meshes.distance((where[chosen], weight[chosen], of.linear), pressure[held.cells[chosen, :3]], exact)


def equilibrium(held: Supported, theta: np.ndarray, forces: np.ndarray, start: np.ndarray) -> growth.Equilibrium:
    """Equilibrium under theta (t, q) and nodal forces (n, 2), over mu_L, that do not depend on the shape, from places
    (n, 2) near it with the held ones on their targets, and without pressure. Raises GrowthError where there is none."""
    return growth.equilibrium(held.body, theta, start, held.resting, held.held, start, forces=forces)


def body_force(held: Supported, density) -> np.ndarray:
    """(n, 2) nodal forces of a force density(X, Y) (..., 2) per area of t = 0."""
    where, weight, of = integrated(held)
    local = np.einsum("tq,qa,tqi->tai", weight, of.values, density(*np.moveaxis(where, 2, 0)))
    return _summed(held.cells, local, len(held.reference))


def traction(held: Supported, grid: Mesh, stress) -> np.ndarray:
    """(n, 2) nodal forces of S N per length of t = 0, stress(X, Y) (..., 2, 2), on the straight right end of the
    rectangle ``grid`` that is the whole body."""
    order = held.geometry
    edges = grid.topology.dofs(order).outlet
    _, weights, shape = meshes.along_edges(order, 5)
    where = np.einsum("qa,eai->eqi", shape, held.reference[edges])
    length = held.reference[edges[:, -1], 1] - held.reference[edges[:, 0], 1]
    pull = stress(where[..., 0], where[..., 1])[..., 0]
    return _summed(edges, np.einsum("e,q,qa,eqi->eai", length, weights, shape, pull), len(held.reference))


def _summed(nodes: np.ndarray, local: np.ndarray, count: int) -> np.ndarray:
    """(count, 2) sums at nodes (k, a) of local forces (k, a, 2)."""
    return np.column_stack([np.bincount(nodes.ravel(), local[..., i].ravel(), count) for i in (0, 1)])
