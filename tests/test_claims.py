"""Verdicts of `verification.claims`: each is reachable, and none lacks a number, an error bar and a narrow range."""
import math
from dataclasses import replace

import pytest

from verification import claims, sensitivity
from verification.claims import (
    CHANGED,
    CONTRADICTED,
    NOT_JUDGED,
    REPRODUCED,
    UNDECIDED,
    VERDICTS,
    WITHIN_ROUNDING,
    ClaimError,
    Finding,
    after_contact,
    report,
)
from verification.uncertainty import Bar


def sure(check, half=0.0):
    """Return a check with an error bar of half-width ``half``."""
    return replace(check, bar=Bar(check.value - half, check.value + half))


GOOD = claims.near("speed (m/d)", "2.9", 2.91, 2.9, 0.029, "1 %")
BAD = claims.at_most("share (%)", "<0.5", 0.7, 0.5, "the paper's bound")
SATISFIED, DOUBTED = sure(GOOD), sure(GOOD, 0.02)
FAILED, DOUBTED_FAILURE = sure(BAD, 0.1), sure(BAD, 0.3)


@pytest.mark.parametrize("checks, words, verdict", [
    ((SATISFIED,), {"rounding": "k 9.31"}, REPRODUCED),
    ((SATISFIED, DOUBTED), {"change": "at saturation"}, UNDECIDED),
    ((SATISFIED, SATISFIED), {"change": "at saturation"}, CHANGED),
    ((FAILED, DOUBTED_FAILURE, SATISFIED), {"change": "at saturation"}, CONTRADICTED),
    ((SATISFIED, DOUBTED_FAILURE), {"rounding": "k 9.31"}, UNDECIDED),
    ((SATISFIED, FAILED), {"rounding": "k 9.31"}, WITHIN_ROUNDING),
])
def test_each_verdict_follows_from_the_checks_and_their_bars(checks, words, verdict):
    assert Finding(checks, reason="it leaks", **words).verdict == verdict
    assert verdict in VERDICTS and len(VERDICTS) == 6


@pytest.mark.parametrize("end, low, high, outcome", [
    (88.0, 24.0, 72.0, "fails"), (60.0, 24.0, 72.0, "reaches over"), (88.0, 24.0, math.inf, "holds")])
def test_a_number_that_a_run_does_not_reach_is_a_lower_bound(end, low, high, outcome):
    """The value is the end of the run. Under an upper bound it never holds; beyond this bound it fails."""
    check = claims.between("time (h)", "a couple of days", end, low, high, "as stated", bar=Bar(end, math.inf))
    assert check.is_lower_bound and check.outcome == outcome and check.holds == (outcome == "holds")
    assert report.value_text(check.value, check.bar.high) == f"not reached by {end:g}"
    assert report.inside(end, end, None) and not report.inside(end - 1, end, None)


# The committed record.
@pytest.fixture(scope="module")
def record():
    return report.read()


def bounds_of(entry):
    """Return the interval of an entry of the record, where null marks an open end."""
    return tuple(math.inf * sign if entry[end] is None else entry[end] for end, sign in (("low", -1), ("high", 1)))


def test_the_recorded_verdicts_follow_from_the_recorded_numbers(record):
    """The test computes every outcome and verdict from intervals and tolerances alone. A printed number holds if its
    interval contains the bar; only statements in words have other tolerances."""
    for entry in (definition for known in record for definition in report.definitions(known)):
        for check in entry["checks"]:
            bounds, printed = bounds_of(check["tolerance"]), claims.interval(check["paper"])
            assert claims.outcome_of(bounds_of(check), bounds) == check["outcome"], check["quantity"]
            assert (check.get("paper_low"), check.get("paper_high")) == (printed or (None, None)), check["quantity"]
            assert printed in (None, bounds), check["quantity"]
        outcomes = {check["outcome"] for check in entry["checks"]}
        follows = claims.verdict_of(outcomes, bool(entry["change"]), bool(entry["rounding"]))
        verdict = follows if outcomes else NOT_JUDGED
        assert entry["verdict"] == verdict, entry["defined"]


def test_a_claim_counts_with_its_first_definition(record):
    """Claims that were redefined after their values had been seen keep all definitions."""
    redefined = {entry["id"]: entry for entry in record if entry["other_definitions"]}
    assert {"C13", "C39", "C41", "C46"} <= redefined.keys()
    for entry in redefined.values():
        first, *later = report.definitions(entry)
        if entry["verdict"] == NOT_JUDGED:
            assert (first, later) == (entry, []) and report.describe_verdicts(entry) == NOT_JUDGED
            continue
        assert report.counted(entry) is first and all(first["defined"] < each["defined"] for each in later)
        assert all(each["replaced_because"] and each["words"] for each in entry["other_definitions"])
        assert f"{first['verdict']} (as redefined: {later[-1]['verdict']})" == report.describe_verdicts(entry)
    assert [report.counted(redefined[id])["verdict"] for id in ("C13", "C39", "C41")] == [CONTRADICTED] * 3


def test_a_definition_is_dated_before_its_first_value(record):
    """No definition in the record is later than its first value, and none of the rule's time is as late."""
    for entry in record:
        for definition in report.definitions(entry):
            times = definition["defined"], definition["first_value"]
            assert times[0] < times[1] or times[0] == times[1] < report.RULE_SINCE, entry["id"]


DEFINED = {"id": "C01", "defined": "2030-01-02 10:00", "checks": [
    {"quantity": "speed at 3 h", "paper": "2.9", "tolerance": {"origin": "half a unit"}}]}
OTHER = {**DEFINED, "checks": [{**DEFINED["checks"][0], "quantity": "speed of another shape"}]}


@pytest.mark.parametrize("entry, known, now", [
    (DEFINED, None, "2030-01-02 09:59"),
    ({**DEFINED, "defined": claims.SET}, None, "2030-01-02 10:01"),
    (OTHER, {**DEFINED, "first_value": "2030-01-02 10:01"}, "2030-01-02 10:03"),
    ({**OTHER, "defined": "2030-01-02 10:04"}, {**DEFINED, "first_value": "2030-01-02 10:01"}, "2030-01-02 10:03"),
])
def test_a_definition_without_a_date_before_its_values_is_refused(entry, known, now):
    with pytest.raises(ClaimError, match="C01: the definition is new"):
        report.stamped(entry, known, now)


def test_no_recorded_verdict_flips_to_its_opposite(record):
    """If a bound moves by the bar of its number, a decided verdict becomes undecided at most, or an undecided one
    decided. At most a tenth of the decided verdicts become undecided."""
    verdicts = {entry["id"]: entry["verdict"] for entry in record}
    flips = [flip for entry in record for flip in report.flips(entry)]
    assert all(UNDECIDED in (flip.verdict, verdicts[flip.id]) for flip in flips), flips
    assert len({flip.id for flip in flips if verdicts[flip.id] != UNDECIDED}) <= len(record) // 10


def test_bars_are_as_narrow_as_required(record):
    """The limit is 0.2 % for velocities, effluents, uptake and concentrations of section 4. All wider bars of base have
    a reason. After contact it is 1 % for conductivity and tips and 2 % for the length of contact."""
    for entry in record:
        for check in entry["checks"]:
            width = check["high"] - check["low"] if entry["id"] <= "C05" else 0.0
            assert width <= 2 * 0.002 * abs(check["value"]), (entry["id"], check["quantity"])
    assert "" not in after_contact.wide_bars_of_base(record)
    rows = sensitivity.record()["after_contact"]
    wider = [row["quantity"] for row in rows if row["bar_percent"] > 1 + ("length" in row["quantity"])]
    assert wider == [] and len(rows) == 12
