"""Scenes: Table 1 in internal units, packaged scenes, sections, --set; units, whose table of exact fractions says what
pint says, and what is said by other keys: F by the oxygen demand, D in the aggregate by that in water."""
import dataclasses
import math
import re
from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from repro.scene import (
    Donor,
    Kinetics,
    Scene,
    SceneError,
    exact,
    load_scene,
    packaged_scenes,
    parse_scene,
    scene_hash,
    scene_tables,
    units,
)
from repro.scene.text import scene_text
from tests.test_scene_text import fields, parsed


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
    "aggregate.position": 0.0,
    "aggregate.smooth": False,
    "aggregate.inert_fraction": 0.0,
    "flow.biomass": "viscous",
    "flow.viscosity_ratio": 2000.0,
    "flow.kinematic_viscosity": 3.6108e9,
    "flow.gravity": 1.271376e14,
    "flow.density": 998000.0,
    "flow.interpolation": "steps",
    "substrates.acceptor.interpolation": "steps",
    "substrates.donor.interpolation": "steps",
    "substrates.acceptor.supply": 10.0,
    "substrates.donor.supply": 10.0,
    "substrates.acceptor.half_saturation": 1.0,
    "substrates.donor.half_saturation": 1.0,
    "substrates.acceptor.diffusivity": 2.32e8 / 24,
    "substrates.acceptor.diffusivity_in_aggregate": 1.85e8 / 24,
    "substrates.donor.diffusivity": 1.01e8 / 24,
    "substrates.donor.diffusivity_in_aggregate": 0.81e8 / 24,
    "substrates.boundary": "open",
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
    "growth.new_biomass": "stressed",
    "growth.fluid_forces": "neglected",
    "numerics.preset": "fast",
    "numerics.elements": "quadratic",
    "numerics.time": "midpoint",
    "numerics.tolerance": 0.0075,
    "numerics.jacobian": "reused",
    "numerics.flow_element": "stabilised",
    "numerics.transport": "quasi_steady",
    "numerics.solver": "superlu",
    "numerics.ordering": "degree",
    "numerics.transfer": "conserving",
    "numerics.extent": "central",
    "numerics.interface": "laplacian",
    "numerics.inlet": "local",
    "numerics.fixed_point": "kept",
    "numerics.refinement": 0.2,
    "numerics.gradation": 0.25,
    "numerics.contact_elements": 0.0,
    "numerics.flow_stabilisation": 100.0,
    "numerics.mesh_compressibility": 1.0,
    "output.timeseries": "csv",
}
GIVEN = {"name", "growth.end", "flow.head", "flow.mean_velocity", "output.times", "aggregate.outline",
         "flow.permeability", "kinetics.donor_oxygen_demand"}


def flat(section, prefix="") -> dict:
    values = {}
    for name in (field.name for field in dataclasses.fields(section)):
        value = getattr(section, name)
        values |= flat(value, f"{prefix}{name}.") if dataclasses.is_dataclass(value) else {f"{prefix}{name}": value}
    return values


#: Every section, as empty as it may be.
EVERYTHING = {"aggregate": {}, "flow": {"head": "1e-3 cm"}, "substrates": {}, "growth": {"end": "1 h"}}


@pytest.fixture
def everything():
    return parse_scene(EVERYTHING, "everything", "mine.toml")


def test_defaults_are_table_1(everything):
    values = {key: value for key, value in flat(everything).items() if key not in GIVEN}
    assert set(values) == set(TABLE_1)
    for key, value in TABLE_1.items():
        assert values[key] == (value if isinstance(value, str) else pytest.approx(value, rel=1e-15)), key


# ---------------------------------------------------------------- packaged scenes and sections


@pytest.mark.parametrize("name, width, end, head, velocity", [("base", 50, 19.4, 10, None),
                                                              ("wide", 100, 45, None, pytest.approx(2.9e6 / 24))])
def test_packaged_scenes(name, width, end, head, velocity):
    """Of the paper; every other value is pinned by its hash (tests/test_scene_aggregate.py)."""
    scene = load_scene(name)
    assert packaged_scenes() == ("base", "flow_only", "initial_mesh", "wide")
    assert (scene.pore.width, scene.pore.length, scene.aggregate.radius, scene.growth.end) == (width, 600, 5, end)
    assert (scene.flow.head, scene.flow.mean_velocity) == (head, velocity)


def test_kinetics_come_with_substrates_and_aggregate():
    assert load_scene("flow_only", ["substrates={}"]).kinetics.yield_coefficient == 0.61
    assert parse_scene({"substrates": {}}, "clean", "mine.toml").kinetics is None
    assert "[substrates]" in refusal("flow_only", "kinetics.yield_coefficient=0.5")


def test_a_file_is_read_with_its_stem_for_a_name(tmp_path):
    path = written(tmp_path, '\ufeff[pore]\r\nwidth = "0.08 mm"\r\n[aggregate]\r\nradius = "20 µm"\r\n')
    for source in (path, str(path)):
        scene = load_scene(source)
        assert (scene.name, scene.pore.width, scene.pore.length, scene.aggregate.radius) == ("mine", 80, 600, 20)


# ---------------------------------------------------------------- units


@pytest.mark.parametrize("override, value", [
    ("growth.end=1 day", 24.0),
    ("growth.end=+.5e1h", 5.0),
    ("growth.minimum_contact_angle=0.25 rad", 0.25),
    ("flow.gravity=1 m/s**2", 1.296e13),
    ("flow.density=1 g/cm^3", 1e6),
    ("flow.kinematic_viscosity=1e-6 m^2 s^-1", 3.6e9),
    ("kinetics.decay_coefficient=0.48 /day", 0.02),
    ("kinetics.maximum_utilization_rate=4.8 mg/mg/day", 0.2),
    ("flow.viscosity_ratio=500", 500.0),
])
def test_conversion_is_rounded_once(override, value):
    """Worked out by hand."""
    read = flat(load_scene("base", [override]))[override.partition("=")[0]]
    assert read == value and isinstance(read, float)


# ---------------------------------------------------------------- --set


@pytest.mark.parametrize("quoted, bare", [
    ("growth.end='5 h'", " growth.end = 5 h "),
    ('numerics.transport="gear"', "numerics.transport=gear"),
    ('substrates.acceptor.supply="0 mg/L"', "substrates.acceptor.supply=0 mg/L"),
])
def test_set_reads_a_bare_string_like_a_quoted_one(quoted, bare):
    changed = load_scene("base", [quoted])
    assert changed == load_scene("base", [bare])
    assert changed != load_scene("base")


def test_set_reads_lists_and_numbers_and_the_last_one_wins():
    times = 'output.times=["16 h", "30 min", "8 h", "0.5 h"]'
    overrides = [times, "flow.viscosity_ratio=1", "flow.viscosity_ratio=2e2"]
    scene = load_scene("base", overrides)
    assert scene.output.times == (0.5, 8.0, 16.0)
    assert scene.flow.viscosity_ratio == 200


def test_set_creates_an_absent_section():
    scene = load_scene("initial_mesh", ["flow.head=1e-3 cm", "substrates.donor.supply=3 mg/L", "substrates.acceptor={}",
                                        "growth.end=0 h"])
    assert (scene.flow.head, scene.substrates.donor.supply, scene.growth.end) == (10, 3, 0)
    assert scene.substrates.acceptor.supply == 10
    assert load_scene("initial_mesh").flow is None


def test_a_value_cannot_smuggle_in_another_key():
    assert "pore.width" in refusal("base", 'pore.width="9 um"\nlength="9 um"')


@pytest.mark.parametrize("override", ["", "pore.width", "=5 um", " = 5", "pore.=5 um", ".width=5 um", "a..b=5 um"])
def test_set_needs_a_key_and_a_value(override):
    told = refusal("base", override)
    assert "KEY=VALUE is needed" in told and f"did you mean {override}?" not in told


# ---------------------------------------------------------------- --unset


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

#: Units that pint knows and the table does not, and words that are no unit.
OTHERS = ["inch", "ft", "angstrom", "lb", "psi", "atm", "dyn", "month", "ppm", "percent", "mol", "K", "Hz", "cc",
          "kmin", "hectare", "nope", "furlongsies", "umm"]
FACTORS = st.builds(str.__add__, st.sampled_from([*exact.UNITS] * 3 + OTHERS),
                    st.sampled_from(["", "", "^2", "**2", "^-1", "**-3", "^3"]))
PRODUCTS = st.builds(lambda head, first, rest: head + first + "".join(sign + one for sign, one in rest),
                     st.sampled_from(["", "", "1/", "/", "1 / ", " /"]), FACTORS,
                     st.lists(st.tuples(st.sampled_from(["*", "/", " ", " * ", " / ", "/ "]), FACTORS), max_size=3))


def told(convert, given, unit):
    """What a conversion is, or that there is none."""
    try:
        return convert(given, unit)
    except ValueError:
        return "refused"


@pytest.mark.parametrize("name", sorted(exact.UNITS))
def test_every_unit_is_pints(name):
    """To the last digit of an exact fraction, and with its dimensions."""
    unit = exact.UNITS[name]
    base = " ".join(f"{symbol}^{power}" for symbol, power in zip(("m", "kg", "s"), unit[1:]) if power) or "rad"
    assert units._by_pint(name, base) == unit.size and isinstance(unit.size, Fraction)


@given(PRODUCTS.filter(lambda text: re.fullmatch(units._UNIT, text)), st.sampled_from(sorted(units.NOUNS)))
def test_products_of_units_are_pints(product, unit):
    """Bit by bit, or refused by both."""
    exactly, slowly = told(units._conversion, product, unit), told(units._by_pint, product, unit)
    assert unit == "rad" and exactly == "refused" or exactly == slowly


@given(st.sampled_from(sorted(units.NOUNS)), st.data())
def test_units_of_the_right_dimension_are_pints(unit, data):
    """Every factor of an internal unit in another one of its kind, in all ways to write a product."""
    product = re.sub(r"[A-Za-z]+", lambda name: data.draw(st.sampled_from(alike(name[0]))), unit)
    product = product.replace("/", data.draw(st.sampled_from(["/", " / ", "/ "])))
    assert units._conversion(product, unit) == units._by_pint(product, unit)


def alike(name):
    if name == "rad":
        return units.ANGLES
    return [other for other, one in exact.UNITS.items() if one[1:] == exact.UNITS[name][1:]]


@pytest.mark.parametrize("text, unit, value", [
    ("5 inch", "um", 127000.0), ("1 month", "h", 730.5), ("14.5 psi", "MPa", 0.09997398075094124),
    ("2 kmin", "h", 2000 / 60), ("3 Hz", "1/h", 10800.0),
])
def test_units_that_pint_alone_knows_are_accepted(text, unit, value):
    assert units.to_internal(text, unit) == value


def test_packaged_scenes_defaults_and_examples_need_no_pint(monkeypatch):
    """Nor do their refusals with hints."""
    monkeypatch.setattr(units, "_registry", None)
    units._conversion.cache_clear()
    for name in packaged_scenes():
        load_scene(name, ["pore.width=0.08 mm", "pore.length=800 micrometers"])
        scene_text(name)
    for entry in ("pore.width=50", "pore.width=50 s", "growth.end=5 um", "substrates.donor.supply=1 m"):
        with pytest.raises(units.SceneError, match="is needed, such as"):
            load_scene("base", [entry])


def test_what_a_key_accepts_cannot_be_changed():
    """Of any kind: one object tells every scene what a key takes."""
    kinds = {type(entry.metadata["kind"]) for _, entry in fields(Scene) if "kind" in entry.metadata}
    assert units.Points in kinds and len(kinds) >= 7
    assert {kind.__name__ for kind in kinds if not kind.__dataclass_params__.frozen} == set()


# ---------------------------------------------------------------- F by the oxygen demand

COD = "kinetics.donor_oxygen_demand"


def test_the_ratio_follows_from_the_oxygen_demand():
    """F = COD - Y d_c, by (7); both are kept, so that a difference can be told."""
    kinetics = load_scene("base", [f"{COD}=2.38"]).kinetics
    assert kinetics.acceptor_to_donor_ratio == pytest.approx(1.5138, rel=1e-15) == kinetics.implied_ratio
    other = load_scene("base", [f"{COD}=3", "kinetics.yield_coefficient=0.5", "kinetics.decay_oxygen_demand=1"])
    assert other.kinetics.acceptor_to_donor_ratio == 2.5
    both = load_scene("base", [f"{COD}=2.38", "kinetics.acceptor_to_donor_ratio=1.6"]).kinetics
    assert (both.acceptor_to_donor_ratio, both.donor_oxygen_demand) == (1.6, 2.38)
    assert both.implied_ratio == pytest.approx(1.5138) and Kinetics().implied_ratio is None


@given(st.floats(1e-3, 1e3), st.floats(0.01, 1), st.floats(0.01, 1))
def test_round_trip_with_an_oxygen_demand(rest, product, part):
    """From the tables and from the text that `repro scene` writes."""
    overrides = [f"{COD}={rest + product * part!r}", f"kinetics.yield_coefficient={part!r}",
                 f"kinetics.decay_oxygen_demand={product!r}"]
    scene = load_scene("base", overrides)
    assert parse_scene(scene_tables(scene), "base", "again") == scene
    assert parsed(scene_text("base", overrides), "base") == scene
    without = replace(scene, kinetics=replace(scene.kinetics, donor_oxygen_demand=None))
    assert scene_hash(scene) != scene_hash(without)


@pytest.mark.parametrize("entry, key", [("yield_coefficient=1", "decay_oxygen_demand"),
                                        ("decay_oxygen_demand=4", "yield_coefficient")])
def test_what_is_set_beside_an_oxygen_demand_is_named(tmp_path, entry, key):
    path = tmp_path / "mine.toml"
    path.write_text("[aggregate]\n[substrates]\n[kinetics]\ndonor_oxygen_demand = 1.2\n")
    message = refusal(path, f"kinetics.{entry}")
    name, _, value = entry.partition("=")
    assert f"kinetics.{name} = {value}: less than kinetics.donor_oxygen_demand (1.2) is needed of Y d_c (" in message
    assert message.endswith(f"its product with {key}")


# ---------------------------------------------------------------- shares


@pytest.mark.parametrize("text, share", [("80 %", Fraction(4, 5)), ("80%", Fraction(4, 5)), ("100.0 %", 1),
                                         ("2.5e1 %", Fraction(1, 4)), ("1e-3 %", Fraction(1, 100_000))])
def test_a_share_of_the_diffusivity_in_water(text, share):
    """Rounded once, of the D that the scene says, in either order."""
    entries = [f"substrates.donor.diffusivity_in_aggregate={text}", "substrates.donor.diffusivity=3 cm^2/day"]
    for overrides in (entries, entries[::-1]):
        scene = load_scene("base", overrides)
        donor = scene.substrates.donor
        assert donor.diffusivity_in_aggregate == float(share * Fraction(donor.diffusivity))
        assert parse_scene(scene_tables(scene), "base", "again") == scene
    default = load_scene("base", [f"substrates.acceptor.diffusivity_in_aggregate={text}"]).substrates.acceptor
    assert default.diffusivity_in_aggregate == float(share * Fraction(default.diffusivity))


def test_a_share_is_hashed_as_what_it_comes_to_and_written_as_it_stands():
    said, meant = ([f"substrates.donor.diffusivity_in_aggregate={value}", "substrates.donor.diffusivity=3 cm^2/day"]
                   for value in ("80 %", "2.4 cm^2/day"))
    assert scene_hash(load_scene("base", said)) == scene_hash(load_scene("base", meant))
    text = scene_text("base", said)
    assert '\ndiffusivity_in_aggregate = "80 %"\n' in text and parsed(text, "base") == load_scene("base", said)
    assert Donor(diffusivity=10.0, diffusivity_in_aggregate=Fraction(1, 2)).diffusivity_in_aggregate == 5.0


