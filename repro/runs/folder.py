"""The folder of a run: what is a run's in it, who may write there, how trouble with it is told.

A run removes and replaces nothing but regular files that it has written itself: those that its
``run.json`` lists, the fields that its ``fields.sha256`` lists, each before it is there, and its
checkpoints.
"""

from __future__ import annotations

import errno
import os
import re
from collections.abc import Collection, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from repro.errors import OutputError
from repro.results.files import MOST_TABLE, WRITING, is_file, is_folder, read
from repro.runs.checkpoint import LAST, NEWEST, PREVIOUS, REFUSED

LOCK = ".lock"
PROVENANCE = "run.json"
REPORT = "report.html"
SUMS = "fields.sha256"
#: What is removed where a run is over.
CHECKPOINTS = (NEWEST, PREVIOUS, REFUSED)
#: Every file that a run may write, besides its fields.
OWN = (PROVENANCE, "timeseries.csv", "ledger.csv", "fields.pvd", "before_expansion.pvd", SUMS,
       "timeseries.nc", REPORT, *CHECKPOINTS, LAST)
FIELDS = re.compile(r"fields/(?:fields|before_expansion)_\d{4,}\.vtu")
#: A line of SUMS, as sha256sum writes and checks it.
SUM = re.compile(rf"([0-9a-f]{{64}})  ({FIELDS.pattern})")
#: A folder in which a run was writing a file when it was killed, and what that may hold.
ROOM = re.compile(re.escape(WRITING) + r"\w{8}")
PART = re.compile("|".join([FIELDS.pattern.removeprefix("fields/"), *map(re.escape, OWN)]))


def listed(folder: Path, told: dict) -> set[str]:
    """The files that a run has written, by its ``run.json`` (``told``) and its SUMS; checkpoints
    too, which one that was killed at its very end has left and does not list."""
    names = told.get("files")
    names = names if isinstance(names, list) else []
    found = {name for name in names if isinstance(name, str)}
    found = {name for name in found if name in OWN or FIELDS.fullmatch(name)}
    if SUMS in found and is_file(folder / SUMS):
        found |= sums(folder).keys()
    return found | {PROVENANCE, *CHECKPOINTS}


def sum_line(name: str, digest: str) -> str:
    """The line of a file in SUMS."""
    return f"{digest}  {name}\n"


def sums(folder: Path) -> dict[str, str]:
    """The SHA-256 of each file of fields, by its name, that SUMS has; none without that file."""
    try:
        lines = read(folder / SUMS, MOST_TABLE).decode(errors="replace").splitlines()
    except OSError:
        return {}
    return {match[2]: match[1] for match in map(SUM.fullmatch, lines) if match}


def prepare(folder: Path, own: Collection[str] = ()) -> None:
    """Make the folder of a run. ``own``: the files of an earlier run in it.

    Raises OutputError where it holds anything else, or cannot be made.
    """
    with usable(folder):
        foreign = strange(folder, own) if folder.exists() else []
        if foreign:
            raise OutputError(f"--out {folder}: it holds {foreign[0]!r}, which is not of a run; "
                              "a new or empty folder, or one of an earlier run, is accepted")
        (folder / "fields").mkdir(parents=True, exist_ok=True)


def strange(folder: Path, own: Collection[str] = ()) -> list[str]:
    """What is neither among these files nor made by a run that was killed before it had any."""
    tidy(folder)
    names = [path.name for path in folder.iterdir() if path.name not in (LOCK, "fields")]
    fields = folder / "fields"
    if is_folder(fields):
        names += [f"fields/{path.name}" for path in fields.iterdir()]
    elif os.path.lexists(fields):
        names.append("fields")
    return sorted(name for name in names if name not in own or not is_file(folder / name))


def refuse_links(folder: Path, own: Collection[str]) -> None:
    """Raises OutputError where a name that a run writes to is a link, or no file at all."""
    if os.path.lexists(folder / "fields") and not is_folder(folder / "fields"):
        raise OutputError(f"{folder / 'fields'}: it is no folder, or a link to one; a run's own "
                          "folder is needed there: move the files of the run into one")
    for name in sorted({*own, *OWN}):
        if os.path.lexists(folder / name) and not is_file(folder / name):
            raise OutputError(f"{folder / name}: it is a link, or no regular file, and so not of a "
                              "run; move it away")


def refuse_others(folder: Path, own: Collection[str]) -> None:
    """Raises OutputError where a file that is not among these has a name that a run gives."""
    with usable(folder):
        for name in strange(folder, own):
            if name in OWN or FIELDS.fullmatch(name):
                raise OutputError(f"{folder / name}: no run has written it; move it away")


def remove(folder: Path, names: Collection[str]) -> None:
    """Remove files of a run, by their names in its folder; links and whatever is no file stay."""
    with usable(folder):
        inside = is_folder(folder / "fields")
        for name in names:
            if is_file(folder / name) and (inside or not name.startswith("fields/")):
                (folder / name).unlink()


def tidy(folder: Path) -> None:
    """Remove what a run was writing when it was killed."""
    places = [folder, folder / "fields"] if is_folder(folder / "fields") else [folder]
    for place in places:
        for room in place.glob(WRITING + "*"):
            if ROOM.fullmatch(room.name) and is_folder(room):
                _empty(room)


def _empty(room: Path) -> None:
    """Remove a folder with the files of a run in it, but for what is none of these."""
    for part in room.iterdir():
        if PART.fullmatch(part.name) and is_file(part):
            part.unlink()
    with suppress(OSError):  # something else is there
        room.rmdir()


@contextmanager
def usable(folder: Path) -> Iterator[None]:
    """Tell any trouble with the folder as one of the output's."""
    try:
        yield
    except OSError as error:
        why = error.strerror or error
        needed = "a folder that can be written is needed"
        raise OutputError(f"--out {folder}: {why}; {needed}") from error


@contextmanager
def writing(path: Path) -> Iterator[None]:
    """Tell any trouble with a file as one of the output's."""
    try:
        yield
    except OSError as error:
        begun = path.name != PROVENANCE or is_file(path)
        then = "go on with --resume" if begun else "give the same command again"
        raise OutputError(f"{path}: {error.strerror or error}; what was written before is whole: "
                          f"make room, or give leave to write, and {then}") from error


def claimed(folder: Path, name: str, own: set[str]) -> Path:
    """The path of a file that a run is about to write, which from then on is among its ``own``.

    Raises OutputError where there is something that the run has not written.
    """
    if name not in own and os.path.lexists(folder / name):
        raise OutputError(f"{folder / name}: it is there, and this run has not written it; move it "
                          "away, and go on with --resume")
    own.add(name)
    return folder / name


@contextmanager
def locked(folder: Path, patience: float = 0.0) -> Iterator[None]:
    """Keep everybody else out of a folder, which is made where it is not there.

    The kernel releases the lock when the process ends, however that ends. Raises OutputError where
    another process has it for longer than `patience` seconds.
    """
    from filelock import FileLock, Timeout  # a twentieth of a second

    lock = FileLock(folder / LOCK, timeout=patience)
    with usable(folder):
        folder.mkdir(parents=True, exist_ok=True)
        _refuse_another_lock(folder / LOCK)
        try:
            lock.acquire()
        except Timeout:
            raise OutputError(f"--out {folder}: another process is writing there; another folder "
                              "is needed, or that process's end") from None
    try:
        yield
    finally:
        with suppress(OSError):
            (folder / LOCK).unlink(missing_ok=True)
        lock.release()


def _refuse_another_lock(path: Path) -> None:
    """Raises OSError where there is something with content, or no file, in the place of a lock."""
    if os.path.lexists(path) and not (is_file(path) and path.stat().st_size == 0):
        raise FileExistsError(errno.EEXIST, f"{path.name} is there and is no lock")
