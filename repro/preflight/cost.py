"""What a run will cost on this machine: first solves are made and timed, steps are estimated.

    seconds = first state + (steps until contact + IN_CONTACT x steps after it + ROW x rows)
                            x one step x REMESHING

A step of the midpoint rule is at first growth.time_step and doubles up to the length that the
tolerance allows; rows are those within steps. All four factors are those of the packaged scenes:
the estimate is meant to be right within a factor of three there. Memory is that which a run asks
for before it begins.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import islice
from time import perf_counter
from typing import TypeAlias

from repro.errors import RunEnd
from repro.march.loop import Instant, State
from repro.march.pace import missed
from repro.march.simulation import rows_within
from repro.march.simulation import steps as steps_of
from repro.march.stepping import SHORTEST
from repro.preflight import numbers
from repro.preflight.memory import MB, expected_bytes
from repro.scene import Scene, needed

#: What a step leaves.
Made: TypeAlias = tuple[State, Instant | None]

#: A step with what it takes besides the first one: new meshes, and larger ones.
REMESHING = 1.5
#: A step in contact, which is one with many rounds of closing films and a new mesh.
IN_CONTACT = 15.0
#: A row within a step: one equilibrium and one solution of flow and substrates of a step's two.
ROW = 0.5
#: The length of a midpoint step that tolerance 0.01 allows, times the growth rate; it goes as the
#: tolerance's root.
ALLOWED = 0.5
#: The first steps are taken over so many growth.time_step; the first of all is slow, the fastest
#: one counts.
FIRST_STEPS = 3
MOST_STEPS = 9  # where these are shorter
#: Larger meshes are not tried: a coarser one is, and its time grows with the nodes to this power.
MOST_NODES = 5000
POWER = 1.2
COARSER = 0.9


@dataclass(frozen=True)
class Trial:
    """What was made for real: the first state; seconds that it and a step took (0 where there is
    none); nodes of the mesh that was tried; the largest estimate of steps that miss the tolerance,
    0 where none does."""

    first: Instant
    start: float
    step: float
    nodes: int
    worst: float = 0.0


@dataclass(frozen=True)
class Cost:
    """Steps, seconds and memory (MB, besides that of the program) of a run, estimated."""

    steps: int
    seconds: float
    memory: float


def tried(scene: Scene, nodes: int) -> Trial:
    """First state and first steps of the scene, or of a coarser one where it has too many nodes.

    Raises SimulationError where a stage fails in them.
    """
    if nodes > MOST_NODES:
        size = scene.numerics.refinement * COARSER * math.sqrt(MOST_NODES / nodes)
        scene = replace(scene, numerics=replace(scene.numerics, refinement=size))
    if scene.growth:
        end = min(scene.growth.end, FIRST_STEPS * scene.growth.time_step)
        scene = replace(scene, growth=replace(scene.growth, end=end),
                        output=replace(scene.output, times=(end,)))
    clock = [perf_counter()]
    run = _until_the_end(steps_of(scene))
    first = needed(next(run)[1], "the first row")
    clock.append(perf_counter())
    worst = 0.0
    for state, _ in islice(run, MOST_STEPS):
        clock.append(perf_counter())
        if missed(state.pace, scene.numerics.tolerance):
            worst = max(worst, state.pace.estimate)
    spent = [b - a for a, b in zip(clock, clock[1:])]
    return Trial(first, spent[0], min(spent[1:], default=0.0), len(first.pore.mesh.points), worst)


def _until_the_end(run: Iterator[Made]) -> Iterator[Made]:
    """The steps of a run, which the model itself may end."""
    try:
        yield from run
    except RunEnd:
        return


def expected(scene: Scene, trial: Trial, nodes: int) -> Cost:
    """Of the whole run, from its trial and the nodes of its first mesh."""
    free, touching = steps(scene)
    larger = nodes / trial.nodes
    factor = (free + IN_CONTACT * touching + ROW * len(rows_within(scene))) * REMESHING
    seconds = (trial.start + factor * trial.step) * larger**POWER
    return Cost(free + touching, seconds, expected_bytes(scene) / MB)


def steps(scene: Scene) -> tuple[int, int]:
    """Steps before and after the aggregate is expected to touch the opposite wall."""
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
    """The longest step (h) that is expected."""
    if scene.numerics.time == "updates":
        return scene.growth.time_step
    rate = abs(numbers.fastest_growth(scene.largest))
    allowed = ALLOWED * math.sqrt(scene.numerics.tolerance / 0.01)
    kept = max(allowed / rate, SHORTEST * scene.growth.time_step) if rate else math.inf
    return min(scene.growth.end, kept)


def _count(first: float, longest: float, duration: float) -> int:
    """Steps in a duration (h): each twice the one before, until they are the longest."""
    ramp = math.ceil(math.log2(longest / first))
    covered = first * (2**ramp - 1)
    if covered >= duration:
        return math.ceil(math.log2(duration / first + 1) - 1e-9)
    return ramp + math.ceil((duration - covered) / longest - 1e-9)
