"""The sequential coupling (section 2): flow, substrates, biomass, shape, moved mesh, every 12 min.

One step: (9)-(10) are integrated over the step in the present geometry, theta grows by (28)-(29),
the aggregate finds its new equilibrium, films that have become too thin close (2.3.3), the mesh
moves (35) or, by the paper's criteria (3.1, 3.5), is made anew.
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
    Ledger,
    Moment,
    PoreEnd,
    Scheme,
    Step,
    laid_out,
    pore_end,
)
from repro.march.pace import Pace
from repro.model import biomass, contact, gear, kinetics, pore, remeshing, transport
from repro.model.biomass import Rates
from repro.model.gear import Flows
from repro.model.kinetics import Sink
from repro.model.pore import Pore, Solved
from repro.model.transport import Concentrations, Fluxes
from repro.scene import Scene, needed

#: An update this close to a multiple of growth.time_step, in parts of it, is that multiple.
ON_GRID = 1e-3


def schedule(scene: Scene) -> tuple[list[float], set[float]]:
    """Times (h) at which steps end, and those that are reported; t = 0 first. The last step is cut
    at growth.end; those reported between steps cut none."""
    if scene.growth is None:
        return [0.0], {0.0}
    end = scene.growth.end
    ends = [0.0]
    while end - ends[-1] > SAME_TIME:
        ends.append(next_time(scene, ends[-1]))
    return ends, {0.0, *(scene.output.times or ends)}


def next_time(scene: Scene, time: float) -> float:
    """The time (h) at which a step ends: the next multiple of growth.time_step, rounded, or of a
    table's times, where that comes first or is the same time; or growth.end, where that comes first
    or is as good as there."""
    growth = needed(scene.growth, "[growth]")
    count = math.floor(time / growth.time_step + ON_GRID) + 1
    update = round(count * growth.time_step, 9)
    corner = scene.corner(time)
    if corner - update < SAME_TIME:
        update = corner
    if update < growth.end - max(SAME_TIME, SAME_TIME * growth.time_step):
        return update
    return growth.end


def _advance(scene: Scene, now: Pore, solved: Solved, pace: Pace) -> tuple[Step, Solved, Pace]:
    """The step to the next update, or to growth.end."""
    time = next_time(scene, now.time)
    done = step(scene, now, solved, time - now.time)
    after = laid_out(replace(done.pore, time=time))
    within = partial(_within, scene, now, solved)
    return replace(done, pore=after, within=within), _solved(scene, after), pace


def _solved(scene: Scene, after: Pore) -> Solved:
    """Flow and substrates. Raises Unresolved, with a refinement that was tried, where the mesh is
    too coarse."""
    try:
        return pore.solve(scene, after)
    except Unresolved as error:
        raise remeshing.advised(scene, after, error) from None


def _within(scene: Scene, now: Pore, solved: Solved, time: float) -> Moment:
    """A time (h) within a step, by a shorter step that nothing goes on from."""
    done = step(scene, now, solved, time - now.time)
    after = replace(done.pore, time=time)
    return Moment(after, _solved(scene, after), done.before)


def step(scene: Scene, now: Pore, solved: Solved, duration: float) -> Step:
    """One step (h): biomass, shape, mesh."""
    solved = _midway(scene, now, solved, duration)
    grown, end, flows = make_biomass(scene, now, solved, duration)
    grown = replace(grown, time=before(now, duration))
    expansion = contact.expand(scene, grown, enlarged(scene, now, grown))
    expanded = expansion.pore
    if leaves := pore_end(scene, expanded, 0.1):
        raise PoreEnd(f"{leaves} in the step from t = {now.time:g} h")
    refuse_fold(now, expanded)
    speed = solved.flow.mean_velocity if solved.flow else 0.0
    after, remeshed = remeshing.new_mesh(scene, now, replace(expanded, concentrations=end), speed)
    ledger = Ledger(now.time, now.time + duration, *flows, now.mass, grown.mass - now.mass,
                    after.mass)
    last = replace(grown, time=now.time + duration), replace(solved, concentrations=end)
    return Step(after, last, ledger, remeshed, expansion.iterations)


def before(now: Pore, duration: float) -> float:
    """The time (h) just before the end of a step, so that a jump there is not yet made."""
    return max(now.time, now.time + duration - SAME_TIME)


def _midway(scene: Scene, now: Pore, solved: Solved, duration: float) -> Solved:
    """What is solved at the start of a step, with the supplies and the drive half way, their mean
    over it, where a table changes them in it."""
    middle = now.time + duration / 2
    if scene.at(middle) == scene.at(now.time):
        return solved
    there = pore.solve(scene, replace(now, time=middle))
    if scene.numerics.transport == "gear":
        return replace(there, concentrations=solved.concentrations)
    return there


def make_biomass(scene: Scene, now: Pore, solved: Solved,
                 duration: float) -> tuple[Pore, Concentrations, Flows]:
    """(9)-(10) over a step (h) in a fixed geometry: the grown pore, concentrations and flows.

    Quasi-steady: Heun's method on the rates, each biomass exponential in its rate; the second rates
    are those of the steady concentrations over the grown biomass. Gear: the transient of the paper.
    """
    problem = needed(solved.problem, "[substrates]")
    start = needed(solved.concentrations, "[substrates]")
    if scene.numerics.transport == "gear":
        done = gear.advance(problem, now.active, now.inert, start, duration)
        return replace(now, active=done.active, inert=done.inert), done.concentrations, done.flows
    first = rates_of(scene, now, start)
    guess = grown(now, first, duration)
    try:
        end = transport.steady(problem, Sink(guess.active), start)
    except Unresolved as error:
        ahead = replace(guess, time=before(now, duration))
        raise remeshing.advised(scene, ahead, error) from None
    second = rates_of(scene, now, end)
    mean = Rates((first.growth + second.growth) / 2, (first.remains + second.remains) / 2)
    at_start = transport.fluxes(problem, Sink(now.active), start)
    at_end = transport.fluxes(problem, Sink(guess.active), end)
    return grown(now, mean, duration), end, _mean_flows(at_start, at_end, duration)


def _mean_flows(before: Sequence[Fluxes], after: Sequence[Fluxes], duration: float) -> Flows:
    """The trapezoidal rule over a step (h), from the fluxes of acceptor and donor at its ends."""
    acceptor, donor = (
        (duration * (a.supplied + b.supplied) / 2, duration * (a.out + b.out) / 2,
         duration * (a.consumed + b.consumed) / 2) for a, b in zip(before, after))
    supplied, out, consumed = zip(acceptor, donor)
    return Flows(supplied, out, consumed, stored=(0.0, 0.0))


def rates_of(scene: Scene, now: Pore, state: Concentrations | None) -> Rates:
    """F3 / X_A and F4 / X_A, 1/h, at the points of the reaction."""
    law = kinetics.rate_law(needed(scene.substrates, "[substrates]"),
                            needed(scene.kinetics, "[kinetics]"))
    return biomass.rates(now.space, needed(state, "[substrates]"), law)


def grown(now: Pore, rates: Rates, duration: float) -> Pore:
    """(9)-(10) over a step (h) at constant rates."""
    active, inert = kinetics.grow(now.active, now.inert, rates.growth, rates.remains, duration)
    return replace(now, active=active, inert=inert)


def enlarged(scene: Scene, now: Pore, after: Pore) -> np.ndarray:
    """(t, q) theta after the biomass has grown: on straight triangles (28)-(29), by the increase of
    X_A + X_I over X_m; on curved ones as the mass in each point."""
    before = now.active + now.inert
    total = after.active + after.inert
    if now.space.order > 1:
        return now.theta * (total / before)
    density = needed(scene.kinetics, "[kinetics]").maximum_density
    more = (total - before) / now.space.reaction.dx / density
    return now.theta * (1 + remeshing.spread(now.space, more))

#: The paper's scheme.
SCHEME = Scheme(_advance, ends=lambda scene: schedule(scene)[0])
