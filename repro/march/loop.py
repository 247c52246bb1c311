"""The loop of steps of every scheme.

Steps depend on neither the requested rows nor the end of the run, to the last bit. There is one
exception: if the step to the end fails, shorter steps lead to it. A row between the ends of two
steps is interpolated within a step, and no step starts from it. If a row cannot be computed, the
state contains the reason, and the run continues. If ``growth.end`` or an end of the
model (:mod:`repro.march.ends`) lies within a step, the step is cut there. Rows before the end are
still interpolated in the uncut step. The ledger of the cut step balances like the others. A run to
a later end restarts from the state before the cut step.

A step ends at a jump of the scene's tables. Its row has the state just after the jump: with fluid
forces the aggregate takes its new equilibrium there, as at t = 0 (:func:`settle`). A step also ends
when an aggregate leaves the pore (``growth.after_detachment``), when two aggregates join
(``growth.meeting``) or when a welded one joins a wall. Its row has the state just after this event,
and its ledger contains the mass that has left.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from repro.errors import RunEnd, StageError
from repro.fem.mesh import Topology
from repro.march import balance
from repro.march.balance import Limits
from repro.march.ends import Ends, Reached, locate, nearest_end
from repro.march.folding import folding, most_compressed, refuse_density
from repro.march.state import (
    SAME_TIME,
    Compression,
    InterpolatedState,
    Report,
    RestartState,
    StepResult,
    contiguous,
    initial_report,
    newton_counts,
    stopping,
    sum_counts,
)
from repro.march.step_control import StepControl
from repro.model.contact_lines import SearchOptions
from repro.model.meshing import seeded
from repro.model.pore import Pore
from repro.model.solving import Solved
from repro.model.stages import Stages
from repro.scene import Growth, Scene, TimeTables


@dataclass(frozen=True)
class Stepping:
    """Time stepping of a scheme.

    advance(stages, pore, solved, step_control): makes one step. Returns its StepResult, the
    solution after it and the step control of the next step. The length of the step does not depend
    on ``growth.end`` or on the requested rows. A step that passes ``growth.end`` is cut there. At a
    jump of the scene's tables the solution is that before the jump.
    cut(stages, pore, solved, time, meshes): makes a shorter step to a time (h), as
    :func:`midpoint.attempt`. Returns its StepResult and the solution after it.
    rows(growth): times (h) of rows without ``output.times``, besides the ends of steps.
    first: length of the first attempted step, as a multiple of growth.time_step.
    ends(scene): times (h) at which steps end, if known in advance.
    """

    advance: Callable[[Stages, Pore, Solved, StepControl], tuple[StepResult, Solved, StepControl]]
    cut: Callable[..., tuple[StepResult, Solved]]
    rows: Callable[[Growth], tuple[float, ...]] = lambda _: ()
    first: float = 1.0
    ends: Callable[[Scene], Iterable[float]] = lambda _: ()


@dataclass(frozen=True, eq=False)
class Course:
    """Data of a scene with growth for the loop.

    limits: of balances; rows: times (h) of rows after t = 0; every_step: does each step have a row
    too?
    """

    stages: Stages
    stepping: Stepping
    ends: Ends
    limits: Limits
    rows: tuple[float, ...]
    every_step: bool

    @classmethod
    def of(cls, scene: Scene, stepping: Stepping) -> Course:
        """Read the data of a scene."""
        return cls(Stages.of(scene), stepping, Ends.of(scene), Limits.of(scene),
                   row_times(stepping, scene), scene.requested_times is None)


def steps(scene: Scene, stepping: Stepping,
          state: RestartState | None = None) -> Iterator[tuple[RestartState, Report | None]]:
    """Yield the state after every step from t = 0 or ``state`` on, with a Report if one is due.

    The scene must have growth. Raises SimulationError if a stage fails. After the last Report,
    raises PoreEnd if an aggregate reaches an end of the pore, Fold if its surface folds, Meeting if
    two aggregates meet, Detachment if an aggregate leaves a wall, tears or is eroded, and Steady if
    growth.until = "steady" and the aggregates are steady.
    """
    first = state is None
    with stopping(state.pore.time if state else 0.0):
        course = Course.of(scene, stepping)
        stages = course.stages
        first_step = StepControl(stepping.first * stages.growth.time_step)
        state = state or RestartState(contiguous(seeded(scene)), first_step)
        pore, solved = stages.grading.solve(state.pore)
        if first:
            pore, solved = settle(stages, pore, solved)
        if pore is not state.pore:
            state = replace(state, pore=contiguous(pore))
    if first:
        yield state, initial_report(state, solved)
    yield from _grow(course, state, solved)


def settle(stages: Stages, pore: Pore, solved: Solved) -> tuple[Pore, Solved]:
    """Bring the aggregate to its equilibrium under the fluid forces at the time of ``pore``.

    Returns the pore, and flow and substrates in it. Without fluid forces nothing changes.
    """
    if not stages.growth.has_fluid_forces:
        return pore, solved
    expanded = stages.expand(pore, pore, search=SearchOptions(landing=-np.inf)).pore
    expanded = replace(expanded, concentrations=solved.concentrations)
    settled, _ = stages.new_mesh(pore, expanded, solved)
    return stages.grading.solve(contiguous(settled))


def _grow(course: Course, state: RestartState,
          solved: Solved) -> Iterator[tuple[RestartState, Report | None]]:
    """Yield the state after every step from ``state`` on; solved: solution in ``state``."""
    stages = course.stages
    pore = replace(state.pore, concentrations=solved.concentrations)
    with stopping(pore.time, stages.growth.bonded), folding(state.compression, state.time):
        event = nearest_end(course.ends, pore, solved)
    shown = pore.mesh.topology
    while event.margin <= 0 and stages.growth.end - pore.time > SAME_TIME:
        try:
            with stopping(pore.time, stages.growth.bonded), folding(state.compression, state.time):
                reached, control = _advance(course, state, pore, solved, event.margin)
                step = reached.step
                balance.refuse(course.limits, step.pore, step.ledger)
                refuse_density(pore, step.pore, stages.remeshing.maximum_density)
        except RunEnd:
            if state.ledgers:  # steps that are not reported yet
                report = make_report(state, pore, solved, None, shown)
                yield mark_reported(state, pore.time), report
            raise
        if state.row > pore.time + SAME_TIME:  # resumed within the step
            shown = step.within(state.row).pore.mesh.topology
        for time in course.rows:
            if state.time + SAME_TIME < time < step.pore.time - SAME_TIME:
                inner, reason = _row_within(stages, pore, step, time)
                if inner:
                    report = make_report(state, inner.pore, inner.solved, inner.before, shown)
                    shown = inner.pore.mesh.topology
                    state = mark_reported(state, time)
                    yield state, report
                else:
                    yield replace(state, missing=(time, reason)), None
        solved = reached.solved
        event = reached.event
        detached = len(step.pore.bodies) < len(pore.bodies)
        state = _after_step(state, step, solved, control)
        pore = replace(state.pore, concentrations=solved.concentrations)
        row = next((row for row in course.rows if abs(row - pore.time) <= SAME_TIME), None)
        if course.every_step or row is not None or detached or event.margin > 0:
            reported = pore if row is None else replace(pore, time=row)
            report = make_report(state, reported, solved, step.before, shown)
            report = replace(report, departed=step.departed)
            shown = pore.mesh.topology
            state = mark_reported(state, pore.time)
            yield state, report
        else:
            yield state, None
    if event.margin > 0:
        raise event.end


def _advance(course: Course, state: RestartState, pore: Pore, solved: Solved,
             margin: float) -> tuple[Reached, StepControl]:
    """Make one step, or a shorter step to the first end of the model within it.

    margin: largest margin at the start of the step (see :mod:`repro.march.ends`).
    """
    stages = course.stages
    stepping = course.stepping

    def reached(step: StepResult, after: Solved) -> Reached:
        return Reached(step, after, nearest_end(course.ends, step.pore, after, pore))

    step, after, control = stepping.advance(stages, pore, solved, state.step_control)
    end = reached(step, after)
    if end.event.margin > 0:
        trial = step

        def shorter(time: float) -> Reached:
            nonlocal trial
            trial, after = stepping.cut(stages, pore, solved, time, trial.generated)
            return reached(trial, after)

        end = locate(shorter, pore.time, margin, end)
        end = replace(end, step=replace(end.step, within=step.within))
    elif stages.tables.jumps(step.pore.time):
        end = reached(*_after_jump(stages, step))
    while True:
        leaves = end.leaves(stages.growth.continues)
        if end.joins is not None:
            welded = stages.weld(end.step.pore, end.joins, end.solved)
            end = reached(*_after_meeting(stages, end.step, welded))
        elif end.lands is not None:
            landed = stages.land(end.step.pore, end.lands, end.solved)
            end = reached(*_after_meeting(stages, end.step, landed))
        elif leaves is not None:
            end = reached(*_after_detachment(stages, end, leaves))
        else:
            return end, control


def _after_detachment(stages: Stages, reached: Reached,
                      number: int) -> tuple[StepResult, Solved]:
    """Return the state just after the aggregate with index ``number`` has left the pore."""
    step = reached.step
    mass = step.pore.bodies[number].mass
    remaining = stages.without(step.pore, number, reached.solved)
    after, solved = settle(stages, *stages.grading.solve(remaining))
    ledger = replace(step.ledger, biomass_after=step.ledger.biomass_after - mass,
                     detached=step.ledger.detached + mass)
    departed = (*step.departed, str(reached.event.end))
    return replace(step, pore=contiguous(after), ledger=ledger, remeshed=True,
                   departed=departed), solved


def _after_meeting(stages: Stages, step: StepResult, joined: Pore) -> tuple[StepResult, Solved]:
    """Return the state just after two aggregates, or one and a wall, have joined.

    step: it ends when they meet; joined: the pore with the new weld or contact.
    """
    after, solved = settle(stages, *stages.grading.solve(joined))
    ledger = replace(step.ledger, biomass_after=after.mass)
    return replace(step, pore=contiguous(after), ledger=ledger, remeshed=True), solved


def _after_jump(stages: Stages, step: StepResult) -> tuple[StepResult, Solved]:
    """Return the state just after a jump of the scene's tables at the end of a step."""
    after, jumped = settle(stages, *stages.grading.solve(step.pore))
    remeshed = step.remeshed or after.mesh.topology is not step.pore.mesh.topology
    return replace(step, pore=contiguous(after), remeshed=remeshed), jumped


def _row_within(stages: Stages, pore: Pore, step: StepResult,
                time: float) -> tuple[InterpolatedState | None, str]:
    """Return the state at a time (h) within a step, or None and the reason; pore: before it."""
    try:
        with np.errstate(all="raise", under="ignore"):
            inner = step.within(time)
            refuse_density(pore, inner.pore, stages.remeshing.maximum_density)
            return inner, ""
    except (RunEnd, StageError, FloatingPointError) as error:
        return None, str(error)


def row_times(stepping: Stepping, scene: Scene) -> tuple[float, ...]:
    """Return the times (h) of rows after t = 0, ascending: output.times, or the scheme's times."""
    requested = scene.requested_times
    return stepping.rows(scene.growing.growth) if requested is None else requested


def _after_step(state: RestartState, step: StepResult, solved: Solved,
                control: StepControl) -> RestartState:
    """Return the state after one more step, not yet reported."""
    before = newton_counts(step.before[1]) if step.before else {}
    counts = sum_counts(state.iterations, {"growth": step.iterations}, before,
                        newton_counts(solved))
    ledgers = (*state.ledgers, step.ledger)
    remeshes = state.remeshes + step.remeshed
    detached = len(step.pore.bodies) < len(state.pore.bodies)
    # The least stretch so far may be that of a detached aggregate.
    earlier = Compression() if detached else state.compression
    return RestartState(step.pore, control, ledgers, remeshes, counts, state.row,
                        most_compressed(earlier, step.pore))


def make_report(state: RestartState, pore: Pore, solved: Solved,
                before: tuple[Pore, Solved] | None, shown: Topology) -> Report:
    """Make the Report of a state; shown: topology of the mesh in the last Report."""
    return Report(pore, solved, before, state.ledgers, state.remeshes, state.iterations,
                  pore.mesh.topology is not shown)


def mark_reported(state: RestartState, time: float) -> RestartState:
    """Reset the counters of a state; time (h): of the row just reported."""
    return RestartState(state.pore, state.step_control, row=time, compression=state.compression)


def time_before_end(previous: Pore, duration: float) -> float:
    """Time (h) just before the end of a step, and so before a jump of the tables at this end."""
    return max(previous.time, previous.time + duration - SAME_TIME)


def before_jump(tables: TimeTables, pore: Pore) -> Pore:
    """Return the pore at its time, or just before if the scene's tables jump at this time."""
    return replace(pore, time=pore.time - SAME_TIME) if tables.jumps(pore.time) else pore
