"""A sweep as its user has it: runs, tables, page, what is refused, what is gone on with, what kills a run."""

import html
import json
import math
import multiprocessing
import os
import re
import runpy
import shutil
import signal
import subprocess
import sys
from contextlib import contextmanager, suppress
from pathlib import Path
from unittest.mock import Mock

import numpy as np
import pytest

import repro
from repro import results
from repro.cli import main
from repro.runs.machine import THREADS
from repro.runs.whole import damage, record_of
from repro.sweeps import page, pool, table, task
from repro.sweeps.design import grid, latin, parse, points
from repro.sweeps.state import Sweep
from tests import shell
from tests.faults import little_memory
from tests.pages import HOSTILE, check_alone
from tests.shell import flip, rewrite, rows, told
from tests.strategies import number
from tests.test_sweep_cluster import until

SHORT = ["--set", "numerics.preset=fast", "--set", 'growth.end="0.4 h"']
#: The second is too slow to carry substrates: it fails by construction.
VARY = ["--vary", "flow.mean_velocity=2.9 m/day, 1e-12 m/day, 5.8 m/day"]


def sweep(out, *arguments, scene="base"):
    return main(["sweep", scene, "--out", str(out), *arguments])


@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    """A sweep with a failure; not to be changed."""
    out = tmp_path_factory.mktemp("finished") / "sweep"
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("OMP_NUM_THREADS", "8")
        assert sweep(out, *VARY, *SHORT, "--quiet") == 3
    return out


@pytest.fixture
def copied(finished, tmp_path):
    return Path(shutil.copytree(finished, tmp_path / "sweep"))


def test_every_run_has_its_place_and_a_failure_is_recorded(finished):
    record = json.loads((finished / "sweep.json").read_text())
    assert sorted(finished.glob("runs/*")) == [finished / point["folder"] for point in record["points"]]
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
    """Bit by bit what `repro run` makes, with one thread whatever else is set."""
    ours, alone = finished / rows(finished / "runs.csv")[2]["folder"], tmp_path / "run"
    assert main(["run", "base", "--unset", "flow.head", "--set", "flow.mean_velocity=5.8 m/day", *SHORT,
                 "--out", str(alone)]) == 0
    assert (ours / "timeseries.csv").read_bytes() == (alone / "timeseries.csv").read_bytes()
    assert {told(ours)["conditions"]["threads"][name] for name in THREADS} == {"1"}


@contextmanager
def in_this_process(workers):
    """What makes runs, one after the other and without a server."""
    def each(points, folder):
        for point in points:
            yield point, task.make(point.scene, folder / point.name)

    yield each


def test_a_run_that_is_not_whole_is_made_again(copied, capsys, monkeypatch):
    """By the same command, and nothing else, whatever a sweep that was killed has left: the tables are as before."""
    monkeypatch.setattr(pool, "ready", in_this_process)
    first, _, last = [copied / row["folder"] for row in rows(copied / "runs.csv")]
    before = {path: path.read_bytes() for path in (copied / "table.csv", last / "timeseries.csv", first / "run.json")}
    there = sorted(copied.glob("runs/*"))
    (last / "timeseries.csv").write_text((last / "timeseries.csv").read_text()[:300])
    assert sweep(copied, *VARY, *SHORT) == 3
    assert {path: path.read_bytes() for path in before} == before and sorted(copied.glob("runs/*")) == there
    out, err = capsys.readouterr()
    assert "2 of 3 runs done, 1 failed" in out and "run 2 (flow.mean_velocity = 1e-12 m/day): failed" in err
    assert "run 3, flow.mean_velocity = 5.8 m/day: completed" in err and "run 1, " not in err


@pytest.mark.parametrize("asked, started", [(None, 2), (400, 2), (1, 1)])
def test_there_are_no_more_processes_than_runs(tmp_path, monkeypatch, asked, started):
    monkeypatch.setattr(pool, "ready", Mock(wraps=in_this_process))
    monkeypatch.setattr(pool, "cores", lambda: 64)
    repro.sweep("flow_only", ["pore.width=48 um, 50 um"], tmp_path / "sweep", workers=asked)
    pool.ready.assert_called_once_with(started)


def test_another_run_in_the_place_of_one_is_refused(copied, capsys):
    """And a link to one: neither told as this one nor removed."""
    first, _, last = [copied / row["folder"] for row in rows(copied / "runs.csv")]
    shutil.rmtree(last)
    last.symlink_to(first)
    assert f"{last}: it is a link, or no folder, and so not of this sweep" in refused(copied, capsys, *VARY, *SHORT)
    last.unlink()
    shutil.copytree(first, last)
    assert f"{last}: it holds the run of another scene; move it away" in refused(copied, capsys, *VARY, *SHORT)


def refused(out, capsys, *arguments):
    return shell.refused(out, capsys, "sweep", "base", "--out", out, *arguments)


@pytest.mark.parametrize("change, arguments, said", [
    ({}, ["--vary", "pore.width=50 um, 60 um"], "another sweep (base, 3 runs)"),
    ({}, [*VARY, "--set", "flow.viscosity_ratio=5"], "another sweep"),
    ({"code": "0.0.1-abc"}, VARY, "begun with version 0.0.1-abc"), ('{"points": 1}', VARY, "sweep.json cannot be read"),
    ("{", VARY, "sweep.json cannot be read"), ("null", VARY, "sweep.json cannot be read"),
    ({"points": 3}, VARY, "sweep.json cannot be read"), ("[" * 100_000, VARY, "sweep.json cannot be read")])
def test_a_folder_of_another_sweep_is_refused(copied, capsys, change, arguments, said):
    """Of other runs, of other code, or with a record that is broken."""
    record = copied / "sweep.json"
    record.write_text(change if isinstance(change, str) else json.dumps(json.loads(record.read_text()) | change))
    assert said in refused(copied, capsys, *arguments, *SHORT)


def test_what_is_not_of_a_sweep_is_left_alone(tmp_path, capsys):
    """A folder with other files, and a file in its place; nothing is written before every run is checked."""
    mine = tmp_path / "thesis.tex"
    mine.write_text("years of work")
    assert "thesis.tex" in refused(tmp_path, capsys, *VARY)
    assert "folder" in refused(mine, capsys, *VARY)
    assert "run 2 (pore.width = 4 um)" in refused(tmp_path / "sweep", capsys, "--vary", "pore.width=50 um, 4 um")


def test_two_sweeps_in_one_folder_are_refused(copied, capsys):
    fcntl = pytest.importorskip("fcntl", reason="locks are held where the system has them")
    with (copied / ".lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        assert "another process is writing there" in refused(copied, capsys, *VARY, *SHORT)


def test_the_page_needs_no_network_and_escapes_what_it_tells(finished):
    text = (finished / "summary.html").read_text()
    assert len(re.findall("<polyline[^>]*><title>", text)) == 2 and "2 of 3 runs" in text and "Peclet" in text
    found = check_alone(text)
    assert [kind for kind, _, _ in found.scripts] == ["style"] and "script-src 'none'" in text
    assert [link.rstrip("/") for link in found.outside] == [run["folder"] for run in rows(finished / "runs.csv")]
    factors = [parse("numerics.preset=fast, paper")]
    strange = Sweep(finished, HOSTILE, factors, points("base", [], factors, grid(factors)))
    made = page.page(strange, table.tell(strange, {1: f"failed: {HOSTILE}"}, 0.1), 0.1)
    assert "<script" not in made and "<img" not in made and made.count(html.escape(HOSTILE)) == 3


def test_the_table_of_the_page_is_that_of_the_runs(finished):
    """What was varied with its unit, numbers to four digits under their names, and how each ended, in a word."""
    head, *lines = re.findall("<tr>(.*?)</tr>", (finished / "summary.html").read_text())
    names = re.findall("<th.*?>(.*?)</th>", head)
    for line, run in zip(lines, rows(finished / "runs.csv"), strict=True):
        shown = dict(zip(names, (re.sub("<.*?>", "", cell) for cell in re.findall("<td.*?</td>", line)), strict=True))
        end, wall = (run[column] and f"{float(run[column]):.4g}" for column in ("end_h", "wall_time_s"))
        wanted = {"run": run["run"], "flow.mean_velocity": f"{run['flow.mean_velocity_m_per_day']} m/day",
                  "end (h)": end, "wall time (s)": wall, "clogged (h)": "", "contact (h)": "",
                  "status": run["status"].partition(":")[0]}
        assert {name: shown[name] for name in wanted} == wanted


def test_rows_have_the_values_that_their_runs_were_made_with(tmp_path):
    """In both tables, of two factors of other sizes and units: what a run was made with, and what came of it, a
    velocity of its own scene."""
    out = tmp_path / "sweep"
    assert sweep(out, "--vary", "pore.width=40 um, 50 um, 60 um", "--vary", "flow.mean_velocity=1 m/day, 3 m/day",
                 "--quiet", scene="flow_only") == 0
    table_rows, runs = rows(out / "table.csv"), rows(out / "runs.csv")
    assert len(table_rows) == len(runs) == 6
    for row in (*table_rows, *runs):
        (one,) = [each for each in runs if each["run"] == row["run"]]
        scene = told(out / one["folder"])["tables"]
        assert float(row["pore.width_um"]) == number(scene["pore"]["width"])
        velocity = number(scene["flow"]["mean_velocity"]) * 24e-6
        columns = {"flow.mean_velocity_m_per_day", "mean_velocity_m_per_d"} & row.keys()
        assert [float(row[name]) for name in columns] == pytest.approx([velocity] * len(columns), rel=1e-12)
    assert "mean_velocity_m_per_d" in table_rows[0]
    assert len({(row["pore.width_um"], row["flow.mean_velocity_m_per_day"]) for row in table_rows}) == 6


def test_every_option_of_the_command_is_heeded(tmp_path, monkeypatch):
    """Each width of a hypercube to its last digit, in the tables and in the scenes."""
    monkeypatch.setattr(pool, "ready", in_this_process)
    out, varied = tmp_path / "sweep", "pore.width=40:60 um:linear"
    assert sweep(out, "--vary", varied, "--samples", "2", "--seed", "5", "--unset", "aggregate", "--clogged", "0.4",
                 "--quiet", scene="flow_only") == 0
    runs = rows(out / "runs.csv")
    scenes = [told(out / run["folder"])["tables"] for run in runs]
    wanted = latin([parse(varied)], 2, 5)
    assert [(number(scene["pore"]["width"]),) for scene in scenes] == wanted
    assert [(float(run["pore.width_um"]),) for run in runs] == wanted
    assert not any("aggregate" in scene for scene in scenes)
    assert "has fallen to 0.4;" in (out / "summary.html").read_text()


@pytest.mark.parametrize("part", [0.5, 0.1, 0.013])
def test_clogging_time_of_an_exponential_fall_is_exact(part):
    """K / K_0 = exp(-t / 3), with biomass t / 10: whatever the rows, t = -3 ln part; none before it has fallen so far.
    """
    times = np.array([0.0, 0.7, 2.0, 5.0, 9.0, 20.0])
    course = times, np.exp(-times / 3), times / 10
    assert table.clogging(*course, part) == pytest.approx((-3 * math.log(part), -0.3 * math.log(part)), rel=1e-12)
    assert np.isnan(table.clogging(*course, 1e-3)).all()
    assert table.clogging(np.arange(4.0), np.array([1, 0.25, 1, 0.25]), np.arange(4.0), 0.5) == (0.5, 0.5)


def test_biomass_and_contact_are_read_from_the_rows(finished, tmp_path):
    """Biomass is the area over the pore's; contact the first row that has it."""
    source = finished / rows(finished / "runs.csv")[0]["folder"]
    factors = [parse("flow.mean_velocity=2.9 m/day")]
    sets = SHORT[1::2]
    made = Sweep(tmp_path, "base", factors, points("base", sets, factors, grid(factors)))
    place = Path(shutil.copytree(source, made.runs / made.points[0].name))
    lines = rows(place / "timeseries.csv")
    for k, line in enumerate(lines):
        line.update(contact=int(k >= 1), conductivity_m_per_d=3 * 0.05 ** k, aggregate_area_um2=30.0 * (k + 1))
    results.write_table(place / "timeseries.csv", results.COLUMNS, [list(line.values()) for line in lines])
    rewrite(place, sha256={})
    (found,) = table.tell(made, {}, 0.1)
    assert found.biomass.tolist() == [30 * (k + 1) / (50 * 600) for k in range(len(lines))]
    assert found.numbers["contact_time_h"] == float(lines[1]["time_h"]) and found.numbers["contact_biomass"] == 0.002
    assert found.numbers["contact_relative_conductivity"] == pytest.approx(0.05)
    assert found.numbers["end_h"] == float(lines[-1]["time_h"])
    assert 0 < found.numbers["clogging_time_h"] < found.numbers["contact_time_h"]


def test_a_killed_run_is_one_runs_failure(tmp_path):
    """The others are made; neither is it a failure of all where the process that forks them is killed."""
    out = tmp_path / "sweep"
    process = begun(out, "--vary", "pore.width=48 um, 50 um, 52 um", "--workers", "1", *SHORT)
    until(lambda: list(out.glob("runs/0001*/fields/*.vtu")))
    os.kill(max(children(process.pid, 2)), signal.SIGKILL)
    until(lambda: list(out.glob("runs/0002*/fields/*.vtu")))
    [os.kill(each, signal.SIGKILL) for each in children(process.pid, 1) if children(each, 1)]
    said = process.communicate(timeout=60)
    assert process.returncode == 3, said
    first, *others = [row["status"] for row in rows(out / "runs.csv")]
    assert first == "failed: the process of the run was killed by SIGKILL" and others == ["completed"] * 2


def children(pid, generation):
    """The processes that a process has started, or that those have."""
    status = [Path(f"/proc/{each}/stat") for each in os.listdir("/proc") if each.isdigit()]
    parents = {}
    for path in status:
        with suppress(FileNotFoundError, ProcessLookupError):
            parents[int(path.parent.name)] = int(path.read_text().rpartition(")")[2].split()[1])
    found = {pid}
    for _ in range(generation):
        found = {child for child, parent in parents.items() if parent in found}
    return found


HOSTILE_MODULE = "import os\nos.mkdir(os.path.join({!r}, f'{{__name__}}-{{os.getpid()}}'))\nraise ImportError\n"
MODULES = ("numpy", "random", "tempfile", "socket", "repro", "scipy", "mmgpy", "distributed", "usercustomize")


def hostile_folder(tmp_path):
    """A working folder with modules that note who imports them, and where they note it."""
    here, notes = tmp_path / "here", tmp_path / "notes"
    here.mkdir()
    notes.mkdir()
    for name in MODULES:
        (here / f"{name}.py").write_text(HOSTILE_MODULE.format(str(notes)))
    return here, notes


def test_nothing_is_imported_from_the_working_folder(tmp_path):
    """By none of the processes of a sweep, whichever way it is started: the command, or a script elsewhere without a
    guard, which is not run again either."""
    here, notes = hostile_folder(tmp_path)
    script = tmp_path / "script.py"
    script.write_text("import repro\nprint(repro.sweep('flow_only', ['pore.width=48 um, 50 um'], 'again'))\n")
    command = ["-c", "import sys\nsys.path.remove('')\nfrom repro.cli import main\nsys.exit(main(sys.argv[1:]))",
               "sweep", "flow_only", "--vary", "pore.width=48 um, 50 um", "--out", "sweep"]
    for arguments in (command, [str(script)]):
        done = subprocess.run([sys.executable, *arguments], cwd=here, capture_output=True, text=True, timeout=120)
        assert done.returncode == 0 and done.stdout.count("2 of 2 runs done") == 1, done.stderr
    assert list(notes.iterdir()) == [] and len(rows(here / "sweep" / "table.csv")) == 2


def test_what_c_code_prints_does_not_reach_the_user(tmp_path, capfd):
    """On neither output of the process of a run, whose own failure is told in one line with its place."""
    (tmp_path / "noisy.py").write_text(
        "import os\nfrom repro.sweeps import task\n"
        "def made(scene, place, watch):\n    os.write(1, b'noise')\n    os.write(2, b'noise')\n    return {}['x']\n"
        "task._made = made\n")
    one = points("flow_only", [], [parse("pore.width=48 um")], [(48.0,)])
    end, answer = multiprocessing.get_context("fork").Pipe()
    child = os.fork()
    if not child:
        runpy.run_path(str(tmp_path / "noisy.py"))
        task.answer(answer, one[0].scene, tmp_path / "run", 0.0)
        os._exit(0)
    os.waitpid(child, 0)
    assert end.recv() == "failed: KeyError: 'x' (noisy.py, line 6)" and capfd.readouterr() == ("", "")


@pytest.mark.parametrize("name", ["runs/{run}/notes.txt", "runs/{run}/fields/mine.vtu", "runs/.part-{run}/notes.txt"])
@pytest.mark.parametrize("spoil", ["failed", pytest.param("damaged", marks=pytest.mark.thorough)])
def test_what_others_have_put_beside_a_run_stays(copied, monkeypatch, name, spoil):
    """Where the run is tried again since it has failed, or is made again since it is damaged."""
    monkeypatch.setattr(pool, "ready", in_this_process)
    run = (copied / rows(copied / "runs.csv")[2]["folder"])
    rewrite(run, status="failed: so") if spoil == "failed" else flip(run / "timeseries.csv")
    mine = copied / name.format(run=run.name)
    mine.parent.mkdir(exist_ok=True)
    mine.write_text("years of work")
    assert sweep(copied, *VARY, *SHORT, "--quiet") == 3
    assert mine.read_text() == "years of work"
    assert rows(copied / "runs.csv")[2]["status"] == "completed" and not damage(run, record_of(run))


@pytest.mark.parametrize("arrange, why", [
    (lambda out, run: run.mkdir(parents=True) or (run / "thesis.tex").write_text("work"), "it holds 'thesis.tex'"),
    (lambda out, run: (out / "runs").symlink_to(out.parent), "runs: it is a link, or no folder"),
    (lambda out, run: run.parent.mkdir() or run.symlink_to(out.parent), "it is a link, or no folder"),
    (lambda out, run: (out / "runs").write_text("mine"), "runs: it is a link, or no folder")])
def test_places_that_are_not_of_a_sweep_are_refused(tmp_path, capsys, arrange, why):
    """A folder of somebody's without a run, links in the place of all runs and of one: before anything is written."""
    factors = [parse("pore.width=48 um, 50 um")]
    (tmp_path / "sweep").mkdir()
    arrange(tmp_path / "sweep", tmp_path / "sweep" / "runs" / points("base", [], factors, grid(factors))[0].name)
    assert why in refused(tmp_path / "sweep", capsys, "--vary", "pore.width=48 um, 50 um")


@pytest.mark.parametrize("name", ["sweep.json", "run.json", "timeseries.csv",
                                  pytest.param("ledger.csv", marks=pytest.mark.thorough)])
@pytest.mark.parametrize("spoil", [lambda path: (path.unlink(), os.mkfifo(path)),
                                   lambda path: os.truncate(path, 3 * 2**30)])
def test_pipes_and_files_of_gigabytes_do_not_stop_a_sweep(copied, capsys, monkeypatch, name, spoil):
    """They are refused, or made again where they are the run's, and neither waited for nor read."""
    monkeypatch.setattr(pool, "ready", in_this_process)
    run = copied / rows(copied / "runs.csv")[2]["folder"]
    spoil(copied / name if name == "sweep.json" else run / name)
    with little_memory(2**28):
        status = sweep(copied, *VARY, *SHORT, "--quiet")
    message = capsys.readouterr().err
    if name in ("sweep.json", "run.json"):
        assert status == 2 and message.count("\n") == 1 and name in message
    else:
        assert status == 3 and (run / name).is_fifo() == (f"{run / name}: it is a link, or no regular" in message)


def test_an_altered_cell_of_a_run_does_not_reach_the_table(copied, monkeypatch):
    """The run is made again."""
    monkeypatch.setattr(pool, "ready", in_this_process)
    table_before = (copied / "table.csv").read_bytes()
    flip(copied / rows(copied / "runs.csv")[2]["folder"] / "timeseries.csv", -20)
    assert sweep(copied, *VARY, *SHORT, "--quiet") == 3
    assert (copied / "table.csv").read_bytes() == table_before


def begun(out, *arguments):
    """`repro sweep base`, going."""
    command = [sys.executable, "-m", "repro", "sweep", "base", "--out", str(out), *arguments]
    return subprocess.Popen(command, stderr=subprocess.PIPE, stdout=subprocess.PIPE, text=True)


def cut_off(out, how, *arguments):
    """(exit status, what is said) of a sweep in another process that is sent a signal while a run is at work.

    No process of it is left: each would hold its standard error open."""
    process = begun(out, *arguments)
    until(lambda: list(out.glob("runs/0*/fields/*.vtu")))
    process.send_signal(how)
    said = process.communicate(timeout=20)[1]
    return process.returncode, said


@pytest.mark.parametrize("how, ends, word", [(signal.SIGTERM, 143, "terminated"), (signal.SIGINT, 130, "interrupted")])
def test_a_signal_ends_a_sweep_quietly(tmp_path, how, ends, word):
    """One line, which gives the command that continues it; tables of what there is."""
    out = tmp_path / "sweep"
    status, said = cut_off(out, how, "--vary", "pore.width=48 um, 50 um", "--workers", "1", "--quiet")
    command = f"repro sweep base --out {out} --vary 'pore.width=48 um, 50 um' --workers 1 --quiet goes on with it"
    assert status == ends and said.startswith(f"repro: {word}; ") and command in said and said.count("\n") == 1, said
    assert (out / "table.csv").exists() and (out / "summary.html").exists()


@pytest.mark.thorough
@pytest.mark.parametrize("how, ends", [(signal.SIGINT, 130), (signal.SIGKILL, -signal.SIGKILL)])
def test_a_sweep_that_was_cut_off_is_gone_on_with(tmp_path, how, ends):
    """The same command ends with every run there once."""
    out, arguments = tmp_path / "sweep", ["--vary", "pore.width=48 um, 50 um, 52 um", "--workers", "2",
                                          "--set", 'growth.end="10 h"']
    status, said = cut_off(out, how, *arguments)
    assert status == ends and "Traceback" not in said
    assert sweep(out, *arguments) == 0
    assert [row["status"] for row in rows(out / "runs.csv")] == ["completed"] * 3
    assert len(list((out / "runs").iterdir())) == 3
