"""Sequential coupling (section 2): flow, substrates, biomass, shape and mesh, every 12 min.

One step integrates (9)-(10) in the present geometry, increases theta by (28)-(29), solves for the
new equilibrium of the aggregate, closes films that are too thin (2.3.3), and moves the mesh (35).
The paper's criteria (3.1, 3.5) decide whether a new mesh replaces it.
"""

from __future__ import annotations

import math
from dataclasses import replace
from functools import partial

from repro.errors import GrowthError, RunEnd
from repro.march.balance import Ledger
from repro.march.ends import refuse_outside
from repro.march.folding import refuse_fold
from repro.march.loop import Stepping, before_jump, time_before_end
from repro.march.state import SAME_TIME, InterpolatedState, StepResult, contiguous
from repro.march.step_control import StepControl
from repro.model.contact_lines import FirstContact
from repro.model.mechanics import Expansion
from repro.model.pore import Pore
from repro.model.remeshing import GeneratedMesh
from repro.model.solving import Solved
from repro.model.stages import Stages
from repro.scene import Growth, Scene

#: A time equals a multiple of growth.time_step if it differs by less than this part of
#: growth.time_step.
ON_GRID = 1e-3


def schedule(scene: Scene) -> tuple[list[float], set[float]]:
    """Times (h) at which steps end, from t = 0 on, and times (h) that are reported.

    growth.end cuts the last step. A reported time within a step does not cut it.
    """
    if scene.growth is None:
        return [0.0], {0.0}
    end = scene.growth.end
    ends = [0.0]
    while end - ends[-1] > SAME_TIME:
        ends.append(next_time(scene.growth, ends[-1], scene.time_tables.corner(ends[-1])))
    return ends, {0.0, *(scene.requested_times or ends)}


def next_time(growth: Growth, time: float, corner: float) -> float:
    """Time (h) at which the step after ``time`` ends.

    It is the earliest of three times: the next multiple of growth.time_step, the next time of the
    scene's tables (``corner``), and growth.end. If two of them differ by less than SAME_TIME,
    ``corner`` replaces the multiple, and growth.end replaces both.
    """
    count = math.floor(time / growth.time_step + ON_GRID) + 1
    update = round(count * growth.time_step, 9)
    if corner - update < SAME_TIME:
        update = corner
    if update < growth.end - max(SAME_TIME, SAME_TIME * growth.time_step):
        return update
    return growth.end


def _advance(stages: Stages, previous: Pore, solved: Solved,
             control: StepControl) -> tuple[StepResult, Solved, StepControl]:
    """Make the step to the next update or to growth.end; halve it until it passes no end."""
    time = next_time(stages.growth, previous.time, stages.tables.corner(previous.time))
    while True:
        try:
            return *_cut(stages, previous, solved, time), control
        except RunEnd:
            if time - previous.time <= SAME_TIME:
                raise
            time = (previous.time + time) / 2


def _cut(stages: Stages, previous: Pore, solved: Solved, time: float,
         meshes: tuple[GeneratedMesh, ...] = ()) -> tuple[StepResult, Solved]:
    """Make a step to a time (h), and solve at its end, just before a jump of the tables there."""
    advanced = step(stages, previous, solved, time - previous.time, meshes)
    after = contiguous(replace(advanced.pore, time=time))
    solved = stages.solver.solve(before_jump(stages.tables, after))
    return replace(advanced, pore=after), solved


def _interpolate(stages: Stages, previous: Pore, solved: Solved, time: float) -> InterpolatedState:
    """The state at a time (h) within a step, by a shorter step from its start."""
    shorter = step(stages, previous, solved, time - previous.time)
    after = replace(shorter.pore, time=time)
    return InterpolatedState(after, stages.solver.solve(after), shorter.before)


def step(stages: Stages, previous: Pore, solved: Solved, duration: float,
         meshes: tuple[GeneratedMesh, ...] = ()) -> StepResult:
    """Make one step of ``duration`` (h): biomass, shape, mesh; meshes: as for
    :func:`midpoint.attempt`."""
    within = partial(_interpolate, stages, previous, solved)
    solved = _solve_midway(stages, previous, solved, duration)
    grown, end, flows = stages.transport.make_biomass(previous, solved, duration)
    grown = replace(grown, time=time_before_end(previous, duration))
    expansion = _expand(stages, previous, grown)
    expanded = expansion.pore
    refuse_outside(stages.channel, previous, expanded)
    refuse_fold(expanded)
    expanded = replace(expanded, concentrations=end)
    after, remeshed = stages.new_mesh(previous, expanded, solved, meshes)
    generated = (GeneratedMesh(expanded, after),) if remeshed else ()
    ledger = Ledger(previous.time, previous.time + duration, *flows[:4], previous.mass,
                    grown.mass - previous.mass, after.mass, flows.unmet)
    last = replace(grown, time=previous.time + duration), replace(solved, concentrations=end)
    return StepResult(after, last, ledger, remeshed, expansion.iterations, within,
                      generated=generated + meshes)


def _expand(stages: Stages, previous: Pore, grown: Pore) -> Expansion:
    """Compute the shape of the grown aggregate.

    Raises GrowthError if the aggregate passes the opposite wall within the step.
    """
    try:
        return stages.expand(previous, grown)
    except FirstContact as early:
        _, opposite = previous.mesh.walls
        beyond = -early.gaps[1] * opposite.part
        raise GrowthError(f"the aggregate passes the opposite wall by {beyond:.3g} um before "
                          "its contact; try a shorter growth.time_step") from None


def _solve_midway(stages: Stages, previous: Pore, solved: Solved, duration: float) -> Solved:
    """Solve in the shape at the start of a step, with the supplies and the drive at its middle.

    If no table of the scene changes in between, the result is ``solved``. If the transport stores
    substrates, the concentrations stay those of the start.
    """
    middle = previous.time + duration / 2
    if stages.tables.same(previous.time, middle):
        return solved
    halfway = stages.solver.solve(replace(previous, time=middle))
    if stages.transport.stores:
        return replace(halfway, concentrations=solved.concentrations)
    return halfway


#: The paper's updates.
STEPPING = Stepping(_advance, _cut, ends=lambda scene: schedule(scene)[0])
