"""Which tests call which functions of ``repro/``, and what each test costs: measured once, file by file of tests.

A map of a file of tests is kept until the file changes; a change of ``repro/`` moves lines but few calls, so functions
are known by name. All are measured anew with ``--reach``.
"""

from __future__ import annotations

import ast
import hashlib
import json
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

from verification.sampled.trying import ROOT, copied, run, told

LIVE = ROOT / "verification" / "report" / "live"
MAP = LIVE / "sampled-reach.jsonl"
#: Tests of what the code's text is, not of what it does: any change of it is one to them.
OF_TEXT = {"test_mutants.py", "test_architecture.py", "test_mentions.py", "test_published.py", "test_sampled.py"}
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
                _append(kept[name])
                print(f"reach: {name}: {len(kept[name]['tests'])} tests", flush=True)
    return Reach(tuple(sorted(_tests(kept[name] for name in wanted), key=lambda test: test.seconds)))


def _kept() -> dict[str, dict]:
    return {row["file"]: row for row in told(MAP)}


def _append(row: dict) -> None:
    LIVE.mkdir(parents=True, exist_ok=True)
    with MAP.open("a", encoding="utf-8") as file:
        file.write(json.dumps(row) + "\n")


def _digest(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()[:16]


def packed(measured: dict[str, tuple[float, list[Call]]]) -> dict:
    """Tests as they are kept: functions once, and by their number."""
    every = sorted({call for _, calls in measured.values() for call in calls})
    numbers = {call: number for number, call in enumerate(every)}
    return {"functions": every, "tests": {id: (seconds, [numbers[call] for call in calls])
                                          for id, (seconds, calls) in measured.items()}}


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
    rows = told(there.parent / "told")
    calls: dict[str, set] = {}
    for line in calls_file.read_text(encoding="utf-8").splitlines() if calls_file.exists() else []:
        parts = line.split("\t")
        if len(parts) == 4:
            calls.setdefault(parts[0], set()).add((parts[1], parts[3]))
    shared = {id: names for row in rows for id, names in row.get("collected", {}).items()}
    reports = [row for row in rows if "outcome" in row]
    bad = {row["test"] for row in reports if row["outcome"] != "passed"}
    setups = {name: max((row["seconds"] for row in reports if name in shared.get(row["test"], ())), default=0.0)
              for names in shared.values() for name in names}
    found = {}
    for id in shared:
        own = sum(row["seconds"] for row in reports if row["test"] == id)
        there_too = set().union(calls.get(id, set()), *(calls.get(f"fixture {name}", set()) for name in shared[id]))
        if id not in bad and sum(row["test"] == id for row in reports) == 3:  # made ready, run, cleared away
            found[id] = (round(max([own, *(setups[name] for name in shared[id])]), 3), sorted(there_too))
    return found
