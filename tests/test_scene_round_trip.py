"""Scenes written and read again, in any units, and anything else that is read: the same scene, or one clear line.

Malformed scenes are refused in a printable line, and nothing is written: 2000 of them in the thorough profile, a
third of it a kind.
"""
import math
import os
import string
import tomllib
from dataclasses import replace
from decimal import Decimal, localcontext

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from repro.scene import KEYS, SceneError, load_scene, packaged_scenes, parse_scene, scene_hash, scene_tables, text
from tests.shell import refused as refused_by_command
from tests.strategies import scenes
from tests.test_scene_text import parsed

#: How many of another unit an internal unit is, an exact decimal, worked out by hand; units one by one are in
#: tests/test_scene.py.
OTHER_UNITS = {"um": "1e-4 cm", "h": "3600 s", "um/h": "24e-6 m/day", "um^2/h": "24e-6 mm**2 / day",
               "um/h^2": "576e-6 m/day^2", "1/h": "24 day^-1", "mg/L": "1e-3 kg/m^3", "MPa": "1e3 kPa",
               "rad": "1 radian"}


def in_other_units(value):
    """Tables, with each number that has a unit in another one, by exact decimals."""
    if isinstance(value, dict):
        return {key: in_other_units(inner) for key, inner in value.items()}
    if not isinstance(value, str) or not value[0].isdigit():
        return value
    digits, unit = value.split(" ", 1)
    factor, other = OTHER_UNITS[unit].split(" ", 1)
    with localcontext(prec=60):
        return f"{Decimal(digits) * Decimal(factor)} {other}"


@given(scenes())
def test_a_scene_in_other_units_is_the_same_scene(made):
    """Written out, as tables and as text, rewritten number by number in other units with exact decimals, and read back:
    equal bit by bit, and with the same hash."""
    tables = scene_tables(made)
    assert parse_scene(tables, made.name, "again") == made
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(text, "load_tables", lambda source, overrides, unset: scene_tables(made))
        assert parsed(text.scene_text("drawn"), "drawn") == made
    again = parse_scene(in_other_units(tables), made.name, "again")
    assert again == made and scene_hash(again) == scene_hash(made)


def test_hash_is_of_what_is_said_not_of_how():
    base, zero, below = (load_scene("base", [f"kinetics.degradable_fraction={part}"]) for part in ("0.8", "0", "-0.0"))
    assert scene_hash(base) == scene_hash(replace(base, name="another")) and scene_hash(zero) == scene_hash(below)
    assert len(scene_hash(base)) == 16 and int(scene_hash(base), 16) >= 0


# ---------------------------------------------------------------- malformed scenes

EACH = 700 if os.environ.get("HYPOTHESIS_PROFILE") == "thorough" else 25
FUZZ = settings(max_examples=EACH, suppress_health_check=[HealthCheck.too_slow, HealthCheck.function_scoped_fixture])
TEXTS = [text.scene_text(name) for name in packaged_scenes()]
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
    """It loads, to a scene that is read back from what it writes, or raises SceneError: one printable line of bearable
    length that names the file, which is returned."""
    try:
        made = load()
    except SceneError as error:
        message = str(error)
        assert message.startswith(f"{file}: ") and message.isprintable() and len(message) < 500 + len(file), message
        return message
    assert 0 < made.pore.width < math.inf and parse_scene(scene_tables(made), made.name, "again") == made
    return ""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("fuzz")


@st.composite
def garbled(draw):
    """The bytes of a scene that has been cut, joined, repeated, overwritten, or that never was one."""
    content = draw(st.sampled_from(TEXTS)).encode()
    for _ in range(draw(st.integers(1, 4))):
        start = draw(st.integers(0, len(content)))
        end = draw(st.integers(start, min(len(content), start + 400)))
        fixed = st.sampled_from([*PIECES, content[start:end] * 2])
        content = content[:start] + draw(st.binary(max_size=20) | controls.map(str.encode) | fixed) + content[end:]
    return draw(st.just(content) | st.binary(max_size=200))


@st.composite
def misshapen(draw):
    """The tables of a scene in which a few keys, known ones or not, hold what they should not."""
    tables = tomllib.loads(draw(st.sampled_from(TEXTS)))
    for _ in range(draw(st.integers(1, 3))):
        key = draw(st.sampled_from([*KEYS, *LEAVES]) | st.text(string.ascii_letters + "._ \n\u00e9", min_size=1))
        table, path = tables, key.split(".")
        for part in path[:-1]:
            table = table.setdefault(part, {}) if isinstance(table.get(part, {}), dict) else {}
        table[path[-1]] = draw(values)
    return tables


@FUZZ
@given(garbled(), st.sampled_from(["run", "scene", "check"]))
def test_a_file_of_any_bytes(capsys, folder, content, command):
    """What is no scene is refused by the command line in the same line, and nothing is written."""
    file = folder / "mine.toml"
    file.write_bytes(content)
    refused = check_judged(lambda: load_scene(file), str(file))
    if refused:
        target = ["--out", folder / "out"] if command == "run" else []
        assert refused_by_command(folder, capsys, command, file, *target) == f"repro: {refused}\n"


@FUZZ
@given(misshapen())
def test_tables_of_any_shape(tables):
    """Wrong types, keys, units, nesting, magnitudes."""
    check_judged(lambda: parse_scene(tables, "mine", "mine.toml"), "mine.toml")


@FUZZ
@given(st.lists(st.builds("{}{}{}".format, st.sampled_from([*KEYS, "", ".", "pore.width.deep.er", "a" * 300]) | texts,
                          st.sampled_from(["=", "=", "=", "", "=="]), values), min_size=1, max_size=3))
def test_any_set(entries):
    check_judged(lambda: load_scene("base", entries), "base")
