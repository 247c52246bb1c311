"""Scenes written and read again, in any units, and anything else that is read: the same scene, or one clear line.

Malformed scenes are refused in a printable line, and nothing is written: 2000 of them in the thorough profile, a
quarter of it a kind.
"""
import dataclasses
import json
import math
import os
import string
import subprocess
import sys
import tomllib
from decimal import Decimal, localcontext

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from repro.scene import KEYS, PRESETS, SceneError, load_scene, packaged_scenes, parse_scene, scene_hash, scene_tables
from repro.scene.text import scene_text
from tests.blocks import ROOT
from tests.shell import refused as refused_by_command
from tests.strategies import scenes
from tests.test_scene import EVERYTHING

#: How many of another unit an internal unit is, an exact decimal, worked out by hand; units one by one are in
#: tests/test_scene.py.
OTHER_UNITS = {"um": "1e-4 cm", "h": "3600 s", "um/h": "24e-6 m/day", "um^2/h": "24e-6 mm**2 / day",
               "um/h^2": "576e-6 m/day^2", "1/h": "24 day^-1", "mg/L": "1e-3 kg/m^3", "MPa": "1e3 kPa",
               "rad": "1 radian"}
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


def check_line(message, file):
    """Is a refusal one printable line of bearable length that names the file?"""
    assert message.startswith(f"{file}: ") and message.isprintable() and len(message) < 500 + len(file), message


def refused(tables):
    """The line in which the tables are refused."""
    with pytest.raises(SceneError) as caught:
        parse_scene(tables, "drawn", "drawn.toml")
    check_line(str(caught.value), "drawn.toml")
    return str(caught.value)


@given(scenes())
def test_a_scene_in_other_units_is_the_same_scene(made):
    """Written out, rewritten number by number in other units with exact decimals, and read back: equal bit by bit, and
    with the same hash."""
    tables = scene_tables(made)
    assert parse_scene(tables, made.name, "again") == made
    for path, value in list(leaves(tables)):
        if isinstance(value, str) and value[0].isdigit():
            digits, unit = value.split(" ", 1)
            factor, other = OTHER_UNITS[unit].split(" ", 1)
            with localcontext(prec=60):
                tables = changed(tables, path, f"{Decimal(digits) * Decimal(factor)} {other}")
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
    assert ".".join(path) in refused(changed(tables, path, bad))


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
        assert "there is no such key" in refused(changed(tables, (*where, name), "5 um"))


KNOWN_BUT_ABSENT = {"head", "mean_velocity", "outline", "times", "aggregate", "flow", "substrates", "kinetics",
                    "growth", "output", "donor_oxygen_demand"}


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
        "substrates": {"acceptor": {}, "donor": {"supply": f"{velocity!r} mg/L"}},
        "growth": {"end": f"{velocity!r} h", "minimum_contact_angle": f"{angle!r} rad",
                   "time_step": f"{max(velocity, 1e-6)!r} h", "minimum_film": f"{size!r} um"},
        "numerics": {"preset": "paper", "transport": "gear"},
    }
    scene = parse_scene(tables, "drawn", "drawn")
    assert (scene.aggregate.radius, scene.growth.minimum_contact_angle) == (size, angle)
    assert (scene.substrates.donor.supply, scene.growth.end) == (velocity, velocity)
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


# ---------------------------------------------------------------- malformed scenes

EACH = 500 if os.environ.get("HYPOTHESIS_PROFILE") == "thorough" else 25
FUZZ = settings(max_examples=EACH, suppress_health_check=[HealthCheck.too_slow, HealthCheck.function_scoped_fixture])
TEXTS = {name: scene_text(name) for name in packaged_scenes()}
PIECES = [b"", b"\n", b"[", b"]", b'"', b"= ", b"\xff", b"\x00", b"[" * 3000, b"a." * 3000 + b"b = 1\n"]
LEAVES = sorted(key for key in KEYS if "." in key)

controls = st.text(st.characters(max_codepoint=0x20) | st.sampled_from("\x7f\x85\u2028\u202e\ufeff\x9b[31m\"'\\#=.,"))
huge = st.sampled_from([10**400, -(10**400), 1e308, -1e308, 5e-324, math.inf, -math.inf, math.nan, 2**63, -0.0])
units = st.sampled_from(["um", "h", "1/day", "m/day", "mg/L", "MPa", "deg", "K", "um^9", "ell", "", "%", "um um um"])
quantities = st.builds(lambda number, unit: f"{number} {unit}", huge | st.floats() | st.integers(), units)
long = st.builds(lambda letter, count: letter * count, st.sampled_from(["9", "a", "\u00b5", "[", "-", "1e9"]),
                 st.integers(80, 20_000))
texts = st.text(max_size=40) | controls | quantities | long
plain = st.none() | st.booleans() | st.integers() | st.floats() | huge | texts
values = st.recursive(plain, lambda inner: st.lists(inner, max_size=3) | st.dictionaries(
    st.text(max_size=9) | st.sampled_from(LEAVES), inner, max_size=3), max_leaves=8)


def check_judged(load, file):
    """It loads, to a scene that is read back from what it writes, or raises SceneError."""
    try:
        made = load()
    except SceneError as error:
        check_line(str(error), file)
    else:
        assert 0 < made.pore.width < math.inf and parse_scene(scene_tables(made), made.name, "again") == made


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("fuzz")


@st.composite
def garbled(draw):
    """The bytes of a scene that has been cut, joined, repeated, overwritten, or that never was one."""
    text = draw(st.sampled_from(sorted(TEXTS.values()))).encode()
    for _ in range(draw(st.integers(1, 4))):
        start = draw(st.integers(0, len(text)))
        end = draw(st.integers(start, min(len(text), start + 400)))
        fixed = st.sampled_from([*PIECES, text[start:end] * 2])
        text = text[:start] + draw(st.binary(max_size=20) | controls.map(str.encode) | fixed) + text[end:]
    return draw(st.just(text) | st.binary(max_size=200))


@st.composite
def misshapen(draw):
    """The tables of a scene in which a few keys, known ones or not, hold what they should not."""
    tables = tomllib.loads(TEXTS[draw(st.sampled_from(sorted(TEXTS)))])
    for _ in range(draw(st.integers(1, 3))):
        key = draw(st.sampled_from([*KEYS, *LEAVES]) | st.text(string.ascii_letters + "._ \n\u00e9", min_size=1))
        table, path = tables, key.split(".")
        for part in path[:-1]:
            table = table.setdefault(part, {}) if isinstance(table.get(part, {}), dict) else {}
        table[path[-1]] = draw(values)
    return tables


@FUZZ
@given(garbled())
def test_a_file_of_any_bytes(folder, content):
    file = folder / "mine.toml"
    file.write_bytes(content)
    check_judged(lambda: load_scene(file), str(file))


@FUZZ
@given(misshapen())
def test_tables_of_any_shape(tables):
    """Wrong types, keys, units, nesting, magnitudes."""
    check_judged(lambda: parse_scene(tables, "mine", "mine.toml"), "mine.toml")


@FUZZ
@given(st.lists(st.builds(lambda key, equals, value: f"{key}{equals}{value}",
                          st.sampled_from([*KEYS, "", ".", "pore.width.deep.er", "a" * 300]) | st.text(max_size=20),
                          st.sampled_from(["=", "=", "=", "", "=="]),
                          plain | values.map(lambda value: shown(value)) | st.sampled_from(["fast", "80 um", "1 h"])),
                min_size=1, max_size=3))
def test_any_set(entries):
    check_judged(lambda: load_scene("base", entries), "base")


def shown(value: object) -> str:
    try:
        return json.dumps(value)
    except ValueError:
        return str(type(value))


@FUZZ
@given(garbled(), st.sampled_from(["run", "scene", "check"]))
def test_the_command_line_refuses_in_one_line_and_writes_nothing(capsys, folder, content, command):
    """Where the file is no scene."""
    file = folder / "line.toml"
    file.write_bytes(content)
    try:
        load_scene(file)
    except SceneError as error:
        target = ["--out", folder / "out"] if command == "run" else []
        assert refused_by_command(folder, capsys, command, file, *target) == f"repro: {error}\n"


def test_a_process_of_its_own_says_the_same(tmp_path):
    """With the bytes of its stderr: one line, printable in ASCII where the terminal knows no more."""
    (tmp_path / "mine.toml").write_bytes(b'[pore]\nwidth = "\\u001b[2J\\u00b5"\n')
    environment = {**os.environ, "PYTHONIOENCODING": "ascii:backslashreplace", "PYTHONPATH": str(ROOT)}
    done = subprocess.run([sys.executable, "-m", "repro", "run", "mine.toml", "--out", "out"], cwd=tmp_path,
                          capture_output=True, env=environment, check=False)
    assert done.returncode == 2 and done.stdout == b"" and done.stderr.startswith(b"repro: mine.toml: ")
    assert done.stderr.count(b"\n") == 1 and done.stderr.decode("ascii").strip().isprintable()
    assert [path.name for path in tmp_path.iterdir()] == ["mine.toml"]
