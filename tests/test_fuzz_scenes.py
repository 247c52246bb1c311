"""Malformed scenes: each is a scene after all, or is refused in one printable line, and nothing is written.

2000 of them in the thorough profile: a quarter of it a kind.
"""

import io
import json
import math
import os
import string
import subprocess
import sys
import tomllib
from contextlib import redirect_stderr, redirect_stdout

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from repro.cli import main
from repro.scene import KEYS, SceneError, load_scene, packaged_scenes, parse_scene, scene_tables
from repro.scene.text import scene_text
from tests.blocks import ROOT

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


def check_line(message: str, file: str) -> None:
    """Is a refusal one printable line of bearable length that names the file?"""
    assert message.startswith(f"{file}: ") and message.isprintable() and len(message) < 700, message


def check_judged(load, file: str) -> None:
    """It loads, to a scene that is read back from what it writes, or raises SceneError."""
    try:
        made = load()
    except SceneError as error:
        check_line(str(error), file)
    else:
        assert parse_scene(scene_tables(made), made.name, "again") == made


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
def test_the_command_line_refuses_in_one_line_and_writes_nothing(folder, content, command):
    """Exit status 2 and a line, where the file is no scene."""
    file, out = folder / "line.toml", folder / "out"
    file.write_bytes(content)
    try:
        load_scene(file)
    except SceneError as error:
        arguments = [command, str(file), *(["--out", str(out)] if command == "run" else [])]
        assert refused(arguments) == f"repro: {error}\n"
        assert sorted(path.name for path in folder.iterdir()) in (["line.toml"], ["line.toml", "mine.toml"])


def refused(arguments: list[str]) -> str:
    """What the command line says on stderr; it says nothing else, and exits with 2."""
    out, err = io.StringIO(), io.StringIO()
    with redirect_stdout(out), redirect_stderr(err):
        assert main(arguments) == 2
    assert out.getvalue() == "" and err.getvalue().count("\n") == 1
    return err.getvalue()


@pytest.mark.parametrize("content", [b"\xff\xfe", b"[pore]\nwidth = 50 um\n", b'[pore]\nwidth = "\\u001b[2J\\u00b5"\n'])
def test_a_process_of_its_own_says_the_same(tmp_path, content):
    """With the bytes of its stderr: one line, printable in ASCII where the terminal knows no more."""
    (tmp_path / "mine.toml").write_bytes(content)
    environment = {**os.environ, "PYTHONIOENCODING": "ascii:backslashreplace", "PYTHONPATH": str(ROOT)}
    done = subprocess.run([sys.executable, "-m", "repro", "run", "mine.toml", "--out", "out"], cwd=tmp_path,
                          capture_output=True, env=environment, check=False)
    assert done.returncode == 2 and done.stdout == b"" and done.stderr.startswith(b"repro: mine.toml: ")
    assert done.stderr.count(b"\n") == 1 and done.stderr.decode("ascii").strip().isprintable()
    assert [path.name for path in tmp_path.iterdir()] == ["mine.toml"]
