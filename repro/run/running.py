"""Run a scene into a folder, or go on with a run there: rows and fields as they come, and nothing lost on the way."""

from __future__ import annotations

import json
import warnings
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter

from repro import results, timing
from repro.errors import CheckpointError, Interrupted, OutputError, SimulationError
from repro.march.loop import PoreEnd
from repro.march.simulation import steps
from repro.run import checkpoint
from repro.run.folder import clear, held, prepare, tidy, usable
from repro.run.machine import conditions, differences
from repro.run.recorder import CHECKPOINTS, Recorder, interrupted, settle
from repro.run.status import done, undone
from repro.scene import Scene, parse_scene, scene_hash

__all__ = ["OutputError", "Recorder", "Watch", "prepare", "resume", "run"]

#: Seconds of wall time between checkpoints.
INTERVAL = 60.0


def untold(event: dict) -> None:
    """What is done with events where nobody asks for them: warnings are given, the others dropped."""
    if event["event"] == "warning":
        warnings.warn(event["message"], stacklevel=2)


@dataclass(frozen=True)
class Watch:
    """Who is told what happens, how often the state is written (s of wall time), and who says when to stop, by a
    signal's number."""

    tell: Callable[[dict], None] = untold
    interval: float = INTERVAL
    stop: Callable[[], int] = lambda: 0


ALONE = Watch()


def run(scene: Scene, folder: Path, progress: Callable[[float], None] = lambda time: None, watch: Watch = ALONE) -> str:
    """Run a scene into a folder; ``progress`` is told each simulated time (h). Returns how the run ended.

    Raises OutputError where the folder cannot be used or another run uses it, SimulationError where a stage fails, and
    Interrupted where ``watch.stop`` asks for it: what was computed until then is written all the same, ``run.json``
    says why it ends, and :func:`resume` goes on from there.
    """
    with held(folder):
        prepare(folder)
        timing.reset()
        return _from_the_start(Recorder(scene, folder), progress, watch)


def resume(folder: Path, progress: Callable[[float], None] = lambda time: None, watch: Watch = ALONE) -> str:
    """Go on with a run that was interrupted, killed or has failed, and give bit for bit what it would have given.

    Returns how the run ended, at once where it had ended before. Where versions have changed, or a checkpoint cannot be
    used, a warning says so. Raises as :func:`run`, and OutputError where there is no run.
    """
    if not (folder / "run.json").is_file():
        raise OutputError(f"--resume {folder}: there is no run.json; the folder of a run is needed")
    with held(folder):
        told, scene = _told(folder / "run.json")
        if done(told["status"]):
            if any((folder / name).exists() for name in CHECKPOINTS):  # it was killed at its very end
                settle(folder, over=True)
            watch.tell({"event": "end", "scene": scene.name, "status": told["status"], "folder": str(folder),
                        "changed": False})
            return told["status"]
        timing.reset()
        recorder = Recorder(scene, folder)
        changed = _changed(told, recorder, watch)
        with usable(folder):
            tidy(folder)
            restored = _restored(recorder, watch)
        recorder.record.resumes.append({"time_h": recorder.time, "changed": changed})
        return (_recorded if restored else _from_the_start)(recorder, progress, watch)


def _told(path: Path) -> tuple[dict, Scene]:
    """What ``run.json`` says, and its scene. Raises OutputError or SceneError where it is none."""
    try:
        told = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError) as error:
        raise OutputError(f"{path}: cannot be read ({error}); the run.json of a run is needed") from None
    wanted = {"scene": str, "hash": str, "tables": dict, "status": str}
    if not isinstance(told, dict) or not all(isinstance(told.get(key), kind) for key, kind in wanted.items()):
        raise OutputError(f"{path}: it has no scene or no status; the run.json of a run is needed")
    if not (done(told["status"]) or undone(told["status"])):
        raise OutputError(f"{path}: its status {told['status']!r} is none that a run writes")
    scene = parse_scene(told["tables"], told["scene"], str(path))
    if scene_hash(scene) != told["hash"]:
        raise OutputError(f"{path}: its scene is not the one that was run: the hash {told['hash']!r} is of another")
    return told, scene


def _changed(told: dict, recorder: Recorder, watch: Watch) -> dict[str, list]:
    """What has changed since the run began that could change its numbers; a warning where anything has."""
    keys = ("versions", "conditions")
    before = {key: told[key] if isinstance(told.get(key), dict) else {} for key in keys}
    after = {"versions": results.provenance(recorder.scene)["versions"], "conditions": conditions()}
    found = {key: pair for key, pair in differences(before, after).items() if not key.startswith("conditions.threads")}
    if found:
        names = ", ".join(f"{key} ({one} before, now {two})" for key, (one, two) in found.items())
        watch.tell({"event": "warning", "message": f"{recorder.folder}: not as it was when the run began: {names}; the "
                    "result need not be that of an uninterrupted run to the last bit"})
    return found


def _restored(recorder: Recorder, watch: Watch) -> bool:
    """Has the recorder its state from a checkpoint? Those that are refused are told."""
    for name in (checkpoint.NEWEST, checkpoint.PREVIOUS):
        path = recorder.folder / name
        if path.exists():
            try:
                recorder.restore(path)
                return True
            except CheckpointError as error:
                watch.tell({"event": "warning", "message": f"{path}: refused: {error}"})
                path.replace(recorder.folder / checkpoint.REFUSED)
    watch.tell({"event": "warning", "message": f"{recorder.folder}: no checkpoint to go on from; it starts again from "
                "t = 0"})
    return False


def _from_the_start(recorder: Recorder, progress: Callable[[float], None], watch: Watch) -> str:
    recorder.tell("running")
    clear(recorder.folder)
    return _recorded(recorder, progress, watch)


def _recorded(recorder: Recorder, progress: Callable[[float], None], watch: Watch) -> str:
    """Run to the end, whatever it is, and write that; how the run ended."""
    watch.tell({"event": "start", "scene": recorder.scene.name, "folder": str(recorder.folder),
                "from_h": recorder.time, "end_h": recorder.end, "step": recorder.steps})
    try:
        status = _simulated(recorder, progress, watch)
    except SimulationError as error:
        told = SimulationError(f"{error}; {recorder.last_good()}")
        _end(recorder, f"failed: {told}", watch)
        raise told from error
    except (KeyboardInterrupt, Interrupted):
        _end(recorder, "interrupted", watch)
        raise
    except BaseException as error:
        with suppress(OutputError):  # the first trouble is the one to tell
            _end(recorder, f"failed: {error}", watch)
        raise
    return _end(recorder, status, watch)


def _end(recorder: Recorder, status: str, watch: Watch) -> str:
    recorder.finish(status)
    watch.tell({"event": "end", "scene": recorder.scene.name, "status": status, "folder": str(recorder.folder),
                "time_h": recorder.time, "step": recorder.steps, "rows": len(recorder.record.rows), "changed": True})
    return status


def _simulated(recorder: Recorder, progress: Callable[[float], None], watch: Watch) -> str:
    """Record every step of a run, from the recorder's state on; how it ended."""
    written = perf_counter()
    try:
        for state, instant in steps(recorder.scene, recorder.state):
            remeshes, contact = recorder.remeshes, recorder.contact
            recorder.add(state, instant)
            _tell_step(recorder, recorder.remeshes > remeshes, recorder.contact > contact, watch)
            progress(recorder.time)
            if number := watch.stop():
                raise interrupted(recorder, number)
            if perf_counter() - written >= watch.interval:
                _checkpoint(recorder, watch)
                written = perf_counter()
    except PoreEnd as end:
        return str(end)
    except MemoryError as error:
        raise SimulationError(f"stopped at t = {recorder.time:g} h, out of memory while results are written ({error}); "
                              "try a smaller numerics.refinement") from error
    return "completed"


def _tell_step(recorder: Recorder, remeshed: bool, contact: bool, watch: Watch) -> None:
    """A step as events."""
    now = {"time_h": recorder.time, "end_h": recorder.end, "step": recorder.steps, "remeshes": recorder.remeshes,
           "contact": recorder.contact}
    watch.tell({"event": "step", **now})
    for event, happened in (("remesh", remeshed), ("contact", contact)):
        if happened:
            watch.tell({"event": event, **now})


def _checkpoint(recorder: Recorder, watch: Watch) -> None:
    start = perf_counter()
    recorder.save("running")
    watch.tell({"event": "checkpoint", "time_h": recorder.time, "file": str(recorder.folder / checkpoint.NEWEST),
                "seconds": perf_counter() - start})
