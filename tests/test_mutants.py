"""The verification can fail: mutants apply to the present code. The cases that name them catch five of them, and the
test that it names catches one."""
import ast

import pytest

from repro.results.files import WRITING
from verification.evidence import pages
from verification.evidence.cases import cases
from verification.evidence.writing import ROOT
from verification.mutants import runner
from verification.mutants.runner import Outcome, Trial

KNOWN = runner.everything()
OF_CASES, OF_TESTS = map(runner.caught_by, ("cases", "tests"))
#: One mutant from each of five stages, caught by cases of less than a second, and one caught by a test.
TRIED = ("inlet-not-scaled", "yield-dropped", "stress-transposed", "lumped-mass", "interface-slips",
         "pickles-read")
PLUG, OTHER = "flow-plug", "flow-poiseuille"


@pytest.mark.parametrize("id", KNOWN)
def test_a_mutant_applies_to_the_code_in_one_place_says_what_is_wrong_and_is_still_python(id):
    mutant = KNOWN[id]
    assert (ROOT / mutant.file).read_text(encoding="utf-8").count(mutant.old) == 1 and mutant.old != mutant.new
    compile(runner.mutated(mutant), mutant.file, "exec")
    assert mutant.file.startswith(("repro/", "verification/")) and len(mutant.says.split()) > 2


def test_every_case_names_mutants_that_exist_and_every_mutant_is_named_or_names_tests():
    assert all(c.mutants for c in cases().values())
    assert {id for c in cases().values() for id in c.mutants} == {*OF_CASES}


@pytest.mark.parametrize("id", OF_TESTS)
def test_the_tests_that_a_mutant_names_are_there(id):
    for test in KNOWN[id].tests:
        file, _, name = test.partition("::")
        tree = ast.parse((ROOT / file).read_text(encoding="utf-8"))
        assert name.partition("[")[0] in {node.name for node in tree.body if isinstance(node, ast.FunctionDef)}, test


@pytest.mark.parametrize("body, caught, message", [
    ("assert 1 == 2", True, "assert 1 == 2"), ("raise MeshError('no')", True, "repro.errors.MeshError: no"),
    ("pytest.fail('q: 2; expected', pytrace=False)", True, "Failed: q: 2; expected"),
    ("assert value if value else wrong", False, "broken: NameError"), ("wrong", False, "broken: NameError"),
    ("assert not value and wrong", True, "assert (not"), ("pass", False, "passes"),
    ("pass\ndel test_b", False, "broken: there is no"), ("import os; os.abort()", False, "broken: the process ended")])
def test_an_assertion_or_a_guard_catches_and_a_broken_or_absent_test_does_not(tmp_path, body, caught, message):
    """Each variant of the test can catch the mutant."""
    folder = tmp_path / "project"
    folder.mkdir()
    (folder / "test_a.py").write_text("import pytest\nfrom repro.errors import MeshError\n"
                                      f"@pytest.mark.parametrize('value', [0, 1])\ndef test_b(value):\n    {body}\n")
    trial = runner.trial(folder, "b", ["test_a.py::test_b"])
    assert trial.caught is caught and trial.message.startswith(message), trial


@pytest.mark.parametrize("trials, passes", [
    ({PLUG: True}, True), ({PLUG: False}, False), ({OTHER: True}, True), ({}, False),
    ({OTHER: True, PLUG: False}, False)])
def test_a_survivor_or_a_case_that_passes_with_its_mutant_is_a_failure(trials, passes):
    outcome = Outcome(cases()[PLUG].mutants[0], tuple(Trial(name, caught, "") for name, caught in trials.items()))
    assert runner.judge([outcome]) is passes and not runner.judge([])


def test_a_record_is_stale_after_a_change_of_the_mutated_file_or_of_a_test_that_caught_it(tmp_path, monkeypatch):
    """The records of other mutants stay fresh, and so does a record if other tests of its module change."""
    test = "import os\nLIMIT = 1\n\ndef test_it():\n    assert LIMIT\n"
    files = {"repro/a.py": "old\n", "repro/b.py": "old\n", "tests/test_a.py": test, "tests/test_b.py": test}
    for name, text in files.items():
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text(text)
    known = {k: runner.Mutant(k, f"repro/{k}.py", "says", "old", "new", (f"tests/test_{k}.py::test_it",)) for k in "ab"}
    monkeypatch.setattr(runner, "ROOT", tmp_path)
    monkeypatch.setattr(runner, "RECORD", tmp_path / "report" / "mutants.json")
    monkeypatch.setattr(runner, "everything", lambda: known)
    assert runner.fresh() == set() and "0 of 2 mutants caught by" in pages.mutant_state()
    for id, mutant in known.items():
        runner.record(Outcome(id, (Trial(mutant.tests[0], True, "q: 2"),)))
    assert runner.fresh() == {"a", "b"}
    assert pages.mutant_state() == "2 of 2 mutants caught by `make mutants`, run on this code."
    (tmp_path / "tests" / "test_a.py").write_text(f"import sys\nMORE = 2\n{test}\ndef test_other():\n    assert MORE\n")
    assert runner.fresh() == {"a", "b"}
    for name, text, fresh in (("repro/a.py", "old and more\n", {"b"}),
                              ("tests/test_b.py", test.replace("assert", "return"), {"a"}),
                              ("tests/test_b.py", test.replace("LIMIT = 1", "LIMIT = 2"), {"a"})):
        (tmp_path / name).write_text(text)
        assert runner.fresh() == fresh and "1 of them run BEFORE THE LAST CHANGE" in pages.mutant_state()
        (tmp_path / name).write_text(files[name])


@pytest.mark.parametrize("id", TRIED)
def test_a_mutant_is_caught_by_every_case_that_names_it(id):
    """The cases, or the tests that it names, run in a process on a copy of the code, as in `make mutants`."""
    outcome = runner.run(KNOWN[id], every=True)
    assert outcome.caught_by and not outcome.missed_by, outcome


def test_the_code_itself_is_not_caught():
    """A case fails because of the mutant, not because the copy lacks something."""
    with runner.copied() as folder:
        assert runner.trial(folder, "growth-stress", cases()["growth-stress"].variants.values()).message == "passes"


def test_a_copy_for_a_mutant_leaves_out_files_that_are_being_written(tmp_path, monkeypatch):
    """Another thread writes the record meanwhile, and its temporary folder disappears during the copy."""
    (tmp_path / f"{WRITING}record").mkdir()
    (tmp_path / "README.md").write_text("text")
    monkeypatch.setattr(runner, "ROOT", tmp_path)
    with runner.copied() as folder:
        assert [path.name for path in folder.iterdir()] == ["README.md"]
