"""What the README shows works as it stands: every block of commands, of TOML and of Python."""

import re
import tomllib

from repro.scene import load_scene, parse_scene
from tests.blocks import ROOT, blocks, execute, is_repro, is_target

PAGE = ROOT / "README.md"
BLOCKS = blocks(PAGE)


def of(language: str) -> list[str]:
    return [block.text for block in BLOCKS if block.language == language]


def test_every_block_is_of_a_kind_that_is_executed():
    assert {block.language for block in BLOCKS} <= {"", "console", "sh", "python", "toml"}
    assert all(is_repro(words) or is_target(words) for block in BLOCKS for words in block.commands)


def test_the_commands_run(tmp_path, capsys, monkeypatch):
    """In the order of the page, in one folder."""
    monkeypatch.chdir(tmp_path)
    commands = [words for block in BLOCKS for words in block.commands if is_repro(words)]
    assert {"run", "scene", "check"} <= {words[1] for words in commands}
    for words in commands:
        assert execute(words, capsys)[0] == 0, words
    assert {path.name for path in (tmp_path / "runs").iterdir()} >= {"base", "mine"}


def test_the_python_examples_run(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    printed = []
    for text in of("python"):
        exec(compile(text, str(PAGE), "exec"), {})
        printed.append(capsys.readouterr().out.splitlines())
    (arrays,) = printed
    assert arrays[0].split()[1] == "m/d" and 160 < float(arrays[0].split()[0]) < 175 and arrays[1] == "(783,)"


def test_the_page_is_short_and_the_others_show_nothing_that_is_not_executed():
    """Two commands, a picture and a pore of one's own come first."""
    text = PAGE.read_text(encoding="utf-8")
    assert len(text.encode()) < 12_000 and text.index("overview.png") < text.index("make env") < 2_500
    others = [page for page in sorted((ROOT / "docs").glob("*.md")) if page.name != "tutorial.md"]
    assert len(others) >= 3 and [page.name for page in others if "```" in page.read_text(encoding="utf-8")] == []


def test_the_scene_example_is_base():
    (text,) = of("toml")
    assert parse_scene(tomllib.loads(text), "base", "README.md") == load_scene("base")


def test_the_commands_are_targets_of_the_makefile():
    commands = set(re.findall(r"`make ([\w-]+)`", PAGE.read_text(encoding="utf-8")))
    assert {"figures", "test", "claims", "verify", "bench"} <= commands
    assert all(is_target(["make", command]) for command in commands)
