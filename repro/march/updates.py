"""The sequential coupling (section 2): flow, substrates, biomass, shape, moved mesh, every 12 min.

One step integrates (9)-(10) in the present geometry, increases theta by (28)-(29), solves for the
new equilibrium of the aggregate, closes films that are too thin (2.3.3), and moves the mesh (35) or
replaces it by the paper's criteria (3.1, 3.5).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from repro.errors import Unresolved
from repro.march.folding import refuse_fold
from repro.march.loop import (
    SAME_TIME,
    InterpolatedState,
    Ledger,
    PoreEnd,
    Scheme,
    StepResult,
    contiguous,
    pore_end,
)
from repro.march.step_control import StepControl
from repro.model import biomass, contact, gear, kinetics, pore, remeshing, transport
from repro.model.biomass import Rates
from repro.model.gear import Flows
from repro.model.kinetics import Sink
from repro.model.pore import Pore, Solved
from repro.model.transport import Concentrations, Fluxes
from repro.scene import Scene, needed

#: A time this close to a multiple of growth.time_step, relative to it, is that multiple.
ON_GRID = 1e-3


def schedule(scene: Scene) -> tuple[list[float], set[float]]:
    """Times (h) at which steps end, and times that are reported; t = 0 first.

    growth.end cuts the last step. A reported time between two steps cuts no step.
    """
    if scene.growth is None:
        return [0.0], {0.0}
    end = scene.growth.end
    ends = [0.0]
    while end - ends[-1] > SAME_TIME:
        ends.append(next_time(scene, ends[-1]))
    return ends, {0.0, *(scene.output.times or ends)}


def next_time(scene: Scene, time: float) -> float:
    """Time (h) at which the step after ``time`` ends.

    It is the earliest of the next multiple of growth.time_step, the next time of the scene's
    tables, and growth.end. Within SAME_TIME, a table's time replaces the multiple, and growth.end
    replaces both.
    """
    growth = needed(scene.growth, "[growth]")
    count = math.floor(time / growth.time_step + ON_GRID) + 1
    update = round(count * growth.time_step, 9)
    corner = scene.corner(time)
    if corner - update < SAME_TIME:
        update = corner
    if update < growth.end - max(SAME_TIME, SAME_TIME * growth.time_step):
        return update
    return growth.end


def _advance(scene: Scene, previous: Pore, solved: Solved,
             control: StepControl) -> tuple[StepResult, Solved, StepControl]:
    """Make the step to the next update, or to growth.end."""
    time = next_time(scene, previous.time)
    advanced = step(scene, previous, solved, time - previous.time)
    after = contiguous(replace(advanced.pore, time=time))
    within = partial(_interpolate, scene, previous, solved)
    return replace(advanced, pore=after, within=within), _solve_after(scene, after), control


def _solve_after(scene: Scene, after: Pore) -> Solved:
    """Solve for flow and substrates.

    Raises Unresolved, with a refinement that resolves them, if the mesh is too coarse.
    """
    try:
        return pore.solve(scene, after)
    except Unresolved as error:
        raise remeshing.advise(scene, after, error) from None


def _interpolate(scene: Scene, previous: Pore, solved: Solved, time: float) -> InterpolatedState:
    """Interpolate to a time (h) within a step, by a shorter step from its start."""
    shorter = step(scene, previous, solved, time - previous.time)
    after = replace(shorter.pore, time=time)
    return InterpolatedState(after, _solve_after(scene, after), shorter.before)


def step(scene: Scene, previous: Pore, solved: Solved, duration: float) -> StepResult:
    """Make one step of ``duration`` (h): biomass, shape, mesh."""
    solved = _solve_midway(scene, previous, solved, duration)
    grown, end, flows = make_biomass(scene, previous, solved, duration)
    grown = replace(grown, time=time_before_end(previous, duration))
    expansion = contact.expand(scene, grown, compute_theta(scene, previous, grown))
    expanded = expansion.pore
    if leaves := pore_end(scene, expanded, 0.1):
        raise PoreEnd(f"{leaves} in the step from t = {previous.time:g} h")
    refuse_fold(previous, expanded)
    speed = solved.flow.mean_velocity if solved.flow else 0.0
    expanded = replace(expanded, concentrations=end)
    after, remeshed = remeshing.new_mesh(scene, previous, expanded, speed)
    ledger = Ledger(previous.time, previous.time + duration, *flows, previous.mass,
                    grown.mass - previous.mass, after.mass)
    last = replace(grown, time=previous.time + duration), replace(solved, concentrations=end)
    return StepResult(after, last, ledger, remeshed, expansion.iterations)


def time_before_end(previous: Pore, duration: float) -> float:
    """Time (h) just before the end of a step, before a jump of the scene's tables there."""
    return max(previous.time, previous.time + duration - SAME_TIME)


def _solve_midway(scene: Scene, previous: Pore, solved: Solved, duration: float) -> Solved:
    """Solution at the start of a step, with the supplies and the drive of its middle.

    If no table of the scene changes in the step, this is ``solved``.
    """
    middle = previous.time + duration / 2
    if scene.at(middle) == scene.at(previous.time):
        return solved
    halfway = pore.solve(scene, replace(previous, time=middle))
    if scene.numerics.transport == "gear":
        return replace(halfway, concentrations=solved.concentrations)
    return halfway


def make_biomass(scene: Scene, previous: Pore, solved: Solved,
                 duration: float) -> tuple[Pore, Concentrations, Flows]:
    """Integrate (9)-(10) over a step (h) in a fixed geometry: grown pore, concentrations, flows.

    Quasi-steady transport uses Heun's method on the rates, and each biomass grows exponentially at
    its rate. The second rates are those of the steady concentrations over the grown biomass. Gear's
    method is the paper's transient.
    """
    problem = needed(solved.problem, "[substrates]")
    start = needed(solved.concentrations, "[substrates]")
    if scene.numerics.transport == "gear":
        transient = gear.advance(problem, previous.active, previous.inert, start, duration)
        after = replace(previous, active=transient.active, inert=transient.inert)
        return after, transient.concentrations, transient.flows
    first = compute_rates(scene, previous, start)
    guess = grown(previous, first, duration)
    try:
        end = transport.steady(problem, Sink(guess.active), start)
    except Unresolved as error:
        ahead = replace(guess, time=time_before_end(previous, duration))
        raise remeshing.advise(scene, ahead, error) from None
    second = compute_rates(scene, previous, end)
    mean = Rates((first.growth + second.growth) / 2, (first.remains + second.remains) / 2)
    at_start = transport.fluxes(problem, Sink(previous.active), start)
    at_end = transport.fluxes(problem, Sink(guess.active), end)
    return grown(previous, mean, duration), end, _mean_flows(at_start, at_end, duration)


def _mean_flows(before: Sequence[Fluxes], after: Sequence[Fluxes], duration: float) -> Flows:
    """Integrate the fluxes of acceptor and donor over a step (h) by the trapezoidal rule."""
    acceptor, donor = (
        (duration * (a.supplied + b.supplied) / 2, duration * (a.out + b.out) / 2,
         duration * (a.consumed + b.consumed) / 2) for a, b in zip(before, after))
    supplied, out, consumed = zip(acceptor, donor)
    return Flows(supplied, out, consumed, stored=(0.0, 0.0))


def compute_rates(scene: Scene, previous: Pore, state: Concentrations | None) -> Rates:
    """F3 / X_A and F4 / X_A, 1/h, at the points of the reaction."""
    law = kinetics.rate_law(needed(scene.substrates, "[substrates]"),
                            needed(scene.kinetics, "[kinetics]"))
    return biomass.rates(previous.space, needed(state, "[substrates]"), law)


def grown(previous: Pore, rates: Rates, duration: float) -> Pore:
    """Integrate (9)-(10) over a step (h) at constant rates."""
    active, inert = kinetics.grow(previous.active, previous.inert, rates.growth, rates.remains,
                                  duration)
    return replace(previous, active=active, inert=inert)


def compute_theta(scene: Scene, previous: Pore, after: Pore) -> np.ndarray:
    """(t, q) theta after growth: (28)-(29), from the increase of X_A + X_I over X_m.

    On curved triangles theta grows with the mass at each point.
    """
    before = previous.active + previous.inert
    total = after.active + after.inert
    if previous.space.order > 1:
        return previous.theta * (total / before)
    density = needed(scene.kinetics, "[kinetics]").maximum_density
    more = (total - before) / previous.space.reaction.dx / density
    return previous.theta * (1 + remeshing.at_growth_points(previous.space, more))

#: The paper's scheme.
SCHEME = Scheme(_advance, ends=lambda scene: schedule(scene)[0])
