"""Run a scene into a folder, or go on with a run there.

Rows and fields are written as they come, and nothing is lost on the way.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass
from itertools import chain
from pathlib import Path
from time import perf_counter

from repro import results, timing
from repro.errors import CheckpointError, Interrupted, OutputError, RunEnd, SimulationError
from repro.march.loop import Instant, State
from repro.march.simulation import ends_soon, same_rows, steps
from repro.preflight import simplifications
from repro.preflight.memory import require_memory, require_outline
from repro.preflight.numbers import judged
from repro.preflight.resolved import unresolved
from repro.preflight.simplifications import Warned
from repro.results.files import is_file, read_json, read_sealed
from repro.runs import INTERVAL, checkpoint
from repro.runs.folder import (
    CHECKPOINTS,
    PROVENANCE,
    REPORT,
    listed,
    locked,
    prepare,
    refuse_links,
    refuse_others,
    tidy,
    usable,
)
from repro.runs.machine import conditions, differences, require_packages
from repro.runs.recorder import Recorder, interrupted, settle
from repro.runs.status import COMPLETED, FAILED, INTERRUPTED, RUNNING, done, undone
from repro.runs.whole import damage
from repro.scene import (
    KEYS,
    Scene,
    SceneError,
    Source,
    load_scene,
    parse_scene,
    scene_hash,
    scene_tables,
)
from repro.scene.files import key_of, override

__all__ = ["OutputError", "Recorder", "Watch", "prepare", "resume", "run"]

#: Steps as they are made, with what is reported of them.
Made = Iterator[tuple[State, Instant | None]]
#: Of what differs so many keys are told.
MOST_SHOWN = 4
#: What a folder of results needs, and what to do without.
LISTED = ("it lists which files there a run has written, without which nothing is overwritten or "
          "removed, by --force neither: move the folder away, or name another")
#: What alone can be changed of a run that has begun.
END = "growth.end"

Progress = Callable[[float], None]


def untold(event: dict) -> None:
    """What is done with events where nobody asks for them: warnings are given, others dropped.

    Those of the scene's simplifications, which have its key, are left to ``run.json``.
    """
    if event["event"] == "warning" and "key" not in event:
        warnings.warn(event["message"], stacklevel=2)


def unwatched(time: float) -> None:
    """What is done with simulated times where nobody asks for them."""


@dataclass(frozen=True)
class Watch:
    """Who is told what happens, how often the state is written (s of wall time), who says when to
    stop, by a signal's number, and how long (s) to wait for another process to leave the folder."""

    tell: Callable[[dict], None] = untold
    interval: float = INTERVAL
    stop: Callable[[], int] = lambda: 0
    patience: float = 0.0

    def warn(self, message: str) -> None:
        """Tell a warning."""
        self.tell({"event": "warning", "message": message})


ALONE = Watch()


def run(scene: Source, folder: str | Path, progress: Progress = unwatched, watch: Watch = ALONE, *,
        force: bool = False, origin: dict | None = None) -> str:
    """Run a scene (loaded, a file, a packaged name or a dict of tables) into a folder.

    ``progress`` is told each simulated time (h).

    A run of the same scene, source and versions that is there is gone on with, or left alone where
    it is over; with ``force`` the files of whatever run is there are removed first. origin: the
    ``file`` of the scene and what was ``set`` and ``unset`` in it, for ``run.json``.

    Returns how the run ended. Raises SceneError where the machine lacks a package or the memory
    that the scene takes, OutputError where the folder holds anything else, cannot be used or
    another run uses it, SimulationError where a stage fails, and Interrupted where ``watch.stop``
    asks for it: what was computed until then is written all the same, ``run.json`` says why it
    ends, and :func:`resume` goes on from there.
    """
    scene = load_scene(scene)
    folder = Path(folder)
    _require(scene, watch)
    with locked(folder, watch.patience):
        recorder = Recorder(scene, folder, origin=origin)
        if not is_file(folder / PROVENANCE):
            prepare(folder)
            return _from_the_start(recorder, progress, watch)
        told = _told(folder / PROVENANCE, read_json if force else read_sealed, LISTED)
        recorder.own = listed(folder, told)
        refuse_links(folder, recorder.own)
        if force:
            refuse_others(folder, recorder.own)
            return _from_the_start(recorder, progress, watch)
        _refuse_another(recorder, told)
        prepare(folder, recorder.own)
        return _continued(recorder, told, progress, watch)


def _require(scene: Scene, watch: Watch) -> None:
    """Raises SceneError where the machine lacks a package or the memory that a scene takes, or
    where the spline of its outline crosses itself or leaves the pore."""
    require_packages(scene)
    require_outline(scene)
    require_memory(scene, watch.warn)


def _refuse_another(recorder: Recorder, told: dict) -> None:
    """Raises OutputError, with what differs, where this is not what the run there was begun with.
    """
    now = results.provenance(recorder.scene) | {"source": recorder.conditions["source"]}
    there = told | {"source": _table(told, "conditions").get("source")}
    keys = ("source", "versions") if there["hash"] == now["hash"] else ("tables",)
    differing = differences({key: there.get(key) for key in keys},
                            {key: now.get(key) for key in keys})
    if differing:
        longer = " (--resume makes a run longer)" if list(differing) == [f"tables.{END}"] else ""
        raise OutputError(
            f"--out {recorder.folder}: the run there is another one: {_shown(differing)}; a new "
            f"folder is needed{longer}, or --force, which removes the files of that run")


def _shown(differing: dict[str, list]) -> str:
    """What differs, for people to read: the first keys with both values, and how many more."""
    pairs = [f"{key.removeprefix('tables.')} ({_value(one)} there, now {_value(two)})"
             for key, (one, two) in differing.items()]
    more = f" and {len(pairs) - MOST_SHOWN} more" if len(pairs) > MOST_SHOWN else ""
    return ", ".join(pairs[:MOST_SHOWN]) + more


def _value(value: object) -> str:
    if isinstance(value, dict):
        return "a section"
    return "not set" if value is None else str(value)


def _table(told: dict, key: str) -> dict:
    return told[key] if isinstance(told.get(key), dict) else {}


def resume(folder: str | Path, progress: Progress = unwatched, watch: Watch = ALONE, *,
           overrides: Sequence[str] = ()) -> str:
    """Go on with a run that was interrupted, killed or has failed, or make a run longer.

    Gives bit for bit what it would have given. Returns how the run ended, at once where it had
    ended before. overrides: of ``growth.end`` alone, to a later time; the run, over or not, then
    becomes what it would be had that been asked for at first. Where versions have changed, or a
    checkpoint cannot be used, a warning says so. Raises as :func:`run`, OutputError where there is
    no run, and SceneError where the end is not a later one.
    """
    folder = Path(folder)
    if not is_file(folder / PROVENANCE):
        raise OutputError(f"--resume {folder}: there is no run.json; the folder of a run is needed")
    with locked(folder, watch.patience):
        told = _told(folder / PROVENANCE, read_sealed, "the run.json of a run is needed")
        own = listed(folder, told)
        refuse_links(folder, own)
        scene = _scene(told, folder / PROVENANCE)
        recorder = Recorder(scene, folder, own, _table(told, "origin"))
        _tell_another_file(recorder, watch)
        later = _later(scene, overrides, str(folder / PROVENANCE))
        if later == scene:
            return _continued(recorder, told, progress, watch)
        return _lengthened(recorder, later, overrides, told, progress, watch)


def _later(scene: Scene, overrides: Sequence[str], file: str) -> Scene:
    """The scene with a later end. Raises SceneError where anything else is asked for."""
    if not overrides:
        return scene
    if scene.growth is None:
        raise SceneError(f"{file}: its scene has no [growth], which alone takes time")
    tables = scene_tables(scene)
    for entry in overrides:
        if key_of(entry) != END:
            raise SceneError(f"{file}: --set {entry}: {END} alone can be changed of a run that has "
                             "begun; a new folder is needed for another scene")
        override(tables, entry, file, KEYS)
    later = parse_scene(tables, scene.name, file, [END])
    if later.growth.end < scene.growth.end:
        raise SceneError(f"{file}: {END} = {later.growth.end:g} h: {scene.growth.end:g} h were "
                         "asked for before; a later time is needed")
    return later


def _lengthened(recorder: Recorder, later: Scene, overrides: Sequence[str], told: dict,
                progress: Progress, watch: Watch) -> str:
    """Make the run that ``run.json`` tells of one of a scene with a later end; how it ended."""
    _require(later, watch)
    timing.reset()
    changed = _changed(told, recorder, watch)
    before = recorder.origin.get("set")
    before = before if isinstance(before, list) else []
    changes = [*(entry for entry in before if key_of(str(entry)) != END), *overrides]
    changed[END] = [f"{scene.growth.end:g} h" for scene in (recorder.scene, later)]
    names = (checkpoint.LAST,) if recorder.kept else (checkpoint.NEWEST, checkpoint.PREVIOUS)
    with usable(recorder.folder):
        tidy(recorder.folder)
        restored = _restored(recorder, names, watch)
    if restored and not same_rows(recorder.scene, later, recorder.time):
        recorder.forget()  # rows lie as the end asks for them: these would not be the longer run's
        restored = False
    recorder.record.resumes.append({"time_h": recorder.time, "changed": changed})
    if not restored:
        recorder.scene = later
        recorder.origin["set"] = changes
        return _from_the_start(recorder, progress, watch)
    _warn(recorder, later, recorder.first_velocity, watch)
    recorder.lengthen(later, changes, ends_soon(later, recorder.state))
    recorder.drop_later()
    return _recorded(recorder, steps(later, recorder.state), progress, watch)


def _tell_another_file(recorder: Recorder, watch: Watch) -> None:
    """Warn where the file that a run's scene was read from says something else by now."""
    file = recorder.origin.get("file")
    changes = [recorder.origin.get(key, []) for key in ("set", "unset")]
    if not isinstance(file, str) or not all(isinstance(entries, list) for entries in changes):
        return
    with suppress(SceneError, TypeError, AttributeError):  # it is gone, or is no scene any more
        now = load_scene(file, *changes)
        differing = differences(scene_tables(recorder.scene), scene_tables(now))
        if differing:
            watch.warn(f"{file}: it is not the scene of the run any more: {_shown(differing)}; "
                       "the run goes on with its own")


def _continued(recorder: Recorder, told: dict, progress: Progress, watch: Watch) -> str:
    """Go on with the run that ``run.json`` tells of, unless it is over; how it ended."""
    if done(told["status"]) and _is_unchanged(recorder, told, watch):
        return _left_alone(recorder, told, watch)
    _require(recorder.scene, watch)
    timing.reset()
    changed = _changed(told, recorder, watch)
    with usable(recorder.folder):
        tidy(recorder.folder)
        restored = _restored(recorder, (checkpoint.NEWEST, checkpoint.PREVIOUS), watch)
    recorder.record.resumes.append({"time_h": recorder.time, "changed": changed})
    if not restored:
        return _from_the_start(recorder, progress, watch)
    recorder.tell(RUNNING)
    recorder.drop_later()
    return _recorded(recorder, steps(recorder.scene, recorder.state), progress, watch)


def _is_unchanged(recorder: Recorder, told: dict, watch: Watch) -> bool:
    """Are all files of a run that is over as they were written? Raises OutputError where not, and
    there is no checkpoint to go on from either."""
    lack = damage(recorder.folder, told)
    names = (checkpoint.NEWEST, checkpoint.PREVIOUS)
    if lack and not any(is_file(recorder.folder / name) for name in names):
        raise OutputError(f"{lack}; there is no checkpoint to go on from: --force with its scene "
                          "makes the run anew")
    if lack:
        watch.warn(f"{lack}; it goes on from its checkpoint")
    return not lack


def _left_alone(recorder: Recorder, told: dict, watch: Watch) -> str:
    """What is said of a run that is over; where its very end is missing, that is made."""
    folder = recorder.folder
    left = any((folder / name).exists() for name in CHECKPOINTS)
    if left or REPORT not in told["sha256"] or not is_file(folder / REPORT):
        settle(folder, told, recorder.own)
    watch.tell({"event": "end", "scene": recorder.scene.name, "status": told["status"],
                "folder": str(folder), "changed": False})
    return told["status"]


def _told(path: Path, read: Callable[[Path], dict], wanted: str) -> dict:
    """What ``run.json`` says. Raises OutputError, with what is wanted, where it is none of a run.
    """
    try:
        told = read(path)
    except (OSError, ValueError) as error:
        why = getattr(error, "strerror", None) or error
        raise OutputError(f"{path}: cannot be read ({why}); {wanted}") from None
    if not _is_record(told):
        raise OutputError(f"{path}: it has no scene or no status; {wanted}")
    if not (done(told["status"]) or undone(told["status"])):
        raise OutputError(f"{path}: its status {told['status']!r} is none that a run writes; "
                          f"{wanted}")
    return told


def _scene(told: dict, path: Path) -> Scene:
    """The scene of ``run.json``. Raises SceneError, or OutputError where it is of another run."""
    scene = parse_scene(told["tables"], told["scene"], str(path))
    if scene_hash(scene) != told["hash"]:
        raise OutputError(f"{path}: its scene is not the one that was run: the hash "
                          f"{told['hash']!r} is of another")
    return scene


def _is_record(told) -> bool:
    """Has it what every ``run.json`` has?"""
    wanted = {"scene": str, "hash": str, "tables": dict, "status": str}
    return isinstance(told, dict) and all(
        isinstance(told.get(key), kind) for key, kind in wanted.items())


def _changed(told: dict, recorder: Recorder, watch: Watch) -> dict[str, list]:
    """What has changed since the run began that could change its numbers; a warning tells it."""
    before = {key: _table(told, key) for key in ("versions", "conditions")}
    versions = results.provenance(recorder.scene)["versions"]
    after = {"versions": versions, "conditions": conditions()}
    changed = {key: pair for key, pair in differences(before, after).items()
               if not key.startswith("conditions.threads")}
    if changed:
        pairs = [f"{key} ({one} before, now {two})" for key, (one, two) in changed.items()]
        watch.warn(f"{recorder.folder}: not as it was when the run began: {', '.join(pairs)}; the "
                   "result need not be that of an uninterrupted run to the last bit")
    return changed


def _restored(recorder: Recorder, names: Sequence[str], watch: Watch) -> bool:
    """Has the recorder its state from one of the checkpoints? Those that are refused are told."""
    for name in names:
        path = recorder.folder / name
        if path.exists():
            try:
                recorder.restore(path)
                return True
            except CheckpointError as error:
                path.replace(recorder.folder / checkpoint.REFUSED)
                watch.warn(f"{path}: refused: {error}; it is {checkpoint.REFUSED} now")
    watch.warn(f"{recorder.folder}: no checkpoint to go on from; it starts again from t = 0")
    return False


def _from_the_start(recorder: Recorder, progress: Progress, watch: Watch) -> str:
    """Run from t = 0; the first state is solved before anything is written. Raises SceneError where
    that cannot be."""
    timing.reset()
    made = steps(recorder.scene)
    try:
        first = next(made)
    except SimulationError as error:
        raise SceneError(f"{recorder.scene.name}: it cannot be run: {error}") from error
    recorder.tell(RUNNING)
    recorder.clear()
    return _recorded(recorder, chain([first], made), progress, watch)


def _recorded(recorder: Recorder, made: Made, progress: Progress, watch: Watch) -> str:
    """Run to the end, whatever it is, and write that; how the run ended."""
    watch.tell({"event": "start", "scene": recorder.scene.name, "folder": str(recorder.folder),
                "from_h": recorder.time, "end_h": recorder.end, "step": recorder.steps})
    try:
        status = _simulated(recorder, made, progress, watch)
    except SimulationError as error:
        told = SimulationError(f"{error}; {recorder.last_good()}")
        _end(recorder, f"{FAILED}{told}", watch)
        raise told from error
    except (KeyboardInterrupt, Interrupted):
        _end(recorder, INTERRUPTED, watch)
        raise
    except BaseException as error:
        with suppress(OutputError):  # the first trouble is the one to tell
            _end(recorder, f"{FAILED}{error}", watch)
        raise
    return _end(recorder, status, watch)


def _end(recorder: Recorder, status: str, watch: Watch) -> str:
    recorder.finish(status)
    _tell_warnings(recorder.unmet(), watch)
    watch.tell({"event": "end", "scene": recorder.scene.name, "status": status,
                "folder": str(recorder.folder), "time_h": recorder.time, "step": recorder.steps,
                "rows": len(recorder.record.rows), "changed": True})
    return status


def _simulated(recorder: Recorder, made: Made, progress: Progress, watch: Watch) -> str:
    """Record every step of a run, from the recorder's state on; how it ended."""
    try:
        _record_steps(recorder, made, progress, watch)
    except RunEnd as end:
        if not recorder.kept:
            recorder.keep()
        return str(end)
    except MemoryError as error:
        raise SimulationError(f"stopped at t = {recorder.time:g} h, out of memory while results "
                              f"are written ({error}); try a smaller "
                              "numerics.refinement") from error
    return COMPLETED


def _record_steps(recorder: Recorder, made: Made, progress: Progress, watch: Watch) -> None:
    written = perf_counter()
    for state, instant in made:
        remeshes = recorder.remeshes
        contact = recorder.contact
        steps_before = recorder.steps if recorder.state else -1
        recorder.add(state, instant)
        if instant and len(recorder.record.rows) == 1:
            _warn(recorder, recorder.scene, recorder.first_velocity, watch)
        _tell_warnings(recorder.judge_surface(), watch)
        if not recorder.kept and ends_soon(recorder.scene, state):
            recorder.keep()
        if recorder.steps > steps_before:  # no row within a step
            _tell_step(recorder, recorder.remeshes > remeshes, recorder.contact > contact, watch)
        progress(recorder.time)
        if number := watch.stop():
            raise interrupted(recorder, number)
        if perf_counter() - written >= watch.interval:
            _checkpoint(recorder, watch)
            written = perf_counter()


def _warn(recorder: Recorder, scene: Scene, velocity: float | None, watch: Watch) -> None:
    """Tell and record which simplifications do not hold, as ``repro check`` finds them."""
    found = warned(scene, velocity)
    recorder.record.warnings = [asdict(each) for each in found]
    _tell_warnings(found, watch)


def _tell_warnings(found: list[Warned], watch: Watch) -> None:
    for each in found:
        watch.tell({"event": "warning", "key": each.key, "message": f"{each.key}: {each.text}"})


def warned(scene: Scene, velocity: float | None) -> list[Warned]:
    """The simplifications of a scene that do not hold; velocity: mean, um/h, at t = 0, if there is
    flow."""
    try:
        return [*simplifications.warnings(*judged(scene, velocity)), *unresolved(scene)]
    except ArithmeticError as error:
        return [Warned("scene", f"its dimensionless numbers cannot be worked out ({error})")]


def _tell_step(recorder: Recorder, remeshed: bool, contact: bool, watch: Watch) -> None:
    """A step as events."""
    now = {"time_h": recorder.time, "end_h": recorder.end, "step": recorder.steps,
           "remeshes": recorder.remeshes, "contact": recorder.contact}
    watch.tell({"event": "step", **now})
    for event, happened in (("remesh", remeshed), ("contact", contact)):
        if happened:
            watch.tell({"event": event, **now})


def _checkpoint(recorder: Recorder, watch: Watch) -> None:
    start = perf_counter()
    recorder.save(RUNNING)
    file = str(recorder.folder / checkpoint.NEWEST)
    watch.tell({"event": "checkpoint", "time_h": recorder.time, "file": file,
                "seconds": perf_counter() - start})
