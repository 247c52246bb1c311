"""Run a scene into a folder, or resume the run in a folder, for the functions of ``scripts``.

Rows and fields are written as they are computed.
"""

import os
import warnings
from collections.abc import Callable, Collection, Iterator, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass
from itertools import chain
from pathlib import Path
from time import perf_counter

from repro import results, timing
from repro.errors import CheckpointError, Interrupted, OutputError, RunEnd, SimulationError
from repro.march.simulation import ends_soon, same_rows, steps
from repro.march.state import Report, RestartState
from repro.polling import polling
from repro.preflight.memory import require_memory, require_outline
from repro.preflight.resolved import find_unresolved_flow
from repro.preflight.simplifications import Caveat, find_warnings
from repro.report.reading import read_record
from repro.results.files import is_file, read_json, read_sealed
from repro.runs import INTERVAL, checkpoint
from repro.runs.folder import (
    CHECKPOINTS,
    PROVENANCE,
    REPORT,
    folder_errors,
    list_written_files,
    locked,
    prepare,
    refuse_foreign,
    refuse_links,
    refuse_null,
    remove_temporary,
)
from repro.runs.integrity import find_damage, require_known_status
from repro.runs.machine import differences, refuse_exchanged, require_packages
from repro.runs.recorder import Recorder, complete_folder, interruption
from repro.runs.status import COMPLETED, FAILED, INTERRUPTED, RUNNING, is_over
from repro.scene import (
    KEYS,
    Scene,
    SceneError,
    Source,
    load_scene,
    packaged_scenes,
    parse_scene,
    scene_tables,
)
from repro.scene.files import key_of, override

#: The state after each step and, if the step is reported, its row.
ReportedSteps = Iterator[tuple[RestartState, Report | None]]
#: At most this many differing keys are listed in a message.
MOST_DESCRIBED = 4
#: The only key that can be changed after a run has begun.
END = "growth.end"


def issue_warnings(event: dict) -> None:
    """Issue warning events as Python warnings, and drop all other events.

    Warnings about a key of the scene are only in ``run.json``.
    """
    if event["event"] == "warning" and "key" not in event:
        warnings.warn(event["message"], stacklevel=2)


@dataclass(frozen=True)
class Watch:
    """How a run reports and when it stops.

    tell: receives each event; interval: wall time (s) between checkpoints; stop: returns the number
    of a signal that asks the run to stop after a step, or 0; stop_within: the same, for a stop
    within a step, whose work is lost; patience: how long (s) to wait for another process that uses
    the folder.
    """

    tell: Callable[[dict], None] = issue_warnings
    interval: float = INTERVAL
    stop: Callable[[], int] = lambda: 0
    stop_within: Callable[[], int] = lambda: 0
    patience: float = 0.0

    def warn(self, message: str) -> None:
        """Report a warning."""
        self.tell({"event": "warning", "message": message})


DEFAULT_WATCH = Watch()


def run(scene: Source, folder: str | Path, watch: Watch = DEFAULT_WATCH, *, force: bool = False,
        origin: dict | None = None) -> str:
    """Run a scene and write its results to a folder.

    If the folder already holds a run of the same scene, code and package versions, that run is
    resumed; a finished run is left unchanged. Returns how the run ended.

    force: remove the files of any run in the folder first; origin: for ``run.json``, from
    :func:`origin_of`. Raises the errors of :func:`repro.run`, and Interrupted if ``watch.stop``
    asks the run to stop; all results so far are written.
    """
    refuse_exchanged(scene)
    scene = load_scene(scene)
    folder = Path(folder)
    refuse_null(folder)
    _require(scene, watch)
    with locked(folder, watch.patience):
        recorder = Recorder(scene, folder, origin=origin)
        if not is_file(folder / PROVENANCE):
            prepare(folder)
            return _run_from_start(recorder, watch)
        record = read_record(folder, read_json if force else read_sealed)
        recorder.run_files = list_written_files(folder, record)
        refuse_links(folder, recorder.run_files)
        if force:
            refuse_foreign(folder, recorder.run_files)
            return _run_from_start(recorder, watch)
        require_known_status(folder, record)
        _refuse_another(recorder, record)
        prepare(folder, recorder.run_files)
        return _continue(recorder, record, watch)


def origin_of(scene: str | Path, overrides: Collection[str], unset: Sequence[str]) -> dict:
    """Describe the origin of a scene for ``run.json``: a packaged name or a path, and changes."""
    file = scene if scene in packaged_scenes() else os.path.abspath(scene)
    return {"file": file, "set": list(overrides), "unset": list(unset)}


def _require(scene: Scene, watch: Watch) -> None:
    """Raise SceneError if the machine or the outline does not permit a run of the scene.

    The machine may lack a package or memory, or the spline of the outline may cross itself or leave
    the pore.
    """
    require_packages(scene)
    require_outline(scene)
    require_memory(scene, watch.warn)


def _refuse_another(recorder: Recorder, record: dict) -> None:
    """Raise OutputError if the folder holds a run of another scene, code or package version."""
    current = results.provenance(recorder.scene) | {"source": recorder.conditions["source"]}
    previous = record | {"source": record["conditions"]["source"]}
    keys = ("source", "versions") if previous["hash"] == current["hash"] else ("tables",)
    differing = differences({key: previous.get(key) for key in keys},
                            {key: current.get(key) for key in keys})
    if differing:
        longer = " (--resume makes a run longer)" if list(differing) == [f"tables.{END}"] else ""
        raise OutputError(
            f"--out {recorder.folder}: it contains another run: {_describe(differing)}; give a new "
            f"folder{longer}, or --force, which removes the files of that run")


def _describe(differing: dict[str, list], earlier: str = "there") -> str:
    """List the first differing keys with both values, and the number of the others."""
    pairs = []
    for key, values in differing.items():
        before, after = ("not set" if value is None else str(value) if not isinstance(value, dict)
                         else "a table over time" if "table" in value else "a section"
                         for value in values)
        pairs.append(f"{key.removeprefix('tables.')} ({before} {earlier}, now {after})")
    more = f" and {len(pairs) - MOST_DESCRIBED} more" if len(pairs) > MOST_DESCRIBED else ""
    return ", ".join(pairs[:MOST_DESCRIBED]) + more


def resume(folder: str | Path, overrides: Collection[str] = (),
           watch: Watch = DEFAULT_WATCH) -> str:
    """Resume the run in a folder, or make it longer; returns how it ended.

    The arguments and errors are those of :func:`repro.resume` and :func:`run`. A warning is issued
    if package versions or the file of the scene have changed or a checkpoint cannot be used.
    """
    folder = Path(folder)
    refuse_null(folder)
    file = folder / PROVENANCE
    if not is_file(file):
        raise OutputError(f"{folder}: there is no run.json; the folder of a run is needed")
    with locked(folder, watch.patience):
        record = read_record(folder)
        require_known_status(folder, record)
        run_files = list_written_files(folder, record)
        refuse_links(folder, run_files)
        scene = parse_scene(record["tables"], record["scene"], str(file))
        recorder = Recorder(scene, folder, run_files, record["origin"])
        origin = recorder.origin
        with suppress(SceneError):  # the file is missing or no longer a scene
            current = load_scene(origin.get("file", scene), origin.get("set", ()),
                                 unset=origin.get("unset", ()))
            if differing := differences(scene_tables(scene), scene_tables(current)):
                watch.warn(f"{origin['file']}: it has changed since the run began: "
                           f"{_describe(differing)}; the run continues with its own scene")
        extended = _extended_scene(scene, overrides, str(file))
        if extended == scene:
            return _continue(recorder, record, watch)
        return _extend(recorder, extended, overrides, record, watch)


def _extended_scene(scene: Scene, overrides: Collection[str], file: str) -> Scene:
    """Return the scene with a later end. Raises SceneError for any other change."""
    if not overrides:
        return scene
    if scene.growth is None:
        raise SceneError(f"{file}: its scene has no [growth], so it has no end to change")
    tables = scene_tables(scene)
    for entry in overrides:
        if key_of(entry) != END:
            raise SceneError(f"{file}: --set {entry}: a run can change {END} only; run another "
                             "scene in a new folder")
        override(tables, entry, file, KEYS)
    extended = parse_scene(tables, scene.name, file, [END])
    if extended.growth.end < scene.growth.end:
        raise SceneError(f"{file}: {END} = {extended.growth.end:g} h: the run already has the end "
                         f"{scene.growth.end:g} h; give a later one")
    return extended


def _extend(recorder: Recorder, extended: Scene, overrides: Collection[str], record: dict,
            watch: Watch) -> str:
    """Continue the run of this ``run.json`` to a later end; return how it ended."""
    earlier = [entry for entry in recorder.origin.get("set", []) if key_of(entry) != END]
    changes = [*earlier, *overrides]
    if not _restore(recorder, extended, record, watch):
        recorder.scene = extended
        recorder.origin["set"] = changes
        return _run_from_start(recorder, watch)
    _warn(recorder, extended, recorder.first_velocity, watch)
    recorder.extend(extended, changes, ends_soon(extended, recorder.state))
    recorder.remove_later_fields()
    return _record_run(recorder, steps(extended, recorder.state), watch)


def _continue(recorder: Recorder, record: dict, watch: Watch) -> str:
    """Continue the run of this ``run.json``; return how it ended.

    A finished run whose files are unchanged is left as it is; if it was killed before, its page is
    written and its checkpoints are removed. Raises OutputError if files have changed and there is
    no checkpoint from which to resume.
    """
    folder = recorder.folder
    if is_over(record["status"]):
        damage = find_damage(folder, record)
        if not damage:
            has_checkpoint = any((folder / name).exists() for name in CHECKPOINTS)
            if has_checkpoint or REPORT not in record["sha256"] or not is_file(folder / REPORT):
                complete_folder(folder, record, recorder.run_files)
            watch.tell({"event": "end", "scene": recorder.scene.name, "status": record["status"],
                        "folder": str(folder), "changed": False})
            return record["status"]
        if not any(is_file(folder / name) for name in checkpoint.STATES):
            raise OutputError(f"{damage}; there is no checkpoint to resume from; run the scene "
                              "again with --force")
        watch.warn(f"{damage}; the run resumes from its checkpoint")
    if not _restore(recorder, recorder.scene, record, watch):
        return _run_from_start(recorder, watch)
    recorder.write_record(RUNNING)
    recorder.remove_later_fields()
    return _record_run(recorder, steps(recorder.scene, recorder.state), watch)


def _restore(recorder: Recorder, scene: Scene, record: dict, watch: Watch) -> bool:
    """Restore the recorder to continue as the run of a scene, and record the resume.

    It takes the first valid checkpoint, and warns of each refused one. Returns False if the run
    starts again from t = 0.
    """
    _require(scene, watch)
    timing.reset()
    folder = recorder.folder
    changed = _find_changes(record, recorder, watch)
    names: tuple[str, ...] = checkpoint.STATES
    if scene != recorder.scene:
        changed[END] = [f"{each.growth.end:g} h" for each in (recorder.scene, scene)]
        names = (checkpoint.LAST,) if recorder.has_last_state else names
    is_restored = False
    with folder_errors(folder):
        remove_temporary(folder)
        for path in (folder / name for name in names):
            if is_restored or not path.exists():
                continue
            try:
                recorder.restore(path)
                is_restored = True
            except CheckpointError as error:
                path.replace(folder / checkpoint.REFUSED)
                watch.warn(f"{path}: refused: {error}; renamed to {checkpoint.REFUSED}")
    if not is_restored:
        watch.warn(f"{folder}: no checkpoint to resume from; the run starts again from t = 0")
    elif not same_rows(recorder.scene, scene, recorder.time):
        recorder.forget()  # a longer run has rows at other times
        is_restored = False
    recorder.history.resumes.append({"time_h": recorder.time, "changed": changed})
    return is_restored


def _find_changes(record: dict, recorder: Recorder, watch: Watch) -> dict[str, list]:
    """Find changes since the run began that could change its numbers, and warn of them."""
    before = {key: record[key] for key in ("versions", "conditions")}
    after = {"versions": results.provenance(recorder.scene)["versions"],
             "conditions": recorder.conditions}
    changed = {key: pair for key, pair in differences(before, after).items()
               if not key.startswith("conditions.threads")}
    if changed:
        watch.warn(f"{recorder.folder}: changed since the run began: "
                   f"{_describe(changed, 'before')}; the results may differ from those of an "
                   "uninterrupted run")
    return changed


def _run_from_start(recorder: Recorder, watch: Watch) -> str:
    """Run from t = 0.

    The first state is solved before any file is written. Raises SceneError if it cannot be solved.
    """
    timing.reset()
    run_steps = steps(recorder.scene)
    try:
        first = next(run_steps)
    except SimulationError as error:
        raise SceneError(f"{recorder.scene.name}: it cannot be run: {error}") from error
    recorder.write_record(RUNNING)
    recorder.clear()
    return _record_run(recorder, chain([first], run_steps), watch)


def _record_run(recorder: Recorder, run_steps: ReportedSteps, watch: Watch) -> str:
    """Run until the run ends, and write its status; return how it ended."""
    watch.tell({"event": "start", "scene": recorder.scene.name, "folder": str(recorder.folder),
                "from_h": recorder.time, "end_h": recorder.end, "step": recorder.steps})
    try:
        status = _simulate(recorder, run_steps, watch)
    except SimulationError as error:
        message = SimulationError(f"{error}; {recorder.describe_last_state()}")
        _finish(recorder, f"{FAILED}{message}", watch)
        raise message from error
    except (KeyboardInterrupt, Interrupted):
        _finish(recorder, INTERRUPTED, watch)
        raise
    except BaseException as error:
        with suppress(OutputError):  # the first error is the one to report
            _finish(recorder, f"{FAILED}{error}", watch)
        raise
    return _finish(recorder, status, watch)


def _finish(recorder: Recorder, status: str, watch: Watch) -> str:
    recorder.finish(status)
    _emit_warnings(recorder.warnings_so_far(), watch)
    watch.tell({"event": "end", "scene": recorder.scene.name, "status": status,
                "folder": str(recorder.folder), "time_h": recorder.time, "step": recorder.steps,
                "rows": len(recorder.history.rows), "changed": True})
    return status


def _simulate(recorder: Recorder, run_steps: ReportedSteps, watch: Watch) -> str:
    """Record every step from the recorder's state on; return how the run ended."""
    def check() -> None:
        if recorder.state and (number := watch.stop_within()):
            raise interruption(recorder, number)

    try:
        with polling(check):
            _record_steps(recorder, run_steps, watch)
    except RunEnd as end:
        if not recorder.has_last_state:
            recorder.save_last_state()
        return str(end)
    except MemoryError as error:
        raise SimulationError(f"stopped at t = {recorder.time:g} h, out of memory while results "
                              f"are written ({error}); try a smaller "
                              "numerics.refinement") from error
    return COMPLETED


def _record_steps(recorder: Recorder, run_steps: ReportedSteps, watch: Watch) -> None:
    saved_at = perf_counter()
    for state, reported in run_steps:
        remeshes = recorder.remeshes
        contact = recorder.contact
        steps_before = recorder.steps if recorder.state else -1
        recorder.add(state, reported)
        if reported and len(recorder.history.rows) == 1:
            _warn(recorder, recorder.scene, recorder.first_velocity, watch)
        _emit_warnings(recorder.find_crease(), watch)
        if not recorder.has_last_state and ends_soon(recorder.scene, state):
            recorder.save_last_state()
        events = {"step": recorder.steps > steps_before, "remesh": recorder.remeshes > remeshes,
                  "contact": recorder.contact > contact}
        for event in events if events["step"] else ():  # no row within a step
            if events[event]:
                watch.tell({"event": event, "time_h": recorder.time, "end_h": recorder.end,
                            "step": recorder.steps, "remeshes": recorder.remeshes,
                            "contact": recorder.contact})
        if number := watch.stop():
            raise interruption(recorder, number)
        if perf_counter() - saved_at >= watch.interval:
            _checkpoint(recorder, watch)
            saved_at = perf_counter()


def _checkpoint(recorder: Recorder, watch: Watch) -> None:
    start = perf_counter()
    recorder.save(RUNNING)
    file = str(recorder.folder / checkpoint.NEWEST)
    watch.tell({"event": "checkpoint", "time_h": recorder.time, "file": file,
                "seconds": perf_counter() - start})


def _warn(recorder: Recorder, scene: Scene, velocity: float | None, watch: Watch) -> None:
    """Report and record the simplifications that do not hold at t = 0."""
    try:
        scene_warnings = [*find_warnings(scene, velocity), *find_unresolved_flow(scene)]
    except ArithmeticError as error:
        text = f"its dimensionless numbers cannot be computed ({error})"
        scene_warnings = [Caveat("scene", text)]
    recorder.history.warnings = [asdict(warning) for warning in scene_warnings]
    _emit_warnings(scene_warnings, watch)


def _emit_warnings(scene_warnings: list[Caveat], watch: Watch) -> None:
    for warning in scene_warnings:
        watch.tell({"event": "warning", "key": warning.key,
                    "message": f"{warning.key}: {warning.text}"})
