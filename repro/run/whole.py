"""Is a run that says it is over all there? For whoever would rather not make it again."""

from __future__ import annotations

import math
from pathlib import Path

from repro.march.loop import SAME_TIME
from repro.report.reading import NoRun, Run, read, require_columns
from repro.run.status import COMPLETED, done, run_end, undone
from repro.scene import Scene, scene_hash


def there(folder: Path, scene: Scene) -> Run:
    """The run of a scene in a folder, over or not. Raises NoRun, with what is wrong, where there is
    none, or one of another scene, or its tables lack what it says it has written."""
    run = read(folder)
    status = str(run.record.get("status"))
    if run.record.get("hash") != scene_hash(scene) or not (done(status) or undone(status)):
        raise NoRun(f"{folder}: run.json tells of a run of another scene, or has no status")
    require_columns(run)
    return run


def lacking(folder: Path, scene: Scene) -> str:
    """What a folder lacks of a scene's run that is over and all there; empty where nothing."""
    try:
        run = there(folder, scene)
    except NoRun as error:
        return str(error)
    status = run.record["status"]
    if not done(status):
        return f"{folder}: the run is not over: {status}"
    last = run.times[-1] if len(run.times) else math.nan
    if not _is_end(last, status, scene):
        return (f"{folder}: run.json says {status!r}, but the last row of timeseries.csv is of "
                f"t = {last:g} h")
    return ""


def _is_end(time: float, status: str, scene: Scene) -> bool:
    """Is the last row (h) of a run with this status there?"""
    if status != COMPLETED:
        return math.isclose(time, run_end(status), rel_tol=1e-5, abs_tol=SAME_TIME)  # six digits
    if scene.growth is None:
        return time == 0.0
    end = scene.growth.end if scene.output.times is None else (0.0, *scene.output.times)[-1]
    return abs(time - end) <= 2 * SAME_TIME
