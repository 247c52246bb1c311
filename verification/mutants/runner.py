"""Run mutants in copies of the project, against the cases or the tests that must catch them.

If cases name a mutant, it is run against them, the quick cases first, until one catches it. With ``--every`` it is run
against all of them. The slow variants of a case run only if its quick ones pass, and both stop at the first failure. If
a mutant names tests, it is run against each of these.

A test catches a mutant if an assertion or a check fails, or if ``repro`` raises an error that it defines. Any other
error, such as an ``AttributeError``, shows that the mutant does not run, and does not count.

The record of a mutant, in ``report/mutants.json``, has the changed file, and a digest of this file, of the change, of
the tests that caught it, and of the functions and constants of their modules that they use. The record is stale if one
of these changes. It stays fresh if something else changes, such as another case in the same module. Comments and
docstrings do not count.
"""

import argparse
import ast
import contextlib
import hashlib
import os
import re
import shutil
import signal
import subprocess
import sys
from collections import Counter
from collections.abc import Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import cache
from importlib import import_module
from itertools import chain
from pathlib import Path
from tempfile import TemporaryDirectory
from xml.etree import ElementTree

from repro.runs.machine import statements
from verification.evidence.cases import STAGES, Case, cases
from verification.evidence.writing import REPORT, ROOT, load, save
from verification.mutants import Mutant
from verification.mutants.anchors import AnchorError, change

RECORD = REPORT / "mutants.json"
#: First words of failures that catch a mutant: of an assertion, of `pytest.fail` or `pytest.raises`, of an error of
#: repro.
CATCH = ("assert", "AssertionError", "Failed: ", "repro.")
#: The beginning of the report of a failed fixture.
IN_FIXTURE = re.compile(r'^failed on (setup|teardown) with "')
NOT_COPIED = (".git", ".venv", "live", "out", "cache", "dist", "build", "*.egg-info", ".*_cache",
              ".writing-*")
#: Largest duration (s) of a trial. No case takes a tenth of it, but a mutant may run forever.
LONGEST = 600.0


class MutantError(RuntimeError):
    """A mutant cannot be applied."""


@dataclass(frozen=True)
class Trial:
    """The run of a mutant against one case or test. message: the failure, or the reason why there is none."""

    catcher: str
    caught: bool
    message: str


@dataclass(frozen=True)
class Outcome:
    """All trials of one mutant."""

    mutant: str
    trials: tuple[Trial, ...]

    @property
    def caught_by(self) -> list[str]:
        """The cases or tests that failed."""
        return [trial.catcher for trial in self.trials if trial.caught]

    @property
    def missed_by(self) -> list[str]:
        """The cases or tests that do not catch it."""
        return [trial.catcher for trial in self.trials if not trial.caught]


def load_mutants() -> dict[str, tuple[Mutant, ...]]:
    """Mutants by stage. "results" has those of texts for users. Raises MutantError if two have the same id."""
    stages = {name: import_module(f"verification.mutants.{name}").MUTANTS for name in (*STAGES, "results")}
    counts = Counter(mutant.id for mutants in stages.values() for mutant in mutants)
    if repeated := sorted(id for id, count in counts.items() if count > 1):
        raise MutantError(f"used twice: {', '.join(repeated)}")
    return stages


def mutants_by_id() -> dict[str, Mutant]:
    """All mutants by id."""
    return {mutant.id: mutant for mutants in load_mutants().values() for mutant in mutants}


def caught_by(catchers: str) -> dict[str, Mutant]:
    """The mutants that "cases" or "tests" must catch, by id."""
    return {id: mutant for id, mutant in mutants_by_id().items() if bool(mutant.tests) == (catchers == "tests")}


def mutated(mutant: Mutant) -> tuple[str, str]:
    """The changed file and its text. Raises MutantError unless the code to change is in one place."""
    try:
        return change(ROOT, mutant.file, mutant.function, mutant.old, mutant.new)
    except AnchorError as error:
        raise MutantError(f"{mutant.id} is stale: {error}; adapt it to the code of {mutant.file}") from None


def tests_of(mutant: Mutant) -> dict[str, list[list[str]]]:
    """{case or test that must catch a mutant: groups of test ids of pytest}, quick cases first.

    The groups of a case are its quick and its slow variants.
    """
    if mutant.tests:
        return {test: [[test]] for test in mutant.tests}
    naming = [case for case in cases().values() if mutant.id in case.mutants]
    return {case.id: _groups(case) for case in sorted(naming, key=lambda case: not case.quick_numerics)}


def _groups(case: Case) -> list[list[str]]:
    """The quick and the slow variants of a case, as far as it has any."""
    groups = [[test for label, test in case.variants.items() if (label in case.slow_variants) == slow]
              for slow in (False, True)]
    return [group for group in groups if group]


def run(mutant: Mutant, every: bool = False) -> Outcome:
    """Run a mutant in a copy of the project until a case catches it, or against every case or each of its tests."""
    trials: list[Trial] = []
    with copied() as folder:
        file, text = mutated(mutant)
        (folder / file).write_text(text, encoding="utf-8")
        for catcher, groups in tests_of(mutant).items():
            for tests in groups:
                last = trial(folder, catcher, tests)
                if last.caught:
                    break
            trials.append(last)
            if last.caught and not (every or mutant.tests):
                break
    return Outcome(mutant.id, tuple(trials))


@contextlib.contextmanager
def copied() -> Iterator[Path]:
    """A copy of the project in a temporary folder."""
    with TemporaryDirectory(prefix="mutant-", ignore_cleanup_errors=True) as temporary:
        folder = Path(temporary).resolve() / "project"
        shutil.copytree(ROOT, folder, ignore=shutil.ignore_patterns(*NOT_COPIED))
        yield folder


def trial(folder: Path, catcher: str, tests: Iterable[str]) -> Trial:
    """Run some tests in a copy until one fails, and read from the report of pytest whether one catches the mutant. If
    the failure does not count, all of them run."""
    first = _trial(folder, catcher, [*tests, "-x"])
    return _trial(folder, catcher, [*tests]) if first.message.startswith("broken") else first


def _trial(folder: Path, catcher: str, arguments: list[str]) -> Trial:
    """Run pytest once, with some arguments."""
    report = folder.parent / "report.xml"
    report.unlink(missing_ok=True)
    status = _run_tests(folder, report, arguments)
    if status is None:
        return Trial(catcher, False, f"not done after {LONGEST:g} s")
    if not report.exists():
        return Trial(catcher, False, f"broken: the process ended with status {status}")
    tree = ElementTree.parse(report)
    messages = [_message(failure) for failure in (*tree.iter("failure"), *tree.iter("error"))]
    catches = [message for message in messages if message.startswith(CATCH)]
    if catches:
        return Trial(catcher, True, catches[0])
    if messages or not tree.findall(".//testcase"):
        return Trial(catcher, False, f"broken: {(messages or ['there is no such test'])[0]}")
    return Trial(catcher, False, "passes")


def _message(failure: ElementTree.Element) -> str:
    """The first line of a failure."""
    return IN_FIXTURE.sub("", failure.get("message", "")).partition("\n")[0]


def _run_tests(folder: Path, report: Path, arguments: Iterable[str]) -> int | None:
    """Return the exit status of pytest, or None after a timeout. All of its processes are ended."""
    command = [sys.executable, "-m", "pytest", "-n0", "-p", "no:cacheprovider", "-o", "faulthandler_timeout=0",
               f"--junitxml={report}", *arguments]
    environment = {**os.environ, "PYTHONPATH": str(folder), "HOME": str(folder.parent), "PYTHONDONTWRITEBYTECODE": "",
                   "HYPOTHESIS_PROFILE": "mutants"}
    child = subprocess.Popen(command, cwd=folder, env=environment, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL,
                             stderr=subprocess.DEVNULL, start_new_session=True)
    try:
        return child.wait(LONGEST)
    except subprocess.TimeoutExpired:
        return None
    finally:
        with contextlib.suppress(ProcessLookupError):
            os.killpg(child.pid, signal.SIGKILL)
        child.wait()


def main(arguments: list[str] | None = None) -> int:
    """Entry point; 0 if every mutant is caught, and no case or test passes with a mutant that it names."""
    known = mutants_by_id()
    parser = argparse.ArgumentParser(prog="python -m verification.mutants", description="Run wrong changes of repro.")
    parser.add_argument("ids", nargs="*", metavar="MUTANT", choices=[*known, []], default=[], help="all by default")
    parser.add_argument("--every", action="store_true", help="against every case that names it, not until a catch")
    parser.add_argument("--stale", action="store_true", help="only mutants without a record of the present code")
    parser.add_argument("--jobs", type=int, default=os.cpu_count(), help="processes; one a core by default")
    chosen = parser.parse_args(arguments)
    skipped = fresh() if chosen.stale else ()
    outcomes = run_all([id for id in chosen.ids or known if id not in skipped], chosen.jobs, chosen.every)
    return 0 if judge(outcomes) else 1


def run_all(ids: Iterable[str], jobs: int, every: bool = False) -> list[Outcome]:
    """Outcomes in the order of ``ids``, several mutants side by side. Each is printed and recorded as it ends."""
    known, outcomes = mutants_by_id(), []
    with ThreadPoolExecutor(jobs) as pool:
        for outcome in pool.map(lambda id: run(known[id], every), ids):
            outcomes.append(outcome)
            record(outcome)
            print(f"{'caught' if outcome.caught_by else 'SURVIVES':9} {outcome.mutant}")
            for trial in outcome.trials:
                print(f"{'':10}{trial.catcher}: {trial.message}", flush=True)
    return outcomes


def judge(outcomes: list[Outcome]) -> bool:
    """Print the failures. Return whether every case and test caught each mutant that it was run against."""
    failures = [f"survives: {outcome.mutant}" for outcome in outcomes if not outcome.caught_by]
    count = f"{len(outcomes) - len(failures)} of {len(outcomes)} mutants caught."
    failures += [f"{name} passes with {outcome.mutant}, which it names" for outcome in outcomes
              for name in outcome.missed_by]
    print("\n".join([*failures, count]))
    return bool(outcomes) and not failures


def record(outcome: Outcome) -> None:
    """Replace the record of a mutant."""
    mutant = mutants_by_id()[outcome.mutant]
    file, _ = mutated(mutant)
    entry = {"file": file, "caught_by": outcome.caught_by, "digest": digest(mutant, file, outcome.caught_by)}
    save({**recorded(), outcome.mutant: entry}, RECORD)


def recorded() -> dict[str, dict]:
    """{mutant: {"file": file, "caught_by": [case or test, ...], "digest": digits}} of all mutants."""
    records = load(RECORD, {})
    return {id: records.get(id, {"file": "", "caught_by": [], "digest": ""}) for id in mutants_by_id()}


def fresh() -> set[str]:
    """The mutants whose record is of the present code. It does not check that they still apply."""
    known = mutants_by_id()
    return {id for id, entry in recorded().items()
            if entry["digest"] == digest(known[id], entry.get("file", ""), entry["caught_by"])}


def digest(mutant: Mutant, file: str, catchers: Iterable[str]) -> str:
    """16 hexadecimal digits of a mutant, of the file that it changes and of the code of some cases or tests."""
    tests = chain.from_iterable(cases()[name].variants.values() if name in cases() else [name] for name in catchers)
    hashed = hashlib.sha256(repr((mutant.file, mutant.function, mutant.old, mutant.new)).encode() + _code_of_file(file))
    for test in sorted({test.partition("[")[0] for test in tests}):
        in_file, _, function = test.partition("::")
        hashed.update(_code_of_test(function, in_file))
    return hashed.hexdigest()[:16]


@cache
def _text_of(file: str) -> str:
    """A file of the project; empty if it is gone."""
    return (ROOT / file).read_text(encoding="utf-8") if (ROOT / file).is_file() else ""


@cache
def _code_of_file(file: str) -> bytes:
    """A file, without comments and docstrings if it is in Python."""
    return (statements(_text_of(file)) if file.endswith(".py") else _text_of(file)).encode()


@cache
def _code_of_test(function: str, file: str) -> bytes:
    """The code of a test and of all that it uses, without comments and docstrings."""
    return statements(code_of(function, _text_of(file))).encode()


@cache
def code_of(function: str, text: str) -> str:
    """The source of a test, and of the functions, classes and assignments of its module that it uses, directly or
    through each other. Marks and fixtures of the entire module are included, imports are not."""
    used, parts = {function, "pytestmark"}, set()
    known = _definitions(text)
    while more := {k for k, (bound, _, _) in enumerate(known) if bound & used} - parts:
        parts |= more
        used.update(*(known[k][1] for k in more))
    return "\n".join(known[k][2] for k in sorted(parts))


@cache
def _definitions(text: str) -> list[tuple[set[str], set[str], str]]:
    """(names that it binds, words that it contains, source) of every function, class and assignment of a module."""
    lines, definitions = text.splitlines(), []
    for part in ast.parse(text).body:
        if isinstance(part, ast.FunctionDef | ast.ClassDef):
            bound, first = {part.name}, min([part.lineno, *(each.lineno for each in part.decorator_list)])
        elif isinstance(part, ast.Assign | ast.AnnAssign | ast.AugAssign):
            bound, first = {node.id for node in ast.walk(part) if isinstance(node, ast.Name)
                            and isinstance(node.ctx, ast.Store)}, part.lineno
        else:
            continue
        source = "\n".join(lines[first - 1:part.end_lineno])
        module_wide = {"pytestmark"} if "autouse=True" in source else set()
        definitions.append((bound | module_wide, {*re.findall(r"\w+", source)}, source))
    return definitions
