"""Tests run in a copy of the project, one process each time, within a limit.

What the process imports of the project is the copy's, and so is what the processes that it starts import. What the
tests do there, and which functions they call, it writes to files (``tracer/telling.py``, ``tracer/sitecustomize.py``).

Which tests call which functions of ``repro/``, and what each test costs: measured once, file by file of tests. A map of
a file of tests is kept until the file changes; a change of ``repro/`` moves lines but few calls, so functions are known
by name. Without the file of maps all are measured anew.
"""

from __future__ import annotations

import ast
import contextlib
import hashlib
import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from tempfile import TemporaryDirectory

from verification.kernel.writing import append, lines

ROOT = Path(__file__).parents[2]
TRACER = Path(__file__).parent / "tracer"
NOT_COPIED = (".git", ".venv", "__pycache__", "live", "out", "cache", "dist", "build", "*.egg-info", ".*_cache")
#: What pytest ends with where no test that it collected fails: all pass, those that failed are told by themselves, or
#: there is none to run.
NOTHING_WRONG = (0, 1, 4, 5)
#: What Linux tells of a process's largest memory begins with that of the process which started it: a small one.
SHELL = ("sh", "-c", '"$0" "$@"; exit $?')
#: How one ends that is ended at the limit: by itself, as the shell tells it, or with the shell.
ENDED = (128 + signal.SIGXCPU, 128 + signal.SIGKILL, -signal.SIGKILL)
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


def run(there: Path, tests: list[str], limit: float, reach: Path | None = None, every: bool = False) -> Ran:
    """Run tests in the copy ``there``, in the order given, to the first that fails, or ``every`` one; ``limit``:
    seconds of processor time. With ``reach`` that file gets the functions which they call."""
    told, asked = there.parent / "told", there.parent / "asked"
    told.unlink(missing_ok=True)
    asked.write_text("\n".join(tests), encoding="utf-8")
    files = dict.fromkeys(test.partition("::")[0] for test in tests)
    stop = [] if every else ["-x"]
    outside = [path for path in os.environ.get("PYTHONPATH", "").split(os.pathsep) if path and Path(path) != ROOT]
    paths = {"PYTHONPATH": os.pathsep.join([str(TRACER), str(there), *outside]), "HOME": str(there.parent),
             "TOLD": str(told), "ASKED": str(asked), "LIMIT": str(int(limit))}
    traced = {"REACH_FILE": str(reach), "REACH_ROOT": str(there / "repro")} if reach else {}
    given = {key: value for key, value in os.environ.items() if key != "PYTHONDONTWRITEBYTECODE"}  # compiled is kept
    began = time.monotonic()
    with (there.parent / "printed").open("w") as printed:
        child = subprocess.Popen(
            [*SHELL, sys.executable, "-m", "pytest", *stop, "-q", "-n0", "-p", "no:cacheprovider", "-p", "telling",
             "--tb=line", *files], cwd=there, env={**given, **paths, **traced}, stdin=subprocess.DEVNULL,
            stdout=printed, stderr=subprocess.STDOUT, start_new_session=True)
        status = _waited(child, limit * PATIENCE)
    return _judged(lines(told), status, time.monotonic() - began, limit)


def _waited(child: subprocess.Popen, longest: float) -> int:
    """Wait for a child, and end all that it started; its exit status, or that of a process ended at the limit."""
    with contextlib.suppress(subprocess.TimeoutExpired):
        child.wait(longest)
    with contextlib.suppress(ProcessLookupError):
        os.killpg(child.pid, signal.SIGKILL)
    return child.wait()


def _judged(rows: list[dict], status: int, seconds: float, limit: float) -> Ran:
    failed = [row for row in rows if row.get("outcome") == "failed"]
    if failed:
        return Ran(failed[0]["test"], failed[0]["how"], seconds=seconds)
    if rows and "ends" in rows[-1]:
        if rows[-1]["ends"] in NOTHING_WRONG:
            return Ran(seconds=seconds)
        return Ran("pytest", f"exit status {rows[-1]['ends']}", seconds=seconds)
    begun = [row for row in rows if "starts" in row] or [{"starts": "collection", "spent": 0.0}]
    where, after = begun[-1]["starts"], max(limit - begun[-1]["spent"], 0.0)
    if status in ENDED:
        return Ran(stopped=where, after=after, seconds=seconds)
    return Ran(where, f"the process ended with status {status}", seconds=seconds)


LIVE = ROOT / "verification" / "report" / "live"
MAP = LIVE / "sampled-reach.jsonl"
#: Tests of what the code's text is, not of what it does: any change of it is one to them.
OF_TEXT = {"test_mutants.py", "test_architecture.py", "test_published.py", "test_sampled.py"}
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
    def ids(self) -> frozenset[str]:
        """Names of all of them."""
        return frozenset(test.id for test in self.tests)

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


def functions(source: str, line: int) -> list[str]:
    """The qualified name of the innermost function that executes something in a line; none of what runs at import."""
    found = [name for name, node in _functions(ast.parse(source), "")
             if node.body[0].lineno <= line <= (node.end_lineno or line)]
    return found[-1:]


def _functions(node: ast.AST, prefix: str) -> Iterator[tuple[str, ast.FunctionDef]]:
    """Functions of a tree by qualified name, outer ones before those in them."""
    for part in ast.iter_child_nodes(node):
        if isinstance(part, ast.FunctionDef):
            yield prefix + part.name, part
            yield from _functions(part, f"{prefix}{part.name}.<locals>.")
        else:
            yield from _functions(part, f"{prefix}{part.name}." if isinstance(part, ast.ClassDef) else prefix)


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
        tree = ast.parse(path.read_text(encoding="utf-8") if path.exists() else "")
        _MENTIONED[file] = {each: _names(node) for each, node in _functions(tree, "")}
    return _MENTIONED[file].get(name, set())


def _names(node: ast.AST) -> set[str]:
    inner = list(ast.walk(node))
    names = {each.id for each in inner if isinstance(each, ast.Name)}
    return names | {each.attr for each in inner if isinstance(each, ast.Attribute)}


def measured() -> Reach:
    """The map, with those files of tests run that have changed since."""
    kept = {row["file"]: row for row in lines(MAP)}
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
