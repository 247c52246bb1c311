"""A run into a folder that holds one already: gone on with, left alone, refused, or replaced where it is asked for."""

import pytest

from repro import results
from repro.cli import main
from repro.run import machine, running
from repro.run.checkpoint import NEWEST, PREVIOUS
from repro.run.running import run
from repro.scene import load_scene
from tests import faults
from tests.shell import as_whole, files, flags, lasting, state, stopped, told

FAST = ('numerics.preset="fast"', 'growth.end="3 h"')
SETS, SCENE = flags(*FAST), load_scene("base", FAST)


def refused(folder, capsys, *arguments):
    """What is said of a run that is refused, with status 2 and one line, and changes nothing."""
    before = state(folder)
    assert main(["run", *arguments, "--out", str(folder)]) == 2
    message = capsys.readouterr().err
    assert message.count("\n") == 1 and state(folder) == before
    return message


def test_a_run_that_is_done_is_left_alone(tmp_path, capsys):
    """The same command again, or a resume: exit 0, says so, nothing is computed or written."""
    arguments = ["run", "base", *SETS, "--out", str(tmp_path / "run")]
    assert main(arguments) == 0
    before = state(tmp_path / "run")
    for again in (arguments, ["run", "--resume", str(tmp_path / "run")]):
        capsys.readouterr()
        assert main(again) == 0
        assert "completed, before this: nothing to do" in capsys.readouterr().out and state(tmp_path / "run") == before


def test_a_run_that_was_interrupted_is_gone_on_with(tmp_path, capsys):
    """From its state, to the bits of the whole run."""
    stopped(SCENE, tmp_path / "run")
    assert main(["run", "base", *SETS, "--out", str(tmp_path / "run")]) == 0
    assert "goes on from t = " in capsys.readouterr().err
    assert as_whole(SCENE, tmp_path / "run")
    assert told(tmp_path / "run")["resumes"][0]["time_h"] > 0


def test_a_run_that_had_no_state_yet_begins_again(tmp_path, capsys):
    stopped(SCENE, tmp_path / "run")
    for name in (NEWEST, PREVIOUS):
        (tmp_path / "run" / name).unlink()
    assert main(["run", "base", *SETS, "--out", str(tmp_path / "run")]) == 0
    assert "it starts again from t = 0" in capsys.readouterr().err


def test_another_scene_is_refused_with_what_differs(tmp_path, capsys):
    """By key, with both values."""
    stopped(SCENE, tmp_path / "run")
    message = refused(tmp_path / "run", capsys, "base", "--set", FAST[0], "--set", "growth.end=4 h")
    assert "growth.end (3.0 h there, now 4.0 h)" in message and "--force" in message
    assert "flow.mean_velocity (not set there" in refused(tmp_path / "run", capsys, "flow_only")
    assert "growth (a section there, now not set)" in refused(tmp_path / "run", capsys, "flow_only")


@pytest.mark.parametrize("key", ["source", "versions.scipy"])
def test_other_versions_are_refused_with_what_differs(tmp_path, capsys, monkeypatch, key):
    """Of a run that is over, and of one that is not."""
    run(SCENE, tmp_path / "done")
    stopped(SCENE, tmp_path / "run")
    if key == "source":
        monkeypatch.setattr(machine, "source_hash", lambda: "01234567")
    else:
        faults.another_version(monkeypatch, "scipy")
    for name in ("run", "done"):
        assert f"the run there is another one: {key} (" in refused(tmp_path / name, capsys, "base", *SETS)


def test_a_forced_run_removes_what_is_listed_and_nothing_else(tmp_path):
    """Files that others have put beside the run's, and what a link leads to, stay."""
    out = tmp_path / "run"
    run(load_scene("base", ('numerics.preset="fast"', 'growth.end="6 h"')), out)
    (tmp_path / "victim").write_text("years of work")
    record = told(out)
    results.write_json(out / "run.json", record | {"files": [*record["files"], "../victim", "link.txt", "notes.txt"]})
    (out / "link.txt").symlink_to(tmp_path / "victim")
    mine = ["notes.txt", "fields/mine.vtu", "fields/fields_mine.vtu", "timeseries.csv.bak"]
    for name in mine:
        (out / name).write_text("years of work")
    assert main(["run", "base", *SETS, "--out", str(out), "--force"]) == 0
    assert (out / "link.txt").is_symlink() and (tmp_path / "victim").read_text() == "years of work"
    assert [(out / name).read_text() for name in mine] == ["years of work"] * len(mine)
    run(SCENE, tmp_path / "whole")
    left = {name: content for name, content in files(out).items() if name not in (*mine, "link.txt")}
    assert left == files(tmp_path / "whole")
    kept = {key: value for key, value in lasting(out).items() if key != "origin"}
    assert kept == {key: value for key, value in lasting(tmp_path / "whole").items() if key != "origin"}


def test_a_forced_run_computes_again(tmp_path):
    """What is done, too."""
    run(SCENE, tmp_path)
    before = (tmp_path / "timeseries.csv").stat().st_mtime_ns
    assert main(["run", "base", *SETS, "--out", str(tmp_path), "--force", "--quiet"]) == 0
    assert (tmp_path / "timeseries.csv").stat().st_mtime_ns > before and told(tmp_path)["resumes"] == []


@pytest.mark.parametrize("name", ["timeseries.nc", "fields/fields_0077.vtu"])
def test_a_forced_run_is_refused_where_others_have_files_of_its_names(tmp_path, capsys, name):
    run(SCENE, tmp_path)
    (tmp_path / name).write_text("years of work")
    assert f"{name}: no run has written it" in refused(tmp_path, capsys, "base", *SETS, "--force")


@pytest.mark.parametrize("content, why", [
    (None, "it holds 'thesis.tex', which is not of a run; a new or empty folder"),
    ("", "run.json: cannot be read"), ("[" * 9999, "run.json: cannot be read"),
    ("{}", "run.json: it has no scene or no status"),
    ('{"scene": "x", "files": ["thesis.tex"]}', "run.json: it has no scene or no status"),
    ('{"scene": "x", "hash": "x", "tables": {}, "status": "x", "files": ["thesis.tex"]}', "run.json: its status 'x'")])
def test_a_forced_run_takes_no_folder_without_a_run(tmp_path, capsys, content, why):
    """Nor one whose run.json cannot be read: one line says what is there and what to do, and nothing is changed."""
    (tmp_path / "thesis.tex").write_text("years of work")
    if content is not None:
        (tmp_path / "run.json").write_text(content)
    message = refused(tmp_path, capsys, "base", *SETS, "--force")
    assert why in message and message.count("\n") == 1
    assert content is None or "move the folder away, or name another" in message
    assert (tmp_path / "thesis.tex").read_text() == "years of work"
    assert sorted(path.name for path in tmp_path.iterdir()) == ["run.json", "thesis.tex"][content is None:]
    assert content is None or (tmp_path / "run.json").read_text() == content


def test_a_scene_file_that_was_changed_is_told_on_resume(tmp_path, capsys):
    """With what differs; the run goes on with its own."""
    scene = tmp_path / "mine.toml"
    scene.write_text('[pore]\nwidth = "50 um"\n[flow]\nhead = "1e-3 cm"\n')
    assert main(["run", str(scene), "--set", "pore.length=500 um", "--out", str(tmp_path / "run")]) == 0
    assert main(["run", "--resume", str(tmp_path / "run")]) == 0
    assert capsys.readouterr().err == ""
    scene.write_text(scene.read_text().replace("50 um", "60 um"))
    assert main(["run", "--resume", str(tmp_path / "run")]) == 0
    message = capsys.readouterr().err
    assert f"{scene}: it is not the scene of the run any more: pore.width (50.0 um there, now 60.0 um)" in message
    assert message.count("\n") == 1 and told(tmp_path / "run")["tables"]["pore"]["width"] == "50.0 um"
    for content in ("not toml", None):
        scene.unlink() if content is None else scene.write_text(content)
        assert main(["run", "--resume", str(tmp_path / "run")]) == 0
        assert capsys.readouterr().err == ""


@pytest.mark.parametrize("origin", [{"file": 3, "set": []}, {"file": "base", "set": [3]}, {"file": "base", "set": None},
                                    [], None])
def test_an_origin_that_makes_no_sense_is_none(tmp_path, capsys, origin):
    run(load_scene("flow_only"), tmp_path)
    results.write_json(tmp_path / "run.json", told(tmp_path) | {"origin": origin})
    assert running.resume(tmp_path) == "completed"
