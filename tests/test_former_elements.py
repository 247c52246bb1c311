"""Folders of runs with cubic elements, which earlier versions had: their fields have the nodes of curved triangles."""
import shutil

import pytest

import repro
from repro.cli import main
from tests.pages import cached_run
from tests.shell import read_record, refusal, rewrite

SCENE = repro.load_scene("base", ["numerics.preset=fast", "growth.end=0.4 h"])


@pytest.fixture
def cubic(tmp_path):
    """The folder of a run on quadratic elements whose record names cubic ones. They have the same files."""
    folder = tmp_path / "cubic"
    shutil.copytree(cached_run(SCENE), folder)
    tables = read_record(folder)["tables"]
    rewrite(folder, tables={**tables, "numerics": {**tables["numerics"], "elements": "cubic"}})
    return folder


def test_a_run_with_cubic_elements_loads_plots_and_compares(cubic, tmp_path):
    results = repro.load_run(cubic)
    assert results.fields(results.time[-1])["triangles"].shape[1] == 6
    page = tmp_path / "both.html"
    for command in (["plot", cubic, "--out", tmp_path / "curves.svg"],
                    ["plot", cubic, "velocity", "--time", "0.4 h", "--out", tmp_path / "field.svg"],
                    ["compare", cubic, cached_run(SCENE), "--out", page], ["check", cubic]):
        assert main([*map(str, command)]) == 0
    assert "numerics.elements" in page.read_text() and "cubic" in page.read_text()


def test_a_run_with_cubic_elements_does_not_go_on(cubic, tmp_path, capsys):
    assert ('numerics.elements = "cubic": this key was removed; leave it out'
            in refusal(tmp_path, capsys, "run", "--resume", cubic))
