"""Estimate the cost of a run on this machine from its first steps and a coarse run.

    seconds = first state + one step x (steps x cost of a step over the first ones)

The first state and steps are made with the scene's own preset and timed. The coarse run
(:mod:`repro.preflight.outlook`) shows how many steps there are, and how much more than the first
ones they cost with new and larger meshes and in contact. The estimated memory is the amount that
must be free when a run begins.
"""

import math
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import islice
from time import perf_counter

from repro.errors import RunEnd
from repro.march.simulation import rows_within
from repro.march.simulation import steps as iterate_steps
from repro.march.state import Report
from repro.march.step_control import SHORTEST, exceeds_tolerance
from repro.polling import poll
from repro.preflight.memory import MB, expected_bytes
from repro.preflight.outlook import MOST_NODES, CoarseRun
from repro.scene import Scene

#: Length of the trial over growth.time_step. Its first step is slow; the fastest one counts.
FIRST_STEPS = 3
MOST_STEPS = 9  # of the trial, if its steps are shorter
#: The trial replaces a mesh of more than MOST_NODES by a coarser one. Time grows with the nodes to
#: this power.
POWER = 1.2


@dataclass(frozen=True)
class Trial:
    """A trial of the first steps.

    first: report of the first state; start, step: seconds of this state and of one step (0 without
    steps); nodes: of its mesh; worst: the largest error estimate of steps that miss the tolerance,
    or 0.
    """

    first: Report
    start: float
    step: float
    nodes: int
    worst: float = 0.0


@dataclass(frozen=True)
class Cost:
    """Estimated steps, seconds and memory (MB, without the program) of a run.

    steps, seconds: None if no step has been made.
    """

    steps: int | None
    seconds: float | None
    memory: float


def run_trial(scene: Scene, nodes: int, advance: bool = True) -> Trial:
    """Make the first state and steps of the scene, or of a coarser one if it has too many nodes.

    advance: make steps? Raises SimulationError if a stage fails.
    """
    if nodes > MOST_NODES:
        size = scene.numerics.refinement * math.sqrt(MOST_NODES / nodes)
        scene = replace(scene, numerics=replace(scene.numerics, refinement=size))
    if scene.growth:
        end = min(scene.growth.end, FIRST_STEPS * scene.growth.time_step) if advance else 0.0
        scene = replace(scene, growth=replace(scene.growth, end=end),
                        output=replace(scene.output, times=(end,), every=None))
    clock = [perf_counter()]
    run = iterate_steps(scene)
    first = next(run)[1]
    clock.append(perf_counter())
    worst = 0.0
    with suppress(RunEnd):
        for state, _ in islice(run, MOST_STEPS):
            clock.append(perf_counter())
            poll()
            if exceeds_tolerance(state.step_control, scene.numerics.tolerance):
                worst = max(worst, state.step_control.estimate)
    seconds = [b - a for a, b in zip(clock, clock[1:])]
    step = min(seconds[1:], default=0.0)
    return Trial(first, seconds[0], step, len(first.pore.mesh.points), worst)


def estimate_cost(scene: Scene, trial: Trial, nodes: int, coarse: CoarseRun | None) -> Cost:
    """Estimate the cost of a run from its trial, the nodes of its first mesh, and a coarse run.

    coarse: None if none was made.
    """
    growth = coarse.node_growth if coarse and coarse.steps else None
    memory = expected_bytes(scene, growth) / MB
    if scene.growth and scene.growth.end and not trial.step:
        return Cost(None, None, memory)
    steps, ratio = expect_steps(scene, coarse) if coarse else (0.0, 1.0)
    factor = ratio * (steps + len(rows_within(scene)) / 2) if steps else 0.0
    seconds = (trial.start + factor * trial.step) * (nodes / trial.nodes)**POWER
    return Cost(math.ceil(steps - 1e-9), seconds, memory)


def expect_steps(scene: Scene, coarse: CoarseRun) -> tuple[float, float]:
    """Expected number of steps, and their mean cost over that of the first ones.

    A row within a step costs one of the step's two stages, which is half a step. The time that the
    coarse run did not reach counts like the second half of its steps. Where it has none, steps are
    expected to be as long as growth.time_step and to cost as much as the first ones.
    """
    if not coarse.steps:
        return scene.growth.end / scene.growth.time_step, 1.0
    counts = [_count(scene, coarse.scene, length) for length, _ in coarse.steps]
    costs = [count * seconds for count, (_, seconds) in zip(counts, coarse.steps)]
    half = len(counts) // 2
    covered = sum(length for length, _ in coarse.steps)
    remaining = 0.0 if coarse.ends else scene.growth.end - covered
    share = remaining / sum(length for length, _ in coarse.steps[half:])
    count = sum(counts) + share * sum(counts[half:])
    first = min(seconds for _, seconds in coarse.steps[:FIRST_STEPS])
    return count, (sum(costs) + share * sum(costs[half:])) / (first * count)


def _count(scene: Scene, coarse: Scene, length: float) -> float:
    """Expected number of steps within a step (h) of the coarse run.

    Steps of the midpoint rule scale with the root of the tolerance.
    """
    time_step = scene.growth.time_step
    if not scene.numerics.scheme.controls_error:
        return length / time_step
    finer = math.sqrt(coarse.numerics.tolerance / scene.numerics.tolerance)
    return min(finer, max(1.0, length / (SHORTEST * time_step)))
