"""The paper's transient scheme for substrates and biomass (3.3): predictor-corrector, modified Gear."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse as sp

from repro import kinetics as law
from repro import linear
from repro.transport import Concentrations, Operator, Problem, TransportError, supplied_everywhere

TOLERANCE = 1e-3
GROWTH, SHRINK, SAFETY = 2.0, 0.2, 0.8
SHORTEST = 1e-6 / 3600
SETTLED, SETTLING, LONG = 1e-9, 0.2, 24.0
JACOBI = False

@dataclass(frozen=True, eq=False)
class Level:
    state: np.ndarray
    rise: np.ndarray
    flows: np.ndarray
    flows_rise: np.ndarray
    step: float = np.inf


@dataclass(frozen=True, eq=False)
class Advance:
    active: np.ndarray
    inert: np.ndarray
    concentrations: Concentrations
    flows: tuple
    steps: tuple
    rejected: int = 0
    euler: int = 0


def _started(state):
    return Level(state, np.zeros_like(state), np.zeros((2, 3)), np.zeros((2, 3)))


def _formula(ratio):
    return ratio**2 / (1 + 2 * ratio), (1 + ratio) / (1 + 2 * ratio)


def _trial(problem, active, now, step, living=True, positive=False):
    ratio = step / now.step
    carry, weight = _formula(0.0 if positive else ratio)
    predicted = now.state + ratio * now.rise
    if positive:
        predicted[:2] = np.maximum(predicted[:2], 0)
    load = problem.body * active * np.exp(predicted[2])
    fields, rise, rates = predicted.copy(), carry * now.rise, np.empty((2, 3))
    for s, operator in enumerate((problem.acceptor, problem.donor)):
        slope, offset = _sink(problem, load, (predicted if JACOBI else fields)[:2], s, positive)
        fields[s], rates[s] = _solved(problem, operator, now.state[s] + carry * now.rise[s], weight * step, slope, offset)
        rise[s] = fields[s] - now.state[s]
    if living:
        rise[2] += weight * step * law.growth_rate(*fields[:2], problem.substrates, problem.kinetics)
        grown = active * np.exp(now.state[2] + rise[2])
        rise[3] += weight * step * grown * law.inert_rate(fields[0], problem.substrates, problem.kinetics)
    flows = carry * now.flows_rise + weight * step * rates
    return Level(now.state + rise, rise, now.flows + flows, flows, step), fields[:2] - predicted[:2]


def _sink(problem, load, fields, s, positive):
    if problem.kinetics is None:
        return np.zeros_like(load), np.zeros_like(load)
    *rates, slopes = law.uptake(*fields, problem.substrates, problem.kinetics)
    if positive:
        tiny = np.finfo(float).tiny
        return load * np.where(fields[s] > tiny, rates[s] / np.maximum(fields[s], tiny), slopes[s][s]), np.zeros_like(load)
    return load * slopes[s][s], load * (rates[s] - slopes[s][s] * fields[s])


def _solved(problem, operator, past, interval, slope, offset):
    storage = problem.total / interval
    free = np.ones(len(past)); free[operator.held] = 0
    matrix = sp.diags_array(free) @ (operator.matrix + sp.diags_array(storage + slope)) + sp.diags_array(1 - free)
    right = np.where(free > 0, storage * past + operator.source - offset, operator.supply)
    field = linear.solve(matrix, right, problem.nodes)
    sink = slope * field + offset
    missing = storage * (field - past) + operator.matrix @ field - operator.source + sink
    return field, (operator.supplied + missing[operator.held].sum(), operator.outflow @ field, sink.sum())


def _scale(problem, fields):
    supplies = np.array([problem.acceptor.supply, problem.donor.supply])
    top = np.maximum(supplies, fields.max(axis=1))
    return np.where(top > 0, top, 1.0)


def advance(problem, active, inert, start, duration, tolerance=TOLERANCE, fixed_step=None, time=0.0, first=None):
    state = np.stack([start.acceptor, start.donor, np.zeros_like(active), inert])
    now, done, steps, step = _started(state), 0.0, [], first or duration
    scale = _scale(problem, state[:2])[:, None]
    where = problem.body > 0
    rejected = euler = 0
    while duration - done > 1e-12 * duration:
        left = duration - done
        step = fixed_step or step
        step = left if step >= left else min(step, left / 2) if step > left / 2 else step
        new, difference = _trial(problem, active, now, step)
        pos = False
        if new.state[:2].min() < 0:
            new, difference = _trial(problem, active, now, step, positive=True); pos = True
        size = np.max(np.abs(difference / scale)[:, where])
        bad = new.state[:2].min() < 0
        if not fixed_step and (bad or size > tolerance):
            rejected += 1
            step *= 0.5 if bad else max(SHRINK, SAFETY * np.sqrt(tolerance / size))
            if step < SHORTEST: raise TransportError("short")
            continue
        done += step; steps.append(step); now = new; euler += pos
        step *= min(GROWTH, SAFETY * np.sqrt(tolerance / max(size, 1e-30)))
    fields = now.state
    stored = ((fields[:2] - state[:2]) @ problem.total)
    flows = (*(tuple(c) for c in now.flows.T), tuple(stored))
    return Advance(active * np.exp(fields[2]), fields[3], Concentrations(fields[0], fields[1], len(steps)), flows, tuple(steps), rejected, euler)


def settle(problem, active, guess, trace=None):
    start = supplied_everywhere(problem) if guess is None else guess
    active = np.zeros_like(problem.body) if active is None else active
    if not any(o.inflow.any() or len(o.held) for o in (problem.acceptor, problem.donor)):
        return start
    zero = np.zeros_like(active)
    now, step = _started(np.stack([start.acceptor, start.donor, zero, zero])), LONG
    scale = _scale(problem, now.state[:2])[:, None]
    for count in range(1000):
        new, difference = _trial(problem, active, now, step, living=False)
        pos = new.state[:2].min() < 0
        if pos:
            new, difference = _trial(problem, active, now, step, living=False, positive=True)
        size = np.max(np.abs(difference / scale))
        if trace is not None: trace.append((step, size, pos))
        if size > SETTLING or new.state[:2].min() < 0:
            step *= 0.1; continue
        now = _started(new.state)
        if size < SETTLED and step >= LONG: return Concentrations(*now.state[:2], count + 1)
        step = max(min(step * 10, LONG * 1), step)
    raise TransportError("no settle")
