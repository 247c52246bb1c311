"""The runs that the claims read: packaged scenes with changes, each computed once in a process, at the present level.

Nothing is written: a run is its instants. In the converged solution, and in wide, rows are asked for (`ROWS`), since
its steps end where they like; base in the scheme has a row a shape update. Contact with the opposite wall is a row of
its own wherever it comes, with the last state before it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import meshio
import numpy as np

from repro import results
from repro.march import simulation, updates
from repro.march.loop import Instant, Ledger, State, newton_counts
from repro.model import pore
from repro.model.pore import Pore, Solved
from repro.scene import Scene, load_scene
from verification.claims.levels import CONVERGED, cached, converged, current

#: Section 4 and Figure 6.
BASE, WIDE = ("base",), ("wide",)
#: Rows of t = 0 and of the last two shapes alone, for runs of which no more is asked.
LAST = 'output.times=["19.2 h", "19.4 h"]'
#: Section 4, where only the last two shapes are asked for.
PLATES = (*BASE, LAST)
#: Hours of the rows of a packaged scene.
ROWS = {"base": (0.2, *map(float, range(1, 20)), 19.2, 19.4), "wide": tuple(map(float, range(1, 121)))}
#: How long (h) before contact the last shape with a film is looked at: 18 s.
FILM = 0.005
#: A shape update (h), whatever the level.
UPDATE = 0.2


def scene(name: str, *changes: str) -> Scene:
    """A packaged scene with the KEY=VALUE of --set, in the elements and steps of the present level."""
    level = current()
    changes = (*level.wide, *changes) if name == "wide" else changes
    if level.kind == CONVERGED:
        return _with_rows(load_scene(name, (*converged(level.size), *changes)), always=True)
    said = load_scene(name, changes)
    numerics = replace(said.numerics, refinement=said.numerics.refinement / level.size)
    growth = said.growth and replace(said.growth, time_step=round(said.growth.time_step * level.step, 12))
    return _with_rows(replace(said, numerics=numerics, growth=growth), always=False)


def _with_rows(said: Scene, always: bool) -> Scene:
    """The scene with its rows, where it names none and cannot have one a step."""
    if said.growth is None or said.output.times or not (always or said.name == "wide"):
        return said
    times = tuple(time for time in ROWS[said.name] if time <= said.growth.end + 1e-9)
    return replace(said, output=replace(said.output, times=times))


@dataclass(frozen=True, eq=False)
class History:
    """A run. instants: those of its rows; ledgers: of all its steps; contact: the last instant before it touches the
    opposite wall and the first after, None where it does not."""

    scene: Scene
    instants: tuple[Instant, ...]
    ledgers: tuple[Ledger, ...]
    contact: tuple[Instant, Instant] | None


@cached
def history(*run: str) -> History:
    """One run, computed. Raises SimulationError where it fails."""
    said, instants, ledgers, before, contact = scene(*run), [], [], None, None
    for state, instant in simulation.steps(said):
        if instant:
            instants.append(instant)
            ledgers += instant.ledgers
        if contact is None and before is not None and state.pore.contact:
            contact = tuple(_solved(said, each) for each in (_with_a_film(said, before, state), state))
        before = state
    return History(said, tuple(instants), tuple(ledgers), contact)


def _with_a_film(said: Scene, before: State, contact: State) -> State:
    """The last state that leaves a film: in the converged solution FILM before contact, in the scheme an update."""
    end = contact.pore.time - FILM
    if current().kind != CONVERGED or end <= before.pore.time:
        return before
    shorter = replace(said, growth=replace(said.growth, end=end), output=replace(said.output, times=(end,)))
    *_, (state, _) = simulation.steps(shorter, before)
    return before if state.pore.contact else state


def _solved(said: Scene, state: State) -> Instant:
    """A state as the instant of a row."""
    found = pore.solve(said, state.pore)
    now = replace(state.pore, concentrations=found.concentrations)
    return Instant(now, found, None, state.ledgers, state.remeshes, newton_counts(found))


@cached
def series(*run: str) -> dict[str, np.ndarray]:
    """Columns of a run's rows, as in ``timeseries.csv``."""
    return _columns(history(*run).scene, history(*run).instants)


@cached
def around_contact(*run: str) -> dict[str, np.ndarray]:
    """The same for the last state before contact and the first after. Raises LookupError where there is none."""
    found = history(*run)
    if found.contact is None:
        raise LookupError(f"{run} does not touch the opposite wall")
    return _columns(found.scene, found.contact)


def _columns(said: Scene, instants: tuple[Instant, ...]) -> dict[str, np.ndarray]:
    rows = [results.row(said, instant) for instant in instants]
    return {name: np.array([np.nan if row[name] is None else row[name] for row in rows]) for name in results.COLUMNS}


@cached
def ledger(*run: str) -> dict[str, np.ndarray]:
    """Columns of ``ledger.csv``, of all steps."""
    found = history(*run)
    rows = np.array([results.ledger_row(found.scene, step) for step in found.ledgers])
    return dict(zip(results.LEDGER_COLUMNS, rows.T))


def row_number(run: tuple[str, ...], time: float) -> int:
    """Number of a run's row at a time (h). Raises KeyError where there is none."""
    found = np.flatnonzero(np.abs(series(*run)["time_h"] - time) < 1e-6)
    if len(found) != 1:
        raise KeyError(f"{run}: {len(found)} rows at t = {time} h")
    return int(found[0])


def instant(run: tuple[str, ...], time: float) -> Instant:
    """The instant of a run's row at a time (h)."""
    return history(*run).instants[row_number(run, time)]


def at(run: tuple[str, ...], time: float) -> dict[str, float]:
    """The row of a run at a time (h). Raises KeyError where there is none."""
    number = row_number(run, time)
    return {name: float(column[number]) for name, column in series(*run).items()}


def nearest(run: tuple[str, ...], time: float) -> float:
    """The time (h) of a run's row that is the nearest to a time (h): longer steps need not land on it."""
    hours = series(*run)["time_h"]
    return float(hours[np.abs(hours - time).argmin()])


@cached
def grown(run: tuple[str, ...], time: float) -> tuple[Pore, Solved]:
    """The shape of a run at a time (h) with what grows in it in the next 12 min, and what is solved then: the state
    "before the aggregate expands" [E12]."""
    said, start = scene(*run), instant(run, time)
    made, _, _ = updates.make_biomass(said, start.pore, start.solved, UPDATE)
    return made, pore.solve(said, made)


def fields(run: tuple[str, ...], number: int) -> meshio.Mesh:
    """Fields of a run's row: ``number`` counts from 0 (-1: the last)."""
    found = history(*run)
    return results.fields(found.scene, found.instants[number].pore, found.instants[number].solved)
