"""`repro` as a process of its own, and what is in the folder of a run."""

from __future__ import annotations

import csv
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from repro import results
from repro.cli import main
from repro.errors import Interrupted
from repro.results.files import read_sealed
from repro.runs.checkpoint import LAST
from repro.runs.running import Watch, run
from tests.pages import whole_of

#: A scene of a second or so, with remeshes, and one of several seconds.
SHORT = ("base", "--set", 'numerics.preset="fast"')
LONG = ("base", "--set", 'growth.end="4 h"')
#: What makes base a run of two steps with six rows, most of them within steps.
BRIEF = ('numerics.preset="fast"', 'growth.end="3 h"',
         'output.times=["0 h", "0.25 h", "0.5 h", "1 h", "2 h", "3 h"]')


def started(*arguments, threads="1", **options) -> subprocess.Popen:
    """`repro run ARGUMENTS`, going; signals as in a shell of one's own."""
    code = ("import signal, sys; signal.signal(signal.SIGINT, signal.default_int_handler); "
            "from repro.cli import main; sys.exit(main(sys.argv[1:]))")
    names = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"), threads)
    given = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True, **options}
    command = [sys.executable, "-c", code, "run", *map(str, arguments)]
    return subprocess.Popen(command, env={**os.environ, **names}, **given)


def shell(*arguments, **options) -> tuple[int, str, str]:
    """Exit status, standard output and standard error of `repro run ARGUMENTS`."""
    process = started(*arguments, **options)
    out, err = process.communicate(timeout=120)
    return process.returncode, out, err


def wait_for(there, process: subprocess.Popen) -> None:
    """Until something is there, or the process has ended."""
    while not there() and process.poll() is None:
        time.sleep(0.01)


def files(folder: Path) -> dict[str, bytes]:
    """Every file of a folder by its name there, but those that tell times: run.json, the page and what a longer run
    goes on from."""
    return {str(path.relative_to(folder)): path.read_bytes() for path in sorted(folder.rglob("*"))
            if path.is_file() and path.name not in ("run.json", "report.html", LAST)}


def told(folder: Path) -> dict:
    """What run.json says, but for its own checksum."""
    return read_sealed(folder / "run.json")


def rewrite(folder: Path, **changes) -> None:
    """Change what run.json says, under a right checksum."""
    results.write_sealed(folder / "run.json", told(folder) | changes)


def flip(path: Path, place: int = -2) -> None:
    """Change the lowest bit of a byte of a file."""
    content = bytearray(path.read_bytes())
    content[place] ^= 1
    path.write_bytes(content)


def rows(table: Path) -> list[dict[str, str]]:
    """The rows of a table as they are written."""
    return list(csv.DictReader(table.read_text(encoding="utf-8").splitlines()))


def lasting(folder: Path) -> dict:
    """What run.json says but for times and counts of resumes, and the SHA-256 of files that tell them."""
    record = told(folder)
    record["sha256"] = {name: digest for name, digest in record["sha256"].items() if name not in ("report.html", LAST)}
    return {key: value for key, value in record.items() if not key.startswith("wall_time") and key != "resumes"}


def flags(*entries) -> list[str]:
    """Each entry as the command line has it: --set ENTRY."""
    return [part for entry in entries for part in ("--set", entry)]


def state(folder: Path) -> dict[Path, object]:
    """A folder, if it is there, and all that is in it; of each file the time at which it was written and its content.
    """
    there = [folder, *folder.rglob("*")] if folder.exists() else []
    return {path: path.is_file() and (path.stat().st_mtime_ns, path.read_bytes()) for path in there}


def refused(folder: Path, capsys, *arguments) -> str:
    """What is said of `repro ARGUMENTS` that is refused, with status 2 and one line, and changes nothing in a folder.
    """
    before = state(folder)
    capsys.readouterr()
    assert main([*map(str, arguments)]) == 2
    out, message = capsys.readouterr()
    assert (out, message.count("\n")) == ("", 1) and state(folder) == before
    return message


def resumed(folder: Path, *options: str) -> int:
    """The exit status of `repro run --resume FOLDER --quiet`."""
    return main(["run", "--resume", str(folder), "--quiet", *options])


def every(count: int):
    """Says stop at each so-manieth step."""
    calls = 0

    def stop():
        nonlocal calls
        calls += 1
        return signal.SIGTERM if calls % count == 0 else 0
    return stop


def stopped(scene, folder: Path, after: int = 3) -> None:
    """A run that was stopped after so many steps, with a checkpoint of every one."""
    with pytest.raises(Interrupted):
        run(scene, folder, watch=Watch(stop=every(after), interval=0.0))


def as_whole(scene, folder: Path) -> bool:
    """Are the files of a folder those of the scene's run without an interruption?"""
    return files(folder) == files(whole_of(scene))
