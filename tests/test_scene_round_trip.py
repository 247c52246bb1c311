"""Scenes are written and read back unchanged; malformed scenes are refused in one printable line.

Nothing is written for a malformed scene. The thorough profile tries 2000 of them, a third of each kind.
"""
import math
import os
import string
import tomllib
from dataclasses import replace

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from repro.scene import KEYS, SceneError, load_scene, packaged_scenes, parse_scene, scene_hash, scene_tables, text
from tests.shell import refusal as refused_by_command
from tests.strategies import scenes
from tests.test_scene_text import parsed


@given(scenes())
def test_a_scene_is_read_back_from_tables_and_text(scene):
    """It is equal to the last bit, with its scheme, which no table states. The case coupling-foreign-units tests other
    units."""
    assert parse_scene(scene_tables(scene), scene.name, "again", scheme=scene.numerics.exchanged) == scene
    scene = parse_scene(scene_tables(scene), scene.name, "again")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(text, "load_tables", lambda source, overrides, unset: scene_tables(scene))
        assert parsed(text.scene_text("drawn"), "drawn") == scene


def test_the_hash_depends_on_values_alone():
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


def check_loads_or_refuses(load, file):
    """Check that a scene loads and is read back unchanged, or raises SceneError with one printable line of limited
    length that names the file. Return that line, or an empty text."""
    try:
        scene = load()
    except SceneError as error:
        message = str(error)
        assert message.startswith(f"{file}: ") and message.isprintable() and len(message) < 500 + len(file), message
        return message
    assert 0 < scene.pore.width < math.inf and parse_scene(scene_tables(scene), scene.name, "again") == scene
    return ""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("fuzz")


@st.composite
def garbled(draw):
    """The bytes of a scene after cuts, insertions and repetitions, or random bytes."""
    content = draw(st.sampled_from(TEXTS)).encode()
    for _ in range(draw(st.integers(1, 4))):
        start = draw(st.integers(0, len(content)))
        end = draw(st.integers(start, min(len(content), start + 400)))
        fixed = st.sampled_from([*PIECES, content[start:end] * 2])
        content = content[:start] + draw(st.binary(max_size=20) | controls.map(str.encode) | fixed) + content[end:]
    return draw(st.just(content) | st.binary(max_size=200))


@st.composite
def misshapen(draw):
    """The tables of a scene in which a few keys, known or unknown, have wrong values."""
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
def test_a_file_of_any_bytes_loads_or_is_refused(capsys, folder, content, command):
    """The command line refuses a file that is no scene with the same line, and writes nothing."""
    file = folder / "mine.toml"
    file.write_bytes(content)
    refused = check_loads_or_refuses(lambda: load_scene(file), str(file))
    if refused:
        target = ["--out", folder / "out"] if command == "run" else []
        assert refused_by_command(folder, capsys, command, file, *target) == f"repro: {refused}\n"


@FUZZ
@given(misshapen())
def test_tables_of_any_shape_load_or_are_refused(tables):
    """Wrong types, keys, units, nesting, magnitudes."""
    check_loads_or_refuses(lambda: parse_scene(tables, "mine", "mine.toml"), "mine.toml")


@FUZZ
@given(st.lists(st.builds("{}{}{}".format, st.sampled_from([*KEYS, "", ".", "pore.width.deep.er", "a" * 300]) | texts,
                          st.sampled_from(["=", "=", "=", "", "=="]), values), min_size=1, max_size=3))
def test_any_entry_of_set_loads_or_is_refused(entries):
    check_loads_or_refuses(lambda: load_scene("base", entries), "base")
