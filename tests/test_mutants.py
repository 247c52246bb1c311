"""The verification can fail: mutants apply to the code as it is, and five of them are caught by the cases that name
them, one by the test that it names."""
import ast
import re

import pytest

from verification.kernel import case, driver, mutants, report
from verification.kernel.case import Outcome, Result, at_most
from verification.kernel.mutants import Hunt, Mutant, MutantError, Trial

driver.load()
KNOWN = mutants.everything()
OF_CASES, OF_TESTS = map(mutants.of, mutants.CATCHERS)
#: One of each of five stages, caught by a case or two of less than a second, and one that a test catches.
TRIED = ("inlet-not-scaled", "yield-dropped", "stress-transposed", "lumped-mass", "interface-slips",
         "columns-kept-for-rows")


def a_mutant(**changes):
    return Mutant(**{"id": "m", "file": "repro/a.py", "says": "s", "old": "x = 1", "new": "x = 2", **changes})


@pytest.fixture
def root(tmp_path):
    (tmp_path / "repro").mkdir()
    (tmp_path / "repro" / "a.py").write_text("x = 1\ny = 3\ny = 3\n")
    return tmp_path


def test_there_are_five_mutants_or_more_of_every_stage():
    found = mutants.load()
    assert {*found} == {*case.STAGES, mutants.RESULTS} and min(map(len, found.values())) >= 5


@pytest.mark.parametrize("id", KNOWN)
def test_a_mutant_applies_to_the_code_says_what_is_wrong_and_is_still_python(id):
    chosen = KNOWN[id]
    compile(mutants.mutated(chosen), chosen.file, "exec")
    assert chosen.file.startswith("repro/") and len(chosen.says.split()) > 2


def test_every_case_names_mutants_that_exist_and_every_mutant_is_named_or_names_tests():
    assert {id for c in case.CASES.values() for id in c.mutants} == {*OF_CASES}


def functions(path):
    """{name: docstring} of the functions of a file, "" that of the file."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    found = {node.name: ast.get_docstring(node) or "" for node in ast.walk(tree) if isinstance(node, ast.FunctionDef)}
    return found | {"": ast.get_docstring(tree) or ""}


TESTS = {path.name: functions(path) for path in sorted((mutants.ROOT / "tests").glob("*.py"))}


@pytest.mark.parametrize("id", OF_TESTS)
def test_the_tests_that_a_mutant_names_are_there(id):
    for test in KNOWN[id].tests:
        file, _, name = test.removeprefix("tests/").partition("::")
        assert name.partition("[")[0] in TESTS[file], test


def test_a_docstring_claims_no_mutant_that_is_not_run():
    """What a test is said to catch is registered, with this test among those that it names."""
    for file, known in TESTS.items():
        for name, text in known.items():
            for said in re.findall(r"[Mm]utants?:\s+([^.]+)", text):
                for id in said.split(", "):
                    tests = {test.partition("[")[0] for test in KNOWN[id].tests} if id in KNOWN else ()
                    assert f"tests/{file}::{name}" in tests, f"{id}: register it, or say what the test holds"


def test_an_id_is_used_once(monkeypatch):
    monkeypatch.setattr("verification.flow.mutants.MUTANTS", (a_mutant(), a_mutant()))
    with pytest.raises(MutantError, match="used twice: m"):
        mutants.load()


@pytest.mark.parametrize("changes", [{"old": "x = 5"}, {"old": "y = 3"}, {"new": "x = 1"}])
def test_the_change_is_made_where_it_belongs_and_text_that_is_gone_or_not_unique_is_an_error(root, changes):
    assert mutants.mutated(a_mutant(), root) == "x = 2\ny = 3\ny = 3\n"
    with pytest.raises(MutantError, match="adapt the mutant"):
        mutants.mutated(a_mutant(**changes), root)


@pytest.mark.parametrize("value, error, caught", [
    (2.0, "", True), (0.5, "", False),
    (None, "Traceback\nrepro.errors.LinearError: residual 1e-2", True),
    (None, "Traceback\nAttributeError: no such thing", False), (None, "Traceback\nNameError", False),
    (2.0, "fast: Traceback\nTypeError: of another variant", True),
    (0.5, "fast: Traceback\nTypeError: of another variant", False),
])
def test_a_number_or_a_guard_catches_and_a_broken_mutant_does_not(value, error, caught):
    checks = () if value is None else (at_most("q", value, 1.0, "theory"),)
    assert mutants.judged(Result("c", Outcome(checks), error, 0.0))[0] is caught


@pytest.mark.parametrize("body, caught, how", [
    ("assert 1 == 2", True, "assert 1 == 2"), ("with pytest.raises(OSError): pass", True, "Failed: DID NOT RAISE"),
    ("raise MeshError('no')", True, "repro.errors.MeshError: no"), ("wrong", False, "broken: NameError"),
    ("pass", False, "passes"), ("pass\ndel test_b", False, "broken"),
])
def test_an_assertion_or_a_guard_catches_and_a_broken_or_absent_test_does_not(tmp_path, body, caught, how):
    head = "import pytest\nfrom repro.errors import MeshError\ndef test_b():\n"
    (tmp_path / "test_a.py").write_text(f"{head}    {body}\n")
    found = mutants.tested(tmp_path, "test_a.py::test_b")
    assert found.caught is caught and found.how.startswith(how)


PLUG, OTHER = "flow-plug", "flow-poiseuille"


@pytest.mark.parametrize("caught_by, missed_by, fine", [
    ([PLUG], [], True), ([], [PLUG], False), ([OTHER], [], True), ([], [], False), ([OTHER], [PLUG], False)])
def test_a_survivor_or_a_case_that_passes_with_its_mutant_is_a_failure(caught_by, missed_by, fine):
    trials = [Trial(name, True, "") for name in caught_by] + [Trial(name, False, "passes") for name in missed_by]
    found = Hunt(case.CASES[PLUG].mutants[0], tuple(trials))
    assert (found.caught_by, found.missed_by) == (tuple(caught_by), tuple(missed_by))
    assert mutants.judge([found]) is fine and not mutants.judge([])


def test_the_record_is_of_this_code_or_says_that_it_is_not(tmp_path, monkeypatch):
    """Of what cases catch and of what tests catch, each when all of it was hunted; some alone change nothing."""
    def hunted(ids, name):
        mutants.record([Hunt(id, (Trial(PLUG, False, "passes"), Trial(name, True, "q: 2"))) for id in ids])
        return mutants.recorded()

    monkeypatch.setattr(mutants, "code", lambda catchers: catchers)
    monkeypatch.setattr(mutants, "RECORD", tmp_path / "report" / "mutants.json")
    assert hunted([*OF_CASES][1:], OTHER) == ({}, False)
    assert hunted(OF_CASES, OTHER) == ({id: [OTHER] * (id in OF_CASES) for id in KNOWN}, False)
    caught, fresh = hunted(OF_TESTS, "test_a.py::test_b")
    assert fresh and {id for id, names in caught.items() if names == ["test_a.py::test_b"]} == {*OF_TESTS}
    assert f"{len(KNOWN)} of {len(KNOWN)} mutants caught by `make mutants`, run on this code." == report.mutant_state()
    monkeypatch.setattr(mutants, "code", lambda catchers: "another")
    assert "BEFORE THE LAST CHANGE" in report.mutant_state()


def test_an_unknown_mutant_is_refused_by_name(capsys):
    assert mutants.main(["nonsense"]) == 2
    assert "there is no nonsense; there are" in capsys.readouterr().err


@pytest.mark.parametrize("id", TRIED)
def test_a_mutant_is_caught_by_every_case_that_names_it(id):
    """In a copy of the code, in a process of its own, as `make mutants` does it for all; or by every test it names."""
    found = mutants.hunt(KNOWN[id], every=True)
    assert found.caught_by and not found.missed_by, found


@pytest.fixture
def unchanged(monkeypatch, tmp_path):
    """The same copy without the change."""
    monkeypatch.setattr(mutants, "mutated", lambda mutant: (mutants.ROOT / mutant.file).read_text(encoding="utf-8"))
    return tmp_path


def test_the_code_itself_is_not_caught(unchanged):
    """What catches is the mutant."""
    mutants.copy(KNOWN["third-power"], unchanged)
    assert mutants.trial(unchanged, "growth-stress") == Trial("growth-stress", False, "passes")


@pytest.mark.thorough
def test_the_tests_that_mutants_name_pass_without_them(unchanged):
    """That something is missing in the copy is no catch."""
    mutants.copy(KNOWN["stresses-exchanged"], unchanged)
    named = {test for mutant in OF_TESTS.values() for test in mutant.tests}
    assert [test for test in sorted(named) if mutants.tested(unchanged, test).how != "passes"] == []
