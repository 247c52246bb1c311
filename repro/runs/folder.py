"""The folder of a run: the run's own files, its lock, and errors of the file system.

A run removes and replaces only regular files that it has written itself. These are the files in
its ``run.json``, the fields in its ``fields.sha256`` (listed before they are written), and its
checkpoints.
"""

import errno
import os
import re
import warnings
from collections.abc import Collection, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from repro.errors import OutputError, printable
from repro.results.field_files import NAME as FIELDS
from repro.results.files import MOST_TABLE, WRITING, is_file, is_folder, read
from repro.runs.checkpoint import LAST, REFUSED, STATES

LOCK = ".lock"
#: Seconds in which a lock without flock is taken over from a process that has ended.
TAKE_OVER = 1.0
PROVENANCE = "run.json"
REPORT = "report.html"
SUMS = "fields.sha256"
#: Files that are removed when a run has finished.
CHECKPOINTS = (*STATES, REFUSED)
#: Every file that a run may write, except its fields.
RUN_FILES = (PROVENANCE, "timeseries.csv", "ledger.csv", "fields.pvd", "before_expansion.pvd", SUMS,
             REPORT, *CHECKPOINTS, LAST)


def is_own(name: str) -> bool:
    """May a run write a file of this name?"""
    return name in RUN_FILES or FIELDS.fullmatch(name) is not None


def list_written_files(folder: Path, record: dict) -> set[str]:
    """Names of the files that a run has written, from its ``run.json`` (record) and its SUMS.

    Checkpoints are always included: a run killed at its very end may leave unlisted ones. Raises
    OutputError if the record has no list of files.
    """
    if not isinstance(record.get("files"), list):
        raise OutputError(f"{folder}: run.json lists no files of a run; move the folder away, or "
                          "name another")
    names = {name for name in map(str, record["files"])
             if is_own(name) or name == "timeseries.nc"}  # runs of earlier versions wrote it
    if SUMS in names and is_file(folder / SUMS):
        names |= read_sums(folder).keys()
    return names | {PROVENANCE, *CHECKPOINTS}


def sum_line(name: str, digest: str) -> str:
    """Format the line of a file in SUMS."""
    return f"{digest}  {name}\n"


def read_sums(folder: Path) -> dict[str, str]:
    """Read {file name: SHA-256} of the fields from SUMS; empty if that file is missing."""
    try:
        lines = read(folder / SUMS, MOST_TABLE).decode(errors="replace").splitlines()
    except OSError:
        return {}
    parts = (line.partition("  ") for line in lines)
    return {name: digest for digest, _, name in parts
            if re.fullmatch("[0-9a-f]{64}", digest) and FIELDS.fullmatch(name)}


def prepare(folder: Path, run_files: Collection[str] = ()) -> None:
    """Create the folder of a run; run_files: the files of an earlier run in it.

    Raises OutputError if the folder contains any other file, or cannot be created.
    """
    with folder_errors(folder):
        foreign = find_foreign(folder, run_files) if folder.exists() else []
        if foreign:
            raise OutputError(f"--out {folder}: it contains {foreign[0]!r}, which is not of a "
                              "run; give a new folder, an empty one, or the folder of a run")
        (folder / "fields").mkdir(parents=True, exist_ok=True)


def find_foreign(folder: Path, run_files: Collection[str] = ()) -> list[str]:
    """Names of the files in a folder that are not in ``run_files``; removes temporary files."""
    remove_temporary(folder)
    names = [path.name for path in folder.iterdir() if path.name not in (LOCK, "fields")]
    fields = folder / "fields"
    if is_folder(fields):
        names += [f"fields/{path.name}" for path in fields.iterdir()]
    elif os.path.lexists(fields):
        names.append("fields")
    return sorted(name for name in names if name not in run_files or not is_file(folder / name))


def refuse_links(folder: Path, run_files: Collection[str]) -> None:
    """Raise OutputError if a name that a run writes to is a link, or not a regular file."""
    if os.path.lexists(folder / "fields") and not is_folder(folder / "fields"):
        raise OutputError(f"{folder / 'fields'}: it is a file or a link, and a run needs a folder "
                          "of its own there: move the files of the run into one")
    for name in sorted({*run_files, *RUN_FILES}):
        if os.path.lexists(folder / name) and not is_file(folder / name):
            raise OutputError(f"{folder / name}: it is not a regular file, so no run has written "
                              "it; move it away")


def refuse_foreign(folder: Path, run_files: Collection[str]) -> None:
    """Raise OutputError if a file that no run has written has a name that a run uses."""
    with folder_errors(folder):
        for name in find_foreign(folder, run_files):
            if is_own(name):
                raise OutputError(f"{folder / name}: no run has written it; move it away")


def remove(folder: Path, names: Collection[str]) -> None:
    """Remove files of a run by their names in its folder, if they are regular files."""
    with folder_errors(folder):
        inside = is_folder(folder / "fields")
        for name in names:
            if is_file(folder / name) and (inside or not name.startswith("fields/")):
                (folder / name).unlink()


def remove_temporary(folder: Path) -> None:
    """Remove the temporary files of a run that was killed, and their folders if then empty."""
    folders = [folder, folder / "fields"] if is_folder(folder / "fields") else [folder]
    for temporary in (path for parent in folders for path in parent.glob(WRITING + "*")):
        if re.fullmatch(rf"{re.escape(WRITING)}\w{{8}}", temporary.name) and is_folder(temporary):
            for file in temporary.iterdir():
                if (is_own(file.name) or is_own(f"fields/{file.name}")) and is_file(file):
                    file.unlink()
            with suppress(OSError):  # it contains another file
                temporary.rmdir()


def refuse_null(folder: Path) -> None:
    """Raise OutputError if a path, which Python may have made, has a null byte."""
    if "\0" in str(folder):
        raise OutputError(f"--out {printable(str(folder))}: a path has no null byte; give another "
                          "folder")


@contextmanager
def folder_errors(folder: Path) -> Iterator[None]:
    """Convert errors of the file system into OutputError for the folder."""
    try:
        yield
    except OSError as error:
        raise OutputError(f"--out {folder}: {error.strerror or error}; a folder that can be "
                          "written is needed") from error


@contextmanager
def file_errors(path: Path) -> Iterator[None]:
    """Convert errors of the file system into OutputError for a file."""
    try:
        yield
    except OSError as error:
        resumable = path.name != PROVENANCE or is_file(path)
        advice = "use --resume" if resumable else "repeat the command"
        raise OutputError(f"{path}: {error.strerror or error}; all earlier results are complete; "
                          f"free space or permit writing, and {advice}") from error


def claim(folder: Path, name: str, run_files: set[str]) -> Path:
    """Add the name of a file that a run is about to write to its ``run_files``; return its path.

    Raises OutputError if a file of that name exists that the run has not written.
    """
    if name not in run_files and os.path.lexists(folder / name):
        raise OutputError(f"{folder / name}: it exists, and this run has not written it; move it "
                          "away, and use --resume")
    run_files.add(name)
    return folder / name


@contextmanager
def locked(folder: Path, patience: float = 0.0) -> Iterator[None]:
    """Lock a folder; create it if it does not exist.

    The kernel releases the lock when the process ends for any reason. On a file system without
    flock, the file of the lock names its process, and a process of the same machine that has ended
    has no lock. Raises OutputError if another process has the lock for longer than `patience`
    seconds.
    """
    from filelock import FileLock, SoftFileLock, Timeout  # its import takes a twentieth of a second

    path = folder / LOCK
    lock = FileLock(folder / LOCK, timeout=max(patience, TAKE_OVER))
    with folder_errors(folder):
        folder.mkdir(parents=True, exist_ok=True)
        is_lock = is_file(path) and (path.stat().st_size == 0 or SoftFileLock(path).pid is not None)
        if os.path.lexists(path) and not is_lock:
            raise FileExistsError(errno.EEXIST, f"{LOCK} exists and is not a lock")
        try:
            with warnings.catch_warnings(action="ignore"):  # there is no flock
                lock.acquire()
        except Timeout:
            advice = "wait for its end, or give another folder"
            if isinstance(lock, SoftFileLock):
                advice += f"; if no process writes there, remove {path}"
            raise OutputError(f"--out {folder}: another process is writing there; "
                              f"{advice}") from None
    try:
        yield
    finally:
        with suppress(OSError):
            path.unlink(missing_ok=True)
        lock.release()
