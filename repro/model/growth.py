"""Growth mechanics (2.3, 3.4): the aggregate as an incompressible neo-Hookean body that grows.

Plane strain, from the configuration of t = 0: F = d phi / d X, J = det F, tr C = F : F + 1. Stationary in phi and P is

    Pi = integral of mu/2 (J^(-2/3) tr C - 3) + P (J - theta) dV - 1/2 sum_tau integral of h^2/(12 mu_tau) |grad P|^2 dv

(14)-(17), (21)-(24) and (27), hence J = theta. Signs are [E5]'s: the stabilisation makes the pressure block negative.
[E6]: h, grad and dv are those of the last known shape, and the modulus is the incremental one there,
mu_tau = mu_L theta^(-2/3); in reference quantities the stabilisation so grows as J^(5/3). It is kept fixed while an
equilibrium is sought. Without tractions mu_L scales P and nothing else: it is 1 in here.

With A = mu J^(-2/3) and H = F^-T (dJ = J H : dF), first Piola-Kirchhoff stress and tangent are

    S = A (F - tr C / 3 H) + P J H
    dS = A (dF - 2/3 (H : dF) F - 2/3 (F : dF) H + 2/9 tr C (H : dF) H + tr C / 3 H dF^T H)
         + P J ((H : dF) H - H dF^T H)
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from repro.errors import GrowthError, LinearError
from repro.fem.assembly import ElementSystem, each, saddle_blocks, saddle_system
from repro.fem.mesh import gradients, triangle_areas
from repro.fem.newton import Jacobian
from repro.timing import timed

#: Newton stops at this residual against the size of its terms, or at the second where round-off keeps it from falling.
NEWTON, ROUND_OFF, MOST_ITERATIONS = 1e-11, 1e-8, 25
#: Halvings in a line search; sub-steps of a continuation.
HALVINGS = 8
CONTINUATION = (1, 8, 64)


@dataclass(frozen=True, eq=False)
class Body:
    """The aggregate's own mesh in its reference configuration.

    reference: (n, 2) um; triangles: (t, 3); held: (n, 2) True where a coordinate is prescribed; topology: what has been
    worked out from connections and held coordinates; reused: does Newton's method use its derivative again?
    """

    reference: np.ndarray
    triangles: np.ndarray
    held: np.ndarray
    topology: dict = field(default_factory=dict, repr=False)
    reused: bool = False

    @property
    def sparse(self) -> ElementSystem:
        """The sparse system of positions and pressure."""
        if "growth" not in self.topology:
            self.topology["growth"] = saddle_system(self.triangles, self.triangles, self.held)
        held = np.concatenate([self.held[:, 0], self.held[:, 1], np.zeros(len(self.held), bool)])
        found = self.topology["growth"]
        return found if np.array_equal(found.held, held) else found.holding(held)


@dataclass(frozen=True, eq=False)
class Equilibrium:
    """position: (n, 2) um; pressure: (n,) P / mu_L; iterations of Newton's method, all sub-steps together."""

    position: np.ndarray
    pressure: np.ndarray
    iterations: int


def deformation(position: np.ndarray, triangles: np.ndarray, slopes: np.ndarray) -> np.ndarray:
    """(t, 2, 2) F[i, K] = d x_i / d X_K, from reference gradients (t, 3, 2) of the nodal functions."""
    return np.einsum("tai,tak->tik", position[triangles], slopes)


def inverse_transpose(F: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """H = F^-T and J of plane deformations (..., 2, 2)."""
    at = Strained(F)
    return at.H, at.J


@dataclass(frozen=True, eq=False)
class Strained:
    """Plane deformations F (..., 2, 2) and what the stress takes from them, each worked out once, where it is asked
    for: J before anything is divided by it."""

    F: np.ndarray

    @cached_property
    def J(self) -> np.ndarray:
        """(...) det F."""
        F = self.F
        return F[..., 0, 0] * F[..., 1, 1] - F[..., 0, 1] * F[..., 1, 0]

    @cached_property
    def H(self) -> np.ndarray:
        """(..., 2, 2) F^-T."""
        F, H = self.F, np.empty_like(self.F)
        H[..., 0, 0], H[..., 1, 1] = F[..., 1, 1], F[..., 0, 0]
        H[..., 0, 1], H[..., 1, 0] = -F[..., 1, 0], -F[..., 0, 1]
        return H / self.J[..., None, None]

    @cached_property
    def A(self) -> np.ndarray:
        """(...) J^(-2/3)."""
        return self.J ** (-2 / 3)

    @cached_property
    def trace(self) -> np.ndarray:
        """(...) tr C."""
        return np.sum(self.F**2, axis=(-2, -1)) + 1

    def piola(self, P: np.ndarray) -> np.ndarray:
        """First Piola-Kirchhoff stress (..., 2, 2), the derivative of (21) by F, at a pressure P (...); both over mu_L.
        """
        return self.A[..., None, None] * self.F + (P * self.J - self.A * self.trace / 3)[..., None, None] * self.H


def energy(F: np.ndarray) -> np.ndarray:
    """mu/2 (J^(-2/3) tr C - 3) for mu = 1 (17), of F (..., 2, 2)."""
    J = np.linalg.det(F)
    return 0.5 * (J ** (-2 / 3) * (np.sum(F**2, axis=(-2, -1)) + 1) - 3)


def piola(F: np.ndarray, P: np.ndarray) -> np.ndarray:
    """:meth:`Strained.piola` of F (..., 2, 2)."""
    return Strained(F).piola(P)


def tangent(F: np.ndarray, P: np.ndarray) -> np.ndarray:
    """d piola / d F, (..., i, K, j, L), over mu_L."""
    at = Strained(F)
    H, A, trace, PJ = at.H, at.A, at.trace, P * at.J
    first, second = (F[..., None, None], H[..., None, None]), (F[..., None, None, :, :], H[..., None, None, :, :])
    FH, HF, HH = first[0] * second[1], first[1] * second[0], first[1] * second[1]
    swap = np.swapaxes(HH, -3, -1)
    identity = np.einsum("ij,kl->ikjl", np.eye(2), np.eye(2))

    def times(scalar, tensor):
        return scalar[..., None, None, None, None] * tensor

    return (times(A, identity - 2 / 3 * (FH + HF)) + times(2 / 9 * A * trace + PJ, HH)
            + times(A * trace / 3 - PJ, swap))


def cauchy(F: np.ndarray, P: np.ndarray) -> np.ndarray:
    """Cauchy stress over mu_L in plane strain: (..., 4) sigma_xx, sigma_yy, sigma_zz, sigma_xy.

    J^-1 S F^T in the plane; across it, where F33 = 1, J^(-5/3) (1 - tr C / 3) + P.
    """
    J = np.linalg.det(F)
    sigma = np.einsum("...ik,...jk->...ij", piola(F, P), F) / J[..., None, None]
    across = J ** (-5 / 3) * (1 - (np.sum(F**2, axis=(-2, -1)) + 1) / 3) + P
    return np.stack([sigma[..., 0, 0], sigma[..., 1, 1], across, sigma[..., 0, 1]], axis=-1)


def largest_principal(stress: np.ndarray) -> np.ndarray:
    """(...) largest principal value of stresses (..., 4) as :func:`cauchy` gives them."""
    xx, yy, zz, xy = np.moveaxis(stress, -1, 0)
    return np.maximum(0.5 * (xx + yy) + np.hypot(0.5 * (xx - yy), xy), zz)


def stabilisation(position: np.ndarray, triangles: np.ndarray, theta: np.ndarray) -> np.ndarray:
    """(t, 3, 3) matrices of sum_tau h^2 / (12 theta^(-2/3)) (grad p, grad q) on the shape ``position`` [E6]."""
    slopes, areas = gradients(position, triangles), triangle_areas(position, triangles)
    corner = position[triangles]
    sides = np.linalg.norm(corner - np.roll(corner, 1, axis=1), axis=2)
    h = np.prod(sides, axis=1) / (2 * areas)
    weight = areas * h**2 / 12 * theta ** (2 / 3)
    return weight[:, None, None] * np.einsum("tai,tbi->tab", slopes, slopes)


def _strains(slopes: np.ndarray) -> np.ndarray:
    """(t, 4, 6) dF [xX, xY, yX, yY] of unit displacements [x of the three nodes, then y]."""
    found = np.zeros((len(slopes), 4, 6))
    found[:, :2, :3] = found[:, 2:, 3:] = np.swapaxes(slopes, 1, 2)
    return found


class System:
    """Residual and tangent of Pi for one body; theta and prescribed coordinates vary, the sparsity does not."""

    def __init__(self, body: Body, stabilising: np.ndarray, forces: np.ndarray | None = None):
        """forces: (n, 2) um, nodal forces over mu_L that do not depend on the shape (the t0 of (20)); none by default.
        """
        self.body = body
        self.pull = None if forces is None else np.concatenate([forces[:, 0], forces[:, 1], np.zeros(len(forces))])
        self.slopes = gradients(body.reference, body.triangles)
        self.areas = triangle_areas(body.reference, body.triangles)
        self.strains = _strains(self.slopes)
        self.stabilising = stabilising
        self.sparse = body.sparse
        self.unknowns, self.free = self.sparse.kinds[0], self.sparse.free

    def residual(self, position: np.ndarray, pressure: np.ndarray, theta: np.ndarray):
        """Residual (3n,) [x of all nodes, y, then P] and the size of its terms; the caller excludes det F <= 0."""
        t, n = self.body.triangles, len(position)
        F = deformation(position, t, self.slopes)
        P = pressure[t]
        S = piola(F, P.mean(axis=1))
        force = self.areas[:, None, None] * np.einsum("tik,tak->tia", S, self.slopes)
        terms = self.areas[:, None, None] * np.einsum("tik,tak->tia", *map(np.abs, (F, self.slopes)))
        terms = terms * np.linalg.det(F)[:, None, None] ** (-2 / 3)
        gap = (self.areas * (np.linalg.det(F) - theta))[:, None] / 3 - np.einsum("tab,tb->ta", self.stabilising, P)
        local = np.concatenate([force[:, 0], force[:, 1], gap], axis=1)
        scale = np.concatenate([terms[:, 0], terms[:, 1],
                                np.broadcast_to((self.areas * theta)[:, None] / 3, P.shape)], axis=1)
        total, size = (np.bincount(self.unknowns.ravel(), part.ravel(), 3 * n) for part in (local, scale))
        if self.pull is None:
            return total, size
        return total - self.pull, size + np.abs(self.pull)

    def tangent(self, position: np.ndarray, pressure: np.ndarray, theta: np.ndarray | None = None) -> np.ndarray:
        """(t, 9, 9) symmetric element matrices of the residual's derivative, which theta does not enter."""
        t = self.body.triangles
        F = deformation(position, t, self.slopes)
        moduli = tangent(F, pressure[t].mean(axis=1))
        K = np.swapaxes(self.strains, 1, 2) @ each(self.areas, moduli.reshape(-1, 4, 4)) @ self.strains
        H, J = inverse_transpose(F)
        B = (self.areas * J)[:, None, None] * np.einsum("tik,tak->tia", H, self.slopes) / 3
        return saddle_blocks(K, -np.repeat(B.reshape(len(t), 1, 6), 3, axis=1), self.stabilising)

    def admissible(self, position: np.ndarray) -> bool:
        """Is det F > 0 everywhere?"""
        return bool(triangle_areas(position, self.body.triangles).min() > 0)


@timed("growth")
def equilibrium(body: Body, theta: np.ndarray, position: np.ndarray, pressure: np.ndarray,
                prescribed: np.ndarray, forces: np.ndarray | None = None) -> Equilibrium:
    """Equilibrium under the expansion theta (t,) since the reference, from a start.

    position: (n, 2) um, the last shape, with det F > 0; pressure: (n,) P / mu_L there; prescribed: (n, 2) um, the
    coordinates to reach where ``body.held``; forces: (n, 2) um, nodal forces over mu_L, none by default. Newton's
    method with a line search that rejects det F <= 0; where it fails, theta and the prescribed coordinates go from
    where they are to their targets in geometric sub-steps. Raises GrowthError where that fails too.
    """
    start = triangle_areas(position, body.triangles) / triangle_areas(body.reference, body.triangles)
    refuse_turned_over(start, theta)
    system = System(body, stabilisation(position, body.triangles, start), forces)
    return reach(system, start, theta, position, pressure, prescribed)


def refuse_turned_over(start: np.ndarray, theta: np.ndarray) -> None:
    """Raises GrowthError where J at the start or theta is not positive."""
    if start.min() <= 0 or theta.min() <= 0:
        raise GrowthError("growth starts from a triangle that is turned over or from theta <= 0; "
                          "try a shorter growth.time_step")


def reach(system, start: np.ndarray, theta: np.ndarray, position: np.ndarray, pressure: np.ndarray,
          prescribed: np.ndarray, parts: int = 1) -> Equilibrium:
    """Equilibrium of a system under theta, from J = ``start`` (shaped alike), in ``parts`` or, where that fails, more;
    see :func:`equilibrium`."""
    failure = ""
    for steps in CONTINUATION:
        try:
            return _continued(system, start, theta, position, pressure, prescribed, parts * steps)
        except (GrowthError, LinearError) as error:
            failure = str(error)
    raise GrowthError(f"{failure}; try a shorter growth.time_step or a larger numerics.refinement")


def _continued(system, start, theta, position, pressure, prescribed, steps: int) -> Equilibrium:
    """Newton's method at theta = start (theta / start)^s for s = 1 / steps ... 1."""
    first, iterations = position, 0
    for part in np.arange(1, steps + 1) / steps:
        target = np.where(system.body.held, first + part * (prescribed - first), position)
        position, pressure, used = _newton(system, start * (theta / start) ** part, position, pressure, target)
        iterations += used
    return Equilibrium(position, pressure, iterations)


def _newton(system: System, theta, position, pressure, target):
    """Solve at one theta; the first step carries the prescribed coordinates to their target."""
    lag = np.where(system.body.held, target - position, 0.0)
    jacobian = Jacobian(system.body.reused)
    residual, size = system.residual(position, pressure, theta)
    defect = np.inf
    for iteration in range(MOST_ITERATIONS):
        last, defect = defect, _relative(residual[system.free], size[system.free])
        if not lag.any() and (defect <= NEWTON or 0.1 * last < defect <= ROUND_OFF):
            return position, pressure, iteration
        move = np.concatenate([lag[:, 0], lag[:, 1], np.zeros(len(pressure))]) if lag.any() else None
        if jacobian.stale(defect):
            jacobian.factors = system.sparse.factored(system.tangent(position, pressure, theta))
        step = jacobian.factors.solve(-residual, move)
        position, pressure, residual, size = _line_search(system, theta, position, pressure, step, residual, lag)
        lag = np.where(system.body.held, target - position, 0.0)
    raise GrowthError(f"Newton's method for the growth stands at a defect of {defect:.2g} "
                      f"after {MOST_ITERATIONS} iterations")


def _relative(residual: np.ndarray, size: np.ndarray) -> float:
    """Largest residual against the size of its row's terms."""
    return float(np.max(np.abs(residual) / np.maximum(size, np.finfo(float).tiny)))


def _line_search(system, theta, position, pressure, step, residual, lag):
    """The longest of the steps 1, 1/2, ... with det F > 0 that does not raise the residual fourfold."""
    n = len(position)
    move, push = step[: 2 * n].reshape(2, n).T, step[2 * n:]
    before = np.linalg.norm(residual[system.free])
    for length in 0.5 ** np.arange(HALVINGS):
        trial = position + length * move
        if not system.admissible(trial):
            continue
        found, size = system.residual(trial, pressure + length * push, theta)
        if lag.any() or np.linalg.norm(found[system.free]) < 4 * before:
            return trial, pressure + length * push, found, size
    raise GrowthError(f"no step of Newton's method keeps det F > 0 and the residual in bounds "
                      f"(shortest tried {0.5 ** (HALVINGS - 1):.2g})")
