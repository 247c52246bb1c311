"""Runs that are interrupted, killed or have failed go on as if nothing had happened, to the last bit."""

import json
import os
import random
import re
import signal
from contextlib import suppress
from dataclasses import replace
from operator import attrgetter
from pathlib import Path
from shutil import copytree
from subprocess import TimeoutExpired
from unittest.mock import Mock

import pytest

from repro.cli import main
from repro.errors import Interrupted, SimulationError
from repro.march import loop
from repro.march.simulation import steps
from repro.model import growth, traction
from repro.results import columns
from repro.results.files import sealed
from repro.results.quantities import Quantity
from repro.runs import running
from repro.runs.checkpoint import NEWEST, PREVIOUS
from repro.runs.running import Watch, resume, run
from repro.runs.whole import lacking
from repro.scene import load_scene
from tests import faults
from tests.faults import little_memory
from tests.pages import whole_of
from tests.shell import (
    BRIEF,
    LONG,
    as_whole,
    every,
    files,
    flags,
    flip,
    lasting,
    refused,
    resumed,
    rewrite,
    rows,
    shell,
    started,
    stopped,
    told,
    wait_for,
)

CONTACT = ('aggregate.radius="17.98 um"', 'pore.width="20 um"', 'growth.end="0.6 h"')
SCENES = {
    "paper, unreported steps": ('growth.end="1 h"', 'output.times=["0.3 h", "1 h"]'),
    "fast": ('numerics.preset="fast"', "numerics.tolerance=0.0005", 'aggregate.radius="25 um"', 'growth.end="3 h"',
             'output.times=["0.1 h", "0.7 h", "0.8 h", "2 h"]'),
    "fast, jumps": ('numerics.preset="fast"', 'growth.end="0.8 h"', 'substrates.donor.supply='
                    '[["0 h", "10 mg/L"], ["0.3 h", "0 mg/L"], ["0.5 h", "20 mg/L"]]',
                    'output.times=["0.1 h", "0.3 h", "0.4 h", "0.7 h"]'),
    "paper, rows within steps": ('growth.end="0.7 h"', 'output.times=["0.05 h", "0.1 h", "0.4 h", "0.47 h"]'),
    "fast, unreported steps, contact": ('numerics.preset="fast"', "numerics.tolerance=0.0001", *CONTACT,
                                        'output.times=["0.6 h"]'),
    "gear": ('numerics.transport="gear"', 'growth.end="0.4 h"'),
    "to the pore's end": ("aggregate.radius=40 um", "pore.length=90 um", "growth.time_step=1 h", "growth.end=9 h",
                          "numerics.refinement=0.5"),
}
MORE = {
    "fast, rows within steps": ('numerics.preset="fast"', 'growth.end="9.7 h"'),
    "cubic, contact": ('numerics.preset="fast"', 'numerics.elements="cubic"', "numerics.tolerance=0.0005", *CONTACT,
                       'output.times=["0.05 h", "0.3 h", "0.6 h"]'),
    "paper": ('growth.end="6 h"',),
    "accurate": ('numerics.preset="accurate"', 'growth.end="4 h"'),
    "linear midpoint": ('numerics.time="midpoint"', "numerics.tolerance=0.0001", 'numerics.transfer="linear"',
                        *CONTACT),
    "rechosen": ('numerics.fixed_point="rechosen"', *CONTACT),
    "quadratic gear": ('numerics.elements="quadratic"', "numerics.refinement=0.3", 'numerics.transport="gear"',
                       'growth.fluid_forces="included"', 'growth.end="0.6 h"'),
    "cubic, stress-free": ('numerics.elements="cubic"', "numerics.refinement=0.3",
                           'growth.new_biomass="stress_free"', *CONTACT),
}


PORE_END = "the aggregate reaches the pore's upstream end at t = 3 h"
SCENE = load_scene("base", BRIEF)


def in_parts(scene, folder, count):
    """Run a scene with a stop at each so-manieth step; how often it was gone on with."""
    watch, resumes = Watch(stop=every(count)), 0
    with suppress(Interrupted):
        run(scene, folder, watch=watch)
    while told(folder)["status"] == "interrupted":
        resumes += 1
        with suppress(Interrupted):
            resume(folder, watch=watch)
    return resumes


@pytest.mark.parametrize("name", [
    *SCENES, *(pytest.param(name, marks=pytest.mark.thorough) for name in MORE)])
def test_a_run_stopped_after_every_step_is_the_whole_run(tmp_path, name):
    """Tables, fields, indices, status and counts, and no warning."""
    scene = load_scene("base", {**SCENES, **MORE}[name])
    run(scene, tmp_path / "whole")
    resumes = in_parts(scene, tmp_path / "parts", 1)
    assert resumes == len(told(tmp_path / "parts")["resumes"]) >= 3
    assert files(tmp_path / "parts") == files(tmp_path / "whole")
    assert lasting(tmp_path / "parts") == lasting(tmp_path / "whole")
    assert not {NEWEST, PREVIOUS, ".lock"} & files(tmp_path / "parts").keys()


def drag(scene, at):
    """The force of the aggregate on the water along the pore, MPa um: against the flow."""
    drive = scene.flow
    forces = traction.nodal(at.pore.space, at.solved.flow, drive.kinematic_viscosity / drive.gravity, "laplacian")
    return -traction.MPA_PER_UM * drive.density * drive.gravity * forces[at.pore.mesh.body, 0].sum()


DRAG = Quantity("drag", "force on the water", "-", drag, needs="aggregate and flow", signed=True)


@pytest.fixture
def a_negative_column(monkeypatch):
    """A column of a contributor: its entry in the list of columns, and nothing else."""
    monkeypatch.setattr(columns, "SERIES", (*columns.SERIES, DRAG))
    columns.COLUMNS.append(DRAG.name)
    yield
    columns.COLUMNS.remove(DRAG.name)


def test_a_run_with_a_negative_column_goes_on_from_its_checkpoint(tmp_path, a_negative_column):
    """From its last step and not from t = 0; the files are those of the run without an interruption. Without
    flow the column is empty."""
    scene = load_scene("base", SCENES["paper, rows within steps"])
    run(scene, tmp_path / "continuous")
    stopped(scene, tmp_path / "parts")
    assert resumed(tmp_path / "parts") == 0
    (resume_record,) = told(tmp_path / "parts")["resumes"]
    assert resume_record["time_h"] > 0
    assert files(tmp_path / "parts") == files(tmp_path / "continuous")
    values = [float(row["drag"]) for row in rows(tmp_path / "parts" / "timeseries.csv")]
    assert len(values) == 5 and max(values) < 0
    diffusion = load_scene("base", ['growth.end="0 h"'], unset=["flow"])
    ((_, instant),) = steps(diffusion)
    assert columns.row(diffusion, instant)["drag"] is None


def test_strided_arrays_are_copied():
    """Of the pore, its mesh, its body at t = 0 and its concentrations: sums over strided views may differ in the last
    bit from those over what a checkpoint gives back."""
    ((_, instant),) = steps(load_scene("base", ["growth.end=0 h"]))
    now = instant.pore

    def strided(data, name):
        return replace(data, **{name: getattr(data, name).repeat(2, axis=-1)[..., ::2]})

    space = replace(now.space, mesh=strided(now.mesh, "points"))
    found = loop.laid_out(replace(strided(now, "active"), space=space, body=strided(now.body, "reference"),
                                  concentrations=strided(now.concentrations, "donor")))
    for place in map(attrgetter, ("active", "mesh.points", "body.reference", "concentrations.donor")):
        assert place(found).flags.c_contiguous and (place(found) == place(now)).all()


RECORD = {"scene": "x", "hash": "x", "tables": {}, "files": ["thesis.tex"], "status": "sunning"}


@pytest.mark.parametrize("arguments", [["run", "--resume"], ["run", "base", *flags(*BRIEF), "--force", "--out"]],
                         ids=["go on", "anew"])
@pytest.mark.parametrize("content, why", [
    (None, "there is no run.json|it holds 'thesis.tex', which is not of a run; a new or empty folder"),
    ("[" * 100_000, "run.json: cannot be read"), ("null", "run.json: cannot be read .it is not a JSON object"),
    (sealed({"scene": "x", "files": ["thesis.tex"]}), "run.json: it has no scene or no status"),
    (sealed(RECORD), "run.json: its status 'sunning' is none that a run writes")])
def test_a_folder_without_a_run_is_refused(tmp_path, capsys, content, why, arguments):
    """With status 2 and one line that says what is there and what to do, and nothing is changed."""
    (tmp_path / "thesis.tex").write_text("years of work")
    if content is not None:
        (tmp_path / "run.json").write_text(content)
    message = refused(tmp_path, capsys, *arguments, tmp_path)
    assert re.search(why, message)
    assert content is None or "--resume" in arguments or "move the folder away, or name another" in message


@pytest.mark.parametrize("status", ["", "Completed", "runningly", f"{PORE_END}, or so"])
def test_a_status_that_no_run_writes_is_none(tmp_path, capsys, status):
    """Neither finished nor to be gone on with."""
    run(load_scene("flow_only"), tmp_path)
    rewrite(tmp_path, status=status)
    message = refused(tmp_path, capsys, "run", "--resume", tmp_path)
    assert f"its status {status!r} is none that a run writes" in message
    assert "run.json tells of a run of another scene, or has no status" in lacking(tmp_path, load_scene("flow_only"))


def test_a_run_that_is_over_and_damaged_goes_on_from_a_checkpoint_that_is_left(tmp_path, capsys):
    """And says so."""
    out = tmp_path / "run"
    stopped(SCENE, out)
    rewrite(out, status="completed")
    flip(out / "timeseries.csv")
    assert resumed(out) == 0
    message = capsys.readouterr().err
    assert "timeseries.csv is not as it was written" in message and "goes on from its checkpoint" in message
    assert as_whole(SCENE, out) and told(out)["status"] == "completed"


def test_every_bit_of_a_run_that_is_over_counts(tmp_path, capsys):
    """A bit of any of its files, or a file exchanged for another one or gone: `check` and --resume say which, with
    status 2. The page is made again where it is gone."""
    whole, anew = whole_of(SCENE), ["base", *flags(*BRIEF), "--out"]
    assert main(["check", str(whole)]) == 0
    assert "completed; its files are as they were written" in capsys.readouterr().out
    names = [str(path.relative_to(whole)) for path in whole.rglob("*") if path.is_file()]
    changes = [(name, flip) for name in names]
    changes += [(name, lambda path: path.unlink()) for name in names if name not in ("report.html", "run.json")]
    other = (whole / "fields" / "fields_0001.vtu").read_bytes()
    changes += [("fields/fields_0002.vtu", lambda path: path.write_bytes(other))]
    changes += [("run.json", lambda path: flip(path, path.read_bytes().index(b'"rows": ') + 8))]
    for number, (name, change) in enumerate(changes):
        out = Path(copytree(whole, tmp_path / str(number)))
        change(out / name)
        for arguments in (["check"], ["run", "--resume"], *([["run", *anew]] if number < 3 else [])):
            message = refused(out, capsys, *arguments, out)
            assert name in message and str(out) in message, message
    assert len(changes) > 2 * 10
    flip(out / "run.json", (out / "run.json").read_bytes().index(b'"rows": ') + 8)
    (out / "report.html").unlink()
    assert resumed(out) == main(["check", str(out)]) == 0 and (out / "report.html").exists()


def test_a_damaged_run_is_made_anew_by_force_alone(tmp_path, capsys):
    out, anew = Path(copytree(whole_of(SCENE), tmp_path / "run")), ["base", *flags(*BRIEF), "--out"]
    flip(out / "timeseries.csv")
    for arguments in (["--resume"], anew):
        message = refused(tmp_path, capsys, "run", *arguments, out)
        assert "--force with its scene makes the run anew" in message
    flip(out / "run.json", 40)
    assert main(["run", *anew, str(out), "--force", "--quiet"]) == 0
    assert as_whole(SCENE, out)


def test_check_says_that_a_run_is_not_over(tmp_path, capsys):
    """And finds what is damaged of it; a scene's changes are not accepted with a run."""
    stopped(SCENE, tmp_path / "run")
    assert main(["check", str(tmp_path / "run"), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["status"] == "interrupted"
    flip(tmp_path / "run" / "timeseries.csv")
    assert "timeseries.csv is not as it was written" in refused(tmp_path, capsys, "check", tmp_path / "run")
    with pytest.raises(SystemExit):
        main(["check", str(tmp_path / "run"), "--set", "growth.end=5 h"])


@pytest.mark.parametrize("spoil", [lambda path: (path.unlink(), os.mkfifo(path)),
                                   lambda path: os.truncate(path, 3 * 2**30)])
def test_a_record_that_is_no_file_or_too_long_is_refused_unread(tmp_path, capsys, spoil):
    """A pipe is not waited for; 3 GB are not read."""
    out = Path(copytree(whole_of(SCENE), tmp_path / "run"))
    spoil(out / "run.json")
    for arguments in (["check"], ["run", "--resume"], ["run", "base", *flags(*BRIEF), "--out"]):
        with little_memory(2**28):
            assert main([*arguments, str(out)]) == 2
        message = capsys.readouterr().err
        assert message.count("\n") == 1 and str(out) in message


def test_an_altered_checkpoint_is_refused_and_the_one_before_is_used(tmp_path, capsys):
    """And the result is the same."""
    out = tmp_path / "run"
    stopped(SCENE, out)
    good = (out / NEWEST).read_bytes()
    (out / NEWEST).write_bytes(good[:-1] + bytes([good[-1] ^ 1]))
    assert resumed(out) == 0
    message = capsys.readouterr().err
    assert f"{NEWEST}: refused: its checksum is wrong" in message and "t = 0" not in message
    assert as_whole(SCENE, out) and told(out)["resumes"][0]["time_h"] > 0


def test_a_change_of_versions_is_told_and_recorded(tmp_path, monkeypatch):
    stopped(SCENE, tmp_path)
    faults.another_version(monkeypatch, "scipy")
    with pytest.warns(UserWarning, match="versions.scipy .* now 0.0.; .* to the last bit"):
        resume(tmp_path)
    (once,) = told(tmp_path)["resumes"]
    assert once["changed"]["versions.scipy"][1] == "0.0" and len(once["changed"]) == 1


def test_checkpoints_are_as_far_apart_as_is_asked(monkeypatch):
    """Steps of 7 s, a checkpoint a minute: after the 9th, the 18th and the 27th; a checkpoint a step where zero is."""
    for interval, wanted in ((60.0, [9, 18, 27]), (0.0, list(range(1, 31)))):
        one, written = Mock(kept=True, contact=False, state=None, time=0.0, end=0.0, remeshes=0, steps=0), []
        one.judge_surface.return_value = []
        monkeypatch.setattr(running, "perf_counter", lambda one=one: 7.0 * one.add.call_count)
        monkeypatch.setattr(running, "_checkpoint",
                            lambda one, watch, written=written: written.append(one.add.call_count))
        running._record_steps(one, [(None, None)] * 30, running.unwatched, Watch(interval=interval))
        assert written == wanted


def test_a_failure_says_where_the_last_good_state_is(tmp_path, monkeypatch):
    """Time, stage, why, what to change, and a state from which the run goes on when the cause is gone."""
    scene, most = load_scene("base", ('growth.end="0.8 h"',)), growth.MOST_ITERATIONS

    def fail_late(event):
        if event["event"] == "step" and event["time_h"] >= 0.4:
            monkeypatch.setattr(growth, "MOST_ITERATIONS", 1)

    with pytest.raises(SimulationError) as failed:
        run(scene, tmp_path / "run", watch=Watch(tell=fail_late))
    message = str(failed.value)
    for part in ("step from t = 0.4 h", "in growth", "try ", f"the last good state, t = 0.4 h, is in {tmp_path}",
                 "fields/fields_0002.vtu"):
        assert part in message
    assert told(tmp_path / "run")["status"] == f"failed: {message}"
    monkeypatch.setattr(growth, "MOST_ITERATIONS", most)
    assert resume(tmp_path / "run") == "completed"
    assert as_whole(scene, tmp_path / "run")


def test_results_reach_the_disk_while_a_run_goes_on(tmp_path):
    """Tables and run.json at every checkpoint."""
    seen = []

    def look(event):
        if event["event"] == "checkpoint":
            rows = len((tmp_path / "timeseries.csv").read_text().splitlines()) - 1
            seen.append((told(tmp_path)["status"], rows, len([*tmp_path.glob("fields/*")])))

    run(load_scene("base", ["growth.end=1 h"]), tmp_path, watch=Watch(tell=look, interval=0.0))
    assert seen == [("running", count, count) for count in range(1, len(seen) + 1)] and len(seen) > 4


@pytest.mark.parametrize("number, status", [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_a_signal_ends_a_run_that_goes_on_later(tmp_path, number, status):
    """One line, results so far; then to the end with the bits of the whole run."""
    process = started("base", "--set", "growth.end=1.6 h", "--out", tmp_path)
    wait_for((tmp_path / "fields" / "fields_0002.vtu").exists, process)
    process.send_signal(number)
    message = process.communicate(timeout=60)[1]
    assert process.returncode == status and message.endswith("goes on from there\n")
    assert f" at t = {float(rows(tmp_path / 'timeseries.csv')[-1]['time_h']):g} h; what" in message
    assert "Traceback" not in message and told(tmp_path)["status"] == "interrupted"
    assert len((tmp_path / "timeseries.csv").read_text().splitlines()) > 3
    assert resume(tmp_path) == "completed" and as_whole(load_scene("base", ["growth.end=1.6 h"]), tmp_path)


@pytest.mark.thorough
@pytest.mark.parametrize("seed", range(6))
def test_killed_again_and_again(tmp_path, seed):
    """SIGKILL at seeded random moments of a run with checkpoints every 0.1 s, from its start to its end, resumed each
    time until it is done: the bits of the whole run."""
    whole, out = whole_of(load_scene("base", ["growth.end=4 h"])), tmp_path / "run"
    arguments, draw = [*LONG, "--out", out], random.Random(seed)
    status, patience = None, 0.0
    while status is None:
        patience += 0.5 * told(whole)["wall_time_s"]
        process = started(*arguments, "--checkpoint", "0.1")
        wait_for((out / "run.json").exists, process)
        with suppress(TimeoutExpired):
            status = process.wait(draw.uniform(0, patience))  # which a start-up may take most of
        process.kill()
        process.communicate()
        arguments = ["--resume", out]
    assert status == 0 and len(told(out)["resumes"]) > 0
    assert files(out) == files(whole) and lasting(out) | {"origin": {}} == lasting(whole)


@pytest.mark.thorough
def test_one_thread_or_two(tmp_path):
    """The same bits."""
    for threads in ("1", "2"):
        assert shell(*LONG, "--out", tmp_path / threads, threads=threads)[0] == 0
    assert files(tmp_path / "1") == files(tmp_path / "2")
    assert told(tmp_path / "2")["conditions"]["threads"]["OMP_NUM_THREADS"] == "2"
