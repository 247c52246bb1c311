"""Scenes: Table 1 in internal units, packaged scenes, sections and --set. Units: exact fractions agree with pint.
Values that other keys imply: F from the oxygen demand, D in the aggregate from that in water."""
import json
import math
import re
from fractions import Fraction
from operator import attrgetter
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from repro.march.simulation import simulate
from repro.runs.machine import differences
from repro.scene import SceneError, exact, load_scene, parse_scene, scene_hash, scene_tables, units
from repro.scene.text import scene_text
from tests.test_scene_text import parsed
from verification.problems.schemes import exchange
from verification.problems.schemes import load_scene as load_exchanged


def refusal(source, *overrides, unset=()) -> str:
    """The message of the SceneError, which is one line of limited length."""
    with pytest.raises(SceneError) as caught:
        load_scene(source, overrides, unset=unset)
    message = str(caught.value)
    assert message.isprintable() and len(message) < 500 and "Traceback" not in message
    return message


def write_scene(tmp_path, text, encoding="utf-8") -> Path:
    path = tmp_path / "mine.toml"
    path.write_bytes(text.encode(encoding))
    return path


# ---------------------------------------------------------------- Table 1

TABLE_1 = {  # worked out by hand: 1 m = 1e6 um, 1 cm2 = 1e8 um2, 1 day = 24 h, 1 cm2/s = 3.6e11 um2/h
    "pore.length": 600.0,
    "pore.width": 100.0,
    "aggregate.radius": 5.0,
    "flow.viscosity_ratio": 2000.0,
    "flow.kinematic_viscosity": 3.6108e9,
    "flow.gravity": 1.271376e14,
    "flow.density": 998000.0,
    "substrates.acceptor.supply": 10.0,
    "substrates.donor.supply": 10.0,
    "substrates.acceptor.half_saturation": 1.0,
    "substrates.donor.half_saturation": 1.0,
    "substrates.acceptor.diffusivity": 2.32e8 / 24,
    "substrates.acceptor.diffusivity_in_aggregate": 1.85e8 / 24,
    "substrates.donor.diffusivity": 1.01e8 / 24,
    "substrates.donor.diffusivity_in_aggregate": 0.81e8 / 24,
    "kinetics.maximum_utilization_rate": 0.3875,
    "kinetics.yield_coefficient": 0.61,
    "kinetics.decay_coefficient": 0.005,
    "kinetics.degradable_fraction": 0.8,
    "kinetics.decay_oxygen_demand": 1.42,
    "kinetics.acceptor_to_donor_ratio": 1.52,
    "kinetics.maximum_density": 30000.0,
    "growth.time_step": 0.2,
    "growth.shear_modulus": 0.01,
    "growth.minimum_contact_angle": 16.7 * math.pi / 180,
    "growth.minimum_film": 2.0,
    "numerics.tolerance": 0.0075,
    "numerics.refinement": 0.2,
    "numerics.gradation": 0.25,
    "numerics.contact_elements": 3.0,
}
#: Every section with its required keys alone.
EVERYTHING = {"aggregate": {}, "flow": {"head": "1e-3 cm"}, "substrates": {}, "growth": {"end": "1 h"}}


@pytest.mark.exact_lengths
def test_defaults_are_table_1():
    scene = parse_scene(EVERYTHING, "everything", "mine.toml")
    for key, value in TABLE_1.items():
        assert attrgetter(key)(scene) == pytest.approx(value, rel=1e-15), key


def test_kinetics_need_substrates_and_an_aggregate():
    assert load_scene("flow_only", ["substrates={}"]).kinetics.yield_coefficient == 0.61
    assert parse_scene({"substrates": {}}, "clean", "mine.toml").kinetics is None
    assert "[substrates]" in refusal("flow_only", "kinetics.yield_coefficient=0.5")


@pytest.mark.exact_lengths
def test_the_name_of_a_scene_is_the_stem_of_its_file(tmp_path):
    path = write_scene(tmp_path, '\ufeff[pore]\r\nwidth = "0.08 mm"\r\n[aggregate]\r\nradius = "20 µm"\r\n')
    for source in (path, str(path)):
        scene = load_scene(source)
        assert (scene.name, scene.pore.width, scene.pore.length, scene.aggregate.radius) == ("mine", 80, 600, 20)


def test_set_reads_lists_and_numbers_and_the_last_one_wins():
    times = 'output.times=["16 h", "30 min", "8 h", "0.5 h"]'
    overrides = [times, "flow.viscosity_ratio=1", " flow.viscosity_ratio = 2e2 "]
    scene = load_scene("base", overrides)
    assert scene.output.times == (0.5, 8.0, 16.0)
    assert scene.flow.viscosity_ratio == 200


def test_a_value_cannot_set_another_key():
    assert "pore.width" in refusal("base", 'pore.width="9 um"\nlength="9 um"')


@pytest.mark.exact_lengths
def test_unset_removes_keys_and_sections():
    base = load_scene("base")
    driven = load_scene("base", ["flow.mean_velocity=1 m/day"], unset=["flow.head"])
    assert (driven.flow.head, driven.flow.mean_velocity) == (None, pytest.approx(1e6 / 24))
    assert load_scene("base", (), unset=["substrates.donor.supply", " substrates . acceptor.supply "]) == base
    at_rest = load_scene("base", (), unset=["flow", "growth"])
    assert at_rest.flow is None and at_rest.growth is None and at_rest.kinetics == base.kinetics
    assert load_scene("base", ["flow.head=10 um"], unset=["flow.head"]) == base
    assert load_scene("base", ["flow.head=1 cm"], unset=["flow"]).flow.head == 10_000


# ---------------------------------------------------------------- units and pint


def units_of_same_kind(unit):
    """The names of units of the same kind."""
    return [other for other, one in exact.UNITS.items() if one[1:] == exact.UNITS[unit][1:]]


@pytest.mark.parametrize("name", sorted(exact.UNITS))
def test_every_unit_agrees_with_pint(name):
    """Sizes agree as exact fractions, and so do the dimensions."""
    unit = exact.UNITS[name]
    base = " ".join(f"{symbol}^{power}" for symbol, power in zip(("m", "kg", "s"), unit[1:]) if power) or "rad"
    assert units._by_pint(name, base) == unit.size and isinstance(unit.size, Fraction)


@given(st.sampled_from(sorted(units.NOUNS)), st.sampled_from(["/", " / ", "/ "]),
       st.sampled_from(["", "*um/um", " / h h", " um^2 / um**2", "/h^-1 / h", " h**-1*h"]), st.data())
def test_products_of_units_agree_with_pint(unit, over, more, data):
    """Both agree bit by bit if units of the same kind replace every factor of an internal unit, for factors that cancel
    and all ways to write a product. Both refuse factors that do not cancel."""
    product = re.sub("[A-Za-z]+", lambda name: data.draw(st.sampled_from(units_of_same_kind(name[0]))), unit + more)
    product = product.replace("/", over)
    exactly = converted(units._conversion, product, unit)
    assert exactly == converted(units._by_pint, product, unit) or unit == "rad" and more and exactly == "refused"


def converted(convert, text, unit):
    """The factor of a conversion, or "refused"."""
    try:
        return convert(text, unit)
    except ValueError:
        return "refused"


@pytest.mark.exact_lengths
@pytest.mark.parametrize("text, unit, value", [("5 inch", "um", 127000.0), ("2 kmin", "h", 2000 / 60),
                                               ("14.5 psi", "MPa", 0.09997398075094124)])
def test_units_that_pint_alone_knows_are_accepted(text, unit, value):
    assert units.to_internal(text, unit) == value


@pytest.mark.parametrize("text, unit, value", [
    ("5 g/m3", "mg/L", 5), ("5 g/m³", "mg/L", 5), ("5 mg L-1", "mg/L", 5), ("5 mg·L⁻¹", "mg/L", 5),
    ("1e-9 m2/s", "um^2/h", 3.6e6), ("1e-9 m²/s", "um^2/h", 3.6e6), ("24 d-1", "1/h", 1), ("24 d−1", "1/h", 1),
    ("1 m s-2", "um/h^2", 1.296e13), ("1 ft2/s", "um^2/h", 334450944000000)])
def test_units_are_accepted_as_papers_write_them(text, unit, value):
    try:
        computed = units.to_internal(text, unit)
    except ValueError as error:
        pytest.fail(f"{text}: {error}")
    assert computed == value


@given(st.floats(1e-12, 1e12), st.sampled_from([
    ("um/h", "m/day"), ("um/h^2", "m s-2"), ("rad", "deg"), ("1/h", "1/day"), ("um^2/h", "cm^2/day"), ("um", "ft")]))
def test_a_value_in_another_unit_reads_back_bit_by_bit(value, pair):
    assert units.to_internal(units.in_unit(value, *pair), pair[0]) == value


def test_a_scene_is_shown_in_the_units_of_its_text():
    """Keys that the text leaves out have those of their example. The hash does not depend on units."""
    written = ["flow.gravity=9810 mm/s2", "substrates.donor.supply=[['0 h', '10 g/m³'], ['2 h', '5 mg/L']]"]
    scene = load_scene("base", written)
    assert scene.flow.gravity == load_scene("base").flow.gravity
    tables = scene_tables(scene)
    assert tables["flow"]["gravity"] == "9810 mm/s2" and tables["flow"]["kinematic_viscosity"] == "0.01003 cm^2/s"
    assert tables["substrates"]["donor"]["supply"][0] == ["0.0 h", "10 g/m3"]
    assert tables["substrates"]["acceptor"]["diffusivity_in_aggregate"] == "1.85 cm^2/day"
    other = load_scene("base", [written[1]])
    assert scene == other and scene_hash(scene) == scene_hash(other)
    assert not differences(tables, scene_tables(other))
    assert list(differences(tables, scene_tables(load_scene(other, ["pore.width=51 um"])))) == ["pore.width"]


# ---------------------------------------------------------------- times of rows


@pytest.mark.parametrize("entries, times", [
    (["output.every=0.1 h"], (0, 0.1, 0.2, 0.3, 0.35)),
    (["output.every=0.1 h", "output.times=[\"0.25 h\", \"0.2 h\"]"], (0, 0.1, 0.2, 0.25, 0.3, 0.35)),
    (["output.every=0.35 h"], (0, 0.35)), (["output.every=1 h"], (0, 0.35))])
@pytest.mark.parametrize("scheme", ["updates", "midpoint"])
def test_rows_at_an_interval(entries, times, scheme):
    """They end with growth.end, and output.times adds others."""
    changes = ["growth.end=0.35 h", "numerics.refinement=0.3", exchange(steps=scheme), *entries]
    assert tuple(report.pore.time for report in simulate(load_exchanged("base", changes))) == times


def test_an_interval_with_too_many_rows_is_refused():
    assert load_scene("base", ["output.every=0.00194 h"]).output.every == 0.00194
    with pytest.raises(SceneError, match="output.every = .*0.00194 h or more is needed: at most 10000 rows"):
        load_scene("base", ["output.every=0.0019 h"])


# ---------------------------------------------------------------- values implied by other keys

COD = "kinetics.donor_oxygen_demand"
SHARE = "substrates.donor.diffusivity_in_aggregate"


@given(st.floats(1e-3, 1e3), st.floats(0.01, 1), st.floats(0.01, 1))
def test_the_ratio_follows_from_the_oxygen_demand(rest, product, part):
    """F = COD - Y d_c, by (7). Both values are stored, even if F is set as well, and are read back."""
    overrides = [f"{COD}={rest + product * part!r}", f"kinetics.yield_coefficient={part!r}",
                 f"kinetics.decay_oxygen_demand={product!r}"]
    scene = load_scene("base", overrides)
    law = scene.kinetics
    law_with_ratio = load_scene("base", [*overrides, "kinetics.acceptor_to_donor_ratio=1.6"]).kinetics
    assert law.acceptor_to_donor_ratio == law.implied_ratio == pytest.approx(rest, rel=1e-12)
    assert law_with_ratio.implied_ratio == law.implied_ratio
    assert law_with_ratio.acceptor_to_donor_ratio == 1.6 and load_scene("base").kinetics.implied_ratio is None
    assert parse_scene(scene_tables(scene), "base", "again") == parsed(scene_text("base", overrides), "base") == scene


@pytest.mark.parametrize("text, share", [("80 %", Fraction(4, 5)), ("100.0%", 1), ("1e-3 %", Fraction(1, 100_000))])
def test_the_diffusivity_in_the_aggregate_may_be_a_share(text, share):
    """The share is one of the scene's D, rounded once, in either order of keys. The hash has the value, the text the
    share."""
    entries = [f"{SHARE}={text}", "substrates.donor.diffusivity=3 cm^2/day"]
    scene, written_out = load_scene("base", entries), scene_text("base", entries)
    donor = scene.substrates.donor
    assert donor.diffusivity_in_aggregate == float(share * Fraction(donor.diffusivity))
    assert scene == load_scene("base", entries[::-1]) == parse_scene(scene_tables(scene), "base", "again")
    explicit = load_scene("base", [f"{SHARE}={donor.diffusivity_in_aggregate!r} um^2/h", entries[1]])
    assert f"\ndiffusivity_in_aggregate = {json.dumps(text)}\n" in written_out and parsed(written_out, "base") == scene
    assert scene_hash(explicit) == scene_hash(scene)
