"""A run into a folder that holds one already: gone on with, left alone, refused, or replaced where it is asked for."""


from repro.cli import main
from repro.runs import machine
from repro.runs.running import run
from repro.runs.whole import lacking
from repro.scene import load_scene
from tests import faults, pages
from tests.pages import whole_of
from tests.shell import BRIEF, as_whole, files, flags, lasting, refused, resumed, rewrite, state, stopped, told

SETS, SCENE = flags(*BRIEF), load_scene("base", BRIEF)


def test_a_run_that_is_done_is_left_alone(tmp_path, capsys):
    """The same command again, or a resume: exit 0, says so, nothing is computed or written."""
    arguments = ["run", "base", *SETS, "--out", str(tmp_path / "run")]
    assert main(arguments) == 0
    before = state(tmp_path / "run")
    for again in (arguments, ["run", "--resume", str(tmp_path / "run")]):
        capsys.readouterr()
        assert main(again) == 0
        assert "completed, before this: nothing to do" in capsys.readouterr().out and state(tmp_path / "run") == before


def test_what_a_run_lacks_of_being_over_is_told(tmp_path):
    """In a folder that is made with those above it: nothing; the scene, or a status that there is."""
    scene, folder = load_scene("flow_only"), tmp_path / "new" / "run"
    run(scene, folder)
    assert lacking(folder, scene) == lacking(whole_of(SCENE), SCENE) == ""
    wrong = "run.json tells of a run of another scene, or has no status"
    assert wrong in lacking(folder, load_scene("flow_only", ["flow.viscosity_ratio=5"]))
    rewrite(folder, status=None)
    assert wrong in lacking(folder, scene)


def test_a_run_that_was_interrupted_is_gone_on_with(tmp_path, capsys):
    """From its state, to the bits of the whole run."""
    stopped(SCENE, tmp_path / "run")
    pages.run(tmp_path, "base", *BRIEF)
    assert "goes on from t = " in capsys.readouterr().err
    assert as_whole(SCENE, tmp_path / "run")
    assert told(tmp_path / "run")["resumes"][0]["time_h"] > 0


def test_another_scene_is_refused_with_what_differs(tmp_path, capsys):
    """By key, with both values."""
    out = tmp_path / "run"
    stopped(SCENE, out)
    message = refused(tmp_path, capsys, "run", "base", *flags(*BRIEF, "growth.end=4 h"), "--out", out)
    assert "growth.end (3.0 h there, now 4.0 h)" in message and "--force" in message
    message = refused(tmp_path, capsys, "run", "flow_only", "--out", out)
    assert "flow.mean_velocity (not set there" in message and "growth (a section there, now not set)" in message


def test_other_versions_are_refused_with_what_differs(tmp_path, capsys, monkeypatch):
    """Of a run that is over, and of one that is not."""
    run(SCENE, tmp_path / "done")
    stopped(SCENE, tmp_path / "run")
    monkeypatch.setattr(machine, "source_hash", lambda: "01234567")
    faults.another_version(monkeypatch, "scipy")
    for name in ("run", "done"):
        said = refused(tmp_path, capsys, "run", "base", *SETS, "--out", tmp_path / name)
        assert "the run there is another one: " in said and "source (" in said and "versions.scipy (" in said


def test_a_forced_run_removes_what_is_listed_and_nothing_else(tmp_path):
    """And computes again. Files that others have put beside the run's, and what a link leads to, stay."""
    out = tmp_path / "run"
    whole = whole_of(SCENE)
    run(load_scene("base", ('numerics.preset="fast"', 'growth.end="6 h"')), out)
    mine = {name: b"years of work" for name in ("notes.txt", "fields/mine.vtu", "fields/fields_mine.vtu",
                                                "timeseries.csv.bak", "../victim", "link.txt")}
    (out / "link.txt").symlink_to(tmp_path / "victim")
    for name, content in mine.items():
        (out / name).write_bytes(content)
    record = told(out)
    rewrite(out, files=[*record["files"], "../victim", "link.txt", "notes.txt"])
    pages.run(tmp_path, "base", *BRIEF, options=["--force"])
    assert (out / "link.txt").is_symlink() and {name: (out / name).read_bytes() for name in mine} == mine
    assert {name: content for name, content in files(out).items() if name not in mine} == files(whole)
    assert lasting(out) | {"origin": None} == lasting(whole) | {"origin": None} and told(out)["resumes"] == []


def test_a_forced_run_is_refused_where_others_have_files_of_its_names(tmp_path, capsys):
    run(SCENE, tmp_path)
    for name in ("fields/fields_0077.vtu", "timeseries.nc"):
        (tmp_path / name).write_text("years of work")
        assert f"{name}: no run has written it" in refused(
            tmp_path, capsys, "run", "base", *SETS, "--force", "--out", tmp_path)
        (tmp_path / name).unlink()


def test_a_scene_file_that_was_changed_is_told_on_resume(tmp_path, capsys, monkeypatch):
    """With what differs, from wherever that is asked for; the run goes on with its own."""
    scene = tmp_path / "mine.toml"
    monkeypatch.chdir(tmp_path)
    scene.write_text('[pore]\nwidth = "50 um"\n[flow]\nhead = "1e-3 cm"\n[substrates]\n')
    out = pages.run(tmp_path, "mine.toml", "pore.length=500 um", options=["--unset", "substrates"])
    monkeypatch.chdir(out)
    text = scene.read_text()
    differs = f"{scene}: it is not the scene of the run any more: pore.width (50.0 um there, now 60.0 um)"
    for content, said in ((text, ""), (text.replace("50 um", "60 um"), differs), ("not toml", ""), (None, "")):
        scene.unlink() if content is None else scene.write_text(content)
        assert resumed(out) == 0
        message = capsys.readouterr().err
        assert said in message and message.count("\n") == bool(said)
    assert told(out)["tables"]["pore"]["width"] == "50.0 um"
