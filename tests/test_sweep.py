"""A sweep as its user has it: runs, tables, page, what is refused, what is gone on with, what kills a run."""

import base64
import csv
import hashlib
import json
import math
import os
import re
import shutil
import signal
import subprocess
import sys
import time
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

import repro
from repro import load_scene, results
from repro.cli import main
from repro.sweep import page, pool, server, table
from repro.sweep.design import grid, parse, points
from repro.sweep.server import Server, ask
from repro.sweep.state import Sweep
from tests.shell import state

SHORT = ["--set", "numerics.preset=fast", "--set", 'growth.end="0.4 h"']
#: The second is too slow to carry substrates: it fails by construction.
VARY = ["--vary", "flow.mean_velocity=2.9 m/day, 1e-12 m/day, 5.8 m/day"]


def sweep(out, *arguments, scene="base"):
    return main(["sweep", scene, "--out", str(out), *arguments])


def rows(path):
    with path.open(newline="") as lines:
        return list(csv.DictReader(lines))


@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    """A sweep with a failure; not to be changed."""
    out = tmp_path_factory.mktemp("finished") / "sweep"
    assert sweep(out, *VARY, *SHORT, "--quiet") == 3
    return out


@pytest.fixture
def copied(finished, tmp_path):
    return Path(shutil.copytree(finished, tmp_path / "sweep"))


def test_every_run_has_its_place_and_a_failure_is_recorded(finished):
    told = json.loads((finished / "sweep.json").read_text())
    assert sorted(path.name for path in (finished / "runs").iterdir()) == [
        point["folder"].removeprefix("runs/") for point in told["points"]]
    found = rows(finished / "runs.csv")
    assert [row["run"] for row in found] == ["1", "2", "3"]
    assert [row["flow.mean_velocity_m_per_day"] for row in found] == ["2.9", "1e-12", "5.8"]
    assert [row["status"].partition(":")[0] for row in found] == ["completed", "failed", "completed"]
    assert "transport" in found[1]["status"] and "Peclet" in found[1]["status"]
    assert not (finished / found[1]["folder"] / "run.json").exists(), "its first state fails: nothing is written"


def test_the_table_is_the_runs_own(finished):
    """A row a run and time, every digit as the run has it."""
    found = rows(finished / "table.csv")
    for run in rows(finished / "runs.csv"):
        own = rows(finished / run["folder"] / "timeseries.csv") if run["status"] == "completed" else []
        mine = [row for row in found if row["run"] == run["run"]]
        assert [dict(zip(results.COLUMNS, map(row.get, results.COLUMNS))) for row in mine] == own
        assert {row["flow.mean_velocity_m_per_day"] for row in mine} <= {run["flow.mean_velocity_m_per_day"]}
    assert len(found) > 3


def test_a_run_of_a_sweep_is_that_run(finished, tmp_path):
    """Bit by bit what `repro run` makes."""
    tables = json.loads((finished / "runs.csv").with_name("sweep.json").read_text())["points"][2]
    scene = tmp_path / "one.toml"
    head = '[pore]\nwidth = "50 um"\nlength = "600 um"\n[aggregate]\nradius = "5 um"\n'
    scene.write_text(head + '[flow]\nmean_velocity = "5.8 m/day"\n'
                     '[substrates.acceptor]\nsupply = "10 mg/L"\n[substrates.donor]\nsupply = "10 mg/L"\n'
                     '[growth]\nend = "0.4 h"\n[numerics]\npreset = "fast"\n')
    assert main(["run", str(scene), "--out", str(tmp_path / "run")]) == 0
    ours, alone = finished / tables["folder"], tmp_path / "run"
    assert json.loads((ours / "run.json").read_text())["hash"] == json.loads((alone / "run.json").read_text())["hash"]
    assert (ours / "timeseries.csv").read_bytes() == (alone / "timeseries.csv").read_bytes()


def test_the_same_command_makes_what_is_missing_and_nothing_else(copied, capsys):
    places = [copied / row["folder"] for row in rows(copied / "runs.csv")]
    before = [(places[k] / "run.json").stat().st_mtime_ns for k in (0, 2)]
    table_before = (copied / "table.csv").read_bytes()
    shutil.rmtree(places[0])
    for left in (f".part-{places[0].name}", f".part-{places[2].name}-attempt"):  # of a sweep that was killed
        (copied / "runs" / left).mkdir()
    assert sweep(copied, *VARY, *SHORT) == 3
    after = [(places[k] / "run.json").stat().st_mtime_ns for k in (0, 2)]
    assert after[0] > before[0] and after[1] == before[1]
    assert (copied / "table.csv").read_bytes() == table_before
    assert sorted(path.name for path in (copied / "runs").iterdir()) == [place.name for place in places]
    out, err = capsys.readouterr()
    assert "2 of 3 runs done, 1 failed" in out and "run 2 (flow.mean_velocity = 1e-12 m/day): failed" in err
    assert "run 1, flow.mean_velocity = 2.9 m/day: completed" in err and "run 3, " not in err


def refused(out, capsys, *arguments):
    before = out.exists(), state(out)
    assert sweep(out, *arguments) == 2
    message = capsys.readouterr().err
    assert message.count("\n") == 1
    assert (out.exists(), state(out)) == before
    return message


def test_another_sweep_in_the_same_folder_is_refused(copied, capsys):
    assert "another sweep (base, 3 runs)" in refused(copied, capsys, "--vary", "pore.width=50 um, 60 um", *SHORT)
    assert "another sweep" in refused(copied, capsys, *VARY, *SHORT, "--set", "flow.viscosity_ratio=5")


def test_a_sweep_begun_with_other_code_is_refused(copied, capsys):
    told = json.loads((copied / "sweep.json").read_text())
    (copied / "sweep.json").write_text(json.dumps(told | {"code": "0.0.1-abc"}))
    assert "begun with version 0.0.1-abc" in refused(copied, capsys, *VARY, *SHORT)


@pytest.mark.parametrize("text", ["", "{", "[]", "null", '{"points": 1}', '"x"'])
def test_a_broken_record_is_refused(copied, capsys, text):
    (copied / "sweep.json").write_text(text)
    assert "sweep.json cannot be read" in refused(copied, capsys, *VARY, *SHORT)


def test_a_folder_with_other_files_is_left_alone(tmp_path, capsys):
    (tmp_path / "thesis.tex").write_text("years of work")
    assert "thesis.tex" in refused(tmp_path, capsys, *VARY)


def test_a_file_in_the_way_is_refused(tmp_path, capsys):
    (tmp_path / "sweep").write_text("not a folder")
    assert "folder" in refused(tmp_path / "sweep", capsys, *VARY)


@pytest.mark.parametrize("arguments", [["--vary", "pore.width=50 um, 4 um"], ["--vary", "pore.width=1:2 um:log"],
                                       [*VARY, "--samples", "3", "--set", "pore.width=oops"]])
def test_nothing_is_written_before_every_run_is_checked(tmp_path, capsys, arguments):
    assert "pore.width" in refused(tmp_path / "sweep", capsys, *arguments) and not (tmp_path / "sweep").exists()


def test_two_sweeps_in_one_folder_are_refused(copied, capsys):
    fcntl = pytest.importorskip("fcntl", reason="locks are held where the system has them")
    with (copied / ".lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        assert "another sweep is at work" in refused(copied, capsys, *VARY, *SHORT)


def test_the_page_needs_no_network_and_escapes_what_it_tells(finished):
    told = (finished / "summary.html").read_text()
    assert "<svg" in told and told.count("<polyline") == 2 and "2 of 3 runs" in told and "Peclet" in told
    assert not re.search(r"https?:|<script|<img|@import|url\(|src=", told)
    (style,) = re.findall("<style>(.*?)</style>", told, re.S)
    digest = base64.b64encode(hashlib.sha256(style.encode()).digest()).decode()
    (policy,) = re.findall('http-equiv="Content-Security-Policy" content="(.*?)"', told)
    assert policy == (f"default-src 'none'; style-src 'sha256-{digest}'; script-src 'none'; base-uri 'none'; "
                      "form-action 'none'") and ' style="' not in told
    factors = [parse("numerics.preset=fast, paper")]
    found = points("base", [], factors, grid(factors))
    strange = Sweep(finished, '<script>alert("1")</script>', factors, found)
    made = page.page(strange, table.tell(strange, {1: "failed: <b>&"}, 0.1), 0.1)
    assert "<script" not in made and "<b>" not in made and "&lt;script&gt;" in made and "failed: &lt;b&gt;&amp;" in made


def two_factors(tmp_path):
    """Tables of a sweep of two factors of other sizes, and of other units."""
    made = sweep(tmp_path / "sweep", "--vary", "pore.width=40 um, 50 um, 60 um", "--vary",
                 "flow.mean_velocity=1 m/day, 3 m/day", "--quiet", scene="flow_only")
    assert made == 0
    return rows(tmp_path / "sweep" / "table.csv"), rows(tmp_path / "sweep" / "runs.csv")


def test_rows_have_the_values_that_their_runs_were_made_with(tmp_path):
    """In both tables: what a run was made with, and what came of it, a velocity of its own scene."""
    table_rows, runs = two_factors(tmp_path)
    assert len(table_rows) == len(runs) == 6
    for row in (*table_rows, *runs):
        (one,) = [each for each in runs if each["run"] == row["run"]]
        scene = json.loads((tmp_path / "sweep" / one["folder"] / "run.json").read_text())["tables"]
        assert float(row["pore.width_um"]) == float(scene["pore"]["width"].split()[0])
        velocity = float(scene["flow"]["mean_velocity"].split()[0]) * 24e-6
        assert float(row["flow.mean_velocity_m_per_day"]) == pytest.approx(velocity, rel=1e-12)
        if "mean_velocity_m_per_d" in row:
            assert float(row["mean_velocity_m_per_d"]) == pytest.approx(velocity, rel=1e-12)
    assert len({(row["pore.width_um"], row["flow.mean_velocity_m_per_day"]) for row in table_rows}) == 6


def test_a_line_of_the_page_is_the_course_of_its_run(tmp_path):
    """What is drawn, read off the ticks of the axes, is conductivity against biomass of the run that its title names.
    """
    factors = [parse("pore.width=40 um, 50 um")]
    found = points("flow_only", [], factors, grid(factors))
    biomass, relative = np.array([0.1, 0.2, 0.4]), np.array([1.0, 0.6, 0.3])
    told = [table.Told(point, "completed", np.array([0.0, 1.0, 2.0]), relative**k, k * biomass,
                       dict.fromkeys(table.COLUMNS)) for k, point in enumerate(found, 1)]
    made = page.page(Sweep(tmp_path, "base", factors, found), told, 0.1)
    picture = made[made.index("<h2>Conductivity against biomass"): made.index("<h2>Clogging time")]
    assert [label in picture for label in ("biomass: aggregate area", "conductivity / initial")] == [True, True]
    across = re.findall(r'<text x="([\d.]+)" y="[\d.]+" text-anchor="middle">([\d.]+)</text>', picture)
    upward = re.findall(r'<text x="[\d.]+" y="([\d.]+)" text-anchor="end">([\d.]+)</text>', picture)
    (x, x0), (y, y0) = (np.polyfit(*np.array(ticks, float).T, 1) for ticks in (across, upward))
    lines = re.findall('<polyline [^>]*points="([^"]*)"><title>run ([12])', picture)
    assert [number for _, number in lines] == ["1", "2"]
    for (drawn, _), one in zip(lines, told):
        places = np.array([pair.split(",") for pair in drawn.split()], float)
        assert x * places[:, 0] + x0 == pytest.approx(one.biomass, abs=0.002)
        assert y * (places[:, 1] + 4) + y0 == pytest.approx(one.relative, abs=0.005)


@pytest.mark.parametrize("part", [0.5, 0.1, 0.013])
def test_clogging_time_of_an_exponential_fall_is_exact(part):
    """K / K_0 = exp(-t / 3), with biomass t / 10: whatever the rows, t = -3 ln part."""
    times = np.array([0.0, 0.7, 2.0, 5.0, 9.0, 20.0])
    found = table.clogging(times, np.exp(-times / 3), times / 10, part)
    assert found == pytest.approx((-3 * math.log(part), -0.3 * math.log(part)), rel=1e-12)


def test_what_has_not_clogged_has_no_time():
    assert np.isnan(table.clogging(np.array([0.0, 1.0]), np.array([1.0, 0.2]), np.array([0.1, 0.2]), 0.1)).all()


def test_biomass_and_contact_are_read_from_the_rows(finished, tmp_path):
    """Biomass is the area over the pore's; contact the first row that has it."""
    source = finished / rows(finished / "runs.csv")[0]["folder"]
    factors = [parse("flow.mean_velocity=2.9 m/day")]
    sets = SHORT[1::2]
    made = Sweep(tmp_path, "base", factors, points("base", sets, factors, grid(factors)))
    place = shutil.copytree(source, made.runs / made.points[0].name)
    lines = rows(place / "timeseries.csv")
    for k, line in enumerate(lines):
        line.update(contact=int(k >= 1), conductivity_m_per_d=0.05 ** k, aggregate_area_um2=30.0 * (k + 1))
    results.write_table(place / "timeseries.csv", results.COLUMNS, [list(line.values()) for line in lines])
    (told,) = table.tell(made, {}, 0.1)
    assert told.biomass.tolist() == [30 * (k + 1) / (50 * 600) for k in range(len(lines))]
    assert told.numbers["contact_time_h"] == float(lines[1]["time_h"]) and told.numbers["contact_biomass"] == 0.002
    assert told.numbers["contact_relative_conductivity"] == 0.05
    assert 0 < told.numbers["clogging_time_h"] < told.numbers["contact_time_h"]


def test_a_killed_run_is_one_runs_failure(tmp_path):
    """The process that is killed is not the one that answers."""
    code = ("import os, signal, sys; from repro.sweep import server, task\n"
            "kill = lambda: os.kill(os.getpid(), signal.SIGKILL)\n"
            "task.make = lambda scene, *rest: kill() if scene.name == 'base' else 'well'\n"
            "server.main()")
    killed = "failed: the process of the run was killed by SIGKILL"
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "text": True}
    with subprocess.Popen([sys.executable, "-c", code], **pipes) as one:
        for name, said in (("base", killed), ("flow_only", "well"), ("base", killed)):
            one.stdin.write(ask(load_scene(name), tmp_path / "run", tmp_path / "part") + "\n")
            one.stdin.flush()
            assert json.loads(one.stdout.readline()) == said
    assert one.returncode == 0


@pytest.mark.parametrize("name, sets", [("base", []), ("wide", ['output.times=["1 h", "3 h"]']), ("initial_mesh", []),
                                        ("base", ['aggregate={outline=[["-5 um", "0 um"], ["0 um", "4 um"], '
                                                  '["6 um", "0 um"]]}'])])
def test_a_scene_comes_to_the_other_process_bit_by_bit(name, sets):
    scene = load_scene(name, sets)
    assert server._asked(ask(scene, Path("a"), Path("b"))) == (scene, Path("a"), Path("b"))


def test_a_server_that_has_died_is_started_again(tmp_path):
    scene, one = load_scene("initial_mesh", ["numerics.preset=fast"]), Server()
    asked = ask(scene, tmp_path / "run", tmp_path / "part")
    try:
        assert one.make(asked) == "completed"
        one.process.kill()
        one.process.wait()
        assert one.make(asked) == "failed: the process of the run was killed by SIGKILL"
        shutil.rmtree(tmp_path / "run")
        assert one.make(asked) == "completed" and (tmp_path / "run" / "run.json").exists()
    finally:
        one.close()


def children(pid):
    """Processes that a process has started, and theirs."""
    table = [line.split() for line in subprocess.run(["ps", "-eo", "pid=,ppid="], capture_output=True, text=True,
                                                     check=True).stdout.splitlines()]
    own = [int(child) for child, parent in table if int(parent) == pid]
    return own + [found for child in own for found in children(child)]


def started(out, *arguments):
    """A sweep in another process, and the process of a run that is at work."""
    command = [sys.executable, "-m", "repro", "sweep", "base", "--out", str(out), *arguments]
    process = subprocess.Popen(command, stderr=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    deadline = time.monotonic() + 60
    while time.monotonic() < deadline:
        time.sleep(0.05)
        runs = [pid for own in children(process.pid) for pid in children(own)]
        if runs and list(out.glob("runs/.part-*/fields/*.vtu")):
            return process, runs
    raise AssertionError("no run has begun")


@pytest.mark.thorough
def test_killing_the_process_of_a_run_harms_no_other(tmp_path):
    process, runs = started(tmp_path / "sweep", "--vary", "pore.width=48 um, 50 um, 52 um", "--workers", "1",
                            "--set", 'growth.end="6 h"')
    os.kill(runs[0], signal.SIGKILL)
    process.communicate(timeout=120)
    assert process.returncode == 3
    found = [row["status"] for row in rows(tmp_path / "sweep" / "runs.csv")]
    assert found == ["failed: the process of the run was killed by SIGKILL", "completed", "completed"]


def test_sigterm_ends_a_sweep_quietly(tmp_path):
    """Status 143, one line, tables of what there is, no process left."""
    out = tmp_path / "sweep"
    process, _ = started(out, "--vary", "pore.width=48 um, 50 um", "--workers", "1", "--quiet")
    family = children(process.pid)
    process.terminate()
    said = process.communicate(timeout=60)[1]
    assert process.returncode == 143 and said.startswith("repro: terminated") and said.count("\n") == 1, said
    assert (out / "table.csv").exists() and (out / "summary.html").exists() and not any(map(alive, family))


@pytest.mark.parametrize("asked, started", [(None, 2), (400, 2), (1, 1)])
def test_there_are_no_more_processes_than_runs(tmp_path, monkeypatch, asked, started):
    seen = []

    @contextmanager
    def ready(workers):
        seen.append(workers)
        yield lambda points, folder: iter([(point, "failed: not made") for point in points])

    monkeypatch.setattr(pool, "ready", ready)
    monkeypatch.setattr(pool, "cores", lambda: 64)
    done = repro.sweep("base", ["pore.width=48 um, 50 um"], tmp_path / "sweep", workers=asked)
    assert seen == [started] and len(done.runs) == 2


def test_nobody_reads_what_a_sweep_says(tmp_path):
    """As under `| head -0`: it goes on to its end."""
    command = [sys.executable, "-m", "repro", "sweep", "base", "--out", str(tmp_path / "sweep"), *VARY, *SHORT]
    process = subprocess.Popen(command, stderr=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    process.stdout.close()
    message = process.stderr.read()
    process.stderr.close()
    assert process.wait(120) == 3 and "Traceback" not in message and "BrokenPipe" not in message


@pytest.mark.thorough
@pytest.mark.parametrize("how", [signal.SIGINT, signal.SIGKILL])
def test_a_sweep_that_was_cut_off_is_gone_on_with(tmp_path, how):
    """No process of it is left, and the same command ends with every run there once."""
    out, arguments = tmp_path / "sweep", ["--vary", "pore.width=48 um, 50 um, 52 um", "--workers", "2",
                                          "--set", 'growth.end="10 h"']
    process, runs = started(out, *arguments)
    family = children(process.pid)
    process.send_signal(how)
    said = process.communicate(timeout=60)[1]
    assert process.returncode == (130 if how == signal.SIGINT else -signal.SIGKILL) and "Traceback" not in said
    deadline = time.monotonic() + 20
    while any(map(alive, family)) and time.monotonic() < deadline:
        time.sleep(0.1)
    assert not any(map(alive, family)) and set(runs) <= set(family)
    assert sweep(out, *arguments) == 0
    assert [row["status"] for row in rows(out / "runs.csv")] == ["completed"] * 3
    assert len(list((out / "runs").iterdir())) == 3


def alive(pid):
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    state = subprocess.run(["ps", "-o", "stat=", "-p", str(pid)], capture_output=True, text=True).stdout
    return bool(state.strip()) and not state.strip().startswith("Z")
