"""Run a scene in the way that its ``numerics.time`` names."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np

from repro.fem.linear import Method
from repro.march import stepping, updates
from repro.march.loop import Instant, State
from repro.scene import Scene, Source, load_scene, parse_scene, scene_tables

#: Points (x, y), um.
Shape = Sequence[tuple[float, float]] | np.ndarray

#: Ways to make steps, by the names that scenes have for them.
WAYS = {"updates": updates.steps, "midpoint": stepping.steps}


def simulate(scene: Source, shape: Shape | None = None,
             state: State | None = None) -> Iterator[Instant]:
    """Yields an Instant at t = 0 and at each reported time: ``output.times``, or after every step.

    scene: one that was loaded, or a file, a packaged name, a dict of tables; shape: the
    aggregate's boundary at t = 0, (x, y) um from its upstream to its downstream end on the lower
    wall, in place of the scene's (see ``aggregate.outline``); state: one of :func:`steps`, after
    which to go on. Raises SceneError where scene or shape are not accepted, SimulationError where a
    stage fails, and PoreEnd, after a last Instant, where the aggregate reaches an end of the pore.
    """
    scene = load_scene(scene)
    if shape is not None:
        scene = shaped(scene, shape)
    return (instant for _, instant in steps(scene, state) if instant)


def shaped(scene: Scene, shape: Shape) -> Scene:
    """The scene with another boundary of the aggregate at t = 0, checked as one in its file."""
    tables = scene_tables(scene)
    seed = dict(tables.get("aggregate", {}))
    for key in ("radius", "position"):
        seed.pop(key, None)
    seed["outline"] = [[f"{float(x)!r} um", f"{float(y)!r} um"] for x, y in shape]
    return parse_scene({**tables, "aggregate": seed}, scene.name, f"{scene.name} with a shape")


def ends_soon(scene: Scene, state: State) -> bool:
    """May the step after a state be another one where growth.end is later? A step is cut short, or
    left room for one more, where less than twice its length is left."""
    end = scene.growth.end if scene.growth else math.inf
    return 2 * state.pace.length > end - state.pore.time


def same_rows(one: Scene, other: Scene, time: float) -> bool:
    """Have runs of two scenes the same rows up to a time (h)?"""
    first, second = ([row for row in _rows(scene) if row <= time] for scene in (one, other))
    return first == second


def _rows(scene: Scene) -> Sequence[float]:
    """Times (h) of rows beside the ends of steps."""
    if scene.output.times is not None:
        return scene.output.times
    return stepping.rows(scene) if scene.numerics.time == "midpoint" else ()


def steps(scene: Scene, state: State | None = None) -> Iterator[tuple[State, Instant | None]]:
    """Every step, t = 0 first: the state from which a run goes on bit for bit, and the Instant if
    one is due."""
    Method(scene.numerics.solver, scene.numerics.ordering).checked()
    return WAYS[scene.numerics.time](scene, state)
