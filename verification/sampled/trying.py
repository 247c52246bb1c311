"""Tests run in a copy of the project, one process each time, within a limit.

The process is forked from one that has imported the packages that tests need, but nothing of the project, which costs
seconds otherwise. What it imports of the project is the copy's, and so is what the processes that it starts import.

Which tests call which functions of ``repro/``, and what each test costs: measured once, file by file of tests.

A map of a file of tests is kept until the file changes; a change of ``repro/`` moves lines but few calls, so functions
are known by name. All are measured anew with ``--reach``.
"""

from __future__ import annotations

import ast
import contextlib
import hashlib
import json
import os
import resource
import runpy
import shutil
import signal
import sys
import time
import traceback
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from functools import cached_property
from importlib import import_module
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest

from verification.kernel.writing import append, lines

ROOT = Path(__file__).parents[2]
TRACER = Path(__file__).parent / "tracer"
NOT_COPIED = (".git", ".venv", "__pycache__", "live", "out", "cache", "dist", "build", "*.egg-info", ".*_cache")
#: What most tests import; what is absent is left to them.
HEAVY = ("pytest", "numpy", "scipy.sparse.linalg", "scipy.spatial", "scipy.optimize", "skfem", "matplotlib.pyplot",
         "shapely", "mmgpy", "meshio", "pint", "tqdm", "xarray", "sympy")
#: What pytest ends with where no test that it collected fails: all pass, those that failed are told by themselves, or
#: there is none to run.
NOTHING_WRONG = (0, 1, 4, 5)
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
    plugins: list[object] = [teller, _Chooser(tests)]
    if reach:
        plugins.append(_Marker(runpy.run_path(str(TRACER / "sitecustomize.py"))["note"].__globals__))
    stop = [] if every else ["-x"]
    return int(pytest.main([*stop, "-q", "-n0", "-p", "no:cacheprovider", "--tb=line", *_files(tests)], plugins))


def _files(tests: list[str]) -> list[str]:
    """The files of some tests, in their order."""
    return list(dict.fromkeys(test.partition("::")[0] for test in tests))


class _Chooser:
    """Keeps the tests that are asked for by their ids, in that order. One that is there no more, such as one that is
    named after a value which a mutant changes, is left out: pytest would refuse to run any with it."""

    def __init__(self, tests: list[str]) -> None:
        self._places = {test: place for place, test in enumerate(tests) if "::" in test}

    @pytest.hookimpl(tryfirst=True)
    def pytest_collection_modifyitems(self, items: list) -> None:
        if self._places:
            chosen = [item for item in items if item.nodeid in self._places]
            items[:] = sorted(chosen, key=lambda item: self._places[item.nodeid])


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
        self._tell(collected=wide)

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


def _judged(path: Path, status: int, seconds: float, limit: float) -> Ran:
    rows = lines(path)
    failed = [row for row in rows if row.get("outcome") == "failed"]
    if failed:
        return Ran(failed[0]["test"], failed[0]["how"], seconds=seconds)
    if rows and "ends" in rows[-1]:
        if rows[-1]["ends"] in NOTHING_WRONG:
            return Ran(seconds=seconds)
        return Ran("pytest", f"exit status {rows[-1]['ends']}", seconds=seconds)
    started = [row for row in rows if "starts" in row]
    where = started[-1]["starts"] if started else "collection"
    after = max(limit - started[-1]["spent"], 0.0) if started else limit
    if os.WIFSIGNALED(status) and os.WTERMSIG(status) in (signal.SIGXCPU, signal.SIGKILL):
        return Ran(stopped=where, after=after, seconds=seconds)
    return Ran(where, f"the process ended with status {status}", seconds=seconds)


LIVE = ROOT / "verification" / "report" / "live"
MAP = LIVE / "sampled-reach.jsonl"
#: Tests of what the code's text is, not of what it does: any change of it is one to them.
OF_TEXT = {"test_mutants.py", "test_architecture.py", "test_published.py", "test_sampled.py"}
AT_IMPORT = {"<listcomp>", "<setcomp>", "<dictcomp>", "<genexpr>"}
#: Seconds of processor time that one file of tests may take, traced.
LONGEST = 900


#: A function: the file in repro/ and its qualified name.
Call = tuple[str, str]


@dataclass(frozen=True)
class Measured:
    """A test: its file and name, seconds with the fixtures that it shares, (file, function) that it calls."""

    id: str
    seconds: float
    calls: frozenset[Call] = field(repr=False)


@dataclass(frozen=True)
class Reach:
    """All tests that pass, the cheapest first."""

    tests: tuple[Measured, ...]

    @cached_property
    def by_function(self) -> dict[Call, list[Measured]]:
        """Tests by the (file, function) that they call."""
        found: dict[Call, list[Measured]] = {}
        for test in self.tests:
            for call in test.calls:
                found.setdefault(call, []).append(test)
        return found

    def of(self, file: str, source: str, line: int, whole: bool = False) -> list[Measured]:
        """Tests that a change in a line can be seen by, the cheapest first: those that call the function it is in; of
        what runs at import, those that call what is defined there, or a function that names it; else all. ``whole``:
        of what runs at import, all."""
        inside = set(functions(source, line))
        if whole and not inside:
            return list(self.tests)
        calls = {(file, name) for name in inside} if inside else self._naming(file, defined(source, line))
        return [test for test in self.tests if test.calls & calls] or list(self.tests)

    def _naming(self, file: str, names: set[str]) -> set[Call]:
        """Functions of the code defined in, or naming, one of some names of a file."""
        return {call for call in self.by_function
                if (call[0] == file and call[1].split(".")[0] in names) or names & mentioned(*call)}


def functions(source: str, line: int) -> Iterator[str]:
    """Qualified names of the functions, comprehensions and lambdas that execute something in a line; a comprehension of
    a module runs at import."""
    def walk(code) -> Iterator[str]:
        for inner in code.co_consts:
            if hasattr(inner, "co_lines"):
                is_class = not inner.co_flags & 2
                at_import = is_class or inner.co_qualname in AT_IMPORT
                if not at_import and any(number == line for *_, number in list(inner.co_lines())[1:]):
                    yield inner.co_qualname
                yield from walk(inner)
    return walk(compile(source, "", "exec"))


def defined(source: str, line: int) -> set[str]:
    """Names that the outermost statement in a line defines."""
    for node in ast.parse(source).body:
        first = min([node.lineno, *(part.lineno for part in getattr(node, "decorator_list", []))])
        if first <= line <= node.end_lineno:
            if isinstance(node, ast.FunctionDef | ast.ClassDef):
                return {node.name}
            names = [part for part in ast.walk(node) if isinstance(part, ast.Name)]
            return {part.id for part in names if isinstance(part.ctx, ast.Store)}
    return set()


_MENTIONED: dict[str, dict[str, set[str]]] = {}


def mentioned(file: str, name: str) -> set[str]:
    """Names that occur in a function of a file."""
    if file not in _MENTIONED:
        path = ROOT / "repro" / file
        tree = ast.parse(path.read_text(encoding="utf-8")) if path.exists() else ast.parse("")
        _MENTIONED[file] = dict(_names(tree, ""))
    return _MENTIONED[file].get(name, set())


def _names(node: ast.AST, prefix: str) -> Iterator[tuple[str, set[str]]]:
    for part in ast.iter_child_nodes(node):
        if isinstance(part, ast.FunctionDef):
            inner = list(ast.walk(part))
            names = {each.id for each in inner if isinstance(each, ast.Name)}
            yield prefix + part.name, names | {each.attr for each in inner if isinstance(each, ast.Attribute)}
            yield from _names(part, f"{prefix}{part.name}.<locals>.")
        elif isinstance(part, ast.ClassDef):
            yield from _names(part, f"{prefix}{part.name}.")
        else:
            yield from _names(part, prefix)


def measured(anew: bool = False) -> Reach:
    """The map, with those files of tests run that have changed since, or all."""
    kept = {} if anew else _kept()
    paths = [path for path in sorted((ROOT / "tests").glob("test_*.py")) if path.name not in OF_TEXT]
    wanted = {path.name: _digest(path) for path in paths}
    due = [name for name, digest in wanted.items() if kept.get(name, {}).get("digest") != digest]
    if due:
        with copied() as there:
            for name in due:
                kept[name] = {"file": name, "digest": wanted[name], **packed(_measure(there, name))}
                append(kept[name], MAP)
                print(f"reach: {name}: {len(kept[name]['tests'])} tests", flush=True)
    return Reach(tuple(sorted(_tests(kept[name] for name in wanted), key=lambda test: test.seconds)))


def _kept() -> dict[str, dict]:
    return {row["file"]: row for row in lines(MAP)}


def _digest(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()[:16]


def packed(measured: dict[str, tuple[float, list[Call]]]) -> dict:
    """Tests as they are kept: functions once, and by their number."""
    every = sorted({call for _, calls in measured.values() for call in calls})
    numbers = {call: number for number, call in enumerate(every)}
    tests = {id: (seconds, list(map(numbers.get, calls))) for id, (seconds, calls) in measured.items()}
    return {"functions": every, "tests": tests}


def _tests(rows: Iterable[dict]) -> Iterator[Measured]:
    for row in rows:
        every = [tuple(call) for call in row["functions"]]
        for id, (seconds, numbers) in row["tests"].items():
            yield Measured(id, seconds, frozenset(every[number] for number in numbers))


def _measure(there: Path, name: str) -> dict[str, tuple[float, list[Call]]]:
    """{test: (seconds, [(file, function), ...])} of the tests of a file that pass, by a run of it."""
    calls_file = there.parent / "calls"
    calls_file.unlink(missing_ok=True)
    run(there, [f"tests/{name}"], LONGEST, calls_file, every=True)
    rows = lines(there.parent / "told")
    calls: dict[str, set] = {}
    for line in calls_file.read_text(encoding="utf-8").splitlines() if calls_file.exists() else []:
        parts = line.split("\t")
        if len(parts) == 4:
            calls.setdefault(parts[0], set()).add((parts[1], parts[3]))
    shared = {id: names for row in rows for id, names in row.get("collected", {}).items()}
    reports = [row for row in rows if "outcome" in row]
    bad = {row["test"] for row in reports if row["outcome"] != "passed"}
    setups: dict[str, float] = {}
    for row in reports:
        for name in shared.get(row["test"], ()):
            setups[name] = max(setups.get(name, 0.0), row["seconds"])
    found = {}
    for id in shared:
        own = sum(row["seconds"] for row in reports if row["test"] == id)
        there_too = set().union(calls.get(id, set()), *(calls.get(f"fixture {name}", set()) for name in shared[id]))
        if id not in bad and sum(row["test"] == id for row in reports) == 3:  # made ready, run, cleared away
            found[id] = (round(max([own, *(setups[name] for name in shared[id])]), 3), sorted(there_too))
    return found
