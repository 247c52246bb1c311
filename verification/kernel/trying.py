"""Changed code, tried: a copy of the project, and tests that are run in it, in one process, within a limit.

What the process imports of the project is the copy's, and so is what the processes that it starts import. What the
tests do there, and which functions they call, it writes to files (``tracer/telling.py``, ``tracer/sitecustomize.py``).
"""

from __future__ import annotations

import contextlib
import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

from verification.evidence.writing import ROOT, lines

TRACER = Path(__file__).parent / "tracer"
NOT_COPIED = (".git", ".venv", "__pycache__", "live", "out", "cache", "dist", "build", "*.egg-info", ".*_cache")
#: What pytest ends with where no test that it collected fails: all pass, or there is none to run.
NOTHING_WRONG = (0, 4, 5)
#: What Linux tells of a process's largest memory begins with that of the process which started it: a small one.
SHELL = ("sh", "-c", '"$0" "$@"; exit $?')
#: How one ends that is ended at the limit: by itself, as the shell tells it, or with the shell.
ENDED = (128 + signal.SIGXCPU, 128 + signal.SIGKILL, -signal.SIGKILL)
#: Seconds on the clock a second of processor time may take, on a machine that others use too.
PATIENCE = 4


@dataclass(frozen=True)
class Ran:
    """What came of some tests: the rows that they told, the exit status of their process, and seconds on the clock."""

    rows: list[dict]
    status: int
    seconds: float

    @property
    def reports(self) -> list[dict]:
        """Of each test as it was made ready, run and cleared away: "test", "outcome", "how" and "seconds"."""
        return [row for row in self.rows if "outcome" in row]

    @property
    def failures(self) -> list[tuple[str, str]]:
        """(test, how) of those that failed, or of the one that the process ended in by itself."""
        told = [(row["test"], row["how"]) for row in self.reports if row["outcome"] == "failed"]
        if told or self.status in NOTHING_WRONG + ENDED:
            return told
        return [(self.last["starts"], f"the process ended with status {self.status}")]

    @property
    def last(self) -> dict:
        """The test that "starts" last, and the seconds of processor time "spent" before."""
        return [row for row in self.rows if "starts" in row][-1]


@contextlib.contextmanager
def copied() -> Iterator[Path]:
    """A copy of the project in a temporary folder."""
    with TemporaryDirectory(prefix="tried-", ignore_cleanup_errors=True) as folder:
        there = Path(folder).resolve() / "project"
        shutil.copytree(ROOT, there, ignore=shutil.ignore_patterns(*NOT_COPIED))
        yield there


def run(there: Path, tests: Iterable[str], limit: float, every: bool = False, traced: bool = False) -> Ran:
    """Run tests in the copy ``there``, in the order given, to the first that fails, or ``every`` one; ``limit``:
    seconds of processor time. ``traced``: the functions which they call go to the file "calls" beside the copy."""
    beside = there.parent
    for name in ("told", "calls"):
        (beside / name).unlink(missing_ok=True)
    (beside / "asked").write_text("\n".join(tests), encoding="utf-8")
    files = dict.fromkeys(test.partition("::")[0] for test in tests)
    paths = {"PYTHONPATH": f"{TRACER}{os.pathsep}{there}", "HOME": str(beside), "TRIED": str(beside),
             "LIMIT": str(int(limit)), "PYTHONDONTWRITEBYTECODE": ""}  # compiled is kept
    reach = {"REACH_FILE": str(beside / "calls"), "REACH_ROOT": str(there / "repro")} if traced else {}
    began = time.monotonic()
    child = subprocess.Popen(
        [*SHELL, sys.executable, "-m", "pytest", *(() if every else ("-x",)), "-n0", "-p", "no:cacheprovider", "-p",
         "telling", "--tb=line", *files], cwd=there, env={**os.environ, **paths, **reach},
        stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True)
    status = _waited(child, limit * PATIENCE)
    return Ran(lines(beside / "told"), status, time.monotonic() - began)


def _waited(child: subprocess.Popen, longest: float) -> int:
    """Wait for a child, and end all that it started; its exit status, or that of a process ended at the limit."""
    with contextlib.suppress(subprocess.TimeoutExpired):
        child.wait(longest)
    with contextlib.suppress(ProcessLookupError):
        os.killpg(child.pid, signal.SIGKILL)
    return child.wait()
