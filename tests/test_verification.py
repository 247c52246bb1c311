"""The verification can fail: verdicts follow from numbers, orders are judged on both sides, and every quick case
passes."""
import math
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest

from repro.errors import LinearError
from repro.fem.space import Space
from repro.scene.keys import PRESETS
from verification.kernel import case, driver, matrix, mutants, report, writing
from verification.kernel.case import (
    Outcome,
    Result,
    Study,
    at_least,
    at_most,
    between,
    refine,
    studies,
    study,
)

SIZES = 0.5 ** np.arange(4)
#: A case that nobody registers: what it measures, and of which variants.
A_CASE = case.Case("x", "flow", "c", "exact", "n", ("m",), False, list)


def result(*checks, studies=(), error=""):
    return Result("flow-plug", Outcome(checks, studies), error, 1.0)


@pytest.mark.parametrize("made, bounds, inside, outside", [
    (at_most, (1.0,), (0.0, 0.9, 1.0), (1.1, -0.1, math.inf, math.nan)),
    (at_least, (1.0,), (1.0, 2.0), (0.5, math.nan)),
    (between, (1.0, 2.0), (1.0, 1.5, 2.0), (0.9, 2.5, math.nan))])
def test_a_number_holds_in_its_range_alone(made, bounds, inside, outside):
    assert all(made("x", value, *bounds, "").holds for value in inside)
    assert not any(made("x", value, *bounds, "").holds for value in outside)


def test_a_case_passes_only_if_it_measures_something_and_all_of_it_holds():
    good = at_most("good", 0.5, 1.0, "")
    bad = at_most("bad", 2.0, 1.0, "")
    steep = study("e", SIZES, SIZES**3, 2, "")
    assert result(good).verdict == case.PASSES
    for short in (result(good, bad), result(), result(good, error="ValueError"), result(good, studies=(steep,))):
        assert short.verdict == case.FALLS_SHORT


@pytest.mark.parametrize("errors, ceiling, holds", [
    (SIZES**2.2, 1, True), (SIZES**1.8, 1, True), (SIZES**1.6, 1, False), (SIZES**2.4, 1, False),
    (SIZES**2 * [1, 1, 4, 1], 1, False), (SIZES**2, 0.02, True), (SIZES**2, 0.01, False),
    *((np.where(np.arange(4) == k, wrong, SIZES**2), 1, False)
      for k in range(4) for wrong in (math.nan, math.inf, 0.0, -1.0))])
def test_a_wrong_order_is_caught_on_both_sides(errors, ceiling, holds):
    """One bad pair is enough, and a last error that is too large."""
    assert study("error", SIZES, errors, 2, "", ceiling=ceiling).holds is holds


@pytest.mark.parametrize("sizes", [[1, 0.5, 0.25], [1, 0.5, 0.25, 0.25], [0.25, 0.5, 1, 2]])
def test_a_study_takes_four_falling_sizes(sizes):
    with pytest.raises(ValueError, match="4 or more falling sizes"):
        Study("error", np.array(sizes, float), np.array(sizes, float) ** 2, 1.5, 2.5, "")


def overflow():
    yield at_most("q", np.zeros(1) / 0, 1, "")


@pytest.mark.parametrize("function, error", [(lambda: 1 / 0, "ZeroDivisionError"), (overflow, "FloatingPointError")])
def test_an_error_in_a_case_is_a_failure_with_its_reason(function, error):
    """Floating-point warnings are errors."""
    found = case.run(replace(A_CASE, function=function))
    assert not found.holds and error in found.error


def test_every_stage_has_cases_of_known_kinds():
    driver.load()
    assert {c.stage for c in case.CASES.values()} == set(case.STAGES)
    assert all(c.claim and c.norm and c.mutants and c.kind in case.KINDS for c in case.CASES.values())


def test_a_case_is_called_for_each_of_its_variants_whose_label_ends_its_names():
    curve = case.Profile("picture", "x", "y", ())
    chosen = replace(A_CASE, over={"one": (1.0,), "two": (2.0,)}, function=lambda value: (
        [at_most("q", value, 1.5, "")], study("error", SIZES, SIZES, 1, ""), (curve for _ in range(2))))
    found = case.run(chosen).outcome
    assert [(part.quantity, part.holds) for part in found.checks] == [("q, one", True), ("q, two", False)]
    assert [part.quantity for part in found.studies] == ["error, one", "error, two"]
    assert [part.title for part in found.profiles] == ["picture, one"] * 2 + ["picture, two"] * 2


def test_a_variant_that_stops_hides_no_other_and_is_named():
    chosen = replace(A_CASE, function=lambda value: [at_most("q", 1 / value, 1.0, "")],
                     over={"none": (0,), "two": (2,), "half": (0.5,), "also none": (0,)})
    found = case.run(chosen)
    assert [(part.quantity, part.holds) for part in found.outcome.checks] == [("q, two", True), ("q, half", False)]
    assert found.error.startswith("none: Traceback") and "\nalso none: Traceback" in found.error and not found.holds


@pytest.mark.parametrize("errors, caught, how", [
    ((LinearError("no flow"), ValueError("x")), True, "LinearError: no flow"),
    ((ValueError("x"), LinearError("no flow")), True, "LinearError: no flow"),
    ((ValueError("x"), KeyError("y")), False, "KeyError: 'y'"),
])
def test_a_guard_that_stops_any_variant_catches_a_mutant(errors, caught, how):
    def stopped(error):
        raise error

    chosen = replace(A_CASE, function=stopped, over={str(error): (error,) for error in errors})
    assert mutants.judged(case.run(chosen)) == (caught, how)


def test_errors_of_unrelated_meshes_are_averaged_and_studied_by_their_own_size():
    """Root mean squares of what every mesh of a size gives; nominal sizes where none are measured."""
    errors = refine(lambda size, mesh, factor: {"error": factor * size * (1 + 6 * mesh)}, {2.0: 2, 1.0: 1}, 3.0)
    assert (*errors["size"], *errors["error"]) == (2.0, 1.0, 30.0, 3.0)
    measured = refine(lambda size, mesh: {"size": size + mesh, "error": 1.0}, {4.0: 1, 1.0: 2})
    assert measured["size"] == pytest.approx([4.0, np.sqrt(2.5)])


def test_studies_are_rows_of_a_table():
    found = studies({"size": SIZES, "a": SIZES**2, "b": SIZES**1.2, "c": SIZES},
                    {"a": (2, "theory", 0.02), "b": ((1.0, 1.1), "seen", 1.0)}, " of all")
    assert [(one.quantity, one.low, one.high, one.ceiling, one.origin, one.holds) for one in found] == [
        ("a of all", 1.7, 2.3, 0.02, "theory", True), ("b of all", 1.0, 1.1, 1.0, "seen", False)]


@pytest.mark.parametrize("id", ["flow-sections", "transport-mean-biomass", "growth-homogeneous", "reprojection-mass",
                                "coupling-stiffness"])
def test_a_case_runs_with_the_orders_that_it_says(id, monkeypatch):
    driver.load()
    orders, made = set(), Space.__init__

    def watched(self, *given):
        made(self, *given)
        orders.add(str(self.order))

    monkeypatch.setattr(Space, "__init__", watched)
    _forget()
    case.run(case.CASES[id])
    assert orders == {way for way in case.CASES[id].ways if way in matrix.ORDERS}


def _forget():
    """Empty what the cases keep."""
    rooms = [module for name, module in sys.modules.items() if name.startswith("verification.")]
    for kept in [value for room in rooms for value in vars(room).values() if hasattr(value, "cache_clear")]:
        kept.cache_clear()


def test_what_is_verified_by_what_has_no_orphan_and_is_written():
    """Every case, mutant, reference and claim stands in a line of the modules, and no line is without cases."""
    driver.load()
    assert matrix.orphans() == [] and matrix.unexplained() == []
    assert matrix.FILE.read_text(encoding="utf-8") == matrix.text()


def test_an_orphan_is_told(monkeypatch):
    driver.load()
    lost = replace(case.CASES["flow-plug"], mutants=("none",), ways=("1",), because="")
    monkeypatch.setitem(case.CASES, "flow-plug", lost)
    assert matrix.orphans() == ["case flow-plug"] and matrix.unexplained() == ["flow-plug"]


@pytest.mark.parametrize("ways, because, told, explained", [
    (case.WAYS, "", "", True), (case.WAYS[:-1], "", "", False), (case.WAYS[:-1], "exact: why", "exact: why", True),
    (case.WAYS[:3], "", matrix.ALONE, True), (case.WAYS[:4], "", matrix.ONE_BY_ONE, True),
    (case.WAYS[1:], "", "", False), (case.WAYS[1:], "order 1: why", "order 1: why", True)])
def test_a_case_says_why_it_does_not_run_with_a_preset(monkeypatch, ways, because, told, explained):
    """Above all with exact, where it runs with accurate."""
    driver.load()
    one = replace(case.CASES["coupling-units"], ways=ways, because=because)
    monkeypatch.setitem(case.CASES, one.id, one)
    assert matrix.reasons(one) == told and matrix.unexplained() == [one.id] * (not explained)


def test_exact_has_the_elements_and_the_order_of_accurate():
    """What is said of stages that run with accurate alone: what else differs are sizes and steps."""
    apart = {key for key, value in PRESETS["exact"].items() if value != PRESETS["accurate"].get(key)}
    assert PRESETS["accurate"].keys() <= PRESETS["exact"].keys()
    assert apart == {"refinement", "tolerance", "contact_elements"}
    assert {matrix.EXACT[stage] for stage in ("flow", "transport")} == {matrix.SAME}


def test_what_is_round_off_or_another_machines_is_not_committed():
    (line,) = result(at_most("x", 3e-13, 1e-9, "why")).outcome.lines()
    assert line == ("x", "at most 1e-09", "why", True)
    found = at_most("x", 0.012345, 0.1, ""), study("error", SIZES, SIZES**2, 2, "")
    assert [one.told for one in found] == ["0.01", "order 2.0, 2.0, 2.0"]
    assert between("x", 1.0, 0.123456, 2.0, "").accepted == "0.123 to 2"


def test_committed_pages_are_short():
    """An index, and a page a stage that a browser shows whole."""
    sizes = {path.name: path.stat().st_size for path in report.FOLDER.glob("*.md")}
    assert {f"{stage}.md" for stage in case.STAGES} | {"REPORT.md", "mutants.md", "matrix.md",
                                                          "sampled.md"} == {*sizes}
    assert sizes.pop("REPORT.md") <= 60_000 and max(sizes.values()) <= 40_000


def test_a_case_is_registered_once():
    driver.load()
    with pytest.raises(ValueError, match="flow-plug"):
        case.case("flow-plug", claim="c", kind="exact", norm="n", mutants=("m",))(lambda: Outcome())


def test_selection_by_stage_and_by_id():
    driver.load()
    assert driver.selected([], []) == [c.id for s in case.STAGES for c in case.CASES.values() if c.stage == s]
    first, *others = driver.selected(["growth"], ["flow-plug"])
    assert first == "flow-plug" and {case.CASES[id].stage for id in others} == {"growth"}
    with pytest.raises(SystemExit, match="no case"):
        driver.selected([], ["nonsense"])


def test_every_quick_case_passes():
    """Exit status 0, else the message tells what fell short; the report, which is of a whole run, is not written."""
    done = subprocess.run([sys.executable, "-m", "verification", "--fast"], capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "report:" not in done.stdout and " cases pass; " in done.stdout


GOOD, BAD = (result(at_most("q", value, 1.0, "")) for value in (0.5, 2.0))


@pytest.mark.parametrize("results, status, told", [
    ([GOOD], 0, "1 of 1"), ([BAD], 1, "0 of 1"), ([], 1, "0 of 0"), ([GOOD, BAD], 1, "1 of 2"),
    ([BAD, GOOD], 1, "1 of 2"), ([GOOD, GOOD], 0, "2 of 2")])
def test_the_exit_status_is_the_verdict(monkeypatch, capsys, results, status, told):
    monkeypatch.setattr(driver, "run_all", lambda ids, jobs: results)
    assert driver.main(["flow"]) == status and f"{told} cases pass" in capsys.readouterr().out


def test_the_report_says_what_fell_short_and_holds_no_time():
    driver.load()
    found = result(at_most("quantity A", 2.0, 1.0, "theory"))
    assert "quantity A: 2; expected at most 1 (theory)" in report.terminal([found])
    text = writing.markdown(report.article(found), 2)
    assert "FALLS SHORT" in text and "| quantity A (2) | at most 1 | theory | NO |" in text
    assert "seconds" not in text and "1.0 s" not in text


def test_what_a_case_keeps_besides_tells_its_page():
    """In the place of its numbers, which are judged all the same."""
    class Kept(case.Note):
        def lines(self, every):
            return [("kept", f"{len(every)}", "why", True)]

    chosen = replace(A_CASE, function=lambda value: (at_most("q", value, 1.5, ""), Kept()),
                     over={"one": (1.0,), "two": (2.0,)})
    found = case.run(chosen)
    assert found.outcome.lines() == [("kept", "2", "why", True)] and len(found.outcome.checks) == 2 and not found.holds


def test_tables_for_a_terminal_are_in_columns():
    """What Markdown has alone is left out, what pages have is told."""
    blocks = [writing.Block("heading", "H"), writing.table(("a", "long"), (("xyz", writing.Link("1", "flow")),)),
              writing.table(("b",), (), brief=True), writing.table(("c",), (("d",),), detail=True)]
    assert writing.plain(blocks) == "H\na    long\nxyz  1\nc\nd"


def test_rows_that_were_appended_are_read_but_for_one_that_was_cut(tmp_path):
    file = tmp_path / "deep" / "rows.jsonl"
    assert writing.lines(file) == []
    writing.append({"a": 1}, file)
    with file.open("a", encoding="utf-8") as opened:
        opened.write('{"a": 2')
    assert writing.lines(file) == [{"a": 1}]


def test_the_first_page_and_its_text_lead_to_what_is_judged_elsewhere():
    """Claims, errata, sensitivity and the law for networks, at files that are there."""
    blocks = report.index([])
    pages, text = writing.page("Verification", blocks), writing.markdown(blocks, 2)
    for link in ("../../paper_figures/replication.md", "../../reference/ERRATA.md", "../sensitivity/sensitivity.md",
                 "../../docs/network.md", "sampled.md"):
        assert f"<a href='{link}'>" in pages and f"]({link})" in text and (report.FOLDER / link).resolve().is_file()
    assert "<a href='mutants.html'>" in pages and "](mutants.md)" in text
