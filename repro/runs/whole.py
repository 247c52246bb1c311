"""Is a run that is over complete and unchanged? Its files' SHA-256 say so."""

from __future__ import annotations

from pathlib import Path

from repro.report.reading import NoRun, Run, hashes, read, require_columns
from repro.results.files import is_file, read_sealed, sha256_of
from repro.runs.folder import PROVENANCE, REPORT, sums
from repro.runs.status import RUNNING, done, undone
from repro.scene import Scene, scene_hash


def run_of(folder: Path, scene: Scene) -> Run:
    """The run of a scene in a folder, over or not. Raises NoRun, with what is wrong, where there is
    none, or one of another scene, or its files are not as they were written."""
    run = read(folder)
    _require_scene(folder, run.record, scene)
    require_columns(run)
    return run


def _require_scene(folder: Path, record: dict, scene: Scene) -> None:
    """Raise NoRun where a record is of another scene, or has no status of a run."""
    status = str(record.get("status"))
    if record.get("hash") != scene_hash(scene) or not (done(status) or undone(status)):
        raise NoRun(f"{folder}: run.json tells of a run of another scene, or has no status")


def lacking(folder: Path, scene: Scene) -> str:
    """What a folder lacks of a scene's run that is over and complete; empty where nothing."""
    try:
        record = record_of(folder)
        _require_scene(folder, record, scene)
    except NoRun as error:
        return str(error)
    if not done(record["status"]):
        return f"{folder}: the run is not over: {record['status']}"
    return damage(folder, record)


def record_of(folder: Path) -> dict:
    """What ``run.json`` says. Raises NoRun where it is missing or not as it was written."""
    try:
        return read_sealed(folder / PROVENANCE)
    except (OSError, ValueError) as error:
        why = getattr(error, "strerror", None) or error
        raise NoRun(f"{folder}: run.json cannot be read: {why}") from error


def damage(folder: Path, record: dict) -> str:
    """Which file of a run is not as it was written; empty where all are.

    The SHA-256 of tables and lists are in ``run.json``, those of fields in a list. A page that is
    missing is no damage: it is made again. A run at work has none but those of its fields.
    """
    expected = hashes(record) | sums(folder)
    if not is_file(folder / REPORT):
        expected.pop(REPORT, None)
    for name, digest in expected.items():
        if not is_file(folder / name) or sha256_of(folder / name) != digest:
            return f"{folder}: {name} is not as it was written: missing, cut short or altered"
    return ""


def state_of(folder: Path) -> str:
    """How the run in a folder has ended, or that it has not. Raises NoRun where it is damaged."""
    record = record_of(folder)
    status = str(record.get("status"))
    if not (done(status) or undone(status)):
        raise NoRun(f"{folder}: its status {status!r} is none that a run writes")
    if status != RUNNING and (lack := damage(folder, record)):
        raise NoRun(lack)
    return status
