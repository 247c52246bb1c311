"""Run a scene with its scheme."""

from __future__ import annotations

import math
import warnings
from collections.abc import Iterator, Sequence
from contextlib import suppress
from typing import TYPE_CHECKING

import numpy as np

from repro.errors import RunEnd
from repro.fem.linear import Method
from repro.march.state import (
    SAME_TIME,
    Report,
    RestartState,
    contiguous,
    initial_report,
    stopping,
)
from repro.march.step_control import STRETCH, StepControl
from repro.model.grading import solve_graded
from repro.model.meshing import seeded
from repro.scene import Scene, SceneError, Source, load_scene, parse_scene, scene_tables
from repro.scene.arguments import Overrides, typed
from repro.schemes import Scheme

if TYPE_CHECKING:
    from repro.march.loop import Stepping

#: Points (x, y), um.
Shape = Sequence[tuple[float, float]] | np.ndarray


@typed
def simulate(scene: Source, overrides: Overrides = (), *, unset: Sequence[str] = (),
             scheme: Scheme | None = None, shape: Shape | None = None,
             state: RestartState | None = None) -> Iterator[Report]:
    """Simulate a scene, and yield a Report at t = 0 and at each reported time.

    Reported times are ``output.times``, or the ends of all steps. A Report has the attributes
    ``pore``, ``solved`` (flow and substrates), ``ledgers`` (mass balances) and counts, in um, h,
    mg/L.

    Parameters
    ----------
    scene : Scene, str, Path or dict
        A loaded scene, the name of a packaged scene, a TOML file, or a dict of tables.
    overrides : sequence of str or dict, optional
        Changes of the scene, as for :func:`repro.load_scene`.
    unset : sequence of str, optional
        Keys or sections of the scene to leave out.
    scheme : repro.schemes.Scheme, optional
        Scheme in place of the preset's, for example ``replace(PAPER, carrier="u")``.
    shape : (K, 2) sequence of float, optional
        Boundary of the aggregate at t = 0, points (x, y) in um from the upstream to the downstream
        end on its wall. It replaces the shape of the only aggregate (see ``aggregate.outline``).
    state : RestartState, optional
        State of :func:`steps` after which the simulation continues; t = 0 by default.

    Returns
    -------
    iterator of Report
        The simulation advances as the reports are read.

    Raises
    ------
    SceneError
        If the scene or the shape is not accepted.
    SimulationError
        If a stage fails. The message names the time, the stage, the reason and a remedy.
    PoreEnd
        After the last Report, if the aggregate reaches an end of the pore.
    Fold
        After the last Report, if the surface of the aggregate folds.
    Detachment
        After the last Report, if a wall must bear more than ``growth.bonding_strength``, or the
        aggregate more than ``growth.tensile_strength``, or if the aggregate is eroded.
    Steady
        After the last Report, if the aggregates are steady and ``growth.until = "steady"``.

    Examples
    --------
    >>> import repro
    >>> changes = ['growth.end="1 h"', 'output.times=["0 h", "1 h"]']
    >>> [report.pore.time for report in repro.simulate("base", changes)]
    [0.0, 1.0]
    """
    scene = load_scene(scene, overrides, unset=unset, scheme=scheme)
    if shape is not None:
        scene = shaped(scene, shape)
    return reports(steps(scene, state))


def reports(states: Iterator[tuple[RestartState, Report | None]]) -> Iterator[Report]:
    """Yield the reports, and warn of each row that cannot be computed."""
    for state, report in states:
        if state.missing:
            time, reason = state.missing
            warnings.warn(f"there is no row at t = {time:g} h, since its state cannot be computed: "
                          f"{reason}", stacklevel=3)
        if report:
            yield report


def report_at(scene: Scene, state: RestartState | None, time: float) -> Report:
    """Return the Report of a row at a time (h), from an earlier state of the run or from t = 0.

    Steps do not depend on rows, so the original run would have the same row. Raises KeyError if the
    state at this time cannot be computed.
    """
    reason = "the run ends before"
    with suppress(RunEnd):
        for after, report in steps(scene.reporting(time), state):
            if after.missing:
                reason = after.missing[1]
                break
            if report and abs(report.pore.time - time) <= SAME_TIME:
                return report
    raise KeyError(f"{time:g} h: the state cannot be computed: {reason}")


def shaped(scene: Scene, shape: Shape) -> Scene:
    """Replace the boundary of the aggregate at t = 0, and check the scene like a scene file."""
    tables = scene_tables(scene)
    if len(scene.aggregates) > 1:
        raise SceneError(f"{scene.name} with a shape: one aggregate at most is needed, and the "
                         f"scene has {', '.join(scene.aggregate_keys)}")
    seed = dict(tables.get("aggregate", {}))
    for key in ("radius", "position"):
        seed.pop(key, None)
    seed["outline"] = [[f"{float(x)!r} um", f"{float(y)!r} um"] for x, y in shape]
    return parse_scene({**tables, "aggregate": seed}, scene.name, f"{scene.name} with a shape",
                       scheme=scene.numerics.exchanged)


def ends_soon(scene: Scene, state: RestartState) -> bool:
    """Return whether the next step depends on growth.end, because it may be cut there.

    A step may be up to STRETCH times as long as its step control proposes.
    """
    end = scene.growth.end if scene.growth else math.inf
    return STRETCH * state.step_control.length > end - state.pore.time


def same_rows(one: Scene, other: Scene, time: float) -> bool:
    """Return whether runs of two scenes have the same rows up to a time (h)."""
    first = [row for row in row_times(one) if row <= time]
    return first == [row for row in row_times(other) if row <= time]


def row_times(scene: Scene) -> tuple[float, ...]:
    """Return the times (h) of rows after t = 0: :func:`repro.march.loop.row_times`."""
    if scene.growth is None:
        return ()
    from repro.march import loop
    return loop.row_times(_stepping(scene), scene)


def rows_within(scene: Scene) -> set[float]:
    """Return the times (h) of rows that may lie within a step, and not at its end."""
    if scene.growth is None:
        return set()
    return set(row_times(scene)) - {0.0, *_stepping(scene).ends(scene)}


def _stepping(scene: Scene) -> Stepping:
    """Return the time stepping of a scene's scheme."""
    if scene.numerics.scheme.controls_error:
        from repro.march import stepping
        return stepping.STEPPING
    from repro.march import updates
    return updates.STEPPING


def steps(scene: Scene,
          state: RestartState | None = None) -> Iterator[tuple[RestartState, Report | None]]:
    """Yield the state after every step, t = 0 first, with a Report if one is due.

    A run restarts from any of these states bit for bit.
    """
    Method(scene.numerics.solver).checked()
    if scene.growth is None:
        return _at_rest(scene, state)
    from repro.march import loop  # a scene without growth does not load the loop
    return loop.steps(scene, _stepping(scene), state)


def _at_rest(scene: Scene,
             state: RestartState | None) -> Iterator[tuple[RestartState, Report | None]]:
    """Yield the state at t = 0 of a scene without growth, unless ``state`` is that state."""
    if state is None:
        with stopping(0.0):
            pore, solved = solve_graded(scene, contiguous(seeded(scene)))
            state = RestartState(contiguous(pore), StepControl(0.0))
        yield state, initial_report(state, solved)
