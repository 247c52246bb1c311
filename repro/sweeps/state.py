"""A sweep's folder: ``sweep.json`` says what is wanted, the folders of ``runs/`` what is there.

Each run has its own folder, as ``repro run`` makes it. The same command continues a sweep that was
cut off: it goes on with the runs that are not over, and makes damaged ones again.
"""

from __future__ import annotations

import os
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path

from repro.errors import OutputError
from repro.report.reading import NoRun
from repro.results import write_json
from repro.results.files import is_folder, read_json, whole
from repro.runs.folder import LOCK, PROVENANCE, locked, strange
from repro.runs.whole import lacking, record_of
from repro.sweeps import task
from repro.sweeps.design import Factor, Point


class SweepError(OutputError):
    """A sweep cannot be made here; says why."""


@dataclass(frozen=True)
class Sweep:
    """What is wanted: the scene's name, the keys that are varied, and the runs, into `folder`."""

    folder: Path
    source: str
    factors: list[Factor]
    points: list[Point]

    @property
    def runs(self) -> Path:
        """Where the runs are."""
        return self.folder / "runs"

    def missing(self) -> list[Point]:
        """The runs that have not come to their end."""
        return [point for point in self.points
                if lacking(self.runs / point.name, point.scene)]


@contextmanager
def opened(sweep: Sweep):
    """Lock the sweep's folder, which is made if it is not there.

    Raises OutputError where it holds anything else, or another sweep, where another process has it,
    and where it cannot be written.
    """
    with usable(sweep.folder):
        _check(sweep.folder, _as_json(sweep))
        _refuse_others(sweep)
    with locked(sweep.folder):
        with usable(sweep.folder):
            _check(sweep.folder, _as_json(sweep))  # again: another may have begun here meanwhile
            sweep.runs.mkdir(exist_ok=True)
            with whole(sweep.folder / "sweep.json") as beside:
                write_json(beside, _as_json(sweep))
        yield


@contextmanager
def usable(folder: Path):
    """Tell any trouble with the folder as one of the output's."""
    try:
        yield
    except OSError as error:
        why = error.strerror or error
        needed = "a folder that can be written is needed"
        raise SweepError(f"--out {folder}: {why}; {needed}") from error


def _as_json(sweep: Sweep) -> dict:
    points = [{"run": point.index, "folder": f"runs/{point.name}", "hash": point.hash,
               "values": list(point.values)} for point in sweep.points]
    factors = [{**asdict(factor), "values": list(factor.values)} for factor in sweep.factors]
    return {"scene": sweep.source, "code": task.code(), "varied": factors, "points": points}


def _check(folder: Path, wanted: dict) -> None:
    """Is the folder this sweep's, or nobody's?"""
    if folder.is_dir() and not os.path.lexists(folder / "sweep.json"):
        foreign = sorted({path.name for path in folder.iterdir()} - {"runs", LOCK})
        if foreign:
            raise SweepError(f"--out {folder}: it holds {foreign[0]!r}, which is not of a sweep; a "
                             "new or empty folder, or one of the same sweep, is accepted")
    elif folder.exists():
        _compare(folder, _read(folder), wanted)


def _read(folder: Path) -> dict:
    try:
        told = read_json(folder / "sweep.json")
        len(told["points"])  # raises TypeError where it is no list
        return {name: told[name] for name in ("scene", "code", "varied", "points")}
    except (OSError, ValueError, KeyError, TypeError) as error:
        why = f" ({error.strerror})" if isinstance(error, OSError) else ""
        raise SweepError(f"--out {folder}: its sweep.json cannot be read{why}; a new folder is "
                         "needed") from None


def _compare(folder: Path, told: dict, wanted: dict) -> None:
    if told["code"] != wanted["code"]:
        raise SweepError(f"--out {folder}: its sweep was begun with version {told['code']} of this "
                         f"package, this is {wanted['code']}; a new folder is needed")
    if (told["varied"], told["points"]) != (wanted["varied"], wanted["points"]):
        raise SweepError(f"--out {folder}: it holds another sweep ({told['scene']}, "
                         f"{len(told['points'])} runs); a new folder, or the same scene, --set, "
                         "--vary, --samples and --seed, is needed")


def _refuse_others(sweep: Sweep) -> None:
    """Raises SweepError where the place of a run, or of all, is a link or no folder, or holds what
    is not of that run."""
    for place in (sweep.runs, *(sweep.runs / point.name for point in sweep.points)):
        if os.path.lexists(place) and not is_folder(place):
            raise SweepError(f"{place}: it is a link, or no folder, and so not of this sweep; move "
                             "it away")
    for point in sweep.points:
        if (sweep.runs / point.name).exists():
            _refuse_another(sweep.runs / point.name, point)


def _refuse_another(place: Path, point: Point) -> None:
    """Raises SweepError where a folder holds what is not of a point's run."""
    if not os.path.lexists(place / PROVENANCE):
        if foreign := strange(place):
            raise SweepError(f"{place}: it holds {foreign[0]!r}, which is not of a run; move it "
                             "away")
        return
    try:
        record = record_of(place)
    except NoRun as error:
        raise SweepError(f"{error}; move the folder away") from error
    if record.get("hash") != point.hash:
        raise SweepError(f"{place}: it holds the run of another scene; move it away")
