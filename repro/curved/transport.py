"""Substrates (2.2) with quadratic concentrations, in the form that conserves; as :mod:`repro.transport`.

    (D grad C, grad N_i) - (C u, grad N_i) + <u_x C, N_i>_outlet + (q(C) X_A, N_i)_biomass = <u_x C_supply, N_i>_inlet

The sum over i is the balance: supply in = out + consumed, to round-off. (11) is the natural condition of the inlet.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from skfem.quadrature import get_quadrature_line

from repro import kinetics as law
from repro.assembly import ElementSystem
from repro.curved import elements
from repro.curved.mesh import CurvedMesh
from repro.errors import TransportError
from repro.flow import Flow
from repro.newton import Jacobian
from repro.timing import timed
from repro.transport import Concentrations, Fluxes

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
    """Both substrates in one geometry.

    matrices: (T, 6, 6) um2/h; sources: (N,) um2 mg/L/h; inflow, outflow: (N,) um2/h, integrals of u_x N_i over an end;
    reused: does Newton's method use its derivative again?
    """

    mesh: CurvedMesh
    matrices: tuple[np.ndarray, ...]
    sources: tuple[np.ndarray, ...]
    inflow: np.ndarray
    outflow: np.ndarray
    speed: float
    substrates: Any
    kinetics: Any
    system: ElementSystem
    reused: bool

    @property
    def both(self):
        """Acceptor and donor, as the scene describes them."""
        return self.substrates.acceptor, self.substrates.donor


@timed("transport")
def problem(mesh: CurvedMesh, flow: Flow | None, substrates, kinetics, reused: bool = False) -> Problem:
    """Assemble the linear parts for one geometry and flow (None: pure diffusion, the supply held at both ends)."""
    at, count = mesh.places, len(mesh.points)
    carried, inflow, outflow, speed = 0.0, np.zeros(count), np.zeros(count), 0.0
    if flow is not None:
        speed = flow.mean_velocity
        u = elements.QUADRATIC @ flow.velocity[mesh.cells]
        along = (at.grad[..., 0] * u[..., :1] + at.grad[..., 1] * u[..., 1:]) * at.dx[..., None]
        carried = -np.swapaxes(along, 1, 2) @ elements.QUADRATIC
        inflow = _end_loads(mesh, mesh.inlet, flow.velocity[:, 0])
        ends, blocks = _end_matrix(mesh, mesh.outlet, flow.velocity[:, 0])
        carried[ends[0]] += blocks
        outflow = _end_loads(mesh, mesh.outlet, flow.velocity[:, 0])
    kinds = (substrates.acceptor, substrates.donor)
    spread = [np.where(mesh.biomass, s.diffusivity_in_aggregate, s.diffusivity) for s in kinds]
    matrices = tuple(elements.stiffness(d, at) + carried for d in spread)
    system = mesh.once(("transport", flow is None), lambda: _system(mesh, flow is None))
    sources = tuple(s.supply * inflow for s in kinds)
    return Problem(mesh, matrices, sources, inflow, outflow, speed, substrates, kinetics, system, reused)


def _system(mesh: CurvedMesh, held_ends: bool) -> ElementSystem:
    """Acceptor and donor of a node side by side, nodes in elimination order."""
    count = len(mesh.points)
    place = np.empty(count)
    place[mesh.order] = np.arange(count)
    held = np.zeros(count, bool)
    held[np.concatenate([mesh.inlet, mesh.outlet])] = held_ends
    return ElementSystem(np.concatenate([mesh.cells, count + mesh.cells], axis=1),
                         np.concatenate([place, place + 0.5]), np.tile(held, 2))


def _line_rule():
    where, weight = get_quadrature_line(6)
    s = where[0]
    return weight, np.column_stack([(1 - s) * (1 - 2 * s), 4 * s * (1 - s), s * (2 * s - 1)])


LINE_WEIGHTS, LINE = _line_rule()


def _end_edges(mesh: CurvedMesh, line: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(E, 3) nodes of the edges of an end, corner, middle, corner; and their lengths (E,)."""
    nodes = np.column_stack([line[:-2:2], line[1:-1:2], line[2::2]])
    return nodes, mesh.points[nodes[:, 2], 1] - mesh.points[nodes[:, 0], 1]


def _end_loads(mesh: CurvedMesh, line: np.ndarray, speed: np.ndarray) -> np.ndarray:
    """(N,) integrals of u_x N_i over an end, um2/h."""
    nodes, length = _end_edges(mesh, line)
    u = speed[nodes] @ LINE.T
    found = np.zeros(len(mesh.points))
    np.add.at(found, nodes, length[:, None] * ((u * LINE_WEIGHTS) @ LINE))
    return found


def _end_matrix(mesh: CurvedMesh, line: np.ndarray, speed: np.ndarray):
    """Integrals of u_x N_i N_j over an end as ((elements,), blocks (E, 6, 6)) of the triangles that have its edges."""
    nodes, length = _end_edges(mesh, line)
    u = speed[nodes] @ LINE.T
    local = length[:, None, None] * np.einsum("eq,q,qa,qb->eab", u, LINE_WEIGHTS, LINE, LINE, optimize=True)
    owner = mesh.once("outlet triangles", lambda: _owners(mesh, nodes[:, 1]))
    blocks = np.zeros((len(nodes), 6, 6))
    where = np.argmax(mesh.cells[owner][:, :, None] == nodes[:, None, :], axis=1)
    each = np.arange(len(nodes))
    blocks[each[:, None, None], where[:, :, None], where[:, None, :]] = local
    return (owner,), blocks


def _owners(mesh: CurvedMesh, middles: np.ndarray) -> np.ndarray:
    """The triangle of each boundary edge, by its middle node."""
    return np.array([np.flatnonzero((mesh.cells[:, 3:] == m).any(axis=1))[0] for m in middles])


@timed("transport")
def steady(problem: Problem, active: np.ndarray | None, guess: Concentrations | None = None) -> Concentrations:
    """Steady concentrations by Newton's method on both substrates at once.

    active: X_A (N,) mg/L, None without biomass. Where it does not converge, as behind a sharp front, it starts again
    from the supply with shorter steps, and half saturations come down from the supply to what they are, a tenth at a
    time. Raises TransportError where that fails too, or where a concentration is outside of zero to the supply by more
    than UNRESOLVED and OVERSHOOT say: the mesh is too coarse for its front.
    """
    count = len(problem.mesh.points)
    supply = np.repeat([s.supply for s in problem.both], count)
    state = supply.copy() if guess is None else np.concatenate([guess.acceptor, guess.donor])
    state[problem.system.held] = supply[problem.system.held]
    try:
        found = _newton(problem, active, state, _full_or_swept)
    except TransportError:
        found = _eased(problem, active, supply)
    return _checked(problem, *found)


def _eased(problem: Problem, active, state):
    """Newton's method with half saturations that fall from the supply to what they are."""
    least = min(s.half_saturation / max(s.supply, s.half_saturation) for s in problem.both)
    total = 0
    for factor in 10.0 ** np.arange(np.ceil(-np.log10(least)), -1, -1):
        both = {name: replace(s, half_saturation=max(s.half_saturation, min(factor * s.half_saturation, s.supply)))
                for name, s in zip(("acceptor", "donor"), problem.both)}
        eased = replace(problem, substrates=replace(problem.substrates, **both))
        state, iterations = _newton(eased, active, state, _shortened)
        total += iterations
    return state, total


def _newton(problem: Problem, active, state, advance):
    """(2N,) solution and Newton's iterations."""
    jacobian, defect, nothing = Jacobian(problem.reused), np.inf, np.zeros(len(state))
    residual, size = _balance(problem, active, state)
    for iteration in range(MOST_ITERATIONS):
        last, defect = defect, _relative(problem, residual, size)
        if defect <= NEWTON or 0.1 * last < defect <= ROUND_OFF:
            return state, iteration
        if jacobian.stale(defect):
            jacobian.factors = problem.system.factored(_tangent(problem, active, state))
        step = jacobian.factors.solve(-residual, nothing)
        state, residual, size = advance(problem, active, state, residual, step)
    raise TransportError(f"Newton's method for the substrates stands at a defect of {defect:.2g} after "
                         f"{MOST_ITERATIONS} iterations; try a larger numerics.refinement")


def _relative(problem: Problem, residual, size) -> float:
    """Largest residual of a free node against the size of its row's terms."""
    free = ~problem.system.held
    return float(np.max(np.abs(residual[free]) / np.maximum(size[free], np.finfo(float).tiny)))


def _full_or_swept(problem: Problem, active, state, residual, step):
    """A Newton step where it lowers the residual and nothing is negative; else a sweep with the uptake's coefficients
    q(C) / C frozen, which keeps what is positive so, as far as quadratic functions can."""
    trial = state + step
    found = _balance(problem, active, trial)
    free = ~problem.system.held
    worse = np.linalg.norm(found[0][free]) > np.linalg.norm(residual[free])
    if worse or trial.min() < -UNRESOLVED * max(s.supply for s in problem.both):
        trial = _sweep(problem, active, np.maximum(state, 0.0))
        found = _balance(problem, active, trial)
    return trial, *found


def _shortened(problem: Problem, active, state, residual, step):
    """The longest part of a Newton step that lowers the residual; a sweep where none does."""
    free = ~problem.system.held
    before = np.linalg.norm(residual[free])
    for length in LENGTHS:
        trial = state + length * step
        found = _balance(problem, active, trial)
        if np.linalg.norm(found[0][free]) <= (1 - FALL * length) * before:
            return trial, *found
    trial = _sweep(problem, active, np.maximum(state, 0.0))
    return trial, *_balance(problem, active, trial)


def _sweep(problem: Problem, active, state) -> np.ndarray:
    """Solve (matrix + X_A q(C) / C) C_new = source, with q(C) / C at the state."""
    matrices = _linear_part(problem)
    weight, values, (q_a, q_d, slopes) = _uptake_at_points(problem, active, state)
    biomass = np.flatnonzero(problem.mesh.biomass)
    for k, (rate, substrate) in enumerate(zip((q_a, q_d), problem.both)):
        tiny = 1e-9 * substrate.half_saturation
        per = np.where(values[k] > tiny, rate / np.maximum(values[k], tiny), slopes[k][k])
        matrices[biomass, 6 * k: 6 * k + 6, 6 * k: 6 * k + 6] += elements.mass(weight * per)
    return problem.system.solve(matrices, np.concatenate(problem.sources), state)


def _balance(problem: Problem, active, state):
    """Residual (2N,) and size of its terms (2N,)."""
    mesh, count = problem.mesh, len(problem.mesh.points)
    local, scale = np.zeros((len(mesh.cells), 12)), np.zeros((len(mesh.cells), 12))
    for k, matrix in enumerate(problem.matrices):
        rows = slice(6 * k, 6 * k + 6)
        values = state[k * count + mesh.cells]
        local[:, rows] = (matrix @ values[..., None])[..., 0]
        scale[:, rows] = (np.abs(matrix) @ np.abs(values)[..., None])[..., 0]
    if problem.kinetics is not None and active is not None:
        _add_uptake(problem, active, state, local, scale)
    source = np.concatenate(problem.sources)
    total, size = (np.bincount(problem.system.unknowns.ravel(), part.ravel(), 2 * count) for part in (local, scale))
    return total - source, size + np.abs(source)


def _uptake_at_points(problem: Problem, active, state):
    """X_A dx (t, q) on the biomass, C_A and C_D (t, q) there, and the uptake with its derivatives."""
    mesh, count = problem.mesh, len(problem.mesh.points)
    cells = mesh.cells[mesh.biomass]
    acceptor, donor, density = (elements.at_points(values, cells)
                                for values in (state[:count], state[count:], active))
    rates = law.paired_uptake(acceptor, donor, problem.substrates, problem.kinetics)
    return density * mesh.places.dx[mesh.biomass], (acceptor, donor), rates


def _add_uptake(problem: Problem, active, state, local, scale) -> None:
    """Add (q X_A, N_i) to the element arrays."""
    weight, _, (q_a, q_d, _) = _uptake_at_points(problem, active, state)
    biomass = np.flatnonzero(problem.mesh.biomass)
    for k, rate in enumerate((q_a, q_d)):
        rows = slice(6 * k, 6 * k + 6)
        local[biomass, rows] += elements.load(weight * rate)
        scale[biomass, rows] += np.abs(weight * rate) @ np.abs(elements.QUADRATIC)


def _linear_part(problem: Problem) -> np.ndarray:
    """(T, 12, 12) element matrices of diffusion, advection and the ends."""
    found = np.zeros((len(problem.mesh.cells), 12, 12))
    for k, matrix in enumerate(problem.matrices):
        found[:, 6 * k: 6 * k + 6, 6 * k: 6 * k + 6] = matrix
    return found


def _tangent(problem: Problem, active, state) -> np.ndarray:
    """(T, 12, 12) element matrices of the residual's derivative."""
    found = _linear_part(problem)
    if problem.kinetics is not None and active is not None:
        weight, _, (_, _, slopes) = _uptake_at_points(problem, active, state)
        biomass = np.flatnonzero(problem.mesh.biomass)
        for k, m in np.ndindex(2, 2):
            found[biomass, 6 * k: 6 * k + 6, 6 * m: 6 * m + 6] += elements.mass(weight * slopes[k][m])
    return found


def _checked(problem: Problem, state, iterations: int) -> Concentrations:
    """The solution, if it stays between zero and the supply as well as it has to."""
    count = len(problem.mesh.points)
    for name, values, substrate in zip(("acceptor", "donor"), (state[:count], state[count:]), problem.both):
        least = -UNRESOLVED * max(s.supply for s in problem.both)
        for beyond, where in ((values.min() < least, values.argmin()),
                              (values.max() > (1 + OVERSHOOT) * substrate.supply, values.argmax())):
            if beyond:
                x, y = problem.mesh.points[where]
                raise TransportError(f"the {name} is {values[where]:.3g} mg/L at x = {x:.4g}, y = {y:.4g} um, outside "
                                     f"of 0 to {substrate.supply:g}; the mesh is too coarse there: "
                                     "try a larger numerics.refinement")
    return Concentrations(state[:count], state[count:], iterations)


def fluxes(problem: Problem, active: np.ndarray | None, state: Concentrations) -> tuple[Fluxes, Fluxes]:
    """Ledger of the acceptor and of the donor in one geometry."""
    both = np.concatenate([state.acceptor, state.donor])
    consumed: tuple[float, ...] = (0.0, 0.0)
    if problem.kinetics is not None and active is not None:
        weight, _, (*rates, _) = _uptake_at_points(problem, active, both)
        consumed = tuple(float(np.sum(weight * rate)) for rate in rates)
    return (_fluxes(problem, 0, state.acceptor, consumed[0]), _fluxes(problem, 1, state.donor, consumed[1]))


def _fluxes(problem: Problem, k: int, field: np.ndarray, consumed: float) -> Fluxes:
    mesh = problem.mesh
    if problem.speed:
        ends = [float(w @ field / w.sum()) for w in (problem.inflow, problem.outflow)]
        return Fluxes(float(problem.sources[k].sum()), float(problem.outflow @ field), consumed, *ends)
    flux = np.bincount(mesh.cells.ravel(), np.einsum("tab,tb->ta", problem.matrices[k], field[mesh.cells]).ravel(),
                       len(field))
    ends = [_mean(mesh, line, field) for line in (mesh.inlet, mesh.outlet)]
    return Fluxes(float(flux[np.concatenate([mesh.inlet, mesh.outlet])].sum()), 0.0, consumed, *ends)


def _mean(mesh: CurvedMesh, line: np.ndarray, field: np.ndarray) -> float:
    weight = _end_loads(mesh, line, np.ones(len(field)))
    return float(weight @ field / weight.sum())
