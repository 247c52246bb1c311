"""Which tests call which functions of ``repro/``, and what each test costs: measured once, file by file of tests.

A map of a file of tests is kept until the file changes; a change of ``repro/`` moves lines but few calls, so functions
are known by name. Without the file of maps all are measured anew.
"""

from __future__ import annotations

import ast
import hashlib
from collections import Counter, defaultdict
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cache, cached_property
from pathlib import Path

from verification.evidence.writing import REPORT, ROOT, append, lines
from verification.kernel.trying import Ran, copied, run

LIVE = REPORT / "live"
MAP = LIVE / "sampled-reach.jsonl"
#: Tests of what the code's text is, not of what it does: any change of it is one to them.
OF_TEXT = {"test_mutants.py", "test_architecture.py", "test_published.py", "test_sampled.py"}
#: Seconds of processor time that one file of tests may take, traced.
LONGEST = 900


@dataclass(frozen=True)
class Measured:
    """A test: its file and name, seconds with the fixtures that it shares, and the functions that it calls: of each the
    file in repro/ and the qualified name, a tab between them."""

    id: str
    seconds: float
    calls: frozenset[str] = field(repr=False)


@dataclass(frozen=True)
class Reach:
    """All tests that pass, the cheapest first."""

    tests: tuple[Measured, ...]

    @cached_property
    def calls(self) -> frozenset[str]:
        """All functions that they call."""
        return frozenset().union(*(test.calls for test in self.tests))

    def of(self, file: str, source: str, line: int, whole: bool = False) -> list[Measured]:
        """Tests that a change in a line can be seen by, the cheapest first: those that call the function it is in; of
        what runs at import, those that call what is defined there, or a function that names it; else all. ``whole``:
        of what runs at import, all."""
        inside = functions(source, line)
        if whole and not inside:
            return list(self.tests)
        calls = {f"{file}\t{inside[-1]}"} if inside else self._naming(file, defined(source, line))
        return [test for test in self.tests if test.calls & calls] or list(self.tests)

    def _naming(self, file: str, names: set[str]) -> set[str]:
        """Functions of the code defined in, or naming, one of some names of a file."""
        split = (call.split("\t") for call in self.calls)
        return {f"{other}\t{name}" for other, name in split
                if (other == file and name.split(".")[0] in names) or names & mentioned(other).get(name, set())}


def functions(source: str, line: int) -> list[str]:
    """Qualified names of the functions that execute something in a line, the innermost last; none of what runs at
    import."""
    return [name for name, node in _functions(ast.parse(source), "") if node.body[0].lineno <= line <= node.end_lineno]


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
    node = next(node for node in ast.parse(source).body if line <= node.end_lineno)
    if isinstance(node, ast.FunctionDef | ast.ClassDef):
        return {node.name}
    return {part.id for part in ast.walk(node) if isinstance(part, ast.Name) and isinstance(part.ctx, ast.Store)}


@cache
def mentioned(file: str) -> dict[str, set[str]]:
    """Names that occur in each function of a file; none in a file that is no more."""
    path = ROOT / "repro" / file
    tree = ast.parse(path.read_text(encoding="utf-8") if path.exists() else "")
    return {name: _names(node) for name, node in _functions(tree, "")}


def _names(node: ast.AST) -> set[str]:
    return {getattr(part, "id", getattr(part, "attr", "")) for part in ast.walk(node)}


def digest(*parts: object) -> str:
    """16 hexadecimal digits that stand for some parts."""
    return hashlib.sha256("|".join(map(str, parts)).encode()).hexdigest()[:16]


def measured() -> Reach:
    """The map, with those files of tests run that have changed since."""
    kept = {row["digest"]: row["tests"] for row in lines(MAP)}
    paths = [path for path in sorted((ROOT / "tests").glob("test_*.py")) if path.name not in OF_TEXT]
    wanted = {digest(path.name, path.read_text(encoding="utf-8")): path for path in paths}
    with copied() as there:
        for of, path in wanted.items():
            if of not in kept:
                kept[of] = measure(there, path.name)
                append({"digest": of, "tests": kept[of]}, MAP)
                print(f"reach: {path.name}: {len(kept[of])} tests", flush=True)
    tests = [Measured(id, seconds, frozenset(calls)) for of in wanted for id, (seconds, calls) in kept[of].items()]
    return Reach(tuple(sorted(tests, key=lambda test: test.seconds)))


def measure(there: Path, name: str) -> dict[str, tuple[float, list[str]]]:
    """{test: (seconds, functions that it calls)} of the tests of a file that pass, by a run of it; the seconds of the
    dearest test that has a fixture with it, as any of them may be the one to make it."""
    ran = run(there, [f"tests/{name}"], LONGEST, every=True, traced=True)
    shared = {id: (id, *names) for row in ran.rows for id, names in row.get("collected", {}).items()}
    passed = Counter(row["test"] for row in ran.reports if row["outcome"] == "passed")
    seconds = _seconds(ran, shared)
    calls = _calls(there.parent / "calls")
    return {id: (round(max(map(seconds.get, names)), 3), sorted(set().union(*map(calls.__getitem__, names))))
            for id, names in shared.items() if passed[id] == 3}  # made ready, run, cleared away


def _seconds(ran: Ran, shared: dict[str, tuple[str, ...]]) -> dict[str, float]:
    """Seconds of each test, and of the dearest test with each fixture."""
    found: Counter = Counter()
    for row in ran.reports:
        found[row["test"]] += row["seconds"]
    for id, names in shared.items():
        for name in names:
            found[name] = max(found[name], found[id])
    return found


def _calls(file: Path) -> dict[str, set[str]]:
    """Functions that each test, and each fixture, calls."""
    found: dict[str, set[str]] = defaultdict(set)
    for line in file.read_text(encoding="utf-8").splitlines():
        maker, call = line.split("\t", 1)
        found[maker].add(call)
    return found
