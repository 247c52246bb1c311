"""A sweep's folder: ``sweep.json`` says what is wanted, the folders of ``runs/`` what is there.

A run is there when its folder is; it is moved there whole. So a sweep that was cut off, by
whatever, is gone on with by the same command: it makes what is missing, and what has failed, again.
"""

from __future__ import annotations

import json
import os
import shutil
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path

from repro.results import write_json
from repro.results.files import is_folder, open_lock, whole
from repro.run.running import OutputError
from repro.run.whole import lacking
from repro.sweep import task
from repro.sweep.design import Factor, Point


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
    """Hold the sweep's folder, made if it is not there.

    Raises OutputError where it holds anything else, or another sweep, where another process has it,
    and where it cannot be written.
    """
    with usable(sweep.folder):
        _check(sweep.folder, _as_json(sweep))
        _refuse_others(sweep)
        sweep.runs.mkdir(parents=True, exist_ok=True)
        lock = os.fdopen(open_lock(sweep.folder / ".lock"), "a")
    with lock:
        _hold(lock, sweep.folder)
        with usable(sweep.folder):
            _check(sweep.folder, _as_json(sweep))  # again: another may have begun here meanwhile
            with whole(sweep.folder / "sweep.json") as beside:
                write_json(beside, _as_json(sweep))
        yield
        _clean(sweep)


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
    if folder.is_dir() and not (folder / "sweep.json").exists():
        strange = sorted({path.name for path in folder.iterdir()} - {"runs", ".lock"})
        if strange:
            raise SweepError(f"--out {folder}: it holds {strange[0]!r}, which is not of a sweep; a "
                             "new or empty folder, or one of the same sweep, is accepted")
    elif folder.exists():
        _compare(folder, _read(folder), wanted)


def _read(folder: Path) -> dict:
    try:
        told = json.loads((folder / "sweep.json").read_text(encoding="utf-8"))
        len(told["points"])  # raises TypeError where it is no list
        return {name: told[name] for name in ("scene", "code", "varied", "points")}
    except (ValueError, KeyError, TypeError, RecursionError):
        raise SweepError(f"--out {folder}: its sweep.json cannot be read; a new folder is "
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
    """Raises SweepError where the place of a run is a link, or no folder, or has another run."""
    for point in sweep.points:
        place = sweep.runs / point.name
        if os.path.lexists(place) and not is_folder(place):
            raise SweepError(f"{place}: it is a link, or no folder, and so not of this sweep; move "
                             "it away")
        if task.ran(place) not in (None, point.hash):
            raise SweepError(f"{place}: it holds the run of another scene; move it away")


def _hold(lock, folder: Path) -> None:
    """Hold the folder against other sweeps, until the file `lock` is closed or this process ends.
    """
    try:
        import fcntl
    except ImportError:  # Windows: two sweeps in one folder cost time there, and lose nothing
        return
    try:
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        raise SweepError(f"--out {folder}: another sweep is at work in it") from None


def _clean(sweep: Sweep) -> None:
    """Remove what is left of attempts at runs that are there now."""
    parts = list(sweep.runs.glob(".part-*"))
    for point in sweep.points:
        left = [part for part in parts if part.name.startswith(f".part-{point.name}")]
        if left and not lacking(sweep.runs / point.name, point.scene):
            for part in left:
                shutil.rmtree(part, ignore_errors=True)
