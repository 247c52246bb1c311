"""`repro` as a separate process, and the contents of a run's folder."""

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
from repro.runs.execution import Watch, run
from tests.pages import cached_run

#: A scene that runs for about a second, with remeshes, and one that runs for several seconds.
SHORT = ("base", "--set", 'numerics.preset="fast"')
LONG = ("base", "--set", 'growth.end="4 h"')
#: Changes that make base a run of two steps and six rows, most of them within steps.
BRIEF = ('numerics.preset="fast"', 'growth.end="3 h"',
         'output.times=["0 h", "0.25 h", "0.5 h", "1 h", "2 h", "3 h"]')


def start(*arguments, threads="1", **options) -> subprocess.Popen:
    """Start `repro ARGUMENTS` with the signal handlers of an interactive shell."""
    code = ("import signal, sys; signal.signal(signal.SIGINT, signal.default_int_handler); "
            "from repro.cli import main; sys.exit(main(sys.argv[1:]))")
    names = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"), threads)
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True, **options}
    command = [sys.executable, "-c", code, *map(str, arguments)]
    return subprocess.Popen(command, env={**os.environ, **names}, **pipes)


def start_run(*arguments, **options) -> subprocess.Popen:
    """Start `repro run ARGUMENTS`."""
    return start("run", *arguments, **options)


def run_python(code: str, *arguments: str) -> subprocess.CompletedProcess:
    """Run Python code, which must succeed, in a process."""
    return subprocess.run([sys.executable, "-c", code, *arguments], capture_output=True, text=True, check=True)


def run_and_wait(*arguments, **options) -> tuple[int, str, str]:
    """Return exit status, stdout and stderr of `repro run ARGUMENTS`."""
    process = start_run(*arguments, **options)
    out, err = process.communicate(timeout=120)
    return process.returncode, out, err


def until(condition, seconds: float = 60) -> None:
    """Wait until a condition is true."""
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end, "it took too long"
        time.sleep(0.01)


def wait_for(condition, process: subprocess.Popen) -> None:
    """Wait until a condition is true or the process has ended."""
    until(lambda: condition() or process.poll() is not None, 120)


def files(folder: Path) -> dict[str, bytes]:
    """Return {name: content} of a folder, without the files that hold times: run.json, the page and the last state."""
    return {str(path.relative_to(folder)): path.read_bytes() for path in sorted(folder.rglob("*"))
            if path.is_file() and path.name not in ("run.json", "report.html", LAST)}


def read_record(folder: Path) -> dict:
    """Return the content of run.json without its checksum."""
    return read_sealed(folder / "run.json")


def rewrite(folder: Path, **changes) -> None:
    """Change entries of run.json and its checksum."""
    results.write_sealed(folder / "run.json", read_record(folder) | changes)


def flip(path: Path, place: int = -2) -> None:
    """Flip the lowest bit of one byte of a file."""
    content = bytearray(path.read_bytes())
    content[place] ^= 1
    path.write_bytes(content)


def rows(table: Path) -> list[dict[str, str]]:
    """Return the rows of a table as text."""
    return list(csv.DictReader(table.read_text(encoding="utf-8").splitlines()))


def lasting_record(folder: Path) -> dict:
    """Return run.json without wall times and resumes, and without the SHA-256 of files that hold them."""
    record = read_record(folder)
    record["sha256"] = {name: digest for name, digest in record["sha256"].items() if name not in ("report.html", LAST)}
    return {key: value for key, value in record.items() if not key.startswith("wall_time") and key != "resumes"}


def flags(*entries) -> list[str]:
    """Return the command-line arguments --set ENTRY of all entries."""
    return [part for entry in entries for part in ("--set", entry)]


def state(folder: Path) -> dict[Path, object]:
    """Return the paths of a folder, if it exists, with the modification time and the content of each file."""
    paths = [folder, *folder.rglob("*")] if folder.exists() else []
    return {path: path.is_file() and (path.stat().st_mtime_ns, path.read_bytes()) for path in paths}


def refusal(folder: Path, capsys, *arguments) -> str:
    """Return the message of `repro ARGUMENTS`, which ends with status 2 and one line and leaves a folder unchanged."""
    before = state(folder)
    capsys.readouterr()
    assert main([*map(str, arguments)]) == 2
    out, message = capsys.readouterr()
    assert (out, message.count("\n")) == ("", 1) and state(folder) == before
    return message


def resume_run(folder: Path, *options: str) -> int:
    """Return the exit status of `repro run --resume FOLDER --quiet`."""
    return main(["run", "--resume", str(folder), "--quiet", *options])


def stop_every(count: int):
    """Return a function that asks for a stop at every ``count``-th call."""
    calls = 0

    def stop():
        nonlocal calls
        calls += 1
        return signal.SIGTERM if calls % count == 0 else 0
    return stop


def interrupt_run(scene, folder: Path, after: int = 3) -> None:
    """Interrupt a run after some steps, with a checkpoint at every step."""
    with pytest.raises(Interrupted):
        run(scene, folder, watch=Watch(stop=stop_every(after), interval=0.0))


def matches_uninterrupted(scene, folder: Path) -> bool:
    """Return whether a folder has the files of the scene's uninterrupted run."""
    return files(folder) == files(cached_run(scene))
