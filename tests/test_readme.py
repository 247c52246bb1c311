"""What the README and the tutorial show works as it stands: every block of commands, of TOML and of Python."""

import re
import tomllib
from pathlib import Path

import matplotlib.pyplot as plt

from repro.scene import load_scene, parse_scene
from tests.blocks import ROOT, blocks, execute, is_repro, is_target, told

PAGE = ROOT / "README.md"
TUTORIAL = ROOT / "docs" / "tutorial.md"
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
    others = [page for page in sorted((ROOT / "docs").glob("*.md")) if page != TUTORIAL]
    assert len(others) >= 3 and [page.name for page in others if "```" in page.read_text(encoding="utf-8")] == []


def test_the_scene_example_is_base():
    (text,) = of("toml")
    assert parse_scene(tomllib.loads(text), "base", "README.md") == load_scene("base")


def test_the_commands_are_targets_of_the_makefile():
    commands = set(re.findall(r"`make ([\w-]+)`", PAGE.read_text(encoding="utf-8")))
    assert {"figures", "test", "claims", "verify", "bench"} <= commands
    assert all(is_target(["make", command]) for command in commands)


def test_the_tutorial_works_from_its_first_line_to_its_last(tmp_path, capsys, monkeypatch):
    """Its commands, its scene and its Python, one after the other in one folder."""
    monkeypatch.chdir(tmp_path)
    printed, statuses = [], []
    names: dict = {}
    for block in blocks(TUTORIAL):
        if block.language == "toml":
            Path(re.match(r"# (\S+)\n", block.text)[1]).write_text(block.text)
        elif block.language == "python":
            exec(compile(block.text, str(TUTORIAL), "exec"), names)
        for words in block.commands:
            assert is_repro(words), words
            status, out, err = execute(words, capsys)
            printed.append(out)
            statuses.append(status)
            assert [err.strip()] == told(block) if status else told(block) == [], err
    plt.close("all")
    assert statuses == [0, 0, 0, 0, 0, 0, 2, 0, 0, 0, 0]
    assert load_scene("mine.toml").pore == load_scene("base").pore
    assert (tmp_path / "runs" / "narrow" / "timeseries.csv").exists()
    assert (tmp_path / "oxygen.png").stat().st_size > 1000
    assert "WARNING" not in printed[3] and "WARNING growth.end" in printed[4]
