"""Growth mechanics (2.3, 3.4): the aggregate as an incompressible elastic body that grows.

Plane strain relative to the configuration at t = 0: F = d phi / d X, J = det F, tr C = F : F + 1.
The equilibrium makes this potential stationary in phi and P:

    Pi = integral of mu w(J^(-2/3) tr C) + P (J - theta) dV
         - 1/2 sum_tau integral of h^2/(12 mu_tau) |grad P|^2 dv

(14)-(17), (21)-(24) and (27), hence J = theta. Signs follow [E5]: the stabilisation makes the
pressure block negative. Without tractions mu_L only scales P, so this module sets mu_L to 1. P is
linear. The paper's energy is w = (I - 3) / 2. :mod:`repro.model.energies` has others, with
a = 2 dw/dI and c = 4 d2w/dI2. With A = a J^(-2/3), H = F^-T (dJ = J H : dF) and
G = J^(-2/3) (F - tr C / 3 H), the first Piola-Kirchhoff stress and the tangent are

    S = A (F - tr C / 3 H) + P J H
    dS = A (dF - 2/3 (H : dF) F - 2/3 (F : dF) H + 2/9 tr C (H : dF) H + tr C / 3 H dF^T H)
         + c (G : dF) G + P J ((H : dF) H - H dF^T H)

*Straight triangles*, linear displacements. [E6]: h, grad and dv are those of the last known shape,
and mu_tau = a mu_L theta^(-2/3) is the incremental modulus of this shape. In reference quantities
the stabilisation grows as J^(5/3) / a. It does not change during the solution of an equilibrium.

*Curved triangles*, quadratic displacements (Taylor-Hood): the potential has no term in |grad P|^2.
Instead S contains P + gamma a theta^(-5/3) (J - theta) in place of P. This grad-div stabilisation
vanishes where J = theta. Without it, modes of J that the linear pressure does not constrain would
grow, because the energy of a plane expansion without change of shape, J^(1/3) + J^(-2/3) / 2, is
concave.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Generic, TypeVar

import numpy as np

from repro.errors import GrowthError, LinearError, failing_as
from repro.fem.assembly import Factored, Supported, saddle_blocks
from repro.fem.forms import Basis, each, product
from repro.fem.mesh import gradients, triangle_areas
from repro.fem.newton import Newton, relative
from repro.model.solid import Solid, Strained
from repro.model.support import Support, balanced
from repro.timing import timed

#: Newton's method stops at this residual relative to the size of its terms.
NEWTON = 1e-11
#: A result of one operation has at most this relative rounding error.
UNIT_ROUND_OFF = np.finfo(float).eps / 2
MOST_ITERATIONS = 25
#: (n, defect): the first attempt gives up if the defect after n iterations is larger. In 19 pores
#: this would have stopped three of 1240 solutions that converged. It saves half of the processor
#: time of 117 that did not.
EARLY = 12, 0.02
#: Number of trial lengths in a line search: 1, 1/2, 1/4 ...
HALVINGS = 8
#: {patient: numbers of sub-steps to try}. If not patient, the caller shortens its step instead.
CONTINUATION = {True: (1, 8, 64), False: (1,)}
#: gamma. The energy's curvature in J is never below -2/9 J^(-5/3), so gamma = 1 makes the energy
#: convex with a margin.
GAMMA = 1.0
#: On curved triangles theta goes to its target in sub-steps of at most this factor. A longer step
#: of Newton's method may end in another equilibrium, with a wrinkled surface.
FACTOR = 1.2
#: FACTOR limits the sub-steps in this fraction of the aggregate's points. In a few points beside a
#: contact line J may be far from theta.
MOST_POINTS = 0.95


@dataclass(frozen=True, eq=False)
class Equilibrium:
    """An equilibrium.

    position: (n, 2) um; pressure: (corners,) P / mu_L; iterations: of Newton's method, in all
    sub-steps.
    """

    position: np.ndarray
    pressure: np.ndarray
    iterations: int


def internal_forces(solid: Solid, theta: np.ndarray, position: np.ndarray,
                    pressure: np.ndarray) -> np.ndarray:
    """(n, 2) um, nodal forces of the stress over mu_L under theta (t, q).

    position: (n, 2) um; pressure: (corners,) P / mu_L. External forces equal to these keep the
    aggregate in this position.
    """
    stabilisation = STABILISATIONS[solid.shape.geometry].on(solid, position)
    system = System(solid, np.zeros(position.shape, bool), stabilisation=stabilisation)
    forces = system.under(theta, position, position, pressure).residual
    return forces[: position.size].reshape(2, -1).T


def cauchy(at: Strained, P: np.ndarray) -> np.ndarray:
    """Cauchy stress over mu_L in plane strain: (..., 4) sigma_xx, sigma_yy, sigma_zz, sigma_xy.

    J^-1 S F^T in the plane; across it, where F33 = 1, a J^(-5/3) (1 - tr C / 3) + P.
    """
    sigma = np.einsum("...ik,...jk->...ij", at.piola(P), at.F) / at.J[..., None, None]
    across = at.A / at.J * (1 - at.trace / 3) + P
    return np.stack([sigma[..., 0, 0], sigma[..., 1, 1], across, sigma[..., 0, 1]], axis=-1)


def largest_principal(stress: np.ndarray) -> np.ndarray:
    """(...) largest principal value of stresses (..., 4) as :func:`cauchy` returns them."""
    xx, yy, zz, xy = np.moveaxis(stress, -1, 0)
    return np.maximum(0.5 * (xx + yy) + np.hypot(0.5 * (xx - yy), xy), zz)


def gradient_stabilisation(position: np.ndarray, triangles: np.ndarray,
                           theta: np.ndarray) -> np.ndarray:
    """(t, 3, 3) matrices of h^2 / (12 theta^(-2/3)) (grad p, grad q) in a shape [E6].

    position: (n, 2) um, of the shape; theta: (t,) expansion.
    """
    slopes = gradients(position, triangles)
    areas = triangle_areas(position, triangles)
    corner = position[triangles]
    sides = np.linalg.norm(corner - np.roll(corner, 1, axis=1), axis=2)
    h = np.prod(sides, axis=1) / (2 * areas)
    weight = areas * h**2 / 12 * theta ** (2 / 3)
    return weight[:, None, None] * np.einsum("tai,tbi->tab", slopes, slopes)


@dataclass(frozen=True, eq=False)
class PressureGradient:
    """Stabilisation on straight triangles; matrices: (t, 3, 3) of the term in |grad P|^2."""

    matrices: np.ndarray
    gamma = 0.0

    @staticmethod
    def on(solid: Solid, last_shape: np.ndarray) -> PressureGradient:
        """The stabilisation in the last known shape (n, 2) um [E6]."""
        expansion = solid.strained(last_shape).J[:, 0]
        matrices = gradient_stabilisation(last_shape, solid.shape.triangles, expansion)
        stiffness = solid.energy.growth_stiffness(expansion)
        relative_modulus = np.broadcast_to(stiffness, expansion.shape)
        return PressureGradient(matrices / relative_modulus[:, None, None])

    @staticmethod
    def parts(growth: np.ndarray) -> int:
        """Number of sub-steps for a growth theta / J (t, q): one."""
        return 1


@dataclass(frozen=True, eq=False)
class GradDiv:
    """Stabilisation on curved triangles; gamma: its weight."""

    gamma: float = GAMMA
    matrices = np.zeros((1, 3, 3))

    @staticmethod
    def on(solid: Solid, last_shape: np.ndarray) -> GradDiv:
        """The stabilisation; it does not depend on the shape."""
        return GradDiv()

    @staticmethod
    def parts(growth: np.ndarray) -> int:
        """Number of sub-steps for a growth theta / J (t, q): each at most FACTOR in most points."""
        apart = np.quantile(np.abs(np.log(growth)), MOST_POINTS)
        return max(1, int(np.ceil(apart / np.log(FACTOR))))


#: {geometry of the triangles: stabilisation}.
STABILISATIONS: dict[int, type[PressureGradient] | type[GradDiv]] = {1: PressureGradient,
                                                                     2: GradDiv}

Value = TypeVar("Value")


class LastResult(Generic[Value]):
    """A function of one array with a cache of the last result.

    The cache is valid for the same array object, so arrays must not change in place.
    """

    def __init__(self, function: Callable[[np.ndarray], Value]):
        self._function = function
        self._last: tuple[np.ndarray, Value] | None = None

    def __call__(self, array: np.ndarray) -> Value:
        if self._last is None or self._last[0] is not array:
            self._last = array, self._function(array)
        return self._last[1]


@dataclass(frozen=True, eq=False)
class Iterate:
    """One Newton iterate.

    position: (n, 2) um; pressure: (corners,) P / mu_L; residual, size: (2n + corners,) residual and
    magnitude of its terms; lag: (n, 2) um, target minus position of prescribed coordinates; free:
    unknowns that are not prescribed.
    """

    position: np.ndarray
    pressure: np.ndarray
    residual: np.ndarray
    size: np.ndarray
    lag: np.ndarray
    free: np.ndarray | slice

    @property
    def defect(self) -> float:
        """Largest residual of a free unknown, relative to the magnitude of its row's terms."""
        return relative(self.residual[self.free], self.size[self.free])

    @property
    def complete(self) -> bool:
        """Have the prescribed coordinates reached their targets?"""
        return not self.lag.any()

    @property
    def length(self) -> float:
        """Euclidean norm of the residual of the free unknowns."""
        return float(np.linalg.norm(self.residual[self.free]))


class System:
    """Residual and tangent of Pi for one solid, one theta and prescribed coordinates."""

    def __init__(self, solid: Solid, constrained: np.ndarray, *,
                 stabilisation: PressureGradient | GradDiv = GradDiv(),
                 forces: np.ndarray | None = None, supports: Sequence[Support] = ()):
        """constrained: (n, 2) True where a coordinate is prescribed; forces: (n, 2) um, nodal
        forces over mu_L that do not depend on the shape (t0 in (20)), none by default; supports: of
        the contact surfaces, at points with prescribed x."""
        self.solid = solid
        self.constrained = constrained
        self.supports = supports
        self.stabilisation = stabilisation
        none = np.zeros(solid.shape.corners, bool)
        rows = np.concatenate([constrained[:, 0], constrained[:, 1], none])
        self.sparse = solid.shape.constrained(rows)
        self.free = self.sparse.free
        self.pull = np.zeros(len(rows))
        if forces is not None:
            self.pull[: constrained.size] = forces.T.ravel()
        self.strained = LastResult(solid.strained)
        self.theta = self.target = np.empty(0)
        self.sizes = np.empty(0)
        self._last_tangent: tuple[Iterate | None, np.ndarray] = None, np.empty(0)

    def under(self, theta: np.ndarray, target: np.ndarray, position: np.ndarray,
              pressure: np.ndarray) -> Iterate:
        """The first iterate for an expansion theta (t, q) and prescribed coordinates (n, 2) um."""
        self.theta = theta
        self.target = target
        self.sizes = self._sizes(position)
        return self._iterate(position, pressure)

    def _iterate(self, position: np.ndarray, pressure: np.ndarray) -> Iterate:
        lag = np.where(self.constrained, self.target - position, 0.0)
        residual = balanced(self.supports, self.residual(position, pressure))
        return Iterate(position, pressure, residual, self.sizes, lag, self.free)

    def _stiffening(self, theta: np.ndarray) -> np.ndarray:
        """gamma a theta^(-5/3)."""
        grown = self.solid.energy.growth_stiffness(theta)
        return self.stabilisation.gamma * theta ** (-5 / 3) * grown

    def _pressed(self, position: np.ndarray, pressure: np.ndarray) -> tuple[Strained, np.ndarray]:
        """The deformation, and P plus the grad-div stabilisation (t, q)."""
        at = self.strained(position)
        linear = self.solid.pressures.evaluate(pressure)
        return at, linear + self._stiffening(self.theta) * (at.J - self.theta)

    def residual(self, position: np.ndarray, pressure: np.ndarray) -> np.ndarray:
        """(2n + corners,) residual: x of all nodes, y of all nodes, then P of the corners.

        The caller ensures det F > 0.
        """
        at, P = self._pressed(position, pressure)
        gap = self.solid.pressures.load(self.solid.at.dx * (at.J - self.theta))
        local = pressure[self.solid.shape.triangles]
        gap -= np.einsum("tab,tb->ta", self.stabilisation.matrices, local)
        return self._summed(self._forces(at.piola(P), self.solid.at.weighted), gap) - self.pull

    def partial_residual(self, solid: Solid, theta: np.ndarray, position: np.ndarray,
                         pressure: np.ndarray) -> np.ndarray:
        """(2n + corners,) residual of a few curved triangles, ``solid``, under theta (r, q)."""
        at = solid.strained(position)
        P = solid.pressures.evaluate(pressure)
        P += self._stiffening(theta) * (at.J - theta)
        stress = at.piola(P)
        forces = self._forces(stress, solid.at.weighted)
        gap = solid.pressures.load(solid.at.dx * (at.J - theta))
        return np.concatenate([solid.at.assemble(forces), solid.pressures.assemble(gap)])

    def _sizes(self, position: np.ndarray) -> np.ndarray:
        """(2n + corners,) magnitudes of the terms of the residual."""
        at = self.strained(position)
        weighted = self.solid.at.weighted
        positive = replace(weighted, gradients=np.abs(weighted.gradients))
        terms = self._forces(at.A[..., None, None] * np.abs(at.F), positive)
        gap = self.solid.pressures.load(self.solid.at.dx * self.theta)
        return self._summed(terms, gap) + np.abs(self.pull)

    def _forces(self, stress: np.ndarray, weighted: Basis) -> np.ndarray:
        """(t, 2, k) of (S, grad v) for a stress (t, q, 2, 2), from grad v dx."""
        return weighted.flux(np.swapaxes(stress, 1, 2))

    def _summed(self, force: np.ndarray, gap: np.ndarray) -> np.ndarray:
        """(2n + corners,) sum over all triangles of forces (t, 2, k) and gaps (t, 3)."""
        return self.sparse.assemble(np.concatenate([force[:, 0], force[:, 1], gap], axis=1))

    def tangent(self, position: np.ndarray, pressure: np.ndarray) -> np.ndarray:
        """(t, 2k + 3, 2k + 3) symmetric element matrices of the residual's derivative."""
        at, P = self._pressed(position, pressure)
        k = self.solid.shape.cells.shape[1]
        dx = self.solid.at.dx
        PJ = P * at.J
        h = self._pulled(at.H)
        f = self._pulled(at.F)
        both = 2 / 9 * at.A * at.trace + PJ + self._stiffening(self.theta) * at.J**2
        half = each(dx * both / 2, h) - each(2 / 3 * dx * at.A, f)
        swap = each(dx * (at.A * at.trace / 3 - PJ), h)
        blocks = np.swapaxes(h, 1, 2) @ np.concatenate([half, swap], axis=2)
        K = blocks[:, :, : 2 * k] + np.swapaxes(blocks[:, :, : 2 * k], 1, 2)
        curvature = self.solid.energy.curvature(at.invariant)
        if curvature is not None:
            g = self._pulled(at.G)
            K += np.swapaxes(g, 1, 2) @ each(dx * curvature, g)
        exchanged = K.reshape(-1, 2, k, 2, k)  # the same memory
        exchanged += np.swapaxes(blocks[:, :, 2 * k:].reshape(exchanged.shape), 1, 3)
        plain = self.solid.at.stiffness(at.A, self.solid.at.weighted)
        exchanged[:, 0, :, 0] += plain
        exchanged[:, 1, :, 1] += plain
        volume = product(self.solid.pressures.values, dx * at.J, h)
        return saddle_blocks(K, -volume, self.stabilisation.matrices)

    def _pulled(self, tensor: np.ndarray) -> np.ndarray:
        """(t, q, 2k) tensor (t, q, 2, 2) times grad N_a: component x for all nodes a, then y."""
        return (tensor @ self.solid.at.gradients).reshape(*self.solid.at.dx.shape, -1)

    def factored(self, iterate: Iterate) -> Factored:
        """The derivative, factorised."""
        factors = self.sparse.factored(self._tangent_at(iterate))
        if not self.supports:
            return factors
        loads = np.zeros((len(iterate.residual), len(self.supports)))
        loads[: len(iterate.position)] = np.column_stack([each.load for each in self.supports])
        points = np.array([support.point for support in self.supports])
        return Supported(factors.system, factors.elements, factors.solver, loads, points)

    def _tangent_at(self, iterate: Iterate) -> np.ndarray:
        """The tangent at an iterate, kept for the next call with the same one."""
        if self._last_tangent[0] is not iterate:
            self._last_tangent = iterate, self.tangent(iterate.position, iterate.pressure)
        return self._last_tangent[1]

    def at_round_off(self, iterate: Iterate) -> bool:
        """Can round-off explain the residual of each free unknown?

        A row of the residual is a sum K x over the k nodes of a triangle, with positions and
        pressures x. Storage rounds x, and the products and their sum are rounded, too. A row may
        therefore err by (k + 1) unit round-offs of |K| |x|. In an element much smaller than x, this
        error is larger than NEWTON times the terms of the row.
        """
        values = np.concatenate([iterate.position.T.ravel(), iterate.pressure])
        terms = self.sparse.product(np.abs(self._tangent_at(iterate)), np.abs(values))
        for support in self.supports:
            share = support.load / support.load[support.point]
            terms[: len(share)] += terms[support.point] * share
        errors = (self.solid.shape.cells.shape[1] + 1) * UNIT_ROUND_OFF * terms
        return bool((np.abs(iterate.residual) <= errors)[self.free].all())

    def advanced(self, iterate: Iterate, factors: Factored, fresh: bool) -> Iterate:
        """The iterate after a step of Newton's method, of the longest accepted length 1, 1/2, ...

        A length is accepted if the deformation is admissible and the residual grows by less than a
        factor of four. Until prescribed coordinates have reached their targets, the step includes
        their move, and the residual does not count. Raises GrowthError if no length is accepted.
        """
        lag = iterate.lag
        carried = None
        if not iterate.complete:
            carried = np.concatenate([lag[:, 0], lag[:, 1], np.zeros(len(iterate.pressure))])
        step = factors.solve(-iterate.residual, carried)
        n = len(iterate.position)
        move = step[: 2 * n].reshape(2, n).T
        push = step[2 * n:]
        for length in 0.5 ** np.arange(HALVINGS):
            position = iterate.position + length * move
            if not self.strained(position).admissible:
                continue
            trial = self._iterate(position, iterate.pressure + length * push)
            if not iterate.complete or trial.length < 4 * iterate.length:
                return trial
        raise GrowthError("no step of Newton's method keeps det F > 0, the strain below the limit "
                          "of the energy, and the residual in bounds "
                          f"(shortest tried {0.5 ** (HALVINGS - 1):.2g})")


@timed("growth")
def equilibrium(solid: Solid, theta: np.ndarray, position: np.ndarray, pressure: np.ndarray,
                constrained: np.ndarray, prescribed: np.ndarray, *, last: np.ndarray | None = None,
                forces: np.ndarray | None = None, supports: Sequence[Support] = (),
                modified_newton: bool = False, patient: bool = True) -> Equilibrium:
    """Solve for the equilibrium of an aggregate under an expansion, (14)-(27).

    Parameters
    ----------
    solid : Solid
    theta : (t, q) float
        Expansion since the reference configuration.
    position : (n, 2) float
        Positions from which to start, um, with det F > 0.
    pressure : (corners,) float
        P / mu_L from which to start.
    constrained : (n, 2) bool
        True where a coordinate is prescribed.
    prescribed : (n, 2) float
        Prescribed coordinates, um.
    last : (n, 2) float, optional
        The last known shape, um, for the stabilisation; ``position`` by default.
    forces : (n, 2) float, optional
        Nodal forces over mu_L, um; none by default.
    supports : sequence of Support, optional
        Tractions that keep points with prescribed x in place. Without a support, a force at the
        point does so.
    modified_newton : bool
        Does Newton's method keep its derivative as long as the defect decreases fast enough?
    patient : bool
        Is a failed equilibrium tried again in more sub-steps?

    Returns
    -------
    Equilibrium

    Raises
    ------
    GrowthError
        If there is no convergence.

    Notes
    -----
    The line search of Newton's method rejects det F <= 0. If the method fails, theta goes to its
    target in geometric sub-steps, and the prescribed coordinates in equal ones.
    """
    start = solid.strained(position).J
    if start.min() <= 0 or theta.min() <= 0:
        raise GrowthError("growth starts from a triangle that is turned over or from theta <= 0")
    method = STABILISATIONS[solid.shape.geometry]
    last_shape = position if last is None else last
    parts = method.parts(theta / start)
    system = System(solid, constrained, stabilisation=method.on(solid, last_shape), forces=forces,
                    supports=supports)
    first = Equilibrium(position, pressure, 0)
    return reach(system, start, theta, first, prescribed, parts, modified_newton, patient)


#: Advice if there is no equilibrium under the fluid forces.
TOO_SOFT = "; the aggregate may be too soft for this flow: try a larger growth.shear_modulus"


def reach(system: System, start: np.ndarray, theta: np.ndarray, first: Equilibrium,
          prescribed: np.ndarray, parts: int = 1, modified_newton: bool = False,
          patient: bool = True) -> Equilibrium:
    """Solve for the equilibrium under theta in ``parts`` sub-steps, or in more if these fail.

    start: (t, q) J of ``first``. Other arguments and errors are those of :func:`equilibrium`.
    """
    failure = ""
    for steps in CONTINUATION[patient]:
        try:
            newton = Newton(NEWTON, MOST_ITERATIONS, modified_newton,
                            EARLY if steps == 1 else None)
            return _continued(system, start, theta, first, prescribed, parts * steps, newton)
        except (GrowthError, LinearError) as error:
            failure = str(error)
    raise GrowthError(failure + (TOO_SOFT if system.pull.any() else ""))


@failing_as(GrowthError)
def _continued(system: System, start: np.ndarray, theta: np.ndarray, first: Equilibrium,
               prescribed: np.ndarray, steps: int, newton: Newton) -> Equilibrium:
    """Newton's method at theta = start (theta / start)^s for s = 1 / steps ... 1."""
    solution = first
    for part in np.arange(1, steps + 1) / steps:
        target = first.position + part * (prescribed - first.position)
        iterate = system.under(start * (theta / start) ** part, target, solution.position,
                               solution.pressure)
        last, count, converged = newton.solve(system, iterate)
        if not converged:
            raise GrowthError("Newton's method for the growth stands at a defect of "
                              f"{last.defect:.2g} after {count} iterations")
        solution = Equilibrium(last.position, last.pressure, solution.iterations + count)
    return solution
