"""The verdicts of `verification.claims`: each can be reached, none without a number and a bar, none by a wide range."""
import json
import math
from dataclasses import replace

import numpy as np
import pytest

from repro.scene import load_scene
from verification import claims, sensitivity
from verification.claims import (
    CHANGED,
    CONTRADICTED,
    EXPECTED,
    FAILS,
    HOLDS,
    REACHES_OVER,
    REPRODUCED,
    UNDECIDED,
    VERDICTS,
    WITHIN_ROUNDING,
    ClaimError,
    Finding,
    after_contact,
    base_run,
    evaluate,
    levels,
    report,
    runs,
)
from verification.claims import __main__ as driver
from verification.claims.levels import CONVERGED, SCHEME, Level, at_level
from verification.claims.scheme import Bookkeeping
from verification.sensitivity.rounding import factors_of, of_base, reached
from verification.sensitivity.rounding import scene as scene_of
from verification.uncertainty import Bar, Estimate


def sure(check, half=0.0):
    """A check with a bar of half a width."""
    return replace(check, bar=Bar(check.value - half, check.value + half))


GOOD = claims.near("speed (m/d)", "2.9", 2.91, 2.9, relative=0.01, why="1 %")
BAD = claims.at_most("share (%)", "<0.5", 0.7, 0.5, "the paper's bound")
HELD, DOUBTED, FAILED, DOUBTED_FAILURE = sure(GOOD), sure(GOOD, 0.02), sure(BAD, 0.1), sure(BAD, 0.3)


@pytest.fixture
def registry(monkeypatch, tmp_path):
    """An empty registry and record, and a driver that registers nothing on its own, in one process."""
    monkeypatch.setattr(claims, "CLAIMS", {})
    for module in (driver, evaluate):
        monkeypatch.setattr(module, "CLAIMS", claims.CLAIMS)
    monkeypatch.setattr(evaluate, "register_all", lambda: None)
    monkeypatch.setattr(evaluate, "side_by_side", lambda function, *given: list(map(function, *given)))
    monkeypatch.setattr(report, "COMMITTED", tmp_path / "claims.json")
    return claims.CLAIMS


def registered(id, function, **fields):
    return claims.claim(id, "4", "what it says", **fields)(function)


@pytest.mark.parametrize("finding, verdict", [
    (Finding((HELD,)), REPRODUCED),
    (Finding((HELD,), reason="not needed", rounding="k 9.31"), REPRODUCED),
    (Finding((HELD, DOUBTED), reason="a wide bar"), UNDECIDED),
    (Finding((HELD, HELD), change="at saturation"), CHANGED),
    (Finding((DOUBTED,), change="at saturation", reason="a wide bar"), UNDECIDED),
    (Finding((HELD, FAILED), reason="it leaks"), CONTRADICTED),
    (Finding((FAILED, DOUBTED_FAILURE), reason="it leaks"), CONTRADICTED),
    (Finding((HELD, DOUBTED_FAILURE), reason="it leaks", rounding="k 9.31"), UNDECIDED),
    (Finding((FAILED,), change="at saturation", reason="it leaks"), CONTRADICTED),
    (Finding((HELD, FAILED), reason="it leaks", rounding="k 9.31"), WITHIN_ROUNDING),
])
def test_each_verdict_follows_from_the_checks_and_their_bars(finding, verdict):
    assert finding.verdict == verdict and verdict in VERDICTS and len(VERDICTS) == 5


@pytest.mark.parametrize("finding, said", [
    (Finding((HELD, FAILED)), "no reason"),
    (Finding((DOUBTED_FAILURE,)), "no reason"),
    (Finding(()), "nothing is checked"),
    (Finding((replace(HELD, value=math.nan),), reason="why"), "not a number"),
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
    """Accepted is 1.8 to 2.2."""
    check = claims.between("q", "2", ours, 1.8, 2.2 + 1e-12, "")
    assert sure(check, half).outcome == outcome


@pytest.mark.parametrize("held, outcome", [((True,) * 3, HOLDS), ((False,) * 3, FAILS), ((True, False), REACHES_OVER)])
def test_a_number_without_a_limit_is_judged_at_every_level(held, outcome):
    """Each level has its own range."""
    check = claims.without_limit(claims.at_most("triangles", "6", 5, 6, ""))
    assert replace(check, bar=Bar(5, 7), held=held).outcome == outcome


@pytest.mark.parametrize("text, low, high", [("1.5", 1.45, 1.55), ("2.9", 2.85, 2.95), ("4.19", 4.185, 4.195),
                                             ("110", 109.5, 110.5), ("~60", 55, 65), ("~7", 6.5, 7.5),
                                             ("~5.8", 5.75, 5.85), ("~3", 2.5, 3.5)])
def test_a_printed_number_is_an_interval(text, low, high):
    assert claims.interval(text) == pytest.approx((low, high))
    check = claims.printed("q", text, low)
    assert (check.low, check.high) == pytest.approx((low, high)) and check.printed == pytest.approx((low, high))


@pytest.mark.parametrize("text", ["about the same", "<0.5", "", ">> 1"])
def test_words_are_no_interval(text):
    assert claims.interval(text) is None
    with pytest.raises(ValueError, match="no printed number"):
        claims.printed("q", text, 1.0)


@pytest.mark.parametrize("check, inside, outside", [
    (claims.near("q", "2", 0, 2.0, relative=0.1, why=""), (1.81, 2.19), (1.79, 2.21)),
    (claims.near("q", "-2", 0, -2.0, relative=0.1, why=""), (-2.19, -1.81), (-2.21, -1.79, 2.0)),
    (claims.near("q", "0", 0, 0.0, absolute=1, why=""), (-1, 1), (-1.01, 1.01)),
    (claims.at_most("q", "<3", 0, 3, ""), (-1e9, 3), (3.01, math.inf)),
    (claims.at_least("q", ">3", 0, 3, ""), (3, 1e9), (2.99, -math.inf)),
    (claims.between("q", "1 to 2", 0, 1, 2, ""), (1, 2), (0.99, 2.01, math.nan)),
])
def test_a_check_holds_in_its_range_alone(check, inside, outside):
    assert all(replace(check, value=value).holds for value in inside)
    assert not any(replace(check, value=value).holds for value in outside)


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
    committed(registry, "C01")
    assert driver.main(["C01"]) == 0
    assert driver.main(["C01", "C02"]) == 1
    assert "C02  NO VERDICT" in capsys.readouterr().out


def committed(registry, *ids):
    """What the claims come to now, as the committed record."""
    report.COMMITTED.write_text(json.dumps([report.entry(row) for row in driver.judged(ids)]), encoding="utf-8")


@pytest.mark.parametrize("function", [lambda: Finding((BAD,)), lambda: Finding(()), lambda: 1 / 0])
def test_an_error_is_a_failure_and_the_others_are_judged(registry, capsys, function):
    registered("C01", function)
    registered("C02", lambda: Finding((BAD,), reason="it leaks"))
    assert driver.main(["C01", "C02"]) == 1
    out = capsys.readouterr().out
    assert "C01  NO VERDICT" in out and "C02  CONTRADICTED" in out and "because: it leaks" in out


def test_a_contradicted_claim_is_no_failure(registry):
    registered("C01", lambda: Finding((BAD,), reason="it leaks"))
    committed(registry, "C01")
    assert driver.main(["C01"]) == 0


def test_an_unknown_id_is_refused(registry, capsys):
    assert driver.main(["C99"]) == 2 and "there is no C99; C01 to" in capsys.readouterr().err


def test_words_are_worked_out_at_the_judged_level_alone(registry, capsys):
    told = []
    registered("C01", lambda: Finding((GOOD,), note=lambda: told.append(levels.current()) or "told once"))
    driver.main(["C01"])
    assert told == [Level(CONVERGED, 0.5)] and "told once" in capsys.readouterr().out


def test_a_level_that_fails_is_told_and_no_verdict(registry, capsys):
    def judge():
        if levels.current() == Level(SCHEME, step=2.0):
            raise KeyError("no row at 19.2 h")
        return Finding((GOOD,))
    registered("C01", judge, about=claims.OF_SCHEME)
    assert driver.main(["C01"]) == 1
    out = capsys.readouterr().out
    assert "C01  NO VERDICT" in out and "step=2.0" in out and "no row at 19.2 h" in out


def test_a_bar_that_reaches_over_its_bound_is_undecided(registry, capsys):
    """The speed falls in proportion to the elements: its limit is 0.06 under the value at size 1, the bar 1.25 times
    that."""
    registered("C01", lambda: Finding((replace(GOOD, value=2.85 + 0.06 * levels.current().size),), reason="coarse"),
               about=claims.OF_SCHEME)
    driver.main(["C01"])
    out = capsys.readouterr().out
    assert "C01  UNDECIDED" in out and "reaches over" in out
    assert "1 numbers with their bars: 0 hold, 0 fail, the bar of 1 reaches over a bound." in out


BOUNDS = [("C01", "2.9", 2.85, 2.95, 0.001), ("C06", "<0.5", -math.inf, 0.5, 0.001)]


@pytest.mark.parametrize("id, text, low, high, half", BOUNDS)
@pytest.mark.parametrize("end", ["low", "high"])
def test_a_bound_moved_by_a_bar_flips_no_verdict_unnoticed(id, text, low, high, half, end):
    """A number on a bound is undecided, one a bar inside it holds, one a bar outside it fails: no step of the bound by
    the bar goes from one verdict to its opposite."""
    bound = {"low": low, "high": high}[end]
    if math.isinf(bound):
        return
    inwards = 1 if end == "low" else -1
    outcomes = [sure(claims.between("q", text, bound + inwards * part * half, low, high, ""), half).outcome
                for part in (1.001, 0.0, -1.001)]
    assert outcomes == [HOLDS, REACHES_OVER, FAILS]


def recorded_claim(low, high, bar, change="", rounding="", others=()):
    """An entry of the record with one check, and the outcomes of others that no bound is moved of."""
    checks = [(bar, (low, high), claims.outcome_of(bar, (low, high)))]
    checks += [((None, None), (None, None), outcome) for outcome in others]
    rows = [{"quantity": f"q{number}", "low": bar[0], "high": bar[1], "outcome": outcome,
             "tolerance": {"low": bounds[0], "high": bounds[1]}}
            for number, (bar, bounds, outcome) in enumerate(checks)]
    verdict = claims.verdict_of({row["outcome"] for row in rows}, bool(change), bool(rounding))
    return {"id": "C01", "verdict": verdict, "change": change, "rounding": rounding, "checks": rows}


@pytest.mark.parametrize("bar, flipped", [
    ((4.0, 6.0), []), ((0.5, 2.5), [UNDECIDED]), ((-0.5, 1.5), [REPRODUCED]),
    ((-1.5, -0.5), [UNDECIDED]), ((-4.0, -3.0), []), ((1.0, 1.0), []), ((8.0, 9.9), [UNDECIDED])])
def test_verdicts_that_a_bound_moved_by_its_bar_changes_are_listed(bar, flipped):
    """Accepted is 0 to 10."""
    assert [flip.verdict for flip in report.flips(recorded_claim(0.0, 10.0, bar))] == flipped


def test_a_flip_is_that_of_the_whole_claim():
    assert report.flips(recorded_claim(0.0, 10.0, (0.5, 2.5), others=[FAILS])) == []
    within = recorded_claim(0.0, 10.0, (-2.5, -0.5), rounding="k 9.3", others=[HOLDS])
    assert [flip.verdict for flip in report.flips(within)] == [UNDECIDED]
    changed = recorded_claim(0.0, 10.0, (-0.5, 1.5), change="at saturation")
    assert [flip.verdict for flip in report.flips(changed)] == [CHANGED]


def test_the_whole_report_is_written_and_compared(registry, monkeypatch, tmp_path, capsys):
    for id in EXPECTED:
        registered(id, lambda: Finding((GOOD, claims.at_least("a", "|b|", 2, 1, ""))))
    lines = (("speed", (1.0, 2.0, 2.1), (100.0, 5.0)),)
    compared = base_run.Comparison("three sizes", ("coarse", "base", "fine"), lines)
    monkeypatch.setattr(base_run, "computed", dict)
    monkeypatch.setattr(base_run, "comparisons", lambda rows: (compared,))
    monkeypatch.setattr(base_run, "checks", lambda rows: (GOOD,))
    monkeypatch.setattr(driver, "OUT", tmp_path / "out")
    assert driver.main([]) == 1 and "C01: not in the record" in capsys.readouterr().out
    assert driver.main(["--record"]) == 0
    kept = report.COMMITTED.read_bytes()
    assert driver.main([]) == 0 and report.COMMITTED.read_bytes() == kept
    assert f"{len(EXPECTED)} claims as recorded in claims.json" in capsys.readouterr().out
    written = json.loads((tmp_path / "out" / "claims.json").read_text(encoding="utf-8"))
    assert written == json.loads(kept) and [row["id"] for row in written] == list(EXPECTED)
    near, bound = written[0]["checks"]
    assert bound["tolerance"]["high"] is None and bound["paper_low"] is None and near["paper_low"] == 2.85
    assert near["low"] == near["high"] == 2.91 and near["scheme_2001"] == [2.91, 2.91]
    table = (tmp_path / "out" / "claims.md").read_text(encoding="utf-8")
    assert "2.1 (+5.00 %)" in table and "| 2.91<br>2 | 2.91<br>2 |" in table
    monkeypatch.setattr(base_run, "checks", lambda rows: (BAD,))
    assert driver.main([]) == 1


def test_a_number_out_of_its_recorded_interval_is_told(registry, capsys):
    registered("C01", lambda: Finding((GOOD,)))
    committed(registry, "C01")
    content = json.loads(report.COMMITTED.read_text(encoding="utf-8"))
    content[0]["checks"][0] |= {"low": 2.92, "high": 2.93}
    report.COMMITTED.write_text(json.dumps(content), encoding="utf-8")
    assert driver.main(["C01"]) == 1
    assert "C01: speed (m/d) is 2.91, recorded as 2.92 to 2.93" in capsys.readouterr().out
    content[0]["checks"][0] |= {"low": 2.91 * (1 - 1e-12), "high": 2.92}
    content[0]["verdict"] = CONTRADICTED
    report.COMMITTED.write_text(json.dumps(content), encoding="utf-8")
    assert driver.main(["C01"]) == 1
    assert "C01: reproduced, recorded as contradicted" in capsys.readouterr().out


def test_some_claims_are_recorded_anew_and_the_others_stay(registry):
    for id in ("C01", "C02"):
        registered(id, lambda: Finding((GOOD,)))
    assert driver.main(["--record", "C02"]) == 0 and driver.main(["--record", "C01"]) == 0
    assert [each["id"] for each in report.read()] == ["C01", "C02"]
    claims.CLAIMS.pop("C01")
    registered("C01", lambda: Finding((BAD,), reason="it leaks"))
    assert driver.main(["C01"]) == 1 and driver.main(["--record", "C01"]) == 0
    assert [each["verdict"] for each in report.read()] == [CONTRADICTED, REPRODUCED]


def test_the_terminal_table_fits(registry):
    long = claims.near("a quantity " * 9, "about " * 9, 123456.789, 1e5, relative=1e-3, why="words " * 30)
    registered("C01", lambda: None)
    bar = Bar(1e5, 1.5e5, Estimate(1e4, 1.5, 1.25), Estimate(1.5e4, math.nan, 3.0))
    finding = Finding((replace(long, bar=bar, scheme=(-1.2345e-5, 1.2345e-5)),), reason="for " * 99, note="n " * 99)
    text = report.terminal(report.Row("C01", registry["C01"], finding, CONTRADICTED))
    assert max(map(len, (text + report.legend()).splitlines())) <= report.WIDTH
    assert "1.235e+05" in text and "1e+05 to" in text and "1.234e-05" in text


def test_every_row_of_the_paper_has_its_judge():
    evaluate.register_all()
    assert set(claims.CLAIMS) == set(EXPECTED)
    assert all(claim.function.__doc__ and claim.text and claim.command for claim in claims.CLAIMS.values())


# The committed record.
@pytest.fixture(scope="module")
def kept():
    return report.read()


def test_the_record_has_every_claim_in_its_schema(kept):
    assert [each["id"] for each in kept] == list(EXPECTED)
    wanted = {"quantity", "rests_on", "paper", "paper_low", "paper_high", "value", "low", "high", "input_low",
              "input_high", "scheme_2001", "on_sizes", "order", "tolerance", "outcome"}
    for each in kept:
        assert each["verdict"] in VERDICTS and each["claim"] and each["checks"], each["id"]
        for check in each["checks"]:
            assert set(check) == wanted and set(check["tolerance"]) == {"low", "high", "origin", "date"}, each["id"]
            assert check["outcome"] in (HOLDS, FAILS, REACHES_OVER) and check["tolerance"]["origin"], each["id"]
            assert check["low"] is None or check["low"] <= check["value"] <= check["high"], each["id"]
            assert (check["paper_low"] is None) == (claims.interval(check["paper"]) is None), each["id"]
            assert check["paper_low"] is None or check["paper_low"] < check["paper_high"], each["id"]


def test_the_recorded_verdicts_follow_from_the_recorded_numbers(kept):
    """Computed again from intervals and tolerances alone."""
    for each in kept:
        outcomes = {check["outcome"] for check in each["checks"]}
        for check in each["checks"]:
            low, high = (math.inf * sign if check["tolerance"][end] is None else check["tolerance"][end]
                         for end, sign in (("low", -1), ("high", 1)))
            if check["outcome"] == HOLDS:
                assert low <= check["value"] <= high, each["id"]
        expected = (UNDECIDED if FAILS not in outcomes else WITHIN_ROUNDING if each["rounding"] else CONTRADICTED)
        if outcomes == {HOLDS}:
            expected = CHANGED if each["change"] else REPRODUCED
        assert each["verdict"] == expected, each["id"]


def test_no_recorded_verdict_flips_to_its_opposite(kept):
    """With a bound moved by the bar of its number a verdict comes to be open at most, or an open one decided; of the
    decided ones no more than a tenth comes to be open."""
    verdicts = {each["id"]: each["verdict"] for each in kept}
    found = [flip for each in kept for flip in report.flips(each)]
    assert all(UNDECIDED in (flip.verdict, verdicts[flip.id]) for flip in found), found
    assert len({flip.id for flip in found if verdicts[flip.id] != UNDECIDED}) <= len(kept) // 10


def test_bars_after_contact_are_listed(kept):
    """Those of every claim about wide, the widest first."""
    found = after_contact.known(kept)
    assert {each.id for each in found} == set(after_contact.OF_WIDE) - {"C38", "C45"}
    evaluate.register_all()
    assert set(after_contact.OF_WIDE) == {id for id, one in claims.CLAIMS.items() if one.fine == levels.WIDE_FINE}
    assert [each.percent for each in found] == sorted((each.percent for each in found), reverse=True)
    check = {"low": 9.0, "high": 11.0, "value": 10.0}
    assert after_contact.percent(check) == 10.0 and after_contact.percent({**check, "value": 0.0}) == math.inf
    assert after_contact.percent({"low": 0.0, "high": 0.0, "value": 0.0}) == 0


def test_a_bar_after_contact_is_told_with_its_convergence():
    """Of a record that has the values on the sizes; without an order where none fits."""
    check = {"quantity": "q", "low": 0.9, "high": 1.1, "value": 1.0, "on_sizes": [1.0, 1.1, 1.2], "order": 1.04}
    entry = {"id": after_contact.OF_WIDE[0], "checks": [check, {**check, "quantity": "p", "order": None}]}
    told = [each.told for each in after_contact.known([entry])]
    assert told == ["      10 %  C12  q: 1, 1.1, 1.2, order 1.0", "      10 %  C12  p: 1, 1.1, 1.2, no order"]
    assert after_contact.Known("C12", "q", 3.0).told == "       3 %  C12  q"


def test_exact_is_told_by_its_distance_from_the_finest_and_their_bar():
    """0.5 % is shown where both together are less; of what 2 % are asked, nothing is said."""
    row = {"quantity": "q", "values": [2.0, 2.1], "bar_percent": 0.3, "asked_percent": 1.0}
    assert after_contact.distance(row, 1.997) == "q: 2, 2.1, bar 0.3 %; exact 1.997, -0.15 %; 0.5 % shown"
    assert after_contact.distance(row, 2.005).endswith("+0.25 %; 0.5 % not shown")
    assert after_contact.distance({**row, "asked_percent": 2.0}, 1.997).endswith("-0.15 %")


def test_the_distance_of_exact_is_of_every_recorded_number(monkeypatch, capsys):
    rows = after_contact.sensitivity.record()["after_contact"]
    ours = {row["quantity"]: row["values"][0] for row in rows}
    monkeypatch.setattr(after_contact, "exact", lambda: (ours, 12.0))
    after_contact.main()
    told = capsys.readouterr().out
    assert told.count("+0 %") == len(rows) == 8 and "took 12 s of processor time, 60 s are asked" in told
    assert told.count("0.5 % shown") + told.count("0.5 % not shown") == 6


#: Claims about base whose numbers a test can compute in seconds.
QUICK = ("C01", "C02", "C03", "C04", "C05", "C06", "C09", "C15", "C34")


def test_coordinates_perturbed_by_1e_12_change_no_verdict_and_leave_no_interval(kept, monkeypatch):
    """As another machine would: the seed's radius, and with it every node, is moved by 1e-12."""
    evaluate.register_all()
    monkeypatch.setattr(runs, "load_scene", perturbed)
    with at_level(Level(CONVERGED, 0.5)):
        found = {id: claims.CLAIMS[id].function() for id in QUICK}
    levels.forget(Level(CONVERGED, 0.5))
    known = {each["id"]: each for each in kept}
    for id, finding in found.items():
        for check, recorded in zip(finding.checks, known[id]["checks"], strict=True):
            assert report.inside(check.value, recorded["low"], recorded["high"]), (id, check.quantity, check.value)
            assert check.holds == (recorded["outcome"] == HOLDS), (id, check.quantity)


def perturbed(name, changes=()):
    said = load_scene(name, changes)
    return replace(said, aggregate=replace(said.aggregate, radius=said.aggregate.radius * (1 + 1e-12)))


def test_bars_of_base_are_as_narrow_as_asked(kept):
    """0.2 % on velocities, effluents and uptake of section 4."""
    known = {each["id"]: each for each in kept}
    for id in ("C01", "C02", "C03", "C04"):
        for check in known[id]["checks"]:
            assert check["high"] - check["low"] <= 2 * 0.002 * abs(check["value"]), (id, check["quantity"])


def test_one_set_of_inputs_gives_all_printed_numbers_of_base():
    """A real run with the recorded set, every input within its rounding."""
    found = sensitivity.record()["one_set"]
    factors = factors_of(found["inputs"])
    rounding = sensitivity.record()["rounding"]
    assert found["reached"] and all(abs(factor - 1) <= rounding[name] + 1e-12 for name, factor in factors.items())
    numbers = of_base(scene_of("base", factors))
    assert reached(numbers)


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
