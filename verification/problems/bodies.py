"""Bodies of straight or curved triangles, their growth from t = 0 in steps, norms over them, and dead loads.

A kind is the order of the elements of a scene. Kind 1 has straight triangles. Kinds 2 and 3 have curved triangles, with
quadratures of degree 6 and 8. The dead loads are f0 and t0 of (20), as nodal forces.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

import numpy as np

from reference import neo_hookean
from repro.fem import elements
from repro.fem.mesh import Mesh
from repro.fem.outline import Outline
from repro.fem.space import Space
from repro.fem.walls import FREE
from repro.model import growth, mechanics
from repro.model.energies import NEO_HOOKEAN
from repro.model.solid import Solid, material
from verification.evidence.cases import combined
from verification.evidence.checks import largest
from verification.problems import meshes

#: Radius of the half-discs (um), and the largest factor of theta in one step.
RADIUS, FACTOR = 20.0, 1.5
LENGTH, HEIGHT = 10.0, 7.0
#: Kinds by label.
EVERY = combined({"straight": 1, "curved": 2})
#: Distance (um) from the middle of a half-disc to both ends of its mesh.
ENDS = {1: 60.0, 2: 95.0}
#: Degree of the quadrature of norms, and the random displacement of the middles of inner edges over the element size.
DEGREE, BENT = 6, 0.075


@dataclass(frozen=True, eq=False)
class Supported(Solid):
    """A body in its reference configuration; constrained (n, 2) is True where a coordinate is prescribed."""

    constrained: np.ndarray

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
        """Number of corner nodes."""
        return self.shape.corners

    def field(self, function: Callable) -> np.ndarray:
        """(t, q) values of a function of X and Y at t = 0, at the quadrature points of growth."""
        where, weight = meshes.quadrature_points(self.reference[self.cells], self.shape.table)
        return np.broadcast_to(function(*np.moveaxis(where, 2, 0)), weight.shape).astype(float)

    def constant(self, value: float) -> np.ndarray:
        """(t, q) array of one value."""
        return self.field(lambda x, y: value)

    @property
    def resting(self) -> np.ndarray:
        """(corners,) zero pressure."""
        return np.zeros(self.corners)


def on_mesh(grid: Mesh, *constrained: np.ndarray) -> Supported:
    """The aggregate of a mesh at t = 0. constrained: (n,) nodes with prescribed x, then nodes with prescribed y."""
    aggregate = material(Space(grid), grid.regions[0], grid.points[grid.body], NEO_HOOKEAN)
    return Supported(aggregate.shape, aggregate.reference, np.column_stack(constrained))


def on_wall(grid: Mesh, outline: Outline) -> tuple[Supported, np.ndarray]:
    """The aggregate of a mesh at t = 0, which slides on the walls with its fixed points at rest.

    Also return the nodes (M,) of its free rim without the contact lines.
    """
    rim = grid.regions[0].own_loop
    supports = mechanics.constrained(len(grid.body), rim, outline.wall, outline.fixed)
    return on_mesh(grid, *supports.T), rim[outline.wall == FREE]


@cache
def half_disc(refinement: float, kind: int = 1) -> tuple[Supported, np.ndarray]:
    """:func:`on_wall` of a half-disc with a fixed middle, on a mesh of the package."""
    seed = meshes.seed(RADIUS, refinement, kind)
    grid, outline = meshes.around(seed, refinement, (-ENDS[kind], ENDS[kind]), 50.0)
    return on_wall(grid, outline)


@cache
def rectangle(size: float, seed: int, kind: int = 1, length: float = LENGTH, height: float = HEIGHT,
              bent: float = BENT):
    """A random mesh of LENGTH x HEIGHT um, and the nodes of each side {name: (n,)}.

    The middles of inner edges of curved triangles are moved at random by a part of the element size.
    """
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
        """theta of the material point X, Y."""
        return self.inner + (self.outer - self.inner) * (x**2 + y**2) / RADIUS**2

    def radius(self, R):
        """Radius (um) of the material point at R."""
        return neo_hookean.cylinder_radius(R, self.inner, self.outer - self.inner, RADIUS)

    def place(self, x, y) -> np.ndarray:
        """(..., 2) um, the position of the material point X, Y."""
        R = np.maximum(np.hypot(x, y), 1e-12)
        return np.stack([x, y], axis=-1) * (self.radius(R) / R)[..., None]

    def pressure(self, x, y) -> np.ndarray:
        """P over mu_L. The value in the middle is that beside it."""
        R = np.maximum(np.hypot(x, y), 1e-6 * RADIUS)
        flat = neo_hookean.cylinder_pressure(R.ravel(), self.inner, self.outer - self.inner, RADIUS)
        return flat.reshape(np.shape(R))

    def at(self, x, y) -> tuple[np.ndarray, np.ndarray]:
        """(..., 2) um and P over mu_L, at the material point X, Y."""
        return self.place(x, y), self.pressure(x, y)


def size(body: Supported) -> float:
    """Element size (um): the root of twice the mean triangle area."""
    return np.sqrt(2 * body.at.dx.sum() / len(body.cells))


def grow(body: Supported, theta: np.ndarray, path: Callable | None = None, factor: float = FACTOR
          ) -> growth.Equilibrium:
    """Equilibrium under theta (t, q), reached in steps that raise theta by at most ``factor``.

    ``path(part)`` gives the prescribed positions (n, 2) under theta^part. By default they are those of t = 0.
    """
    position, pressure = body.reference, body.resting
    parts = max(1, int(np.ceil(largest(np.log(theta)) / np.log(factor))))
    for part in np.arange(1, parts + 1) / parts:
        prescribed = path(part) if path else body.reference
        solution = growth.equilibrium(body, theta**part, position, pressure, body.constrained, prescribed)
        position, pressure = solution.position, solution.pressure
    return solution


def system(body: Supported, position: np.ndarray, pressure: np.ndarray, theta: np.ndarray) -> growth.System:
    """The equations of a free body under theta, at positions (n, 2) and pressures (corners,).

    On straight triangles the stabilisation is that of this shape.
    """
    stabilisation: growth.PressureGradient | growth.GradDiv = growth.GradDiv()
    if body.geometry == 1:
        stabilisation = growth.PressureGradient(growth.gradient_stabilisation(position, body.cells, theta[:, 0]))
    equations = growth.System(body, np.zeros_like(body.constrained), stabilisation=stabilisation)
    equations.under(theta, position, position, pressure)
    return equations


def norm_points(body: Supported) -> tuple[np.ndarray, np.ndarray, elements.Table]:
    """Quadrature of norms: points X, Y (t, q, 2), weights (t, q) um2 and the table."""
    of = elements.table(body.geometry, DEGREE)
    return *meshes.quadrature_points(body.reference[body.cells], of), of


def errors(body: Supported, solution: growth.Equilibrium, exact: Callable, chosen=slice(None)) -> dict[str, float]:
    """Element size, and relative L2 errors of positions and pressures against exact(X, Y).

    The norm is over the body at t = 0, or over its triangles ``chosen``. ``exact`` gives both fields.
    """
    where, weight, of = norm_points(body)
    place, pressure = exact(*np.moveaxis(where[chosen], 2, 0))
    cells, weight = body.cells[chosen], weight[chosen]
    return {"size": size(body), "place": meshes.relative(of.values @ solution.position[cells], place, weight),
            "pressure": meshes.relative(solution.pressure[cells[:, :3]] @ of.linear.T, pressure, weight)}


def equilibrium(body: Supported, theta: np.ndarray, start: np.ndarray, forces: np.ndarray | None = None
                ) -> growth.Equilibrium:
    """Equilibrium under theta (t, q) and dead nodal forces (n, 2), over mu_L.

    Newton's method starts without pressure, from positions (n, 2) near the solution with the prescribed ones in place.
    Raises GrowthError if it does not converge.
    """
    return growth.equilibrium(body, theta, start, body.resting, body.constrained, start, forces=forces)


def body_force(body: Supported, density) -> np.ndarray:
    """(n, 2) nodal forces of a force density(X, Y) (..., 2) per area at t = 0."""
    where, weight, of = norm_points(body)
    local = np.einsum("tq,qa,tqi->tai", weight, of.values, density(*np.moveaxis(where, 2, 0)))
    return _assemble(body, body.cells, local)


def traction(body: Supported, grid: Mesh, stress) -> np.ndarray:
    """(n, 2) nodal forces of S N per length at t = 0 on the straight right end of a rectangular body.

    stress(X, Y): S (..., 2, 2) or (2, 2); grid: the mesh, all of which is the body.
    """
    edges = grid.topology.dofs.outlet
    _, weights, shape = meshes.along_edges(body.geometry, 5)
    where = np.einsum("qa,eai->eqi", shape, body.reference[edges])
    length = np.ptp(body.reference[edges, 1], axis=1)
    pull = np.broadcast_to(stress(*np.moveaxis(where, 2, 0))[..., 0], where.shape)
    return _assemble(body, edges, np.einsum("e,q,qa,eqi->eai", length, weights, shape, pull))


def _assemble(body: Supported, nodes: np.ndarray, local: np.ndarray) -> np.ndarray:
    """(n, 2) sums of local forces (k, a, 2) at their nodes (k, a)."""
    total = np.zeros_like(body.reference)
    np.add.at(total, nodes, local)
    return total
