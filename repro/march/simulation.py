"""Run a scene in the way that its ``numerics.time`` names."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np

from repro.fem.linear import Method
from repro.march import loop, stepping, updates
from repro.march.loop import Instant, Scheme, State
from repro.march.pace import STRETCH
from repro.scene import Scene, Source, load_scene, parse_scene, scene_tables

#: Points (x, y), um.
Shape = Sequence[tuple[float, float]] | np.ndarray

#: Ways to make steps, by the names that scenes have for them.
SCHEMES = {"updates": updates.SCHEME, "midpoint": stepping.SCHEME}


def simulate(scene: Source, shape: Shape | None = None,
             state: State | None = None) -> Iterator[Instant]:
    """Yields an Instant at t = 0 and at each reported time: ``output.times``, or after every step.

    scene: one that was loaded, or a file, a packaged name, a dict of tables; shape: the
    aggregate's boundary at t = 0, (x, y) um from its upstream to its downstream end on the lower
    wall, in place of the scene's (see ``aggregate.outline``); state: one of :func:`steps`, after
    which to go on. Raises SceneError where scene or shape are not accepted, SimulationError where a
    stage fails, and, after a last Instant, PoreEnd where the aggregate reaches an end of the pore,
    Fold where its surface folds.
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
    """May the step after a state be another one where growth.end is later? One that passes it is
    cut there; it may be STRETCH times as long as its pace says."""
    end = scene.growth.end if scene.growth else math.inf
    return STRETCH * state.pace.length > end - state.pore.time


def same_rows(one: Scene, other: Scene, time: float) -> bool:
    """Have runs of two scenes the same rows up to a time (h)?"""
    first = [row for row in row_times(one) if row <= time]
    return first == [row for row in row_times(other) if row <= time]


def row_times(scene: Scene) -> tuple[float, ...]:
    """Times (h) of rows after t = 0, ascending: :func:`repro.march.loop.row_times`."""
    return loop.row_times(scene, _scheme(scene))


def rows_within(scene: Scene) -> set[float]:
    """Times (h) of rows that may lie within steps, not at an end that is known beforehand."""
    return set(row_times(scene)) - {0.0, *_scheme(scene).ends(scene)}


def _scheme(scene: Scene) -> Scheme:
    return SCHEMES[scene.numerics.time]


def steps(scene: Scene, state: State | None = None) -> Iterator[tuple[State, Instant | None]]:
    """Every step, t = 0 first: the state from which a run goes on bit for bit, and the Instant if
    one is due."""
    Method(scene.numerics.solver, scene.numerics.ordering).checked()
    return loop.steps(scene, _scheme(scene), state)
