"""Run a scene in the way that its ``numerics.time`` names."""

from __future__ import annotations

from collections.abc import Iterator

from repro.fem.linear import Method
from repro.march import stepping, updates
from repro.march.loop import Instant, State
from repro.scene import Scene

#: Ways to make steps, by the names that scenes have for them.
WAYS = {"updates": updates.steps, "midpoint": stepping.steps}


def simulate(scene: Scene, state: State | None = None) -> Iterator[Instant]:
    """Yields an Instant at t = 0 and at each of ``output.times``, or after every step.

    state: one of :func:`steps`, after which to go on. Raises SimulationError where a stage fails,
    and PoreEnd, after a last Instant, where the aggregate reaches an end of the pore.
    """
    return (instant for _, instant in steps(scene, state) if instant)


def steps(scene: Scene, state: State | None = None) -> Iterator[tuple[State, Instant | None]]:
    """Every step, t = 0 first: the state from which a run goes on bit for bit, and the Instant if
    one is due."""
    Method(scene.numerics.solver, scene.numerics.ordering).checked()
    return WAYS[scene.numerics.time](scene, state)
