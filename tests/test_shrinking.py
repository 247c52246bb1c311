"""Reversed trends: a decaying aggregate in a run, a sweep, the report and a comparison."""
import html
import re

import numpy as np
import pytest

from repro.cli import main
from repro.report import charts, comparison, quantities
from repro.report.reading import read
from repro.results import picture, read_table
from repro.sweeps import driver, table
from repro.sweeps.design import grid, parse, points
from repro.sweeps.folder import Sweep
from tests.shell import rows
from tests.test_sweep import in_this_process

#: Without a donor, an aggregate of 40 um in a pore of 50 um decays for a day.
HUNGRY = ["numerics.preset=fast", "aggregate.radius=40 um", "substrates.donor.supply=0 mg/L",
          "growth.end=24 h", 'output.times=["0 h", "8 h", "16 h", "24 h"]']
VARIED = "kinetics.decay_coefficient=0.5 1/day, 1 1/day"


@pytest.fixture(scope="module")
def decayed(tmp_path_factory):
    """The folder of a sweep of two runs that decay, slowly and fast."""
    out = tmp_path_factory.mktemp("decayed") / "sweep"
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(driver, "ready", in_this_process)
        assert main(["sweep", "base", "--out", str(out), "--vary", VARIED, "--quiet",
                     *(part for change in HUNGRY for part in ("--set", change))]) == 0
    return out


def folders(sweep):
    """The folders of its runs."""
    return [sweep / row["folder"] for row in rows(sweep / "runs.csv")]


def summarize(decayed):
    """The sweep, and the summaries of its runs from the functions that write its files."""
    factors = [parse(VARIED)]
    design = points("base", HUNGRY, factors, grid(factors))
    sweep = Sweep(decayed, "base", factors, design)
    return sweep, table.read_runs(sweep, {}, 0.1)


def test_conductivity_is_relative_to_that_of_the_start(decayed):
    """It is one at t = 0 and rises; no run clogs or reaches contact."""
    sweep, summaries = summarize(decayed)
    for summary, folder in zip(summaries, folders(decayed)):
        series = read_table(folder / "timeseries.csv")
        assert summary.relative[0] == 1 and (np.diff(summary.relative) > 0).all()
        expected = series["conductivity_m_per_d"] / series["conductivity_m_per_d"][0]
        assert summary.relative == pytest.approx(expected, rel=1e-12)
        assert summary.biomass == pytest.approx(series["aggregate_area_um2"] / (50 * 600), rel=1e-12)
        assert {name for name, value in summary.numbers.items() if value is not None} == {"end_h", "wall_time_s"}
    for row in rows(decayed / "runs.csv"):
        assert row["clogging_time_h"] == row["contact_time_h"] == ""


def test_lines_of_the_page_of_the_sweep_go_up_to_the_left(decayed):
    """Conductivity rises as biomass falls, and the lines stay in the frame."""
    text = (decayed / "summary.html").read_text(encoding="utf-8")
    lines = re.findall('<polyline class="line[0-9]" points="([^"]*)"><title>run', text)
    upper_left = charts.LEFT, charts.TOP
    lower_right = charts.WIDTH - charts.RIGHT, charts.HEIGHT - charts.BOTTOM
    assert len(lines) == 2
    for line in lines:
        coordinates = np.array([pair.split(",") for pair in line.split()], float)
        assert (np.diff(coordinates[:, 0]) < 0).all() and (np.diff(coordinates[:, 1]) < 0).all()
        assert ((coordinates >= upper_left) & (coordinates <= lower_right)).all()


def test_a_comparison_and_the_key_figures_show_decreases(decayed):
    """Faster decay has less area and more conductivity than slower decay, with their signs. First and last values are
    in order."""
    runs = [read(folder) for folder in folders(decayed)]
    page = html.unescape(comparison.build(runs))
    for name, sign in (("area of the aggregate (um²)", "-"), ("hydraulic conductivity of the pore (m/day)", "+")):
        cells = re.findall("<td[^>]*>(.*?)</td>", re.search(rf"{re.escape(name)}</t[hd]>(.*?)</tr>", page)[1])
        assert re.fullmatch(rf"\{sign}[\d.]+ %", cells[-1]), name
    for run in runs:
        first, last = run.series["thickness_um"][[0, -1]]
        assert f"thickness of the aggregate {first:.4g} → {last:.4g} um" in picture.key_figures(run.series)
        produced = quantities.series(run)["biomass_made_ug_per_m"][1]
        assert (produced < 0).all() and (np.diff(produced) < 0).all()


@pytest.mark.parametrize("relative, expected", [
    ([1.0, 1.4, 1.2, 0.9, 0.45, 0.2], 3 + np.log(0.9 / 0.5) / np.log(2)), ([1.0, 2.0, 3.0], np.nan),
    ([1.0, 0.8, 1.5, 0.75, 0.375, 3.0], 3 + np.log(0.75 / 0.5) / np.log(2))])
def test_a_pore_that_first_conducts_more_clogs_at_half_of_the_start(relative, expected):
    """The limit is half of the initial conductivity, not of the largest."""
    times = np.arange(float(len(relative)))
    clogged = table.clogging(times, np.array(relative), 10 - times, 0.5)
    assert clogged == pytest.approx((expected, 10 - expected), rel=1e-12, nan_ok=True)
