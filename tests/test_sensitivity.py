"""What the rounding of Table 1 allows: inputs are those of the scenes, differences right on power laws, runs kept."""
import pytest

from paper_figures import replication
from repro.scene import load_scene
from verification import claims, sensitivity, store
from verification.claims import evaluate, report
from verification.sensitivity import __main__ as driver
from verification.sensitivity import rounding, wide
from verification.sensitivity.rounding import BY_NAME, EXACT, OF, ROUNDED, Runs, changed, scene

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
    """The supply is printed as 10 K_s."""
    said = load_scene("base")
    other = changed(said, {each.name: 2.0})
    assert all(value_of(other, path) == 2 * value_of(said, path) for path in each.paths)
    assert changed(other, {each.name: 0.5}) == said
    assert any(path.endswith("supply") for path in each.paths) == each.name.startswith(("K_s", "supply"))


class Law:
    """Numbers of a law of the inputs in the place of runs."""

    def __init__(self, law):
        self.law = law

    def get(self, said):
        plain = load_scene(said.name)
        return self.law({each.name: value_of(said, each.paths[0]) / value_of(plain, each.paths[0])
                         for each in ROUNDED + EXACT if each.only in ("", said.name)})

    def get_all(self, scenes):
        return [*map(self.get, scenes)]


def test_elasticities_of_a_power_law():
    """x^3 at 1 %: 3 and a bar that holds the rest."""
    found = rounding.elasticities(Law(lambda x: {"n": 7 * x["k"] ** 3 * x["X_m"] ** -0.5}), "base")["n"]
    assert found["k"]["elasticity"] == pytest.approx(3, abs=1e-3) and found["k"]["resolved"]
    assert abs(found["k"]["elasticity"] - 3) <= found["k"]["bar"]
    assert found["X_m"]["by_10_percent"] == pytest.approx([100 * (1.1**-0.5 - 1), 100 * (0.9**-0.5 - 1)])
    assert found["Y"]["elasticity"] == 0 and "head" in found and "u_ave" not in found


def test_what_differs_by_noise_is_not_resolved():
    noise = {0.99: 1e-3, 1.01: -1e-3, 0.98: -1e-3, 1.02: 1e-3}
    found = rounding.elasticities(Law(lambda x: {"n": 1 + noise.get(round(x["k"], 3), 0.0)}), "base")["n"]["k"]
    assert not found["resolved"] and found["bar"] > abs(found["elasticity"])


@pytest.mark.parametrize("shift, reached", [(-0.02, True), (-0.06, False), (-0.2, False)])
def test_one_set_is_found_where_there_is_one_and_the_least_misfit_where_there_is_none(shift, reached):
    """2 % of the effluent are 0.25 % of k, within its 0.54 %; 6 % and 20 % are not."""
    law = Law(lambda x: {"velocity_0": 2.9, "velocity": 1.5 / x["k"], "consumed": 60 - 5 * (x["F"] - 1),
                         "effluent_acceptor": 4.19 * (1 + shift) * x["k"] ** -8,
                         "effluent_donor": 6.13 * x["K_sD"] ** 0.5})
    found = rounding.one_set(law, rounding.elasticities(law, "base"))
    factors = {name: value / BY_NAME[name].value for name, value in found["inputs"].items()}
    assert found["reached"] is reached
    assert all(abs(factor - 1) <= BY_NAME[name].rounding * (1 + 1e-9) for name, factor in factors.items())
    if reached:
        assert rounding.misfit(found["numbers"]) <= 0.5
        assert found["share_of_the_rounding"] == pytest.approx(0.46, abs=0.06)
    else:
        assert factors["k"] == pytest.approx(1 - BY_NAME["k"].rounding, rel=1e-6)
        assert found["misfit_in_half_intervals"] > 10 and found["share_of_the_rounding"] > 1


def test_the_interval_of_a_value_is_the_sum_of_all_roundings(monkeypatch):
    """Or that of the corners, where a closed form tells it."""
    low, high = sensitivity.in_closed_form(lambda a, b, c: a - b * c, (2.38, 0.005), (0.61, 0.005), (1.42, 0.005))
    assert (low, high) == pytest.approx((2.375 - 0.615 * 1.425, 2.385 - 0.605 * 1.415))
    content = {"rounding": {"k": 0.01, "Y": 0.02}, "elasticities": {"n": {
        "k": {"elasticity": -3.0}, "Y": {"elasticity": 2.0}, "X_m": {"elasticity": 99.0}}}}
    monkeypatch.setattr(sensitivity, "record", lambda: content)
    assert sensitivity.interval("n", 10.0) == pytest.approx((9.3, 10.7))
    assert sensitivity.interval("other", 10.0) is None and sensitivity.verified_set() == ""


MADE = []


def counted(said):
    MADE.append(said)
    return {"n": len(MADE)}


def test_a_run_is_computed_once_kept_at_once_and_computed_anew_by_another_source(tmp_path, monkeypatch):
    """A second call, or one after a break that cuts a line, goes on from the file."""
    kept = tmp_path / "out" / "runs.jsonl"
    monkeypatch.setitem(OF, "base", counted)
    plain, other = scene("base", {}), scene("base", {"k": 1.01})
    for said, number in ((plain, 1), (plain, 1), (other, 2), (other, 2)):
        assert Runs(kept).get(said) == {"n": number}
    kept.write_text(kept.read_text()[:-1])
    assert Runs(kept).get(plain) == {"n": 1} and Runs(kept).get(other) == {"n": 3}
    assert len(Runs(kept).known) == 2
    monkeypatch.setattr(store, "source_hash", lambda: "another!")
    assert Runs(kept).known == {} and Runs(kept).get(plain) == {"n": 4}


def its_input(said):
    return {"k": said.kinetics.maximum_utilization_rate}


def test_runs_on_all_cores_are_kept_under_their_own_scenes(tmp_path, monkeypatch):
    monkeypatch.setitem(OF, "base", its_input)
    scenes = [scene("base", {"k": factor}) for factor in (0.9, 1.0, 1.1)]
    assert Runs(tmp_path / "runs.jsonl").get_all(scenes) == [*map(its_input, scenes)]
    monkeypatch.delitem(OF, "base")
    for said in scenes:
        assert Runs(tmp_path / "runs.jsonl").get(said) == its_input(said)


def test_sobol_indices_of_a_linear_law():
    """Shares of the variance, e r squared over their sum; an input that hardly moves a number has none."""
    law = Law(lambda x: dict.fromkeys(rounding.PRINTED, 3 * x["k"] + 3 * x["Y"] + 0.02 * x["K_sD"]))
    found = rounding.sobol(law, rounding.elasticities(law, "base"), 64)
    assert found["inputs"] == ["k", "Y"]
    share = 1 / (1 + (BY_NAME["Y"].rounding / BY_NAME["k"].rounding) ** 2)
    for order in ("first_order", "total_order"):
        values = [value for value, *_ in found["numbers"]["velocity"][order]]
        assert values == pytest.approx([share, 1 - share], abs=0.05)


def test_claims_with_other_supplies_are_told_apart():
    """Those that hold with all, with some and with none, whatever base does."""
    def holding(*values):
        rows = [claims.at_most(f"wide, q{k}", "", value, 1.0, "") for k, value in enumerate(values)]
        return wide.holding(claims.Finding((claims.at_most("base, 19.2 h", "", 9.0, 1.0, ""), *rows)))

    found = {"5": {"claims": {"C12": holding(0.0), "C16": holding(2.0, 0.0), "C25": holding(2.0)}},
             "10": {"claims": {"C12": holding(0.5), "C16": holding(0.0, 0.0), "C25": holding(3.0)}}}
    assert wide.verdicts(found) == (["C12"], ["C16"], ["C25"])


# The committed record.
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


def test_page_and_diagrams_are_those_of_the_record(kept, tmp_path):
    assert sensitivity.RECORD.with_suffix(".md").read_text(encoding="utf-8") == driver.page(kept)
    made = tmp_path / "one.svg", tmp_path / "outlines.svg"
    driver.write(kept, *made)
    assert [file.read_bytes() for file in made] == [driver.TARGET.read_bytes(), driver.OUTLINES.read_bytes()]


def test_claims_about_wide_are_judged_with_other_supplies_or_named_as_left_out(kept):
    """And those that read it without being about it."""
    told = {each["id"] for each in report.read() for check in each["checks"] if "wide" in check["quantity"]}
    evaluate.register_all()
    judged = set(kept["supplies"]["10"]["claims"])
    assert judged.isdisjoint(wide.LEFT_OUT)
    assert told | {id for id, one in claims.CLAIMS.items() if one.of_wide} <= {*judged, *wide.LEFT_OUT}
    note = " ".join(replication.NOTE.read_text(encoding="utf-8").split())
    assert all(f"{id}, which {why}" in note for id, why in wide.LEFT_OUT.items())
