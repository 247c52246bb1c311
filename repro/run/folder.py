"""The folder of a run: what may be in it, who may write there, and how trouble with it is told."""

from __future__ import annotations

import os
import re
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from repro.errors import OutputError
from repro.files import WRITING, is_file, is_folder, open_lock
from repro.run.checkpoint import NEWEST, PREVIOUS, REFUSED

LOCK = ".lock"
#: Everything that a run writes, beside its fields; a folder that holds anything else is not written to.
OWN = ("run.json", "timeseries.csv", "ledger.csv", "fields.pvd", "before_expansion.pvd", "report.html", "timeseries.nc",
       NEWEST, PREVIOUS, REFUSED)
FIELDS = re.compile(r"(?:fields|before_expansion)_\d{4,}\.vtu")
#: A folder in which a run was writing a file when it was killed, and what that may hold.
ROOM = re.compile(re.escape(WRITING) + r"\w{8}")
PART = re.compile(rf"(?:\.part-)?{FIELDS.pattern}|\.?(?:{'|'.join(map(re.escape, OWN))})(?:\.part)?")


def prepare(folder: Path) -> None:
    """Make the folder. Raises OutputError where it holds anything that is not a run's, or can't be made."""
    with usable(folder):
        strange = _strange(folder) if folder.exists() else []
        if strange:
            raise OutputError(f"--out {folder}: it holds {strange[0]!r}, which is not of a run; "
                              "a new or empty folder, or one of an earlier run, is accepted")
        (folder / "fields").mkdir(parents=True, exist_ok=True)


def clear(folder: Path) -> None:
    """Remove what a run has left, but for ``run.json``: it says that the rest is a run's."""
    with usable(folder):
        for old in (*(folder / "fields").iterdir(), *(folder / name for name in OWN[1:])):
            old.unlink(missing_ok=True)
        tidy(folder)


def tidy(folder: Path) -> None:
    """Remove what a run was writing when it was killed."""
    for room in (*folder.glob(WRITING + "*"), *(folder / "fields").glob(WRITING + "*")):
        if ROOM.fullmatch(room.name) and is_folder(room):
            _empty(room)


def _empty(room: Path) -> None:
    """Remove a folder with the files of a run in it, but for what is none of these."""
    for part in room.iterdir():
        if PART.fullmatch(part.name) and is_file(part):
            part.unlink()
    with suppress(OSError):  # something else is there
        room.rmdir()


def _strange(folder: Path) -> list[str]:
    """What no run has written there: tables count as a run's beside a run.json only, fields by their names."""
    tidy(folder)
    told = (*OWN, LOCK) if (folder / "run.json").exists() else (LOCK,)
    found = [path.name for path in folder.iterdir() if path.name not in (*told, "fields")]
    inside = sorted((folder / "fields").iterdir()) if (folder / "fields").is_dir() else []
    return sorted(found) + [f"fields/{path.name}" for path in inside if not FIELDS.fullmatch(path.name)]


@contextmanager
def usable(folder: Path) -> Iterator[None]:
    """Tell any trouble with the folder as one of the output's."""
    try:
        yield
    except OSError as error:
        why = error.strerror or error
        raise OutputError(f"--out {folder}: {why}; a folder that can be written is needed") from error


@contextmanager
def writing(path: Path) -> Iterator[None]:
    """Tell any trouble with a file as one of the output's."""
    try:
        yield
    except OSError as error:
        raise OutputError(f"{path}: {error.strerror or error}; what was written before is whole: make room, or give "
                          "leave to write, and go on with --resume") from error


@contextmanager
def held(folder: Path) -> Iterator[None]:
    """Keep everybody else out of the folder, which is made where it is not there.

    The lock is the kernel's and goes when the process does, however that ends. Raises OutputError where another run
    holds it.
    """
    with usable(folder):
        folder.mkdir(parents=True, exist_ok=True)
        number = _locked(folder)
    try:
        yield
    finally:
        with suppress(OSError):
            (folder / LOCK).unlink(missing_ok=True)
        os.close(number)


def _locked(folder: Path) -> int:
    """The descriptor of the locked file; another try where it was removed between opening and locking."""
    while True:
        number = open_lock(folder / LOCK)
        try:
            _exclude(number)
            with suppress(FileNotFoundError):
                if os.path.samestat(os.fstat(number), os.stat(folder / LOCK)):
                    return number
        except BlockingIOError:
            os.close(number)
            raise OutputError(f"--out {folder}: another run is writing there; another folder is needed, or "
                              "that run's end") from None
        os.close(number)


def _exclude(number: int) -> None:
    """Lock an open file. Raises BlockingIOError where another process has done so."""
    if sys.platform == "win32":
        import msvcrt
        try:
            msvcrt.locking(number, msvcrt.LK_NBLCK, 1)
        except OSError as error:
            raise BlockingIOError from error
    else:
        import fcntl
        fcntl.flock(number, fcntl.LOCK_EX | fcntl.LOCK_NB)
