"""One step of the midpoint rule, second order in time: see :mod:`repro.march.stepping`.

Half a step with the rates at its start gives the shape half way. The substrates are solved in this
shape with the *mean* biomass over the step: M (e^z - 1) / z for a mass M that grows by e^z. The
mean depends on the rates being solved for. These rates integrate (9)-(10) over the entire step.
Uptake and growth in a step are then one integral, and both balances close to round-off.

A row at the fraction s of a step of length h integrates (9)-(10) over s h with the rates
(1 - s) k_1 + s k_2, where k_1 are the rates at the start and k_2 the rates half way. This
interpolation is of second order too. At s = 1 it equals the step, which integrates k_2 over h
(Hairer, Norsett and Wanner, Solving Ordinary Differential Equations I, section II.6). Shape,
contact and mesh are advanced from the start, as in a step. Flow and substrates are solved in this
shape.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from repro.fem import transfer
from repro.fem.space import Space
from repro.fem.walls import numbered
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

    step: the result, None if the rates change too much or if the step ends too long after the first
    contact with a wall; change: 1/h, mean change of the rates over the first half; gaps: (um,
    um), least distance to this wall before and after the step, None without a first contact.
    """

    step: StepResult | None
    change: float
    gaps: tuple[float, float] | None = None


@dataclass(frozen=True, eq=False)
class Halfway:
    """Solution half way through a step.

    duration: h, of the entire step; first: rates at its start; expansion: the aggregates half way;
    solved: flow and substrates half way; rates: half way, at the points of the mesh at the start;
    produced: for each aggregate, increase of active and of inert biomass over the entire step, um2
    mg/L; generated: meshes that the step has generated so far; end: the aggregates at the end, None
    until they are computed.
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
            largest_change: float = np.inf, search: SearchOptions = PATIENT,
            meshes: tuple[GeneratedMesh, ...] = ()) -> Attempt:
    """Attempt a step of ``duration`` (h).

    The step succeeds if the rates change by at most ``largest_change`` (1/h) over its first half.
    meshes: meshes that other steps from the same start have generated. One of them replaces a new
    mesh at the end, if possible. Raises StageError if a stage fails, and RunEnd if the step passes
    an end of the pore or if aggregates overlap.
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
    new, remeshed = stages.new_mesh(previous, expanded, solved, meshes)
    generated = (GeneratedMesh(expanded, new),) if remeshed else ()
    refuse_density(previous, new, stages.remeshing.maximum_density)
    makes_contact = expanded.spanning > previous.spanning
    new = _with_line_speeds(new, previous, half, expansion)
    flows = integrated(duration, half.solved.substrates.fluxes)
    ledger = Ledger(previous.time, previous.time + duration, *flows[:4], previous.mass,
                    after.mass - previous.mass, new.mass, flows.unmet)
    complete = replace(half, generated=half.generated + generated, end=expansion)
    inner = partial(interpolate, stages, previous, solved, complete)
    step = StepResult(new, None, ledger, remeshed, expansion.iterations, inner,
                      generated=generated + meshes)
    return Attempt(step, change, expansion.gaps if makes_contact else None)


def _with_line_speeds(new: Pore, previous: Pore, half: Halfway, end: Expansion) -> Pore:
    """The pore with the speeds of contact lines in both halves of a step.

    They are unknown after a first contact.
    """
    first = half.expansion.advances
    second = {key: max(length - first.get(key, 0.0), 0.0) for key, length in end.advances.items()}
    bodies = []
    for number, (before, after) in enumerate(zip(previous.bodies, new.bodies)):
        makes_contact = after.spans and not before.spans
        speeds = contact_lines.speeds((first, second), number, half.duration / 2)
        bodies.append(replace(after, line_speeds=None if makes_contact else speeds))
    return replace(new, bodies=tuple(bodies))


def _expand(stages: Stages, previous: Pore, after: Pore, half: Halfway, part: float,
            search: SearchOptions) -> Expansion:
    """Equilibrium of the aggregates at a fraction ``part`` of the step.

    The search starts from the shapes known so far. Contact lines start at interpolated positions
    and have small triangles there. For the end of the step, lines are assumed to slow down after
    the first half as in the last step.
    """
    shapes = _known_shapes(half, part)
    advances = {key: sum(weight * shape.advances.get(key, 0.0) for weight, shape in shapes)
                for key in half.expansion.advances}
    if half.end is None:
        advances |= _slower_advances(previous, half)
    search = replace(search, advances=advances,
                     line_size=stages.remeshing.meshing.sizes.moving_lines)
    return stages.expand(previous, after, _guess_shape(previous, shapes), search)


def _slower_advances(previous: Pore, half: Halfway) -> dict[tuple[int, int, int], float]:
    """Advances (um) at the end of a step of the lines that are expected to slow down.

    Lines slow down after the first half as in the last step. After a first contact, the length of
    contact grows like the square root of time, as for a round body.
    """
    first, second = (_last_advances(previous, number, half.duration / 2) for number in (0, 1))
    advances = {}
    for key, length in half.expansion.advances.items():
        number, wall, _ = key
        own = previous.focused(number)
        if key not in first and wall != own.boundary.seat.wall:
            before = own.boundary.contact_length(numbered(own.walls, wall)) / 2
            advances[key] = math.sqrt(2 * (before + length)**2 - before**2) - before
        elif second.get(key, 0.0) < first.get(key, 0.0):
            advances[key] = length * (1 + second[key] / first[key])
    return advances


def _last_advances(previous: Pore, half: int,
                   duration: float) -> dict[tuple[int, int, int], float]:
    """Advances (um) of the lines in a duration (h) at their speeds in a half (0 or 1) of the last
    step. Lines of unknown speeds are left out."""
    advances: dict[tuple[int, int, int], float] = {}
    for number, body in enumerate(previous.bodies):
        if body.line_speeds is not None:
            advances |= contact_lines.advances_at(body.line_speeds[half], number, duration)
    return advances


def solve_halfway(stages: Stages, previous: Pore, solved: Solved, first: Rates, duration: float,
                  search: SearchOptions) -> Halfway:
    """Solve in the shape half way through a step of ``duration`` (h).

    The rates at the start give this shape. Welds and their contact lines end at corners here,
    because this shape gives only the rates of the step. If the moved mesh is not acceptable, a new
    mesh replaces it. The masses are then carried to the points of the new mesh, and the rates back
    to the points of the mesh at the start.
    """
    ahead = replace(grow(previous, first, duration / 2), time=previous.time + duration / 2)
    search = replace(search, advances=_last_advances(previous, 1, duration / 2), within_arcs=False)
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
    """Advance the pore to a time (h) within a step with interpolated rates, and solve there.

    If the moved mesh is not acceptable, one of the meshes that the step has generated replaces it.
    """
    part = (time - previous.time) / half.duration
    mean = Rates((1 - part) * half.first.growth + part * half.rates.growth,
                 (1 - part) * half.first.remains + part * half.rates.remains)
    after = replace(grow(previous, mean, part * half.duration), time=time)
    expanded = _expand(stages, previous, after, half, part, PATIENT).pore
    expanded = replace(expanded, concentrations=_guess_substrates(solved, half, part))
    inner, _ = stages.new_mesh(previous, expanded, solved, half.generated)
    return InterpolatedState(*stages.grading.solve(inner))


def _carry_rates_back(middle: Pore, previous: Pore, half: Expansion, rates: Rates) -> Rates:
    """Interpolate rates from the points of a new mesh back to the points of the previous mesh."""
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
    """Correct the growth of each aggregate to ``produced``, to the last bit.

    The interpolation of the rates causes the difference. The correction is distributed in
    proportion to the active biomass.
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
    """Initial guess of the substrates at a fraction ``part`` of the step.

    Concentrations are extrapolated from the start and half way. The guess is the solution half way
    if the extrapolation is negative anywhere, and the solution at the start if the mesh has changed
    half way.
    """
    first = start.substrates.concentrations
    second = half.solved.substrates.concentrations
    if second.fields.shape != first.fields.shape:
        return first
    fields = first.fields + 2 * part * (second.fields - first.fields)
    if fields.min() < 0:
        return second
    return first.with_fields(fields)


def _scale_shape(previous: Pore, after: Pore) -> Pore:
    """Initial guess of the shape.

    An aggregate on one wall is scaled by the square root of the ratio of its masses.
    """
    points = previous.mesh.points.copy()
    for before, grown, region, outline in zip(previous.bodies, after.bodies, previous.mesh.regions,
                                              previous.outlines):
        if before.spans:
            continue
        fixed = outline.points[outline.fixed][:1]
        scale = np.sqrt(grown.mass / before.mass)
        points[region.nodes] = fixed + (points[region.nodes] - fixed) * scale
    return _place_bodies(after, points) or after


def _known_shapes(half: Halfway, part: float) -> list[tuple[float, Expansion]]:
    """Known shapes of a step, without the start, and their weights at a fraction of the step.

    If the shape at the end is known, the weights interpolate between start, half way and end.
    Otherwise they extrapolate from the first half.
    """
    if half.end is None:
        return [(2 * part, half.expansion)]
    return [(4 * part * (1 - part), half.expansion), (part * (2 * part - 1), half.end)]


def _guess_shape(previous: Pore, shapes: list[tuple[float, Expansion]]) -> Pore:
    """Initial guess of the shape from the result of :func:`_known_shapes`.

    If this turns a triangle over, the guess is the shape half way, or the one at the start.
    """
    corners = previous.mesh.corners
    for candidates in (shapes, [(1.0, shapes[0][1])]):
        push = previous.pressure
        points = previous.mesh.points
        for weight, shape in candidates:
            push = push + weight * (shape.pore.pressure[:corners] - previous.pressure)
            points = points + weight * (shape.position - previous.mesh.points)
        guess = _place_bodies(replace(previous, pressure=push), points)
        if guess:
            return guess
    return previous


def _place_bodies(after: Pore, points: np.ndarray) -> Pore | None:
    """Move the aggregates' nodes to ``points`` (N, 2) um; None if this turns a triangle over."""
    moved = after.moved(after.mesh.from_body(points[after.mesh.body], after.mesh.points))
    biomass_cells = np.flatnonzero(moved.mesh.biomass)
    return None if moved.mesh.turned_over(biomass_cells).any() else moved
