"""The sequential coupling (section 2): flow -> substrates -> biomass -> shape -> moved mesh, once every 12 min.

One step: (9)-(10) are integrated over the step in the present geometry, theta grows by (28)-(29), the aggregate finds
its new equilibrium, films that have become too thin close (2.3.3), the biomass is reprojected (34), the mesh moves (35)
or, by the paper's criteria (3.1, 3.5), is made anew.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace

import numpy as np

from repro import gear, geometry, kinetics, pore, remeshing, shape, transport
from repro.errors import SimulationError, StageError
from repro.pore import Pore, Solved
from repro.transport import Concentrations

#: A step of the grid this close (h) to a reported time is that time.
SAME_TIME = 1e-9


@dataclass(frozen=True)
class Ledger:
    """Mass balance of one step, per depth (um2 mg/L = 1e-12 g/m): both substrates, then the biomass."""

    start: float
    end: float
    supplied: tuple[float, float]
    out: tuple[float, float]
    consumed: tuple[float, float]
    stored: tuple[float, float]
    biomass_before: float
    biomass_made: float
    biomass_after: float


@dataclass(frozen=True, eq=False)
class Instant:
    """The pore at ``pore.time`` with what is solved in its geometry, and how it came there.

    before: the pore and its solution at the end of the last step, grown but not yet expanded (Plate 1), None at t = 0;
    ledgers, remeshes, iterations: of the steps since the last instant.
    """

    pore: Pore
    solved: Solved
    before: tuple[Pore, Solved] | None
    ledgers: tuple[Ledger, ...]
    remeshes: int
    iterations: dict[str, int]


class PoreEnd(Exception):
    """The aggregate has reached an end of the pore: the run is over."""


def schedule(scene) -> tuple[list[float], set[float]]:
    """Times (h) at which steps end, and those of them that are reported; t = 0 first."""
    if scene.growth is None:
        return [0.0], {0.0}
    end, step, wanted = scene.growth.end, scene.growth.time_step, scene.output.times
    grid = [round(k * step, 9) for k in range(int(np.ceil(round(end / step, 9))))]
    reported = {0.0, *(wanted or (*grid, end))}
    between = [time for time in grid if min(abs(time - other) for other in (*reported, end)) > SAME_TIME]
    return sorted({*between, *reported, end}), reported


def simulate(scene) -> Iterator[Instant]:
    """Run a scene; yields an Instant at t = 0 and at each reported time.

    Raises SimulationError where a stage fails; ends early, after a last Instant, by raising PoreEnd where the aggregate
    reaches an end of the pore.
    """
    times, reported = schedule(scene)
    with stopping(0.0):
        now = pore.seeded(scene)
        solved = pore.solve(scene, now)
    now = replace(now, concentrations=solved.concentrations)
    yield Instant(now, solved, None, (), 0, newton_counts(solved))
    before, ledgers, remeshes, counts = None, [], 0, {}
    for time in times[1:]:
        try:
            with stopping(now.time):
                done = step(scene, now, solved, time - now.time)
                now, before = replace(done.pore, time=time), done.before
                solved = pore.solve(scene, now)
        except PoreEnd:
            if ledgers:  # steps that are not reported yet
                yield Instant(now, solved, before, tuple(ledgers), remeshes, counts)
            raise
        now = replace(now, concentrations=solved.concentrations)
        ledgers.append(done.ledger)
        remeshes += done.remeshed
        counts = added(counts, {"growth": done.iterations}, newton_counts(before[1]), newton_counts(solved))
        over = pore_end(scene, now, 1.0)
        if time in reported or over:
            yield Instant(now, solved, before, tuple(ledgers), remeshes, counts)
            ledgers, remeshes, counts = [], 0, {}
        if over:
            raise PoreEnd(f"{over} at t = {now.time:g} h")


@contextmanager
def stopping(time: float):
    """Floating-point errors stop the run; a stage's failure is told with the simulated time of its step."""
    try:
        with np.errstate(all="raise", under="ignore"):
            yield
    except StageError as error:
        raise SimulationError(f"stopped in the step from t = {time:g} h, in {error.stage}: {error}") from error
    except FloatingPointError as error:
        raise SimulationError(f"stopped in the step from t = {time:g} h by a floating-point error ({error}); "
                              "try a shorter growth.time_step or a larger numerics.refinement") from error


def newton_counts(solved: Solved) -> dict[str, int]:
    return {"transport": solved.concentrations.iterations if solved.concentrations else 0}


def added(*counts: dict[str, int]) -> dict[str, int]:
    keys = {key for count in counts for key in count}
    return {key: sum(count.get(key, 0) for count in counts) for key in sorted(keys)}


def pore_end(scene, now: Pore, elements: float) -> str:
    """Which end of the pore the aggregate has reached, to so many elements of the fluid; empty while it has not."""
    outline, end = now.outline, scene.pore.length / 2
    near = elements * scene.pore.width / geometry.ACROSS_PORE
    if outline.upstream < near - end or outline.downstream > end - near:
        side = "upstream" if outline.upstream < near - end else "downstream"
        return f"the aggregate reaches the pore's {side} end"
    return ""


@dataclass(frozen=True, eq=False)
class Step:
    """What one step made: the new pore, the pore and its solution before it expanded, the ledger, and counts."""

    pore: Pore
    before: tuple[Pore, Solved]
    ledger: Ledger
    remeshed: bool
    iterations: int


@dataclass(frozen=True, eq=False)
class Attempt:
    """A step of the midpoint rule that may be taken: what it makes, None where the rates change more than is allowed;
    their mean change over its first half, 1/h; and, where it first makes contact with the opposite wall, the least
    distance (um) to that before and after the step, and the film's least thickness."""

    step: Step | None
    change: float
    gaps: tuple[float, float, float] | None


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
    ledger = Ledger(now.time, now.time + duration, *flows, mass_of(now), made, mass_of(after))
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
    guess = kinetics.grow(now.active, now.inert, *first, duration)
    end = transport.steady(solved.problem, guess[0], solved.concentrations)
    mean = [(a + b) / 2 for a, b in zip(first, rates_of(scene, end))]
    active, inert = kinetics.grow(now.active, now.inert, *mean, duration)
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
