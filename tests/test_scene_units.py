"""Units of scenes: the table of exact fractions says what pint says, and pint is asked for the rest alone."""
import re
import subprocess
import sys
from fractions import Fraction

import pytest
from hypothesis import given
from hypothesis import strategies as st

from repro.scene import exact, load_scene, packaged_scenes, units
from repro.scene.text import scene_text

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
        load_scene(name)
        scene_text(name)
    for entry in ("pore.width=50", "pore.width=50 s", "growth.end=5 um", "substrates.donor.supply=1 m"):
        with pytest.raises(units.SceneError, match="is needed, such as"):
            load_scene("base", [entry])


def test_a_run_of_base_never_makes_the_registry(tmp_path):
    script = ("import sys; from repro.cli import main; "
              "status = main(['run', 'base', '--set', 'growth.end=0.2 h', '--out', sys.argv[1], '--quiet']); "
              "sys.exit(status or ('pint' in sys.modules))")
    assert subprocess.run([sys.executable, "-c", script, tmp_path / "out"], check=False).returncode == 0
