"""A run into a folder that already holds a run: resumed, left unchanged, refused, or replaced on request."""


from repro.cli import main
from repro.runs import machine
from repro.runs.execution import run
from repro.scene import load_scene
from tests import faults, pages
from tests.pages import cached_run
from tests.shell import (
    BRIEF,
    files,
    flags,
    interrupt_run,
    lasting_record,
    matches_uninterrupted,
    read_record,
    refusal,
    resume_run,
    rewrite,
    state,
)

SETS, SCENE = flags(*BRIEF), load_scene("base", BRIEF)


def test_a_finished_run_is_left_unchanged(tmp_path, capsys):
    """The same command, or a resume, reports this with status 0, and computes and writes nothing."""
    arguments = ["run", "base", *SETS, "--out", str(tmp_path / "run")]
    assert main(arguments) == 0
    before = state(tmp_path / "run")
    for repeated in (arguments, ["run", "--resume", str(tmp_path / "run")]):
        capsys.readouterr()
        assert main(repeated) == 0
        assert "completed, already finished" in capsys.readouterr().out and state(tmp_path / "run") == before


def test_an_interrupted_run_is_resumed(tmp_path, capsys):
    """It starts from its checkpoint, with the bits of the uninterrupted run."""
    interrupt_run(SCENE, tmp_path / "run")
    pages.run(tmp_path, "base", *BRIEF)
    assert "resumes from t = " in capsys.readouterr().err
    assert matches_uninterrupted(SCENE, tmp_path / "run")
    assert read_record(tmp_path / "run")["resumes"][0]["time_h"] > 0


def test_another_scene_is_refused_with_its_differences(tmp_path, capsys):
    """The message has the keys that differ, with both values."""
    out = tmp_path / "run"
    interrupt_run(SCENE, out)
    message = refusal(tmp_path, capsys, "run", "base", *flags(*BRIEF, "growth.end=4 h"), "--out", out)
    assert "growth.end (3 h there, now 4 h)" in message and "--force" in message
    linear = 'flow.head={table=[["0 h", "1 cm"], ["1 h", "2 cm"]], between="linear"}'
    message = refusal(tmp_path, capsys, "run", "base", *flags(*BRIEF, linear), "--out", out)
    assert "flow.head (0.001 cm there, now a table over time)" in message
    message = refusal(tmp_path, capsys, "run", "flow_only", "--out", out)
    assert "flow.mean_velocity (not set there" in message and "growth (a section there, now not set)" in message


def test_other_versions_are_refused_with_their_differences(tmp_path, capsys, monkeypatch):
    """This holds for a finished run and for an unfinished one."""
    run(SCENE, tmp_path / "done")
    interrupt_run(SCENE, tmp_path / "run")
    monkeypatch.setattr(machine, "source_hash", lambda: "01234567")
    faults.replace_version(monkeypatch, "scipy")
    for name in ("run", "done"):
        message = refusal(tmp_path, capsys, "run", "base", *SETS, "--out", tmp_path / name)
        assert "it contains another run: " in message and "source (" in message and "versions.scipy (" in message


def test_a_forced_run_removes_only_the_listed_files(tmp_path):
    """It is computed again. Other files in the folder, and the target of a link, stay. A file that a run of an earlier
    version has written and listed is removed."""
    out = tmp_path / "run"
    reference = cached_run(SCENE)
    run(load_scene("base", ('numerics.preset="fast"', 'growth.end="6 h"', "output.every=1 h")), out)
    foreign = {name: b"years of work" for name in ("notes.txt", "fields/mine.vtu", "fields/fields_mine.vtu",
                                                "timeseries.csv.bak", "../victim", "link.txt")}
    (out / "link.txt").symlink_to(tmp_path / "victim")
    for name, content in foreign.items():
        (out / name).write_bytes(content)
    (out / "timeseries.nc").touch()
    record = read_record(out)
    rewrite(out, files=[*record["files"], "timeseries.nc", "../victim", "link.txt", "notes.txt"])
    pages.run(tmp_path, "base", *BRIEF, options=["--force"])
    assert (out / "link.txt").is_symlink() and {name: (out / name).read_bytes() for name in foreign} == foreign
    assert {name: content for name, content in files(out).items() if name not in foreign} == files(reference)
    assert lasting_record(out) | {"origin": None} == lasting_record(reference) | {"origin": None}
    assert read_record(out)["resumes"] == []


def test_a_forced_run_is_refused_if_its_names_are_those_of_other_files(tmp_path, capsys):
    run(SCENE, tmp_path)
    for name in ("fields/fields_0077.vtu", "before_expansion.pvd"):
        (tmp_path / name).write_text("years of work")
        assert f"{name}: no run has written it" in refusal(
            tmp_path, capsys, "run", "base", *SETS, "--force", "--out", tmp_path)
        (tmp_path / name).unlink()


def test_a_resume_reports_a_changed_scene_file(tmp_path, capsys, monkeypatch):
    """The message has the difference, in any working folder. The run goes on with its own scene."""
    scene = tmp_path / "mine.toml"
    monkeypatch.chdir(tmp_path)
    scene.write_text('[pore]\nwidth = "50 um"\n[flow]\nhead = "1e-3 cm"\n[substrates]\n')
    out = pages.run(tmp_path, "mine.toml", "pore.length=500 um", options=["--unset", "substrates"])
    monkeypatch.chdir(out)
    text = scene.read_text()
    differs = f"{scene}: it has changed since the run began: pore.width (50 um there, now 60 um)"
    for content, expected in ((text, ""), (text.replace("50 um", "60 um"), differs), ("not toml", ""), (None, "")):
        scene.unlink() if content is None else scene.write_text(content)
        assert resume_run(out) == 0
        message = capsys.readouterr().err
        assert expected in message and message.count("\n") == bool(expected)
    assert read_record(out)["tables"]["pore"]["width"] == "50 um"
