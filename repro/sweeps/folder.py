"""The folder of a sweep: ``sweep.json`` lists the planned runs, ``runs/`` holds their folders.

The folder of each run is the same as one that ``repro run`` makes. The command of an interrupted
sweep continues it: unfinished runs are resumed, damaged ones are repeated.
"""

import os
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path

from repro.errors import OutputError
from repro.report.reading import read_record
from repro.results import write_json
from repro.results.files import is_folder, read_json
from repro.runs.folder import LOCK, PROVENANCE, find_foreign, folder_errors, locked, refuse_null
from repro.runs.integrity import find_defect
from repro.sweeps import single_run
from repro.sweeps.design import Factor, Point


@dataclass(frozen=True)
class Sweep:
    """The plan of a sweep: its folder, the name of the scene, the varied keys, and the runs."""

    folder: Path
    source: str
    factors: list[Factor]
    points: list[Point]

    @property
    def runs(self) -> Path:
        """The folder that holds the folders of the runs."""
        return self.folder / "runs"

    def missing(self) -> list[Point]:
        """The runs that are not finished."""
        return [point for point in self.points
                if find_defect(self.runs / point.name, point.scene)]


@contextmanager
def lock_folder(sweep: Sweep):
    """Lock the folder of a sweep. Make the folder if it does not exist.

    Raises OutputError if the folder has other files or another sweep, if another process uses it,
    or if it cannot be written.
    """
    refuse_null(sweep.folder)
    with folder_errors(sweep.folder):
        _check(sweep)
        _refuse_foreign(sweep)
    with locked(sweep.folder):
        with folder_errors(sweep.folder):
            _check(sweep)  # again: another sweep may have begun meanwhile
            sweep.runs.mkdir(exist_ok=True)
            write_json(sweep.folder / "sweep.json", _as_json(sweep))
        yield


def _as_json(sweep: Sweep) -> dict:
    points = [{"run": point.index, "folder": f"runs/{point.name}", "hash": point.hash,
               "values": list(point.values)} for point in sweep.points]
    factors = [{**asdict(factor), "values": list(factor.values)} for factor in sweep.factors]
    return {"scene": sweep.source, "code": single_run.code(), "varied": factors, "points": points}


def _check(sweep: Sweep) -> None:
    """Raise OutputError if the folder belongs to another sweep or to something else."""
    folder, expected = sweep.folder, _as_json(sweep)
    if folder.is_dir() and not os.path.lexists(folder / "sweep.json"):
        foreign = sorted({path.name for path in folder.iterdir()} - {"runs", LOCK})
        if foreign:
            raise OutputError(f"--out {folder}: it holds {foreign[0]!r}, which is not of a sweep; "
                              "a new or empty folder, or one of the same sweep, is accepted")
        return
    if not folder.exists():
        return
    try:
        record = read_json(folder / "sweep.json")
        runs = len(record["points"])  # raises TypeError where it is no list
        scene, code, *plan = (record[name] for name in expected)
    except (OSError, ValueError, KeyError, TypeError) as error:
        reason = f" ({error.strerror})" if isinstance(error, OSError) else ""
        raise OutputError(f"--out {folder}: its sweep.json cannot be read{reason}; a new folder is "
                          "needed") from None
    if code != expected["code"]:
        raise OutputError(f"--out {folder}: its sweep was begun with version {code} of "
                          f"this package, this is {expected['code']}; a new folder is needed")
    if plan != [expected["varied"], expected["points"]]:
        raise OutputError(f"--out {folder}: it holds another sweep ({scene}, {runs} runs); a new "
                          "folder, or the same scene, --set, --vary, --samples and --seed, is "
                          "needed")


def _refuse_foreign(sweep: Sweep) -> None:
    """Raise OutputError if the folder of a run, or of all runs, is a link or not a folder, or holds
    files that do not belong to the run."""
    folders = {sweep.runs / point.name: point for point in sweep.points}
    for folder in (sweep.runs, *folders):
        if os.path.lexists(folder) and not is_folder(folder):
            raise OutputError(f"{folder}: it is a link, or no folder, and so not of this sweep; "
                              "move it away")
    for folder, point in folders.items():
        if os.path.lexists(folder / PROVENANCE):
            if read_record(folder)["hash"] != point.hash:
                raise OutputError(f"{folder}: it holds the run of another scene; move it away")
        elif folder.exists() and (foreign := find_foreign(folder)):
            raise OutputError(f"{folder}: it holds {foreign[0]!r}, which is not of a run; move it "
                              "away")
