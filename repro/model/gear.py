"""The paper's transient scheme (3.3): substrates and biomass by a predictor-corrector modified Gear method.

Every quantity y of (7)-(10), dy/dt = f, advances by Gear's second-order formula (BDF2). With r the ratio of a step h
to the one before it (r = 0, backward Euler, in the first step),

    predictor   y* = y + r dy                        dy the last increment
    corrector   dy_new = carry dy + weight h f_new   carry = r^2 / (1 + 2 r), weight = (1 + r) / (1 + 2 r)

For C_A and C_D, (7) and (8), the corrector is one linear system each,

    M (C - C_n - carry dC_n) / (weight h) + L C - b + m X_A (q(C*) + q'(C*) (C - C*)) = 0

with M the lumped area, L and b of :mod:`repro.model.transport`, m the lumped area of biomass and X_A predicted. The uptake q
is linearised in the substrate's own concentration; the acceptor sees the predicted donor, the donor the corrected
acceptor. (9) advances ln X_A and (10) X_I at the corrected concentrations: both stay positive. Fluxes are integrated by
the formula of the concentrations that they change, so that supplied - out - consumed = stored to round-off. Where the
corrector gives a negative concentration, the step is backward Euler's with the sink C q(C*) / C*, which keeps C >= 0.

Steps are controlled by |C - C*| within the aggregate (3.3.2), relative to the substrate's largest concentration.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse as sp

from repro.errors import TransportError
from repro.fem import linear
from repro.model import kinetics as law
from repro.model.transport import Concentrations, Operator, Problem, supplied_everywhere
from repro.timing import timed

#: Largest accepted |C - C*| in the aggregate over the supply. Measured against a tolerance of 3e-6, 12 min from settled
#: pores (base; a seed of 40 um; wide at 40 h) and from closed ones filled with the supply (seeds of 5 and 40 um), the
#: largest error in concentrations, biomass made or uptake is 2e-2 at 1e-1, 9e-4 at 1e-2, 3.1e-4 at 1e-3: 0.1 % is kept.
TOLERANCE = 1e-3
#: Bounds on the ratio of successive steps, and the part taken of the step that would just be accepted.
LONGER, SHORTER, SAFETY = 2.0, 0.2, 0.8
#: Longest first step, which is of first order: 45 s keep its error under 2e-4 (720 s: 2e-2). A step under 1e-6 s fails.
FIRST, SHORTEST = 45 / 3600, 1e-6 / 3600
#: Settled: the change over the supply that further steps of LONG (h) would sum up to. On the way there: the largest
#: change in a step, the factor by which steps rise and fall, and most steps.
SETTLED, LONG, SETTLING, FASTER, MOST_STEPS = 1e-9, 1e6, 0.3, 10.0, 1000


@dataclass(frozen=True, eq=False)
class Level:
    """State (4, N): C_A, C_D (mg/L), rise of ln X_A since the start, X_I (mg/L); flows (2, 3): each substrate supplied,
    out and consumed since the start (um2 mg/L); their increments in the last step, and its size (h)."""

    state: np.ndarray
    flows: np.ndarray
    rise: np.ndarray
    flow: np.ndarray
    step: float = np.inf


@dataclass(frozen=True, eq=False)
class Advance:
    """X_A, X_I and concentrations (mg/L) at the end; flows: (acceptor, donor) pairs supplied, out, consumed, stored in
    um2 mg/L; steps: sizes of the steps taken (h)."""

    active: np.ndarray
    inert: np.ndarray
    concentrations: Concentrations
    flows: tuple[tuple[float, float], ...]
    steps: tuple[float, ...]


@dataclass(frozen=True, eq=False)
class Row:
    """One substrate's operator, nodes in elimination order: ``matrix`` with zero rows where C is held, the places of
    its diagonal in ``matrix.data``, and those rows as they were."""

    matrix: sp.csc_matrix
    diagonal: np.ndarray
    held: np.ndarray
    held_rows: sp.csr_matrix
    source: np.ndarray
    operator: Operator
    outflow: np.ndarray


@dataclass(frozen=True, eq=False)
class System:
    """What the scheme needs, nodes in elimination order: watched (N,) nodes of the step control; scale (2, 1) of the
    concentrations; living: are F3 and F4 integrated; simultaneous: see :func:`advance`."""

    problem: Problem
    rows: tuple[Row, Row]
    body: np.ndarray
    total: np.ndarray
    active: np.ndarray
    watched: np.ndarray
    scale: np.ndarray
    living: bool
    simultaneous: bool = False


@timed("transport")
def settle(problem: Problem, active: np.ndarray | None, guess: Concentrations | None) -> Concentrations:
    """Profiles consistent with the biomass after a shape update: the scheme with F3 = F4 = 0 until nothing changes.

    The way there does not matter (3.3.2): backward Euler in steps that rise to LONG as fast as SETTLING permits. Where
    nothing can enter or leave the pore no profile is steady: returns the guess unchanged (None: C_supply everywhere).
    Raises TransportError where the profiles do not come to rest.
    """
    start = supplied_everywhere(problem) if guess is None else guess
    if not any(operator.inflow.any() or len(operator.held) for operator in problem.both):
        return start
    nothing = np.zeros(len(problem.body))
    system, now = _started(problem, nothing if active is None else active, nothing, start, living=False)
    system = replace(system, watched=np.ones(len(nothing), bool))
    step, last = LONG, np.inf
    for count in range(1, MOST_STEPS + 1):
        new, change = _accepted(system, now, step, SETTLING, "while the profiles settle", 1 / FASTER)
        if new.step >= LONG and change <= SETTLED * (1 - change / last):
            acceptor, donor = _restored(system, new)[:2]
            return Concentrations(acceptor, donor, count)
        now, step, last = _level(new.state), min(FASTER * new.step, LONG), change
    raise TransportError(f"the profiles still change by {change:.2g} of the supply a step after {MOST_STEPS} steps; "
                         'try numerics.transport = "quasi_steady"')


@timed("transport")
def advance(problem: Problem, active: np.ndarray, inert: np.ndarray, start: Concentrations, duration: float, *,
            tolerance: float = TOLERANCE, fixed_step: float | None = None, simultaneous: bool = False) -> Advance:
    """Integrate (7)-(10) over a duration (h) in one geometry.

    active, inert: X_A, X_I (N,) mg/L at the start; fixed_step: steps of that size (h), uncontrolled; simultaneous: both
    substrates see the other's prediction, as (3.3.1) may be read; less accurate, and long steps may then oscillate.
    Raises TransportError where the step falls under SHORTEST.
    """
    system, now = _started(problem, active, inert, start, simultaneous=simultaneous)
    before, steps, step, left = now.state[:2], [], fixed_step or min(FIRST, duration), duration
    while left > 1e-12 * duration:
        step = left / np.ceil(left / step - 1e-9)
        when = f"{duration - left:.6g} h after the start"
        now, size = _accepted(system, now, step, np.inf if fixed_step else tolerance, when, SHORTER)
        steps.append(float(now.step))
        left -= now.step
        step = fixed_step or now.step * min(LONGER, _factor(tolerance, size))
    stored = (now.state[:2] - before) @ system.total
    _, _, growth, remains = fields = _restored(system, now)
    flows = tuple((float(a), float(d)) for a, d in (*now.flows.T, stored))
    end = Concentrations(fields[0], fields[1], len(steps))
    return Advance(active * np.exp(growth), remains, end, flows, tuple(steps))


def make_biomass(scene, now, solved, duration: float):
    """(9)-(10) over a step (h) in a fixed geometry: the grown pore, concentrations at its end, substrate flows."""
    done = advance(solved.problem, now.active, now.inert, solved.concentrations, duration)
    return replace(now, active=done.active, inert=done.inert), done.concentrations, done.flows


def _started(problem: Problem, active, inert, start: Concentrations, living=True, simultaneous=False):
    """The system and its first time level."""
    order, state = problem.nodes, np.stack([start.acceptor, start.donor, np.zeros_like(active), inert])
    largest = np.maximum([operator.supply for operator in problem.both], state[:2].max(axis=1))
    scale, body = np.where(largest > 0, largest, 1.0)[:, None], problem.body[order]
    acceptor, donor = (_row(operator, order) for operator in problem.both)
    system = System(problem, (acceptor, donor), body, problem.total[order], active[order], body > 0, scale, living,
                    simultaneous)
    return system, _level(state[:, order])


def _level(state: np.ndarray) -> Level:
    """A first level, without a past."""
    return Level(state, np.zeros((2, 3)), np.zeros_like(state), np.zeros((2, 3)))


def _restored(system: System, level: Level) -> np.ndarray:
    """(4, N) state in the mesh's numbering."""
    state = np.empty_like(level.state)
    state[:, system.problem.nodes] = level.state
    return state


def _row(operator: Operator, order: np.ndarray) -> Row:
    held = np.isin(order, operator.held)
    matrix = sp.csc_matrix(operator.matrix[order][:, order])
    held_rows = sp.csr_matrix(matrix)[held]
    matrix.data[held[matrix.indices]] = 0.0
    diagonal = np.flatnonzero(matrix.indices == np.repeat(np.arange(len(order)), np.diff(matrix.indptr)))
    return Row(matrix, diagonal, held, held_rows, operator.source[order], operator, operator.outflow[order])


def _accepted(system: System, now: Level, step: float, tolerance: float, when: str, least: float):
    """A step of this size, or of the first smaller one that is positive and differs little enough from its prediction,
    and that difference over the scale; each try is shorter than the last by a factor of 1/2 to ``least``."""
    while step >= SHORTEST:
        new, difference = _corrected(system, now, step, positive=False)
        if new.state[:2].min() < 0:
            new, difference = _corrected(system, now, step, positive=True)
        size = float(np.max(difference[:, system.watched]))
        if new.state[:2].min() >= 0 and size <= tolerance:
            return new, size
        step *= max(least, min(0.5, _factor(tolerance, size)))
    raise _too_short(system, new, difference, when)


def _factor(tolerance: float, size: float) -> float:
    """Change of the step that brings the difference, of second order in it, just under the tolerance."""
    return SAFETY * np.sqrt(tolerance / max(size, 1e-99))


def _too_short(system: System, new: Level, difference: np.ndarray, when: str) -> TransportError:
    negative = new.state[:2].min() < 0
    wrong = new.state[:2] if negative else -difference * system.watched
    species, node = divmod(int(np.argmin(wrong)), len(system.body))
    x, y = system.problem.mesh.points[system.problem.nodes[node]]
    why = "becomes negative" if negative else "does not follow its prediction"
    return TransportError(f"the {('acceptor', 'donor')[species]} {why} at x = {x:.4g}, y = {y:.4g} um {when}, even in "
                          f"steps of {3600 * SHORTEST:g} s; try a larger numerics.refinement")


def _corrected(system: System, now: Level, step: float, positive: bool) -> tuple[Level, np.ndarray]:
    """One step, and |C - C*| over the scale (2, N); positive: by backward Euler with the positive sink."""
    ratio = step / now.step
    carry, weight = (0.0, 1.0) if positive else (ratio**2 / (1 + 2 * ratio), (1 + ratio) / (1 + 2 * ratio))
    rise, flux, interval = carry * now.rise, np.empty((2, 3)), weight * step
    fields = np.maximum(now.state[:2] + ratio * now.rise[:2], 0.0 if positive else -np.inf)
    predicted = fields.copy()
    active = system.active * np.exp(now.state[2] + rise[2] + interval * _rates(system, fields)[0])
    for s, row in enumerate(system.rows):
        sink = _sink(system, active, predicted if system.simultaneous else fields, s, positive)
        fields[s], flux[s] = _solved(row, system.total / interval, now.state[s] + rise[s], *sink)
    rise[:2] = fields - now.state[:2]
    growth, remains = _rates(system, fields)
    rise[2] += interval * growth
    rise[3] += interval * system.active * np.exp(now.state[2] + rise[2]) * remains
    flow = carry * now.flow + interval * flux
    state = np.vstack([fields, now.state[2:] + rise[2:]])
    return Level(state, now.flows + flow, rise, flow, step), np.abs(fields - predicted) / system.scale


def _rates(system: System, fields: np.ndarray):
    """F3 / X_A and F4 / X_A (1/h), zero where the biomass does not live."""
    if not system.living:
        return 0.0, 0.0
    substrates, kinetics = system.problem.substrates, system.problem.kinetics
    return law.growth_rate(fields[0], fields[1], substrates, kinetics), law.inert_rate(fields[0], substrates, kinetics)


def _sink(system: System, active: np.ndarray, fields: np.ndarray, s: int, positive: bool):
    """Slope and offset (N,) of the uptake of substrate s, slope C + offset (um2 mg/L/h), linearised at the fields."""
    if system.problem.kinetics is None:
        return np.zeros_like(active), np.zeros_like(active)
    *uptake, slopes = law.uptake(fields[0], fields[1], system.problem.substrates, system.problem.kinetics)
    load, slope, own = system.body * active, slopes[s][s], fields[s]
    if positive:
        tiny = np.finfo(float).tiny
        return load * np.where(own > tiny, uptake[s] / np.maximum(own, tiny), slope), np.zeros_like(active)
    return load * slope, load * (uptake[s] - slope * own)


def _solved(row: Row, storage: np.ndarray, past: np.ndarray, slope: np.ndarray, offset: np.ndarray):
    """C (N,) of storage (C - past) + L C - b + slope C + offset = 0, and what is supplied, leaves and is consumed."""
    matrix = row.matrix.copy()
    matrix.data[row.diagonal] += np.where(row.held, 1.0, storage + slope)
    field = linear.solve(matrix, np.where(row.held, row.operator.supply, storage * past + row.source - offset))
    sink = slope * field + offset
    entered = row.held_rows @ field + (storage * (field - past) - row.source + sink)[row.held]
    return field, (row.operator.supplied + entered.sum(), row.outflow @ field, sink.sum())
