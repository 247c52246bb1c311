"""Substrates (2.2, 3.3): advection, diffusion and uptake of acceptor and donor, (7)-(8) with (11)-(13).

Linear nodal functions N_i; the reaction is lumped at the nodes with the area of the biomass triangles around each,
so that the substrate taken up and the biomass made are the same sums. For one substrate

    (D grad C, grad N_i) + (w . grad C, N_i) + <u_x (C - C_supply), N_i>_inlet + m_i q(C_i) X_i = 0

where w = u - tau grad p is the divergence-free velocity of :mod:`repro.model.flow`. Summed over i, the second term is the net
flux of u C through the ends, so the balance closes to round-off: supply in = out + consumed. Without flow the supply is
held at both ends, or nothing passes them ("closed"). With u_ave for the inlet's u_x, (11) reads as printed [E4], and
what is supplied, u_ave W C_supply, is not quite what enters.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from repro.errors import TransportError
from repro.fem import linear
from repro.fem.assembly import ElementSystem, each, mass
from repro.fem.mesh import PoreMesh
from repro.fem.newton import Jacobian
from repro.model import kinetics as law
from repro.model.flow import Flow, forms, mean_over
from repro.timing import timed

#: Newton stops when the residual is this small against the largest term of its row's balance.
NEWTON, MOST_ITERATIONS = 1e-13, 60
#: Concentrations below zero by less than this part of the supply are round-off, anything more is a failure.
ROUND_OFF = 1e-9


@dataclass(frozen=True, eq=False)
class Operator:
    """Linear part of one substrate in one geometry: matrix @ C - source is what must balance the uptake.

    matrix: (N, N) um2/h, symmetric in its sparsity; magnitude: its absolute values; source: (N,) um2 mg/L/h; held:
    nodes where C = supply; inflow, outflow: (N,) um2/h weights of the flux through inlet and outlet; supplied: the flux
    supplied by the inlet, um2 mg/L/h; supply: mg/L.
    """

    matrix: sp.csc_matrix
    magnitude: sp.csc_matrix
    source: np.ndarray
    held: np.ndarray
    inflow: np.ndarray
    outflow: np.ndarray
    supplied: float
    supply: float


@dataclass(frozen=True, eq=False)
class Problem:
    """Both substrates in one geometry: their operators, body (N,) um2 lumped biomass area, total (N,) lumped area;
    nodes: (N,) in elimination order; newton: the sparsity of both substrates' Newton matrix; reused: does Newton's
    method use its derivative again?"""

    mesh: PoreMesh
    acceptor: Operator
    donor: Operator
    body: np.ndarray
    total: np.ndarray
    substrates: object
    kinetics: object
    nodes: np.ndarray
    newton: PairPattern
    reused: bool

    @property
    def both(self) -> tuple[Operator, Operator]:
        """Acceptor and donor."""
        return self.acceptor, self.donor


@dataclass(frozen=True, eq=False)
class Concentrations:
    """C_A and C_D (N,) mg/L at the nodes, and the iterations that they took."""

    acceptor: np.ndarray
    donor: np.ndarray
    iterations: int = 0


@timed("transport")
def problem(mesh: PoreMesh, flow: Flow | None, substrates, kinetics, inlet: str = "local",
            reused: bool = False) -> Problem:
    """Assemble both substrates' linear parts for one geometry and flow (None: pure diffusion).

    substrates, kinetics: of a scene (kinetics None without biomass); inlet: "local" or "mean", u_x or u_ave in (11);
    reused: as :class:`Problem`'s.
    """
    dofs, count = mesh.triangles, len(mesh.points)
    scalar = mesh.once("scalar", lambda: ElementSystem(dofs, np.arange(count), np.zeros(count, bool)))
    carried = 0.0 if flow is None else advection(mesh, flow)
    acceptor, donor = [_operator(mesh, flow, carried, scalar, s, inlet, substrates.boundary)
                       for s in (substrates.acceptor, substrates.donor)]
    nodes = mesh.once("node order", lambda: linear.node_order(count, dofs))
    newton = mesh.once("newton", lambda: PairPattern(scalar.indices, scalar.indptr, mesh.body, nodes))
    return Problem(mesh, acceptor, donor, mesh.lumped(mesh.biomass), mesh.lumped(), substrates, kinetics, nodes,
                   newton, reused)


def advection(mesh: PoreMesh, flow: Flow) -> np.ndarray:
    """(T, 3, 3) of (w . grad C, v) with w = u - tau grad p, linear on each triangle: the mass matrix times w . grad."""
    w = flow.velocity[mesh.triangles] - flow.correction[:, None, :]
    return mass(mesh.areas) @ (w @ np.swapaxes(mesh.gradients, 1, 2))


def _operator(mesh: PoreMesh, flow: Flow | None, carried, scalar, substrate, inlet: str, boundary: str) -> Operator:
    """Diffusion, advection and the conditions at both ends for one substrate."""
    diffusivity = np.where(mesh.biomass, substrate.diffusivity_in_aggregate, substrate.diffusivity)
    spread = each(diffusivity, forms(mesh).laplace)
    nothing, held, supplied = np.zeros(len(mesh.points)), np.empty(0, int), 0.0
    inflow = outflow = robin = nothing
    if flow is not None:
        inflow, outflow = (_edge_flux(mesh, nodes, flow.velocity[nodes, 0]) for nodes in (mesh.inlet, mesh.outlet))
        mean = np.full(len(mesh.inlet), flow.mean_velocity)
        robin = inflow if inlet == "local" else _edge_flux(mesh, mesh.inlet, mean)
        supplied = flow.mean_velocity * mesh.width * substrate.supply
    elif boundary == "open":
        held = np.concatenate([mesh.inlet, mesh.outlet])
    matrix = scalar.matrix(spread + carried)
    matrix.setdiag(matrix.diagonal() + robin)  # in its place: a sum would drop entries that happen to be zero
    return Operator(matrix, abs(matrix), robin * substrate.supply, held, inflow, outflow, supplied, substrate.supply)


def _edge_flux(mesh: PoreMesh, nodes: np.ndarray, speed: np.ndarray) -> np.ndarray:
    """(N,) integrals of u_x N_i over the inlet or outlet, um2/h, u_x linear between its nodes."""
    length = np.diff(mesh.points[nodes, 1])
    weight = np.zeros(len(mesh.points))
    weight[nodes[:-1]] += length * (2 * speed[:-1] + speed[1:]) / 6
    weight[nodes[1:]] += length * (speed[:-1] + 2 * speed[1:]) / 6
    return weight


def supplied_everywhere(problem: Problem) -> Concentrations:
    """C = C_supply in the whole pore, the state at t = 0 (2.2)."""
    ones = np.ones(len(problem.mesh.points))
    return Concentrations(problem.acceptor.supply * ones, problem.donor.supply * ones)


@timed("transport")
def steady(problem: Problem, active: np.ndarray | None, guess: Concentrations | None = None) -> Concentrations:
    """Steady concentrations: Newton's method on both substrates at once.

    active: X_A (N,) mg/L, None without biomass; guess: a first iterate, C_supply everywhere by default.
    Raises TransportError where Newton does not converge or a concentration is negative.
    """
    start = supplied_everywhere(problem) if guess is None else guess
    state = np.stack([start.acceptor, start.donor])
    weight = np.zeros(len(problem.mesh.points)) if active is None else problem.body * active
    jacobian = Jacobian(problem.reused)
    residual, size, slopes = _balance(problem, weight, state)
    for iteration in range(MOST_ITERATIONS):
        defect = _relative(residual, size)
        if defect <= NEWTON:
            return _checked(problem, weight, state, iteration)
        if jacobian.stale(defect):
            blocks = [[weight * entry for entry in row] for row in slopes]
            jacobian.factors = linear.factorised(problem.newton.matrix(*problem.both, blocks))
        state, residual, size, slopes = _advance(problem, weight, state, residual, jacobian.factors)
    raise TransportError(f"Newton's method for the substrates stands at a defect of {defect:.2g} after "
                         f"{MOST_ITERATIONS} iterations; try a larger numerics.refinement")


def _balance(problem: Problem, weight: np.ndarray, state: np.ndarray):
    """Residual (2, N), the size of the terms in each row, and the uptake's derivatives [[AA, AD], [DA, DD]] (N,)."""
    nothing = np.zeros(len(weight))
    uptake, slopes = (nothing, nothing), ((nothing, nothing), (nothing, nothing))
    if problem.kinetics is not None:
        *uptake, slopes = law.uptake(state[0], state[1], problem.substrates, problem.kinetics)
    residual, size = np.empty_like(state), np.empty_like(state)
    for k, operator in enumerate(problem.both):
        sink = weight * uptake[k]
        residual[k] = operator.matrix @ state[k] - operator.source + sink
        size[k] = operator.magnitude @ np.abs(state[k]) + operator.source + np.abs(sink)
        residual[k, operator.held] = state[k, operator.held] - operator.supply
        size[k, operator.held] = operator.supply
    return residual, size, slopes


def _relative(residual: np.ndarray, size: np.ndarray) -> float:
    """Largest residual against the size of its row's terms."""
    return float(np.max(np.abs(residual)[size > 0] / size[size > 0], initial=0.0))


def _advance(problem: Problem, weight, state, residual, factors):
    """A Newton step where it keeps both substrates positive and lowers the residual; else a positive sweep."""
    trial = state + _solve(problem, factors, -residual)
    found = _balance(problem, weight, trial)
    if trial.min() < 0 or np.linalg.norm(found[0]) > np.linalg.norm(residual):
        trial = _sweep(problem, weight, np.maximum(state, 0.0))
        found = _balance(problem, weight, trial)
    return trial, *found


def _solve(problem: Problem, factors: linear.Solver, right: np.ndarray) -> np.ndarray:
    """(2, N) solution with a matrix of both substrates, factorised."""
    solution = np.empty_like(right)
    found = factors.solve(right[:, problem.nodes].T.ravel())
    solution[:, problem.nodes] = found.reshape(-1, 2).T
    return solution


class PairPattern:
    """Sparsity of the Newton matrix of both substrates, acceptor and donor of a node side by side, nodes in elimination
    order; the substrates are coupled at the aggregate's nodes alone.

    indices, indptr: of an operator's (N, N) matrix by columns; body: coupled nodes; nodes: (N,) in elimination order.
    """

    def __init__(self, indices: np.ndarray, indptr: np.ndarray, body: np.ndarray, nodes: np.ndarray):
        self.body, self.count = body, 2 * len(nodes)
        place = np.empty(len(nodes), int)
        place[nodes] = 2 * np.arange(len(nodes))
        rows, columns = place[indices], place[np.repeat(np.arange(len(nodes)), np.diff(indptr))]
        coupled = place[body]
        pairs = [(rows, columns), (rows + 1, columns + 1), (coupled, coupled + 1), (coupled + 1, coupled)]
        keys = np.concatenate([column * self.count + row for row, column in pairs])
        by_column = np.argsort(keys)
        slot = np.empty(len(keys), int)
        slot[by_column] = np.arange(len(keys))
        self.slots = np.split(slot, np.cumsum([len(row) for row, _ in pairs])[:-1])
        self.indices = (keys[by_column] % self.count).astype(np.int32)
        self.indptr = np.searchsorted(keys[by_column], self.count * np.arange(self.count + 1)).astype(np.int32)
        self.diagonals = [np.searchsorted(keys[by_column], (place + k) * (self.count + 1)) for k in (0, 1)]

    def matrix(self, acceptor: Operator, donor: Operator, blocks) -> sp.csc_matrix:
        """(2N, 2N) operators' matrices plus diagonal blocks; the rows of held nodes are the identity's."""
        data = np.zeros(len(self.indices))
        data[self.slots[0]], data[self.slots[1]] = acceptor.matrix.data, donor.matrix.data
        for k, operator in enumerate((acceptor, donor)):
            data[self.diagonals[k]] += blocks[k][k]
            data[self.slots[2 + k]] = blocks[k][1 - k][self.body]
            rows = self.indices[self.diagonals[k][operator.held]]
            data[np.isin(self.indices, rows)] = 0.0
            data[self.diagonals[k][operator.held]] = 1.0
        return sp.csc_matrix((data, self.indices, self.indptr), shape=(self.count, self.count))


def _checked(problem: Problem, weight, state, iterations: int) -> Concentrations:
    """The solution, positive: round-off below zero is removed by one sweep with the sink written as C times a
    coefficient, which keeps a non-negative right-hand side's solution non-negative."""
    if state.min() < 0 and state.min() >= -ROUND_OFF * max(operator.supply for operator in problem.both):
        state = _sweep(problem, weight, np.maximum(state, 0.0))
    if state.min() < 0:
        which, worst = np.unravel_index(np.argmin(state), state.shape)
        x, y = problem.mesh.points[worst]
        raise TransportError(f"the {('acceptor', 'donor')[which]} is negative, {state[which, worst]:.3g} mg/L at "
                             f"x = {x:.4g}, y = {y:.4g} um; the mesh is too coarse there: "
                             "try a larger numerics.refinement")
    return Concentrations(state[0], state[1], iterations)


def _sweep(problem: Problem, weight, state) -> np.ndarray:
    """Solve (matrix + weight q(C) / C) C_new = source, with the uptake's coefficients frozen at the state."""
    *uptake, slopes = law.uptake(state[0], state[1], problem.substrates, problem.kinetics)
    tiny, zero, right = np.finfo(float).tiny, np.zeros(len(weight)), np.empty_like(state)
    per = [np.where(c > tiny, q / np.maximum(c, tiny), slopes[k][k]) for k, (c, q) in enumerate(zip(state, uptake))]
    for k, operator in enumerate(problem.both):
        right[k] = operator.source
        right[k, operator.held] = operator.supply
    blocks = [[weight * per[0], zero], [zero, weight * per[1]]]
    return _solve(problem, linear.factorised(problem.newton.matrix(*problem.both, blocks)), right)


@dataclass(frozen=True)
class Fluxes:
    """One substrate's ledger in an instant, per um of depth (um2 mg/L/h): in, out and consumed; and concentrations
    (mg/L): flow-weighted at the meshed inlet and at the outlet (the mean over the end's nodes without flow)."""

    supplied: float
    out: float
    consumed: float
    inlet: float
    effluent: float


def fluxes(problem: Problem, active: np.ndarray | None, state: Concentrations) -> tuple[Fluxes, Fluxes]:
    """Ledger of the acceptor and of the donor in one geometry."""
    q = (0.0, 0.0)
    if problem.kinetics is not None and active is not None:
        q = law.uptake(state.acceptor, state.donor, problem.substrates, problem.kinetics)[:2]
    weight = 0.0 if active is None else problem.body * active
    acceptor, donor = (_fluxes(problem.mesh, operator, field, float(np.sum(weight * rate)))
                       for operator, field, rate in zip(problem.both, (state.acceptor, state.donor), q))
    return acceptor, donor


def _fluxes(mesh: PoreMesh, operator: Operator, field: np.ndarray, consumed: float) -> Fluxes:
    supplied = operator.supplied
    if len(operator.held):
        supplied = float(np.sum((operator.matrix @ field - operator.source)[operator.held]))
    ends = [float(weight @ field / weight.sum()) if weight.any() else mean_over(mesh, nodes, field)
            for weight, nodes in ((operator.inflow, mesh.inlet), (operator.outflow, mesh.outlet))]
    return Fluxes(supplied, float(operator.outflow @ field), consumed, *ends)
