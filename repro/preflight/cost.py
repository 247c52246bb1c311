"""Estimate the cost of a run on this machine: time the first solves, and estimate the steps.

    seconds = first state + (steps until contact + IN_CONTACT x steps after it + ROW x rows)
                            x one step x REMESHING

The first step of the midpoint rule is growth.time_step; it doubles up to the length that the
tolerance allows. Only rows within steps count. The factors are fitted to the packaged scenes, where
the estimate is right within a factor of three. The estimated memory is the amount that must be free
when a run begins.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import islice
from time import perf_counter
from typing import TypeAlias

from repro.errors import RunEnd
from repro.march.simulation import rows_within
from repro.march.simulation import steps as iterate_steps
from repro.march.state import Report, RestartState
from repro.march.step_control import SHORTEST, exceeds_tolerance
from repro.polling import poll
from repro.preflight import numbers
from repro.preflight.memory import MB, expected_bytes
from repro.scene import Scene, needed

#: The state after a step and, if the step is reported, its row.
ReportedStep: TypeAlias = tuple[RestartState, Report | None]

#: Cost of a later step over the first one: new meshes, and larger ones.
REMESHING = 1.5
#: Cost of a step in contact, whose contact lines move and whose stages both have new meshes.
IN_CONTACT = 4.0
#: Cost of a row within a step: one of the step's two equilibria and solutions.
ROW = 0.5
#: Length of a midpoint step at tolerance 0.01, times the growth rate; it scales with the root of
#: the tolerance.
ALLOWED = 0.5
#: Length of the trial over growth.time_step. Its first step is slow; the fastest one counts.
FIRST_STEPS = 3
MOST_STEPS = 9  # of the trial, if its steps are shorter
#: The trial replaces a larger mesh by a coarser one. Time grows with the nodes to this power.
MOST_NODES = 5000
POWER = 1.2
COARSER = 0.9


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
    """Estimated steps, seconds and memory (MB, without the program) of a run."""

    steps: int
    seconds: float
    memory: float


def run_trial(scene: Scene, nodes: int) -> Trial:
    """Make the first state and steps of the scene, or of a coarser one if it has too many nodes.

    Raises SimulationError if a stage fails.
    """
    if nodes > MOST_NODES:
        size = scene.numerics.refinement * COARSER * math.sqrt(MOST_NODES / nodes)
        scene = replace(scene, numerics=replace(scene.numerics, refinement=size))
    if scene.growth:
        end = min(scene.growth.end, FIRST_STEPS * scene.growth.time_step)
        scene = replace(scene, growth=replace(scene.growth, end=end),
                        output=replace(scene.output, times=(end,), every=None))
    clock = [perf_counter()]
    run = _until_the_end(iterate_steps(scene))
    first = needed(next(run)[1], "the first row")
    clock.append(perf_counter())
    worst = 0.0
    for state, _ in islice(run, MOST_STEPS):
        clock.append(perf_counter())
        poll()
        if exceeds_tolerance(state.step_control, scene.numerics.tolerance):
            worst = max(worst, state.step_control.estimate)
    seconds = [b - a for a, b in zip(clock, clock[1:])]
    step = min(seconds[1:], default=0.0)
    return Trial(first, seconds[0], step, len(first.pore.mesh.points), worst)


def _until_the_end(run: Iterator[ReportedStep]) -> Iterator[ReportedStep]:
    """Yield the steps of a run until the scene or the model ends."""
    try:
        yield from run
    except RunEnd:
        return


def estimate_cost(scene: Scene, trial: Trial, nodes: int) -> Cost:
    """Estimate the cost of a run from its trial and the nodes of its first mesh."""
    free, touching = steps(scene)
    node_ratio = nodes / trial.nodes
    factor = (free + IN_CONTACT * touching + ROW * len(rows_within(scene))) * REMESHING
    seconds = (trial.start + factor * trial.step) * node_ratio**POWER
    return Cost(free + touching, seconds, expected_bytes(scene) / MB)


def steps(scene: Scene) -> tuple[int, int]:
    """Number of steps before and after the expected contact with the opposite wall."""
    if scene.growth is None or scene.growth.end == 0:
        return 0, 0
    end = scene.growth.end
    contact = numbers.at_end(scene.largest).contact
    free = end if contact is None else min(contact, end)
    longest = longest_step(scene)
    total = _count(min(scene.growth.time_step, longest), longest, end)
    touching = min(total, math.ceil((end - free) / longest - 1e-9))
    return total - touching, touching


def longest_step(scene: Scene) -> float:
    """The longest expected step (h)."""
    if not scene.numerics.scheme.controls_error:
        return scene.growth.time_step
    rate = abs(numbers.fastest_growth(scene.largest))
    allowed = ALLOWED * math.sqrt(scene.numerics.tolerance / 0.01)
    allowed_length = max(allowed / rate, SHORTEST * scene.growth.time_step) if rate else math.inf
    return min(scene.growth.end, allowed_length)


def _count(first: float, longest: float, duration: float) -> int:
    """Number of steps in a duration (h) if each doubles until the longest is reached."""
    ramp = math.ceil(math.log2(longest / first))
    covered = first * (2**ramp - 1)
    if covered >= duration:
        return math.ceil(math.log2(duration / first + 1) - 1e-9)
    return ramp + math.ceil((duration - covered) / longest - 1e-9)
