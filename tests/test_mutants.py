"""The verification can fail: mutants apply to the present code. The cases that name them catch some of them, and the
tests that they name catch others."""
import ast
from functools import cache

import pytest

from verification.evidence.cases import cases
from verification.evidence.writing import ROOT
from verification.mutants import runner

KNOWN = runner.mutants_by_id()
OF_CASES, OF_TESTS = map(runner.caught_by, ("cases", "tests"))
#: One mutant from each of five stages, caught by cases of less than a second, and one caught by a test. make test runs
#: the first one.
TRIED = ("stress-transposed", "pickles-read", "inlet-not-scaled", "yield-dropped", "lumped-mass", "interface-slips")


@pytest.mark.parametrize("id", sorted(KNOWN, key=lambda id: KNOWN[id].file))  # neighbours share a file
def test_a_mutant_applies_to_the_code_in_one_place_says_what_is_wrong_and_is_still_python(id):
    """The change is refused if its place is not one, or if the new file is not Python."""
    mutant = KNOWN[id]
    file, text = runner.mutated(mutant)
    assert text != (ROOT / file).read_text(encoding="utf-8")
    assert mutant.file.startswith(("repro/", "verification/")) and len(mutant.says.split()) > 2


def test_every_case_names_mutants_that_exist_and_every_mutant_is_named_or_names_tests():
    assert all(c.mutants for c in cases().values())
    assert {id for c in cases().values() for id in c.mutants} == {*OF_CASES}


@pytest.mark.parametrize("id", OF_TESTS)
def test_the_tests_that_a_mutant_names_are_there(id):
    for test in KNOWN[id].tests:
        file, _, name = test.partition("::")
        assert name.partition("[")[0] in functions(file), test


@cache
def functions(file):
    tree = ast.parse((ROOT / file).read_text(encoding="utf-8"))
    return {node.name for node in tree.body if isinstance(node, ast.FunctionDef)}


@pytest.mark.parametrize("body, caught, message", [
    ("assert not value and wrong", True, "assert (not"), ("pass", False, "passes"),
    *(pytest.param(*example, marks=pytest.mark.thorough) for example in (
        ("raise MeshError('no')", True, "repro.errors.MeshError: no"),
        ("assert value if value else wrong", False, "broken: NameError"),
        ("import os; os.abort()", False, "broken: the process ended"),
        ("assert 1 == 2", True, "assert 1 == 2"), ("wrong", False, "broken: NameError"),
        ("pytest.fail('q: 2; expected', pytrace=False)", True, "Failed: q: 2; expected"),
        ("pass\ndel test_b", False, "broken: there is no")))])
def test_an_assertion_or_a_guard_catches_and_a_broken_or_absent_test_does_not(tmp_path, body, caught, message):
    """Each variant of the test can catch the mutant."""
    folder = tmp_path / "project"
    folder.mkdir()
    (folder / "test_a.py").write_text("import pytest\nfrom repro.errors import MeshError\n"
                                      f"@pytest.mark.parametrize('value', [0, 1])\ndef test_b(value):\n    {body}\n")
    trial = runner.trial(folder, "b", ["test_a.py::test_b"])
    assert trial.caught is caught and trial.message.startswith(message), trial


@pytest.mark.parametrize("id", [
    TRIED[0], *(pytest.param(id, marks=pytest.mark.thorough) for id in TRIED[1:])])
def test_a_mutant_is_caught_by_every_case_that_names_it(id):
    """The cases, or the tests that it names, run in a process on a copy of the code, as in `make mutants`."""
    outcome = runner.run(KNOWN[id], every=True)
    assert outcome.caught_by and not outcome.missed_by, outcome
