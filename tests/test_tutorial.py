"""The tutorial works as it stands: its commands, its scene and its Python, one after the other in one folder."""

import re
from pathlib import Path

import matplotlib.pyplot as plt
import pytest

from repro.scene import load_scene
from tests.blocks import ROOT, blocks, execute, is_repro, told

PAGE = ROOT / "docs" / "tutorial.md"


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("tutorial")


def test_the_tutorial_works_from_its_first_line_to_its_last(folder, capsys, monkeypatch):
    monkeypatch.chdir(folder)
    printed, statuses = [], []
    names: dict = {}
    for block in blocks(PAGE):
        if block.language == "toml":
            Path(re.match(r"# (\S+)\n", block.text)[1]).write_text(block.text)
        elif block.language == "python":
            exec(compile(block.text, str(PAGE), "exec"), names)
        for words in block.commands:
            assert is_repro(words), words
            status, out, err = execute(words, capsys)
            printed.append(out)
            statuses.append(status)
            assert [err.strip()] == told(block) if status else told(block) == [], err
    plt.close("all")
    assert statuses == [0, 0, 0, 0, 0, 0, 2, 0, 0, 0, 0]
    assert load_scene("mine.toml").pore == load_scene("base").pore
    assert (folder / "runs" / "narrow" / "timeseries.csv").exists() and (folder / "oxygen.png").stat().st_size > 1000
    assert "WARNING" not in printed[3] and "WARNING growth.end" in printed[4]
