"""The hunt for mutants that no test sees, and what is kept of it.

A mutant's row is written when it is done, and kept as long as its module, its line and the tests that reach it are the
same: a hunt that was interrupted goes on, and after a change of the tests survivors alone are tried again. A mutant of
a changed module meets the test that caught it before, alone, and all others only if that one lets it pass.
"""

from __future__ import annotations

import ast
import json
import os
import re
import time
import traceback
from dataclasses import asdict, dataclass, replace
from pathlib import Path

from verification.sampled import trying
from verification.sampled.drawing import Mutant, digest, mutated, sources
from verification.sampled.reach import LIVE, Measured, Reach
from verification.sampled.trying import ROOT, Ran, copied, run, told

KEPT = LIVE / "sampled.jsonl"
RECORD = ROOT / "verification" / "report" / "sampled.json"
#: Seconds of processor time of a mutant's first trial, and of a survivor's second one.
LIMIT, WHOLE = 60.0, 1800.0
#: A test that takes so much longer than it did, in multiples of that and seconds besides, does not end.
LONGER, BESIDES = 5.0, 10.0
#: Files of the tests that a mutant is first tried with.
FILES = 4


@dataclass(frozen=True)
class Row:
    """What came of a mutant. ``verdict``: caught, timeout or survivor; ``test``: that caught it, or did not end;
    ``tried``: tests that were run, of ``reached`` that reach it; ``module``, ``tests``: digests of what it rests on."""

    name: str
    file: str
    line: int
    operator: str
    old: str
    new: str
    module: str
    verdict: str
    test: str = ""
    how: str = ""
    tried: int = 0
    reached: int = 0
    tests: str = ""
    seconds: float = 0.0
    #: Does the test that caught it pass without it, in the same place?
    sure: bool = False


def kept() -> dict[str, Row]:
    """Rows by the name of the mutant, the newest."""
    record = json.loads(RECORD.read_text(encoding="utf-8"))["mutants"] if RECORD.exists() else []
    return {row["name"]: Row(**row) for row in [*record, *told(KEPT)]}


def due(sample: list[Mutant], rows: dict[str, Row], reach: Reach, whole: bool) -> list[Mutant]:
    """Mutants without a row, or with one that no longer stands; ``whole``: survivors that tests were left for too."""
    texts = sources()
    return [mutant for mutant in sample if not _stands(rows.get(mutant.name), mutant, texts[mutant.file], reach, whole)]


def _stands(row: Row | None, mutant: Mutant, text: str, reach: Reach, whole: bool) -> bool:
    if row is None or row.module != digest(text):
        return False
    if row.verdict == "caught":
        return (ROOT / row.test.partition("::")[0]).exists()
    tests = reach.of(mutant.file, text, mutant.line)
    return row.tests == _names(tests) and not (whole and row.tried < row.reached)


def _names(tests: list[Measured]) -> str:
    return digest(*sorted(test.id for test in tests))


def hunt(mutants: list[Mutant], reach: Reach, jobs: int, whole: bool, ends: float) -> None:
    """Try mutants, several side by side, and write a row for each; none is begun after the time ``ends``."""
    trying.prepare()
    before = {name: row.test for name, row in kept().items() if row.verdict == "caught"}
    workers = [pid for number in range(jobs) if (pid := _forked(mutants[number::jobs], reach, whole, ends, before))]
    for worker in workers:
        os.waitpid(worker, 0)


def _forked(mutants: list[Mutant], reach: Reach, whole: bool, ends: float, before: dict[str, str]) -> int:
    worker = os.fork()
    if not worker:
        try:
            with copied() as there:
                for mutant in mutants:
                    if time.time() < ends:
                        _write(tried(mutant, there, reach, whole, before.get(mutant.name, "")))
        except BaseException:
            traceback.print_exc()
        finally:
            os._exit(0)
    return worker


def _write(row: Row) -> None:
    LIVE.mkdir(parents=True, exist_ok=True)
    with KEPT.open("a", encoding="utf-8") as file:
        file.write(json.dumps(asdict(row)) + "\n")
    counted = f"{row.tried} of {row.reached} tests, {row.seconds:.0f} s"
    print(f"{row.verdict:9} {row.file}:{row.line} {row.new!r} {row.test} ({counted})", flush=True)


def tried(mutant: Mutant, there: Path, reach: Reach, whole: bool = False, before: str = "") -> Row:
    """Run a mutant in the copy ``there`` against the tests that reach it: the one that caught it ``before`` first, then
    as many of the cheapest as take no more than LIMIT; or all, for WHOLE, those that are named as its module is at
    first."""
    limit = WHOLE if whole else LIMIT
    path, text = there / "repro" / mutant.file, (ROOT / "repro" / mutant.file).read_text(encoding="utf-8")
    tests = reach.of(mutant.file, text, mutant.line, whole)
    chosen = sorted(tests, key=lambda test: -alike(test.id, mutant.file)) if whole else within(tests, limit)
    put(path, mutated(text, mutant))
    found = run(there, [before], limit) if before in {test.id for test in tests} else Ran()
    if not found.failed:
        found = _met(there, chosen, limit)
    put(path, text)
    row = Row(mutant.name, mutant.file, mutant.line, mutant.operator, mutant.old, mutant.new, digest(text), "survivor",
              reached=len(tests), tests=_names(reach.of(mutant.file, text, mutant.line)), tried=len(chosen),
              seconds=round(found.seconds, 1))
    return _verdict(row, found, {test.id: test.seconds for test in tests}, there)


def _met(there: Path, chosen: list[Measured], limit: float) -> Ran:
    """What comes of some tests, the nearest first."""
    first = nearest(chosen)
    found = run(there, [test.id for test in first], limit / 3)
    if found == Ran(seconds=found.seconds) and len(chosen) > len(first):
        found = run(there, [test.id for test in chosen[len(first):]], 2 * limit / 3)
    return found


def _verdict(row: Row, found: Ran, usual: dict[str, float], there: Path) -> Row:
    if found.failed:
        return replace(row, verdict="caught", test=found.failed, how=_short(found.how))
    if found.stopped:
        long = LONGER * usual.get(found.stopped, 0.0) + BESIDES
        return replace(row, verdict="timeout" if found.after > long else "survivor", test=found.stopped,
                       tried=len(ended(told(there.parent / "told"))))
    return row


def ended(rows: list[dict]) -> set[str]:
    """Tests that a run has been through."""
    return {row["test"] for row in rows if row.get("outcome")}


def confirm(rows: list[Row]) -> None:
    """Run the tests that caught mutants once more without any: one that fails now has caught nothing."""
    unsure = [row for row in rows if row.verdict == "caught" and not row.sure]
    tests = sorted({row.test for row in unsure if "::" in row.test})
    if tests:
        with copied() as there:
            run(there, tests, WHOLE, every=True)
            failed = {row["test"] for row in told(there.parent / "told") if row.get("outcome") == "failed"}
        for row in unsure:
            how = f"{row.test} fails without the mutant too"
            _write(replace(row, verdict="survivor", how=how) if row.test in failed else replace(row, sure=True))


def _short(how: str) -> str:
    """The last line of a failure that tells something."""
    lines = [line.strip() for line in how.splitlines() if line.strip()]
    return (lines or [""])[-1].removeprefix("E ").strip()[-160:]


def alike(test: str, file: str) -> int:
    """How many words the names of a test's file and of a module have in common."""
    names = (Path(test.partition("::")[0]).stem, Path(file).with_suffix("").as_posix())
    one, other = ({word.rstrip("s") for word in re.split(r"[/_]", name)} for name in names)
    return len(one & other)


def nearest(tests: list[Measured]) -> list[Measured]:
    """The first of some tests, up to the fifth file: what is not imported costs nothing, and they catch most."""
    files: set[str] = set()
    for number, test in enumerate(tests):
        files.add(test.id.partition("::")[0])
        if len(files) > FILES:
            return tests[:number]
    return tests


def within(tests: list[Measured], limit: float) -> list[Measured]:
    """The cheapest tests that together take no longer than a limit; one at least."""
    total, chosen = 0.0, []
    for test in tests:
        total += test.seconds
        if total > limit and chosen:
            break
        chosen.append(test)
    return chosen


_PUT = [0]


def put(path: Path, text: str) -> None:
    """Write a module with a time of change that no compiled form of it has."""
    _PUT[0] += 1
    path.write_text(text, encoding="utf-8")
    os.utime(path, (10**9 + _PUT[0], 10**9 + _PUT[0]))


def where(mutant: Row, text: str) -> str:
    """The function that a mutant is in, or "import"."""
    inside = [node for node in ast.walk(ast.parse(text)) if isinstance(node, ast.FunctionDef)
              and node.lineno <= mutant.line <= node.end_lineno]
    return max(inside, key=lambda node: node.lineno).name if inside else "import"
