"""The one loop of steps of every scheme, and the state from which it goes on bit for bit.

Steps, to the last bit, depend neither on which rows are asked for nor on when the run ends. A row
between two steps is made of the step that passes it, and nothing goes on from it. Where
``growth.end`` lies within a step, that one is cut there, rows before the end are still those of the
whole step, and the ledger closes like the others; a run to a later end goes on from the state
before it.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import Field, dataclass, field, fields, replace
from typing import ClassVar, Protocol, TypeVar

import numpy as np

from repro.errors import RunEnd, SimulationError, StageError
from repro.fem.brief import brief
from repro.fem.sizing import ACROSS_PORE
from repro.march import balance
from repro.march.folding import folding, refuse_density
from repro.march.pace import Pace
from repro.model.advice import advised
from repro.model.pore import Pore, Solved, seeded
from repro.model.remeshing import resolved
from repro.scene import Scene, needed


class Dataclass(Protocol):
    """An instance of any dataclass."""

    __dataclass_fields__: ClassVar[dict[str, Field]]


Data = TypeVar("Data", bound=Dataclass)

#: A step of the grid this close (h) to a reported time is that time.
SAME_TIME = 1e-9


@dataclass(frozen=True)
class Ledger:
    """Mass balance of one step per depth (um2 mg/L = 1e-12 g/m): both substrates, then biomass."""

    start: float
    end: float
    supplied: tuple[float, float]
    out: tuple[float, float]
    consumed: tuple[float, float]
    stored: tuple[float, float]
    biomass_before: float
    biomass_made: float
    biomass_after: float


@brief
@dataclass(frozen=True, eq=False)
class Instant:
    """The pore at ``pore.time`` with what is solved in its geometry, and how it came there.

    before: the pore and its solution at the end of the last step, grown but not yet expanded
    (Plate 1), None at t = 0 and where the step that follows cannot be made; ledgers, remeshes,
    iterations: of the steps that ended since the last instant.
    """

    pore: Pore
    solved: Solved
    before: tuple[Pore, Solved] | None
    ledgers: tuple[Ledger, ...]
    remeshes: int
    iterations: dict[str, int]


@dataclass(frozen=True, eq=False)
class Moment:
    """The pore at a time within a step, what is solved there, and both before it expanded."""

    pore: Pore
    solved: Solved
    before: tuple[Pore, Solved] | None = None


@dataclass(frozen=True, eq=False)
class Step:
    """What one step made: the new pore, the pore and its solution before it expanded, the ledger
    and counts; and how it comes to any time (h) within it."""

    pore: Pore
    before: tuple[Pore, Solved] | None
    ledger: Ledger
    remeshed: bool
    iterations: int
    within: Callable[[float], Moment] | None = None


@brief
@dataclass(frozen=True, eq=False)
class State:
    """All that a run goes on from after a step.

    pore: as the step left it, with the guess from which its substrates are solved; pace: of the
    step to try next; ledgers, remeshes, iterations: of the steps since the last Instant; row: time
    (h) of that Instant, later than the pore's where it lies within the step that follows.
    """

    pore: Pore
    pace: Pace
    ledgers: tuple[Ledger, ...] = ()
    remeshes: int = 0
    iterations: dict[str, int] = field(default_factory=dict)
    row: float = 0.0

    @property
    def time(self) -> float:
        """How far the run has come, h."""
        return max(self.pore.time, self.row)


@dataclass(frozen=True)
class Scheme:
    """What the loop needs of a way to make steps.

    advance(scene, pore, solved, pace): one step that growth.end has no part in, nor have rows, or
    the one that is cut there, as (Step, what is solved after it, pace of the next);
    rows(scene): times (h) of rows where there are no ``output.times``, beside the ends of steps;
    first: length of the first step that is tried, in parts of growth.time_step; ends(scene): times
    (h) at which steps end, those that are known beforehand.
    """

    advance: Callable[[Scene, Pore, Solved, Pace], tuple[Step, Solved, Pace]]
    rows: Callable[[Scene], tuple[float, ...]] = lambda _: ()
    first: float = 1.0
    ends: Callable[[Scene], Iterable[float]] = lambda _: ()


class PoreEnd(RunEnd):
    """The aggregate has reached an end of the pore."""


def steps(scene: Scene, scheme: Scheme,
          state: State | None = None) -> Iterator[tuple[State, Instant | None]]:
    """Every step of a run from t = 0, or after ``state``, with an Instant at reported times.

    Raises SimulationError where a stage fails, and, after a last Instant, PoreEnd where the
    aggregate reaches an end of the pore, Fold where its surface folds.
    """
    first = state is None
    with stopping(state.pore.time if state else 0.0):
        first_step = scheme.first * scene.growth.time_step if scene.growth else 0.0
        state = state or State(laid_out(seeded(scene)), Pace(first_step))
        begun, solved = resolved(scene, state.pore)
        if begun is not state.pore:
            state = replace(state, pore=laid_out(begun))
    now = replace(state.pore, concentrations=solved.concentrations)
    if first:
        yield state, Instant(now, solved, None, (), 0, newton_counts(solved))
    if scene.growth:
        refuse_end(scene, now, 1.0 if now.time > 0 else 0.1)
    rows = row_times(scene, scheme)
    largest = scene.largest
    end = scene.growth.end if scene.growth else 0.0
    while end - now.time > SAME_TIME:
        try:
            with stopping(now.time), folding(now, state.time):
                taken, after, pace = scheme.advance(scene, now, solved, state.pace)
                balance.refuse(largest, taken.pore, taken.ledger)
                refuse_density(scene, taken.pore)
            for time in rows:
                if state.time + SAME_TIME < time < taken.pore.time - SAME_TIME:
                    with stopping(now.time), folding(now, state.time):
                        there = needed(taken.within, "a step's interior")(time)
                        refuse_density(scene, there.pore)
                    found = instant(state, there.pore, there.solved, there.before)
                    state = reported(state, time)
                    yield state, found
        except RunEnd:
            if state.ledgers:  # steps that are not reported yet
                yield reported(state, now.time), instant(state, now, solved, None)
            raise
        solved = after
        state = _after(state, taken, solved, pace)
        now = replace(state.pore, concentrations=solved.concentrations)
        asked = _asked(rows, now.time)
        if scene.output.times is None or asked is not None or pore_end(scene, now, 1.0):
            shown = now if asked is None else replace(now, time=asked)
            yield reported(state, now.time), instant(state, shown, solved, taken.before)
            state = reported(state, now.time)
        else:
            yield state, None
        refuse_end(scene, now, 1.0)


def row_times(scene: Scene, scheme: Scheme) -> tuple[float, ...]:
    """Times (h) of rows after t = 0, ascending: ``output.times``, or those of the scheme."""
    if scene.growth is None:
        return ()
    return scheme.rows(scene) if scene.output.times is None else scene.output.times


def _asked(rows: tuple[float, ...], time: float) -> float | None:
    """The row's time that a step's end is, to the last bit; None where it is none."""
    return next((row for row in rows if abs(row - time) <= SAME_TIME), None)


def _after(state: State, taken: Step, solved: Solved, pace: Pace) -> State:
    """The state with one step more to report."""
    before = newton_counts(taken.before[1]) if taken.before else {}
    counts = added(state.iterations, {"growth": taken.iterations}, before, newton_counts(solved))
    ledgers = (*state.ledgers, taken.ledger)
    return State(taken.pore, pace, ledgers, state.remeshes + taken.remeshed, counts, state.row)


def instant(state: State, now: Pore, solved: Solved, before: tuple[Pore, Solved] | None) -> Instant:
    """The Instant that reports the steps of a state."""
    return Instant(now, solved, before, state.ledgers, state.remeshes, state.iterations)


def reported(state: State, time: float) -> State:
    """The state with nothing to report, after a row at a time (h)."""
    return State(state.pore, state.pace, row=time)


def laid_out(pore: Pore) -> Pore:
    """The same pore, none of its arrays a strided view: sums over those may differ in the last bit
    from sums over the copies that a checkpoint gives back."""
    state = pore.concentrations
    mesh = _flat(pore.mesh)
    body = _flat(pore.body)
    found = replace(_flat(pore), concentrations=state and _flat(state))
    if body is not pore.body:
        found = replace(found, body=body)
    return found if mesh is pore.mesh else replace(found, space=replace(pore.space, mesh=mesh))


def _flat(data: Data) -> Data:
    """A dataclass with its strided arrays copied; itself where there are none."""
    arrays = {each.name: getattr(data, each.name) for each in fields(data) if each.init}
    strided = {name: np.ascontiguousarray(array) for name, array in arrays.items()
               if isinstance(array, np.ndarray) and not array.flags.forc}
    return replace(data, **strided) if strided else data


@contextmanager
def stopping(time: float) -> Iterator[None]:
    """Floating-point errors and lack of memory stop the run; a failure is told with the simulated
    time of its step."""
    stopped = f"stopped in the step from t = {time:g} h"
    try:
        with np.errstate(all="raise", under="ignore"):
            yield
    except StageError as error:
        raise SimulationError(f"{stopped}, in {error.stage}: {advised(error)}") from error
    except FloatingPointError as error:
        raise SimulationError(f"{stopped} by a floating-point error ({error}); try a shorter "
                              "growth.time_step or a larger numerics.refinement") from error
    except MemoryError as error:
        raise SimulationError(f"{stopped}, out of memory ({error}); "
                              "try a smaller numerics.refinement") from error


def newton_counts(solved: Solved) -> dict[str, int]:
    """Iterations by what they were spent on."""
    return {"transport": solved.concentrations.iterations if solved.concentrations else 0}


def added(*counts: dict[str, int]) -> dict[str, int]:
    """The sum of counts, key by key."""
    total: Counter[str] = Counter()
    for count in counts:
        total.update(count)
    return dict(sorted(total.items()))


def pore_end(scene: Scene, now: Pore, elements: float) -> str:
    """Which end of the pore the aggregate has reached, to within so many elements of the fluid;
    empty while it has reached none."""
    outline = now.boundary
    end = scene.pore.length / 2
    near = elements * scene.pore.width / ACROSS_PORE
    if outline.upstream < near - end or outline.downstream > end - near:
        side = "upstream" if outline.upstream < near - end else "downstream"
        return f"the aggregate reaches the pore's {side} end"
    return ""


def refuse_end(scene: Scene, now: Pore, elements: float) -> None:
    """Raises PoreEnd where the aggregate has reached an end of the pore, to within so many
    elements of the fluid."""
    if over := pore_end(scene, now, elements):
        raise PoreEnd(f"{over} at t = {now.time:g} h")
