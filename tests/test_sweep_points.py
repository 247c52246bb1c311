"""Own points of a sweep: their forms, refusals, the expected cost, and the time that is left."""

import re

import numpy as np
import pytest

import repro
from repro.cli import main
from repro.cli.sweep import _print_run
from repro.scene import SceneError
from repro.sweeps import driver, expected
from repro.sweeps.design import Factor, parse
from repro.sweeps.own_points import read
from tests.pages import cached_run
from tests.shell import refusal, rows
from tests.test_sweep import in_this_process

pytestmark = pytest.mark.exact_lengths

TABLE = 'pore.width (um), flow.mean_velocity ,numerics.preset\n48,1 m/day,fast\n\n5e1,2.5 m/day,"paper"\n'
#: The same points in other forms.
COLUMNS = {"pore.width (um)": np.array([48.0, 50.0]), "flow.mean_velocity (m/day)": [1, 2.5],
           "numerics.preset": ["fast", "paper"]}
FACTORS = [Factor("pore.width", "um", (48.0, 50.0)), Factor("flow.mean_velocity", "m/day", (1.0, 2.5)),
           Factor("numerics.preset", "", ("fast", "paper"))]


def frame(columns):
    return pytest.importorskip("pandas").DataFrame(columns)


def structured(columns):
    kinds = [(name, float if name.endswith(")") else "U5") for name in columns]
    return np.array(list(zip(*columns.values())), dtype=kinds)


@pytest.mark.parametrize("form", [dict, frame, structured, "file"])
def test_points_with_names_have_their_values_and_units(tmp_path, form):
    """Lines of a file may be blank, and its cells may have their units."""
    path = tmp_path / "points.csv"
    path.write_text(TABLE, encoding="utf-8-sig")
    assert read(path if form == "file" else form(COLUMNS), [], None) == (
        FACTORS, [(48.0, 1.0, "fast"), (50.0, 2.5, "paper")])


def test_points_of_the_unit_cube_are_scaled():
    """Those of an array and of an engine of SciPy; a list has its last value at 1."""
    qmc = pytest.importorskip("scipy.stats").qmc
    factors = [parse("pore.width=40:60 um:linear"), parse("flow.mean_velocity=1:100 m/day:log"),
               parse("numerics.preset=fast, paper")]
    assert read(np.array([[0, 0.5, 0], [1, 1, 1]]), factors, None) == (
        factors, [(40.0, pytest.approx(10), "fast"), (60.0, pytest.approx(100), "paper")])
    drawn = qmc.Sobol(3, rng=5).random(4)
    assert read(qmc.Sobol(3, rng=5), factors, 4) == read(drawn, factors, None)


RANGE = ["pore.width=40:60 um:linear"]


@pytest.mark.parametrize("points, vary, samples, part", [
    ({"pore.width (um)": [48, np.nan]}, [], None, 'row 2, column "pore.width (um)": "nan": a finite number'),
    ({"pore.width": ["48 um", "50 mm"]}, [], None, 'row 2, column "pore.width": "50 mm": a finite number in the unit'),
    ({"numerics.preset": ["fast", ""]}, [], None, 'row 2, column "numerics.preset": ""'),
    ({"pore.width (um)": [48, 50], "pore.length (um)": [600]}, [], None, 'row 2, column "pore.length (um)": ""'),
    ({"pore.width (s)": [48]}, [], None, 'row 1 (pore.width = 48 s): flow_only: pore.width = "48.0 s": a length'),
    ({"pore.width (um)": [48, 48]}, [], None, "row 2 (pore.width = 48 um): the same scene as run 1"),
    ({"pore.width (um)": [48], "pore.width (mm)": [0.04]}, [], None, 'row 0, column "pore.width (mm)": a key that no'),
    ({}, [], None, "0 points: from 1"), ({"pore.width (um)": [48]}, RANGE, None, "vary and samples: neither"),
    (np.array([[0.5], [1.5]]), RANGE, None, "row 2, column pore.width: 1.5: a number from 0 to 1"),
    (np.zeros((2, 2)), RANGE, None, "an array of shape (points, 1) is needed"),
    (np.zeros((2, 1)), RANGE, 2, "samples: an engine needs the number of points, an array has one"),
    (np.zeros((2, 1)), [], None, "vary: a range without a number of values is needed"),
    (np.zeros((10_001, 1)), RANGE, None, "10001 points")])
def test_bad_points_are_refused_in_one_line(tmp_path, points, vary, samples, part):
    """The line names row and column, and nothing is written."""
    with pytest.raises(SceneError) as refused:
        repro.sweep("flow_only", vary, tmp_path / "sweep", points=points, samples=samples, workers=1)
    message = str(refused.value)
    assert part in message and "\n" not in message and not list(tmp_path.iterdir())


@pytest.mark.parametrize("text, part", [
    ("pore.width (um)\n", "0 points"), ("pore.width (um)\n48,600\n", 'row 0, column ""'),
    ("pore.width (um)\n48\nx\n", 'row 2, column "pore.width (um)": "x'),
    (b"\xff", "it cannot be read as a CSV file"), (None, "it cannot be read as a CSV file")])
def test_a_bad_file_is_refused_by_its_name(tmp_path, capsys, text, part):
    path = tmp_path / "points.csv"
    if text is not None:
        path.write_bytes(text if isinstance(text, bytes) else text.encode())
    line = refusal(tmp_path / "sweep", capsys, "sweep", "flow_only", "--points", path, "--out", tmp_path / "sweep")
    assert line.startswith(f"repro: {path}: ") and part in line


def test_a_folder_and_points_are_needed(tmp_path, capsys):
    with pytest.raises(SceneError, match="^folder: a folder is needed"):
        repro.sweep("flow_only", ["pore.width=48 um"])
    assert "--vary: a key" in refusal(tmp_path, capsys, "sweep", "flow_only", "--out", tmp_path / "x")


def test_a_sweep_of_a_file_equals_that_of_its_columns(tmp_path, monkeypatch):
    """The page has the points, the last values, and no empty column."""
    monkeypatch.setattr(driver, "ready", in_this_process)
    path = tmp_path / "points.csv"
    path.write_text(TABLE)
    assert main(["sweep", "flow_only", "--points", str(path), "--out", str(tmp_path / "file"), "--quiet"]) == 0
    swept = repro.sweep("flow_only", folder=tmp_path / "dict", points=COLUMNS)
    runs = rows(tmp_path / "file" / "runs.csv")
    assert [row["folder"] for row in runs] == [f"runs/{run.point.name}" for run in swept.runs]
    columns = ["pore.width_um", "flow.mean_velocity_m_per_d"]
    assert [[row[name] for name in columns] for row in runs] == [["48.0", "1.0"], ["50.0", "2.5"]]
    text = (tmp_path / "file" / "summary.html").read_text()
    names = re.findall("<th(?: .*?)?>(.*?)</th>", text)
    assert names == ["run", "pore.width", "flow.mean_velocity", "numerics.preset", "end (h)", "conductivity (m/day)",
                     "area (um²)", "thickness (um)", "wall time (s)", "status"]
    assert all(f"{float(row['conductivity_m_per_d']):.4g}" in text for row in runs) and "<td></td>" not in text


def test_a_dry_run_states_points_time_and_disk(tmp_path, monkeypatch, capsys):
    """At most three runs are tried, and nothing is written."""
    costs = iter([(10.0, 1e6), (20.0, 3e6), (30.0, 5e6)])
    monkeypatch.setattr(expected, "_expect", lambda scene: next(costs))
    widths = ", ".join(f"{40 + k} um" for k in range(8))
    monkeypatch.chdir(tmp_path)
    assert main(["sweep", "base", "--vary", f"pore.width={widths}", "--workers", "2", "--dry-run"]) == 0
    out = capsys.readouterr().out
    assert out.startswith("base: 8 points; roughly 80 s with 2 runs at a time, 24 MB of fields; estimated from 3 of ")
    assert not list(tmp_path.iterdir())


def test_the_expected_size_is_near_that_of_the_run():
    """Disk space is right within a factor of two. `test_check.py` judges the time."""
    scene = repro.load_scene("base", ["growth.end=0.4 h", "numerics.preset=fast"])
    _, size = expected._expect(scene)
    written = sum(path.stat().st_size for path in (cached_run(scene) / "fields").iterdir())
    assert 0.5 < size / written < 2


def test_the_time_left_is_that_of_the_missing_runs(tmp_path, monkeypatch, capsys):
    """It is the time so far times the missing runs over the finished ones."""
    clock = iter([100.0, 110.0, 140.0, 160.0])
    monkeypatch.setattr(driver, "monotonic", lambda: next(clock))
    plan = driver.plan("flow_only", ["pore.width=48 um, 49 um, 50 um"], tmp_path / "sweep", [],
                       points=None, unset=[], samples=None, seed=0)
    events = []
    driver.run_plan(plan, lambda points, folder: ((point, "failed: x") for point in points), tell=events.append)
    assert [event["left_s"] for event in events[1:]] == [20, 20, 0]
    _print_run(events[1])
    assert "failed: x; about 20 s left" in capsys.readouterr().err


def test_a_sample_of_salib_is_a_table_of_points():
    """With its own bounds: every row of Saltelli's design is a point."""
    sobol = pytest.importorskip("SALib.sample.sobol")
    problem = {"num_vars": 2, "names": ["pore.width (um)", "flow.mean_velocity (m/day)"],
               "bounds": [[40.0, 60.0], [1.0, 3.0]]}
    sample = sobol.sample(problem, 4, calc_second_order=False, seed=1)
    _, combinations = read(dict(zip(problem["names"], sample.T)), [], None)
    assert len(combinations) == 4 * (2 + 2) and np.array(combinations) == pytest.approx(sample)
