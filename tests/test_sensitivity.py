"""The effect of the rounding of Table 1: inputs are those of the scenes, and elasticities of power laws are exact.
Error bars from values on several sizes."""
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from repro.scene import load_scene, scene_tables
from tests.strategies import number
from verification import sensitivity
from verification.sensitivity import __main__ as driver
from verification.sensitivity import rounding
from verification.sensitivity.rounding import EXACT, INPUTS, ROUNDED
from verification.uncertainty import OBSERVED, estimate


def value_of(scene, path):
    for key in path.split("."):
        scene = getattr(scene, key)
    return scene


def test_the_rounded_inputs_are_those_of_table_1():
    """The scenes have the units and values of Table 1, as test_scene.py tests."""
    for rounded in ROUNDED:
        written = scene_tables(load_scene("base"))
        for key in rounded.paths[0].split("."):
            written = written[key]
        assert rounded.value == number(str(written)), rounded.name
        digits = len(f"{rounded.value}".partition(".")[2])
        assert rounded.half == pytest.approx(0.5 * 10**-digits), rounded.name
    assert len(ROUNDED) == 10 and all(exact.half == 0 for exact in EXACT)


def test_the_stipulated_saturation_constants_are_in_no_set_and_no_width(record):
    """Section 2.2 sets both K_s to 1 mg/L. Their elasticities stay."""
    for name in ("K_sA", "K_sD"):
        assert rounding.BY_NAME[name] in EXACT
        assert all(name in known for known in record["elasticities"].values())
        for part in (record["rounding"], record["one_set"]["inputs"], record["sobol"]["inputs"]):
            assert name not in part


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
def test_a_set_is_reached_if_it_fits_with_its_bars(law, within, fits):
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


def test_no_inputs_give_the_printed_effluents():
    """The closed form: the least F exceeds the largest ratio that the printed effluents admit."""
    assert "1.515, times" in sensitivity.impossible() and "1.505 times" in sensitivity.impossible()
    assert 1.515 > (10 - 4.185) / (10 - 6.135)


def test_claims_that_depend_on_the_supply_hold_jointly_with_one(monkeypatch):
    supplies = {"5": {"A": True, "B": False, "C": True}, "10": dict.fromkeys("ABC", True),
                "20": {"A": False, "B": True, "C": True}}
    record = {"supplies": {supply: {"claims": {id: {"number": holds} for id, holds in claims.items()}}
                           for supply, claims in supplies.items()}}
    monkeypatch.setattr(sensitivity, "record", lambda: record)
    assert sensitivity.jointly() == ["10"] and not sensitivity.on_supplies("C").splits
    text = sensitivity.on_supplies("A").text
    assert text == "the supply of Figure 6 (K_s): holds with 5, 10; does not with 20"


# ---------------------------------------------------------------- error bars from values on several sizes


SIZES = np.array([1.0, 2**0.5, 2**-0.5, 0.5])


def test_the_example_of_celik_et_al():
    """J. Fluids Eng. 130 (2008) 078001, Table 1: 18000, 8000 and 4500 cells, p = 1.53, GCI = 2.2 %."""
    result = estimate([1.0, 1.5, 2.0], [6.063, 5.972, 5.863], (2.0, 2.0))
    assert result.order == pytest.approx(1.53, abs=0.005)
    assert 100 * result.bar / 6.063 == pytest.approx(2.2, abs=0.05)


# The bar of a number on several sizes: the law's error, the scatter about the law, and the number's distance from it.
def parts(sizes, values, order):
    """The three terms of a bar with an order, by NumPy's least squares."""
    law = np.column_stack([np.ones(len(sizes)), sizes**order])
    coefficients = np.linalg.lstsq(law, values, rcond=None)[0]
    residual = values - law @ coefficients
    scatter = (residual @ residual / max(len(sizes) - 3, 1)) ** 0.5
    return OBSERVED * abs(coefficients[1]) * sizes[0] ** order, scatter, abs(residual[0])


@given(st.lists(st.floats(-0.15, 0.15), min_size=4, max_size=4), st.floats(0.6, 2.0), st.sampled_from([1.0, -1.0]))
def test_a_bar_is_the_sum_of_its_three_terms(noise, order, sign):
    """This holds for a law with any noise, if the observed order is accepted."""
    values = 7.0 + sign * (SIZES**order + noise)
    result = estimate(SIZES, values, (1.0, 2.0))
    if result.factor == OBSERVED:
        assert result.bar == pytest.approx(sum(parts(SIZES, values, min(result.order, 1.0))), rel=1e-6)
