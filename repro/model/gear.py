"""The paper's transient scheme (3.3): a modified Gear method for substrates and biomass.

Every quantity y of (7)-(10), dy/dt = f, advances by Gear's second-order formula (BDF2). With r the
ratio of a step h to the one before it (r = 0, backward Euler, in the first step),

    predictor   y* = y + r dy                        dy the last increment
    corrector   dy_new = carry dy + weight h f_new   carry = r^2 / (1 + 2 r)
                                                     weight = (1 + r) / (1 + 2 r)

For C_A and C_D, (7) and (8), the corrector is one linear system each,

    M (C - C_n - carry dC_n) / (weight h) + L C - b + m X_A (q(C*) + q'(C*) (C - C*)) = 0

where M is the mass matrix (lumped for linear concentrations), and L and b are those of
:mod:`repro.model.transport`. The uptake at the points of the reaction uses the predicted X_A, and q
is linearised in the substrate's own concentration. The uptake of the acceptor uses the predicted
donor, and the uptake of the donor uses the corrected acceptor. At the corrected concentrations (9)
advances ln X_A and (10) advances X_I, so both masses stay positive. The same formula integrates
concentrations and fluxes, so that supplied - out - consumed = stored to round-off. If the corrector
gives a negative concentration, the step is backward Euler's with the sink C q(C*) / C*, which keeps
C >= 0.

The step size is controlled by |C - C*| within the aggregate (3.3.2), relative to the substrate's
largest concentration.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TypeAlias

import numpy as np
import scipy.sparse as sp

from repro.errors import TransportError, failing_as
from repro.fem import linear
from repro.fem.assembly import ElementSystem
from repro.fem.space import Space
from repro.model.kinetics import Sink
from repro.model.transport import (
    Concentrations,
    Flows,
    Problem,
    concentrations,
    coupled_system,
    supplied_everywhere,
)
from repro.timing import timed

#: Largest accepted |C - C*| in the aggregate over the supply. Errors were measured against a
#: tolerance of 3e-6, after 12 min in settled pores (base; a seed of 40 um; wide at 40 h) and in
#: closed ones filled with the supply (seeds of 5 and 40 um). The largest error in concentrations,
#: biomass made or uptake is 2e-2 at a tolerance of 1e-1, 9e-4 at 1e-2, and 3.1e-4 at 1e-3. The
#: tolerance therefore stays at 0.1 %.
TOLERANCE = 1e-3
#: Bounds on the ratio of successive steps.
LONGER = 2.0
SHORTER = 0.2
#: Ratio of a step's size to the size that would just be accepted.
SAFETY = 0.8
#: Longest first step (h). This step is of first order. Its error is below 2e-4 with 45 s, and 2e-2
#: with 720 s.
FIRST = 45 / 3600
#: Least step (h); a shorter step fails.
SHORTEST = 1e-6 / 3600
#: Profiles are steady if all further steps of LONG (h) together would change them by at most this
#: part of the supply.
STEADY = 1e-9
LONG = 1e6
#: In :func:`settle`: the largest change in a step, over the supply.
SETTLING = 0.3
#: In :func:`settle`: the factor by which steps grow and shrink, and the largest number of steps.
FASTER = 10.0
MOST_STEPS = 1000

#: A rate (1/h): one value at each point (r, q), or one number for all points.
Rate: TypeAlias = np.ndarray | float


@dataclass(frozen=True, eq=False)
class Level:
    """One time level.

    fields: (s, n) mg/L, of the modelled substrates; biomass: (2, r, q), rise of ln X_A since the
    start, and X_I (um2 mg/L); flows: (2, 4) um2 mg/L, of acceptor and donor since the start:
    supplied, out, consumed, unmet demand; field_rise, biomass_rise, flow_rise: their increments in
    the last step; step: size (h) of the last step.
    """

    fields: np.ndarray
    biomass: np.ndarray
    flows: np.ndarray
    field_rise: np.ndarray
    biomass_rise: np.ndarray
    flow_rise: np.ndarray
    step: float = np.inf


@dataclass(frozen=True, eq=False)
class Advance:
    """Result of an integration.

    active, inert: X_A and X_I (r, q) um2 mg/L at the end; concentrations: mg/L, at the end; flows:
    over the duration; steps: sizes (h) of the steps.
    """

    active: np.ndarray
    inert: np.ndarray
    concentrations: Concentrations
    flows: Flows
    steps: tuple[float, ...]


@dataclass(frozen=True, eq=False)
class Row:
    """Equations of one substrate.

    operator, storage: (d,) entries of L and of the mass matrix (:meth:`ElementSystem.entries`);
    matrix, mass: both as (n, n) matrices; source: (n,) um2 mg/L/h; supply: mg/L.
    """

    operator: np.ndarray
    storage: np.ndarray
    matrix: sp.csc_matrix
    mass: sp.csc_matrix
    source: np.ndarray
    supply: float


@dataclass(frozen=True, eq=False)
class System:
    """A problem with data of the scheme.

    active: (r, q) um2 mg/L at the start; watched: (n,) True at nodes that control the step; scale:
    (s, 1) mg/L, of the concentrations; living: are F3 and F4 integrated?; simultaneous: see
    :func:`advance`.
    """

    problem: Problem
    active: np.ndarray
    watched: np.ndarray
    scale: np.ndarray
    living: bool
    simultaneous: bool = False

    @property
    def space(self) -> Space:
        """The problem's space."""
        return self.problem.space

    @cached_property
    def sparse(self) -> ElementSystem:
        """The system of one substrate: all triangles, then the pieces of biomass."""
        return coupled_system(self.space, bool(self.problem.system.constrained.any()), 1)

    @cached_property
    def storage(self) -> np.ndarray:
        """(T, k, k) um2, the mass matrix; lumped for linear functions."""
        return self.space.integration.mass()

    @cached_property
    def rows(self) -> tuple[Row, ...]:
        """The equations of the modelled substrates."""
        return tuple(map(self._row, range(len(self.problem.kinds))))

    def _row(self, s: int) -> Row:
        problem = self.problem
        unknowns = slice(s * self.space.count, (s + 1) * self.space.count)
        operator = self.sparse.entries(0, problem.matrices[s])
        storage = self.sparse.entries(0, self.storage)
        return Row(operator, storage, problem.operator[unknowns, unknowns], self.mass,
                   problem.source[unknowns], problem.kinds[s].supply)

    @cached_property
    def mass(self) -> sp.csc_matrix:
        """(n, n) um2, assembled from :attr:`storage`."""
        size = self.space.count
        rows, columns = (part.ravel() for part in linear.pairs(self.space.cells))
        return sp.csc_matrix((self.storage.ravel(), (rows, columns)), shape=(size, size))


@timed("transport")
@failing_as(TransportError)
def settle(problem: Problem, sink: Sink | None, guess: Concentrations | None) -> Concentrations:
    """Compute steady profiles after a shape update: integrate with F3 = F4 = 0 until C is steady.

    Parameters
    ----------
    problem : Problem
    sink : Sink, optional
        Biomass that takes up substrates; None without biomass.
    guess : Concentrations, optional
        Start of the scheme; C_supply everywhere by default.

    Returns
    -------
    Concentrations
        C_A and C_D (n,), mg/L. The guess if nothing can enter or leave the pore, because no profile
        is then steady.

    Raises
    ------
    TransportError
        If the profiles do not become steady.

    Notes
    -----
    The transient does not matter (3.3.2). The steps are backward Euler's and grow to LONG as fast
    as SETTLING permits. If a law of uptake is not monotone, the transient decides which steady
    state is reached. Changes in a step are then FASTER times smaller, and the step grows as the
    rate of change decreases.
    """
    start = _nearer(problem, guess)
    if not (problem.inflow.any() or problem.system.constrained.any()):
        return start
    nothing = np.zeros_like(problem.space.reaction.dx)
    active = nothing if sink is None else sink.active
    system, level = _started(problem, active, nothing, start, living=False)
    system = replace(system, watched=np.ones(problem.space.count, bool))
    monotone = problem.law is None or problem.law.uptake_law.monotone
    most = SETTLING if monotone else SETTLING / FASTER
    step = LONG
    last = rate = np.inf
    for count in range(1, MOST_STEPS + 1):
        new, change = _accepted(system, level, step, most, "while the profiles settle", 1 / FASTER)
        if new.step >= LONG and change <= STEADY * (1 - change / last):
            return concentrations(problem.substrates, new.fields, count)
        level = _level(new.fields, level.biomass)
        faster = FASTER
        if not monotone and change > STEADY:
            faster = max(1 / FASTER, min(FASTER, rate * new.step / change))
        step = min(faster * new.step, LONG)
        rate = change / new.step
        last = change
    raise TransportError(f"the profiles still change by {change:.2g} of the supply a step after "
                         f"{MOST_STEPS} steps")


def _nearer(problem: Problem, guess: Concentrations | None) -> Concentrations:
    """The guess, or C_supply everywhere if there is no guess.

    C_supply also replaces the guess if constrained nodes would jump by more than SETTLING. No step
    is short enough for a larger jump, because quadratic concentrations beside it would become
    negative.
    """
    supplied = supplied_everywhere(problem)
    if guess is None:
        return supplied
    change = np.abs(guess.fields.ravel() - problem.supply)
    jumps = problem.system.constrained & (change > SETTLING * problem.supply)
    return supplied if jumps.any() else guess


@timed("transport")
@failing_as(TransportError)
def advance(problem: Problem, active: np.ndarray, inert: np.ndarray, start: Concentrations,
            duration: float, *, tolerance: float = TOLERANCE, fixed_step: float | None = None,
            simultaneous: bool = False) -> Advance:
    """Integrate (7)-(10) over a duration in one geometry.

    Parameters
    ----------
    problem : Problem
    active, inert : (r, q) float
        X_A and X_I at the start, um2 mg/L.
    start : Concentrations
        C_A and C_D (n,) at the start, mg/L.
    duration : float
        Hours.
    tolerance : float
        Largest |C - C*| in the aggregate over the supply.
    fixed_step : float, optional
        Size (h) of steps without error control.
    simultaneous : bool
        Does the uptake of each substrate use the prediction of the other one? This is a possible
        reading of 3.3.1. It is less accurate, and long steps may oscillate.

    Returns
    -------
    Advance

    Raises
    ------
    TransportError
        If a step would be shorter than SHORTEST.
    """
    system, level = _started(problem, active, inert, start, simultaneous=simultaneous)
    before = level.fields
    left = duration
    step = fixed_step or min(FIRST, duration)
    steps = []
    while left > 1e-12 * duration:
        step = left / np.ceil(left / step - 1e-9)
        when = f"{duration - left:.6g} h after the start"
        level, size = _accepted(system, level, step, np.inf if fixed_step else tolerance, when,
                                SHORTER)
        steps.append(float(level.step))
        left -= level.step
        step = fixed_step or level.step * min(LONGER, _factor(tolerance, size))
    stored = np.zeros(2)
    stored[problem.substrates.places] = (system.mass @ (level.fields - before).T).sum(axis=0)
    supplied, out, consumed, unmet = level.flows.T
    flows = Flows(*((float(a), float(d)) for a, d in (supplied, out, consumed, stored, unmet)))
    growth, remains = level.biomass
    end = concentrations(problem.substrates, level.fields, len(steps))
    return Advance(active * np.exp(growth), remains, end, flows, tuple(steps))


def _started(problem: Problem, active: np.ndarray, inert: np.ndarray, start: Concentrations,
             living: bool = True, simultaneous: bool = False) -> tuple[System, Level]:
    """The system and its first time level."""
    fields = start.fields
    largest = np.maximum([s.supply for s in problem.kinds], fields.max(axis=1))
    scale = np.where(largest > 0, largest, 1.0)[:, None]
    watched = np.zeros(problem.space.count, bool)
    watched[problem.space.reaction.cells] = True
    system = System(problem, active, watched, scale, living, simultaneous)
    return system, _level(fields, np.stack([np.zeros_like(active), inert]))


def _level(fields: np.ndarray, biomass: np.ndarray) -> Level:
    """The first time level, without increments."""
    still = np.zeros_like(fields), np.zeros_like(biomass), np.zeros((2, 4))
    return Level(fields, biomass, np.zeros((2, 4)), *still)


def _accepted(system: System, level: Level, step: float, tolerance: float, when: str,
              least: float) -> tuple[Level, float]:
    """Make a step of at most ``step`` (h) that stays positive and agrees with its prediction.

    Also returns its largest difference from the prediction over the scale. Each trial is shorter
    than the previous one by a factor between ``least`` and 1/2. Raises TransportError if the step
    would be shorter than SHORTEST; when: names the time in the message.
    """
    floor = _lowest(system.problem)
    shortest = min(SHORTEST, step)
    while step >= shortest:
        new, difference = _tried(system, level, step, floor)
        size = float(np.max(difference[:, system.watched], initial=0.0))
        if (new.fields >= floor).all() and size <= tolerance:
            return new, size
        step *= max(least, min(0.5, _factor(tolerance, size)))
    raise _too_short(system, new, difference, when)


def _tried(system: System, level: Level, step: float,
           floor: np.ndarray) -> tuple[Level, np.ndarray]:
    """One step, and its difference (s, n) from the prediction over the scale.

    The step uses the positive sink if a concentration is below zero without it, and if either the
    positive sink prevents this or the concentration is below ``floor`` (s, 1).
    """
    plain = _corrected(system, level, step, positive=False)
    fields = plain[0].fields
    if fields.min() >= 0:
        return plain
    positive = _corrected(system, level, step, positive=True)
    return positive if positive[0].fields.min() >= 0 or (fields < floor).any() else plain


def _lowest(problem: Problem) -> np.ndarray:
    """(s, 1) least accepted concentrations, mg/L."""
    return np.array([[-problem.scheme.undershoot * s.supply] for s in problem.kinds])


def _factor(tolerance: float, size: float) -> float:
    """Ratio of step sizes that reduces a second-order difference to just below the tolerance."""
    return SAFETY * np.sqrt(tolerance / max(size, 1e-99))


def _too_short(system: System, new: Level, difference: np.ndarray, when: str) -> TransportError:
    room = new.fields - _lowest(system.problem)
    negative = room.min() < 0
    wrong = room if negative else -difference * system.watched
    species, node = divmod(int(np.argmin(wrong)), system.space.count)
    x, y = system.space.points[node]
    why = "becomes negative" if negative else "does not follow its prediction"
    name = list(system.problem.substrates.modelled)[species]
    return TransportError(f"the {name} {why} at x = {x:.4g}, y = {y:.4g} um {when}, even in steps "
                          f"of {3600 * SHORTEST:g} s; try numerics.transport = "
                          '"quasi_steady", which solves for steady profiles')


def _corrected(system: System, level: Level, step: float,
               positive: bool) -> tuple[Level, np.ndarray]:
    """One step, and |C - C*| over the scale (s, n); positive: is the step backward Euler's with the
    positive sink?"""
    ratio = step / level.step
    carry, weight = (0.0, 1.0) if positive else _formula(ratio)
    interval = weight * step
    fields = np.maximum(level.fields + ratio * level.field_rise, 0.0 if positive else -np.inf)
    predicted = fields.copy()
    field_rise = carry * level.field_rise
    biomass_rise = carry * level.biomass_rise
    flux = np.zeros((2, 4))
    first = system.problem.substrates.places.start
    rise = level.biomass[0] + biomass_rise[0] + interval * _rates(system, fields)[0]
    active = system.active * np.exp(rise)
    for s in range(len(fields)):
        other_fields = predicted if system.simultaneous else fields
        past = level.fields[s] + field_rise[s]
        sink = _sink(system, active, other_fields, s, positive)
        fields[s], flux[first + s, :3] = _solved(system, s, interval, past, *sink)
    field_rise = fields - level.fields
    growth, remains = _rates(system, fields)
    biomass_rise[0] += interval * growth
    rise = level.biomass[0] + biomass_rise[0]
    biomass_rise[1] += interval * system.active * np.exp(rise) * remains
    law = system.problem.law
    if law is not None:
        fractions = law.uptake_law.fraction(system.space.reaction.evaluate(fields))
        flux[:, 3] = Sink(system.active * np.exp(rise)).unmet(fractions, law)
    flow_rise = carry * level.flow_rise + interval * flux
    new = Level(fields, level.biomass + biomass_rise, level.flows + flow_rise, field_rise,
                biomass_rise, flow_rise, step)
    return new, np.abs(fields - predicted) / system.scale


def _formula(ratio: float) -> tuple[float, float]:
    """Carry and weight of Gear's formula for the ratio of a step to the previous step."""
    return ratio**2 / (1 + 2 * ratio), (1 + ratio) / (1 + 2 * ratio)


def _rates(system: System, fields: np.ndarray) -> tuple[Rate, Rate]:
    """F3 / X_A and F4 / X_A (r, q) 1/h; zero if growth and decay are not integrated."""
    problem = system.problem
    if not system.living or problem.law is None:
        return 0.0, 0.0
    values = system.space.reaction.evaluate(fields)
    return problem.law.growth_rate(*values), problem.law.inert_rate(*values)


def _sink(system: System, active: np.ndarray, fields: np.ndarray, s: int,
          positive: bool) -> tuple[np.ndarray, np.ndarray]:
    """Slope and offset (r, q) of the uptake of substrate s, linearised at ``fields``: the uptake is
    slope C + offset (um2 mg/L/h)."""
    law = system.problem.law
    if law is None:
        return np.zeros_like(active), np.zeros_like(active)
    values = system.space.reaction.evaluate(fields)
    substrate = values[s]
    uptake, slope = law.own_uptake(s, *values)
    if positive:
        secant = np.divide(uptake, substrate, out=slope, where=substrate > np.finfo(float).tiny)
        return active * secant, np.zeros_like(active)
    return active * slope, active * (uptake - slope * substrate)


def _solved(system: System, s: int, interval: float, past: np.ndarray, slope: np.ndarray,
            offset: np.ndarray) -> tuple[np.ndarray, tuple[float, float, float]]:
    """C (n,) mg/L of M (C - past) / interval + L C - b + slope C + offset = 0.

    Also returns supply, outflow and consumption, um2 mg/L/h.
    """
    row = system.rows[s]
    sparse = system.sparse
    reaction = system.space.reaction
    entries = row.operator + row.storage / interval + sparse.entries(1, reaction.mass(slope))
    right = row.mass @ past / interval + row.source - reaction.assembled(offset)
    constrained = np.where(sparse.constrained, row.supply, 0.0)
    prescribed = row.matrix @ constrained + row.mass @ constrained / interval
    field = constrained
    solver = linear.factorised(sparse.filled(entries), system.space.mesh.topology.method)
    field[sparse.order] = solver.solve((right - prescribed)[sparse.order])
    consumed = slope * reaction.evaluate(field) + offset
    stored = row.mass @ (field - past) / interval
    entered = row.matrix @ field + stored - row.source + reaction.assembled(consumed)
    supplied = row.source.sum() + entered[sparse.constrained].sum()
    return field, (supplied, float(system.problem.outflow @ field), consumed.sum())
