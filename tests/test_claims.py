"""The verdicts of `verification.claims`: each can be reached, none without a number, none by a wide range."""
import json
import math
from dataclasses import replace

import numpy as np
import pytest

from verification import claims
from verification.claims import CHANGED, CONTRADICTED, EXPECTED, REPRODUCED, ClaimError, Finding, independence, report
from verification.claims import __main__ as driver
from verification.claims.mass_balance import Bookkeeping

GOOD = claims.near("speed (m/d)", "2.9", 2.91, 2.9, relative=0.01, why="1 %")
BAD = claims.at_most("share (%)", "<0.5", 0.7, 0.5, "the paper's bound")


@pytest.fixture
def registry(monkeypatch):
    """An empty registry, and a driver that registers and computes nothing on its own."""
    monkeypatch.setattr(claims, "CLAIMS", {})
    monkeypatch.setattr(driver, "CLAIMS", claims.CLAIMS)
    monkeypatch.setattr(driver, "register_all", lambda: None)
    monkeypatch.setattr(driver.runs, "compute", lambda runs: [])
    return claims.CLAIMS


def registered(id, function):
    return claims.claim(id, "4", "what it says", f"python -m verification.claims {id}")(function)


@pytest.mark.parametrize("finding, verdict", [
    (Finding((GOOD,)), REPRODUCED),
    (Finding((GOOD,), reason="not needed"), REPRODUCED),
    (Finding((GOOD, GOOD), change="at saturation"), CHANGED),
    (Finding((GOOD, BAD), reason="it leaks"), CONTRADICTED),
    (Finding((BAD,), change="at saturation", reason="it leaks"), CONTRADICTED),
])
def test_each_verdict_follows_from_the_checks(finding, verdict):
    assert finding.verdict == verdict


@pytest.mark.parametrize("finding, said", [
    (Finding((GOOD, BAD)), "no reason"),
    (Finding(()), "nothing is checked"),
    (Finding((replace(GOOD, ours=math.nan),), reason="why"), "not a number"),
])
def test_no_verdict_without_numbers_or_without_a_reason(finding, said):
    with pytest.raises(ClaimError, match=said):
        finding.verdict


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
    assert written["claims"][0]["checks"][1]["high"] is None
    assert "2.1 (+5.00 %)" in (tmp_path / "out" / "claims.md").read_text(encoding="utf-8")


def test_the_terminal_table_fits(registry):
    long = claims.near("a quantity " * 9, "about " * 9, 123456.789, 1e5, relative=1e-3, why="words " * 30)
    registered("C01", lambda: None)
    finding = Finding((long,), reason="for " * 99, note="n " * 99)
    text = report.terminal(report.Row("C01", registry["C01"], finding, CONTRADICTED))
    assert max(map(len, text.splitlines())) <= report.WIDTH
    assert "1.235e+05" in text and "+23 %" in text


def test_every_row_of_the_paper_has_its_judge():
    driver.register_all()
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
