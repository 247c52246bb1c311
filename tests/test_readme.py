"""What the README shows works as it stands."""

import re
import tomllib
from pathlib import Path

from repro.scene import load_scene, parse_scene

README = (Path(__file__).parents[1] / "README.md").read_text(encoding="utf-8")


def block(language: str) -> str:
    return re.search(rf"```{language}\n(.*?)```", README, re.DOTALL)[1]


def test_the_python_example_runs(capsys):
    exec(compile(block("python"), "README.md", "exec"), {})
    lines = [line.split() for line in capsys.readouterr().out.splitlines()]
    assert [float(line[0]) for line in lines] == [0.0, 0.2, 0.4]
    assert float(lines[0][2]) == 5.0 < float(lines[-1][2])


def test_the_scene_example_is_base():
    """Mutant: an example that drifts from the packaged scene or names a key that is gone."""
    scene = parse_scene(tomllib.loads(block("toml")), "base", "README.md")
    assert scene == load_scene("base")


def test_the_commands_are_targets_of_the_makefile():
    makefile = (Path(__file__).parents[1] / "Makefile").read_text(encoding="utf-8")
    commands = set(re.findall(r"`make (\w+)`", README))
    assert {"figures", "test", "claims", "verify", "bench"} <= commands
    assert all(re.search(rf"^{command}:", makefile, re.MULTILINE) for command in commands)
