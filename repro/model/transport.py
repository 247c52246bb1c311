"""Substrates (2.2, 3.3): advection, diffusion and uptake of acceptor and donor, (7)-(13).

For one substrate and every nodal function N_i, quadratic functions satisfy the conserving form

    (D grad C, grad N_i) - (C w, grad N_i) + <u_x C, N_i>_outlet + (q(C) X_A, N_i)_biomass
        = <u_x C_supply, N_i>_inlet

where w = u - grad psi has (w, grad N_i) = <u_x, N_i>_outlet - <u_x, N_i>_inlet for every N_i.
Therefore C = C_supply is a solution without uptake. Linear functions satisfy, with the reaction
lumped at the nodes,

    (D grad C, grad N_i) + (w . grad C, N_i) + <u_x (C - C_supply), N_i>_inlet + m_i q(C_i) X_i = 0

where w = u - tau grad p has the same property (:mod:`repro.model.flow`). The sum of either form
over i is the balance: supplied = out + consumed, to round-off. Without flow, both ends have the
concentration C_supply ("open"), or no flux ("closed"). With u_ave in place of u_x at the inlet,
(11) is as printed [E4], but the supply u_ave W C_supply then differs slightly from the inflow.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from copy import copy
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
import scipy.sparse as sp

from repro.errors import LinearError, TransportError, Unresolved, failing_as
from repro.fem.assembly import ElementSystem, Factored
from repro.fem.brief import brief
from repro.fem.forms import Basis, each, mass
from repro.fem.mesh import Mesh
from repro.fem.newton import Newton, relative
from repro.fem.space import End, Space
from repro.model.flow import Flow
from repro.model.kinetics import RateLaw, Sink, rate_law
from repro.model.uptake_law import LARGEST_SATURATION, UptakeLaw
from repro.scene import Kinetics, Substrate, Substrates, needed
from repro.schemes import PAPER, UNRESOLVED, Scheme
from repro.timing import timed

#: Newton's method stops at this residual relative to the size of its terms.
NEWTON = 1e-13
#: The method also stops at this residual, if round-off prevents a further decrease.
ROUND_OFF = 1e-12
MOST_ITERATIONS = 60
#: Upper limit of a predicted saturation s, so that C = K s / (1 - s) is finite.
SATURATED = 0.9
#: Above this saturation, uptake is linearised about the actual concentration.
SWITCH = 0.5
#: The uptake is not resolved if its relative difference from a quadrature of a degree higher by
#: FINER is above APART. Both quadratures use the same concentrations. In base with fronts of half
#: saturations from 1e-1 to 1e-6 of the supply, the error of the biomass made in 2 h was at most a
#: hundredth of the largest difference.
APART = 0.05
FINER = 3


@brief
@dataclass(frozen=True, eq=False)
class Problem:
    """Equations of the s = 1 or 2 modelled substrates in one geometry, with n nodes.

    matrices: for each substrate, (T, k, k) um2/h, without uptake; operator: (sn, sn) of all
    substrates, uncoupled; magnitude: absolute values of its entries; source: (sn,) um2 mg/L/h;
    inflow, outflow: (n,) um2/h, integrals of u_x N_i over an end; system: of all substrates,
    coupled in biomass; law: None without biomass; scheme: its limits of the concentrations and its
    Newton's method.
    """

    space: Space
    matrices: tuple[np.ndarray, ...]
    operator: sp.csc_matrix
    magnitude: sp.csc_matrix
    source: np.ndarray
    inflow: np.ndarray
    outflow: np.ndarray
    system: ElementSystem
    substrates: Substrates
    law: RateLaw | None
    scheme: Scheme

    @property
    def mesh(self) -> Mesh:
        """The mesh of the space."""
        return self.space.mesh

    @property
    def kinds(self) -> tuple[Substrate, ...]:
        """The modelled substrates, as the scene describes them, the acceptor first."""
        return tuple(self.substrates.modelled.values())

    @property
    def rate_law(self) -> RateLaw:
        """The law of the biomass. Raises MissingError without biomass."""
        return needed(self.law, "[kinetics]")

    @property
    def supply(self) -> np.ndarray:
        """(sn,) mg/L, supply of one substrate at all nodes, then of the other substrate."""
        return np.repeat([s.supply for s in self.kinds], self.space.count)


@brief
@dataclass(frozen=True, eq=False)
class Concentrations:
    """Concentrations at the nodes of a space.

    acceptor, donor: C_A and C_D (n,) mg/L, None if the substrate is not modelled; iterations: of
    Newton's method.
    """

    acceptor: np.ndarray | None
    donor: np.ndarray | None
    iterations: int = 0

    @property
    def fields(self) -> np.ndarray:
        """(s, n) mg/L, of the modelled substrates."""
        return np.stack([field for field in (self.acceptor, self.donor) if field is not None])

    def with_fields(self, fields: np.ndarray) -> Concentrations:
        """The same substrates with other fields (s, n)."""
        rows = iter(fields)
        acceptor, donor = (None if field is None else next(rows)
                           for field in (self.acceptor, self.donor))
        return replace(self, acceptor=acceptor, donor=donor)


def concentrations(substrates: Substrates, fields: np.ndarray,
                   iterations: int = 0) -> Concentrations:
    """The concentrations of the modelled substrates from their fields (s, n), mg/L."""
    named = dict(zip(substrates.modelled, fields))
    return Concentrations(named.get("acceptor"), named.get("donor"), iterations)


@timed("transport")
def problem(space: Space, flow: Flow | None, substrates: Substrates, kinetics: Kinetics | None,
            scheme: Scheme = PAPER) -> Problem:
    """Assemble the linear parts of the substrates' equations in one geometry.

    Parameters
    ----------
    space : Space
        Space of the concentrations, and of the flow's velocity.
    flow : Flow, optional
        None without flow.
    substrates : Substrates
    kinetics : Kinetics, optional
        None without biomass.
    scheme : Scheme
        Determines inlet, carrier, the limits of the concentrations and Newton's method.

    Returns
    -------
    Problem
    """
    topology = space.mesh.topology
    kinds = tuple(substrates.modelled.values())
    count = len(kinds)
    carried, source, inflow, outflow = _through(space, flow, scheme)
    matrices = tuple(diffusion(space, kind) + carried for kind in kinds)
    constrained = flow is None and substrates.boundary == "open"
    uncoupled = topology.system(("uncoupled", count), lambda: _apart(space, count))
    operator = uncoupled.matrix(matrices)
    system = coupled_system(space, constrained, count)
    magnitude = copy(operator)
    magnitude.data = np.abs(operator.data)
    sources = np.concatenate([kind.supply * source for kind in kinds])
    law = None if kinetics is None else rate_law(substrates, kinetics).on(space, substrates)
    return Problem(space, matrices, operator, magnitude, sources, inflow, outflow, system,
                   substrates, law, scheme)


def diffusion(space: Space, kind: Substrate) -> np.ndarray:
    """(T, k, k) um2/h of (D grad C, grad v)."""
    spread = np.where(space.mesh.biomass, kind.diffusivity_in_aggregate, kind.diffusivity)
    return each(spread, space.stiffness)


def _through(space: Space, flow: Flow | None,
             scheme: Scheme) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Advection (T, k, k) um2/h, and the loads (n,) um2/h of supply, inflow and outflow; all zero
    without flow."""
    if flow is None:
        return np.zeros((1, 1, 1)), *np.zeros((3, space.count))
    u_x = flow.velocity[:, 0]
    enters = INLETS[scheme.inlet](flow)
    source = space.inlet.assembled(enters)
    inflow = space.inlet.assembled(u_x)
    outflow = space.outlet.assembled(u_x)
    carrier = CARRIERS[scheme.carrier]
    return advection(space, flow, enters, carrier), source, inflow, outflow


def local_speed(flow: Flow) -> np.ndarray:
    """(n,) um/h, u_x(y) in (11)."""
    return flow.velocity[:, 0]


def mean_speed(flow: Flow) -> np.ndarray:
    """(n,) um/h, u_ave in (11), as printed [E4]."""
    return np.full(len(flow.velocity), flow.mean_velocity)


#: {inlet of the scheme: speed in (11)}.
INLETS = {"local": local_speed, "mean": mean_speed}


def advection(space: Space, flow: Flow, enters: np.ndarray, carrier: type[Carrier]) -> np.ndarray:
    """(T, k, k) um2/h of advection, with the conditions at inlet and outlet; enters: (n,) um/h, the
    speed in (11)."""
    if flow.correction is None:
        return _conserving(space, flow.velocity, carrier.quadratic(space, flow.velocity), enters)
    return _by_corners(space, carrier.linear(flow, flow.correction, space.mesh), enters)


class Carrier(ABC):
    """The velocity that carries the substrates."""

    @staticmethod
    @abstractmethod
    def linear(flow: Flow, correction: np.ndarray, mesh: Mesh) -> np.ndarray:
        """(T, 3, 2) um/h at the corners of straight triangles; correction: (T, 2) tau grad p."""

    @staticmethod
    @abstractmethod
    def quadratic(space: Space, velocity: np.ndarray) -> np.ndarray:
        """(2, T, q) um/h at the quadrature points of curved triangles."""


class DivergenceFree(Carrier):
    """w; its divergence vanishes against every function of the space."""

    @staticmethod
    def linear(flow: Flow, correction: np.ndarray, mesh: Mesh) -> np.ndarray:
        """w = u - tau grad p."""
        return flow.velocity[mesh.triangles] - correction[:, None, :]

    @staticmethod
    def quadratic(space: Space, velocity: np.ndarray) -> np.ndarray:
        """w = u - grad psi."""
        return divergence_free(space, velocity)


class Printed(Carrier):
    """u, as printed in (7)-(8)."""

    @staticmethod
    def linear(flow: Flow, correction: np.ndarray, mesh: Mesh) -> np.ndarray:
        """u, as printed. Substrate appears or vanishes where the divergence of u is not zero."""
        return flow.velocity[mesh.triangles]

    @staticmethod
    def quadratic(space: Space, velocity: np.ndarray) -> np.ndarray:
        """u, as printed. With u, a constant concentration is not a solution."""
        return space.at.evaluate(velocity.T)


#: {carrier of the scheme: class}.
CARRIERS: dict[str, type[Carrier]] = {"w": DivergenceFree, "u": Printed}


def _conserving(space: Space, velocity: np.ndarray, carrier: np.ndarray,
                enters: np.ndarray) -> np.ndarray:
    """(T, k, k) um2/h of -(C w, grad v) plus <u_x C, v> over the outlet; carrier: (2, T, q) w.

    If (11) contains u_ave [E4], <(u_ave - u_x) C, v> over the inlet is added.
    """
    dofs = space.dofs
    u_x = velocity[:, 0]
    matrices = space.at.advection(carrier * -space.at.dx)
    _add_at(matrices, dofs.beside_outlet, space.outlet.mass(u_x))
    if np.any(enters[dofs.inlet] != u_x[dofs.inlet]):
        _add_at(matrices, dofs.beside_inlet, space.inlet.mass(enters - u_x))
    return matrices


def divergence_free(space: Space, velocity: np.ndarray) -> np.ndarray:
    """(2, T, q) um/h of w = u - grad psi at the quadrature points, where psi in the space solves

        (grad psi, grad v) = (u, grad v) + <u_x, v>_inlet - <u_x, v>_outlet    for all v.

    So (w, grad v) is the flux through the ends for every v of the space. The divergence of
    Taylor-Hood velocities vanishes only against functions of one order less. With u as carrier a
    constant concentration is therefore not a solution. The exact velocity has psi = 0, and grad psi
    is at most as large as the error of u.
    """
    at = space.at
    u = at.evaluate(velocity.T)
    load = at.assemble(at.flux(np.moveaxis(u * at.dx, 0, 2)[:, None]))
    load += space.inlet.assembled(velocity[:, 0])
    load -= space.outlet.assembled(velocity[:, 0])
    system = space.mesh.topology.system("potential", lambda: _potential(space))
    psi = system.solve(space.stiffness, load)
    return u - np.moveaxis(at.gradient(psi[:, None])[:, 0], 2, 0)


def _potential(space: Space) -> ElementSystem:
    """The system of psi, which is zero at one node of the outlet."""
    constrained = np.zeros(space.count, bool)
    constrained[space.dofs.outlet[0, 0]] = True
    return ElementSystem(space.cells, space.dofs.places, constrained, space.mesh.topology.method)


def _by_corners(space: Space, w: np.ndarray, enters: np.ndarray) -> np.ndarray:
    """(T, 3, 3) um2/h of (w . grad C, v) plus the lumped <u_x C, v> over the inlet.

    w: (T, 3, 2) um/h at the corners, linear on each triangle; enters: (n,) um/h, u_x in (11).
    """
    mesh = space.mesh
    matrices = mass(mesh.areas) @ (w @ np.swapaxes(mesh.gradients, 1, 2))
    loads = space.inlet.load(enters)
    _add_at(matrices, space.dofs.beside_inlet, loads[:, :, None] * np.eye(loads.shape[1]))
    return matrices


def _add_at(matrices: np.ndarray, beside: tuple[np.ndarray, np.ndarray],
            blocks: np.ndarray) -> None:
    """Add, in place, matrices (E, e, e) of an end's edges to those of the triangles beside them."""
    owner, place = beside
    np.add.at(matrices, (owner[:, None, None], place[:, :, None], place[:, None, :]), blocks)


def _apart(space: Space, count: int) -> ElementSystem:
    """The system of ``count`` uncoupled substrates: all nodes of one substrate, then the next."""
    size = count * space.count
    return ElementSystem(_shifted(space.cells, space, count), np.arange(size),
                         np.zeros(size, bool), space.mesh.topology.method)


def _shifted(cells: np.ndarray, space: Space, count: int) -> tuple[np.ndarray, ...]:
    """For each of ``count`` substrates, its unknowns at the nodes ``cells``."""
    return tuple(k * space.count + cells for k in range(count))


def coupled_system(space: Space, constrained: bool, count: int) -> ElementSystem:
    """The system of ``count`` substrates, coupled by uptake; constrained: is the supply prescribed
    at the ends?"""
    return space.mesh.topology.system(("transport", constrained, count),
                                      lambda: _system(space, constrained, count))


def _system(space: Space, ends_constrained: bool, count: int) -> ElementSystem:
    """The system of :func:`coupled_system`, with the substrates of a node eliminated together.

    The first kinds of elements are the triangles of each substrate. The last kind are the pieces of
    biomass, in which the uptake couples the substrates.
    """
    constrained = np.zeros(space.count, bool)
    constrained[both_ends(space)] = ends_constrained
    coupled = np.concatenate(_shifted(space.reaction.cells, space, count), axis=1)
    rank = np.concatenate([space.dofs.places + 0.5 * k for k in range(count)])
    return ElementSystem((*_shifted(space.cells, space, count), coupled), rank,
                         np.tile(constrained, count), space.mesh.topology.method)


def both_ends(space: Space) -> np.ndarray:
    """Nodes of the inlet and of the outlet."""
    return np.concatenate([space.inlet.nodes, space.outlet.nodes])


def supplied_everywhere(problem: Problem) -> Concentrations:
    """C = C_supply in the whole pore, the state at t = 0 (2.2)."""
    return concentrations(problem.substrates, problem.supply.reshape(len(problem.kinds), -1))


@dataclass(frozen=True, eq=False)
class Iterate:
    """One Newton iterate.

    state: (sn,) mg/L, all concentrations; saturations: (s, r, q), about which the uptake is
    linearised; residual, size: (sn,) um2 mg/L/h, residual at the concentrations and magnitude of
    its terms; free: unknowns that are not prescribed; consistent: are the saturations those of the
    concentrations?
    """

    state: np.ndarray
    saturations: np.ndarray
    residual: np.ndarray
    size: np.ndarray
    free: np.ndarray | slice
    consistent: bool = True

    #: Constrained nodes have their supply from the start.
    complete = True

    @property
    def defect(self) -> float:
        """Largest residual of a free unknown, relative to the magnitude of its row's terms."""
        return relative(self.residual[self.free], self.size[self.free])


@dataclass(frozen=True, eq=False)
class Balance:
    """The equations of a problem with a sink, in the form that Newton's method needs.

    Uptake is a function of max(C, 0) through the fractions m(C) of the law. If half saturations K
    are far below the supply, this function is nearly a step, and Newton's method in C jumps from
    one side of the step to the other. Therefore each point of the reaction has its own saturation
    s, and the uptake is linearised about C = K s / (1 - s). Above one half, s is the saturation of
    the concentration, C / (C + K); this is Newton's method in C. Below one half, s follows the
    linearisation, from 0 on, as in primal-dual active-set methods (Hintermueller, Ito and Kunisch
    2002).
    """

    problem: Problem
    sink: Sink | None

    @property
    def _reaction(self) -> Basis:
        return self.problem.space.reaction

    def at(self, state: np.ndarray) -> np.ndarray:
        """(s, r, q) mg/L, concentrations at the points of the reaction; state: (sn,) mg/L."""
        return self._reaction.evaluate(state.reshape(len(self.problem.kinds), -1))

    @property
    def _present_sink(self) -> Sink:
        return needed(self.sink, "a sink")

    @property
    def _law(self) -> RateLaw:
        return self.problem.rate_law

    @property
    def _uptake_law(self) -> UptakeLaw:
        """The law of uptake of the modelled substrates."""
        return self._law.uptake_law

    def uptake(self, state: np.ndarray) -> np.ndarray:
        """(r, s, q) um2 mg/L/h, uptake at concentrations (sn,) mg/L."""
        return self._present_sink.uptake(self._uptake_law.fraction(self.at(state)), self._law)

    def unmet(self, state: np.ndarray) -> np.ndarray:
        """(2,) um2 mg/L/h, the unmet demand for acceptor and donor."""
        return self._present_sink.unmet(self._uptake_law.fraction(self.at(state)), self._law)

    def residual(self, state: np.ndarray, loads: np.ndarray | None = None) -> np.ndarray:
        """(sn,) um2 mg/L/h, residual at concentrations (sn,) mg/L; loads: the uptake, if known."""
        residual = self.problem.operator @ state - self.problem.source
        if self.sink is None:
            return residual
        return residual + self._reaction.assembled(self.uptake(state) if loads is None else loads)

    def sizes(self, state: np.ndarray, loads: np.ndarray | None = None) -> np.ndarray:
        """(sn,) um2 mg/L/h, magnitudes of the residual's terms; loads: the uptake, if known."""
        sizes = self.problem.magnitude @ np.abs(state) + np.abs(self.problem.source)
        if self.sink is None:
            return sizes
        loads = self.uptake(state) if loads is None else loads
        return sizes + self._reaction.assemble(np.abs(loads) @ np.abs(self._reaction.values))

    def _slopes(self, state: np.ndarray, saturations: np.ndarray) -> np.ndarray:
        """(s, r, q) ds/dC at the saturations; zero where saturation and concentration are zero."""
        empty = (saturations <= 0) & (self.at(state) <= 0)
        return np.where(empty, 0.0, self._uptake_law.saturation_slope(saturations))

    def _uptake_slopes(self, saturations: np.ndarray) -> np.ndarray:
        """(s, s, r, q) derivatives of the uptake by the saturations."""
        fractions, slopes = self._uptake_law.at_saturation(saturations)
        return self._present_sink.slopes(fractions, self._law) * slopes

    def tangent(self, state: np.ndarray,
                saturations: np.ndarray | None = None) -> tuple[np.ndarray, ...]:
        """Element matrices (um2/h) of the residual's derivative: each substrate, then uptake."""
        if self.sink is None:
            return *self.problem.matrices, self._coupled(None)
        if saturations is None:
            saturations = self._uptake_law.saturation(self.at(state))
        by = self._uptake_slopes(saturations) * self._slopes(state, saturations)
        return *self.problem.matrices, self._coupled(by)

    def _coupled(self, slopes: np.ndarray | None) -> np.ndarray:
        """(r, sk, sk) um2/h of the uptake; slopes: (s, s, r, q), of uptake i by concentration j."""
        count, k = self._reaction.cells.shape
        size = len(self.problem.kinds) * k
        if slopes is None:
            return np.zeros((count, size, size))
        blocks = self._reaction.mass(slopes)
        return blocks.transpose(2, 0, 3, 1, 4).reshape(count, size, size)

    def begun(self, state: np.ndarray) -> Iterate:
        """The first iterate."""
        saturations = np.zeros((len(self.problem.kinds), 1, 1))
        if self.sink is not None:
            saturations = self._uptake_law.saturation(self.at(state))
        return Iterate(state, saturations, self.residual(state), self.sizes(state),
                       self.problem.system.free)

    def factored(self, iterate: Iterate) -> Factored:
        """The derivative, factorised."""
        return self.problem.system.factored(self.tangent(iterate.state, iterate.saturations))

    def advanced(self, iterate: Iterate, factors: Factored, fresh: bool) -> Iterate:
        """The iterate after a step of Newton's method.

        The magnitudes of the terms are computed for the first iterate, and again in the first step
        with each new derivative.
        """
        state = iterate.state + factors.solve(-self._linearised(iterate))
        if self.sink is None:
            size = self.sizes(state) if fresh else iterate.size
            return replace(iterate, state=state, residual=self.residual(state), size=size)
        concentrations = self.at(state)
        loads = self.sink.uptake(self._uptake_law.fraction(concentrations), self._law)
        size = self.sizes(state, loads) if fresh else iterate.size
        new = replace(iterate, state=state, residual=self.residual(state, loads), size=size)
        return self._resaturated(iterate, new, concentrations)

    def at_round_off(self, iterate: Iterate) -> bool:
        """Can round-off explain the residual of an iterate?"""
        return iterate.defect <= ROUND_OFF

    def _linearised(self, iterate: Iterate) -> np.ndarray:
        """(sn,) the residual, with the uptake linearised about the saturations."""
        if self.sink is None or iterate.consistent:
            return iterate.residual
        about = iterate.saturations
        change = self._predicted(iterate, iterate.state) - about
        rise = np.einsum("ijrq,jrq->riq", self._uptake_slopes(about), change)
        loads = self.sink.uptake(self._uptake_law.at_saturation(about)[0], self._law) + rise
        return self.residual(iterate.state, loads)

    def _predicted(self, iterate: Iterate, state: np.ndarray) -> np.ndarray:
        """(s, r, q) saturations that the linearisation at ``iterate`` predicts for ``state``."""
        about = np.minimum(iterate.saturations, LARGEST_SATURATION)
        change = self.at(state) - self._uptake_law.concentration(about)
        return about + self._slopes(iterate.state, about) * change

    def _resaturated(self, iterate: Iterate, new: Iterate, concentrations: np.ndarray) -> Iterate:
        """The new iterate with the saturations for the next linearisation.

        concentrations: (s, r, q) mg/L of ``new`` at the points of the reaction.
        """
        actual = self._uptake_law.saturation(concentrations)
        if iterate.consistent and concentrations.min() > 0:
            return replace(new, saturations=actual)
        predicted = np.clip(self._predicted(iterate, new.state), 0.0, SATURATED)
        woken = (iterate.saturations <= 0) & (predicted <= 0) & (concentrations > 0)
        rising = np.minimum(self._uptake_law.proportional(concentrations), SWITCH)
        predicted = np.where(woken, rising, predicted)
        saturations = np.where((predicted > SWITCH) & (concentrations > 0), actual, predicted)
        consistent = bool((saturations == actual).all())
        return replace(new, saturations=saturations, consistent=consistent)


@timed("transport")
def steady(problem: Problem, sink: Sink | None,
           guess: Concentrations | None = None) -> Concentrations:
    """Solve for steady concentrations, by Newton's method on all substrates at once.

    Parameters
    ----------
    problem : Problem
    sink : Sink, optional
        Biomass that takes up substrates; None without biomass.
    guess : Concentrations, optional
        Start of the iteration; C_supply everywhere by default.

    Returns
    -------
    Concentrations
        C_A and C_D (n,), mg/L.

    Raises
    ------
    TransportError
        If the method does not converge.
    Unresolved
        If the mesh is too coarse for a front: a concentration is below zero by more than UNRESOLVED
        of the supply, or above the supply by more than the scheme accepts, or the uptake
        depends on the quadrature.

    Notes
    -----
    The method may fail at a sharp front. It then starts again from the supply, with half
    saturations equal to the supply, and reduces them to their values by factors of ten. If the law
    is not monotone, it does not start again: several solutions may exist, and the solution near the
    guess is required.
    """
    sink = _acting(problem, sink)
    supply = problem.supply
    state = supply.copy() if guess is None else guess.fields.flatten()
    state[problem.system.constrained] = supply[problem.system.constrained]
    try:
        state, count = _newton(Balance(problem, sink), state)
    except TransportError:
        if problem.law is not None and not problem.law.uptake_law.monotone:
            raise
        state, count = _eased(problem, sink, supply)
    solution = _checked(problem, state, count)
    if sink is not None:
        _refuse_unresolved(problem, sink, solution)
    return solution


@failing_as(TransportError)
def _newton(balance: Balance, state: np.ndarray) -> tuple[np.ndarray, int]:
    """(sn,) mg/L, the solution by Newton's method from ``state``, and the number of iterations."""
    newton = Newton(NEWTON, MOST_ITERATIONS, balance.problem.scheme.modified_newton)
    try:
        last, count, converged = newton.solve(balance, balance.begun(state))
    except LinearError:
        if balance.sink is None:
            raise
        raise _front("Newton's method for the substrates meets a singular matrix") from None
    if not converged:
        raise _front("Newton's method for the substrates stands at a defect of "
                     f"{last.defect:.2g} after {count} iterations")
    return last.state, count


def _front(failure: str) -> Unresolved:
    return Unresolved(f"{failure}; the mesh is too coarse for the front in the aggregate")


def _eased(problem: Problem, sink: Sink | None, state: np.ndarray) -> tuple[np.ndarray, int]:
    """Newton's method with half saturations that decrease from the supply to their values."""
    law = problem.rate_law
    supply = np.array([s.supply for s in problem.kinds])[:, None, None]
    sharpest = law.uptake_law.sharpness(supply).min()
    full_newton = replace(problem.scheme, modified_newton=False)
    total = 0
    for factor in 10.0 ** np.arange(np.ceil(-np.log10(sharpest)), -1, -1):
        softened = replace(law, uptake_law=law.uptake_law.softened(factor, supply))
        eased = replace(problem, law=softened, scheme=full_newton)
        state, iterations = _newton(Balance(eased, sink), state)
        total += iterations
    return state, total


def _checked(problem: Problem, state: np.ndarray, iterations: int) -> Concentrations:
    """The solution. Raises Unresolved if it is not in the range from zero to the supply."""
    fields = state.reshape(len(problem.kinds), -1)
    for field, (name, substrate) in zip(fields, problem.substrates.modelled.items()):
        if field.min() < -UNRESOLVED * substrate.supply:
            raise _outside(problem, name, field, int(field.argmin()), substrate)
        overshoot = problem.scheme.overshoot
        if overshoot is not None and field.max() / (1 + overshoot) > substrate.supply:
            raise _outside(problem, name, field, int(field.argmax()), substrate)
    return concentrations(problem.substrates, fields, iterations)


def _refuse_unresolved(problem: Problem, sink: Sink, state: Concentrations) -> None:
    """Raise Unresolved if two quadratures of the uptake differ by more than APART."""
    difference = quadrature_error(problem, sink, state)
    if difference > APART:
        raise _front(f"two quadratures of the uptake differ by {100 * difference:.2g} % (up to "
                     f"{100 * APART:g} % is accepted)")


def quadrature_error(problem: Problem, sink: Sink, state: Concentrations) -> float:
    """Relative difference of the uptake between the quadrature and a finer quadrature.

    The uptake is that of the donor, or of the acceptor if the donor is not modelled. Both
    quadratures use the same concentrations. The density of the biomass is linear in each triangle
    and does not grow.
    """
    reaction = problem.space.reaction
    finer, fit = problem.space.integration.finer(FINER)
    law = problem.rate_law
    rate = law.uptake(*finer.evaluate(state.fields))[law.modelled][-1]
    masses = sink.active / reaction.dx @ fit * finer.dx
    exact = float(np.vdot(masses, rate))
    loads = Balance(problem, Sink(sink.active)).uptake(state.fields.ravel())
    quadrature = float(loads[:, -1].sum())
    return abs(exact - quadrature) / quadrature if quadrature else 0.0


def _outside(problem: Problem, name: str, field: np.ndarray, node: int,
             substrate: Substrate) -> Unresolved:
    x, y = problem.space.points[node]
    return Unresolved(f"the {name} is {field[node]:.3g} mg/L at x = {x:.4g}, y = {y:.4g} um, "
                      f"outside of 0 to {substrate.supply:g} mg/L; the mesh is too coarse there")


@dataclass(frozen=True)
class Fluxes:
    """Rates and mean concentrations of one substrate.

    supplied, out, consumed, unmet: um2 mg/L/h, per depth; inlet, effluent: mg/L, flow-weighted mean
    concentrations at the inlet and the outlet of the mesh, or plain means without flow. If the
    substrate is not modelled, only ``unmet`` is not zero.
    """

    supplied: float
    out: float
    consumed: float
    inlet: float
    effluent: float
    unmet: float = 0.0


class Flows(NamedTuple):
    """Amounts (um2 mg/L) of acceptor and donor in the balance of a step, and their unmet demand."""

    supplied: tuple[float, float]
    out: tuple[float, float]
    consumed: tuple[float, float]
    stored: tuple[float, float]
    unmet: tuple[float, float] = (0.0, 0.0)


def integrated(duration: float, *instants: tuple[Fluxes, Fluxes]) -> Flows:
    """Flows of steady substrates over a duration (h), from the mean of the fluxes ``instants``."""
    def total(part: str) -> tuple[float, float]:
        acceptor, donor = (sum(getattr(flux, part) for flux in fluxes) for fluxes in zip(*instants))
        return duration * acceptor / len(instants), duration * donor / len(instants)

    return Flows(total("supplied"), total("out"), total("consumed"), (0.0, 0.0), total("unmet"))


def fluxes(problem: Problem, sink: Sink | None, state: Concentrations) -> tuple[Fluxes, Fluxes]:
    """Fluxes of acceptor and donor in one geometry.

    Supplied and out are fluxes through the ends, consumed is the uptake at ``state``.
    """
    space = problem.space
    fields = state.fields
    out = fields @ problem.outflow
    consumed = np.zeros(len(fields))
    rows = np.zeros((2, 6))
    sink = _acting(problem, sink)
    if sink is not None:
        balance = Balance(problem, sink)
        consumed = balance.uptake(fields.ravel()).sum(axis=(0, 2))
        rows[:, 5] = balance.unmet(fields.ravel())
    supplied = problem.source.reshape(len(fields), -1).sum(axis=1)
    if problem.system.constrained.any():
        through = (problem.operator @ fields.ravel()).reshape(len(fields), -1)
        supplied = through[:, both_ends(space)].sum(axis=1)
    enters = _end_means(space.inlet, fields, problem.inflow)
    leaves = _end_means(space.outlet, fields, problem.outflow)
    rows[problem.substrates.places, :5] = np.column_stack([supplied, out, consumed, enters, leaves])
    acceptor, donor = rows.tolist()
    return Fluxes(*acceptor), Fluxes(*donor)


def _acting(problem: Problem, sink: Sink | None) -> Sink | None:
    """The sink, None without kinetics or biomass."""
    acts = sink is not None and problem.law is not None and sink.active.size > 0
    return sink if acts else None


def _end_means(end: End, fields: np.ndarray, load: np.ndarray) -> np.ndarray:
    """(s,) mg/L, means over an end, weighted with the flow if there is any."""
    if not load.any():
        load = end.assembled(np.ones(end.count))
    return fields @ load / load.sum()
