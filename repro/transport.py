"""Substrates (2.2, 3.3): advection, diffusion and uptake of acceptor and donor, (7)-(8) with (11)-(13).

Linear nodal functions N_i; the reaction is lumped at the nodes with the area of the biomass triangles around each,
so that the substrate taken up and the biomass made are the same sums. For one substrate

    (D grad C, grad N_i) + (w . grad C, N_i) + <u_x (C - C_supply), N_i>_inlet + m_i q(C_i) X_i = 0

where w = u - tau grad p is the divergence-free velocity of :mod:`repro.flow`. Summed over i, the second term is the net
flux of u C through the ends, so the balance closes to round-off: supply in = out + consumed. Without flow the supply is
held at both ends, or nothing passes them ("closed"). With the inlet's u_x replaced by u_ave, (11) reads as printed [E4].
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from skfem import Basis, BilinearForm, ElementTriP1

from repro import kinetics as law
from repro import linear
from repro.errors import TransportError
from repro.flow import Flow, gradient_product
from repro.mesh import PoreMesh
from repro.timing import timed

#: Newton stops when the residual is this small against the largest term of its row's balance.
NEWTON, MOST_ITERATIONS = 1e-13, 60
#: Concentrations below zero by less than this part of the supply are round-off, anything more is a failure.
ROUND_OFF = 1e-9


@dataclass(frozen=True, eq=False)
class Operator:
    """Linear part of one substrate in one geometry: matrix @ C - source is what must balance the uptake.

    matrix: (N, N) um2/h; source: (N,) um2 mg/L/h; held: nodes where C = supply; outflow: (N,) um2/h weights of the flux
    through the outlet; inflow: the same for the inlet; supplied: flux supplied by the inlet, um2 mg/L/h.
    """

    matrix: sp.csr_matrix
    source: np.ndarray
    held: np.ndarray
    inflow: np.ndarray
    outflow: np.ndarray
    supplied: float
    supply: float


@dataclass(frozen=True, eq=False)
class Problem:
    """Both substrates in one geometry: their operators, body (N,) um2 lumped biomass area, total (N,) lumped area."""

    mesh: PoreMesh
    acceptor: Operator
    donor: Operator
    body: np.ndarray
    total: np.ndarray
    substrates: object
    kinetics: object
    order: np.ndarray


@dataclass(frozen=True, eq=False)
class Concentrations:
    """C_A and C_D (N,) mg/L at the nodes, and the iterations that they took."""

    acceptor: np.ndarray
    donor: np.ndarray
    iterations: int = 0


@BilinearForm
def advection(u, v, w):
    """(w . grad C, v)."""
    return (w["x_speed"] * u.grad[0] + w["y_speed"] * u.grad[1]) * v


@timed("transport")
def problem(mesh: PoreMesh, flow: Flow | None, substrates, kinetics, inlet: str = "local") -> Problem:
    """Assemble both substrates' linear parts for one geometry and flow (None: pure diffusion).

    substrates, kinetics: of a scene (kinetics None without biomass); inlet: "local" or "mean", u_x or u_ave in (11).
    """
    basis = Basis(mesh.fem, ElementTriP1(), intorder=2)
    carried = None if flow is None else _advection(basis, mesh, flow)
    operators = [_operator(basis, mesh, flow, carried, s, inlet, substrates.boundary)
                 for s in (substrates.acceptor, substrates.donor)]
    count = len(mesh.points)
    nodes = linear.node_order(count, mesh.triangles)
    order = np.column_stack([nodes, count + nodes]).ravel()
    return Problem(mesh, *operators, mesh.lumped(mesh.biomass), mesh.lumped(), substrates, kinetics, order)


def _advection(basis, mesh: PoreMesh, flow: Flow):
    """(w . grad C, v) with w = u - tau grad p, linear on each triangle."""
    corner = flow.velocity[: len(mesh.points)]
    speed = [basis.interpolate(corner[:, i]) - flow.correction[:, i][:, None] for i in (0, 1)]
    return advection.assemble(basis, x_speed=speed[0], y_speed=speed[1])


def _operator(basis, mesh: PoreMesh, flow: Flow | None, carried, substrate, inlet: str, boundary: str) -> Operator:
    """Diffusion, advection and the conditions at both ends for one substrate."""
    diffusivity = np.where(mesh.biomass, substrate.diffusivity_in_aggregate, substrate.diffusivity)
    matrix = gradient_product.assemble(basis, k=np.broadcast_to(diffusivity[:, None], basis.dx.shape))
    nothing, none_held = np.zeros(len(mesh.points)), np.empty(0, int)
    if flow is None:
        held = np.concatenate([mesh.inlet, mesh.outlet]) if boundary == "open" else none_held
        return Operator(matrix, nothing, held, nothing, nothing, 0.0, substrate.supply)
    inflow, outflow = (_edge_flux(mesh, nodes, flow.velocity[nodes, 0]) for nodes in (mesh.inlet, mesh.outlet))
    robin = inflow
    if inlet == "mean":
        robin = _edge_flux(mesh, mesh.inlet, np.full(len(mesh.inlet), flow.mean_velocity))
    supplied = flow.mean_velocity * mesh.width * substrate.supply
    return Operator((matrix + carried + sp.diags_array(robin)).tocsr(), robin * substrate.supply, none_held, inflow,
                    outflow, supplied, substrate.supply)


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
    state = np.concatenate([start.acceptor, start.donor])
    weight = np.zeros(len(problem.mesh.points)) if active is None else problem.body * active
    system = _linear_system(problem)
    residual, size, jacobian = _balance(problem, system, weight, state)
    for iteration in range(MOST_ITERATIONS):
        defect = _relative(residual, size)
        if defect <= NEWTON:
            return _checked(problem, system, weight, state, iteration)
        state, residual, size, jacobian = _advance(problem, system, weight, state, residual, jacobian)
    raise TransportError(f"Newton's method for the substrates stands at a defect of {defect:.2g} after "
                         f"{MOST_ITERATIONS} iterations; try a larger numerics.refinement")


def _linear_system(problem: Problem):
    """Block matrix (2N, 2N), right-hand side and held unknowns of both substrates; held rows are the identity."""
    count = len(problem.mesh.points)
    held = np.concatenate([problem.acceptor.held, count + problem.donor.held])
    free = np.ones(2 * count)
    free[held] = 0.0
    matrix = sp.block_diag([problem.acceptor.matrix, problem.donor.matrix], format="csr")
    matrix = sp.diags_array(free) @ matrix + sp.diags_array(1 - free)
    right = np.concatenate([problem.acceptor.source, problem.donor.source])
    supply = np.repeat([problem.acceptor.supply, problem.donor.supply], count)
    return matrix.tocsr(), np.where(free > 0, right, supply), free, abs(matrix).tocsr()


def _balance(problem: Problem, system, weight: np.ndarray, state: np.ndarray):
    """Residual (2N,), the size of the terms in each row, and the Jacobian of both balances."""
    matrix, right, free, magnitude = system
    half = len(weight)
    sink, block = np.zeros(2 * half), sp.csr_matrix(matrix.shape)
    if problem.kinetics is not None:
        q_a, q_d, slopes = law.uptake(state[:half], state[half:], problem.substrates, problem.kinetics)
        sink = free * np.concatenate([weight * q_a, weight * q_d])
        diagonals = [[sp.diags_array(weight * entry) for entry in row] for row in slopes]
        block = sp.diags_array(free) @ sp.block_array(diagonals)
    return matrix @ state - right + sink, magnitude @ np.abs(state) + right + np.abs(sink), (matrix + block).tocsr()


def _relative(residual: np.ndarray, size: np.ndarray) -> float:
    """Largest residual against the size of its row's terms."""
    return float(np.max(np.abs(residual)[size > 0] / size[size > 0], initial=0.0))


def _advance(problem, system, weight, state, residual, jacobian):
    """A Newton step where it keeps both substrates positive and lowers the residual; else a sweep, which is positive."""
    trial = state + linear.solve(jacobian, -residual, problem.order)
    found = _balance(problem, system, weight, trial)
    if trial.min() < 0 or np.linalg.norm(found[0]) > np.linalg.norm(residual):
        trial = _sweep(problem, system, weight, np.maximum(state, 0.0))
        found = _balance(problem, system, weight, trial)
    return trial, *found


def _checked(problem, system, weight, state, iterations: int) -> Concentrations:
    """The solution, positive: round-off below zero is removed by one sweep with the sink written as C times a
    coefficient, which keeps a non-negative right-hand side's solution non-negative."""
    half = len(weight)
    supply = np.repeat([problem.acceptor.supply, problem.donor.supply], half)
    if (state < 0).any() and (state >= -ROUND_OFF * np.maximum(supply, supply.max())).all():
        state = _sweep(problem, system, weight, np.maximum(state, 0.0))
    if (state < 0).any():
        worst = int(np.argmin(state))
        where = problem.mesh.points[worst % half]
        name = "acceptor" if worst < half else "donor"
        raise TransportError(f"the {name} is negative, {state[worst]:.3g} mg/L at x = {where[0]:.4g}, y = {where[1]:.4g} um; "
                             "the mesh is too coarse there: try a larger numerics.refinement")
    return Concentrations(state[:half], state[half:], iterations)


def _sweep(problem, system, weight, state):
    """Solve (matrix + weight q(C) / C) C_new = right, with the uptake's coefficients frozen at the state."""
    matrix, right, free, _ = system
    half = len(weight)
    q_a, q_d, slopes = law.uptake(state[:half], state[half:], problem.substrates, problem.kinetics)
    tiny = np.finfo(float).tiny
    per = np.concatenate([np.where(state[:half] > tiny, q_a / np.maximum(state[:half], tiny), slopes[0][0]),
                          np.where(state[half:] > tiny, q_d / np.maximum(state[half:], tiny), slopes[1][1])])
    return linear.solve(matrix + sp.diags_array(free * np.tile(weight, 2) * per), right, problem.order)


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
    return tuple(_fluxes(problem.mesh, operator, field, float(np.sum(weight * rate)))
                 for operator, field, rate in ((problem.acceptor, state.acceptor, q[0]), (problem.donor, state.donor, q[1])))


def _fluxes(mesh: PoreMesh, operator: Operator, field: np.ndarray, consumed: float) -> Fluxes:
    supplied = operator.supplied
    if len(operator.held):
        supplied = float(np.sum((operator.matrix @ field - operator.source)[operator.held]))
    ends = [float(weight @ field / weight.sum()) if weight.any() else _mean(mesh, nodes, field)
            for weight, nodes in ((operator.inflow, mesh.inlet), (operator.outflow, mesh.outlet))]
    return Fluxes(supplied, float(operator.outflow @ field), consumed, *ends)


def _mean(mesh: PoreMesh, nodes: np.ndarray, field: np.ndarray) -> float:
    return float(np.trapezoid(field[nodes], mesh.points[nodes, 1]) / mesh.width)
