"""Check by SHA-256 whether the files of a run are complete and unchanged."""

from pathlib import Path

from repro.errors import OutputError, shortened
from repro.report.reading import Run, read, read_record, require_columns
from repro.results.files import is_file, sha256_of
from repro.runs.folder import REPORT, read_sums
from repro.runs.status import RUNNING, is_known, is_over
from repro.scene import Scene, scene_hash


def read_scene_run(folder: Path, scene: Scene) -> Run:
    """Read the run of a scene in a folder, finished or not.

    Raises OutputError if the folder contains no run or a run of another scene, or if its files have
    changed since they were written.
    """
    run = read(folder)
    _require_scene(folder, run.record, scene)
    require_columns(run)
    return run


def _require_scene(folder: Path, record: dict, scene: Scene) -> None:
    """Raise OutputError if a record is of another scene."""
    if record["hash"] != scene_hash(scene):
        raise OutputError(f"{folder}: it holds the run of another scene")


def find_defect(folder: Path, scene: Scene) -> str:
    """Reason why a folder has no finished, complete run of a scene; empty if it has one."""
    try:
        record = read_record(folder)
        _require_scene(folder, record, scene)
    except OutputError as error:
        return str(error)
    if not is_over(record["status"]):
        return f"{folder}: the run has not finished: {record['status']}"
    return find_damage(folder, record)


def find_damage(folder: Path, record: dict) -> str:
    """Name a file of a run that has changed since it was written; empty if none has.

    ``run.json`` has the SHA-256 of tables and lists, and ``fields.sha256`` those of the fields. A
    missing page is no damage: it can be written again. A running run has only the SHA-256 of its
    fields.
    """
    expected = record["sha256"] | read_sums(folder)
    if not is_file(folder / REPORT):
        expected.pop(REPORT, None)
    for name, digest in expected.items():
        if not is_file(folder / name) or sha256_of(folder / name) != digest:
            return f"{folder}: {name} is missing, cut short or altered since it was written"
    return ""


def require_known_status(folder: Path, record: dict) -> None:
    """Raise OutputError if this version does not know the status of a run: it may be over."""
    status = record["status"]
    if not is_known(status):
        raise OutputError(f"{folder}: run.json has the status {shortened(status)!r}, which this "
                          "version does not know; use the version that wrote it, or --force, which "
                          "removes the files of that run")


def read_status(folder: Path) -> str:
    """Read the status of the run in a folder. Raises OutputError if its files are damaged."""
    record = read_record(folder)
    require_known_status(folder, record)
    status = record["status"]
    if status != RUNNING and (damage := find_damage(folder, record)):
        raise OutputError(damage)
    return status
