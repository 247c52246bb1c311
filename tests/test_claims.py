"""Verdicts of `verification.claims`: each is reachable, and none lacks a number, an error bar and a narrow range."""
import math
from dataclasses import replace

import numpy as np
import pytest
import shapely

from reference import layered_channel
from verification import claims, sensitivity
from verification.claims import (
    CHANGED,
    CLAIMS,
    CONTRADICTED,
    DEGREE,
    DEPENDS,
    MEANINGS,
    NOT_JUDGED,
    REPRODUCED,
    TAKEN_BACK,
    UNDECIDED,
    VERDICTS,
    WITHIN_ROUNDING,
    ClaimError,
    Dependence,
    Finding,
    Meaning,
    adhesion,
    after_contact,
    assumed,
    discussed,
    evaluate,
    fluid_and_aggregate,
    folds,
    permeability,
    report,
    rheology,
    runs,
    scheme,
)
from verification.claims.levels import CONVERGED, Level, at_level
from verification.claims.permeability import clean
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
    assert Finding(checks, reason="it leaks", **words).verdict() == verdict
    assert verdict in VERDICTS and len(VERDICTS) == 8


SEVEN = sure(claims.at_most("apart (%)", "a few percent", 7.0, 5.0, "up to five"), 0.5)
WORDS = {"five": Meaning("up to 5 %", "first"),
         "three": Meaning("up to 3 %", "few", ("apart",), {"apart": (-math.inf, 3)}),
         "ten": Meaning("up to 10 %", "order", ("apart",), {"apart": (-math.inf, 10)}),
         "other": Meaning("the speed alone", "first", ("speed",))}


@pytest.mark.parametrize("names, holds, verdict", [
    (("five", "three"), {}, CONTRADICTED), (("ten", "other"), {}, REPRODUCED), (("five", "ten"), {}, DEGREE),
    (("ten", "five"), {}, DEGREE), (("five", "three"), {"5": True, "20": False}, DEPENDS),
    (("ten",), {"5": True, "20": True}, REPRODUCED), (("five",), {"5": False, "20": False}, CONTRADICTED)])
def test_a_verdict_follows_from_all_meanings_of_the_words(names, holds, verdict):
    """Meanings that differ make it a matter of degree; a range in which it holds in a part makes it depend on it."""
    finding = Finding((SEVEN, SATISFIED), reason="it leaks", dependence=Dependence("the supply", holds))
    assert finding.verdict(tuple(WORDS[name] for name in names)) == verdict


@pytest.mark.parametrize("meaning", [Meaning("none", "", ("area",)), Meaning("bound", "", ("",), {"area": (0, 1)})])
def test_a_meaning_that_names_no_quantity_is_refused(meaning):
    with pytest.raises(ClaimError, match="no quantity has the name"):
        Finding((SATISFIED,)).verdict((meaning,))


def test_a_threshold_is_that_of_all_numbers_with_the_same_words():
    """Up to the largest upper end the bound holds, and under the largest lower end it fails; for lower bounds the
    reverse; printed numbers have none."""
    few = [sure(claims.at_most(f"{name} apart (%)", "a few", value, 5.0, "up to five"), half)
           for name, value, half in (("rim", 2.0, 1.5), ("core", 3.0, 0.25))]
    most = [sure(claims.at_least(f"{name} (%)", "most", value, 50.0, "half"), 1.0) for name, value in (("up", 87.0),)]
    recorded = [report._check(check, claims.MODEL) for check in (*few, *most, SATISFIED)]
    assert report.flips(recorded) == [{"words": "a few", "bound": "at most", "holds": 3.5, "fails": 2.75},
                                      {"words": "most", "bound": "at least", "holds": 86.0, "fails": 88.0}]
    assert report.flip_text(report.flips(recorded)[0]) == '"a few" as at most 3.5 holds, and fails under 2.75'


def test_every_claim_with_words_of_degree_has_two_to_four_meanings():
    """Other claims are not judged, or have only printed numbers, closed forms, places and signs, or say that something
    can be done, or depend on their scene. The first meaning has the bounds of the claim's numbers."""
    evaluate.register_all()
    assert all(1 <= len(meanings) <= 4 and not meanings[0].bounds for meanings in MEANINGS.values())
    assert [id for id, meanings in MEANINGS.items() if len(meanings) < 2] == ["C09"] and "C09" in TAKEN_BACK
    assert all(meaning.words and meaning.origin for meanings in MEANINGS.values() for meaning in meanings)
    assert set(MEANINGS) <= {id for id, claim in CLAIMS.items() if not claim.unjudged}
    stated = {id for id, claim in CLAIMS.items() if not claim.unjudged} - set(MEANINGS)
    assert stated == {"C01", "C04", "C05", "C06", "C07", "C08", "C10", "C17", "C23", "C27", "C28", "C37", "C40", "C44"}


@pytest.mark.parametrize("end, low, high, outcome", [
    (88.0, 24.0, 72.0, "fails"), (60.0, 24.0, 72.0, "reaches over"), (88.0, 24.0, math.inf, "holds")])
def test_a_number_that_a_run_does_not_reach_is_a_lower_bound(end, low, high, outcome):
    """The value is the end of the run. Under an upper bound it never holds; beyond this bound it fails."""
    check = claims.between("time (h)", "a couple of days", end, low, high, "as stated", bar=Bar(end, math.inf))
    assert check.is_lower_bound and check.outcome == outcome and check.holds == (outcome == "holds")
    assert report.value_text(check.value, check.bar.high) == f"not reached by {end:g}"
    assert report.inside(end, end, None) and not report.inside(end - 1, end, None)


# Functions of claims on one synthetic run.
SCENE = runs.load_packaged("wide")
HOURS = np.linspace(0.0, 40.0, 21)
#: Area e^(t / 8) um2 times 100; K / K_clean = 50 / area; effluents, and a height, that are linear in the area.
AREA = 100 * np.exp(HOURS / 8)
SYNTHETIC = {"time_h": HOURS, "aggregate_area_um2": AREA, "conductivity_m_per_d": 24e-6 * clean(SCENE) * 50 / AREA,
             "effluent_acceptor_mg_per_L": 10 - AREA / 2000, "effluent_donor_mg_per_L": 10 - AREA / 3000,
             "mean_velocity_m_per_d": 2 + HOURS, "thickness_um": AREA / 200, "contact": 1.0 * (HOURS > 35)}
#: The last shape with a film and the first without, with a 20th of the conductivity.
TOUCHING = {"time_h": np.array([36.0, 36.1]), "aggregate_area_um2": np.array([9000.0, 9100.0]),
            "conductivity_m_per_d": 24e-6 * clean(SCENE) * 50 / np.array([9000.0, 20 * 9100.0])}
#: The rows before, and both.
APPROACH = {key: np.append(SYNTHETIC[key][HOURS < 36], values) for key, values in TOUCHING.items()}
#: Two steps: supplies 10 mg/L of 1 and 3 um2 of water, of which 40 and 20 % are taken up; biomass that lacks 2 %.
STEPS = {"end_h": np.array([1.0, 2.0]), "biomass_before_pg_per_m": np.array([100.0, 150.0]),
         "biomass_made_pg_per_m": np.array([50.0, 40.0]), "biomass_after_pg_per_m": np.array([150.0, 186.2])}
STEPS |= {f"{name}_supplied_pg_per_m": np.array([10.0, 30.0]) for name in ("acceptor", "donor")}
STEPS |= {f"{name}_{part}_pg_per_m": share * np.array([10.0, 30.0])
          for name, left in (("acceptor", 0.6), ("donor", 0.8))
          for part, share in (("out", left), ("consumed", 1 - left))}
#: A run whose area grows as its biomass does, X_m times. Its effluents are those at the starts of steps; the mean of a
#: step is 6 and 8 mg/L.
EVEN = {"aggregate_area_um2": np.array([100.0, 150.0, 190.0]) / SCENE.kinetics.maximum_density,
        "effluent_acceptor_mg_per_L": np.array([6.2, 6.1, 5.9]), "effluent_donor_mg_per_L": np.array([8.3, 8.1, 7.9])}
#: Effluents at the ends of steps, (2, 2) mg/L.
AT_ENDS = np.array([[5.8, 5.9], [7.7, 7.9]])
AGAINST = (10 - AT_ENDS) / [[4], [2]]
FOLDING = folds.StretchHistory(HOURS, 1 - HOURS / 100, np.exp(HOURS / 8), 1.0, "")
CREASED = np.exp(100 * (1 - 0.647) / 8)
#: {name: (value of a function of claims, its closed form)}; the error of linear interpolation is none.
VALUES = {
    "steepness": (lambda: permeability.steepness(("wide",)),
                  1 + np.log(20) / np.log(1.1)),
    "steepness over a layer's": (lambda: permeability.slopes(("wide",), "wide")[-1].value, (
        1 + np.log(20) / np.log(1.1)) * np.log(1.1) / np.log(layered_channel.gradient(1.0, 9100 / 6e4, 2000.0)
                                                            / layered_channel.gradient(1.0, 9100 / 6.6e4, 2000.0))),
    "fall within a quarter more biomass": (lambda: permeability.fall_of(("wide",), 0.25), 20 * 1.25),
    "steepest slope while a film is left": (lambda: permeability.steepest_with_film(("wide",)), 1.0),
    "slope of a layer in a pore twice as long": (
        lambda: permeability.layer_slope(("wide",), 12.0) * np.log(1.1),
        np.log(layered_channel.gradient(1.0, 9100 / 12e4, 2000.0)
               / layered_channel.gradient(1.0, 9100 / 13.2e4, 2000.0))),
    "conductivity of a pore twice as long": (lambda: permeability.at_length(0.2, SCENE, 12.0), 1 / (1 + 4 / 2)),
    "filled in a pore twice as long": (
        lambda: discussed.filled_at(1 / (1 + (AREA[14] / 50 - 1) / 2), ("wide",), 12.0), AREA[14] / 12e4),
    "time to which it is smooth": (lambda: folds.smooth_until(FOLDING), 35.3),
    "filled at a reduction": (lambda: discussed.filled_at(0.02), 50 / 0.02 / 6e4),
    "shares": (lambda: discussed.shares(SYNTHETIC), AREA / 20000),
    "share of the aggregate": (lambda: discussed.share_of_aggregate(0.1), 6e3 / 20000),
    "spread": (lambda: discussed.spread_in_percent(np.array([[1.0, 4.0], [3.0, 5.0], [2.0, 4.5]])), [200.0, 25.0]),
    "conductivity at a thickness": (lambda: assumed.conductivity_ratio_at(("wide",), AREA[7] / 2e4), 50 / AREA[7]),
    "change of the conductivity": (lambda: rheology.conductivity_change(("changed",), (10.0, 20.0), ("wide",)), 20.0),
    "acceptor consumed": (lambda: permeability.consumed(SYNTHETIC), (2 + HOURS) * AREA / 2000),
    "specific growth": (lambda: permeability.specific_growth(SYNTHETIC), np.full(20, 1 / 8)),
    "defects of the biomass": (lambda: runs.biomass_defects(("wide",)), [0.0, -3.8 / 186.2]),
    "time of contact": (lambda: runs.contact_time("wide"), 36.1),
    "nearest row": (lambda: runs.nearest(("wide",), 12.9), 12.0),
    "errors of the bookkeeping": (lambda: book().ratio_errors(), np.vstack([
        1 / AGAINST - 1, AGAINST[:1] / AGAINST[1:] - 1])),
    "errors of corrected effluents": (lambda: book().ratio_errors(1.01)[:2], [[4], [2]] / (10 - 1.01 * AT_ENDS) - 1),
    "corrections": (lambda: book().corrections(), [[6], [8]] / AT_ENDS),
    "dM_CA / dM_CD": (lambda: scheme.ratio_of(1.01, 4.0, 6.0), (10 - 4.04) / (10 - 6.06)),
    "expansion while smooth": (lambda: folds.smooth_expansion(FOLDING), CREASED),
    "expansion without creases": (lambda: folds.smooth_expansion(replace(FOLDING, stretch=np.ones(21))), np.exp(5.0)),
    "part upstream": (lambda: runs.upstream_part(shapely.box(-1, 0, 1, 1), shapely.box(-4, 0, 2, 1)), 0.75),
    "uncovered": (lambda: runs.uncovered(shapely.box(0, 0, 4, 1), shapely.box(1, 0, 5, 1)), 50.0),
    "in-plane stress": (lambda: runs.in_plane(np.array([[5.0, 1.0, 7.0, 1.5]])), [2.5]),
    "equivalent stress": (lambda: runs.equivalent(np.array([[0.0, 0.0, 3.0, 0.0], [0.0, 0.0, 0.0, 2.0]])),
                          [3.0, 12**0.5]),
}


def book():
    return scheme.bookkeeping(("even",))


@pytest.mark.parametrize("name", VALUES)
def test_a_function_of_claims_gives_its_closed_form_on_a_synthetic_run(name, monkeypatch):
    changed = SYNTHETIC | {"conductivity_m_per_d": 1.2 * SYNTHETIC["conductivity_m_per_d"]}
    tables = {"wide": SYNTHETIC, "changed": changed, "even": EVEN}
    replaced = {"series": lambda run: tables[run], "around_contact": lambda run: TOUCHING,
                "approach": lambda run: APPROACH,
                "load_packaged": lambda run: SCENE, "ledger": lambda run: STEPS,
                "at": lambda run, time: {key: column[HOURS == time][0] for key, column in tables[run[0]].items()}}
    for module in (runs, permeability, discussed, assumed, rheology, scheme):
        for function, value in replaced.items():
            if hasattr(module, function):
                monkeypatch.setattr(module, function, value)
    computed, expected = VALUES[name]
    assert computed() == pytest.approx(expected, rel=1e-9, abs=1e-12)


def test_growth_that_slides_distorts_nothing_and_softens_the_aggregate():
    """The mean distortion of base after 1 h is one, as far as growth is even; its least modulus falls with the volume
    ratio J as J^(-2/3), and the area has grown by J."""
    with at_level(Level(CONVERGED, 4.0)):
        aggregate = runs.body((*runs.BASE, *runs.until(1)), 1.0)
        grown = runs.series(*runs.BASE, *runs.until(1))["aggregate_area_um2"]
    assert adhesion.distortion(aggregate) == pytest.approx(1, abs=1e-3)
    softened = 1e6 * aggregate.scene.growth.shear_modulus * (grown[-1] / grown[0]) ** (-2 / 3)
    assert fluid_and_aggregate.forces(aggregate).stiffness == pytest.approx(softened, rel=1e-3)


# The committed record.
@pytest.fixture(scope="module")
def record():
    return report.read()


def bounds_of(entry):
    """Return the interval of an entry of the record, where null marks an open end."""
    return tuple(math.inf * sign if entry[end] is None else entry[end] for end, sign in (("low", -1), ("high", 1)))


def test_the_recorded_verdicts_follow_from_the_recorded_numbers(record):
    """The test computes every outcome and verdict from intervals, tolerances and meanings alone. A printed number holds
    if its interval contains the bar; only statements in words have other tolerances."""
    for entry in record:
        for definition in (entry, *entry["other_definitions"]):
            for check in definition["checks"]:
                bounds, printed = bounds_of(check["tolerance"]), claims.interval(check["paper"])
                assert claims.outcome_of(bounds_of(check), bounds) == check["outcome"], check["quantity"]
                assert (check.get("paper_low"), check.get("paper_high")) == (printed or (None, None)), check["quantity"]
                assert printed in (None, bounds), check["quantity"]
        words = bool(entry["change"]), bool(entry["rounding"])
        numbers = [(check["quantity"], bounds_of(check), bounds_of(check["tolerance"])) for check in entry["checks"]]
        given = [Meaning(meaning["words"], meaning["origin"], tuple(meaning["judges"]), {
            name: bounds_of(dict(zip(("low", "high"), ends))) for name, ends in meaning["bounds"].items()})
            .verdict(numbers, *words) for meaning in entry["meanings"]]
        assert given == [meaning["verdict"] for meaning in entry["meanings"]], entry["id"]
        verdict = claims.common_verdict(given, entry["depends"]) if given else NOT_JUDGED
        assert entry["verdict"] == verdict, entry["id"]
        assert entry["flips"] == report.flips(entry["checks"]), entry["id"]


def test_every_verdict_that_a_claim_ever_had_is_in_its_row(record):
    """All definitions that were replaced have their verdicts among the former ones. So have the claims whose verdict
    changed before the record kept former ones; the history of the record has these verdicts."""
    rows = {entry["id"]: entry for entry in record}
    for entry in record:
        former = [(each["defined"], each["verdict"]) for each in entry["former"]]
        assert {(each["defined"], each["verdict"]) for each in entry["other_definitions"]} <= set(former), entry["id"]
        assert all(each["replaced_because"] and each["words"] for each in entry["other_definitions"])
        assert all(verdict in report.former_text(entry) for _, verdict in former)
    first = {**dict.fromkeys(("C02", "C08", "C12", "C25", "C29", "C34", "C40", "C42", "C44"), REPRODUCED),
             **dict.fromkeys(("C33", "C39", "C45"), CONTRADICTED), **dict.fromkeys(("C19", "C22"), UNDECIDED),
             "C03": WITHIN_ROUNDING}
    assert {id: rows[id]["former"][0]["verdict"] for id in first} == first
    assert UNDECIDED in [each["verdict"] for each in rows["C41"]["former"]]


def test_a_definition_is_dated_before_its_first_value(record):
    """No definition in the record is later than its first value, and none of the rule's time is as late."""
    for entry in record:
        for definition in (entry, *entry["other_definitions"]):
            times = definition["defined"], definition["first_value"]
            assert times[0] < times[1] or times[0] == times[1] < report.RULE_SINCE, entry["id"]


DEFINED = {"id": "C01", "defined": "2030-01-02 10:00", "verdict": REPRODUCED, "former": [], "checks": [
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


def test_recorded_numbers_are_judged_again_by_other_meanings(monkeypatch):
    """Only the verdict, its meanings and thresholds change; the numbers stay."""
    evaluate.register_all()
    claim = replace(CLAIMS["C11"], unjudged="")
    recorded = {"id": "C11", "change": "", "rounding": "", "reason": "it leaks", "verdict": CONTRADICTED, "checks": [
        report._check(SEVEN, claims.MODEL)]}
    for names, verdict in ((("five",), CONTRADICTED), (("five", "ten"), DEGREE)):
        monkeypatch.setitem(MEANINGS, "C11", tuple(WORDS[name] for name in names))
        again = report.judged_again(recorded, claim)
        assert again["verdict"] == verdict and again["checks"] == recorded["checks"]
        assert [meaning["words"] for meaning in again["meanings"]] == [WORDS[name].words for name in names]


KNOWN = {**DEFINED, "first_value": "2030-01-02 10:01"}
NOW = "2030-01-02 10:03"


@pytest.mark.parametrize("entry, former", [
    (DEFINED, []), ({**DEFINED, "verdict": DEGREE}, [REPRODUCED]),
    ({**OTHER, "defined": "2030-01-02 10:02"}, [REPRODUCED])])
def test_a_verdict_that_changes_stays_among_the_former_ones(entry, former):
    """It also stays if the definition changes and not the verdict."""
    assert [each["verdict"] for each in report.stamped(entry, KNOWN, NOW)["former"]] == former


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
