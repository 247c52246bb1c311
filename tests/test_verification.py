"""The verification can fail: verdicts follow from numbers, orders are judged on both sides, and every quick case
passes."""
import math
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest

from repro.fem.space import Space
from repro.scene.keys import PRESETS
from verification.kernel import case, driver, matrix, report, writing
from verification.evidence.checks import Outcome, Result, at_least, at_most, between, refine, study

SIZES = 0.5 ** np.arange(4)
#: A case that nobody registers: what it measures, and of which variants.
A_CASE = case.Case("x", "flow", "c", "exact", "n", ("m",), False, list, {}, (), "")


def result(*checks, studies=(), error=""):
    return Result("flow-plug", Outcome((*checks, *studies)), error, 1.0)


GOOD, BAD = (result(at_most("quantity A", value, 1.0, "theory")) for value in (0.5, 2.0))


@pytest.mark.parametrize("made, bounds, inside, outside", [
    (at_most, [1.0], [0.0, 1.0], [1.1, -0.1, math.inf, math.nan]), (at_least, [1.0], [1.0], [0.5, math.nan]),
    (between, [1.0, 2.0], [1.0, 2.0], [0.9, 2.5, math.nan])])
def test_a_number_holds_in_its_range_alone(made, bounds, inside, outside):
    assert all(made("x", value, *bounds, "").holds for value in inside)
    assert not any(made("x", value, *bounds, "").holds for value in outside)


def test_a_case_passes_only_if_it_measures_something_and_all_of_it_holds():
    good, bad = (one.outcome.measured[0] for one in (GOOD, BAD))
    steep = study("e", SIZES, SIZES**3, 2, "")
    assert GOOD.holds
    for short in (result(good, bad), result(), result(good, error="ValueError"), result(good, studies=(steep,))):
        assert short.verdict == case.FALLS_SHORT


@pytest.mark.parametrize("errors, ceiling, holds", [
    (SIZES**2.2, 1, True), (SIZES**1.8, 1, True), (SIZES**1.6, 1, False), (SIZES**2.4, 1, False),
    (SIZES**2 * [1, 1, 4, 1], 1, False), (SIZES**2, 0.02, True), (SIZES**2, 0.01, False),
    *((np.where(np.arange(4) == k, wrong, SIZES**2), 1, False)
      for k in range(4) for wrong in (math.nan, math.inf, 0.0, -1.0))])
def test_a_wrong_order_is_caught_on_both_sides(errors, ceiling, holds):
    """One bad pair is enough, and a last error that is too large; there are four pairs or none."""
    assert study("error", SIZES, errors, 2, "", ceiling=ceiling).holds is holds
    with pytest.raises(ValueError, match="4 or more falling sizes"):
        study("error", SIZES[:3], errors[:3], 2, "")


def test_a_variant_that_stops_hides_no_other_and_is_named():
    """Floating-point warnings stop it."""
    chosen = replace(A_CASE, function=lambda value: [at_most("q", np.ones(1)[0] / value, 1.0, "")],
                     over={"none": (np.zeros(1)[0],), "two": (2,), "half": (0.5,), "also none": (0,)})
    found = case.run(chosen)
    assert [(part.quantity, part.holds) for part in found.outcome.measured] == [("q, two", True), ("q, half", False)]
    assert found.error.startswith("none: Traceback") and "FloatingPointError" in found.error
    assert "\nalso none: Traceback" in found.error and not found.holds


def test_errors_of_unrelated_meshes_are_averaged_and_studied_by_their_own_size():
    """Root mean squares of what every mesh of a size gives."""
    found = refine(lambda size, mesh: {"size": size + mesh, "error": size * (1 + 6 * mesh)}, {4.0: 1, 1.0: 2})
    assert found["size"] == pytest.approx([4.0, np.sqrt(2.5)]) and found["error"] == pytest.approx([4.0, 5.0])


@pytest.mark.parametrize("id", ["flow-sections", "transport-mean-biomass", "growth-homogeneous"])
def test_a_case_runs_with_the_orders_that_it_says(id, monkeypatch):
    driver.load()
    orders, made = set(), Space.__init__

    def watched(self, *given):
        made(self, *given)
        orders.add(str(self.order))

    monkeypatch.setattr(Space, "__init__", watched)
    rooms = [module for name, module in sys.modules.items() if name.startswith("verification.")]
    for kept in [value for room in rooms for value in vars(room).values() if hasattr(value, "cache_clear")]:
        kept.cache_clear()
    case.run(case.CASES[id])
    assert orders == {way for way in case.CASES[id].ways if way in matrix.ORDERS}


def test_what_is_verified_by_what_has_no_orphan_and_is_written(monkeypatch):
    """Every case, mutant, reference and claim stands in a line of the modules, and no line is without cases; one that
    stands nowhere is told."""
    driver.load()
    assert matrix.orphans() == [] and matrix.unexplained() == []
    assert matrix.FILE.read_text(encoding="utf-8") == matrix.text()
    lost = replace(case.CASES["flow-plug"], mutants=("none",), ways=("1",), because="")
    monkeypatch.setitem(case.CASES, "flow-plug", lost)
    assert matrix.orphans() == ["case flow-plug"] and matrix.unexplained() == ["flow-plug"]


def test_exact_has_the_elements_and_the_order_of_accurate():
    """What is said of stages that run with accurate alone: what else differs are sizes and steps."""
    apart = {key for key, value in PRESETS["exact"].items() if value != PRESETS["accurate"].get(key)}
    assert apart == {"refinement", "tolerance", "contact_elements"}


def test_what_is_round_off_or_another_machines_is_not_committed():
    """Nor times; pages are short enough for a browser to show them whole."""
    found = at_most("x", 3e-13, 1e-9, ""), at_most("x", 0.012345, 0.1, ""), study("error", SIZES, SIZES**2, 2, "")
    assert [one.told for one in found] == ["", "0.01", "order 2.0, 2.0, 2.0"]
    assert between("x", 1.0, 0.123456, 2.0, "").accepted == "0.123 to 2"
    driver.load()
    text = writing.markdown(report.article(BAD), 2)
    assert "FALLS SHORT" in text and "| quantity A (2) | at most 1 | theory | NO |" in text
    assert "seconds" not in text and "1.0 s" not in text
    sizes = {path.name: path.stat().st_size for path in writing.REPORT.glob("*.md")}
    assert {*sizes} == {"REPORT.md", "mutants.md", "mutants_read.md", "matrix.md", "sampled.md",
                        *(f"{s}.md" for s in case.STAGES)}
    assert sizes.pop("REPORT.md") <= 60_000 and max(sizes.values()) <= 40_000


def test_every_quick_case_passes():
    """Exit status 0, else the message tells what fell short; the report, which is of a whole run, is not written."""
    done = subprocess.run([sys.executable, "-m", "verification", "--fast"], capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "report:" not in done.stdout and " cases pass; " in done.stdout


@pytest.mark.parametrize("results, status, told", [
    ([GOOD], 0, "1 of 1"), ([], 1, "0 of 0"), ([GOOD, BAD], 1, "quantity A: 2; expected at most 1 (theory)")])
def test_the_exit_status_is_the_verdict(monkeypatch, capsys, results, status, told):
    driver.load()
    monkeypatch.setattr(driver, "run_all", lambda ids, jobs: results)
    assert driver.main(["flow"]) == status and told in capsys.readouterr().out


def test_rows_that_were_appended_are_read_but_for_one_that_was_cut(tmp_path):
    file = tmp_path / "deep" / "rows.jsonl"
    assert writing.lines(file) == []
    writing.append({"a": 1}, file)
    with file.open("a", encoding="utf-8") as opened:
        opened.write('\n{"a": 2')
    assert writing.lines(file) == [{"a": 1}]
    writing.append({"a": 3}, file)
    assert writing.lines(file) == [{"a": 1}, {"a": 3}]
