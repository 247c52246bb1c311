"""One step of the midpoint rule, second order in time: see :mod:`repro.march.stepping`.

Half a step with the rates at its start gives the shape half way. There the substrates are solved
with the *mean* biomass over the step, computed with the rates being solved for: M (e^z - 1) / z for
a mass M that grows by e^z. These rates integrate (9)-(10) over the entire step. Uptake and growth
in a step are then one integral, and both balances close to round-off.

A row at the fraction s of a step of length h integrates (9)-(10) over s h with the rates (1 - s)
k_1 + s k_2, where k_1 are the rates at the start and k_2 those half way. This interpolation is of
second order too. At s = 1 it equals the step, which integrates k_2 over h (Hairer, Norsett and
Wanner, Solving Ordinary Differential Equations I, section II.6). Shape, contact and mesh follow
from those at the start, as in a step. Flow and substrates are solved in this shape.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from repro.fem import transfer
from repro.fem.space import Space
from repro.march.balance import Ledger
from repro.march.ends import refuse_outside
from repro.march.folding import refuse_density, refuse_fold
from repro.march.loop import time_before_end
from repro.march.state import InterpolatedState, StepResult
from repro.model import biomass, contact_lines, remeshing
from repro.model.biomass import Rates, grow
from repro.model.contact_lines import PATIENT, FirstContact, SearchOptions
from repro.model.mechanics import Expansion
from repro.model.pore import Pore
from repro.model.remeshing import GeneratedMesh
from repro.model.solving import Solved
from repro.model.stages import Stages
from repro.model.transport import Concentrations, integrated


@dataclass(frozen=True, eq=False)
class Attempt:
    """Attempted step of the midpoint rule.

    step: its result, None if the rates change too much or if it ends long after the first contact;
    change: mean change of the rates over its first half, 1/h; gaps: least distance (um) to a
    wall without contact before and after the step, if the step makes the first contact with it.
    """

    step: StepResult | None
    change: float
    gaps: tuple[float, float] | None = None


@dataclass(frozen=True, eq=False)
class Halfway:
    """Solution half way through a step.

    duration: h, of the entire step; first: rates at its start; expansion: the aggregate half way;
    solved: flow and substrates half way; rates: half way, at the points of the mesh at the start;
    produced: growth of active and of inert biomass of each aggregate over the entire step, um2
    mg/L; generated: meshes that the step has generated so far; end: the aggregate at the end, None
    before it is known.
    """

    duration: float
    first: Rates
    expansion: Expansion
    solved: Solved
    rates: Rates
    produced: tuple[tuple[float, float], ...]
    generated: tuple[GeneratedMesh, ...]
    end: Expansion | None = None


def attempt(stages: Stages, previous: Pore, solved: Solved, duration: float,
            largest_change: float = np.inf, search: SearchOptions = PATIENT) -> Attempt:
    """Attempt a step of ``duration`` (h).

    It succeeds if the rates change by at most ``largest_change`` (1/h) over its first half. Raises
    StageError if a stage fails.
    """
    first = stages.rates(previous, solved)
    try:
        half = solve_halfway(stages, previous, solved, first, duration, search)
    except FirstContact as early:
        before, halfway = early.gaps
        return Attempt(None, 0.0, (before, before - 2 * (before - halfway)))
    change = biomass.change(first, half.rates, previous.space.reaction.dx)
    if change > largest_change:
        return Attempt(None, change)
    after = _match_production(previous, grow(previous, half.rates, duration), half.produced)
    after = replace(after, time=time_before_end(previous, duration))
    try:
        expansion = _expand(stages, previous, after, half, 1.0, search)
    except FirstContact as early:
        return Attempt(None, 0.0, early.gaps)
    expanded = expansion.pore
    refuse_outside(stages.channel, previous, expanded)
    refuse_fold(expanded)
    expanded = replace(expanded, concentrations=_guess_substrates(solved, half, 1.0))
    new, remeshed = stages.new_mesh(previous, expanded, solved)
    generated = (GeneratedMesh(expanded, new),) if remeshed else ()
    refuse_density(previous, new, stages.remeshing.maximum_density)
    makes_contact = expanded.spanning > previous.spanning
    new = _with_line_speeds(new, previous, expansion, duration)
    flows = integrated(duration, half.solved.substrates.fluxes)
    ledger = Ledger(previous.time, previous.time + duration, *flows[:4], previous.mass,
                    after.mass - previous.mass, new.mass, flows.unmet)
    complete = replace(half, generated=half.generated + generated, end=expansion)
    inner = partial(interpolate, stages, previous, solved, complete)
    step = StepResult(new, None, ledger, remeshed, expansion.iterations, inner)
    return Attempt(step, change, expansion.gaps if makes_contact else None)


def _with_line_speeds(new: Pore, previous: Pore, expansion: Expansion, duration: float) -> Pore:
    """The pore with the speeds of contact lines in a step; unknown after a first contact."""
    bodies = []
    for number, (before, after) in enumerate(zip(previous.bodies, new.bodies)):
        makes_contact = after.spans and not before.spans
        speeds = contact_lines.speeds(expansion.advances, number, duration)
        bodies.append(replace(after, line_speeds=None if makes_contact else speeds))
    return replace(new, bodies=tuple(bodies))


def _expand(stages: Stages, previous: Pore, after: Pore, half: Halfway, part: float,
            search: SearchOptions) -> Expansion:
    """Equilibrium of the aggregate at a part of the step, starting from its known shapes.

    Contact lines start at their interpolated places and have small triangles there.
    """
    shapes = _known_shapes(half, part)
    advances = {key: sum(weight * shape.advances.get(key, 0.0) for weight, shape in shapes)
                for key in half.expansion.advances}
    search = replace(search, advances=advances,
                     line_size=stages.remeshing.meshing.sizes.moving_lines)
    return stages.expand(previous, after, _guess_shape(previous, shapes), search)


def solve_halfway(stages: Stages, previous: Pore, solved: Solved, first: Rates, duration: float,
                  search: SearchOptions) -> Halfway:
    """Solve in the shape after half of ``duration`` (h) with the rates at the start.

    If the moved mesh is not acceptable, a new one replaces it. Masses are carried to its points,
    and rates back to the points of the material.
    """
    ahead = replace(grow(previous, first, duration / 2), time=previous.time + duration / 2)
    advances: dict[tuple[int, int, int], float] = {}
    for number, body in enumerate(previous.bodies):
        advances |= contact_lines.advances_at(body.line_speeds, number, duration / 2)
    search = replace(search, advances=advances)
    expansion = stages.expand(previous, ahead, _scale_shape(previous, ahead), search)
    shape = expansion.pore
    mesh = remeshing.moved_mesh(stages.remeshing.meshing, previous, shape)
    if mesh is not None:
        middle = replace(previous, space=Space(mesh), time=shape.time)
    else:
        amounts = tuple(expansion.amounts(amount, previous)
                        for amount in (previous.active, previous.inert))
        middle, (active, inert) = remeshing.remesh(stages.remeshing, previous, shape,
                                                   solved.mean_velocity, amounts)
        middle = middle.with_masses(active, inert)
    solution = stages.solver.solve(middle, duration)
    rates = stages.rates(middle, solution)
    after = grow(middle, rates, duration)
    if mesh is None:
        rates = _carry_rates_back(middle, previous, expansion, rates)
    produced = tuple((float((new.active - old.active).sum()), float((new.inert - old.inert).sum()))
                     for old, new in zip(middle.bodies, after.bodies))
    generated = () if mesh else (GeneratedMesh(shape, middle),)
    return Halfway(duration, first, expansion, solution, rates, produced, generated)


def interpolate(stages: Stages, previous: Pore, solved: Solved, half: Halfway,
                time: float) -> InterpolatedState:
    """Interpolate the pore to a time (h) within a step, as the step itself advances, and solve
    there.

    If the moved mesh is not acceptable, the nearest of the meshes that the step has generated
    replaces it.
    """
    part = (time - previous.time) / half.duration
    mean = Rates((1 - part) * half.first.growth + part * half.rates.growth,
                 (1 - part) * half.first.remains + part * half.rates.remains)
    after = replace(grow(previous, mean, part * half.duration), time=time)
    expanded = _expand(stages, previous, after, half, part, PATIENT).pore
    expanded = replace(expanded, concentrations=_guess_substrates(solved, half, part))
    nearest = sorted(half.generated, key=lambda each: abs(each.shape.time - time))
    inner, _ = stages.new_mesh(previous, expanded, solved, nearest)
    return InterpolatedState(*stages.grading.solve(inner))


def _carry_rates_back(middle: Pore, previous: Pore, half: Expansion, rates: Rates) -> Rates:
    """Interpolate rates at the points of a new mesh back to those of the previous mesh."""
    mesh = middle.mesh
    nodal = np.column_stack([middle.space.integration.to_nodes(field)
                             for field in (rates.growth, rates.remains)])
    carried = transfer.interpolate(mesh.points, mesh.cells[mesh.biomass], nodal,
                                   half.position[previous.mesh.body])
    growth, remains = map(previous.space.integration.to_points,
                          previous.mesh.from_body(carried).T)
    return Rates(growth, remains)


def _match_production(previous: Pore, after: Pore,
                      produced: tuple[tuple[float, float], ...]) -> Pore:
    """Correct the growth of each aggregate to that computed half way, to the last bit.

    The difference is due to the interpolation of the rates. It is added in proportion to the active
    biomass.
    """
    bodies = []
    for old, new, (active, inert) in zip(previous.bodies, after.bodies, produced):
        share = old.active / old.active.sum()
        missing = [active - float((new.active - old.active).sum()),
                   inert - float((new.inert - old.inert).sum())]
        bodies.append(replace(new, active=new.active + missing[0] * share,
                              inert=new.inert + missing[1] * share))
    return replace(after, bodies=tuple(bodies))


def _guess_substrates(start: Solved, half: Halfway, part: float) -> Concentrations:
    """Initial guess of the substrates at a part of the step."""
    first = start.substrates.concentrations
    return _extrapolate_substrates(first, half.solved.substrates.concentrations, part)


def _extrapolate_substrates(first: Concentrations, second: Concentrations,
                            part: float) -> Concentrations:
    """Extrapolate concentrations to a part of the step, from its start and half way.

    If the extrapolation is negative anywhere, the guess is the solution half way. If the mesh has
    changed half way, the guess is the solution at the start.
    """
    if second.fields.shape != first.fields.shape:
        return first
    fields = first.fields + 2 * part * (second.fields - first.fields)
    if fields.min() < 0:
        return second
    return first.with_fields(fields)


def _scale_shape(previous: Pore, after: Pore) -> Pore:
    """Initial guess of the shape: an aggregate on one wall is scaled by the root of its growth."""
    points = previous.mesh.points.copy()
    for before, grown, region, outline in zip(previous.bodies, after.bodies, previous.mesh.regions,
                                              previous.outlines):
        if before.spans:
            continue
        fixed = outline.points[outline.fixed][:1]
        scale = np.sqrt(grown.mass / before.mass)
        points[region.nodes] = fixed + (points[region.nodes] - fixed) * scale
    return _place_bodies(after, points)


def _known_shapes(half: Halfway, part: float) -> list[tuple[float, Expansion]]:
    """Weights of the known shapes of a step at a part of it, besides that of its start: the shape
    is extrapolated from the first half, or interpolated in start, half way and end if the end is
    known."""
    if half.end is None:
        return [(2 * part, half.expansion)]
    return [(4 * part * (1 - part), half.expansion), (part * (2 * part - 1), half.end)]


def _guess_shape(previous: Pore, shapes: list[tuple[float, Expansion]]) -> Pore:
    """Initial guess of the shape, from those of :func:`_known_shapes`."""
    corners = previous.mesh.corners
    push = previous.pressure
    points = previous.mesh.points
    for weight, shape in shapes:
        push = push + weight * (shape.pore.pressure[:corners] - previous.pressure)
        points = points + weight * (shape.position - previous.mesh.points)
    return _place_bodies(replace(previous, pressure=push), points)


def _place_bodies(after: Pore, points: np.ndarray) -> Pore:
    """Move the aggregates' nodes to ``points``, unless this turns a triangle over."""
    moved = after.moved(after.mesh.from_body(points[after.mesh.body], after.mesh.points))
    biomass_cells = np.flatnonzero(moved.mesh.biomass)
    return after if moved.mesh.turned_over(biomass_cells).any() else moved
