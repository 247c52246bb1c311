"""Scenes written and read again, in any units, and anything else that is read: the same scene, or one clear line."""
import dataclasses
import math
from decimal import Decimal, localcontext

import pytest
from hypothesis import given
from hypothesis import strategies as st

from repro.scene import PRESETS, SceneError, load_scene, packaged_scenes, parse_scene, scene_hash, scene_tables
from tests.strategies import scenes
from tests.test_scene import EVERYTHING

#: Units that a scene may be written in, and how many of them an internal unit is: exact decimals, worked out by hand.
OTHER_UNITS = {
    "um": {"nm": "1e3", "mm": "1e-3", "cm": "1e-4", "m": "1e-6"},
    "h": {"min": "60", "s": "3600"},
    "um/h": {"m/day": "24e-6", "cm/day": "24e-4", "mm h^-1": "1e-3"},
    "um^2/h": {"cm^2/day": "24e-8", "m^2/h": "1e-12", "mm**2 / day": "24e-6"},
    "um/h^2": {"m/day^2": "576e-6", "mm/h^2": "1e-3"},
    "1/h": {"1/day": "24", "/day": "24", "day^-1": "24"},
    "mg/L": {"g/L": "1e-3", "ug/L": "1e3", "kg/m^3": "1e-3", "mg/m^3": "1e3"},
    "MPa": {"kPa": "1e3", "Pa": "1e6", "GPa": "1e-3"},
    "rad": {"radian": "1"},
}
WRONG = ["", " kg", " um", " mg/L", " um^9", " furlongsies", "um+um", " K"]
EITHER_SIGN = {("aggregate", "position")}
NOT_A_VALUE = [True, None, [], {}, ["5 um"], {"value": "5 um"}, "", "nan", "inf um", "um", "1e999999999 um", math.nan]


def leaves(table, path=()):
    """(path, value) of every value of a scene's tables."""
    for key, value in table.items():
        yield from leaves(value, (*path, key)) if isinstance(value, dict) else [((*path, key), value)]


def changed(table, path, value):
    """The tables with one value set."""
    head, *rest = path
    return {**table, head: changed(table.get(head, {}), rest, value) if rest else value}


def refused(tables, key):
    """Is it refused, by one clear line that names the key?"""
    with pytest.raises(SceneError) as caught:
        parse_scene(tables, "drawn", "drawn.toml")
    message = str(caught.value)
    assert message.startswith("drawn.toml: ") and key in message and message.isprintable() and len(message) < 500
    return message


@given(scenes(), st.data())
def test_a_scene_in_any_units_is_the_same_scene(made, data):
    """Written out, rewritten number by number in other units with exact decimals, and read back: equal bit by bit, and
    with the same hash."""
    tables = scene_tables(made)
    assert parse_scene(tables, made.name, "again") == made
    for path, value in list(leaves(tables)):
        if isinstance(value, str) and value[0].isdigit():
            digits, unit = value.split(" ", 1)
            other = data.draw(st.sampled_from(sorted(OTHER_UNITS[unit].items())))
            with localcontext(prec=60):
                tables = changed(tables, path, f"{Decimal(digits) * Decimal(other[1])} {other[0]}")
    again = parse_scene(tables, made.name, "again")
    assert again == made and scene_hash(again) == scene_hash(made)


@given(scenes(), st.data())
def test_one_wrong_value_is_refused_by_its_name(made, data):
    """Any value of a scene that runs, spoiled in one of many ways: another dimension, no unit, less than zero, a table
    or a list."""
    tables = scene_tables(made)
    path, value = data.draw(st.sampled_from([*leaves(tables)]))
    if isinstance(value, str) and value[0].isdigit():
        digits, unit = value.split(" ", 1)
        wrong = [digits + end for end in WRONG if end.strip() != unit]
        below = [] if path in EITHER_SIGN else [f"-{digits}1 {unit}"]
        bad = data.draw(st.sampled_from([*NOT_A_VALUE, *wrong, *below, float(digits)]))
    elif isinstance(value, bool):
        bad = data.draw(st.sampled_from([*NOT_A_VALUE, 0, 1.0, "true", "yes"]))
    elif isinstance(value, float):
        bad = data.draw(st.sampled_from([*NOT_A_VALUE, -1.0 - value, str(value), f"{value} um"]))
    else:
        bad = data.draw(st.sampled_from([*NOT_A_VALUE, 1.0, value.upper(), value + "s"]))
    assert path[-1] in refused(changed(tables, path, bad), ".".join(path))


@given(scenes(), st.data(), st.text(st.characters(codec="ascii"), min_size=1, max_size=30))
def test_an_unknown_key_is_refused_by_its_name(made, data, name):
    """In any section, or beside them."""
    tables = scene_tables(made)
    sections = sorted({path[:-1] for path, _ in leaves(tables)} | {()})
    where = data.draw(st.sampled_from(sections))
    table = tables
    for part in where:
        table = table[part]
    if name not in table and name not in KNOWN_BUT_ABSENT:
        assert "there is no such key" in refused(changed(tables, (*where, name), "5 um"), "")


KNOWN_BUT_ABSENT = {"head", "mean_velocity", "outline", "times", "aggregate", "flow", "substrates", "kinetics",
                    "growth", "output", "donor_oxygen_demand"}


@given(st.text(max_size=100) | st.integers() | st.floats() | st.recursive(
    st.none() | st.booleans() | st.text(max_size=9), lambda inner: st.lists(inner) | st.dictionaries(st.text(), inner)))
def test_whatever_is_read_is_a_scene_or_one_clear_line(anything):
    """For a value, a section and a --set."""
    for tables in ({"pore": {"width": anything}}, {"flow": {"head": "1 um", "viscosity_ratio": anything}},
                   {"pore": anything}, {"output": {"times": anything}}, {"numerics": {"transport": anything}}):
        try:
            made = parse_scene(tables, "drawn", "drawn.toml")
        except SceneError as error:
            assert str(error).startswith("drawn.toml: ") and str(error).isprintable() and len(str(error)) < 500
        else:
            assert 0 < made.pore.width < math.inf and parse_scene(scene_tables(made), "drawn", "again") == made
    try:
        load_scene("base", [f"pore.width={anything}"])
    except SceneError as error:
        assert str(error).startswith("base: ") and str(error).isprintable()


def test_round_trip_of_every_packaged_scene():
    """And of one with every section, as empty as it may be, with each preset and all that it chose spelt out."""
    given = [EVERYTHING | {"numerics": {"preset": preset, "refinement": 0.77}} for preset in PRESETS]
    made = [parse_scene(tables, "everything", "mine.toml") for tables in (EVERYTHING, *given)]
    for scene in (*made, *map(load_scene, packaged_scenes())):
        assert parse_scene(scene_tables(scene), scene.name, "again") == scene


@given(st.floats(1e-300, 1e300), st.floats(0, math.pi / 2, exclude_min=True, exclude_max=True), st.floats(0, 1e300))
def test_round_trip_is_exact(size, angle, velocity):
    """At any magnitude."""
    tables = {
        "pore": {"width": f"{10 * size!r} um", "length": f"{100 * size!r} um"},
        "aggregate": {"radius": f"{size!r} um"},
        "flow": {"mean_velocity": f"{velocity!r} um/h", "viscosity_ratio": size},
        "substrates": {"acceptor": {}, "donor": {"diffusivity": f"{size!r} um^2/h", "supply": f"{velocity!r} mg/L"}},
        "growth": {"end": f"{velocity!r} h", "minimum_contact_angle": f"{angle!r} rad",
                   "time_step": f"{max(velocity, 1e-6)!r} h", "minimum_film": f"{size!r} um"},
        "numerics": {"preset": "paper", "transport": "gear"},
        "output": {"times": [f"{velocity!r} h"]},
    }
    scene = parse_scene(tables, "drawn", "drawn")
    assert (scene.aggregate.radius, scene.growth.minimum_contact_angle) == (size, angle)
    assert (scene.substrates.donor.supply, scene.output.times) == (velocity, (velocity,))
    assert parse_scene(scene_tables(scene), "drawn", "again") == scene


def test_tables_spell_out_every_default_and_nothing_absent():
    assert set(scene_tables(load_scene("flow_only"))) == {"pore", "aggregate", "flow", "numerics", "output"}
    assert scene_tables(load_scene("base"))["growth"]["minimum_film"] == "2.0 um"
    assert "mean_velocity" not in scene_tables(load_scene("base"))["flow"]


def test_hash_is_of_what_is_said_not_of_how(tmp_path):
    base = load_scene("base")
    same = load_scene("base", ["growth.end=1164 min", "flow.viscosity_ratio=2000", "kinetics.yield_coefficient=0.61"])
    renamed = dataclasses.replace(base, name="another")
    assert scene_hash(base) == scene_hash(same) == scene_hash(renamed)
    zeros = [load_scene("base", [f"kinetics.degradable_fraction={zero}"]) for zero in ("0", "-0.0")]
    assert scene_hash(zeros[0]) == scene_hash(zeros[1])
    assert len(scene_hash(base)) == 16 and int(scene_hash(base), 16) >= 0


@pytest.mark.parametrize("override", [
    "growth.end=19.2 h",
    "numerics.transport=gear",
    "substrates.donor.supply=9 mg/L",
    'output.times=["1 h"]',
    "kinetics.acceptor_to_donor_ratio=1.5138",
])
def test_hash_changes_with_every_part(override):
    assert scene_hash(load_scene("base", [override])) != scene_hash(load_scene("base"))
