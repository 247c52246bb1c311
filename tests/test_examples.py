"""The scripts of the site's notebooks run, and their own checks hold."""

import runpy

import pytest

from tests.blocks import ROOT

SCRIPTS = sorted(path.stem for path in (ROOT / "docs" / "examples").glob("*.py"))
#: Scripts of many runs.
LONG = {"calibrate", "sweep"}


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=[pytest.mark.thorough] * (name in LONG)) for name in SCRIPTS])
def test_an_example_runs(name, monkeypatch, tmp_path):
    monkeypatch.setenv("MPLBACKEND", "Agg")
    monkeypatch.chdir(tmp_path)
    script = ROOT / "docs" / "examples" / f"{name}.py"
    assert "\nassert " in script.read_text(encoding="utf-8")
    runpy.run_path(str(script), run_name="__main__")
