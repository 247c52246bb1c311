"""The beginning of a run's page: its answer in words, a small table and the outlines of the aggregates."""

import html
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from repro import report
from repro.report import answer, charts, quantities
from repro.report.reading import Run, read
from repro.results import field_files
from tests.pages import text_of


def made(ledger=None, tables=None, **series):
    """A run of rows at 0, 1, 2, ... h with some columns."""
    count = len(next(iter(series.values()), []))
    columns = {"time_h": np.arange(float(count))} | {name: np.array(values) for name, values in series.items()}
    return Run(Path("none"), {"tables": {"growth": {}} if tables is None else tables}, columns, ledger or {})


FALLING = {"conductivity_m_per_d": [100.0, 60.0, 25.0]}


@pytest.mark.parametrize("run, expected", [
    (made(**FALLING, contact=[0, 1, 1]), "3 rows, to t = 2 h. An aggregate touches the opposite wall from t = 1 h on. "
                                         "The conductivity falls from 100 to 25 m/day, by a factor of 4."),
    (made(**FALLING, effluent_acceptor_mg_per_L=[9.0, 8.0, 2.25], effluent_donor_mg_per_L=[8.0, 8.0, 8.0]),
     "3 rows, to t = 2 h. No aggregate touches the opposite wall. The conductivity falls from 100 to 25 m/day, by a "
     "factor of 4. The acceptor in the effluent falls from 9 to 2.25 mg/L. The donor in the effluent stays at 8 mg/L."),
    (made(conductivity_m_per_d=[100.0, 150.0], ledger={"end_h": np.array([0.5, 1.0]),
                                                       "detached_pg_per_m": np.array([3e6, 0.0])}),
     "2 rows, to t = 1 h. No aggregate touches the opposite wall. An aggregate leaves the pore at t = 0.5 h. In all, 3 "
     "ug/m of biomass detaches. The conductivity rises from 100 to 150 m/day, by a factor of 1.5."),
    (made(thickness_um=[4.0, 8.0], ledger={"end_h": np.array([0.5, 1.0]), "detached_pg_per_m": np.array([3e6, 1e6])},
          tables={"growth": {"erosion": {}}}),
     "2 rows, to t = 1 h. No aggregate touches the opposite wall. In all, 4 ug/m of biomass detaches."),
    (made(aggregate_area_um2=[40.0, 80.0], effluent_acceptor_mg_per_L=[10.0, 10.0]),
     "2 rows, to t = 1 h. No aggregate touches the opposite wall. The acceptor in the effluent stays at 10 mg/L. The "
     "area of the aggregate rises from 40 to 80 um², by a factor of 2."),
    (made(conductivity_m_per_d=[174.0], tables={}), "One row, at t = 0 h. The conductivity is 174 m/day."),
    (made(conductivity_m_per_d=[np.nan, 8.0, 4.0, np.nan], tables={}),
     "4 rows, to t = 3 h. The conductivity falls from 8 to 4 m/day, by a factor of 2."),
    (made(conductivity_m_per_d=[1.231, 1.233], tables={}),
     "2 rows, to t = 1 h. The conductivity stays at 1.23 m/day.")],
    ids=["contact", "effluents", "leaves", "erodes", "no flow", "one row", "gaps", "equal digits"])
def test_the_sentence_has_contact_conductivity_and_effluents(run, expected):
    """Physics that is not modelled is not mentioned."""
    assert answer.sentence(run) == expected


@pytest.mark.parametrize("status, reached", [("completed", True), ("failed: stopped", False), ("folds at 2 h", False)])
def test_the_sentence_says_that_the_scene_is_run_to_its_end(status, reached):
    """Any other end is the status of the run, above the sentence."""
    run = made(**FALLING)
    run.record["status"] = status
    assert ("h. The run reaches growth.end. No aggregate" in answer.sentence(run)) == reached


def test_a_run_without_rows_says_so():
    assert answer.build(made(conductivity_m_per_d=[])) == "<p>The run has no row: it stopped before the first.</p>"


def test_the_table_has_rows_at_start_contact_and_end():
    """Times between them are evenly spread; a value that a row lacks is a dash."""
    columns = {"conductivity_m_per_d": np.linspace(100, 1, 41), "thickness_um": np.append(np.arange(40.0), np.nan),
               "contact": np.arange(41) >= 33}
    rows = answer._rows(made(**columns))
    assert [row[0] for row in rows] == ["0", "10", "20", "30", "33", "40"]
    assert [row[2] for row in rows] == ["0", "10", "20", "30", "33", "-"]
    assert [float(row[1]) for row in rows] == pytest.approx([100, 75.2, 50.5, 25.8, 18.3, 1])


def test_the_page_begins_with_the_answer(fast, flow_only):
    """It precedes the model in words, the fields and the charts. A seed without a flow of time has its outline."""
    for out in (fast, flow_only):
        text = text_of(out)
        places = [text.index(words) for words in ('class="status"', 'class="answer"', "<table>", 'class="outlines"',
                                                  "Modelled, ", "Fields and mesh")]
        assert places == sorted(places)
        assert html.escape(answer.sentence(read(out))) in text


@pytest.mark.parametrize("name", ["fast", "paper"])
def test_the_outlines_are_those_of_the_aggregate(request, name):
    """Their points are as thick as the aggregate above the wall, and as long, in the scale of the picture."""
    run = read(request.getfixturevalue(name))
    text = answer.build(run)
    paths = re.findall(r'<path class="line(\d)" d="([^"]+)"', text)
    times = [float(time) for time in re.findall(r"</svg>([\d.]+) h<", text)]
    assert [int(colour) for colour, _ in paths] == list(range(len(paths))) and len(paths) == len(times) == 5
    (_, height) = map(float, re.search(r'viewBox="0 0 (\S+) (\S+)"', text).groups())
    scale = (height - 2 * answer.MARGIN) / 50
    for time, (_, outline) in zip(times, paths):
        ends = np.array(re.findall(r"(?:M| )([-\d.]+),([-\d.]+)", outline), float)
        row = {column: values[run.times == time][-1] for column, values in run.series.items()}
        assert np.ptp(ends[:, 1]) / scale == pytest.approx(row["thickness_um"], abs=0.4)
        assert np.ptp(ends[:, 0]) / scale == pytest.approx(row["downstream_um"] - row["upstream_um"], abs=0.4)


def test_a_side_is_an_arc_through_its_middle(fast):
    """The control point of a parabola is as far beyond the middle as that from the chord."""
    grid = field_files.read(sorted((fast / "fields").glob("fields_*.vtu"))[-1])
    sides = answer._sides(grid)
    radius = np.hypot(sides[:, 1, 0], sides[:, 1, 1])
    free = sides[:, :, 1].min(axis=1) > 0.5
    assert free.sum() >= 5 and np.ptp(radius[free]) < 0.1 * radius[free].mean()
    numbers = re.findall(r"-?\d+\.\d", answer._path(sides[free][:1], 0))
    start, control, end = np.array(numbers, float).reshape(3, 2)
    assert (start + 2 * control + end) / 4 == pytest.approx(sides[free][0, 1], abs=0.11)


def test_a_quantity_that_does_not_change_has_no_chart():
    """A zero one has no line; another one that is constant has none if no other one of its chart changes."""
    run = made(head_loss_cm=[1e-3] * 3, acceptor_overshoot_mg_per_L=[0.0] * 3, donor_overshoot_mg_per_L=[0.0, 1.0, 2.0],
               biomass_density_min=[0.9, 1.0, 0.9], biomass_density_max=[1.0] * 3, nodes=[7.0] * 3, remeshed=[0, 1, 0],
               inlet_donor_mg_per_L=[5.0] * 3, inlet_acceptor_mg_per_L=[9.0, 8.0, 7.0])
    drawn = {chart.title: [line.label for line in chart.lines] for chart in quantities.charts_of(run)}
    assert drawn == {"Concentrations above the supply: donor": ["donor"], "Biomass density": ["least", "largest"],
                     "Inlet of the meshed part": ["acceptor", "donor"]}
    assert [chart.of_mesh for chart in quantities.charts_of(run)] == [True, False, False]
    assert quantities.charts_of(replace(run, series={**run.series, "time_h": np.zeros(1)})) == []


@pytest.mark.parametrize("values, constant", [([2.0, 2.0], True), ([2.0, 2.0 + 1e-12], True), ([2.0, 2.001], False),
                                              ([np.nan, 2.0], True), ([0.0, 0.0], True), ([0.0, 1e-15], False)])
def test_equal_to_round_off_is_constant(values, constant):
    assert charts.Line("one", np.arange(2.0), np.array(values)).constant is constant


def test_charts_of_the_mesh_stand_apart(fast):
    text = text_of(fast)
    pore, _, mesh = text.partition("<h2>Of the mesh and the balances, not of the pore</h2>")
    mesh = mesh.partition("<h2>")[0]
    assert re.findall("<figcaption>([^<]+)", mesh) == ["Inlet of the meshed part", "Defects of the balances"]
    assert "<figcaption>Effluents" in pore and "<figcaption>Head loss" not in text
    assert report.write(fast).read_text() == text
