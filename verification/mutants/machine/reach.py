"""Which tests reach which line of ``repro/``, and the command that runs the tests of a mutant's line.

The tests run once under coverage.py, whose context is the name of the test. This covers the process of the tests and
the processes that they start. A mutant is run against the tests that reach its lines, the cheapest first. The other
tests of their files follow, because several tests can share a fixture. A line that runs at import belongs to the tests
that reach its module. This module imports nothing from ``repro/``, which contains the mutant.
"""

import difflib
import filecmp
import json
import os
import subprocess
import sys
from collections.abc import Iterable
from itertools import accumulate
from pathlib import Path
from xml.etree import ElementTree

TESTS, DATA = "tests.json", "reach.coverage"
#: Total duration (s), measured without a mutant, of the tests that a mutant is run against.
LIMIT = 60.0
#: Tests that read the text of the code and fail after any change of it.
OF_TEXT = ("mutants", "architecture", "published", "machine_mutants")
#: Exit statuses of pytest if no test fails: all pass, or none is collected.
NONE_FAILS = (0, 5)
SETTINGS = """[run]
source = repro
data_file = {data}
parallel = true
concurrency = thread, multiprocessing
sigterm = true
context = ${{TEST-}}
"""


def measure(folder: Path) -> None:
    """Run all tests under coverage.py in the present folder. Store the data and the seconds of the tests that pass."""
    settings = folder / "coveragerc"
    settings.write_text(SETTINGS.format(data=folder / DATA), encoding="utf-8")
    report = folder / "junit.xml"
    ignored = [f"--ignore=tests/test_{name}.py" for name in OF_TEXT]
    coverage = [sys.executable, "-m", "coverage"]
    subprocess.run([*coverage, "run", f"--rcfile={settings}", "-m", "pytest", "tests", "-p",
                    "verification.mutants.machine.contexts", f"--junitxml={report}", *ignored], check=False,
                   env={**os.environ, "SETTINGS": str(settings)})
    subprocess.run([*coverage, "combine", f"--rcfile={settings}", "-q"], check=True)
    (folder / TESTS).write_text(json.dumps(seconds_of(report)), encoding="utf-8")


def seconds_of(report: Path) -> dict[str, float]:
    """{test: seconds} of the tests that passed."""
    passed = [case for case in ElementTree.parse(report).iter("testcase") if not list(case.iter("failure"))
              and not list(case.iter("error")) and not list(case.iter("skipped"))]
    return {f"{case.get('classname').replace('.', '/')}.py::{case.get('name')}": float(case.get("time"))
            for case in passed}


def changed(original: Path) -> tuple[str, set[int]]:
    """The file of ``repro/`` that differs between the present folder and the original, and the lines of the original
    that differ."""
    names = [path.relative_to(original).as_posix() for path in sorted((original / "repro").rglob("*.py"))]
    name = next(name for name in names if not filecmp.cmp(original / name, name, shallow=False))
    before, after = ((folder / name).read_text(encoding="utf-8").splitlines() for folder in (original, Path()))
    blocks = difflib.SequenceMatcher(None, before, after, autojunk=False).get_opcodes()
    return name, {line + 1 for kind, first, last, *_ in blocks if kind != "equal" for line in range(first, last)}


def reaching(contexts: dict[int, Iterable[str]], lines: set[int], seconds: dict[str, float]) -> list[str]:
    """The tests to run against a change of some lines, of a file with these contexts {line: tests}."""
    direct = {test for line in lines for test in contexts.get(line, ())} & seconds.keys()
    direct = direct or {test for tests in contexts.values() for test in tests} & seconds.keys() or {*seconds}
    files = {test.partition("::")[0] for test in direct}
    beside = {test for test in seconds if test.partition("::")[0] in files} - direct
    ordered = sorted(direct, key=seconds.__getitem__) + sorted(beside, key=seconds.__getitem__)
    costs = accumulate(seconds[test] for test in ordered)
    return [test for test, cost in zip(ordered, costs) if cost <= LIMIT] or ordered[:1]


def main(original: Path, folder: Path) -> int:
    """Run the tests that reach the mutant in the present folder; the exit status of pytest, 0 if none catches it."""
    from coverage import CoverageData

    name, lines = changed(original)
    data = CoverageData(str(folder / DATA))
    data.read()
    measured = next((file for file in data.measured_files() if file.endswith(f"/{name}")), "")
    contexts = data.contexts_by_lineno(measured) if measured else {}
    seconds = json.loads((folder / TESTS).read_text(encoding="utf-8"))
    tests = reaching(contexts, lines, seconds)
    command = [sys.executable, "-m", "pytest", "-x", "-n0", "--tb=line", "-rf", "-p", "no:cacheprovider", "-p",
               "verification.mutants.machine.reach", *dict.fromkeys(test.partition("::")[0] for test in tests)]
    status = subprocess.run(command, env={**os.environ, "REACHING": json.dumps(tests)}).returncode
    return 0 if status in NONE_FAILS else 1


def pytest_collection_modifyitems(items: list) -> None:
    """As a plugin of pytest: keep the tests that reach the mutant, in their order. A test may be absent, for instance
    if it is named after a value that the mutant changes."""
    places = {test: place for place, test in enumerate(json.loads(os.environ["REACHING"]))}
    items[:] = sorted((item for item in items if item.nodeid in places), key=lambda item: places[item.nodeid])


if __name__ == "__main__":
    sys.exit(main(*map(Path, sys.argv[1:])))
