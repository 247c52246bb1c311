"""What the rounding of Table 1 allows: inputs are those of the scenes, differences right on power laws, runs kept."""
import json
from types import SimpleNamespace
from xml.etree import ElementTree

import numpy as np
import pytest

from paper_figures import replication
from repro.march.loop import PoreEnd
from repro.scene import load_scene
from verification import claims, sensitivity
from verification.claims import evaluate, report, runs
from verification.claims.levels import at_level
from verification.sensitivity import __main__ as driver
from verification.sensitivity import rounding, wide
from verification.sensitivity.rounding import BY_NAME, EXACT, OF, ROUNDED, Runs, changed, factors_of, scene

PAPER = {"k": 9.3 / 24, "Y": 0.61, "b": 0.12 / 24, "f_d": 0.8, "d_c": 1.42, "F": 1.52, "K_sA": 1.0, "K_sD": 1.0,
         "D_a": 2.32e8 / 24, "D_fa": 1.85e8 / 24, "D_d": 1.01e8 / 24, "D_fd": 0.81e8 / 24}


def value_of(said, path):
    for key in path.split("."):
        said = getattr(said, key)
    return said


def test_the_rounded_inputs_are_those_of_table_1_and_of_the_scenes():
    """In the package's units."""
    said = load_scene("base")
    assert {each.name for each in ROUNDED} == set(PAPER)
    for each in ROUNDED:
        assert value_of(said, each.paths[0]) == pytest.approx(PAPER[each.name], rel=1e-12), each.name
        digits = len(f"{each.value}".partition(".")[2])
        assert each.half == pytest.approx(0.5 * 10**-digits), each.name
    assert all(each.half == 0 for each in EXACT)


@pytest.mark.parametrize("each", ROUNDED + tuple(each for each in EXACT if each.only != "wide"),
                         ids=lambda each: each.name)
def test_a_factor_moves_its_input_and_nothing_else(each):
    said = load_scene("base")
    other = changed(said, {each.name: 2.0})
    assert all(value_of(other, path) == 2 * value_of(said, path) for path in each.paths)
    assert changed(other, {each.name: 0.5}) == said
    if each.name.startswith("K_s"):
        assert len(each.paths) == 2 and each.paths[1].endswith("supply")


class Law:
    """Numbers of a law of the inputs in the place of runs."""

    def __init__(self, law):
        self.law = law

    def numbers(self, said):
        plain = load_scene(said.name)
        return self.law({each.name: value_of(said, each.paths[0]) / value_of(plain, each.paths[0])
                         for each in ROUNDED + EXACT if each.only in ("", said.name)})


def test_elasticities_of_a_power_law():
    """x^3 at 1 %: 3 and a bar that holds the rest."""
    found = rounding.elasticities(Law(lambda x: {"n": 7 * x["k"] ** 3 * x["X_m"] ** -0.5}), "base")["n"]
    assert found["k"]["elasticity"] == pytest.approx(3, abs=1e-3) and found["k"]["resolved"]
    assert abs(found["k"]["elasticity"] - 3) <= found["k"]["bar"]
    assert found["X_m"]["by_10_percent"] == pytest.approx([100 * (1.1**-0.5 - 1), 100 * (0.9**-0.5 - 1)])
    assert found["Y"]["elasticity"] == 0 and "head" in found and "u_ave" not in found


@pytest.mark.parametrize("sign", [1, -1])
def test_what_differs_by_noise_is_not_resolved(sign):
    noise = {0.99: 1e-3, 1.01: -1e-3, 0.98: -1e-3, 1.02: 1e-3}
    found = rounding.elasticities(Law(lambda x: {"n": 1 + sign * noise.get(round(x["k"], 3), 0.0)}), "base")["n"]["k"]
    assert not found["resolved"] and found["bar"] > abs(found["elasticity"])


def law_of_base(shift):
    """Numbers near those printed, moved by an acceptor effluent that k lowers and one that D_a hardly does."""
    def law(x):
        return {"velocity_0": 2.9, "velocity": 1.5 / x["k"], "consumed": 60 - 5 * (x["F"] - 1),
                "effluent_acceptor": 4.19 * (1 + shift) * x["k"] ** -8, "effluent_donor": 6.13 * x["K_sD"] ** 0.5}
    return law


@pytest.mark.parametrize("shift, reached", [(-0.02, True), (-0.06, False), (-0.2, False)])
def test_one_set_is_found_where_there_is_one_and_the_least_misfit_where_there_is_none(shift, reached):
    """2 % of the effluent are 0.25 % of k, within its 0.54 %; 6 % and 20 % are not."""
    law = Law(law_of_base(shift))
    found = rounding.one_set(law, rounding.elasticities(law, "base"))
    factors = factors_of(found["inputs"])
    assert found["reached"] is reached
    assert all(abs(factor - 1) <= BY_NAME[name].rounding * (1 + 1e-9) for name, factor in factors.items())
    if reached:
        assert rounding.misfit(found["numbers"]) <= 0.5
        assert found["share_of_the_rounding"] == pytest.approx(0.46, abs=0.06)
    else:
        assert factors["k"] == pytest.approx(1 - BY_NAME["k"].rounding, rel=1e-6)
        assert found["misfit_in_half_intervals"] > 10 and found["share_of_the_rounding"] > 1


class Coarse(Law):
    """The same with an error of second order, whose part of a number at the preset's size is ``error``."""

    def __init__(self, law, error):
        super().__init__(law)
        self.error = error

    def numbers(self, said):
        size = scene("base", {}).numerics.refinement / said.numerics.refinement
        return {name: value * (1 + self.error * size**2) for name, value in super().numbers(said).items()}


@pytest.mark.parametrize("error, reached", [(-0.001, True), (-0.01, False)])
def test_one_set_counts_where_the_whole_of_each_bar_lies_in_its_interval(error, reached):
    """0.1 % of the donor effluent at size 1, 0.006, are more than the half width of its digits, 0.005, and less than
    0.001 at the finest size, where a set is made; ten times that leave no room for a bar, and no set."""
    law = Coarse(law_of_base(-0.02), error)
    found = rounding.one_set(law, rounding.elasticities(law, "base"))
    true = Law(law.law).numbers(scene("base", factors_of(found["inputs"])))
    bars = found["bars"]
    assert found["reached"] is reached and (found["misfit_in_half_intervals"] <= 1) == reached
    assert all(bars[name] >= abs(value - true[name]) > 0 for name, value in found["numbers"].items())
    assert all(found["on_sizes"][name][0] == value for name, value in found["numbers"].items())
    if reached:
        for name, printed in rounding.PRINTED.items():
            low, high = claims.interval(printed)
            assert low <= found["numbers"][name] - bars[name] and found["numbers"][name] + bars[name] <= high, name


def test_a_closed_form_goes_where_its_inputs_are_rounded():
    assert sensitivity.in_closed_form(lambda b: 1 / b, (0.12, 0.005)) == pytest.approx((8, 1 / 0.115))
    low, high = sensitivity.in_closed_form(lambda a, b, c: a - b * c, (2.38, 0.005), (0.61, 0.005), (1.42, 0.005))
    assert (low, high) == pytest.approx((2.375 - 0.615 * 1.425, 2.385 - 0.605 * 1.415))


def test_the_interval_of_a_value_is_the_sum_of_all_roundings(monkeypatch):
    content = {"rounding": {"k": 0.01, "Y": 0.02}, "elasticities": {"n": {
        "k": {"elasticity": -3.0}, "Y": {"elasticity": 2.0}, "X_m": {"elasticity": 99.0}}}}
    monkeypatch.setattr(sensitivity, "record", lambda: content)
    assert sensitivity.interval("n", 10.0) == pytest.approx((9.3, 10.7))
    assert sensitivity.interval("other", 10.0) is None and sensitivity.verified_set() == ""


def test_a_run_is_computed_once_and_kept_at_once(tmp_path, monkeypatch):
    """A second call, or one after a break, goes on from the file."""
    made = []
    monkeypatch.setitem(OF, "base", lambda said: made.append(said) or {"n": len(made)})
    plain, other = scene("base", {}), scene("base", {"k": 1.01})
    for said, number in ((plain, 1), (plain, 1), (other, 2), (other, 2)):
        assert Runs(tmp_path / "out" / "runs.json").numbers(said) == {"n": number}
    assert made == [plain, other]


def test_a_run_of_another_source_is_computed_anew(tmp_path, monkeypatch):
    """And forgotten; the rooms that tell of a run are not part of it."""
    monkeypatch.setitem(OF, "base", lambda said: {"n": 1})
    kept = tmp_path / "out" / "runs.json"
    Runs(kept).numbers(scene("base", {}))
    monkeypatch.setattr(rounding, "source", lambda: "another!")
    assert Runs(kept).known == {}
    Runs(kept).numbers(scene("base", {}))
    assert [key[-8:] for key in json.loads(kept.read_text())] == ["another!"]
    assert {"fem", "model", "march"} <= set(rounding.ROOMS) and "report" not in rounding.ROOMS


def test_sobol_indices_of_a_linear_law():
    """Shares of the variance, e r squared over their sum."""
    slopes = {"velocity": {"k": 3.0, "Y": 3.0, "K_sD": 0.02}, "effluent_acceptor": {"k": 8.0, "Y": 1.0, "K_sD": 0.3}}

    def linear(x, of):
        return 1 + sum(e * (x[key] - 1) for key, e in of.items())

    law = Law(lambda x: {name: linear(x, slopes.get(name, {})) for name in rounding.PRINTED})
    found = rounding.sobol(law, rounding.elasticities(law, "base"), 64)
    assert set(found["inputs"]) == {"k", "Y", "K_sD"} and set(found["numbers"]) == set(slopes)
    total = dict(zip(found["inputs"], [value for value, *_ in found["numbers"]["velocity"]["total_order"]]))
    k, y = ((3 * BY_NAME[name].rounding) ** 2 for name in ("k", "Y"))
    assert (total["k"], total["Y"]) == pytest.approx((k / (k + y), y / (k + y)), abs=0.05)


@pytest.mark.parametrize("samples", ["-2", "3", "100"])
def test_a_number_of_samples_is_a_power_of_two(samples, capsys):
    assert driver.main(["--sobol", samples]) == 2 and "a power of two" in capsys.readouterr().err


def test_claims_with_other_supplies_are_told_apart():
    def holding(supply, values):
        rows = [claims.at_most(f"wide, {supply} h: {k}", "", value, 1.0, "") for k, value in enumerate(values)]
        return wide.holding(claims.Finding((claims.at_most("base, 19.2 h", "", 9.0, 1.0, ""), *rows)))

    found = {}
    for supply, by_id in (("5", {"C12": [0.0], "C16": [2.0, 0.0], "C25": [2.0]}),
                          ("10", {"C12": [0.5], "C16": [0.0, 0.0], "C25": [3.0]})):
        found[supply] = {"claims": {id: holding(supply, values) for id, values in by_id.items()}}
    assert wide.verdicts(found) == (["C12"], ["C16"], ["C25"])
    assert wide.moving(found) == [("C16", "wide, # h: #")]


def test_a_level_changes_wide_alone():
    with at_level(wide.supplied(5.0, 59.0)):
        base, of_wide = runs.scene("base"), runs.scene("wide")
    assert base.substrates.acceptor.supply == 10.0 and of_wide.substrates.donor.supply == 5.0
    assert of_wide.growth.end == 59.0 and of_wide.output.times[-1] == 59.0 and base.growth.end == pytest.approx(19.4)


def test_a_number_after_contact_is_kept_where_its_bar_is_what_is_asked():
    """Of second order, 0.125 % off on the finest size."""
    values = [2.0 * (1 + 0.005 * size**2) for size in wide.SIZES]
    told = wide.bar_of("mean of x", values, 1.0)
    assert 0.125 < told["bar_percent"] < 1.0 and told["kept"] and told["values"] == values
    assert not wide.bar_of("mean of x", values, 0.1)["kept"]


def in_contact(time):
    outline = SimpleNamespace(upstream=-2.0 * time, downstream=time)
    pore = SimpleNamespace(time=time, contact=time > 34.0, boundary=outline,
                           concentrations=SimpleNamespace(acceptor=np.array([3.0, time])))
    return SimpleNamespace(pore=pore)


def test_numbers_after_contact_are_geometric_means_the_hour_asked_for_and_the_last(monkeypatch):
    """Of rows in contact alone, of which none may be missing."""
    monkeypatch.setattr(wide, "_row", lambda now: [2.0**now.pore.time, -now.pore.time, 1.0, now.pore.time**2])
    rows = [(None, in_contact(time)) for time in (0.0, 33.0, *wide.HOURS)]
    monkeypatch.setattr(wide.simulation, "steps", lambda said: iter([*rows, (None, None)]))
    found = wide.of_after(None)
    speed, tip, _, length = wide.ASKED
    assert found[f"mean of {speed}"] == pytest.approx(2.0**40) and found[f"39 h: {tip}"] == 39.0
    assert found[f"mean of {tip}"] == pytest.approx(np.prod(np.array(wide.HOURS) / 40) ** (1 / 11) * 40)
    assert found[f"last {length}"] == 45.0**2 and len(found) == 12
    del rows[5]
    with pytest.raises(LookupError, match="10 of 11"):
        wide.of_after(None)


@pytest.mark.parametrize("ends, hour", [(np.inf, 45.0), (40.05, 39.0), (40.15, 40.0)])
def test_wide_goes_on_for_eleven_hours_after_the_hour_of_contact_or_to_the_pores_end(monkeypatch, ends, hour):
    """Less the margin, in whole hours."""
    def steps(said, state=None):
        yield from ((in_contact(time), None) for time in (33.9, 34.7, min(ends, said.growth.end)))
        if ends < said.growth.end:
            raise PoreEnd("")

    monkeypatch.setattr(wide.simulation, "steps", steps)
    found = wide.of_contact(scene("wide", {"K_sA": 2.0}))
    assert found == {"contact_time": 34.7, "upstream": -69.4, "downstream": 34.7, "acceptor_min": 1.5, "end": hour}


@pytest.fixture(scope="module")
def kept():
    return sensitivity.record()


def test_the_committed_record_is_whole(kept):
    """Every rounded input for every number, each with its bar."""
    for number, known in kept["elasticities"].items():
        assert set(known) >= {each.name for each in ROUNDED}, number
        assert all(one["bar"] >= 0 and isinstance(one["resolved"], bool) for one in known.values()), number
    assert set(rounding.PRINTED) <= set(kept["elasticities"])
    assert kept["rounding"] == {each.name: each.rounding for each in ROUNDED}


def test_page_and_diagram_are_those_of_the_record(kept, tmp_path):
    assert sensitivity.RECORD.with_suffix(".md").read_text(encoding="utf-8") == driver.page(kept)
    made = tmp_path / "one.svg", tmp_path / "outlines.svg"
    driver.write(kept, *made)
    for file, there in zip(made, (driver.TARGET, driver.OUTLINES)):
        assert file.read_bytes() == there.read_bytes()
        ElementTree.parse(file)
    largest = [abs(value) for _, value, _ in driver.reaches(kept, "effluent_acceptor")]
    assert largest == sorted(largest, reverse=True)


def test_the_diagram_tells_what_is_not_resolved_and_what_nothing_moves(tmp_path):
    """Hatched by a pattern; a panel without bars says so, and draws none for inputs that move nothing."""
    def content(k, resolved):
        moved = {"elasticity": k, "bar": 0.0, "resolved": resolved}
        still = {"elasticity": 0.0, "bar": 0.0, "resolved": True}
        return {"elasticities": {"velocity": {each.name: moved if each.name == "k" else still for each in ROUNDED}}}
    pictures = []
    for k, resolved in ((3.0, True), (3.0, False), (0.0, True)):
        driver.tornado(content(k, resolved), tmp_path / "one.svg")
        pictures.append((tmp_path / "one.svg").read_text(encoding="utf-8"))
    assert ["<pattern" in one for one in pictures] == [False, True, False]
    assert [driver.UNMOVED in one for one in pictures] == [False, False, True]
    assert [">k</text>" in one and ">Y</text>" not in one for one in pictures] == [True, True, False]
    assert all("hatched: not resolved" in one for one in pictures)


def test_claims_about_wide_are_judged_with_other_supplies_or_named_as_left_out(kept):
    """And those that read it without being about it."""
    told = {each["id"] for each in report.read() for check in each["checks"] if "wide" in check["quantity"]}
    evaluate.register_all()
    judged = set(kept["supplies"]["10"]["claims"])
    assert judged.isdisjoint(wide.LEFT_OUT)
    assert told | {id for id, one in claims.CLAIMS.items() if one.of_wide} <= {*judged, *wide.LEFT_OUT}
    note = " ".join(replication.NOTE.read_text(encoding="utf-8").split())
    assert all(f"{id}, which {why}" in note for id, why in wide.LEFT_OUT.items())
