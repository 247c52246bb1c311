"""The loop of steps of every scheme, and the state from which it restarts bit for bit.

Steps depend neither on the requested rows nor on the end of the run, to the last bit. A row between
two steps is interpolated in the step that passes it, and no step starts from it. If ``growth.end``
lies within a step, that step is cut there. Rows before the end still belong to the uncut step, and
the ledger of the cut step closes like the others. A run to a later end restarts from the state
before the cut step.
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
from repro.march.balance import Ledger, Limits
from repro.march.detachment import detachment
from repro.march.folding import Compression, folding, refuse_density
from repro.march.step_control import StepControl
from repro.model.advice import with_advice
from repro.model.pore import Pore, Solved, seeded
from repro.model.remeshing import solve_graded
from repro.model.stages import Stages
from repro.scene import Growth, Scene
from repro.scene import Pore as Channel


class Dataclass(Protocol):
    """An instance of any dataclass."""

    __dataclass_fields__: ClassVar[dict[str, Field]]


Data = TypeVar("Data", bound=Dataclass)

#: Two times (h) this close are the same time.
SAME_TIME = 1e-9


@brief
@dataclass(frozen=True, eq=False)
class Report:
    """State of the pore at a reported time, for one row of results.

    Attributes
    ----------
    pore : Pore
        Pore at the reported time ``pore.time`` (h).
    solved : Solved
        Flow and substrates in the geometry of ``pore``.
    before : (Pore, Solved) or None
        Pore and solution at the end of the last step, grown but not yet expanded (Plate 1). None
        at t = 0, and if the next step fails.
    ledgers : tuple of Ledger
        Mass balances of the steps since the last report.
    remeshes : int
        Number of new meshes since the last report.
    iterations : dict of str to int
        Newton iterations since the last report, by stage.
    """

    pore: Pore
    solved: Solved
    before: tuple[Pore, Solved] | None
    ledgers: tuple[Ledger, ...]
    remeshes: int
    iterations: dict[str, int]


@dataclass(frozen=True, eq=False)
class InterpolatedState:
    """Pore and solution interpolated within a step; ``before``: both before the expansion."""

    pore: Pore
    solved: Solved
    before: tuple[Pore, Solved] | None = None


@dataclass(frozen=True, eq=False)
class StepResult:
    """Result of one step: the new pore, pore and solution before the expansion, and the ledger.

    within: interpolates the state to a time (h) within the step.
    """

    pore: Pore
    before: tuple[Pore, Solved] | None
    ledger: Ledger
    remeshed: bool
    iterations: int
    within: Callable[[float], InterpolatedState]


@brief
@dataclass(frozen=True, eq=False)
class RestartState:
    """Complete state from which a run restarts after a step.

    pore: pore after the step, with the initial guess of its substrates; step_control: of the next
    step; ledgers, remeshes, iterations: of the steps since the last Report; row: time (h) of that
    Report, later than ``pore.time`` if it lies within the next step; compression: the least stretch
    of the surface so far.
    """

    pore: Pore
    step_control: StepControl
    ledgers: tuple[Ledger, ...] = ()
    remeshes: int = 0
    iterations: dict[str, int] = field(default_factory=dict)
    row: float = 0.0
    compression: Compression = Compression()

    @property
    def time(self) -> float:
        """Simulated time (h) that the run has reached."""
        return max(self.pore.time, self.row)


@dataclass(frozen=True)
class Scheme:
    """Time-stepping scheme.

    advance(stages, pore, solved, step_control): makes one step, and returns its StepResult, the
    solution after it and the step control of the next one. The length of the step does not depend
    on ``growth.end`` or on the requested rows; a step that passes ``growth.end`` is cut there.
    rows(growth): times (h) of rows besides the ends of steps, without requested ones; first:
    length of the first attempted step, as a multiple of growth.time_step; ends(scene): times (h) at
    which steps end, if known in advance.
    """

    advance: Callable[[Stages, Pore, Solved, StepControl], tuple[StepResult, Solved, StepControl]]
    rows: Callable[[Growth], tuple[float, ...]] = lambda _: ()
    first: float = 1.0
    ends: Callable[[Scene], Iterable[float]] = lambda _: ()


class PoreEnd(RunEnd):
    """The aggregate has reached an end of the pore.

    :func:`repro.simulate` raises it after the last Report. It is an end of the model, not a
    failure: the message names the end of the pore and the time (h).

    Examples
    --------
    >>> import repro
    >>> changes = ['pore.length="120 um"', 'aggregate.radius="9 um"', 'aggregate.position="-50 um"']
    >>> try:
    ...     for report in repro.simulate(repro.load_scene("base", changes)):
    ...         pass
    ... except repro.PoreEnd as end:
    ...     print(end)
    the aggregate reaches the pore's upstream end at t = 0.2 h
    """


def steps(scene: Scene, scheme: Scheme,
          state: RestartState | None = None) -> Iterator[tuple[RestartState, Report | None]]:
    """Yield the state after every step from t = 0 or ``state`` on, with a Report if one is due.

    Raises SimulationError if a stage fails. After the last Report, raises PoreEnd if the aggregate
    reaches an end of the pore, Fold if its surface folds, and Detachment if it leaves a wall or
    tears.
    """
    first = state is None
    with stopping(state.pore.time if state else 0.0):
        first_step = scheme.first * scene.growth.time_step if scene.growth else 0.0
        state = state or RestartState(contiguous(seeded(scene)), StepControl(first_step))
        refined, solved = solve_graded(scene, state.pore)
        if refined is not state.pore:
            state = replace(state, pore=contiguous(refined))
    if first:
        pore = replace(state.pore, concentrations=solved.concentrations)
        yield state, Report(pore, solved, None, (), 0, newton_counts(solved))
    if scene.growth:
        yield from _grow(Stages.of(scene), scheme, state, solved)


def _grow(stages: Stages, scheme: Scheme, state: RestartState,
          solved: Solved) -> Iterator[tuple[RestartState, Report | None]]:
    """Yield the state after every step from ``state`` on, whose solution is ``solved``."""
    scene = stages.scene
    density = stages.remeshing.maximum_density
    pore = replace(state.pore, concentrations=solved.concentrations)
    refuse_end(scene.pore, pore, 1.0 if pore.time > 0 else 0.1)
    failure = detachment(scene, pore, solved)
    requested = scene.requested_times
    rows = row_times(scheme, scene)
    limits = Limits.of(scene)
    bonded = stages.growth.wall == "bonded"
    while failure is None and stages.growth.end - pore.time > SAME_TIME:
        try:
            with stopping(pore.time, bonded), folding(state.compression, state.time):
                step, after, control = scheme.advance(stages, pore, solved, state.step_control)
                balance.refuse(limits, step.pore, step.ledger)
                refuse_density(step.pore, density)
            for time in rows:
                if state.time + SAME_TIME < time < step.pore.time - SAME_TIME:
                    with stopping(pore.time, bonded), folding(state.compression, state.time):
                        inner = step.within(time)
                        refuse_density(inner.pore, density)
                    report = make_report(state, inner.pore, inner.solved, inner.before)
                    state = mark_reported(state, time)
                    yield state, report
        except RunEnd:
            if state.ledgers:  # steps that are not reported yet
                yield mark_reported(state, pore.time), make_report(state, pore, solved, None)
            raise
        solved = after
        state = _after_step(state, step, solved, control)
        pore = replace(state.pore, concentrations=solved.concentrations)
        row = _row_time_at(rows, pore.time)
        failure = detachment(scene, pore, solved)
        ends = failure or pore_end(scene.pore, pore, 1.0)
        if requested is None or row is not None or ends:
            reported = pore if row is None else replace(pore, time=row)
            yield mark_reported(state, pore.time), make_report(state, reported, solved, step.before)
            state = mark_reported(state, pore.time)
        else:
            yield state, None
        refuse_end(scene.pore, pore, 1.0)
    if failure:
        raise failure


def row_times(scheme: Scheme, scene: Scene) -> tuple[float, ...]:
    """Return the times (h) of rows after t = 0, ascending: those of [output], or the scheme's."""
    if scene.growth is None:
        return ()
    requested = scene.requested_times
    return scheme.rows(scene.growth) if requested is None else requested


def _row_time_at(rows: tuple[float, ...], time: float) -> float | None:
    """Exact time (h) of the row at which a step ends; None if it ends at no row."""
    return next((row for row in rows if abs(row - time) <= SAME_TIME), None)


def _after_step(state: RestartState, step: StepResult, solved: Solved,
                control: StepControl) -> RestartState:
    """Return the state after one more step, which is not reported yet."""
    before = newton_counts(step.before[1]) if step.before else {}
    counts = sum_counts(state.iterations, {"growth": step.iterations}, before,
                        newton_counts(solved))
    ledgers = (*state.ledgers, step.ledger)
    remeshes = state.remeshes + step.remeshed
    return RestartState(step.pore, control, ledgers, remeshes, counts, state.row,
                        state.compression.after(step.pore))


def make_report(state: RestartState, pore: Pore, solved: Solved,
                before: tuple[Pore, Solved] | None) -> Report:
    """Report the steps of a state since the last report."""
    return Report(pore, solved, before, state.ledgers, state.remeshes, state.iterations)


def mark_reported(state: RestartState, time: float) -> RestartState:
    """Return the state after a row at a time (h), without steps to report."""
    return RestartState(state.pore, state.step_control, row=time, compression=state.compression)


def contiguous(pore: Pore) -> Pore:
    """Return the same pore with contiguous arrays.

    A sum over a strided view may differ in the last bit from that over its copy in a checkpoint.
    """
    state = pore.concentrations
    mesh = _contiguous_arrays(pore.mesh)
    body = _contiguous_arrays(pore.body)
    copied = replace(_contiguous_arrays(pore), concentrations=state and _contiguous_arrays(state))
    if body is not pore.body:
        copied = replace(copied, body=body)
    return copied if mesh is pore.mesh else replace(copied, space=replace(pore.space, mesh=mesh))


def _contiguous_arrays(data: Data) -> Data:
    """Return a dataclass with its strided arrays copied, or the same object if it has none."""
    arrays = {each.name: getattr(data, each.name) for each in fields(data) if each.init}
    strided = {name: np.ascontiguousarray(array) for name, array in arrays.items()
               if isinstance(array, np.ndarray) and not array.flags.forc}
    return replace(data, **strided) if strided else data


@contextmanager
def stopping(time: float, bonded: bool = False) -> Iterator[None]:
    """Turn the failure of a step that starts at ``time`` (h) into a SimulationError.

    bonded: whether the aggregate is bonded to the lower wall, for the advice in the message. Stage
    errors, floating-point errors and lack of memory count as failures.
    """
    stopped = f"stopped in the step from t = {time:g} h"
    try:
        with np.errstate(all="raise", under="ignore"):
            yield
    except StageError as error:
        message = f"{stopped}, in {error.stage}: {with_advice(error, bonded)}"
        raise SimulationError(message) from error
    except FloatingPointError as error:
        raise SimulationError(f"{stopped} by a floating-point error ({error})") from error
    except MemoryError as error:
        raise SimulationError(f"{stopped}, out of memory ({error}); "
                              "try a smaller numerics.refinement") from error


def time_before_end(previous: Pore, duration: float) -> float:
    """Time (h) just before the end of a step, before a jump of the scene's tables there."""
    return max(previous.time, previous.time + duration - SAME_TIME)


def newton_counts(solved: Solved) -> dict[str, int]:
    """Newton iterations by stage."""
    return {"transport": solved.concentrations.iterations if solved.concentrations else 0}


def sum_counts(*counts: dict[str, int]) -> dict[str, int]:
    """Add counts, key by key."""
    total: Counter[str] = Counter()
    for count in counts:
        total.update(count)
    return dict(sorted(total.items()))


def pore_end(channel: Channel, pore: Pore, elements: float) -> str:
    """Message with the end of the pore that the aggregate has reached; empty if none.

    elements: distance from an end that counts as reached, in elements of the fluid.
    """
    outline = pore.boundary
    end = channel.length / 2
    near = elements * channel.width / ACROSS_PORE
    if outline.upstream < near - end or outline.downstream > end - near:
        side = "upstream" if outline.upstream < near - end else "downstream"
        return f"the aggregate reaches the pore's {side} end"
    return ""


def refuse_end(channel: Channel, pore: Pore, elements: float) -> None:
    """Raise PoreEnd if the aggregate has reached an end of the pore (see :func:`pore_end`)."""
    if message := pore_end(channel, pore, elements):
        raise PoreEnd(f"{message} at t = {pore.time:g} h")
