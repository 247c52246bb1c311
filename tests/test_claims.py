"""The verdicts of `verification.claims`: each can be reached, none without a number and a bar, none by a wide range."""
import json
import math
from dataclasses import replace

import numpy as np
import pytest

from verification import claims
from verification.claims import (
    CHANGED,
    CONTRADICTED,
    EXPECTED,
    FAILS,
    HOLDS,
    INSIDE_BAR,
    INSIDE_FEW,
    NEITHER,
    REACHES_OVER,
    REPRODUCED,
    UNDECIDED,
    WITHIN_BAR,
    ClaimError,
    Finding,
    evaluate,
    independence,
    levels,
    report,
)
from verification.claims import __main__ as driver
from verification.claims.levels import DEFAULT, Level
from verification.claims.mass_balance import Bookkeeping
from verification.uncertainty import Bar, Estimate


def sure(check, half=0.0):
    """A check with a bar of half a width."""
    return replace(check, bar=Bar(check.ours - half, check.ours + half))


GOOD = claims.near("speed (m/d)", "2.9", 2.91, 2.9, relative=0.01, why="1 %")
BAD = claims.at_most("share (%)", "<0.5", 0.7, 0.5, "the paper's bound")
HELD, DOUBTED, FAILED, DOUBTED_FAILURE = sure(GOOD), sure(GOOD, 0.02), sure(BAD, 0.1), sure(BAD, 0.3)


@pytest.fixture
def registry(monkeypatch):
    """An empty registry, and a driver that registers and computes nothing on its own, in one process."""
    monkeypatch.setattr(claims, "CLAIMS", {})
    for module in (driver, evaluate):
        monkeypatch.setattr(module, "CLAIMS", claims.CLAIMS)
    monkeypatch.setattr(evaluate, "register_all", lambda: None)
    monkeypatch.setattr(evaluate, "compute", lambda scenes: None)
    monkeypatch.setattr(evaluate, "side_by_side", lambda function, *given: list(map(function, *given)))
    return claims.CLAIMS


def registered(id, function, **levels):
    return claims.claim(id, "4", "what it says", f"python -m verification.claims {id}", **levels)(function)


@pytest.mark.parametrize("finding, verdict", [
    (Finding((HELD,)), REPRODUCED),
    (Finding((HELD,), reason="not needed"), REPRODUCED),
    (Finding((HELD, DOUBTED)), REPRODUCED + WITHIN_BAR),
    (Finding((HELD, HELD), change="at saturation"), CHANGED),
    (Finding((DOUBTED,), change="at saturation"), CHANGED + WITHIN_BAR),
    (Finding((HELD, FAILED), reason="it leaks"), CONTRADICTED),
    (Finding((FAILED, DOUBTED_FAILURE), reason="it leaks"), CONTRADICTED),
    (Finding((HELD, DOUBTED_FAILURE), reason="it leaks"), UNDECIDED),
    (Finding((FAILED,), change="at saturation", reason="it leaks"), CONTRADICTED),
])
def test_each_verdict_follows_from_the_checks_and_their_bars(finding, verdict):
    """Mutants: contradicted within the bar; reproduced without a word of a bar that reaches over the bound."""
    assert finding.verdict == verdict


@pytest.mark.parametrize("finding, said", [
    (Finding((HELD, FAILED)), "no reason"),
    (Finding((DOUBTED_FAILURE,)), "no reason"),
    (Finding(()), "nothing is checked"),
    (Finding((replace(HELD, ours=math.nan),), reason="why"), "not a number"),
    (Finding((HELD, GOOD)), "no error bar"),
])
def test_no_verdict_without_numbers_or_bars_or_without_a_reason(finding, said):
    with pytest.raises(ClaimError, match=said):
        print(finding.verdict)


@pytest.mark.parametrize("ours, half, outcome", [
    (2.0, 0.1, HOLDS), (2.0, 0.2, HOLDS), (2.0, 0.21, REACHES_OVER), (2.1, 0.15, REACHES_OVER),
    (2.3, 0.15, REACHES_OVER), (2.3, 0.05, FAILS), (1.5, 0.2, FAILS), (1.5, 0.9, REACHES_OVER),
])
def test_a_check_is_judged_with_the_whole_of_its_bar(ours, half, outcome):
    """Accepted is 1.8 to 2.2. Mutants: the number alone; one side of the bar."""
    check = claims.between("q", "2", ours, 1.8, 2.2 + 1e-12, "")
    assert sure(check, half).outcome == outcome


@pytest.mark.parametrize("held, outcome", [((True,) * 3, HOLDS), ((False,) * 3, FAILS), ((True, False), REACHES_OVER)])
def test_a_number_without_a_limit_is_judged_at_every_level(held, outcome):
    """Each level has its own range. Mutant: the default's range for the values of all levels."""
    check = claims.without_limit(claims.at_most("triangles", "6", 5, 6, ""))
    assert replace(check, bar=Bar(5, 7), held=held).outcome == outcome


@pytest.mark.parametrize("paper, ours, half, against", [
    ("2.9", 2.91, 0.02, INSIDE_BAR), ("2.9", 2.91, 0.005, INSIDE_FEW), ("~2.9", 2.77, 0.0, INSIDE_FEW),
    ("2.9", 3.05, 0.1, NEITHER), ("2.9", 3.05, 0.2, INSIDE_BAR),
    ("about the same", 2.9, 0.1, ""), ("<2.9", 2.9, 0.1, ""),
])
def test_where_the_papers_value_is(paper, ours, half, against):
    """A few percent are five. Mutants: relative to ours; the bar on one side; a bound taken for a value."""
    check = claims.near("q", paper, ours, 2.9, relative=0.5, why="")
    assert sure(check, half).against_paper == against


def test_a_printed_bound_is_no_printed_value():
    assert sure(claims.at_most("triangles", "6", 5, 6, "")).against_paper == ""


@pytest.mark.parametrize("check, inside, outside", [
    (claims.near("q", "2", 0, 2.0, relative=0.1, why=""), (1.81, 2.19), (1.79, 2.21)),
    (claims.near("q", "-2", 0, -2.0, relative=0.1, why=""), (-2.19, -1.81), (-2.21, -1.79, 2.0)),
    (claims.near("q", "0", 0, 0.0, absolute=1, why=""), (-1, 1), (-1.01, 1.01)),
    (claims.at_most("q", "<3", 0, 3, ""), (-1e9, 3), (3.01, math.inf)),
    (claims.at_least("q", ">3", 0, 3, ""), (3, 1e9), (2.99, -math.inf)),
    (claims.between("q", "1 to 2", 0, 1, 2, ""), (1, 2), (0.99, 2.01, math.nan)),
])
def test_a_check_holds_in_its_range_alone(check, inside, outside):
    assert all(replace(check, ours=value).holds for value in inside)
    assert not any(replace(check, ours=value).holds for value in outside)


@pytest.mark.parametrize("tolerances", [{}, {"relative": 0.1, "absolute": 0.1}])
def test_near_needs_one_tolerance(tolerances):
    with pytest.raises(ValueError, match="tolerance"):
        claims.near("q", "2", 2.0, 2.0, why="", **tolerances)


def test_a_claim_has_one_judge(registry):
    registered("C01", lambda: Finding((GOOD,)))
    with pytest.raises(ValueError, match="twice"):
        registered("C01", lambda: Finding((GOOD,)))


def test_a_claim_that_nobody_computes_is_a_failure(registry, capsys):
    registered("C01", lambda: Finding((GOOD,)))
    assert driver.main(["C01"]) == 0
    assert driver.main(["C01", "C02"]) == 1
    assert "C02  NO VERDICT" in capsys.readouterr().out


@pytest.mark.parametrize("function", [lambda: Finding((BAD,)), lambda: Finding(()), lambda: 1 / 0])
def test_an_error_is_a_failure_and_the_others_are_judged(registry, capsys, function):
    registered("C01", function)
    registered("C02", lambda: Finding((BAD,), reason="it leaks"))
    assert driver.main(["C01", "C02"]) == 1
    out = capsys.readouterr().out
    assert "C01  NO VERDICT" in out and "C02  CONTRADICTED" in out and "because: it leaks" in out


def test_a_contradicted_claim_is_no_failure(registry):
    registered("C01", lambda: Finding((BAD,), reason="it leaks"))
    assert driver.main(["C01"]) == 0


def test_an_unknown_id_is_refused(registry):
    assert driver.main(["C38"]) == 2


def test_only_what_the_checks_need_is_run_at_every_level(registry):
    """Mutant: runs of which only words tell at every level."""
    registered("C01", lambda: None, scenes=(("base",),), words=(("wide",),), steps=(1.0,), fixed="why")
    found = evaluate.scenes(["C01"])
    assert [said.name for said in found] == ["base", "wide", "base", "base", "base"]
    assert [said.numerics.refinement for said in found] == pytest.approx([1.0, 1.0, 2**-0.5, 2**0.5, 2.0])


def test_words_are_worked_out_at_the_default_level_alone(registry, capsys):
    """Mutant: notes at every level, with runs of their own."""
    told = []
    registered("C01", lambda: Finding((GOOD,), note=lambda: told.append(levels.current()) or "told once"))
    assert driver.main(["C01"]) == 0 and told == [DEFAULT]
    assert "told once" in capsys.readouterr().out


@pytest.mark.parametrize("moved, expected", [((GOOD,), 0), ((BAD,), 1)])
def test_the_whole_report_is_written_and_needs_independence(registry, monkeypatch, tmp_path, moved, expected):
    for id in EXPECTED:
        registered(id, lambda: Finding((GOOD, claims.at_least("a", "|b|", 2, 1, ""))))
    lines = (("speed", (1.0, 2.0, 2.1), (100.0, 5.0)),)
    compared = independence.Comparison("three sizes", ("coarse", "base", "fine"), lines)
    monkeypatch.setattr(independence, "comparisons", lambda: (compared,))
    monkeypatch.setattr(independence, "checks", lambda: moved)
    monkeypatch.setattr(driver, "OUT", tmp_path / "out")
    assert driver.main([]) == expected
    written = json.loads((tmp_path / "out" / "claims.json").read_text(encoding="utf-8"))
    assert [row["id"] for row in written["claims"]] == list(EXPECTED)
    assert {row["verdict"] for row in written["claims"]} == {REPRODUCED}
    near, bound = written["claims"][0]["checks"]
    assert bound["high"] is None and bound["against_paper"] == "" and near["against_paper"] == INSIDE_FEW
    assert near["bar_low"] == near["bar_high"] == 2.91 and near["mesh"] == {"bar": 0.0, "order": None, "factor": 0.0}
    assert [level["values"] for level in written["claims"][0]["other_levels"]] == 6 * [[2.91, 2.0]]
    assert written["summary"][1:] == ["74 numbers with their bars: 74 hold, 0 fail, the bar of 0 reaches over a bound.",
                                      f"37 values of the paper: 0 {INSIDE_BAR}, 37 {INSIDE_FEW}, 0 {NEITHER}."]
    table = (tmp_path / "out" / "claims.md").read_text(encoding="utf-8")
    assert "2.1 (+5.00 %)" in table
    assert "| exact<br>exact | same/same<br>same/same | -/-<br>-/- | 2.871 to 2.929<br>at least 1 |" in table


def test_a_level_that_fails_is_told_and_no_verdict(registry, capsys):
    """Mutant: bars from the levels that are left."""
    def judge():
        if levels.current() == Level(step=2.0):
            raise KeyError("no row at 19.2 h")
        return Finding((GOOD,))
    registered("C01", judge)
    assert driver.main(["C01"]) == 1
    out = capsys.readouterr().out
    assert "C01  NO VERDICT" in out and "step=2.0" in out and "no row at 19.2 h" in out


def test_a_bar_that_reaches_over_its_bound_is_told(registry, capsys):
    """The speed falls in proportion to the elements: its limit is 0.06 under the value, the bar 1.25 times that."""
    registered("C01", lambda: Finding((replace(GOOD, ours=2.85 + 0.06 * levels.current().size),)))
    assert driver.main(["C01"]) == 0
    out = capsys.readouterr().out
    assert "REPRODUCED, BUT A BAR REACHES OVER A BOUND" in out and "± 0.075" in out and "1.0/same" in out
    assert "1 numbers with their bars: 0 hold, 0 fail, the bar of 1 reaches over a bound." in out


def test_the_terminal_table_fits(registry):
    long = claims.near("a quantity " * 9, "about " * 9, 123456.789, 1e5, relative=1e-3, why="words " * 30)
    registered("C01", lambda: None)
    bar = Bar(1e5, 1.5e5, Estimate(1e4, 1.5, 1.25), Estimate(1.5e4, math.nan, 3.0))
    finding = Finding((replace(long, bar=bar),), reason="for " * 99, note="n " * 99)
    text = report.terminal(report.Row("C01", registry["C01"], finding, CONTRADICTED))
    assert max(map(len, (text + report.legend()).splitlines())) <= report.WIDTH
    assert "1.235e+05" in text and "+23 %" in text and "± 2.5e+04" in text and "1.5/none" in text and "1.25/3" in text


def test_every_row_of_the_paper_has_its_judge():
    evaluate.register_all()
    assert set(claims.CLAIMS) == set(EXPECTED)
    assert all(claim.function.__doc__ and claim.text and claim.command for claim in claims.CLAIMS.values())


def test_the_papers_bookkeeping_is_exact_for_a_steady_consumption_and_sees_a_growing_one():
    """Consumption that doubles within the step, booked at its end, is 4/3 of its mean over the step."""
    supply, volume, made = np.array([[10.0], [10.0]]), np.array([100.0, 100.0]), np.array([30.0, 30.0])
    consumed = np.array([[60.0, 60.0], [40.0, 40.0]])
    effluent = supply - consumed / volume * np.array([1.0, 4 / 3])
    book = Bookkeeping(np.array([0.2, 0.4]), volume, made, consumed, made, effluent, supply)
    assert book.ratio_errors()[:, 0] == pytest.approx(0, abs=1e-14)
    assert book.ratio_errors()[:, 1] == pytest.approx([-0.25, -0.25, 0])
    corrected = volume * (supply - book.corrections() * effluent)
    assert corrected == pytest.approx(consumed)
