"""The sequential coupling (section 2): flow -> substrates -> biomass -> shape -> moved mesh, once every 12 min.

One step: (9)-(10) are integrated over the step in the present geometry, theta grows by (28)-(29), the aggregate finds
its new equilibrium, films that have become too thin close (2.3.3), the biomass is reprojected (34), the mesh moves (35)
or, by the paper's criteria (3.1, 3.5), is made anew.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from repro.march import loop
from repro.march.loop import SAME_TIME, Instant, Ledger, PoreEnd, Scheme, State, Step, laid_out, pore_end
from repro.march.pace import Pace
from repro.model import gear, kinetics, pore, remeshing, shape, transport
from repro.model.pore import Pore, Solved
from repro.model.transport import Concentrations

__all__ = ["Attempt", "Instant", "Ledger", "PoreEnd", "Step", "increase", "mass_of", "pore_end", "rates_of", "simulate"]


@dataclass(frozen=True, eq=False)
class Attempt:
    """A step of the midpoint rule that may be taken: what it makes, None where the rates change more than is allowed;
    their mean change over its first half, 1/h; and, where it first makes contact with the opposite wall, the least
    distance (um) to that before and after the step, and the film's least thickness."""

    step: Step | None
    change: float
    gaps: tuple[float, float, float] | None


def schedule(scene) -> tuple[list[float], set[float]]:
    """Times (h) at which steps end, and those of them that are reported; t = 0 first."""
    if scene.growth is None:
        return [0.0], {0.0}
    end, step, wanted = scene.growth.end, scene.growth.time_step, scene.output.times
    grid = [round(k * step, 9) for k in range(int(np.ceil(round(end / step, 9))))]
    reported = {0.0, *(wanted or (*grid, end))}
    between = [time for time in grid if min(abs(time - other) for other in (*reported, end)) > SAME_TIME]
    return sorted({*between, *reported, end}), reported


def steps(scene, state: State | None = None) -> Iterator[tuple[State, Instant | None]]:
    """:func:`repro.march.loop.steps` of the paper's scheme."""
    return loop.steps(scene, Scheme(pore.seeded, pore.solve, lambda scene: schedule(scene)[0], _advance), state)


def simulate(scene) -> Iterator[Instant]:
    """Run a scene; yields an Instant at t = 0 and at each reported time.

    Raises SimulationError where a stage fails; ends early, after a last Instant, by raising PoreEnd where the aggregate
    reaches an end of the pore.
    """
    return (instant for _, instant in steps(scene) if instant)


def _advance(scene, now: Pore, solved: Solved, time: float, pace: Pace) -> tuple[Step, Solved, Pace]:
    """One step to the time ``time`` (h)."""
    done = step(scene, now, solved, time - now.time)
    after = laid_out(replace(done.pore, time=time))
    return replace(done, pore=after), pore.solve(scene, after), pace


def step(scene, now: Pore, solved: Solved, duration: float) -> Step:
    """One step (h): biomass, shape, mesh."""
    grown, end, flows = make_biomass(scene, now, solved, duration)
    made = float(np.sum(solved.problem.body * (grown.active + grown.inert - now.active - now.inert)))
    theta = now.theta * (1 + increase(now, grown) / scene.kinetics.maximum_density)
    expanded, iterations, _ = shape.expand(scene, grown, theta)
    if leaves := pore_end(scene, expanded, 0.1):
        raise PoreEnd(f"{leaves} in the step from t = {now.time:g} h")
    solved = replace(solved, concentrations=end)
    after, remeshed = remeshing.new_mesh(scene, now, expanded, solved)
    supplied, out, consumed, stored = flows
    ledger = Ledger(now.time, now.time + duration, supplied, out, consumed, stored, mass_of(now), made, mass_of(after))
    return Step(after, (replace(grown, time=now.time + duration), solved), ledger, remeshed, iterations)


def mass_of(now: Pore) -> float:
    return float(np.sum(now.mesh.lumped(now.mesh.biomass) * (now.active + now.inert)))


def make_biomass(scene, now: Pore, solved: Solved, duration: float):
    """(9)-(10) over a step (h) in a fixed geometry: the grown pore, concentrations at its end, substrate flows.

    Quasi-steady: Heun's method on the rates, each biomass exponential in its rate; the second rates are those of the
    steady concentrations over the grown biomass. Gear: the transient of the paper.
    """
    if scene.numerics.transport == "gear":
        return gear.make_biomass(scene, now, solved, duration)
    first = rates_of(scene, solved.concentrations)
    guess = kinetics.grow(now.active, now.inert, first[0], first[1], duration)
    end = transport.steady(solved.problem, guess[0], solved.concentrations)
    mean = [(a + b) / 2 for a, b in zip(first, rates_of(scene, end))]
    active, inert = kinetics.grow(now.active, now.inert, mean[0], mean[1], duration)
    pairs = zip(transport.fluxes(solved.problem, now.active, solved.concentrations),
                transport.fluxes(solved.problem, guess[0], end))
    means = [[duration * (getattr(a, key) + getattr(b, key)) / 2 for key in ("supplied", "out", "consumed")]
             for a, b in pairs]
    flows = (*(tuple(row) for row in zip(*means)), (0.0, 0.0))
    return replace(now, active=active, inert=inert), end, flows


def rates_of(scene, state: Concentrations):
    """F3 / X_A and F4 / X_A (N,), 1/h."""
    return (kinetics.growth_rate(state.acceptor, state.donor, scene.substrates, scene.kinetics),
            kinetics.inert_rate(state.acceptor, scene.substrates, scene.kinetics))


def increase(now: Pore, grown: Pore) -> np.ndarray:
    """(29): mean over the nodes of each biomass triangle of the increase of X_A + X_I (mg/L)."""
    more = grown.active + grown.inert - now.active - now.inert
    return more[now.mesh.triangles[now.mesh.biomass]].mean(axis=1)
