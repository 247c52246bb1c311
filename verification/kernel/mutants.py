"""Can the verification fail? Small wrong changes to ``repro/``, each of which a case must catch: ``make mutants``.

A mutant is a change of exact text; it is applied to a copy of the code, never to the code itself. Every case names
mutants, and must fall short with each of them. A mutant is run against the cases that name it, the quick ones first,
until one catches it; with ``--every`` against all of them, whichever catches it first.

A case catches by a number out of its range, or by an error of ``repro.errors`` (a guard of the code that stops it).
Whatever else stops a case, an ``AttributeError`` for instance, shows a broken mutant and catches nothing. No case knows
stored results of ``repro``: what it expects comes from theory, from ``reference/`` or from a conserved quantity.

What no case exercises (what a user reads: columns, files, pages, tables of sweeps) and what one would notice by luck
alone has mutants that tests catch: these name their ``tests``, as pytest does, and are run against each of them. A test
catches by an assertion that fails, or by an error that ``repro`` defines. ``--tests`` hunts these alone.

A hunt is of the code that its cases, or its tests, can reach: the stages of verification or the files of the tests, the
references, and the modules of repro that they import.
"""

from __future__ import annotations

import argparse
import ast
import hashlib
import json
import os
import re
import subprocess
import sys
from collections.abc import Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path

from verification.kernel import writing
from verification.kernel.case import CASES, STAGES, Result
from verification.kernel.case import load as load_cases
from verification.kernel.case import run as run_case
from verification.kernel.trying import ENDED, copied, run
from verification.kernel.writing import REPORT, ROOT

#: The names that it exports come from modules that cases import by themselves.
API = ROOT / "repro" / "__init__.py"


def reached(files: Iterable[Path]) -> set[Path]:
    """Files, and all of this project that these import, directly or not, but for what the kernel does: it runs cases,
    and no case depends on it."""
    found: set[Path] = set()
    waiting = list(files)
    while waiting:
        path = waiting.pop()
        if path not in found:
            found.add(path)
            waiting += [] if path == API or path.parent == Path(__file__).parent else imported(path)
    return found


def imported(path: Path) -> Iterator[Path]:
    """Files of this project that a file imports, inside functions too."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import | ast.ImportFrom):
            package = ROOT.joinpath(*(getattr(node, "module", None) or "").split("."))
            for module in (package, *(package.joinpath(*alias.name.split(".")) for alias in node.names)):
                yield from filter(Path.is_file, (module.with_suffix(".py"), module / "__init__.py"))


RECORD = REPORT / "mutants.json"
#: What of the mutants catches them.
CATCHERS = ("cases", "tests")
#: How the error of a test begins that is a catch: an assertion, `pytest.raises`, a guard.
CATCH = ("assert", "AssertionError", "Failed: ", "repro.")
#: The guard that stops a variant of a case, the last of them or one before another's traceback.
GUARD = re.compile(r"^repro\.errors\.(\w+: .*)$(?=\n?\Z|\n.*Traceback )", re.M)
#: No case takes a tenth of this; a mutant may make one run for ever.
LONGEST = 600.0
NOT_DONE = f"not done after {LONGEST:g} s"


@dataclass(frozen=True)
class Mutant:
    """A change to ``file``: ``old``, which occurs there once, becomes ``new``; ``says`` what is wrong then; ``tests``:
    the tests that catch it, by the names that pytest gives them, where it is not cases that do."""

    id: str
    file: str
    says: str
    old: str
    new: str
    tests: tuple[str, ...] = ()


def changes(file: str, *rows: tuple) -> tuple[Mutant, ...]:
    """Mutants of one file, a row each: id, what is wrong then, the old text, the new one, and tests that catch it."""
    return tuple(Mutant(id, file, says, old, new, tuple(tests)) for id, says, old, new, *tests in rows)


class MutantError(RuntimeError):
    """A mutant cannot be applied, or what it does is no result."""


@dataclass(frozen=True)
class Trial:
    """A case, or a test, run with a mutant: ``how`` it was caught, or why that is no catch."""

    case: str
    caught: bool
    how: str


@dataclass(frozen=True)
class Hunt:
    """All trials of one mutant."""

    mutant: str
    trials: tuple[Trial, ...]

    @property
    def caught_by(self) -> tuple[str, ...]:
        """Ids of the cases that fell short, or of the tests that failed."""
        return tuple(trial.case for trial in self.trials if trial.caught)

    @property
    def missed_by(self) -> tuple[str, ...]:
        """Ids of the cases, or tests, that it was run against and that pass with it."""
        return tuple(trial.case for trial in self.trials if not trial.caught)


def load() -> dict[str, tuple[Mutant, ...]]:
    """Mutants by stage, and those of "results", what users read. Raises MutantError where an id is used twice."""
    found = {stage: import_module(f"verification.{stage}.mutants").MUTANTS for stage in STAGES}
    found["results"] = import_module("verification.mutants").MUTANTS
    ids = [mutant.id for mutants in found.values() for mutant in mutants]
    if twice := {id for id in ids if ids.count(id) > 1}:
        raise MutantError(f"used twice: {', '.join(sorted(twice))}")
    return found


def everything() -> dict[str, Mutant]:
    """Mutants of all stages by id."""
    return {mutant.id: mutant for mutants in load().values() for mutant in mutants}


def of(catchers: str) -> dict[str, Mutant]:
    """Those of CATCHERS "cases" or "tests", by id."""
    return {id: mutant for id, mutant in everything().items() if bool(mutant.tests) == (catchers == "tests")}


def mutated(mutant: Mutant) -> str:
    """The changed text of the file. Raises MutantError unless the text to change occurs exactly once."""
    text = (ROOT / mutant.file).read_text(encoding="utf-8")
    count = text.count(mutant.old)
    if count != 1 or mutant.old == mutant.new:
        raise MutantError(f"{mutant.id}: the text to change occurs {count} times in {mutant.file}, not once, or it "
                          "stays the same; adapt the mutant to the code")
    return text.replace(mutant.old, mutant.new)


def hunt(mutant: Mutant, every: bool = False) -> Hunt:
    """Run the mutant against the cases that name it, the quick ones first, to the first catch, or ``every`` one; or
    against every test that it names."""
    quick_first = sorted(CASES.values(), key=lambda case: case.slow)
    catchers = mutant.tests or [case.id for case in quick_first if mutant.id in case.mutants]
    trials: list[Trial] = []
    with copied() as there:
        (there / mutant.file).write_text(mutated(mutant), encoding="utf-8")
        for each in catchers:
            trials.append((tested if mutant.tests else trial)(there, each))
            if trials[-1].caught and not (every or mutant.tests):
                break
    return Hunt(mutant.id, tuple(trials))


def trial(there: Path, case: str) -> Trial:
    """Run one case in the copy, in a process of its own."""
    command = f"from verification.kernel import mutants; mutants.examine({case!r})"
    try:
        done = subprocess.run([sys.executable, "-c", command], cwd=there, env={**os.environ, "PYTHONPATH": str(there)},
                              capture_output=True, text=True, timeout=LONGEST)
    except subprocess.TimeoutExpired:
        return Trial(case, False, NOT_DONE)
    if done.returncode:
        return Trial(case, False, "broken: " + (done.stderr.strip().splitlines() or ["no message"])[-1])
    return Trial(case, *json.loads(done.stdout.splitlines()[-1]))


def tested(there: Path, test: str) -> Trial:
    """Run one test in the copy, in a process of its own."""
    found = run(there, [test], LONGEST)
    if found.failures:
        how = found.failures[0][1].partition("\n")[0]
        caught = how.startswith(CATCH)
        return Trial(test, caught, how if caught else f"broken: {how}")
    if found.status in ENDED:
        return Trial(test, False, NOT_DONE)
    return Trial(test, False, "passes" if found.reports else "broken: there is no such test")


def examine(id: str) -> None:
    """Run a case with the code of the present folder and print, as JSON, whether it is caught and how."""
    import repro
    if Path(repro.__file__).parents[1] != Path.cwd():
        raise MutantError(f"repro is imported from {repro.__file__}, not from the copy with the mutant")
    load_cases()
    print(json.dumps(judged(run_case(CASES[id]))))


def judged(result: Result) -> tuple[bool, str]:
    """(caught, how) of a case that has run with a mutant."""
    guard = GUARD.search(result.error)
    short = [part for part in result.outcome.measured if not part.holds]
    if guard:
        return True, guard[1]
    if short:
        return True, f"{short[0].quantity}: {short[0].measured} (expected {short[0].expected})"
    return False, result.error.strip().splitlines()[-1] if result.error else "passes"


def main(arguments: list[str] | None = None) -> int:
    """Entry point; 0 if every mutant is caught, and no case that was run passes with a mutant that it names."""
    load_cases()
    parser = argparse.ArgumentParser(prog="python -m verification.mutants", description=__doc__.splitlines()[0])
    parser.add_argument("ids", nargs="*", metavar="MUTANT", choices=[*everything(), []], default=[],
                        help="all by default")
    parser.add_argument("--every", action="store_true", help="against every case that names it, not to the first catch")
    parser.add_argument("--tests", action="store_true", help="those alone that tests catch, not cases")
    parser.add_argument("--jobs", type=int, default=os.cpu_count(), help="processes; one a core by default")
    chosen = parser.parse_args(arguments)
    hunts = hunt_all(chosen.ids or (of("tests") if chosen.tests else everything()), chosen.jobs, chosen.every)
    record(hunts)
    return 0 if judge(hunts) else 1


def hunt_all(ids: Iterable[str], jobs: int, every: bool = False) -> list[Hunt]:
    """Hunts in the order of ``ids``, several side by side; a line or more each as it ends."""
    known, hunts = everything(), []
    with ThreadPoolExecutor(jobs) as pool:
        for found in pool.map(lambda id: hunt(known[id], every), ids):
            hunts.append(found)
            print(f"{'caught' if found.caught_by else 'SURVIVES':9} {found.mutant}")
            for trial in found.trials:
                print(f"{'':10}{trial.case}: {trial.how}", flush=True)
    return hunts


def judge(hunts: list[Hunt]) -> bool:
    """Print what is wrong, if anything; is every mutant caught, and by every case that names it?"""
    wrong = [f"survives: {found.mutant}" for found in hunts if not found.caught_by]
    count = f"{len(hunts) - len(wrong)} of {len(hunts)} mutants caught."
    wrong += [f"{case} passes with {found.mutant}, which it names" for found in hunts for case in found.missed_by]
    print("\n".join([*wrong, count]))
    return bool(hunts) and not wrong


def record(hunts: list[Hunt]) -> None:
    """Write what caught which mutant, for the report, where all that cases or all that tests catch were hunted."""
    caught = {found.mutant: list(found.caught_by) for found in hunts}
    whole = [catchers for catchers in CATCHERS if of(catchers).keys() <= caught.keys()]
    if not whole:
        return
    before = _read()
    known = {**before["caught"], **caught}
    codes = {**before["code"], **{catchers: code(catchers) for catchers in whole}}
    writing.save({"code": codes, "caught": {id: known.get(id, []) for id in everything()}}, RECORD)


def _read() -> dict[str, dict]:
    """The record: {"code": {"cases": digits, "tests": digits}, "caught": {mutant: [case or test, ...]}}."""
    return writing.load(RECORD, {"code": {}, "caught": {}})


def recorded() -> tuple[dict[str, list[str]], bool]:
    """({mutant: [case or test, ...]} of the last whole hunts, whether the code is still the same)."""
    found = _read()
    return found["caught"], found["code"] == {catchers: code(catchers) for catchers in CATCHERS}


def code(catchers: str) -> str:
    """16 hexadecimal digits that stand for the cases and the references, or for the files of the tests that mutants
    name, and for what they reach of the code."""
    digest = hashlib.sha256()
    if catchers == "tests":
        files = {ROOT / test.partition("::")[0] for mutant in of("tests").values() for test in mutant.tests}
        folders = {ROOT / "repro", ROOT / "tests"}
    else:
        cases = {ROOT / "reference", *(ROOT / "verification" / stage for stage in STAGES)}
        files = {path for folder in cases for path in folder.rglob("*.py")}
        folders = {ROOT / "repro", ROOT / "verification" / "problems", *cases}
    for path in sorted(reached(files)):
        if not folders.isdisjoint(path.parents):
            digest.update(path.relative_to(ROOT).as_posix().encode() + path.read_bytes())
    return digest.hexdigest()[:16]

