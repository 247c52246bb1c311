"""The verification can fail: verdicts follow from numbers, orders are judged on both sides."""
import math
import sys
from dataclasses import replace

import numpy as np
import pytest

from reference import channel_bvp, channel_fipy, taylor_hood
from repro.errors import LinearError
from repro.fem.space import Space
from verification.kernel import case, driver, matrix, mutants, report, writing
from verification.kernel.case import (
    Check,
    Outcome,
    Result,
    Study,
    at_least,
    at_most,
    between,
    combined,
    refine,
    studies,
    study,
)
from verification.problems import meshes

SIZES = 0.5 ** np.arange(4)


def result(*checks, studies=(), error=""):
    return Result("flow-plug", Outcome(checks, studies), error, 1.0)


@pytest.mark.parametrize("check, holds", [
    (at_most("x", 0.9, 1.0, ""), True), (at_most("x", 1.1, 1.0, ""), False), (at_most("x", -0.1, 1.0, ""), False),
    (at_least("x", 2.0, 1.0, ""), True), (at_least("x", 0.5, 1.0, ""), False),
    (between("x", 1.5, 1.0, 2.0, ""), True), (between("x", 2.5, 1.0, 2.0, ""), False),
    (Check("x", math.nan, 0.0, 1.0, ""), False), (at_most("x", math.inf, 1.0, ""), False),
])
def test_a_number_holds_in_its_range_alone(check, holds):
    assert check.holds is holds


def test_a_case_passes_only_if_it_measures_something_and_all_of_it_holds():
    good, bad = at_most("good", 0.5, 1.0, ""), at_most("bad", 2.0, 1.0, "")
    assert result(good).verdict == case.PASSES
    for short in (result(good, bad), result(), result(good, error="ValueError"), result(studies=(_of_order(3.0),))):
        assert short.verdict == case.FALLS_SHORT


def _of_order(order, ceiling=math.inf):
    return study("error", SIZES, SIZES**order, 2, "", ceiling=ceiling)


@pytest.mark.parametrize("order, holds", [(2.0, True), (2.2, True), (1.8, True), (1.0, False), (3.0, False),
                                          (1.6, False), (2.4, False), (0.0, False)])
def test_a_wrong_order_is_caught_on_both_sides(order, holds):
    assert _of_order(order).holds is holds


def test_one_bad_pair_is_enough():
    errors = SIZES**2 * [1, 1, 4, 1]
    assert not study("error", SIZES, errors, 2, "").holds


@pytest.mark.parametrize("errors", [[1, 0.25, 0.0625, math.nan], [1, 0.25, 0.0625, 0.0], [1, 1, 1, 1]])
def test_errors_that_are_no_errors_fail(errors):
    assert not study("error", SIZES, errors, 2, "").holds


def test_the_last_error_must_be_small_enough():
    assert _of_order(2.0, ceiling=0.02).holds and not _of_order(2.0, ceiling=0.01).holds


@pytest.mark.parametrize("sizes", [[1, 0.5, 0.25], [1, 0.5, 0.25, 0.25], [0.25, 0.5, 1, 2]])
def test_a_study_takes_four_falling_sizes(sizes):
    with pytest.raises(ValueError, match="4 or more falling sizes"):
        Study("error", np.array(sizes, float), np.array(sizes, float) ** 2, 1.5, 2.5, "")


@pytest.mark.parametrize("value, quantum, text", [
    (1.23456e-3, 5e-5, "0.00123"), (3e-16, 5e-11, "under 1e-11"), (2.0004, 0.01, "2"), (41.27, 0.5, "41.3"),
    (math.nan, 0.1, "nan"),
])
def test_numbers_are_told_to_their_tolerance(value, quantum, text):
    assert case.rounded(value, quantum) == text


def test_an_error_in_a_case_is_a_failure_with_its_reason():
    chosen = case.Case("x", "flow", "c", "exact", "n", ("m",), False, lambda: 1 / 0)
    found = case.run(chosen)
    assert not found.holds and "ZeroDivisionError" in found.error


def test_floating_point_warnings_are_errors_in_a_case():
    chosen = case.Case("x", "flow", "c", "exact", "n", ("m",), False,
                       lambda: Outcome((at_most("q", np.zeros(1) / 0, 1, ""),)))
    assert "FloatingPointError" in case.run(chosen).error


def test_every_stage_has_cases_and_each_says_what_must_break_it():
    driver.load()
    assert {c.stage for c in case.CASES.values()} == set(case.STAGES)
    assert all(c.claim and c.norm and c.mutants and c.kind in case.KINDS for c in case.CASES.values())


def test_a_case_is_called_for_each_of_its_variants_whose_label_ends_its_names():
    curve = case.Profile("picture", "x", "y", ())
    chosen = case.Case("x", "flow", "c", "exact", "n", ("m",), False,
                       lambda value: ([at_most("q", value, 1.5, "")], _of_order(2.0), (curve for _ in range(2))),
                       {"one": (1.0,), "two": (2.0,)})
    found = case.run(chosen).outcome
    assert [part.quantity for part in found.checks] == ["q, one", "q, two"]
    assert [part.holds for part in found.checks] == [True, False] and len(found.studies) == 2
    assert [part.title for part in found.profiles] == ["picture, one", "picture, one", "picture, two", "picture, two"]


def test_a_variant_that_stops_hides_no_other_and_is_named():
    def reciprocal(value):
        yield at_most("q", 1 / value, 1.0, "")

    chosen = case.Case("x", "flow", "c", "exact", "n", ("m",), False, reciprocal,
                       {"none": (0,), "two": (2,), "half": (0.5,), "also none": (0,)})
    found = case.run(chosen)
    assert [(part.quantity, part.holds) for part in found.outcome.checks] == [("q, two", True), ("q, half", False)]
    assert found.error.startswith("none: Traceback") and "\nalso none: Traceback" in found.error
    assert found.error.count("ZeroDivisionError") == 2 and not found.holds


@pytest.mark.parametrize("errors, caught, how", [
    ((LinearError("no flow"), ValueError("x")), True, "LinearError: no flow"),
    ((ValueError("x"), LinearError("no flow")), True, "LinearError: no flow"),
    ((ValueError("x"), KeyError("y")), False, "KeyError: 'y'"),
])
def test_a_guard_that_stops_any_variant_catches_a_mutant(errors, caught, how):
    def stopped(error):
        raise error

    chosen = case.Case("x", "flow", "c", "exact", "n", ("m",), False, stopped, {str(e): (e,) for e in errors})
    assert mutants.judged(case.run(chosen)) == (caught, how)


def test_what_a_case_runs_over_is_every_combination_with_its_label():
    found = combined({"order 2": 2, "order 3": 3}, {"lambda = 1": 1.0})
    assert found == {"order 2, lambda = 1": (2, 1.0), "order 3, lambda = 1": (3, 1.0)}


def test_errors_of_unrelated_meshes_are_averaged_and_studied_by_their_own_size():
    """Root mean squares of what every mesh of a size gives; nominal sizes where none are measured."""
    errors = refine(lambda size, mesh, factor: {"error": factor * size * (1 + 6 * mesh)}, {2.0: 2, 1.0: 1}, 3.0)
    assert errors["size"].tolist() == [2.0, 1.0] and errors["error"].tolist() == [30.0, 3.0]
    measured = refine(lambda size, mesh: {"size": size + mesh, "error": 1.0}, {4.0: 1, 1.0: 2})
    assert measured["size"] == pytest.approx([4.0, np.sqrt(2.5)])


def test_studies_are_rows_of_a_table():
    errors = {"size": SIZES, "a": SIZES**2, "b": SIZES**1.2, "c": SIZES}
    found = studies(errors, {"a": (2, "theory", 0.02), "b": ((1.0, 1.1), "seen", 1.0)}, " of all")
    assert [(one.quantity, one.low, one.high, one.ceiling, one.origin, one.holds) for one in found] == [
        ("a of all", 1.7, 2.3, 0.02, "theory", True), ("b of all", 1.0, 1.1, 1.0, "seen", False)]


@pytest.mark.parametrize("labels, more, ways", [
    (("linear", "cubic"), "", ("1", "3")), (("order 2, traction",), "", ("2",)),
    (("straight", "curved"), "3", ("1", "2", "3")), (("R = 5 um, quadratic",), "paper", ("2", "paper")),
    (("fast", "accurate, cubic"), "2", ("2", "3", "fast", "accurate")),
])
def test_labels_tell_with_what_a_case_runs(labels, more, ways):
    assert case._ways("x", labels, more) == ways


def test_a_way_that_is_none_is_refused():
    with pytest.raises(ValueError, match="x: 4 are none of 1, 2, 3, paper, fast, accurate"):
        case._ways("x", (), "4")


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


def test_what_is_round_off_or_another_machines_is_not_committed():
    assert at_most("x", 3e-13, 1e-9, "").told == "" and at_most("x", 0.012345, 0.1, "").told == "0.01"
    assert between("x", 1.0, 0.123456, 2.0, "").accepted == "0.123 to 2"
    assert _of_order(2.0).told == "order 2.0, 2.0, 2.0"
    driver.load()
    (line,) = result(at_most("x", 3e-13, 1e-9, "why")).outcome.lines()
    assert line == ("x", "at most 1e-09", "why", True)


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
    assert driver.selected(["growth"], ["flow-plug"])[0] == "flow-plug"
    assert all(case.CASES[i].stage == "growth" for i in driver.selected(["growth"], []))
    with pytest.raises(SystemExit, match="no case"):
        driver.selected([], ["nonsense"])


@pytest.mark.parametrize("id", ["growth-stress", "growth-homogeneous", "reprojection-supermesh", "mesh_motion-plug"])
def test_a_quick_case_runs_and_passes(id):
    driver.load()
    found = case.run(case.CASES[id])
    assert found.holds, report.terminal([found])


def test_a_mutant_is_caught(monkeypatch):
    """J^(1/3) in the stress: the closed form sees it."""
    from repro.model import growth
    driver.load()
    monkeypatch.setattr(growth, "cauchy", lambda F, P: _wrong_cauchy(F, P, growth.piola(F, P)))
    assert not case.run(case.CASES["growth-stress"]).holds


def _wrong_cauchy(F, P, S):
    J = np.linalg.det(F) ** 0.5
    sigma = np.einsum("...ik,...jk->...ij", S, F) / J[..., None, None]
    return np.stack([sigma[..., 0, 0], sigma[..., 1, 1], P, sigma[..., 0, 1]], axis=-1)


def test_the_exit_status_is_the_verdict(monkeypatch, capsys):
    driver.load()
    for checks, status in (((at_most("q", 0.5, 1.0, ""),), 0), ((at_most("q", 2.0, 1.0, ""),), 1)):
        monkeypatch.setattr(driver, "run_all", lambda ids, jobs, found=checks: [result(*found)])
        assert driver.main(["flow"]) == status
    monkeypatch.setattr(driver, "run_all", lambda ids, jobs: [])
    assert driver.main(["flow"]) == 1
    assert "0 of 1 cases pass" in capsys.readouterr().out


def test_the_report_says_what_fell_short_and_holds_no_time():
    driver.load()
    found = [result(at_most("quantity A", 2.0, 1.0, "theory"))]
    assert "quantity A: 2; expected at most 1 (theory)" in report.terminal(found)
    text = report.texts(found)[f"{case.CASES['flow-plug'].stage}.md"]
    assert "FALLS SHORT" in text and "| quantity A (2) | at most 1 | theory | NO |" in text
    assert "seconds" not in text and "1.0 s" not in text


def test_random_meshes_cover_their_rectangle_and_follow_their_lines():
    grid = meshes.channel((-10.0, 20.0), 8.0, 1.1, lambda x, y: (x > 0) & (y < 3), across=(0.0,), along=(3.0,), seed=3)
    assert grid.areas.min() > 0 and grid.areas.sum() == pytest.approx(240.0, rel=1e-13)
    assert grid.areas[grid.biomass].sum() == pytest.approx(60.0, rel=1e-13)
    assert meshes.l2_error(grid.points, grid.triangles, grid.points[:, 0], lambda x, y: x) < 1e-14
    assert meshes.sample(grid.points, grid.triangles, grid.points, np.array([[1.5, 2.5]])) == pytest.approx(
        np.array([[1.5, 2.5]]))


def test_taylor_hood_holds_poiseuille_and_the_plug_exactly():
    found = taylor_hood.stokes(taylor_hood.plug(5.0, (-10.0, 10.0), 4.0, 3), 100.0)
    assert found.loss == pytest.approx(12 / 25 * (12 + 100 * 8), rel=1e-10)


def test_finite_volumes_and_collocation_agree_and_conserve():
    rates = {"k": 0.4, "F": 1.5, "decay": 0.006, "K_A": 1.0, "K_D": 1.0}
    given = (1e5, (10.0, 10.0), (1e7, 4e6), (8e6, 3e6), 3e4, rates, 40.0)
    fine = channel_fipy.Channel(120, (-40.0, 80.0), *given)
    ours, theirs = fine.steady(), channel_bvp.strip(fine.x, *given)
    assert np.abs(ours - theirs).max() < 1e-3
    taken = 3e4 * channel_bvp.uptake(*ours, rates)[0][fine.density > 0].sum()
    assert taken == pytest.approx(1e5 * (10 - ours[0, -1]), rel=1e-8)


def test_names_that_begin_and_end_alike_are_told_together():
    """No name is lost, and what is told of one is not told of another."""
    names = ["C, R = 5, fast (order 2.0)", "C, R = 7, fast (order 2.0)", "C, R = 9, fast (order 1.9)", "P, a", "P, b",
             "Q, a", "Q, b", "u, 1, slow", "u, 2, slow", "u, 3, slow", "alone, x"]
    assert report.shared(names) == ("C: R = 5, fast; R = 7, fast (each order 2.0); R = 9, fast (order 1.9) / "
                                    "P, Q: a; b / u: 1; 2; 3, each slow / alone, x")


def test_what_a_case_keeps_besides_tells_its_page():
    """In the place of its numbers, which are judged all the same."""
    class Kept(case.Note):
        def lines(self, every):
            return [("kept", f"{len(every)}", "why", True)]

    chosen = case.Case("x", "flow", "c", "exact", "n", ("m",), False,
                       lambda value: (at_most("q", value, 1.5, ""), Kept()), {"one": (1.0,), "two": (2.0,)})
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
