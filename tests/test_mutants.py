"""The verification can fail: mutants apply to the code as it is, and five of them are caught by the cases that name
them, one by the test that it names."""
import ast

import pytest

from verification.kernel import case, driver, mutants, report, trying
from verification.kernel.case import Outcome, Result, at_most
from verification.kernel.mutants import Hunt, Trial

driver.load()
KNOWN = mutants.everything()
OF_CASES, OF_TESTS = map(mutants.of, mutants.CATCHERS)
#: One of each of five stages, caught by a case or two of less than a second, and one that a test catches.
TRIED = ("inlet-not-scaled", "yield-dropped", "stress-transposed", "lumped-mass", "interface-slips",
         "pickles-read")
PLUG, OTHER = "flow-plug", "flow-poiseuille"


@pytest.mark.parametrize("id", KNOWN)
def test_a_mutant_applies_to_the_code_in_one_place_says_what_is_wrong_and_is_still_python(id):
    chosen = KNOWN[id]
    assert (mutants.ROOT / chosen.file).read_text(encoding="utf-8").count(chosen.old) == 1 and chosen.old != chosen.new
    compile(mutants.mutated(chosen), chosen.file, "exec")
    assert chosen.file.startswith(("repro/", "verification/")) and len(chosen.says.split()) > 2


def test_every_case_names_mutants_that_exist_and_every_mutant_is_named_or_names_tests():
    assert all(c.mutants for c in case.CASES.values())
    assert {id for c in case.CASES.values() for id in c.mutants} == {*OF_CASES}


@pytest.mark.parametrize("id", OF_TESTS)
def test_the_tests_that_a_mutant_names_are_there(id):
    for test in KNOWN[id].tests:
        file, _, name = test.partition("::")
        tree = ast.parse((mutants.ROOT / file).read_text(encoding="utf-8"))
        assert name.partition("[")[0] in {node.name for node in tree.body if isinstance(node, ast.FunctionDef)}, test


GUARD = "Traceback\nrepro.errors.LinearError: no flow\n"
BROKEN = "fast: Traceback (most)\nTypeError: of another variant\n"


@pytest.mark.parametrize("value, error, caught", [
    (2.0, "", True), (0.5, "", False), (None, GUARD, True), (None, "Traceback\nAttributeError: no such thing", False),
    (2.0, BROKEN, True), (0.5, BROKEN, False), (None, BROKEN + GUARD, True), (None, GUARD + BROKEN, True)])
def test_a_number_or_a_guard_catches_and_a_broken_mutant_does_not(value, error, caught):
    """In any variant."""
    checks = () if value is None else (at_most("q", value, 1.0, "theory"),)
    assert mutants.judged(Result("c", Outcome(checks), error, 0.0))[0] is caught


@pytest.mark.parametrize("body, caught, how", [
    ("assert 1 == 2", True, "assert 1 == 2"), ("raise MeshError('no')", True, "repro.errors.MeshError: no"),
    ("wrong", False, "broken: NameError"), ("pass", False, "passes"), ("pass\ndel test_b", False, "broken")])
def test_an_assertion_or_a_guard_catches_and_a_broken_or_absent_test_does_not(tmp_path, body, caught, how):
    there = tmp_path / "project"
    there.mkdir()
    (there / "test_a.py").write_text(f"from repro.errors import MeshError\ndef test_b():\n    {body}\n")
    found = mutants.tested(there, "test_a.py::test_b")
    assert found.caught is caught and found.how.startswith(how)


@pytest.mark.parametrize("trials, fine", [
    ({PLUG: True}, True), ({PLUG: False}, False), ({OTHER: True}, True), ({}, False),
    ({OTHER: True, PLUG: False}, False)])
def test_a_survivor_or_a_case_that_passes_with_its_mutant_is_a_failure(trials, fine):
    found = Hunt(case.CASES[PLUG].mutants[0], tuple(Trial(name, caught, "") for name, caught in trials.items()))
    assert mutants.judge([found]) is fine and not mutants.judge([])


def test_the_record_is_of_this_code_or_says_that_it_is_not(tmp_path, monkeypatch):
    """When all of it was hunted; some alone change nothing."""
    monkeypatch.setattr(mutants, "code", lambda catchers: catchers)
    monkeypatch.setattr(mutants, "RECORD", tmp_path / "report" / "mutants.json")
    for ids, fresh in (([*OF_CASES][1:], False), (OF_CASES, False), (OF_TESTS, True)):
        mutants.record([Hunt(id, (Trial(OTHER, True, "q: 2"),)) for id in ids])
        assert mutants.recorded()[1] is fresh
    assert f"{len(KNOWN)} of {len(KNOWN)} mutants caught by `make mutants`, run on this code." == report.mutant_state()
    monkeypatch.setattr(mutants, "code", lambda catchers: "another")
    assert "BEFORE THE LAST CHANGE" in report.mutant_state()


@pytest.mark.parametrize("id", TRIED)
def test_a_mutant_is_caught_by_every_case_that_names_it(id):
    """In a copy of the code, in a process of its own, as `make mutants` does it for all; or by every test it names."""
    found = mutants.hunt(KNOWN[id], every=True)
    assert found.caught_by and not found.missed_by, found


def test_the_code_itself_is_not_caught():
    """What catches is the mutant, and not what the copy lacks."""
    with trying.copied() as there:
        assert mutants.trial(there, "growth-stress").how == "passes"
