"""Tests run in a copy of the project, one process each time, within a limit.

The process is forked from one that has imported the packages that tests need, but nothing of the project, which costs
seconds otherwise. What it imports of the project is the copy's, and so is what the processes that it starts import.
"""

from __future__ import annotations

import contextlib
import json
import os
import resource
import runpy
import shutil
import signal
import sys
import time
import traceback
from collections.abc import Iterator
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest

ROOT = Path(__file__).parents[2]
TRACER = Path(__file__).parent / "tracer"
NOT_COPIED = (".git", ".venv", "__pycache__", "live", "out", "cache", "dist", "build", "*.egg-info", ".*_cache")
#: What most tests import; what is absent is left to them.
HEAVY = ("pytest", "numpy", "scipy.sparse.linalg", "scipy.spatial", "scipy.optimize", "skfem", "matplotlib.pyplot",
         "shapely", "mmgpy", "meshio", "pint", "tqdm", "xarray", "sympy")
#: Seconds on the clock a second of processor time may take, on a machine that others use too.
PATIENCE = 4


@dataclass(frozen=True)
class Ran:
    """What came of some tests: the first that ``failed`` and how, or the one ``stopped`` in at the limit."""

    failed: str = ""
    how: str = ""
    stopped: str = ""
    #: Seconds of processor time that the test had taken until it was stopped.
    after: float = 0.0
    #: Seconds on the clock of all.
    seconds: float = 0.0


class TryingError(RuntimeError):
    """Tests could not be run at all."""


@contextlib.contextmanager
def copied() -> Iterator[Path]:
    """A copy of the project in a temporary folder."""
    with TemporaryDirectory(prefix="sampled-", ignore_cleanup_errors=True) as folder:
        there = Path(folder).resolve() / "project"
        shutil.copytree(ROOT, there, ignore=shutil.ignore_patterns(*NOT_COPIED))
        yield there


def prepare() -> None:
    """Import what is heavy, once for all processes that are forked later."""
    for name in HEAVY:
        with contextlib.suppress(ImportError):
            import_module(name)


def run(there: Path, tests: list[str], limit: float, reach: Path | None = None, every: bool = False) -> Ran:
    """Run tests in the copy ``there``, in the order given, to the first that fails, or ``every`` one; ``limit``:
    seconds of processor time. With ``reach`` that file gets the functions which they call."""
    told = there.parent / "told"
    told.unlink(missing_ok=True)
    began = time.monotonic()
    child = os.fork()
    if not child:
        _in_child(there, tests, limit, told, reach, every)
    status = _waited(child, limit * PATIENCE)
    return _judged(told, status, time.monotonic() - began, limit)


def _in_child(there: Path, tests: list[str], limit: float, told: Path, reach: Path | None, every: bool) -> None:
    code = 70
    try:
        os.setsid()
        resource.setrlimit(resource.RLIMIT_CPU, (int(limit), int(limit) + 5))
        signal.signal(signal.SIGXCPU, signal.SIG_DFL)
        _enter(there, reach)
        code = _tested(tests, _Teller(told), bool(reach), every)
    except BaseException:
        traceback.print_exc()
    finally:
        os._exit(code)


def _enter(there: Path, reach: Path | None) -> None:
    """Let this process and its children see the copy and nothing of the checkout that it was made of."""
    nowhere = os.open(there.parent / "printed", os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
    os.dup2(nowhere, 1)
    os.dup2(nowhere, 2)
    os.dup2(os.open(os.devnull, os.O_RDONLY), 0)
    os.chdir(there)
    for name in [name for name in sys.modules if name.split(".")[0] in ("verification", "repro", "tests")]:
        del sys.modules[name]
    outside = [path for path in os.environ.get("PYTHONPATH", "").split(os.pathsep) if path and Path(path) != ROOT]
    sys.path[:] = [str(there), *(path for path in sys.path if path not in ("", str(ROOT), str(there)))]
    os.environ.update(PYTHONPATH=os.pathsep.join([str(there), *outside]), HOME=str(there.parent))
    os.environ.pop("PYTHONDONTWRITEBYTECODE", None)  # the copy keeps what is compiled
    sys.dont_write_bytecode = False
    if reach:
        os.environ.update(PYTHONPATH=os.pathsep.join([str(TRACER), str(there), *outside]), REACH_FILE=str(reach),
                          REACH_ROOT=str(there / "repro"), REACH_TEST="")


def _tested(tests: list[str], teller: _Teller, reach: bool, every: bool) -> int:
    plugins: list[object] = [teller]
    if reach:
        plugins.append(_Marker(runpy.run_path(str(TRACER / "sitecustomize.py"))["note"].__globals__))
    stop = [] if every else ["-x"]
    return int(pytest.main([*stop, "-q", "-n0", "-p", "no:cacheprovider", "--tb=line", *tests], plugins))


class _Teller:
    """Writes what tests do to a file, a line of JSON each."""

    def __init__(self, path: Path) -> None:
        self._file = path.open("w", encoding="utf-8")
        self._spent = _processor()

    def _tell(self, **what: object) -> None:
        self._file.write(json.dumps(what) + "\n")
        self._file.flush()

    def pytest_collection_modifyitems(self, items: list) -> None:
        wide = {item.nodeid: _wide(item) for item in items}
        self._tell(collected={test: names for test, names in wide.items()})

    def pytest_runtest_logstart(self, nodeid: str) -> None:
        self._tell(starts=nodeid, spent=_processor())

    def pytest_runtest_logreport(self, report) -> None:
        how = str(getattr(report, "longreprtext", ""))
        before, self._spent = self._spent, _processor()
        self._tell(test=report.nodeid, outcome=report.outcome, seconds=self._spent - before, how=how[-400:])

    def pytest_collectreport(self, report) -> None:
        if report.failed:
            self._tell(test=report.nodeid, outcome="failed", seconds=0.0, how=str(report.longreprtext)[-400:])

    def pytest_sessionfinish(self, exitstatus: int) -> None:
        self._tell(ends=int(exitstatus))


def _processor() -> float:
    """Seconds of processor time of this process, and of its children that have ended."""
    return sum(os.times()[:4])


def _wide(item) -> list[str]:
    """Names of the fixtures of a test that are made once for several tests."""
    found = getattr(item, "_fixtureinfo", None)
    definitions = found.name2fixturedefs.items() if found else ()
    return [name for name, defined in definitions if defined[-1].scope != "function"]


class _Marker:
    """Tells the tracer which test, or which fixture for several tests, makes the calls."""

    def __init__(self, tracer: dict) -> None:
        self._tracer = tracer

    def _set(self, name: str) -> str:
        before = self._tracer["test"]
        self._tracer["test"] = os.environ["REACH_TEST"] = name
        return before

    def pytest_runtest_logstart(self, nodeid: str) -> None:
        self._set(nodeid)

    @pytest.hookimpl(wrapper=True)
    def pytest_fixture_setup(self, fixturedef):
        before = self._tracer["test"]
        if fixturedef.scope != "function":
            self._set("fixture " + fixturedef.argname)
        found = yield
        self._set(before)
        return found

    def pytest_runtest_logfinish(self) -> None:
        self._set("")


def _waited(child: int, longest: float) -> int:
    """Wait for a child, and end all that it started; its exit status, or that of a process ended at the limit."""
    ends = time.monotonic() + longest
    pause = 0.02
    done, status = os.waitpid(child, os.WNOHANG)
    while not done and time.monotonic() < ends:
        time.sleep(pause)
        pause = min(1.2 * pause, 0.5)
        done, status = os.waitpid(child, os.WNOHANG)
    with contextlib.suppress(ProcessLookupError):
        os.killpg(child, signal.SIGKILL)
    return status if done else os.waitpid(child, 0)[1]


def told(path: Path) -> list[dict]:
    """Lines that a run has written; the last one may be cut."""
    rows = []
    for line in path.read_text(encoding="utf-8").splitlines() if path.exists() else []:
        with contextlib.suppress(json.JSONDecodeError):
            rows.append(json.loads(line))
    return rows


def _judged(path: Path, status: int, seconds: float, limit: float) -> Ran:
    rows = told(path)
    failed = [row for row in rows if row.get("outcome") == "failed"]
    if failed:
        return Ran(failed[0]["test"], failed[0]["how"], seconds=seconds)
    if rows and "ends" in rows[-1]:
        if rows[-1]["ends"] in (0, 1):
            return Ran(seconds=seconds)
        return Ran("pytest", f"exit status {rows[-1]['ends']}", seconds=seconds)
    started = [row for row in rows if "starts" in row]
    where = started[-1]["starts"] if started else "collection"
    after = max(limit - started[-1]["spent"], 0.0) if started else limit
    if os.WIFSIGNALED(status) and os.WTERMSIG(status) in (signal.SIGXCPU, signal.SIGKILL):
        return Ran(stopped=where, after=after, seconds=seconds)
    return Ran(where, f"the process ended with status {status}", seconds=seconds)
