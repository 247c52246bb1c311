"""The verification can fail: mutants apply to the code as it is, and five of them are caught by the cases they name."""
import pytest

from verification.kernel import case, driver, mutants, report
from verification.kernel.case import Outcome, Result, at_most
from verification.kernel.mutants import Hunt, Mutant, MutantError, Trial

driver.load()
KNOWN = mutants.everything()
#: One of each of five stages, caught by a case of a second or two.
TRIED = ("saddle-sign", "carried-by-u", "third-power", "linear-transfer", "stale-fluid")


def a_mutant(**changes):
    return Mutant(**{"id": "m", "file": "repro/a.py", "says": "s", "old": "x = 1", "new": "x = 2", **changes})


@pytest.fixture
def root(tmp_path):
    (tmp_path / "repro").mkdir()
    (tmp_path / "repro" / "a.py").write_text("x = 1\ny = 3\ny = 3\n")
    return tmp_path


def test_there_are_enough_mutants_of_every_stage():
    assert len(KNOWN) >= 40
    assert {stage: len(found) >= 5 for stage, found in mutants.load().items()} == dict.fromkeys(case.STAGES, True)


@pytest.mark.parametrize("id", KNOWN)
def test_a_mutant_applies_to_the_code_says_what_is_wrong_and_is_still_python(id):
    chosen = KNOWN[id]
    compile(mutants.mutated(chosen), chosen.file, "exec")
    assert chosen.file.startswith("repro/") and len(chosen.says.split()) > 2


def test_every_case_names_mutants_that_exist_and_every_mutant_is_named():
    named = {id for c in case.CASES.values() for id in c.mutants}
    assert named - set(KNOWN) == set() and set(KNOWN) - named == set()


def test_an_id_is_used_once(monkeypatch):
    monkeypatch.setattr("verification.flow.mutants.MUTANTS", (a_mutant(), a_mutant()))
    with pytest.raises(MutantError, match="used twice: m"):
        mutants.load()


def test_the_change_is_made_where_it_belongs(root):
    assert mutants.mutated(a_mutant(), root) == "x = 2\ny = 3\ny = 3\n"


@pytest.mark.parametrize("changes", [{"old": "x = 5"}, {"old": "y = 3"}, {"new": "x = 1"}])
def test_text_that_is_gone_or_not_unique_is_an_error(root, changes):
    """Mutant: `replace` that silently changes nothing, so that the code itself "survives" as a mutant."""
    with pytest.raises(MutantError, match="adapt the mutant"):
        mutants.mutated(a_mutant(**changes), root)


def outcome(value):
    return Outcome((at_most("q", value, 1.0, "theory"),))


@pytest.mark.parametrize("result, caught", [
    (Result("c", outcome(2.0), "", 0.0), True),
    (Result("c", outcome(0.5), "", 0.0), False),
    (Result("c", Outcome(), "Traceback\nrepro.errors.LinearError: residual 1e-2", 0.0), True),
    (Result("c", Outcome(), "Traceback\nAttributeError: no such thing", 0.0), False),
    (Result("c", Outcome(), "Traceback\nNameError", 0.0), False),
])
def test_a_number_or_a_guard_catches_and_a_broken_mutant_does_not(result, caught):
    """Mutant: any exception counts as a catch, so that a typing error in a mutant proves a test."""
    assert mutants.judged(result)[0] is caught


@pytest.mark.parametrize("trials, fine", [
    ([Trial("flow-plug", True, "")], True), ([Trial("flow-plug", False, "passes")], False),
    ([Trial("flow-poiseuille", True, "")], True), ([], False),
])
def test_a_survivor_or_a_case_that_passes_with_its_mutant_is_a_failure(trials, fine, capsys):
    hunts = [Hunt(case.CASES["flow-plug"].mutants[0], tuple(trials))]
    assert mutants.judge(hunts) is fine
    assert not mutants.judge([])


def test_a_case_that_misses_the_mutant_it_names_is_told_though_another_catches():
    id = case.CASES["flow-plug"].mutants[0]
    found = Hunt(id, (Trial("flow-plug", False, "passes"), Trial("flow-energy", True, "")))
    assert found.caught_by == ("flow-energy",) and found.missed_by == ("flow-plug",)
    assert not mutants.judge([found])


def test_named_cases_come_first_and_quick_ones_before_slow_ones():
    named, others = mutants.plan(KNOWN["saddle-sign"])
    assert "flow-poiseuille" in named and set(named).isdisjoint(others)
    slow = [case.CASES[id].slow for id in others]
    assert slow == sorted(slow) and len(named) + len(others) == len(case.CASES)


def test_the_record_is_of_this_code_or_says_that_it_is_not(tmp_path, monkeypatch):
    monkeypatch.setattr(mutants, "RECORD", tmp_path / "report" / "mutants.json")
    assert mutants.recorded() == ({}, False)
    mutants.record([Hunt("saddle-sign", (Trial("flow-poiseuille", True, "q: 2"), Trial("flow-plug", False, "passes")))])
    assert mutants.recorded() == ({"saddle-sign": ["flow-poiseuille"]}, True)
    assert f"1 of {len(KNOWN)} mutants caught by `make mutants`, run on this code." == report.mutant_state()
    monkeypatch.setattr(mutants, "code", lambda: "another")
    assert "BEFORE THE LAST CHANGE" in report.mutant_state()


def test_an_unknown_mutant_is_refused_by_name(capsys):
    assert mutants.main(["nonsense"]) == 2
    assert "there is no nonsense; there are" in capsys.readouterr().err


@pytest.mark.parametrize("id", TRIED)
def test_a_mutant_is_caught_by_every_case_that_names_it(id):
    """In a copy of the code, in a process of its own, as `make mutants` does it for all."""
    found = mutants.hunt(KNOWN[id], every=True)
    assert found.caught_by and not found.missed_by, found


def test_the_code_itself_is_not_caught(monkeypatch, tmp_path):
    """The same copy without the change passes: what catches is the mutant."""
    monkeypatch.setattr(mutants, "mutated", lambda mutant: (mutants.ROOT / mutant.file).read_text(encoding="utf-8"))
    mutants.copy(KNOWN["third-power"], tmp_path)
    assert mutants.trial(tmp_path, "growth-stress") == Trial("growth-stress", False, "passes")
