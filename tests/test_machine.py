"""What a run needs of the machine that it is on: packages, memory."""

import sys

import pytest

from repro.cli import main
from repro.errors import Interrupted
from repro.fem import linear
from repro.run import machine
from repro.run.running import Watch, resume, run
from repro.scene import SceneError, load_scene

CHOICES = [("numerics.solver=pardiso", "pypardiso"), ("numerics.ordering=metis", "pymetis")]


@pytest.mark.parametrize("entry, package", CHOICES)
@pytest.mark.parametrize("command", [["run", "base"], ["sweep", "base", "--vary", "pore.width=50 um, 60 um"]])
def test_a_package_that_is_not_there_is_told_before_anything_is_written(tmp_path, capsys, monkeypatch, command, entry,
                                                                        package):
    """One line, status 2, no folder. Mutants: a traceback, a run that fails with files."""
    monkeypatch.setitem(sys.modules, package, None)
    assert main([*command, "--set", entry, "--out", str(tmp_path / "out")]) == 2
    out, err = capsys.readouterr()
    key, _, choice = entry.partition("=")
    assert f'base: {key} = "{choice}": the package {package} is not installed; pip install {package}' in err
    assert err.count("\n") == 1 and out == "" and list(tmp_path.iterdir()) == []


def test_a_package_that_went_is_told_at_a_resume(tmp_path, monkeypatch):
    """Mutant: a traceback at the first linear system."""
    scene = load_scene("base", ("numerics.preset=fast", "numerics.ordering=metis"))
    with monkeypatch.context() as there:
        there.setattr(machine, "find_spec", lambda name: name)
        there.setattr(linear, "use", lambda *_: None)
        with pytest.raises(Interrupted):
            run(scene, tmp_path, watch=Watch(stop=lambda: 15))
    monkeypatch.setitem(sys.modules, "pymetis", None)
    with pytest.raises(SceneError, match="pymetis is not installed"):
        resume(tmp_path)
