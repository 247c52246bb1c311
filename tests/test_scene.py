"""Scenes: Table 1 in internal units, packaged scenes, sections, --set; units, whose table of exact fractions says what
pint says, and what is said by other keys: F by the oxygen demand, D in the aggregate by that in water."""
import json
import math
import re
from fractions import Fraction
from operator import attrgetter
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from repro.scene import SceneError, exact, load_scene, parse_scene, scene_hash, scene_tables, units
from repro.scene.text import scene_text
from tests.test_scene_text import parsed


def refusal(source, *overrides, unset=()) -> str:
    """The message of the SceneError, which is one line of bearable length."""
    with pytest.raises(SceneError) as caught:
        load_scene(source, overrides, unset)
    message = str(caught.value)
    assert message.isprintable() and len(message) < 500 and "Traceback" not in message
    return message


def written(tmp_path, text, encoding="utf-8") -> Path:
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
    "numerics.contact_elements": 0.0,
    "numerics.flow_stabilisation": 100.0,
    "numerics.mesh_compressibility": 1.0,
}
#: Every section, as empty as it may be.
EVERYTHING = {"aggregate": {}, "flow": {"head": "1e-3 cm"}, "substrates": {}, "growth": {"end": "1 h"}}


def test_defaults_are_table_1():
    made = parse_scene(EVERYTHING, "everything", "mine.toml")
    for key, value in TABLE_1.items():
        assert attrgetter(key)(made) == pytest.approx(value, rel=1e-15), key


def test_kinetics_come_with_substrates_and_aggregate():
    assert load_scene("flow_only", ["substrates={}"]).kinetics.yield_coefficient == 0.61
    assert parse_scene({"substrates": {}}, "clean", "mine.toml").kinetics is None
    assert "[substrates]" in refusal("flow_only", "kinetics.yield_coefficient=0.5")


def test_a_file_is_read_with_its_stem_for_a_name(tmp_path):
    path = written(tmp_path, '\ufeff[pore]\r\nwidth = "0.08 mm"\r\n[aggregate]\r\nradius = "20 µm"\r\n')
    for source in (path, str(path)):
        scene = load_scene(source)
        assert (scene.name, scene.pore.width, scene.pore.length, scene.aggregate.radius) == ("mine", 80, 600, 20)


def test_set_reads_lists_and_numbers_and_the_last_one_wins():
    times = 'output.times=["16 h", "30 min", "8 h", "0.5 h"]'
    overrides = [times, "flow.viscosity_ratio=1", " flow.viscosity_ratio = 2e2 "]
    scene = load_scene("base", overrides)
    assert scene.output.times == (0.5, 8.0, 16.0)
    assert scene.flow.viscosity_ratio == 200


def test_a_value_cannot_smuggle_in_another_key():
    assert "pore.width" in refusal("base", 'pore.width="9 um"\nlength="9 um"')


def test_unset_leaves_keys_and_sections_out():
    base = load_scene("base")
    driven = load_scene("base", ["flow.mean_velocity=1 m/day"], ["flow.head"])
    assert (driven.flow.head, driven.flow.mean_velocity) == (None, pytest.approx(1e6 / 24))
    assert load_scene("base", (), ["substrates.donor.supply", " substrates . acceptor.supply "]) == base
    still = load_scene("base", (), ["flow", "growth"])
    assert still.flow is None and still.growth is None and still.kinetics == base.kinetics
    assert load_scene("base", ["flow.head=10 um"], ["flow.head"]) == base
    assert load_scene("base", ["flow.head=1 cm"], ["flow"]).flow.head == 10_000


# ---------------------------------------------------------------- units and pint


def alike(unit):
    """The names of units of the same kind."""
    if unit == "rad":
        return units.ANGLES
    return [other for other, one in exact.UNITS.items() if one[1:] == exact.UNITS[unit][1:]]


@pytest.mark.parametrize("name", sorted(exact.UNITS))
def test_every_unit_is_pints(name):
    """To the last digit of an exact fraction, and with its dimensions."""
    unit = exact.UNITS[name]
    base = " ".join(f"{symbol}^{power}" for symbol, power in zip(("m", "kg", "s"), unit[1:]) if power) or "rad"
    assert units._by_pint(name, base) == unit.size and isinstance(unit.size, Fraction)


@given(st.sampled_from(sorted(units.NOUNS)), st.sampled_from(["/", " / ", "/ "]),
       st.sampled_from(["", "*um/um", " / h h", " um^2 / um**2", "/h^-1 / h", " h**-1*h"]), st.data())
def test_products_of_units_are_pints(unit, over, more, data):
    """Bit by bit: every factor of an internal unit in another one of its kind, with factors that cancel, in all ways to
    write a product; refused by both where they do not."""
    product = re.sub("[A-Za-z]+", lambda name: data.draw(st.sampled_from(alike(name[0]))), unit + more)
    product = product.replace("/", over)
    exactly = told(units._conversion, product, unit)
    assert exactly == told(units._by_pint, product, unit) or unit == "rad" and more and exactly == "refused"


def told(convert, given, unit):
    """What a conversion is, or that there is none."""
    try:
        return convert(given, unit)
    except ValueError:
        return "refused"


@pytest.mark.parametrize("text, unit, value", [("5 inch", "um", 127000.0), ("2 kmin", "h", 2000 / 60),
                                               ("14.5 psi", "MPa", 0.09997398075094124)])
def test_units_that_pint_alone_knows_are_accepted(text, unit, value):
    assert units.to_internal(text, unit) == value


# ---------------------------------------------------------------- what is said by other keys

COD = "kinetics.donor_oxygen_demand"
SHARE = "substrates.donor.diffusivity_in_aggregate"


@given(st.floats(1e-3, 1e3), st.floats(0.01, 1), st.floats(0.01, 1))
def test_the_ratio_follows_from_the_oxygen_demand(rest, product, part):
    """F = COD - Y d_c, by (7); both are kept, also where F is given too, and read back from what is written."""
    overrides = [f"{COD}={rest + product * part!r}", f"kinetics.yield_coefficient={part!r}",
                 f"kinetics.decay_oxygen_demand={product!r}"]
    made = load_scene("base", overrides)
    law, given = made.kinetics, load_scene("base", [*overrides, "kinetics.acceptor_to_donor_ratio=1.6"]).kinetics
    assert law.acceptor_to_donor_ratio == law.implied_ratio == given.implied_ratio == pytest.approx(rest, rel=1e-12)
    assert given.acceptor_to_donor_ratio == 1.6 and load_scene("base").kinetics.implied_ratio is None
    assert parse_scene(scene_tables(made), "base", "again") == parsed(scene_text("base", overrides), "base") == made


@pytest.mark.parametrize("text, share", [("80 %", Fraction(4, 5)), ("100.0%", 1), ("1e-3 %", Fraction(1, 100_000))])
def test_a_share_of_the_diffusivity_in_water(text, share):
    """Rounded once, of the D that the scene says, in either order; hashed as what it comes to, written as it stands."""
    entries = [f"{SHARE}={text}", "substrates.donor.diffusivity=3 cm^2/day"]
    made, written_out = load_scene("base", entries), scene_text("base", entries)
    donor = made.substrates.donor
    assert donor.diffusivity_in_aggregate == float(share * Fraction(donor.diffusivity))
    assert made == load_scene("base", entries[::-1]) == parse_scene(scene_tables(made), "base", "again")
    meant = load_scene("base", [f"{SHARE}={donor.diffusivity_in_aggregate!r} um^2/h", entries[1]])
    assert f"\ndiffusivity_in_aggregate = {json.dumps(text)}\n" in written_out and parsed(written_out, "base") == made
    assert scene_hash(meant) == scene_hash(made)
