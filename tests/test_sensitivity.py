"""The effect of the rounding of Table 1: inputs are those of the scenes, and elasticities of power laws are exact."""
import pytest

from repro.scene import load_scene
from verification import sensitivity
from verification.sensitivity import __main__ as driver
from verification.sensitivity import rounding
from verification.sensitivity.rounding import EXACT, INPUTS, ROUNDED

PAPER = {"k": 9.3 / 24, "Y": 0.61, "b": 0.12 / 24, "f_d": 0.8, "d_c": 1.42, "F": 1.52, "K_sA": 1.0, "K_sD": 1.0,
         "D_a": 2.32e8 / 24, "D_fa": 1.85e8 / 24, "D_d": 1.01e8 / 24, "D_fd": 0.81e8 / 24}


def value_of(scene, path):
    for key in path.split("."):
        scene = getattr(scene, key)
    return scene


def test_the_rounded_inputs_are_those_of_table_1_and_of_the_scenes():
    """Values are in the package's units."""
    scene = load_scene("base")
    assert {rounded.name for rounded in ROUNDED} == set(PAPER)
    for rounded in ROUNDED:
        assert value_of(scene, rounded.paths[0]) == pytest.approx(PAPER[rounded.name], rel=1e-12), rounded.name
        digits = len(f"{rounded.value}".partition(".")[2])
        assert rounded.half == pytest.approx(0.5 * 10**-digits), rounded.name
    assert all(rounded.half == 0 for rounded in EXACT)


class Law:
    """Numbers that follow from inputs and element size by a law; they replace runs."""

    def __init__(self, law):
        self.law = law

    def get(self, scene):
        packaged, converged = load_scene(scene.name), load_scene("base", rounding.converged(1.0))
        factors = {each.name: value_of(scene, each.paths[0]) / value_of(packaged, each.paths[0])
                   for each in INPUTS if each.only in ("", scene.name)}
        return self.law(factors, converged.numerics.refinement / scene.numerics.refinement)

    def get_all(self, scenes):
        return [*map(self.get, scenes)]


def test_elasticities_of_a_power_law():
    """The elasticity of x^3 at 1 % is 3 within its bar."""
    elasticities = rounding.elasticities(Law(lambda x, size: {"n": 7 * x["k"] ** 3 * x["X_m"] ** -0.5}), "base")["n"]
    assert elasticities["k"]["elasticity"] == pytest.approx(3, abs=1e-3) and elasticities["k"]["resolved"]
    assert abs(elasticities["k"]["elasticity"] - 3) <= elasticities["k"]["bar"]
    assert elasticities["X_m"]["by_10_percent"] == pytest.approx([100 * (1.1**-0.5 - 1), 100 * (0.9**-0.5 - 1)])
    assert elasticities["Y"]["elasticity"] == 0 and "head" in elasticities and "u_ave" not in elasticities


def test_the_interval_of_a_value_is_the_sum_of_all_roundings(monkeypatch):
    """A closed form takes the extremes at the corners instead."""
    low, high = sensitivity.in_closed_form(lambda a, b, c: a - b * c, (2.38, 0.005), (0.61, 0.005), (1.42, 0.005))
    assert (low, high) == pytest.approx((2.375 - 0.615 * 1.425, 2.385 - 0.605 * 1.415))
    content = {"rounding": {"k": 0.01, "Y": 0.02}, "elasticities": {"n": {
        "k": {"elasticity": -3.0}, "Y": {"elasticity": 2.0}, "X_m": {"elasticity": 99.0}}}}
    monkeypatch.setattr(sensitivity, "record", lambda: content)
    assert sensitivity.interval("n", 10.0) == pytest.approx((9.3, 10.7))
    assert sensitivity.interval("other", 10.0) is None and sensitivity.verified_set() == ""


# A set of inputs is reached if it is within the rounding, and the complete bar of each number is in its interval.
def numbers(effluent):
    """The numbers of section 4 in the middle of their intervals, except the effluent."""
    middles = dict(zip(rounding.PRINTED, map(float, rounding.MIDDLE)))
    return middles | {"effluent_acceptor": effluent}


def curved(x, size):
    """The linear program needs more than the rounding of k, but a run at the end of the rounding fits."""
    change = 1 - x["k"]
    return numbers(4.19 * (0.95 + 4 * change + 1e3 * change**2))


def scattering(x, size):
    """The effluent fits within the rounding, but its values on several sizes scatter for that set."""
    change = 1 - x["k"]
    return numbers(4.19 * (0.99 + 8 * change) + (0.02 * size if abs(change) > 1e-4 else 0.0))


def straight(x, size):
    """The effluent fits within the rounding, without a bar."""
    return numbers(4.19 * (0.99 + 8 * (1 - x["k"])))


@pytest.mark.parametrize("law, within, fits", [
    (straight, True, True), (curved, False, True), (scattering, True, False)])
def test_a_set_is_reached_if_it_is_within_the_rounding_and_fits_with_its_bars(law, within, fits):
    """Neither condition alone suffices."""
    slope = -4.0 if law is curved else -8.0
    elasticities = {number: {each.name: {"elasticity": 0.0} for each in INPUTS} for number in rounding.PRINTED}
    elasticities["effluent_acceptor"]["k"] = {"elasticity": slope}
    result = rounding.one_set(Law(law), elasticities)
    assert (result["share_of_the_rounding"] <= 1, result["misfit_in_half_intervals"] <= 1) == (within, fits)
    assert result["reached"] is (within and fits)


# The committed record.
@pytest.fixture(scope="module")
def record():
    return sensitivity.record()


def test_page_and_diagrams_are_those_of_the_record(record, tmp_path):
    assert sensitivity.RECORD.with_suffix(".md").read_text(encoding="utf-8") == driver.page(record)
    pictures = tmp_path / "one.svg", tmp_path / "outlines.svg"
    driver.write(record, *pictures)
    assert [file.read_bytes() for file in pictures] == [driver.TARGET.read_bytes(), driver.OUTLINES.read_bytes()]
