"""Mutants made by machine: the tests that a session runs them against, what it makes of their outcome, and the page."""
import json
import os
import subprocess
import sys
from types import SimpleNamespace

import pytest

from verification.evidence.writing import ROOT
from verification.mutants.machine import reach, record, sample
from verification.mutants.machine.survivors import EQUIVALENT, LEFT

SECONDS = {"tests/test_a.py::test_slow": 50.0, "tests/test_a.py::test_quick": 1.0, "tests/test_b.py::test_other": 2.0,
           "tests/test_a.py::test_long": 70.0}
CONTEXTS = {3: ["tests/test_a.py::test_slow", "gone"], 4: ["tests/test_b.py::test_other"]}


@pytest.mark.parametrize("lines, tests", [
    ({3}, ["test_slow", "test_quick"]), ({4}, ["test_other"]), ({3, 4}, ["test_other", "test_slow", "test_quick"]),
    ({9}, ["test_other", "test_slow", "test_quick"])])
def test_the_tests_that_reach_a_line_come_first_then_those_beside_them_for_a_minute(lines, tests):
    """A line that runs at import belongs to all tests of its module."""
    assert [test.partition("::")[2] for test in reach.reaching(CONTEXTS, lines, SECONDS)] == tests


def test_the_changed_lines_are_those_of_the_original(tmp_path, monkeypatch):
    for name, text in {"original": "a\nb\nc\n", "copy": "a\nB\nc\n"}.items():
        (tmp_path / name / "repro").mkdir(parents=True)
        (tmp_path / name / "repro" / "m.py").write_text(text)
        (tmp_path / name / "repro" / "n.py").write_text("same\n")
    monkeypatch.chdir(tmp_path / "copy")
    assert reach.changed(tmp_path / "original") == ("repro/m.py", {2})


@pytest.mark.parametrize("asked, status", [
    (["test_m.py::test_gone[3]", "test_m.py::test_good"], 0), (["test_m.py::test_bad"], 1),
    (["test_m.py::test_gone"], 5)])
def test_the_tests_asked_for_run_and_one_that_is_gone_does_not(tmp_path, asked, status):
    (tmp_path / "test_m.py").write_text("def test_bad():\n    assert 0\ndef test_good():\n    pass\n")
    done = subprocess.run([sys.executable, "-m", "pytest", "-q", "-n0", "-p", "verification.mutants.machine.reach",
                           "test_m.py"], cwd=tmp_path, capture_output=True, text=True,
                          env={**os.environ, "PYTHONPATH": str(ROOT), "REACHING": json.dumps(asked)})
    assert done.returncode == status, done.stdout


DIFF = """--- mutation diff ---
--- arepro/fem/m.py
+++ brepro/fem/m.py
@@ -1,3 +1,3 @@
 before
-    {old}
{new} after
"""


@pytest.mark.parametrize("outcome, output, verdict, test", [
    ("killed", "F\nFAILED tests/test_a.py::test_b[1] - assert", "caught", "tests/test_a.py::test_b[1]"),
    ("killed", "timeout", "timeout", ""), ("killed", "Aborted", "survivor", ""), ("survived", ".", "survivor", "")])
@pytest.mark.parametrize("operator, old, new, change", [
    ("core/AddNot", "if a:", "+    if not a:\n", ("if a:", "if not a:")),
    ("core/RemoveDecorator", "@cache", "", ("@cache after", "after"))])
def test_a_row_has_the_change_and_what_came_of_it(outcome, output, verdict, test, operator, old, new, change):
    mutation = SimpleNamespace(module_path=record.Path("repro/fem/m.py"), start_pos=(2, 0), operator_name=operator)
    result = SimpleNamespace(diff=DIFF.format(old=old, new=new), output=output, test_outcome=outcome)
    row = record._row(mutation, result)
    assert (row["verdict"], row["test"], row["file"], (row["old"], row["new"])) == (verdict, test, "fem/m.py", change)


@pytest.mark.parametrize("caught, survivor, timeout, equal, is_enough", [
    (95, 5, 0, 0, True), (94, 6, 0, 0, False), (94, 5, 1, 0, False), (0, 0, 0, 0, False), (90, 10, 0, 10, True),
    (89, 11, 0, 11, False)])
def test_the_share_is_that_of_the_caught_without_few_equivalent_ones(monkeypatch, caught, survivor, timeout, equal,
                                                                      is_enough):
    counts = {"caught": caught, "timeout": timeout, "survivor": survivor}
    rows = [{"file": "m.py", "old": verdict, "new": "", "verdict": verdict}
            for verdict, count in counts.items() for _ in range(count)]
    if equal:
        monkeypatch.setitem(EQUIVALENT, record.key(rows[-1]), "it is the same")
    verdicts = record.judged(rows)
    assert len(verdicts["equivalent"]) == equal and record.holds(verdicts) is is_enough


def test_modules_share_the_sample_by_their_size_and_operators_stay_in_their_group():
    assert sample.shared({"a": 10, "b": 1, "c": 30}, {"a": 5, "b": 2, "c": 3}, 8) == {"a": 4, "b": 1, "c": 3}
    assert sample.is_taken("ReplaceBinaryOperator_Add_Sub") and not sample.is_taken("ReplaceBinaryOperator_Add_BitOr")


def test_the_page_is_that_of_the_record_and_reasons_are_given_for_lines_that_are_there():
    assert record.PAGE.read_text(encoding="utf-8") == record.text()
    texts = {path.relative_to(ROOT / "repro").as_posix(): path.read_text(encoding="utf-8")
             for path in (ROOT / "repro").rglob("*.py")}
    for file, old, new in {**EQUIVALENT, **LEFT}:
        assert old != new and all(line in " ".join(texts[file].split()) for line in old.splitlines()), (file, old)
