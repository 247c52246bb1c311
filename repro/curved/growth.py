"""Growth mechanics (2.3) with quadratic places and a linear pressure (Taylor-Hood); as :mod:`repro.growth`.

Pi without the stabilisation, which a stable pair does not need: the residual is

    (S(F, P), grad v) = 0,        (q, J - theta) = 0    for every linear q

with P + gamma theta^(-5/3) (J - theta) for P in S. The last term (grad-div stabilisation) vanishes where J = theta. It
is needed: at a given shape the energy of plane expansion is J^(1/3) + J^(-2/3) / 2, which is concave, and what the
linear pressure leaves free of J would grow from nothing.

integrated over the curved triangles of t = 0. theta = J_r e: the exact J of the reference, the shape in which the mesh
was made, where it is integrated, times the expansion e since then, a quadratic nodal field that starts at one.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from repro.assembly import ElementSystem, saddle_blocks, saddle_system
from repro.curved import elements
from repro.growth import Equilibrium, inverse_transpose, piola, reach, refuse_turned_over, tangent
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


class System:
    """Residual and tangent for one body, in the shape that :func:`repro.growth.reach` asks for."""

    def __init__(self, body: Body):
        self.body, self.sparse = body, body.sparse
        self.at = body.places
        self.unknowns, self.free = self.sparse.kinds[0], ~self.sparse.held
        self._last: tuple[np.ndarray, np.ndarray, np.ndarray] | None = None

    def deformed(self, position: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """F[i, K] = d x_i / d X_K (t, q, 2, 2) and J (t, q), kept until another position is asked for."""
        if self._last is None or self._last[0] is not position:
            slopes = self.at.rows @ position[self.body.cells]
            F = np.ascontiguousarray(np.swapaxes(slopes.reshape(*self.at.dx.shape, 2, 2), 2, 3))
            self._last = position, F, elements.determinant(F)
        return self._last[1:]

    def _strained(self, position, pressure, theta):
        """F (t, q, 2, 2), J, and P with its stabilisation (t, q)."""
        F, J = self.deformed(position)
        linear = pressure[self.body.cells[:, :3]] @ elements.LINEAR.T
        return F, J, linear + GAMMA * theta ** (-5 / 3) * (J - theta)

    def _forces(self, stress: np.ndarray, slopes: np.ndarray) -> np.ndarray:
        """(t, 2, 6) of the integral of stress (t, q, 2, 2) : grad v, slopes (t, 2 q, 6) being those of v."""
        weighted = self.at.dx[..., None, None] * stress
        return np.moveaxis(weighted, 2, 1).reshape(len(stress), 2, -1) @ slopes

    def residual(self, position: np.ndarray, pressure: np.ndarray, theta: np.ndarray):
        """Residual [x of all nodes, y, then P of the corners] and the size of its terms; theta: (t, q)."""
        F, J, P = self._strained(position, pressure, theta)
        dx, slopes = self.at.dx, self.at.rows
        force = self._forces(piola(F, P), slopes)
        terms = self._forces(J[..., None, None] ** (-2 / 3) * np.abs(F), np.abs(slopes))
        gap, scale = (dx * (J - theta)) @ elements.LINEAR, (dx * theta) @ elements.LINEAR
        n = 2 * len(position) + self.body.corners
        return tuple(np.bincount(self.unknowns.ravel(), np.concatenate([a[:, 0], a[:, 1], b], axis=1).ravel(), n)
                     for a, b in ((force, gap), (terms, scale)))

    def tangent(self, position: np.ndarray, pressure: np.ndarray, theta: np.ndarray) -> np.ndarray:
        """(t, 15, 15) symmetric element matrices of the residual's derivative."""
        F, _, P = self._strained(position, pressure, theta)
        count, points = F.shape[:2]
        unit = np.zeros((count, points, 4, 12))
        unit[:, :, :2, :6] = unit[:, :, 2:, 6:] = self.at.slopes
        H, J = inverse_transpose(F)
        JH = (J[..., None, None] * H).reshape(count, points, 4)
        stiff = (GAMMA * theta ** (-5 / 3))[..., None, None] * JH[..., :, None] * JH[..., None, :]
        moduli = self.at.dx[..., None, None] * (tangent(F, P).reshape(count, points, 4, 4) + stiff)
        stacked = unit.reshape(count, -1, 12)
        K = np.swapaxes(stacked, 1, 2) @ (moduli @ unit).reshape(count, -1, 12)
        slope = ((self.at.dx * J)[..., None, None] * H) @ self.at.slopes
        B = elements.LINEAR.T @ slope.reshape(count, points, 12)
        return saddle_blocks(K, -B)

    def admissible(self, position: np.ndarray) -> bool:
        """Is det F > 0 wherever it is integrated?"""
        return bool(self.deformed(position)[1].min() > 0)


@timed("growth")
def equilibrium(body: Body, theta: np.ndarray, position: np.ndarray, pressure: np.ndarray,
                prescribed: np.ndarray) -> Equilibrium:
    """Equilibrium under theta (n,) nodal since the reference; other arguments as :func:`repro.growth.equilibrium`'s."""
    system = System(body)
    _, start = system.deformed(position)
    target = elements.at_points(theta, body.cells) * body.expanded
    refuse_turned_over(start, target)
    parts = int(np.ceil(np.abs(np.log(target / start)).max() / np.log(FACTOR)))
    return reach(system, start, target, position, pressure, prescribed, max(1, parts))
