"""The sequential coupling (section 2): flow, substrates, biomass, shape, moved mesh, every 12 min.

One step: (9)-(10) are integrated over the step in the present geometry, theta grows by (28)-(29),
the aggregate finds its new equilibrium, films that have become too thin close (2.3.3), the mesh
moves (35) or, by the paper's criteria (3.1, 3.5), is made anew.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from repro.march import loop
from repro.march.loop import SAME_TIME, Instant, Ledger, PoreEnd, Scheme, State, Step, laid_out, pore_end
from repro.march.pace import Pace
from repro.model import biomass, contact, gear, kinetics, pore, remeshing, transport
from repro.model.biomass import Rates
from repro.model.kinetics import Sink
from repro.model.pore import Pore, Solved
from repro.model.transport import Concentrations
from repro.scene import Scene

#: Of a step, of acceptor and donor: supplied, out, consumed and stored, um2 mg/L.
Flows = tuple[tuple[float, float], ...]


def schedule(scene: Scene) -> tuple[list[float], set[float]]:
    """Times (h) at which steps end, and those of them that are reported; t = 0 first."""
    if scene.growth is None:
        return [0.0], {0.0}
    end, step, wanted = scene.growth.end, scene.growth.time_step, scene.output.times
    grid = [round(k * step, 9) for k in range(int(np.ceil(round(end / step, 9))))]
    reported = {0.0, *(wanted or (*grid, end))}
    between = [time for time in grid if min(abs(time - other) for other in (*reported, end)) > SAME_TIME]
    return sorted({*between, *reported, end}), reported


def steps(scene: Scene, state: State | None = None) -> Iterator[tuple[State, Instant | None]]:
    """:func:`repro.march.loop.steps` of the paper's scheme."""
    return loop.steps(scene, Scheme(lambda scene: schedule(scene)[0], _advance), state)


def _advance(scene: Scene, now: Pore, solved: Solved, time: float, pace: Pace) -> tuple[Step, Solved, Pace]:
    """One step to the time ``time`` (h)."""
    done = step(scene, now, solved, time - now.time)
    after = laid_out(replace(done.pore, time=time))
    return replace(done, pore=after), pore.solve(scene, after), pace


def step(scene: Scene, now: Pore, solved: Solved, duration: float) -> Step:
    """One step (h): biomass, shape, mesh."""
    grown, end, flows = make_biomass(scene, now, solved, duration)
    expanded, iterations, _ = contact.expand(scene, grown, enlarged(scene, now, grown))
    if leaves := pore_end(scene, expanded, 0.1):
        raise PoreEnd(f"{leaves} in the step from t = {now.time:g} h")
    speed = solved.flow.mean_velocity if solved.flow else 0.0
    after, remeshed = remeshing.new_mesh(scene, now, replace(expanded, concentrations=end), speed)
    ledger = Ledger(now.time, now.time + duration, *flows, now.mass, grown.mass - now.mass, after.mass)
    before = replace(grown, time=now.time + duration), replace(solved, concentrations=end)
    return Step(after, before, ledger, remeshed, iterations)


def make_biomass(scene: Scene, now: Pore, solved: Solved, duration: float) -> tuple[Pore, Concentrations, Flows]:
    """(9)-(10) over a step (h) in a fixed geometry: the grown pore, concentrations and flows.

    Quasi-steady: Heun's method on the rates, each biomass exponential in its rate; the second rates
    are those of the steady concentrations over the grown biomass. Gear: the transient of the paper.
    """
    if scene.numerics.transport == "gear":
        done = gear.advance(solved.problem, now.active, now.inert, solved.concentrations, duration)
        return replace(now, active=done.active, inert=done.inert), done.concentrations, done.flows
    first = rates_of(scene, now, solved.concentrations)
    guess = grown(now, first, duration)
    end = transport.steady(solved.problem, Sink(guess.active), solved.concentrations)
    second = rates_of(scene, now, end)
    mean = Rates((first.growth + second.growth) / 2, (first.remains + second.remains) / 2)
    ends = (transport.fluxes(solved.problem, Sink(now.active), solved.concentrations),
            transport.fluxes(solved.problem, Sink(guess.active), end))
    flows = [tuple(duration * (getattr(a, key) + getattr(b, key)) / 2 for a, b in zip(*ends))
             for key in ("supplied", "out", "consumed")]
    return grown(now, mean, duration), end, (*flows, (0.0, 0.0))


def rates_of(scene: Scene, now: Pore, state: Concentrations) -> Rates:
    """F3 / X_A and F4 / X_A, 1/h, at the points of the reaction."""
    return biomass.rates(now.space, state, scene.substrates, scene.kinetics)


def grown(now: Pore, rates: Rates, duration: float) -> Pore:
    """(9)-(10) over a step (h) at constant rates."""
    active, inert = kinetics.grow(now.active, now.inert, rates.growth, rates.remains, duration)
    return replace(now, active=active, inert=inert)


def enlarged(scene: Scene, now: Pore, after: Pore) -> np.ndarray:
    """(t, q) theta after the biomass has grown: on straight triangles (28)-(29), by the increase of
    X_A + X_I over X_m; on curved ones as the mass in each point."""
    before, total = now.active + now.inert, after.active + after.inert
    if now.space.order > 1:
        return now.theta * (total / before)
    more = (total - before) / now.space.reaction.dx / scene.kinetics.maximum_density
    return now.theta * (1 + remeshing.spread(now.space, more))
