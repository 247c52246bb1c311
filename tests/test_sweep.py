"""A sweep as its user sees it: runs, tables, page, refusals, resumes, killed runs and times of clogging."""
import html
import json
import math
import os
import re
import shutil
import signal
import subprocess
import sys
from concurrent.futures import CancelledError
from contextlib import closing, contextmanager, suppress
from pathlib import Path
from unittest.mock import Mock

import numpy as np
import pytest

import repro
from repro import results
from repro.cli import main
from repro.cli.sweep import SOME_FAILED, _report
from repro.report import charts
from repro.runs import execution
from repro.runs.machine import THREADS
from repro.runs.status import COMPLETED, FAILED, INTERRUPTED, RUNNING
from repro.sweeps import driver, page, pool, single_run, table
from repro.sweeps.design import latin, parse
from repro.sweeps.folder import Sweep
from tests import shell
from tests.pages import HOSTILE, check_alone
from tests.shell import read_record, rewrite, rows, start, until
from tests.strategies import number
from tests.test_sweep_design import make_points

#: The runs of a sweep are processes of their own.
pytestmark = pytest.mark.exact_lengths

SHORT = ["--set", "numerics.preset=fast", "--set", 'growth.end="0.4 h"', "--set", "output.every=0.2 h"]
#: The second flow is too slow to carry substrates, so that its run fails.
VARY = ["--vary", "flow.mean_velocity=2.9 m/day, 1e-12 m/day, 5.8 m/day"]


def sweep(out, *arguments, scene="base"):
    return main(["sweep", scene, "--out", str(out), *arguments])


@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    """A sweep with a failure. Tests do not change it."""
    out = tmp_path_factory.mktemp("finished") / "sweep"
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("OMP_NUM_THREADS", "8")
        assert sweep(out, *VARY, *SHORT, "--quiet") == 3
    return out


@pytest.fixture
def copied(finished, tmp_path):
    return Path(shutil.copytree(finished, tmp_path / "sweep"))


def test_every_run_has_its_folder_and_a_failure_is_recorded(finished):
    record = json.loads((finished / "sweep.json").read_text())
    assert sorted(finished.glob("runs/*")) == [finished / point["folder"] for point in record["points"]]
    runs = rows(finished / "runs.csv")
    assert [row["run"] for row in runs] == ["1", "2", "3"]
    assert [row["flow.mean_velocity_m_per_d"] for row in runs] == ["2.9", "1e-12", "5.8"]
    assert [row["status"].partition(":")[0] for row in runs] == ["completed", "failed", "completed"]
    assert "transport" in runs[1]["status"] and "Peclet" in runs[1]["status"]
    assert not (finished / runs[1]["folder"] / "run.json").exists(), "its first state fails: nothing is written"


def test_the_table_equals_those_of_the_runs(finished):
    """The table has a row for each run and time, with all digits of the run."""
    table_rows = rows(finished / "table.csv")
    for run in rows(finished / "runs.csv"):
        expected = rows(finished / run["folder"] / "timeseries.csv") if run["status"] == "completed" else []
        computed = [row for row in table_rows if row["run"] == run["run"]]
        names = results.column_names(repro.load_scene("base"))
        assert [dict(zip(names, map(row.get, names))) for row in computed] == expected
        assert {row["flow.mean_velocity_m_per_d"] for row in computed} <= {run["flow.mean_velocity_m_per_d"]}
    assert len(table_rows) > 3


def test_a_run_of_a_sweep_equals_a_separate_run(finished, tmp_path):
    """It equals `repro run` bit by bit, and uses one thread whatever else is set."""
    in_sweep, alone = finished / rows(finished / "runs.csv")[2]["folder"], tmp_path / "run"
    assert main(["run", "base", "--unset", "flow.head", "--set", "flow.mean_velocity=5.8 m/day", *SHORT,
                 "--out", str(alone)]) == 0
    assert (in_sweep / "timeseries.csv").read_bytes() == (alone / "timeseries.csv").read_bytes()
    assert {read_record(in_sweep)["conditions"]["threads"][name] for name in THREADS} == {"1"}


@contextmanager
def in_this_process(scheduler, workers):
    """Make the runs one after the other, without further processes."""
    def each(points, folder):
        for point in points:
            yield point, single_run.make(point.scene, folder / point.name)

    yield each


def test_a_damaged_run_is_made_again(copied, capsys, monkeypatch):
    """The same command makes this run alone again, and the tables are as before."""
    monkeypatch.setattr(driver, "ready", in_this_process)
    first, _, last = [copied / row["folder"] for row in rows(copied / "runs.csv")]
    before = {path: path.read_bytes() for path in (copied / "table.csv", last / "timeseries.csv", first / "run.json")}
    folders = sorted(copied.glob("runs/*"))
    (last / "timeseries.csv").write_text((last / "timeseries.csv").read_text()[:300])
    assert sweep(copied, *VARY, *SHORT) == 3
    assert {path: path.read_bytes() for path in before} == before and sorted(copied.glob("runs/*")) == folders
    out, err = capsys.readouterr()
    assert "2 of 3 runs done, 1 failed" in out and "run 2 (flow.mean_velocity = 1e-12 m/day): failed" in err
    assert "run 3, flow.mean_velocity = 5.8 m/day: completed" in err and "run 1, " not in err


@pytest.mark.parametrize("requested, started", [(None, 2), (400, 2), (1, 1)])
def test_there_are_no_more_processes_than_runs(tmp_path, monkeypatch, requested, started):
    monkeypatch.setattr(driver, "ready", Mock(wraps=in_this_process))
    monkeypatch.setattr(pool, "cores", lambda: 64)
    repro.sweep("flow_only", ["pore.width=48 um, 50 um"], tmp_path / "sweep", workers=requested)
    driver.ready.assert_called_once_with(None, started)


def test_a_folder_of_another_run_is_refused(copied, capsys, monkeypatch):
    monkeypatch.setattr(driver, "ready", in_this_process)
    first, _, last = [copied / row["folder"] for row in rows(copied / "runs.csv")]
    shutil.rmtree(last)
    shutil.copytree(first, last)
    assert f"{last}: it holds the run of another scene; move it away" in refused(copied, capsys, *VARY, *SHORT)
    shutil.rmtree(last)
    assert sweep(copied, *VARY, *SHORT, "--quiet") == 3 and read_record(last)["status"] == "completed"


def refused(out, capsys, *arguments):
    return shell.refusal(out, capsys, "sweep", "base", "--out", out, *arguments)


@pytest.mark.parametrize("change, arguments, message", [
    ({}, [*VARY, "--set", "flow.viscosity_ratio=5"], "another sweep (base, 3 runs)"),
    ({"code": "0.0.1-abc"}, VARY, "begun with version 0.0.1-abc"),
    *((content, VARY, "sweep.json cannot be read") for content in ('{"points": 1}', {"points": 3}, "[" * 100_000))])
def test_a_folder_of_another_sweep_is_refused(copied, capsys, change, arguments, message):
    """The folder has other runs, other code, or a broken record."""
    record = copied / "sweep.json"
    record.write_text(change if isinstance(change, str) else json.dumps(json.loads(record.read_text()) | change))
    assert message in refused(copied, capsys, *arguments, *SHORT)


def test_a_folder_with_other_files_is_left_unchanged(tmp_path, capsys):
    """A folder with other files, or a file in its place, is refused. All runs are checked before anything is written.
    """
    foreign = tmp_path / "thesis.tex"
    foreign.write_text("years of work")
    assert "thesis.tex" in refused(tmp_path, capsys, *VARY)
    assert "folder" in refused(foreign, capsys, *VARY)
    assert "run 2 (pore.width = 4 um)" in refused(tmp_path / "sweep", capsys, "--vary", "pore.width=50 um, 4 um")


def test_two_sweeps_in_one_folder_are_refused(copied, capsys):
    fcntl = pytest.importorskip("fcntl", reason="locks are held where the system has them")
    with (copied / ".lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        assert "another process is writing there" in refused(copied, capsys, *VARY, *SHORT)


def test_the_page_needs_no_network_and_escapes_its_texts(finished):
    text = (finished / "summary.html").read_text()
    assert len(re.findall("<polyline[^>]*><title>", text)) == 2 and "2 of 3 runs" in text and "Peclet" in text
    html_page = check_alone(text)
    assert [kind for kind, _, _ in html_page.scripts] == ["style"] and "script-src 'none'" in text
    assert [link.rstrip("/") for link in html_page.outside] == [run["folder"] for run in rows(finished / "runs.csv")]
    varied = "numerics.preset=fast, paper"
    strange = Sweep(finished, HOSTILE, [parse(varied)], make_points(varied))
    escaped = page.page(strange, table.read_runs(strange, {1: f"failed: {HOSTILE}"}, 0.1), 0.1)
    assert "<script" not in escaped and "<img" not in escaped and escaped.count(html.escape(HOSTILE)) == 3


def test_rows_have_the_inputs_of_their_runs(tmp_path, monkeypatch):
    """With two factors of other sizes and units, both tables have each run's inputs and its velocity."""
    monkeypatch.setattr(driver, "ready", in_this_process)
    out = tmp_path / "sweep"
    assert sweep(out, "--vary", "pore.width=40 um, 50 um, 60 um", "--vary", "flow.mean_velocity=1 m/day, 3 m/day",
                 "--quiet", scene="flow_only") == 0
    table_rows, runs = rows(out / "table.csv"), rows(out / "runs.csv")
    assert len(table_rows) == len(runs) == 6
    for row in (*table_rows, *runs):
        (one,) = [each for each in runs if each["run"] == row["run"]]
        scene = read_record(out / one["folder"])["tables"]
        assert float(row["pore.width_um"]) == number(scene["pore"]["width"])
        velocity = number(scene["flow"]["mean_velocity"])
        columns = {"flow.mean_velocity_m_per_d", "mean_velocity_m_per_d"} & row.keys()
        assert [float(row[name]) for name in columns] == pytest.approx([velocity] * len(columns), rel=1e-12)
    assert "mean_velocity_m_per_d" in table_rows[0]
    assert len({(row["pore.width_um"], row["flow.mean_velocity_m_per_d"]) for row in table_rows}) == 6


def test_every_option_of_the_command_has_its_effect(tmp_path, monkeypatch):
    """Tables and scenes have each width of the hypercube to its last digit."""
    monkeypatch.setattr(driver, "ready", in_this_process)
    out, varied = tmp_path / "sweep", "pore.width=40:60 um:linear"
    assert sweep(out, "--vary", varied, "--samples", "2", "--seed", "5", "--unset", "aggregate", "--clogged", "0.4",
                 "--quiet", scene="flow_only") == 0
    runs = rows(out / "runs.csv")
    scenes = [read_record(out / run["folder"])["tables"] for run in runs]
    expected = latin([parse(varied)], 2, 5)
    assert [(number(scene["pore"]["width"]),) for scene in scenes] == expected
    assert [(float(run["pore.width_um"]),) for run in runs] == expected
    assert not any("aggregate" in scene for scene in scenes)
    assert "has fallen to 0.4;" in (out / "summary.html").read_text()


def test_biomass_and_contact_are_read_from_the_rows(finished, tmp_path):
    """Biomass is the area over that of the pore; contact is at its first row. Conductivity is over that of the start,
    and not over its largest."""
    source = finished / rows(finished / "runs.csv")[0]["folder"]
    varied = "flow.mean_velocity=2.9 m/day"
    swept = Sweep(tmp_path, "base", [parse(varied)], make_points(varied, sets=SHORT[1::2]))
    folder = Path(shutil.copytree(source, swept.runs / swept.points[0].name))
    lines = rows(folder / "timeseries.csv")
    for k, line in enumerate(lines):
        line.update(contact=int(k >= 1), conductivity_m_per_d=(3, 0.15, 6)[min(k, 2)],
                    aggregate_area_um2=30.0 * (k + 1))
    results.write_table(folder / "timeseries.csv", list(lines[0]), [list(line.values()) for line in lines])
    rewrite(folder, sha256={})
    (summary,) = table.read_runs(swept, {}, 0.1)
    assert summary.biomass.tolist() == [30 * (k + 1) / (50 * 600) for k in range(len(lines))]
    assert summary.numbers["contact_time_h"] == float(lines[1]["time_h"])
    assert summary.numbers["contact_biomass"] == 0.002
    assert summary.numbers["contact_relative_conductivity"] == pytest.approx(0.05)
    assert summary.numbers["end_h"] == float(lines[-1]["time_h"])
    assert 0 < summary.numbers["clogging_time_h"] < summary.numbers["contact_time_h"]


@pytest.mark.thorough
def test_a_killed_run_fails_alone(tmp_path):
    """Its status names the signal, and the other runs are made."""
    out = tmp_path / "sweep"
    process = start("sweep", "base", "--out", out, "--vary", "pore.width=48 um, 50 um, 52 um", "--workers", "1",
                    *SHORT[:4])
    until(lambda: list(out.glob("runs/0001*/fields/*.vtu")))
    (child,) = children(process.pid)
    os.kill(child, signal.SIGKILL)
    outputs = process.communicate(timeout=60)
    assert process.returncode == 3, outputs
    first, *remaining = [row["status"] for row in rows(out / "runs.csv")]
    assert first == "failed: the process of the run was killed by SIGKILL" and remaining == ["completed"] * 2


def children(pid):
    """The processes that a process has started and that have not ended."""
    parents = {}
    for path in [Path(f"/proc/{each}/stat") for each in os.listdir("/proc") if each.isdigit()]:
        with suppress(FileNotFoundError, ProcessLookupError):
            parents[int(path.parent.name)] = int(path.read_text().rpartition(")")[2].split()[1])
    return [child for child, parent in parents.items() if parent == pid]


def two_points():
    return make_points("pore.width=48 um, 50 um", source="flow_only")


@pytest.mark.thorough
def test_a_process_killed_between_runs_costs_none(tmp_path):
    """Another process makes the next run."""
    with closing(pool.Processes()) as processes:
        for point in two_points():
            assert processes.make(point, tmp_path / point.name) == "completed"
            (last,) = processes._idle
            os.kill(last.pid, signal.SIGKILL)
            os.waitid(os.P_PID, last.pid, os.WEXITED | os.WNOWAIT)


def test_a_process_ends_with_its_parent():
    """Its standard input is a pipe from the parent."""
    with pool._start() as process:
        process.stdin.close()
        try:
            status = process.wait(60)
        except subprocess.TimeoutExpired:
            status = None
        process.kill()
    assert status == 1


def test_no_run_begins_after_the_end_of_a_sweep(tmp_path):
    """A thread may take a run just before the sweep ends."""
    processes = pool.Processes()
    processes.close()
    with suppress(CancelledError):
        processes.make(two_points()[0], tmp_path / "run")
    assert not (tmp_path / "run").exists() and not processes._started


def test_a_sweep_that_ends_early_stops_its_runs(tmp_path, monkeypatch):
    """An error in the caller's function ends the sweep. The second run is interrupted, the third is not begun, and no
    process is left when the tables are written."""
    def tell(event):
        if event["event"] == "run":
            until(lambda: list(tmp_path.glob("runs/0002*/run.json")))
            raise ArithmeticError

    left = []
    monkeypatch.setattr(table, "write", lambda *written: left.extend(children(os.getpid())))
    before = children(os.getpid())
    with pytest.raises(ArithmeticError):
        repro.sweep("base", ["growth.end=0.2 h, 19 h, 20 h"], tmp_path, ["numerics.preset=fast"], workers=1, tell=tell)
    (second,) = tmp_path.glob("runs/0002*")
    assert read_record(second)["status"] == INTERRUPTED and left == before
    assert not list(tmp_path.glob("runs/0003*"))


HOSTILE_MODULE = "import os\nos.mkdir(os.path.join({!r}, f'{{__name__}}-{{os.getpid()}}'))\nraise ImportError\n"
MODULES = ("numpy", "random", "tempfile", "socket", "repro", "scipy", "mmgpy", "distributed", "usercustomize")


def hostile_folder(tmp_path):
    """A working folder whose modules record their import, and the folder of the records."""
    working_folder, notes = tmp_path / "here", tmp_path / "notes"
    working_folder.mkdir()
    notes.mkdir()
    for name in MODULES:
        (working_folder / f"{name}.py").write_text(HOSTILE_MODULE.format(str(notes)))
    return working_folder, notes


@pytest.mark.thorough
def test_nothing_is_imported_from_the_working_folder(tmp_path):
    """This holds for a sweep that the command starts, and for one that a script without a guard starts. The script is
    not run again."""
    working_folder, notes = hostile_folder(tmp_path)
    script = tmp_path / "script.py"
    script.write_text("import repro\nprint(repro.sweep('flow_only', ['pore.width=48 um, 50 um'], 'again'))\n")
    command = ["-c", "import sys\nsys.path.remove('')\nfrom repro.cli import main\nsys.exit(main(sys.argv[1:]))",
               "sweep", "flow_only", "--vary", "pore.width=48 um, 50 um", "--out", "sweep"]
    for arguments in (command, [str(script)]):
        process = subprocess.run([sys.executable, *arguments], cwd=working_folder, capture_output=True, text=True,
                                 timeout=120)
        assert process.returncode == 0 and process.stdout.count("2 of 2 runs done") == 1, process.stderr
    assert list(notes.iterdir()) == [] and len(rows(working_folder / "sweep" / "table.csv")) == 2


def test_output_of_c_code_does_not_reach_the_user(tmp_path, capfd, monkeypatch):
    """It appears on neither output of a run's process. The run's failure is one line with its position."""
    (tmp_path / "noisy.py").write_text(
        "import os\nfrom repro.sweeps import single_run\n"
        "def made(scene, place, watch):\n    os.write(1, b'noise')\n    os.write(2, b'noise')\n    return {}['x']\n"
        "single_run._run_or_resume = made\n")
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setattr(pool, "COMMAND", ("-c", "import noisy; noisy.single_run.serve()"))
    ((_, status),) = pool.run_points(two_points()[:1], tmp_path, 1)
    assert status == "failed: KeyError: 'x' (noisy.py, line 6)" and capfd.readouterr() == ("", "")


@pytest.mark.parametrize("arrange, why", [
    (lambda out, run: run.mkdir(parents=True) or (run / "thesis.tex").write_text("work"), "it holds 'thesis.tex'"),
    (lambda out, run: (out / "runs").symlink_to(out.parent), "runs: it is a link, or no folder"),
    (lambda out, run: run.parent.mkdir() or run.symlink_to(out.parent), "it is a link, or no folder"),
    (lambda out, run: (out / "runs").write_text("mine"), "runs: it is a link, or no folder")])
def test_foreign_folders_and_links_are_refused(tmp_path, capsys, arrange, why):
    """A foreign folder, and links in place of all runs or of one, are refused before anything is written."""
    varied = "pore.width=48 um, 50 um"
    (tmp_path / "sweep").mkdir()
    arrange(tmp_path / "sweep", tmp_path / "sweep" / "runs" / make_points(varied)[0].name)
    assert why in refused(tmp_path / "sweep", capsys, "--vary", varied)


def sweep_of(folder, widths):
    varied = f"pore.width={widths}"
    return Sweep(folder, "flow_only", [parse(varied)], make_points(varied, source="flow_only"))


def record_end(swept, point, status, rows=1):
    """Record the end of a run of a sweep, with rows of t = 0 and ones; return its recorder."""
    (swept.runs / point.name).mkdir(parents=True)
    recorder = execution.Recorder(point.scene, swept.runs / point.name)
    recorder.history.rows = [[0.0, *[1.0] * (len(results.COLUMNS) - 1)]] * rows
    recorder.save(status)
    return recorder


#: Every status of a run, and whether the run is over.
ENDS = ["the aggregate reaches the pore's downstream end at t = 0 h", "aggregates left and 2 meet at t = 3.5 h",
        "the aggregate's surface folds in the step from t = 2 h: growth compressed it near x = 3 um"]
NAMED = [end.replace("the aggregate", "aggregate left") for end in ENDS if re.match("the aggregate( |'s)", end)]
STATUSES = dict.fromkeys([COMPLETED, *ENDS, *NAMED], True) | dict.fromkeys(
    [f"{FAILED}x", f"{FAILED}{ENDS[2]}", INTERRUPTED, RUNNING], False)


def test_every_status_takes_its_whole_path_through_a_sweep(tmp_path, capsys):
    """Which runs are made again, their rows in both tables, the page, and the exit status with a line for each run that
    is not over. A running run was killed: its table may be cut short."""
    widths = ", ".join(f"{40 + k} um" for k in range(len(STATUSES)))
    swept = sweep_of(tmp_path, widths)
    for point, status in zip(swept.points, STATUSES):
        record_end(swept, point, status, rows=2)
    repeated = []

    def run_points(missing, folder):
        for point in missing:
            repeated.append(point.index)
            yield point, "failed: again"

    again = driver.run_plan(swept, run_points)
    unfinished = [index for index, over in enumerate(STATUSES.values(), 1) if not over]
    assert repeated == unfinished == [run.point.index for run in again.failed]
    expected = ["failed: again" if status == RUNNING else status for status in STATUSES]
    lines = rows(tmp_path / "runs.csv")
    assert [line["status"] for line in lines] == expected
    assert [line["status"] for line in lines if line["fold_time_h"]] == [ENDS[2], NAMED[-1]]
    killed = [*STATUSES].index(RUNNING) + 1
    assert [row["run"] for row in rows(tmp_path / "table.csv")] == [
        str(index) for index in range(1, len(STATUSES) + 1) for _ in range(2 * (index != killed))]
    text = (tmp_path / "summary.html").read_text()
    assert f"{len(STATUSES) - len(unfinished)} of {len(STATUSES)} runs have come to their end" in text
    cells = re.findall(r'<td class="text( bad)?">(.*?)</td></tr>', text)
    assert cells == [("", html.escape(status)) if over else (" bad", html.escape(status.partition(":")[0]))
                     for status, over in zip(expected, STATUSES.values())]
    assert _report(again) == SOME_FAILED == 3
    printed = capsys.readouterr()
    for index, status in enumerate(expected, 1):
        line = f"repro: run {index} (pore.width = {39 + index} um): {status}\n"
        assert (line in printed.err) == (index in unfinished)
    assert f"{len(STATUSES) - len(unfinished)} of {len(STATUSES)} runs done, {len(unfinished)} failed" in printed.out


def test_a_run_without_rows_has_the_status_of_its_folder_or_attempt(tmp_path):
    """A run failed before t = 0. A run without a folder has the status of its attempt, or "not run"."""
    swept = sweep_of(tmp_path, "40 um, 50 um, 60 um")
    record_end(swept, swept.points[0], "failed: x", rows=0)
    for messages, second in (({}, "not run"), ({1: "failed: y", 2: "failed: z"}, "failed: z")):
        assert [run.status for run in table.read_runs(swept, messages, 0.1)] == ["failed: x", second, "not run"]


def test_a_sweep_converts_to_tables_and_pictures(tmp_path, monkeypatch):
    """The columns are those of runs.csv, with the last row of each run. Varied keys are dimensions of a grid, in the
    order of the design, and coordinates of a hypercube."""
    pandas, xarray = map(pytest.importorskip, ("pandas", "xarray"))
    monkeypatch.setattr(driver, "ready", in_this_process)
    changes = ["growth.end=0.4 h", "numerics.refinement=0.3"]
    varied = ["pore.width=50 um, 48 um", "flow.viscosity_ratio=100, 2000"]
    swept = repro.sweep("base", varied, tmp_path, changes)
    frame, array = swept.to_pandas(), swept.to_xarray()
    written = pandas.read_csv(tmp_path / "runs.csv", index_col="run")
    pandas.testing.assert_frame_equal(frame, written, check_dtype=False, rtol=1e-15)
    for run, path in zip(swept.runs, swept.paths):
        last = {name: float(value) for name, value in rows(path / "timeseries.csv")[-1].items() if value}
        assert {name: frame.loc[run.point.index, name] for name in last if name != "time_h"} == {
            name: value for name, value in last.items() if name != "time_h"}
        at = array.sel({"pore.width": run.point.values[0], "flow.viscosity_ratio": run.point.values[1]})
        assert float(at["conductivity_m_per_d"]) == last["conductivity_m_per_d"] and at["end_h"] == 0.4
    assert array["pore.width"].values.tolist() == [50.0, 48.0]
    assert array.sizes == {"pore.width": 2, "flow.viscosity_ratio": 2} and array["pore.width"].attrs["units"] == "um"
    assert isinstance(array, xarray.Dataset) and array["conductivity_m_per_d"].attrs["units"] == "m/day"
    for run in (swept.runs[3], swept.runs[1]):
        swept.runs.remove(run)
    assert swept.to_xarray().sizes == {"pore.width": 2, "flow.viscosity_ratio": 1}
    swept.runs.extend(5 * swept.runs)
    assert swept.to_xarray().sizes == {"run": 12} and repr(swept.runs).splitlines()[9:] == ["... and 3 more"]
    assert repr(swept.runs).startswith("<run 1 (50.0, 100.0): completed, to 0.4 h>")
    axes = swept.plot("conductivity")
    assert [line.get_label() for line in axes.lines] == ["flow.viscosity_ratio = 100"]
    assert axes.get_xlabel() == "pore.width (um)" and "m/day" in axes.get_ylabel()
    with pytest.raises(KeyError, match="porosity: runs.csv has end_h, "):
        swept.plot("porosity")


def test_events_of_a_run():
    """Half of the conductivity is reached between rows; a fold has the time of the last row."""
    series = {"time_h": np.array([0.0, 1.0, 2.0]), "conductivity_m_per_d": np.array([1.0, 0.8, 0.2]),
              "aggregate_area_um2": np.zeros(3), "contact": np.zeros(3)}
    folded = table.SweepRun(two_points()[0], ENDS[2], 0.1, series, 1.0)
    value = {number.name: number.reported(folded) for number in table.NUMBERS}
    assert value["half_conductivity_time_h"] == pytest.approx(1 + np.log(1.6) / np.log(4))
    assert value["fold_time_h"] == 2 and np.isnan(value["contact_time_h"]) and np.isnan(value["clogging_time_h"])


def test_marks_of_the_page_have_the_colour_of_their_key(tmp_path):
    """Two factors are varied, and each figure has the key of the other one. Dots are runs that clogged, triangles runs
    that ended before; failed runs have no mark. Lines go up with their values, and stay in the frame."""
    varied = "pore.width=40 um, 50 um", "flow.viscosity_ratio=100, 400, 1000"
    designed, course = make_points(*varied, source="flow_only"), np.array([1.0, 8.0])
    series = dict.fromkeys(("time_h", "conductivity_m_per_d", "aggregate_area_um2"), course)
    statuses = ["completed"] * 5 + ["failed: x"]
    runs = [table.SweepRun(one, status, 0.3, series) for one, status in zip(designed, statuses)]
    for run, time in zip(runs, (5.0, 5.0, None, 5.0, 5.0, None)):
        run.numbers["clogging_time_h"] = time
    text = page.page(Sweep(tmp_path, "flow_only", [*map(parse, varied)], designed), runs, 0.3)
    times = text.split("<h2>Clogging time")[1].split("<h2>")[0]
    figures = re.findall("<figure>.*?</figure>", times, re.S)
    for figure, key in zip(figures, ("flow.viscosity_ratio", "pore.width"), strict=True):
        named = dict(re.findall(r'class="line(.)" points="0,5 24,5"/></svg>([^<]*)</li>', figure))
        mark = rf'<(\w+) class="[a-z]+(.)"[^>]*><title>run (.)[^<]*?{key} = ([^,:]*)[^<]*?: ([^:<]*)</title>'
        marks = re.findall(mark, figure)
        assert len(marks) == 5 and "time to 0.3 of the conductivity (h)" in figure
        assert {named[level] == value for _, level, _, value, _ in marks} == {True}
        for kind, _, run, _, message in marks:
            assert (kind, message) == (("polygon", "after 8 h") if run == "3" else ("circle", "5 h"))
    lines = re.findall('<polyline class="line[0-9]" points="([^"]*)"><title>run', text)
    places = np.array([[pair.split(",") for pair in line.split()] for line in lines], float)
    assert len(lines) == 12 and (np.diff(places, axis=1) * [1, -1] > 0).all()
    assert (places >= (charts.LEFT, charts.TOP)).all()
    assert (places <= (charts.WIDTH - charts.RIGHT, charts.HEIGHT - charts.BOTTOM)).all()


def luminance(colour):
    """Relative luminance of a colour such as "#440154", by WCAG 2.2."""
    parts = np.array([*bytes.fromhex(colour[1:])]) / 255
    return np.where(parts <= 0.04045, parts / 12.92, ((parts + 0.055) / 1.055)**2.4) @ [0.2126, 0.7152, 0.0722]


def test_lines_are_visible_on_light_and_dark_pages():
    """Their contrast with the page is 2.5 at least. Lighter lines are those of larger values."""
    for background, rules in zip(("#ffffff", "#15171a"), page._colours().split("@media"), strict=True):
        assert rules.count(".dot") == page.LEVELS
        values = np.array([luminance(colour) for colour in re.findall("stroke: (#.{6})", rules)])
        lower, upper = np.sort([values, np.full(page.LEVELS, luminance(background))], axis=0)
        assert (np.diff(values) > 0).all() and ((upper + 0.05) / (lower + 0.05)).min() > 2.5


# ---------------------------------------------------------------- times of clogging


#: K / K_0 = exp(-t / 3).
TIMES = np.array([0.0, 0.7, 2.0, 5.0, 9.0, 20.0])
FALLING = np.exp(-TIMES / 3)


@pytest.mark.parametrize("times, relative, part, expected", [
    *((TIMES, FALLING, part, -3 * math.log(part)) for part in (0.5, 0.1, 0.013)), (TIMES, FALLING, 1e-3, math.nan),
    (np.arange(4.0), [1, 0.25, 1, 0.25], 0.5, 0.5),
    (np.arange(6.0), [1.0, 1.4, 1.2, 0.9, 0.45, 0.2], 0.5, 3 + math.log(0.9 / 0.5) / math.log(2)),
    (np.arange(6.0), [1.0, 0.8, 1.5, 0.75, 0.375, 3.0], 0.5, 3 + math.log(0.75 / 0.5) / math.log(2)),
    (np.arange(3.0), [1.0, 2.0, 3.0], 0.5, math.nan)])
def test_the_clogging_time_of_an_exponential_fall_is_exact(times, relative, part, expected):
    """For any rows it is the first time at which a part of the initial conductivity, not of the largest, is left. The
    biomass is 1 + t / 10."""
    computed = table.clogging(times, np.array(relative, float), 1 + times / 10, part)
    assert computed == pytest.approx((expected, 1 + expected / 10), rel=1e-12, nan_ok=True)
