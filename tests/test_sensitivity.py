"""What the rounding of Table 1 allows: inputs are those of the scenes, differences right on power laws, runs kept."""
import pytest

from paper_figures import replication
from repro.scene import load_scene
from verification import claims, sensitivity
from verification.claims import evaluate, report
from verification.sensitivity import __main__ as driver
from verification.sensitivity import rounding, wide
from verification.sensitivity.rounding import EXACT, ROUNDED, changed

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


def test_the_interval_of_a_value_is_the_sum_of_all_roundings(monkeypatch):
    """Or that of the corners, where a closed form tells it."""
    low, high = sensitivity.in_closed_form(lambda a, b, c: a - b * c, (2.38, 0.005), (0.61, 0.005), (1.42, 0.005))
    assert (low, high) == pytest.approx((2.375 - 0.615 * 1.425, 2.385 - 0.605 * 1.415))
    content = {"rounding": {"k": 0.01, "Y": 0.02}, "elasticities": {"n": {
        "k": {"elasticity": -3.0}, "Y": {"elasticity": 2.0}, "X_m": {"elasticity": 99.0}}}}
    monkeypatch.setattr(sensitivity, "record", lambda: content)
    assert sensitivity.interval("n", 10.0) == pytest.approx((9.3, 10.7))
    assert sensitivity.interval("other", 10.0) is None and sensitivity.verified_set() == ""


# The committed record.
@pytest.fixture(scope="module")
def kept():
    return sensitivity.record()


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
