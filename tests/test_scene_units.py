"""Units of scenes: the table of exact fractions says what pint says, and pint is asked for the rest alone; and what is
said by other keys: F by the oxygen demand, D in the aggregate by that in water."""
import re
from dataclasses import replace
from fractions import Fraction

import pytest
from hypothesis import given
from hypothesis import strategies as st

from repro.scene import (
    Donor,
    Kinetics,
    Scene,
    exact,
    load_scene,
    packaged_scenes,
    parse_scene,
    scene_hash,
    scene_tables,
    units,
)
from repro.scene.text import scene_text
from tests.test_scene import refusal
from tests.test_scene_text import fields, parsed

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


