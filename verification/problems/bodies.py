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
from repro.fem.mesh import Mesh
from repro.fem.outline import FREE, Outline
from repro.fem.space import Space
from repro.model import growth, pore
from repro.model.contact import constrained
from verification.evidence.cases import combined
from verification.evidence.checks import largest
from verification.problems import meshes

#: Radius of the half-discs (um), and the factor by which theta is raised at a time.
RADIUS, FACTOR = 20.0, 1.5
LENGTH, HEIGHT = 10.0, 7.0
#: Kinds, by label: the curved ones, and every one.
CURVED = combined({"curved": 2, "curved, of cubic scenes": 3})
EVERY = combined({"straight": 1}) | CURVED
#: Ends of the mesh around a half-disc, at either side of it (um).
ENDS = {1: 60.0, 2: 95.0, 3: 95.0}
#: Degree of the quadrature of norms, and how far middles of inner edges are moved at random (of the elements' size).
DEGREE, BENT = 6, 0.075


@dataclass(frozen=True, eq=False)
class Supported(growth.Body):
    """A body in its reference configuration, and which coordinates are held, (n, 2)."""

    held: np.ndarray

    @property
    def cells(self) -> np.ndarray:
        """(t, 3 or 6) nodes."""
        return self.shape.cells

    @property
    def geometry(self) -> int:
        """1: straight; 2: curved."""
        return self.shape.geometry

    @property
    def corners(self) -> int:
        """How many nodes are corners."""
        return self.shape.corners

    def field(self, function: Callable) -> np.ndarray:
        """(t, q) of a function of X and Y at t = 0 where growth is taken."""
        where, weight = meshes.places(self.reference[self.cells], self.shape.table)
        return np.broadcast_to(function(*np.moveaxis(where, 2, 0)), weight.shape).astype(float)

    def constant(self, value: float) -> np.ndarray:
        """(t, q) of one value."""
        return self.field(lambda x, y: value)

    @property
    def resting(self) -> np.ndarray:
        """(corners,) no pressure."""
        return np.zeros(self.corners)


def on_mesh(grid: Mesh, kind: int, *held: np.ndarray) -> Supported:
    """The aggregate of a mesh at t = 0, as scenes have it; held: (n,) its nodes whose x is, and whose y is."""
    whole = pore.material(Space(grid, kind), grid.points[grid.body])
    return Supported(whole.shape, whole.reference, np.column_stack(held))


def on_wall(grid: Mesh, kind: int, outline: Outline) -> tuple[Supported, np.ndarray]:
    """(body, nodes of its free rim without the corners (M,)): the aggregate of a mesh at t = 0, which slides on the
    walls, its fixed points held."""
    rim = grid.topology.body_loop
    held = constrained(len(grid.body), rim, outline.wall, outline.fixed)
    return on_mesh(grid, kind, *held.T), rim[outline.wall == FREE]


@cache
def half_disc(refinement: float, kind: int = 1) -> tuple[Supported, np.ndarray]:
    """:func:`on_wall` of a half-disc, its middle fixed, in a mesh of the package's own."""
    seed = meshes.seed(RADIUS, refinement, kind)
    grid, outline = meshes.around(seed, refinement, (-ENDS[kind], ENDS[kind]), 50.0)
    return on_wall(grid, kind, outline)


@cache
def rectangle(size: float, seed: int, kind: int = 1, length: float = LENGTH, height: float = HEIGHT,
              bent: float = BENT):
    """(mesh, nodes of each side {name: (n,)}) of a random mesh of LENGTH x HEIGHT um; middles of the inner edges of
    curved triangles are moved at random by a part of the elements' size."""
    straight = meshes.channel((0.0, length), height, size, lambda x, y: x >= 0, seed=seed)
    grid = meshes.space_on(straight, kind).mesh
    points = grid.points.copy()
    x, y = grid.points.T
    sides = {"left": x == 0, "right": x == length, "bottom": y == 0, "top": y == height}
    rim = np.any([*sides.values()], axis=0)
    inner = np.flatnonzero(~rim & (np.arange(len(x)) >= grid.corners))
    points[inner] += bent * size * np.random.default_rng(seed + 1).uniform(-1, 1, (len(inner), 2))
    return grid.moved(points).checked(), sides


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

    def at(self, x, y) -> tuple[np.ndarray, np.ndarray]:
        """Place and pressure."""
        return self.place(x, y), self.pressure(x, y)


def size(held: Supported) -> float:
    """Side of the square of mean triangle area twice over, um."""
    return np.sqrt(2 * held.at.dx.sum() / len(held.cells))


def grown(held: Supported, theta: np.ndarray, path: Callable | None = None, factor: float = FACTOR
          ) -> growth.Equilibrium:
    """Equilibrium under theta (t, q), raised by a factor at a time; ``path(part)`` are the prescribed places (n, 2)
    under theta^part, those of t = 0 if there is none."""
    position, pressure = held.reference, held.resting
    parts = max(1, int(np.ceil(largest(np.log(theta)) / np.log(factor))))
    for part in np.arange(1, parts + 1) / parts:
        prescribed = path(part) if path else held.reference
        found = growth.equilibrium(held, theta**part, position, pressure, held.held, prescribed)
        position, pressure = found.position, found.pressure
    return found


def system(held: Supported, position: np.ndarray, pressure: np.ndarray, theta: np.ndarray) -> growth.System:
    """The equations of a body under theta, nothing prescribed, at places (n, 2) and pressures (corners,); on straight
    triangles stabilised as at that shape of expansion theta."""
    stabilising = None
    if held.geometry == 1:
        stabilising = growth.gradient_stabilisation(position, held.cells, theta[:, 0])
    found = growth.System(held, np.zeros_like(held.held), stabilising=stabilising)
    found.under(theta, position, position, pressure)
    return found


def integrated(held: Supported) -> tuple[np.ndarray, np.ndarray, elements.Table]:
    """Where norms are taken: X, Y (t, q, 2), weights (t, q) um2 and the table."""
    of = elements.table(held.geometry, held.geometry, DEGREE)
    return *meshes.places(held.reference[held.cells], of), of


def errors(held: Supported, found: growth.Equilibrium, exact: Callable, chosen=slice(None)) -> dict[str, float]:
    """Size of the elements; L2 over the body at t = 0, or over its triangles ``chosen``, of places (..., 2) and
    pressures (...) less exact(X, Y), both of them, over that of these."""
    where, weight, of = integrated(held)
    place, pressure = exact(*np.moveaxis(where[chosen], 2, 0))
    cells, weight = held.cells[chosen], weight[chosen]
    return {"size": size(held), "place": meshes.relative(of.values @ found.position[cells], place, weight),
            "pressure": meshes.relative(found.pressure[cells[:, :3]] @ of.linear.T, pressure, weight)}


def equilibrium(held: Supported, theta: np.ndarray, start: np.ndarray, forces: np.ndarray | None = None
                ) -> growth.Equilibrium:
    """Equilibrium under theta (t, q) and nodal forces (n, 2), over mu_L, that do not depend on the shape, from places
    (n, 2) near it with the held ones on their targets, and without pressure. Raises GrowthError where there is none."""
    return growth.equilibrium(held, theta, start, held.resting, held.held, start, forces=forces)


def body_force(held: Supported, density) -> np.ndarray:
    """(n, 2) nodal forces of a force density(X, Y) (..., 2) per area of t = 0."""
    where, weight, of = integrated(held)
    local = np.einsum("tq,qa,tqi->tai", weight, of.values, density(*np.moveaxis(where, 2, 0)))
    return _summed(held, held.cells, local)


def traction(held: Supported, grid: Mesh, stress) -> np.ndarray:
    """(n, 2) nodal forces of S N per length of t = 0, stress(X, Y) (..., 2, 2) or (2, 2), on the straight right end of
    the rectangle ``grid`` that is the whole body."""
    order = held.geometry
    edges = grid.topology.dofs(order).outlet
    _, weights, shape = meshes.along_edges(order, 5)
    where = np.einsum("qa,eai->eqi", shape, held.reference[edges])
    length = np.ptp(held.reference[edges, 1], axis=1)
    pull = np.broadcast_to(stress(*np.moveaxis(where, 2, 0))[..., 0], where.shape)
    return _summed(held, edges, np.einsum("e,q,qa,eqi->eai", length, weights, shape, pull))


def _summed(held: Supported, nodes: np.ndarray, local: np.ndarray) -> np.ndarray:
    """(n, 2) sums at nodes (k, a) of local forces (k, a, 2)."""
    total = np.zeros_like(held.reference)
    np.add.at(total, nodes, local)
    return total
