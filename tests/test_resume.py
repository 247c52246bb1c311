"""Runs that were interrupted, killed or have failed resume, with the same results to the last bit. A run
into a folder that already holds a run is resumed, left unchanged, refused, or replaced on request."""
import json
import random
import re
from contextlib import suppress
from pathlib import Path
from shutil import copytree
from subprocess import TimeoutExpired
from unittest.mock import Mock

import pytest

import repro
from repro import timing
from repro.cli import main
from repro.errors import Interrupted, SimulationError
from repro.model import growth
from repro.results import write_sealed
from repro.runs import execution, machine
from repro.runs.checkpoint import NEWEST, PREVIOUS
from repro.runs.execution import Watch, resume, run
from repro.scene import load_scene
from tests import faults, pages
from tests.pages import cached_run
from tests.shell import (
    BRIEF,
    LONG,
    files,
    flags,
    flip,
    interrupt_run,
    lasting_record,
    matches_uninterrupted,
    read_record,
    refusal,
    resume_run,
    rewrite,
    run_and_wait,
    start_run,
    state,
    stop_every,
    wait_for,
)

CONTACT = ('aggregate.radius="17.98 um"', 'pore.width="20 um"', 'growth.end="0.6 h"')
#: An aggregate near the ends of the pore: each run has a warning.
WARNED = ('pore.length="90 um"',)
SCENES = {
    "fast, jumps, two aggregates": (
        'numerics.preset="fast"', 'growth.end="0.8 h"', 'growth.new_biomass="stress_free"',
        'substrates.donor.supply=[["0 h", "10 mg/L"], ["0.3 h", "0 mg/L"], ["0.5 h", "20 mg/L"]]',
        'aggregate=[{radius="12 um", position="-30 um", name="left"}, {radius="9 um", position="20 um", wall="upper"}]',
        'output.times=["0.1 h", "0.3 h", "0.4 h", "0.7 h"]'),
    "paper, rows within steps": ('growth.end="0.7 h"', 'output.times=["0.05 h", "0.1 h", "0.4 h", "0.47 h"]'),
    "fast, unreported steps, contact": ('numerics.preset="fast"', "numerics.tolerance=0.0001", *CONTACT, *WARNED,
                                        'output.times=["0.6 h"]'),
}
THOROUGH_SCENES = {
    "gear": ('numerics.transport="gear"', 'growth.end="0.4 h"'),
    "to the pore's end": ("aggregate.radius=40 um", "pore.length=90 um", "growth.time_step=1 h", "growth.end=9 h",
                          "numerics.refinement=0.5"),
    "fast, rows within steps": ('numerics.preset="fast"', 'growth.end="9.7 h"'),
    "gear with forces": ("numerics.refinement=0.3", 'numerics.transport="gear"', 'growth.fluid_forces="included"',
                         'growth.end="0.6 h"'),
    "fast, stress-free": ('numerics.preset="fast"', 'growth.new_biomass="stress_free"', *CONTACT),
    "fast, erosion of two aggregates": (
        'numerics.preset="fast"', 'growth.new_biomass="stress_free"', 'growth.end="3 h"',
        'aggregate=[{radius="12 um", position="-30 um"}, {radius="9 um", position="20 um", wall="upper"}]',
        'growth.erosion={law="shear", shear_coefficient="20 um/h/Pa"}', 'output.times=["1 h", "3 h"]'),
    "fast, a missed tolerance": ('numerics.preset="fast"', "numerics.tolerance=1e-12", "growth.time_step=1 h",
                                 "growth.end=0.0205 h", 'output.times=["4.2e-3 h", "0.0205 h"]'),
    "fast, to a detachment": ('numerics.preset="fast"', "growth.time_step=0.5 h", "growth.end=3 h",
                              "growth.wall=bonded", "growth.bonding_strength=0.002 MPa"),
}


SCENE = load_scene("base", BRIEF)


def check_parts(scene, folder):
    """Check that a run with a stop after every step equals the uninterrupted run: tables, fields, indices, status and
    counts."""
    whole, parts = folder / "whole", folder / "parts"
    run(scene, whole)
    watch = Watch(stop=stop_every(1))
    with suppress(Interrupted):
        run(scene, parts, watch=watch)
    for _ in range(read_record(whole)["rows"] + 200):
        if read_record(parts)["status"] != "interrupted":
            break
        with suppress(Interrupted):
            resume(parts, watch=watch)
    assert len(read_record(parts)["resumes"]) >= 3
    assert files(parts) == files(whole) and lasting_record(parts) == lasting_record(whole)
    assert not {NEWEST, PREVIOUS, ".lock"} & files(parts).keys()


@pytest.mark.parametrize("name", [
    *SCENES, *(pytest.param(name, marks=pytest.mark.thorough) for name in THOROUGH_SCENES)])
def test_a_run_stopped_after_every_step_equals_the_uninterrupted_run(tmp_path, name):
    """No warning occurs."""
    check_parts(load_scene("base", {**SCENES, **THOROUGH_SCENES}[name]), tmp_path)


def test_every_bit_of_a_finished_run_is_checked(tmp_path, capsys):
    """After a flipped bit in any file, or an exchanged or missing file, `check` and --resume name the file, with status
    2; --force repeats the run, as a resume advises. A missing page is made again."""
    uninterrupted, command = cached_run(SCENE), ["base", *flags(*BRIEF), "--out"]
    assert main(["check", str(uninterrupted)]) == 0
    assert "completed; its files are unchanged" in capsys.readouterr().out
    names = [str(path.relative_to(uninterrupted)) for path in uninterrupted.rglob("*") if path.is_file()]
    changes = [(name, flip) for name in names]
    changes += [(name, lambda path: path.unlink()) for name in names if name not in ("report.html", "run.json")]
    other = (uninterrupted / "fields" / "fields_0001.vtu").read_bytes()
    changes += [("fields/fields_0002.vtu", lambda path: path.write_bytes(other))]
    changes += [("run.json", lambda path: flip(path, path.read_bytes().index(b'"rows": ') + 8))]
    for number, (name, change) in enumerate(changes):
        out = Path(copytree(uninterrupted, tmp_path / str(number)))
        change(out / name)
        same_command = [["run", *command]] if number < 3 or name == "run.json" else []
        for arguments in (["check"], ["run", "--resume"], *same_command):
            message = refusal(out, capsys, *arguments, out)
            assert name in message and str(out) in message, message
            assert arguments == ["check"] or name == "run.json" or "run the scene again with --force" in message
    assert len(changes) > 2 * 10
    assert main(["run", *command, str(out), "--force", "--quiet"]) == 0 and matches_uninterrupted(SCENE, out)
    (out / "report.html").unlink()
    assert resume_run(out) == main(["check", str(out)]) == 0 and (out / "report.html").exists()


@pytest.mark.parametrize("file, message", [
    ("timeseries.csv", "timeseries.csv is missing, cut short or altered.* resumes from its checkpoint"),
    (NEWEST, f"{NEWEST}: refused: its checksum is wrong")])
def test_a_damaged_run_resumes_from_its_last_good_checkpoint(tmp_path, capsys, file, message):
    """A message reports the damage, of a table although the run is marked as finished, or of the newest checkpoint. The
    results stay the same."""
    out = tmp_path / "run"
    interrupt_run(SCENE, out)
    flip(out / file)
    if file != NEWEST:
        assert f"{file} is missing, cut short or altered" in refusal(out, capsys, "check", out)
        rewrite(out, status="completed")
    assert resume_run(out) == 0
    err = capsys.readouterr().err
    assert re.search(message, err) and "t = 0" not in err
    assert matches_uninterrupted(SCENE, out) and read_record(out)["status"] == "completed"
    assert read_record(out)["resumes"][0]["time_h"] > 0


def test_checkpoints_follow_at_the_requested_interval(monkeypatch):
    """Steps take 7 s. A checkpoint a minute follows the 9th, 18th and 27th step; an interval of zero means every step.
    """
    for interval, expected in ((60.0, [9, 18, 27]), (0.0, list(range(1, 31)))):
        writer = Mock(has_last_state=True, contact=False, state=None, time=0.0, end=0.0, remeshes=0, steps=0)
        checkpoints = []
        writer.find_crease.return_value = []
        monkeypatch.setattr(execution, "perf_counter", lambda writer=writer: 7.0 * writer.add.call_count)
        monkeypatch.setattr(execution, "_checkpoint",
                            lambda writer, watch, checkpoints=checkpoints: checkpoints.append(writer.add.call_count))
        execution._record_steps(writer, [(None, None)] * 30, Watch(interval=interval))
        assert checkpoints == expected


def test_a_failure_names_the_last_good_state(tmp_path, monkeypatch):
    """The message has time, stage and reason. The run resumes from the last good state once the cause is gone."""
    scene, most = load_scene("base", ('growth.end="0.8 h"',)), growth.MOST_ITERATIONS

    def fail_late(event):
        if event["event"] == "step" and event["time_h"] >= 0.4:
            monkeypatch.setattr(growth, "MOST_ITERATIONS", 1)

    with pytest.raises(SimulationError) as failed:
        run(scene, tmp_path / "run", watch=Watch(tell=fail_late))
    message = str(failed.value)
    for part in ("step from t = 0.4 h", "in growth", f"the last good state, t = 0.4 h, is in {tmp_path}",
                 "fields/fields_0002.vtu"):
        assert part in message
    assert read_record(tmp_path / "run")["status"] == f"failed: {message}"
    monkeypatch.setattr(growth, "MOST_ITERATIONS", most)
    assert resume(tmp_path / "run") == "completed"
    assert matches_uninterrupted(scene, tmp_path / "run")


@pytest.mark.thorough
@pytest.mark.parametrize("seed", range(6))
def test_a_run_killed_repeatedly_equals_the_uninterrupted_run(tmp_path, seed):
    """SIGKILL ends a run with checkpoints every 0.1 s at seeded random times, and it is resumed until it completes. It
    has the bits of the uninterrupted run."""
    uninterrupted, out = cached_run(load_scene("base", ["growth.end=4 h"])), tmp_path / "run"
    arguments, draw = [*LONG, "--out", out], random.Random(seed)
    status, patience = None, 0.0
    for _ in range(100):
        if status is not None:
            break
        patience += 0.5 * read_record(uninterrupted)["wall_time_s"]
        process = start_run(*arguments, "--checkpoint", "0.1")
        wait_for((out / "run.json").exists, process)
        with suppress(TimeoutExpired):
            status = process.wait(draw.uniform(0, patience))  # the start may take most of it
        process.kill()
        process.communicate()
        arguments = ["--resume", out]
    assert status == 0 and len(read_record(out)["resumes"]) > 0
    assert files(out) == files(uninterrupted) and lasting_record(out) | {"origin": {}} == lasting_record(uninterrupted)


@pytest.mark.parametrize("status", ["paused", "", "failed"])
def test_a_run_of_unknown_status_is_neither_resumed_nor_repeated(status, tmp_path, capsys):
    """It may be over, in another version. Its rows load, and --force replaces it."""
    out = tmp_path / "run"
    assert main(["run", "flow_only", "--quiet", "--out", str(out)]) == 0
    write_sealed(out / "run.json", read_record(out) | {"status": status})
    before = files(out)
    for command in (["run", "flow_only", "--out", str(out)], ["run", "--resume", str(out)], ["check", str(out)]):
        capsys.readouterr()
        assert main(command) == 2
        (message,) = capsys.readouterr().err.splitlines()
        assert message.startswith(f"repro: {out}: run.json has the status {status!r}, which this version does not know")
    swept = ["sweep", "flow_only", "--vary", "pore.width=50 um", "--workers", "1", "--quiet",
             "--out", str(tmp_path / "swept")]
    assert main(swept) == 0
    (point,) = (tmp_path / "swept" / "runs").iterdir()
    write_sealed(point / "run.json", read_record(point) | {"status": status})
    assert main(swept) == 3 and read_record(point)["status"] == status
    assert files(out) == before and repro.load_run(out).status == status
    assert main(["run", "flow_only", "--quiet", "--force", "--out", str(out)]) == 0
    assert read_record(out)["status"] == "completed"


@pytest.mark.thorough
def test_results_do_not_depend_on_the_number_of_threads(tmp_path):
    """Both runs have the same bits."""
    for threads in ("1", "2"):
        assert run_and_wait(*LONG, "--out", tmp_path / threads, threads=threads)[0] == 0
    assert files(tmp_path / "1") == files(tmp_path / "2")
    assert read_record(tmp_path / "2")["conditions"]["threads"]["OMP_NUM_THREADS"] == "2"


def test_times_by_stage_are_those_before_a_resume_and_since(tmp_path, monkeypatch):
    monkeypatch.setattr(timing, "seconds", {"growth": 2.0, "transfer": 4.0})
    recorder = execution.Recorder(load_scene("base"), tmp_path)
    recorder.history.stages, recorder.history.seconds = {"flow": 8.0, "growth": 16.0}, 1000.0
    recorder.write_record("running")
    assert read_record(tmp_path)["wall_time_by_stage_s"] == {"flow": 8.0, "growth": 18.0, "transfer": 4.0}
    assert 1000 < read_record(tmp_path)["wall_time_s"] < 1100


@pytest.mark.parametrize("key", ["blas", "libc", "geos", "machine", "system", "source", "scipy"])
def test_a_resume_under_other_conditions_is_reported(key, tmp_path, monkeypatch, recwarn):
    """Conditions and versions that may change numbers are reported, and recorded by name; threads are not."""
    recorder = execution.Recorder(load_scene("flow_only"), tmp_path)
    recorder.write_record("running")
    before = read_record(tmp_path)
    present = {**before["conditions"], "threads": {"OMP_NUM_THREADS": "7"}}
    recorder.conditions = present
    assert execution._find_changes(before, recorder, execution.DEFAULT_WATCH) == {} and not recwarn.list
    if key == "scipy":
        faults.replace_version(monkeypatch, key)
    else:
        present[key] = "0.0"
    with pytest.warns(UserWarning, match=rf"\.{key} .*now 0.0.*; the results may differ"):
        (changed,) = execution._find_changes(before, recorder, execution.DEFAULT_WATCH)
    assert changed in (f"conditions.{key}", f"versions.{key}")


# ---------------------------------------------------------------- a run into a folder that already holds a run


SETS = flags(*BRIEF)


def test_the_same_command_resumes_a_run_and_leaves_a_finished_one_unchanged(tmp_path, capsys):
    """It starts from the checkpoint of an interrupted run, with the bits of the uninterrupted one. Then it reports with
    status 0 that the run is finished, and so does a resume; both write nothing. `check` reports the interruption, and
    accepts no changes with a run."""
    out = tmp_path / "run"
    interrupt_run(SCENE, out)
    assert main(["check", str(out), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["status"] == "interrupted"
    with pytest.raises(SystemExit):
        main(["check", str(out), "--set", "growth.end=5 h"])
    arguments = ["run", "base", *SETS, "--out", str(out)]
    assert main(arguments) == 0 and "resumes from t = " in capsys.readouterr().err
    assert matches_uninterrupted(SCENE, out) and read_record(out)["resumes"][0]["time_h"] > 0
    before = state(out)
    for repeated in (arguments, ["run", "--resume", str(out)]):
        assert main(repeated) == 0
        assert "completed, already finished" in capsys.readouterr().out and state(out) == before


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
