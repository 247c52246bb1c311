"""Substrates (2.2) with quadratic or cubic concentrations, in the form that conserves; as :mod:`repro.model.transport`.

    (D grad C, grad N_i) - (C u, grad N_i) + <u_x C, N_i>_outlet + (q(C) X_A, N_i)_biomass = <u_x C_supply, N_i>_inlet

The sum over i is the balance: supply in = out + consumed, to round-off. (11) is the natural condition of the inlet.
"""

from __future__ import annotations

from copy import copy
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import scipy.sparse as sp

from repro.curved.fields import Space, space
from repro.curved.mesh import CurvedMesh
from repro.errors import TransportError
from repro.fem.assembly import ElementSystem, each
from repro.fem.newton import Jacobian
from repro.model import kinetics as law
from repro.model.flow import Flow
from repro.model.transport import Concentrations, Fluxes
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


@dataclass(frozen=True, eq=False)
class Problem:
    """Both substrates in one geometry, with n nodes in all and k a triangle.

    matrices: (T, k, k) um2/h of each; operator: (2n, 2n) of both, not coupled, and magnitude: the same of its entries;
    source: (2n,) um2 mg/L/h; inflow, outflow: (n,) um2/h, integrals of u_x N_i over an end; system: of both, coupled
    where there is biomass; reused: does Newton's method use its derivative again?
    """

    space: Space
    matrices: tuple[np.ndarray, ...]
    operator: sp.csc_matrix
    magnitude: sp.csc_matrix
    source: np.ndarray
    inflow: np.ndarray
    outflow: np.ndarray
    speed: float
    substrates: Any
    kinetics: Any
    system: ElementSystem
    reused: bool

    @property
    def mesh(self) -> CurvedMesh:
        """Of the space."""
        return self.space.mesh

    @property
    def both(self):
        """Acceptor and donor, as the scene describes them."""
        return self.substrates.acceptor, self.substrates.donor


@timed("transport")
def problem(mesh: CurvedMesh, flow: Flow | None, substrates, kinetics, reused: bool = False, order: int = 2) -> Problem:
    """Assemble the linear parts for one geometry and flow of the same order (None: pure diffusion, the supply held at
    both ends)."""
    here = space(mesh, order)
    inflow, outflow = np.zeros(here.count), np.zeros(here.count)
    carried: np.ndarray | float = 0.0
    if flow is not None:
        u_x = flow.velocity[:, 0]
        carried, inflow = _advection(here, flow.velocity), _end_loads(here, here.inlet, u_x)
        outflow = _end_loads(here, here.outlet, u_x)
    kinds = (substrates.acceptor, substrates.donor)
    spread = [np.where(mesh.biomass, s.diffusivity_in_aggregate, s.diffusivity) for s in kinds]
    matrices = tuple(each(d, here.stiffness) + carried for d in spread)
    operator = mesh.once(("both", order), lambda: _apart(here)).matrix(matrices)
    system = mesh.once(("transport", order, flow is None), lambda: _system(here, flow is None))
    magnitude = copy(operator)
    magnitude.data = np.abs(operator.data)
    source = np.concatenate([s.supply * inflow for s in kinds])
    speed = flow.mean_velocity if flow else 0.0
    return Problem(here, matrices, operator, magnitude, source, inflow, outflow, speed, substrates, kinetics,
                   system, reused)


def _advection(here: Space, velocity: np.ndarray) -> np.ndarray:
    """(T, k, k) of -(C u, grad v), and of u_x C v over the outlet."""
    at = here.at
    u_x, u_y = here.at_points(velocity.T, here.cells) * -at.dx
    along = u_x[..., None] * at.slopes[:, :, 0]
    along += u_y[..., None] * at.slopes[:, :, 1]
    found = here.load(np.swapaxes(along, 1, 2))
    owner, place = here.mesh.once(("outlet triangles", here.cubic), lambda: _owners(here))
    blocks = _outlet_matrix(here, velocity[:, 0])
    found[owner[:, None, None], place[:, :, None], place[:, None, :]] += blocks
    return found


def _apart(here: Space) -> ElementSystem:
    """Acceptor, then donor of all nodes in their own order, without their uptake."""
    count = 2 * here.count
    return ElementSystem((here.cells, here.count + here.cells), np.arange(count), np.zeros(count, bool))


def _system(here: Space, held_ends: bool) -> ElementSystem:
    """Acceptor and donor of a node side by side, nodes in elimination order: their own triangles, then both together
    on those of the biomass, where the uptake couples them."""
    place = np.empty(here.count)
    place[here.order] = np.arange(here.count)
    held = np.zeros(here.count, bool)
    held[_both_ends(here)] = held_ends
    both = np.concatenate([here.biomass_cells, here.count + here.biomass_cells], axis=1)
    return ElementSystem((here.cells, here.count + here.cells, both), np.concatenate([place, place + 0.5]),
                         np.tile(held, 2))


def _both_ends(here: Space) -> np.ndarray:
    """Nodes of the inlet and of the outlet."""
    return np.concatenate([here.end_nodes(here.inlet), here.end_nodes(here.outlet)])


def _lengths(here: Space, edges: np.ndarray) -> np.ndarray:
    """(E,) of the edges of an end, um."""
    return here.mesh.points[edges[:, -1], 1] - here.mesh.points[edges[:, 0], 1]


def _end_loads(here: Space, edges: np.ndarray, speed: np.ndarray) -> np.ndarray:
    """(n,) integrals of u_x N_i over an end, um2/h."""
    u = speed[edges] @ here.of.along.T
    found = np.zeros(here.count)
    np.add.at(found, edges, _lengths(here, edges)[:, None] * ((u * here.of.line_weights) @ here.of.along))
    return found


def _outlet_matrix(here: Space, speed: np.ndarray) -> np.ndarray:
    """(E, e, e) integrals of u_x N_i N_j over the outlet's edges with e nodes."""
    along = here.of.along
    weight = (speed[here.outlet] @ along.T) * here.of.line_weights * _lengths(here, here.outlet)[:, None]
    return (along.T * weight[:, None]) @ along


def _owners(here: Space) -> tuple[np.ndarray, np.ndarray]:
    """The triangle of each of the outlet's edges (E,), by its middle node, and where the edge's nodes (E, e) are among
    the triangle's."""
    mesh, edges = here.mesh, here.outlet
    owner = np.array([np.flatnonzero((mesh.cells[:, 3:] == m).any(axis=1))[0] for m in mesh.outlet[1::2]])
    place = np.argmax(here.cells[owner][:, :, None] == edges[:, None, :], axis=1)
    return owner, place


@timed("transport")
def steady(problem: Problem, active: np.ndarray | None, guess: Concentrations | None = None) -> Concentrations:
    """Steady concentrations by Newton's method on both substrates at once.

    active: X_A (N,) mg/L at the mesh's nodes, None without biomass; guess: at the problem's. Where it does not
    converge, as behind a sharp front, it starts again from the supply with shorter steps, and half saturations come
    down from the supply to what they are, a tenth at a time. Raises TransportError where that fails too, or where a
    concentration is outside of zero to the supply by more than UNRESOLVED and OVERSHOOT say: the mesh is too coarse
    for its front.
    """
    supply, weight = np.repeat([s.supply for s in problem.both], problem.space.count), sinks(problem, active)
    state = supply.copy() if guess is None else np.concatenate([guess.acceptor, guess.donor])
    state[problem.system.held] = supply[problem.system.held]
    try:
        found = _newton(problem, weight, state, _full_or_swept)
    except TransportError:
        found = _eased(problem, weight, supply)
    return _checked(problem, *found)


def sinks(problem: Problem, active: np.ndarray | None) -> np.ndarray | None:
    """X_A dx (t, q), um2 mg/L, on the biomass, from X_A (N,) mg/L at the mesh's nodes; None: nothing is taken up."""
    if problem.kinetics is None or active is None:
        return None
    here, biomass = problem.space, problem.mesh.biomass
    density = active[problem.mesh.cells[biomass]] @ here.of.shape.T
    return density * here.at.dx[biomass]


def _eased(problem: Problem, weight, state):
    """Newton's method with half saturations that fall from the supply to what they are."""
    least = min(s.half_saturation / max(s.supply, s.half_saturation) for s in problem.both)
    total = 0
    for factor in 10.0 ** np.arange(np.ceil(-np.log10(least)), -1, -1):
        both = {name: replace(s, half_saturation=max(s.half_saturation, min(factor * s.half_saturation, s.supply)))
                for name, s in zip(("acceptor", "donor"), problem.both)}
        eased = replace(problem, substrates=replace(problem.substrates, **both))
        state, iterations = _newton(eased, weight, state, _shortened)
        total += iterations
    return state, total


def _newton(problem: Problem, weight, state, advance):
    """(2n,) solution and Newton's iterations; sizes of the terms are those of the first guess, then those after the
    first step of each derivative."""
    jacobian, defect = Jacobian(problem.reused), np.inf
    residual, size = balance(problem, weight, state), terms(problem, weight, state)
    for iteration in range(MOST_ITERATIONS):
        last, defect = defect, _relative(problem, residual, size)
        if defect <= NEWTON or 0.1 * last < defect <= ROUND_OFF:
            return state, iteration
        fresh = jacobian.stale(defect)
        if fresh:
            jacobian.factors = problem.system.factored(tangent(problem, weight, state))
        step = jacobian.factors.solve(-residual)
        state, residual = advance(problem, weight, state, residual, step)
        size = terms(problem, weight, state) if fresh else size
    raise TransportError(f"Newton's method for the substrates stands at a defect of {defect:.2g} after "
                         f"{MOST_ITERATIONS} iterations; try a larger numerics.refinement")


def _relative(problem: Problem, residual, size) -> float:
    """Largest residual of a free node against the size of its row's terms."""
    free = problem.system.free
    return float(np.max(np.abs(residual[free]) / np.maximum(size[free], np.finfo(float).tiny)))


def _full_or_swept(problem: Problem, weight, state, residual, step):
    """A Newton step where it lowers the residual and nothing is negative; else a sweep with the uptake's coefficients
    q(C) / C frozen, which keeps what is positive so, as far as quadratic functions can."""
    trial = state + step
    found, free = balance(problem, weight, trial), problem.system.free
    worse = np.linalg.norm(found[free]) > np.linalg.norm(residual[free])
    if worse or trial.min() < -UNRESOLVED * max(s.supply for s in problem.both):
        trial = _sweep(problem, weight, np.maximum(state, 0.0))
        found = balance(problem, weight, trial)
    return trial, found


def _shortened(problem: Problem, weight, state, residual, step):
    """The longest part of a Newton step that lowers the residual; a sweep where none does."""
    free = problem.system.free
    before = np.linalg.norm(residual[free])
    for length in LENGTHS:
        trial = state + length * step
        found = balance(problem, weight, trial)
        if np.linalg.norm(found[free]) <= (1 - FALL * length) * before:
            return trial, found
    trial = _sweep(problem, weight, np.maximum(state, 0.0))
    return trial, balance(problem, weight, trial)


def _sweep(problem: Problem, weight, state) -> np.ndarray:
    """Solve (matrix + X_A q(C) / C) C_new = source, with q(C) / C at the state."""
    per = {}
    if weight is not None:
        slopes = _slopes(problem, state)
        for k, (c, rate) in enumerate(zip(_on_the_biomass(problem, state), _uptake(problem, state))):
            tiny = 1e-9 * problem.both[k].half_saturation
            per[k, k] = weight * np.where(c > tiny, rate / np.maximum(c, tiny), slopes[k][k])
    elements = *problem.matrices, _coupled(problem, per)
    return problem.system.solve(elements, problem.source, state)


def balance(problem: Problem, weight, state) -> np.ndarray:
    """Residual (2n,), um2 mg/L/h, for C_A, then C_D, of all nodes (2n,), mg/L; weight: as :func:`sinks`'."""
    found = problem.operator @ state - problem.source
    if weight is not None:
        sink = weight[:, None] * np.stack(_uptake(problem, state), axis=1)
        found += np.bincount(problem.system.kinds[2].ravel(), problem.space.load(sink).ravel(), len(state))
    return found


def terms(problem: Problem, weight, state) -> np.ndarray:
    """Sizes (2n,) of the terms of :func:`balance`, all taken as positive."""
    found = problem.magnitude @ np.abs(state) + np.abs(problem.source)
    if weight is not None:
        sink = np.abs(weight[:, None] * np.stack(_uptake(problem, state), axis=1))
        loads = sink @ np.abs(problem.space.of.values)
        found += np.bincount(problem.system.kinds[2].ravel(), loads.ravel(), len(state))
    return found


def _on_the_biomass(problem: Problem, state) -> np.ndarray:
    """(2, t, q) mg/L of C_A and C_D in the points of the biomass."""
    return problem.space.at_points(state.reshape(2, -1), problem.space.biomass_cells)


def _uptake(problem: Problem, state):
    """Uptake of both substrates per X_A there, (t, q) 1/h each."""
    acceptor, donor = _on_the_biomass(problem, state)
    return law.paired_uptake(acceptor, donor, problem.substrates, problem.kinetics)


def _slopes(problem: Problem, state):
    """Its derivatives by both concentrations."""
    acceptor, donor = _on_the_biomass(problem, state)
    return law.paired_slopes(acceptor, donor, problem.substrates, problem.kinetics)


def _coupled(problem: Problem, slopes: dict[tuple[int, int], np.ndarray]) -> np.ndarray:
    """(t, 2k, 2k) um2/h of the derivatives X_A dx d(uptake of i) / d(concentration of j), (t, q), of (i, j) in
    ``slopes``."""
    k = problem.space.cells.shape[1]
    found = np.zeros((len(problem.space.biomass_cells), 2 * k, 2 * k))
    for (i, j), slope in slopes.items():
        found[:, i * k: i * k + k, j * k: j * k + k] = problem.space.mass(slope)
    return found


def tangent(problem: Problem, weight, state) -> tuple[np.ndarray, ...]:
    """Element matrices, um2/h, of the derivative of :func:`balance`: of both substrates and of their uptake."""
    slopes = {}
    if weight is not None:
        by = _slopes(problem, state)
        slopes = {(i, j): weight * by[i][j] for i, j in np.ndindex(2, 2)}
    return *problem.matrices, _coupled(problem, slopes)


def _checked(problem: Problem, state, iterations: int) -> Concentrations:
    """The solution, if it stays between zero and the supply as well as it has to."""
    count = problem.space.count
    for name, values, substrate in zip(("acceptor", "donor"), (state[:count], state[count:]), problem.both):
        least = -UNRESOLVED * max(s.supply for s in problem.both)
        for beyond, where in ((values.min() < least, values.argmin()),
                              (values.max() > (1 + OVERSHOOT) * substrate.supply, values.argmax())):
            if beyond:
                x, y = problem.space.points[where]
                raise TransportError(f"the {name} is {values[where]:.3g} mg/L at x = {x:.4g}, y = {y:.4g} um, outside "
                                     f"of 0 to {substrate.supply:g}; the mesh is too coarse there: "
                                     "try a larger numerics.refinement")
    return Concentrations(state[:count], state[count:], iterations)


def fluxes(problem: Problem, active: np.ndarray | None, state: Concentrations) -> tuple[Fluxes, Fluxes]:
    """Ledger of the acceptor and of the donor in one geometry."""
    here, both = problem.space, np.stack([state.acceptor, state.donor])
    weight, consumed = sinks(problem, active), np.zeros(2)
    if weight is not None:
        consumed = np.array([np.vdot(weight, rate) for rate in _uptake(problem, both)])
    if problem.speed:
        ends, out = [problem.inflow, problem.outflow], both @ problem.outflow
        supplied = problem.source.reshape(2, -1).sum(axis=1)
    else:
        ends = [_end_loads(here, edges, np.ones(here.count)) for edges in (here.inlet, here.outlet)]
        flux, out = (problem.operator @ both.ravel()).reshape(2, -1), np.zeros(2)
        supplied = flux[:, _both_ends(here)].sum(axis=1)
    means = [both @ load / load.sum() for load in ends]
    acceptor, donor = np.column_stack([supplied, out, consumed, *means]).tolist()
    return Fluxes(*acceptor), Fluxes(*donor)
