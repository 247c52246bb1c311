"""Substrates (2.2, 3.3): advection, diffusion and uptake of acceptor and donor, (7)-(8) with (11)-(13).

For one substrate and every nodal function N_i, with order 2 or 3 in the form that conserves,

    (D grad C, grad N_i) - (C u, grad N_i) + <u_x C, N_i>_outlet + (q(C) X_A, N_i)_biomass = <u_x C_supply, N_i>_inlet

and with linear functions, the reaction lumped at the nodes,

    (D grad C, grad N_i) + (w . grad C, N_i) + <u_x (C - C_supply), N_i>_inlet + m_i q(C_i) X_i = 0

where w = u - tau grad p is the divergence-free velocity of :mod:`repro.model.flow`. Summed over i either is the balance:
supply in = out + consumed, to round-off. Without flow the supply is held at both ends, or nothing passes them
("closed"). With u_ave for the inlet's u_x, (11) reads as printed [E4], and what is supplied, u_ave W C_supply, is not
quite what enters.
"""

from __future__ import annotations

from copy import copy
from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse as sp

from repro.errors import TransportError
from repro.fem.assembly import ElementSystem, Factored, each, mass
from repro.fem.mesh import Mesh
from repro.fem.newton import Newton, relative
from repro.fem.space import Space
from repro.model.flow import Flow
from repro.model.kinetics import Sink
from repro.scene import Kinetics, Substrate, Substrates
from repro.timing import timed

#: Newton stops at this residual against the size of its terms, or at the second where round-off keeps it from falling.
NEWTON, ROUND_OFF, MOST_ITERATIONS = 1e-13, 1e-12, 60
#: Parts of a step of Newton's method that are tried, and by how much of them the residual must fall.
LENGTHS, FALL = 0.5 ** np.arange(8), 1e-4
#: A concentration below zero by more than this part of the larger supply is not resolved. Where a substrate is used up
#: behind a front of 2 um, the coarsest preset has -1.6e-4, with effluents right to 5e-5 of the supply.
UNRESOLVED = 1e-3
#: Neither is one above its supply by more than this part of it.
OVERSHOOT = 0.02
#: Linear concentrations with a lumped reaction below zero by less than this part of the supply are so by round-off.
NEGATIVE = 1e-9


@dataclass(frozen=True, eq=False)
class Problem:
    """Both substrates in one geometry, with n nodes in all and k a triangle.

    matrices: (T, k, k) um2/h of each, without uptake; operator: (2n, 2n) of both, not coupled, and magnitude: the same
    of its entries; source: (2n,) um2 mg/L/h; inflow, outflow: (n,) um2/h, integrals of u_x N_i over an end; system: of
    both, coupled where there is biomass; kinetics: None without biomass; reused: does Newton's method keep its
    derivative while that does enough?
    """

    space: Space
    matrices: tuple[np.ndarray, np.ndarray]
    operator: sp.csc_matrix
    magnitude: sp.csc_matrix
    source: np.ndarray
    inflow: np.ndarray
    outflow: np.ndarray
    system: ElementSystem
    substrates: Substrates
    kinetics: Kinetics | None
    reused: bool

    @property
    def mesh(self) -> Mesh:
        """Of the space."""
        return self.space.mesh

    @property
    def both(self) -> tuple[Substrate, Substrate]:
        """Acceptor and donor, as the scene describes them."""
        return self.substrates.acceptor, self.substrates.donor

    @property
    def supply(self) -> np.ndarray:
        """(2n,) mg/L, of the acceptor at all nodes, then of the donor."""
        return np.repeat([s.supply for s in self.both], self.space.count)

    @property
    def floor(self) -> float:
        """How far (mg/L) below zero a concentration may be: a lumped reaction of linear ones keeps them positive."""
        return 0.0 if self.space.order == 1 else UNRESOLVED * max(s.supply for s in self.both)


@dataclass(frozen=True, eq=False)
class Concentrations:
    """C_A and C_D (n,) mg/L at the nodes of their space, and the iterations that they took."""

    acceptor: np.ndarray
    donor: np.ndarray
    iterations: int = 0


@timed("transport")
def problem(space: Space, flow: Flow | None, substrates: Substrates, kinetics: Kinetics | None,
            inlet: str = "local", reused: bool = False) -> Problem:
    """Assemble both substrates' linear parts for one geometry and flow of the same space (None: pure diffusion).

    inlet: "local" or "mean", u_x or u_ave in (11); reused: as :class:`Problem`'s.
    """
    kinds, dofs = (substrates.acceptor, substrates.donor), space.dofs
    carried, source = np.zeros((1, 1, 1)), np.zeros(space.count)
    inflow, outflow = np.zeros(space.count), np.zeros(space.count)
    if flow is not None:
        u_x = flow.velocity[:, 0]
        enters = u_x if inlet == "local" else np.full(space.count, flow.mean_velocity)
        inflow = space.summed(dofs.inlet, space.end_loads(dofs.inlet, u_x))
        outflow = space.summed(dofs.outlet, space.end_loads(dofs.outlet, u_x))
        source = space.summed(dofs.inlet, space.end_loads(dofs.inlet, enters))
        carried = advection(space, flow, enters)
    spread = [np.where(space.mesh.biomass, s.diffusivity_in_aggregate, s.diffusivity) for s in kinds]
    matrices = each(spread[0], space.stiffness) + carried, each(spread[1], space.stiffness) + carried
    held = flow is None and substrates.boundary == "open"
    operator = space.mesh.topology.system(("both", space.order), lambda: _apart(space)).matrix(matrices)
    system = space.mesh.topology.system(("transport", space.order, held), lambda: _system(space, held))
    magnitude = copy(operator)
    magnitude.data = np.abs(operator.data)
    return Problem(space, matrices, operator, magnitude, np.concatenate([s.supply * source for s in kinds]), inflow,
                   outflow, system, substrates, kinetics, reused)


def advection(space: Space, flow: Flow, enters: np.ndarray) -> np.ndarray:
    """(T, k, k) um2/h of what the flow carries, with the conditions at inlet and outlet; enters: (n,) um/h, the speed
    in (11)."""
    if flow.correction is None:
        return _conserving(space, flow.velocity, enters)
    return _by_divergence_free(space, flow, enters)


def _conserving(space: Space, velocity: np.ndarray, enters: np.ndarray) -> np.ndarray:
    """-(C u, grad v), u_x C v over the outlet, and (u_ave - u_x) C v over the inlet where (11) has u_ave [E4]."""
    at, dofs = space.at, space.dofs
    u_x, u_y = space.at_points(velocity.T) * -at.dx
    along = u_x[..., None] * at.slopes[:, :, 0]
    along += u_y[..., None] * at.slopes[:, :, 1]
    found = space.load(np.swapaxes(along, 1, 2))
    _add_at(space, found, dofs.outlet, space.end_masses(dofs.outlet, velocity[:, 0]))
    if enters is not velocity[:, 0] and np.any(enters[dofs.inlet] != velocity[dofs.inlet, 0]):
        _add_at(space, found, dofs.inlet, space.end_masses(dofs.inlet, enters - velocity[:, 0]))
    return found


def _by_divergence_free(space: Space, flow: Flow, enters: np.ndarray) -> np.ndarray:
    """(w . grad C, v) with w = u - tau grad p, linear on each triangle, and u_x C v over the inlet, lumped."""
    mesh, dofs = space.mesh, space.dofs
    w = flow.velocity[mesh.triangles] - flow.correction[:, None, :]
    found = mass(mesh.areas) @ (w @ np.swapaxes(mesh.gradients, 1, 2))
    loads = space.end_loads(dofs.inlet, enters)
    _add_at(space, found, dofs.inlet, loads[:, :, None] * np.eye(loads.shape[1]))
    return found


def _add_at(space: Space, matrices: np.ndarray, edges: np.ndarray, blocks: np.ndarray) -> None:
    """Add (E, e, e) of the edges of an end to the element matrices of their triangles, in place."""
    owner, place = space.owners(edges)
    np.add.at(matrices, (owner[:, None, None], place[:, :, None], place[:, None, :]), blocks)


def _apart(space: Space) -> ElementSystem:
    """Acceptor, then donor of all nodes in their own order, without their uptake."""
    count = 2 * space.count
    return ElementSystem((space.cells, space.count + space.cells), np.arange(count), np.zeros(count, bool),
                         space.mesh.topology.method)


def _system(space: Space, held_ends: bool) -> ElementSystem:
    """Acceptor and donor of a node side by side, nodes in elimination order: their own triangles, then both together
    on the pieces of biomass, where the uptake couples them."""
    place = np.empty(space.count)
    place[space.dofs.elimination] = np.arange(space.count)
    held = np.zeros(space.count, bool)
    held[both_ends(space)] = held_ends
    pieces = space.reaction.cells
    both = np.concatenate([pieces, space.count + pieces], axis=1)
    return ElementSystem((space.cells, space.count + space.cells, both), np.concatenate([place, place + 0.5]),
                         np.tile(held, 2), space.mesh.topology.method)


def both_ends(space: Space) -> np.ndarray:
    """Nodes of the inlet and of the outlet."""
    return np.concatenate([space.end_nodes(space.dofs.inlet), space.end_nodes(space.dofs.outlet)])


def supplied_everywhere(problem: Problem) -> Concentrations:
    """C = C_supply in the whole pore, the state at t = 0 (2.2)."""
    acceptor, donor = problem.supply.reshape(2, -1)
    return Concentrations(acceptor, donor)


@dataclass(frozen=True, eq=False)
class Iterate:
    """Both concentrations (2n,), their residual and the size of its terms, um2 mg/L/h."""

    state: np.ndarray
    residual: np.ndarray
    size: np.ndarray
    free: np.ndarray | slice

    #: Constrained nodes have their supply from the start.
    complete = True

    @property
    def defect(self) -> float:
        """Largest residual of a free node against the size of its row's terms."""
        return relative(self.residual[self.free], self.size[self.free])

    @property
    def length(self) -> float:
        """Of the residual at free nodes."""
        return float(np.linalg.norm(self.residual[self.free]))


@dataclass(frozen=True, eq=False)
class Balance:
    """The equations of a problem with a sink (None: nothing is taken up), as Newton's method asks for them.

    extended: uptake below zero as :mod:`repro.model.kinetics` has it for iterates; shortened: steps are cut until the
    residual falls.
    """

    problem: Problem
    sink: Sink | None
    extended: bool = True
    shortened: bool = False

    def _at(self, state: np.ndarray):
        """C_A and C_D (r, q) in the points of the reaction, and the laws."""
        problem = self.problem
        pieces = problem.space.reaction
        acceptor, donor = state.reshape(2, -1)[:, pieces.cells] @ pieces.values.T
        return acceptor, donor, problem.substrates, problem.kinetics

    def _taken(self, loads: np.ndarray) -> np.ndarray:
        """(2n,) sum of loads (r, 2, q) times the nodal functions."""
        pieces, count = self.problem.space.reaction, self.problem.space.count
        nodes = np.stack([pieces.cells, count + pieces.cells], axis=1)
        return np.bincount(nodes.ravel(), (loads @ pieces.values).ravel(), 2 * count)

    def uptake(self, state: np.ndarray) -> np.ndarray:
        """(r, 2, q) um2 mg/L/h."""
        return self.sink.uptake(*self._at(state), self.extended)

    def residual(self, state: np.ndarray) -> np.ndarray:
        """(2n,) um2 mg/L/h for C_A, then C_D, of all nodes (2n,), mg/L."""
        found = self.problem.operator @ state - self.problem.source
        return found if self.sink is None else found + self._taken(self.uptake(state))

    def sizes(self, state: np.ndarray) -> np.ndarray:
        """Sizes (2n,) of the terms of the residual, all taken as positive."""
        found = self.problem.magnitude @ np.abs(state) + np.abs(self.problem.source)
        if self.sink is None:
            return found
        pieces, count = self.problem.space.reaction, self.problem.space.count
        nodes = np.stack([pieces.cells, count + pieces.cells], axis=1)
        loads = np.abs(self.uptake(state)) @ np.abs(pieces.values)
        return found + np.bincount(nodes.ravel(), loads.ravel(), 2 * count)

    def tangent(self, state: np.ndarray) -> tuple[np.ndarray, ...]:
        """Element matrices, um2/h, of the residual's derivative: of both substrates and of their uptake."""
        slopes = {}
        if self.sink is not None:
            by = self.sink.slopes(*self._at(state), self.extended)
            slopes = {(i, j): by[i][j] for i, j in np.ndindex(2, 2)}
        return *self.problem.matrices, self._coupled(slopes)

    def _coupled(self, slopes: dict[tuple[int, int], np.ndarray]) -> np.ndarray:
        """(r, 2k, 2k) of the derivatives (r, q) of the uptake of i by the concentration of j, um2/h."""
        pieces = self.problem.space.reaction
        count, k = pieces.cells.shape
        products = (pieces.values[:, :, None] * pieces.values[:, None, :]).reshape(len(pieces.values), -1)
        found = np.zeros((count, 2 * k, 2 * k))
        for (i, j), slope in slopes.items():
            found[:, i * k: i * k + k, j * k: j * k + k] = (slope @ products).reshape(count, k, k)
        return found

    def begun(self, state: np.ndarray) -> Iterate:
        """The first iterate."""
        return Iterate(state, self.residual(state), self.sizes(state), self.problem.system.free)

    def factored(self, iterate: Iterate) -> Factored:
        """The derivative, factorised."""
        return self.problem.system.factored(self.tangent(iterate.state))

    def advanced(self, iterate: Iterate, factors: Factored, fresh: bool) -> Iterate:
        """A step of Newton's method where it lowers the residual and nothing is negative, else :meth:`swept`; sizes of
        the terms are those of the first guess, then those after the first step of each derivative."""
        step = factors.solve(-iterate.residual)
        new = self._shorter(iterate, step) if self.shortened else self._full(iterate, step)
        return replace(new, size=self.sizes(new.state)) if fresh else new

    def _tried(self, iterate: Iterate, state: np.ndarray) -> Iterate:
        return replace(iterate, state=state, residual=self.residual(state))

    def _full(self, iterate: Iterate, step: np.ndarray) -> Iterate:
        trial = self._tried(iterate, iterate.state + step)
        if trial.length > iterate.length or trial.state.min() < -self.problem.floor:
            return self._tried(iterate, self.swept(np.maximum(iterate.state, 0.0)))
        return trial

    def _shorter(self, iterate: Iterate, step: np.ndarray) -> Iterate:
        """The longest part of a step that lowers the residual."""
        for length in LENGTHS:
            trial = self._tried(iterate, iterate.state + length * step)
            if trial.length <= (1 - FALL * length) * iterate.length:
                return trial
        return self._tried(iterate, self.swept(np.maximum(iterate.state, 0.0)))

    def swept(self, state: np.ndarray) -> np.ndarray:
        """(2n,) solution with the uptake's coefficients q(C) / C frozen at the state, which keeps what is positive so,
        as far as functions of higher order can."""
        per = {}
        if self.sink is not None:
            at = self._at(state)
            taken, slopes = self.sink.uptake(*at, True), self.sink.slopes(*at, True)
            for k, c in enumerate(at[:2]):
                tiny = 1e-9 * self.problem.both[k].half_saturation
                per[k, k] = np.where(c > tiny, taken[:, k] / np.maximum(c, tiny), slopes[k][k])
        elements = *self.problem.matrices, self._coupled(per)
        return self.problem.system.solve(elements, self.problem.source, state)


@timed("transport")
def steady(problem: Problem, sink: Sink | None, guess: Concentrations | None = None) -> Concentrations:
    """Steady concentrations by Newton's method on both substrates at once.

    sink: what takes them up, None without biomass; guess: at the problem's nodes, C_supply everywhere by default. Where
    the method does not converge, as behind a sharp front, it starts again from the supply with shorter steps, and half
    saturations come down from the supply to what they are, a tenth at a time. Raises TransportError where that fails
    too, or where a concentration is outside of zero to the supply by more than UNRESOLVED and OVERSHOOT say: the mesh
    is too coarse for its front.
    """
    if problem.kinetics is None:
        sink = None
    supply = problem.supply
    state = supply.copy() if guess is None else np.concatenate([guess.acceptor, guess.donor])
    state[problem.system.held] = supply[problem.system.held]
    try:
        found, count = _found(Balance(problem, sink), state)
    except TransportError:
        found, count = _eased(problem, sink, supply)
    if sink is not None and found.min() < 0:
        found, more = _found(Balance(problem, sink, extended=False), found)
        count += more
    return _checked(problem, sink, found, count)


def _found(balance: Balance, state: np.ndarray) -> tuple[np.ndarray, int]:
    """(2n,) the solution from a start, and Newton's iterations."""
    newton = Newton(NEWTON, ROUND_OFF, MOST_ITERATIONS, balance.problem.reused)
    last, count, converged = newton.solve(balance, balance.begun(state))
    if not converged:
        raise TransportError(f"Newton's method for the substrates stands at a defect of {last.defect:.2g} after "
                             f"{count} iterations; try a larger numerics.refinement")
    return last.state, count


def _eased(problem: Problem, sink: Sink | None, state: np.ndarray) -> tuple[np.ndarray, int]:
    """Newton's method with half saturations that fall from the supply to what they are."""
    least = min(s.half_saturation / max(s.supply, s.half_saturation) for s in problem.both)
    total = 0
    for factor in 10.0 ** np.arange(np.ceil(-np.log10(least)), -1, -1):
        acceptor, donor = (_softened(substrate, factor) for substrate in problem.both)
        eased = replace(problem, substrates=replace(problem.substrates, acceptor=acceptor, donor=donor))
        state, iterations = _found(Balance(eased, sink, shortened=True), state)
        total += iterations
    return state, total


def _softened(substrate: Substrate, factor: float) -> Substrate:
    """With a half saturation larger by a factor, but for one above the supply."""
    half = max(substrate.half_saturation, min(factor * substrate.half_saturation, substrate.supply))
    return replace(substrate, half_saturation=half)


def _checked(problem: Problem, sink: Sink | None, state: np.ndarray, iterations: int) -> Concentrations:
    """The solution, if it stays between zero and the supply as well as it has to. Linear concentrations that are below
    zero by round-off are swept once, which keeps a non-negative right-hand side's solution non-negative."""
    round_off = NEGATIVE * max(s.supply for s in problem.both)
    if problem.floor == 0 and -round_off <= state.min() < 0:
        state = Balance(problem, sink).swept(np.maximum(state, 0.0))
    for name, field, substrate in zip(("acceptor", "donor"), state.reshape(2, -1), problem.both):
        if field.min() < -problem.floor:
            raise _outside(problem, name, field, int(field.argmin()), substrate)
        if problem.space.order > 1 and field.max() > (1 + OVERSHOOT) * substrate.supply:
            raise _outside(problem, name, field, int(field.argmax()), substrate)
    acceptor, donor = state.reshape(2, -1)
    return Concentrations(acceptor, donor, iterations)


def _outside(problem: Problem, name: str, field: np.ndarray, node: int, substrate: Substrate) -> TransportError:
    x, y = problem.space.points[node]
    return TransportError(f"the {name} is {field[node]:.3g} mg/L at x = {x:.4g}, y = {y:.4g} um, outside of 0 to "
                          f"{substrate.supply:g}; the mesh is too coarse there: try a larger numerics.refinement")


@dataclass(frozen=True)
class Fluxes:
    """One substrate's ledger in an instant, per um of depth (um2 mg/L/h): in, out and consumed; and concentrations
    (mg/L): flow-weighted at the meshed inlet and at the outlet (the mean over the end without flow)."""

    supplied: float
    out: float
    consumed: float
    inlet: float
    effluent: float


def fluxes(problem: Problem, sink: Sink | None, state: Concentrations) -> tuple[Fluxes, Fluxes]:
    """Ledger of the acceptor and of the donor in one geometry: supplied and out from the ends, consumed from the uptake
    at the state."""
    space, both = problem.space, np.stack([state.acceptor, state.donor])
    consumed, out = np.zeros(2), both @ problem.outflow
    if sink is not None and problem.kinetics is not None:
        consumed = Balance(problem, sink, extended=False).uptake(both.ravel()).sum(axis=(0, 2))
    supplied = problem.source.reshape(2, -1).sum(axis=1)
    if problem.system.held.any():
        through = (problem.operator @ both.ravel()).reshape(2, -1)
        supplied = through[:, both_ends(space)].sum(axis=1)
    means = [_end_means(space, both, edges, load) for edges, load in
             ((space.dofs.inlet, problem.inflow), (space.dofs.outlet, problem.outflow))]
    acceptor, donor = np.column_stack([supplied, out, consumed, *means]).tolist()
    return Fluxes(*acceptor), Fluxes(*donor)


def _end_means(space: Space, both: np.ndarray, edges: np.ndarray, load: np.ndarray) -> np.ndarray:
    """(2,) mg/L, weighted with the flow through an end, plain where nothing flows."""
    if not load.any():
        load = space.summed(edges, space.end_loads(edges, np.ones(space.count)))
    return both @ load / load.sum()
