"""Growth mechanics (2.3) with quadratic places and a linear pressure (Taylor-Hood); as :mod:`repro.model.growth`.

Pi without the stabilisation, which a stable pair does not need: the residual is

    (S(F, P), grad v) = 0,        (q, J - theta) = 0    for every linear q

with P + gamma theta^(-5/3) (J - theta) for P in S. The last term (grad-div stabilisation) vanishes where J = theta. It
is needed: at a given shape the energy of plane expansion is J^(1/3) + J^(-2/3) / 2, which is concave, and what the
linear pressure leaves free of J would grow from nothing.

integrated over the curved triangles of t = 0. theta = J_r e: the exact J of the reference, the shape in which the mesh
was made, where it is integrated, times the expansion e since then, a quadratic nodal field that starts at one.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import numpy as np

from repro.curved import elements
from repro.fem.assembly import ElementSystem, each, saddle_blocks, saddle_system
from repro.model.growth import Equilibrium, Strained, reach, refuse_turned_over
from repro.timing import timed

#: gamma: the energy's curvature in J is -2/9 J^(-5/3) and less, so that one makes it convex with room to spare.
GAMMA = 1.0
#: theta goes to its target in parts of at most this factor: a longer step of Newton's method may end in another
#: equilibrium, with a wrinkled surface.
FACTOR = 1.2


@dataclass(frozen=True, eq=False)
class Body:
    """The aggregate's own mesh.

    origin, reference: (n, 2) um at t = 0 and when the mesh was made, corners first; cells: (t, 6); corners: how many;
    held: (n, 2) True where a coordinate is prescribed; topology: what is worked out once for this mesh; reused: does
    Newton's method use its derivative again?
    """

    origin: np.ndarray
    reference: np.ndarray
    cells: np.ndarray
    corners: int
    held: np.ndarray
    topology: dict = field(default_factory=dict, repr=False)
    reused: bool = False

    @property
    def sparse(self) -> ElementSystem:
        """The sparse system of places and pressure."""
        if "growth" not in self.topology:
            self.topology["growth"] = saddle_system(self.cells, self.cells[:, :3], self.held)
        held = np.concatenate([self.held[:, 0], self.held[:, 1], np.zeros(self.corners, bool)])
        found = self.topology["growth"]
        return found if np.array_equal(found.held, held) else found.holding(held)

    @property
    def places(self) -> elements.Places:
        """Weights and gradients of t = 0."""
        if "origin" not in self.topology:
            self.topology["origin"] = elements.places(self.origin[self.cells])
        return self.topology["origin"]

    @property
    def weighted(self) -> np.ndarray:
        """(t, 2 q, 6) um, its gradients times weights."""
        if "weighted" not in self.topology:
            self.topology["weighted"] = self.places.weighted
        return self.topology["weighted"]

    @property
    def expanded(self) -> np.ndarray:
        """(t, q) J of the reference."""
        if "expanded" not in self.topology:
            self.topology["expanded"] = elements.places(self.reference[self.cells]).dx / self.places.dx
        return self.topology["expanded"]


def of(pore, held: np.ndarray | None = None, reused: bool = False) -> Body:
    """The aggregate of a pore; held: (n, 2), nothing by default; reused: as :class:`Body`'s."""
    grid, nodes = pore.mesh, pore.mesh.body
    held = np.zeros((len(nodes), 2), bool) if held is None else held
    return Body(pore.origin[nodes], pore.reference[nodes], grid.body_cells, int(np.searchsorted(nodes, grid.corners)),
                held, grid.once("growth", dict), reused)


class Last:
    """A function of one array, its last result kept until another array is asked for; arrays do not change in place.
    """

    def __init__(self, function: Callable[[np.ndarray], Any]):
        self.function = function
        self.of: Any = None
        self.found: Any = None

    def __call__(self, array: np.ndarray) -> Any:
        if self.of is not array:
            self.of, self.found = array, self.function(array)
        return self.found


def _deformed(at: elements.Places, cells: np.ndarray, position: np.ndarray) -> Strained:
    """F[i, K] = d x_i / d X_K (t, q, 2, 2) of triangles (t, 6) at positions (n, 2), and what goes with it."""
    slopes = np.swapaxes(position[cells], 1, 2) @ np.swapaxes(at.rows, 1, 2)
    count, points = at.dx.shape
    return Strained(elements.by_component(slopes.reshape(count, 2, points, 2).transpose(1, 3, 0, 2)))


class System:
    """Residual and tangent for one body, in the shape that :func:`repro.model.growth.reach` asks for."""

    def __init__(self, body: Body):
        self.body, self.sparse = body, body.sparse
        self.at = body.places
        self.unknowns, self.free = self.sparse.kinds[0], self.sparse.free
        self.weighted = body.weighted
        self.deformed = Last(partial(_deformed, self.at, body.cells))
        self._grad_div = Last(lambda theta: GAMMA * theta ** (-5 / 3))
        self._sized: tuple[Any, Any] = None, None

    def _pressed(self, position, pressure, theta) -> tuple[Strained, np.ndarray]:
        """The deformation, and P with its stabilisation (t, q)."""
        at = self.deformed(position)
        linear = pressure[self.body.cells[:, :3]] @ elements.LINEAR.T
        return at, linear + self._grad_div(theta) * (at.J - theta)

    def _forces(self, stress: np.ndarray, weighted: np.ndarray) -> np.ndarray:
        """(t, 2, 6) of the integral of stress (t, q, 2, 2) : grad v, weighted (t, 2 q, 6) being dx grad v."""
        return np.swapaxes(stress, 1, 2).reshape(len(stress), 2, -1) @ weighted

    def residual(self, position: np.ndarray, pressure: np.ndarray, theta: np.ndarray):
        """Residual [x of all nodes, y, then P of the corners] and the size of its terms where this theta (t, q) was
        first asked for."""
        at, P = self._pressed(position, pressure, theta)
        force, gap = self._forces(at.piola(P), self.weighted), (self.at.dx * (at.J - theta)) @ elements.LINEAR
        if self._sized[0] is not theta:
            terms = self._forces(at.A[..., None, None] * np.abs(at.F), np.abs(self.weighted))
            self._sized = theta, self._summed(terms, (self.at.dx * theta) @ elements.LINEAR)
        return self._summed(force, gap), self._sized[1]

    def _summed(self, force: np.ndarray, gap: np.ndarray) -> np.ndarray:
        """Of all triangles, from (t, 2, 6) and (t, 3)."""
        local = np.concatenate([force[:, 0], force[:, 1], gap], axis=1)
        return np.bincount(self.unknowns.ravel(), local.ravel(), len(self.sparse.held))

    def tangent(self, position: np.ndarray, pressure: np.ndarray, theta: np.ndarray) -> np.ndarray:
        """(t, 15, 15) symmetric element matrices of the residual's derivative."""
        at, P = self._pressed(position, pressure, theta)
        h, f, dx, PJ = self._pulled(at.H), self._pulled(at.F), self.at.dx, P * at.J
        both = 2 / 9 * at.A * at.trace + PJ + self._grad_div(theta) * at.J**2
        half = each(dx * both / 2, h) - each(2 / 3 * dx * at.A, f)
        swap = each(dx * (at.A * at.trace / 3 - PJ), h)
        found = np.swapaxes(h, 1, 2) @ np.concatenate([half, swap], axis=2)
        K = found[:, :, :12] + np.swapaxes(found[:, :, :12], 1, 2)
        exchanged = K.reshape(-1, 2, 6, 2, 6)  # the same memory
        exchanged += np.swapaxes(found[:, :, 12:].reshape(exchanged.shape), 1, 3)
        plain = np.swapaxes(self.at.rows, 1, 2) @ (np.repeat(at.A, 2, axis=1)[:, :, None] * self.weighted)
        exchanged[:, 0, :, 0] += plain
        exchanged[:, 1, :, 1] += plain
        B = elements.LINEAR.T @ each(dx * at.J, h)
        return saddle_blocks(K, -B)

    def _pulled(self, tensor: np.ndarray) -> np.ndarray:
        """(t, q, 12) a tensor (t, q, 2, 2) times grad N_a: component x for every node a, then y."""
        return (tensor @ self.at.slopes).reshape(*self.at.dx.shape, 12)

    def admissible(self, position: np.ndarray) -> bool:
        """Is det F > 0 wherever it is integrated?"""
        return bool(self.deformed(position).J.min() > 0)


@timed("growth")
def equilibrium(body: Body, theta: np.ndarray, position: np.ndarray, pressure: np.ndarray,
                prescribed: np.ndarray) -> Equilibrium:
    """Equilibrium under theta (n,) nodal since the reference; other arguments as :func:`repro.model.growth.equilibrium`'s."""
    system = System(body)
    start = system.deformed(position).J
    target = elements.at_points(theta, body.cells) * body.expanded
    refuse_turned_over(start, target)
    parts = int(np.ceil(np.abs(np.log(target / start)).max() / np.log(FACTOR)))
    return reach(system, start, target, position, pressure, prescribed, max(1, parts))
