"""Line charts: positions of lines, scales and gaps."""

import html
import json
import re
from dataclasses import replace

import matplotlib
import numpy as np
import pytest

from repro.report import charts, quantities
from repro.report.colours import viridis
from repro.report.reading import Run
from repro.results.columns import PARTS, SUBSTRATES
from repro.results.jumps import with_jumps
from repro.scene import load_scene, scene_tables
from tests.pages import first_group

ROUNDED = 0.11  # largest error of a difference of two positions, each rounded to 0.1


def drawn(chart):
    """Points (n, 2) of the first polyline in the drawing's units."""
    text = first_group('<polyline class="line0" points="([^"]*)"', charts.svg(chart).split("</figcaption>")[1])
    return np.array([pair.split(",") for pair in text.split()], float)


def chart(values, times=None, **more):
    times = np.arange(len(values), dtype=float) if times is None else np.asarray(times, float)
    return charts.Chart("title", "axis", [charts.Line("one", times, np.asarray(values, float), **more)])


@pytest.mark.parametrize("values, log", [([2.0, 5.0, 3.5, 9.0], False), ([0.0, 10.0, 500.0, 1000.0], False),
                                         ([1.0, 10.0, 50.0, 1000.0], True)])
def test_positions_of_a_line_follow_its_values_and_the_ticks(values, log):
    """Positions between two labelled ticks are linear in the value, or in its logarithm if the range is wide."""
    values, times = np.array(values), np.array([0.0, 1.0, 4.0, 10.0])
    marked = replace(chart(values, times), marks=[4.0])
    text, even = charts.svg(marked), np.log if log else np.array
    ticks = re.findall('<text class="y" x="[^"]*" y="([^"]*)">([^<]*)<', text)
    heights, labels = np.array([float(y) - 3.5 for y, _ in ticks]), np.array([float(text) for _, text in ticks])
    assert len(labels) >= 3 and labels.min() <= values.min() and labels.max() >= values.max() - np.diff(labels)[0]
    assert ("axis (log scale)" in text) == log and ("log" in text) == log
    order = np.argsort(labels)
    assert (np.diff(heights[order]) < 0).all()  # a drawing's y grows downwards
    assert np.allclose(drawn(marked)[:, 1], np.interp(even(values), even(labels[order]), heights[order]), atol=ROUNDED)
    across = drawn(marked)[:, 0]
    assert np.allclose((across - across[0]) / (across[-1] - across[0]), times / 10, atol=1e-3)
    hours = [(float(x), float(time)) for x, time in re.findall('<text class="x" x="([^"]*)" y="[^"]*">([^<]*)<', text)]
    assert np.allclose(across, np.interp(times, *np.array(hours).T[::-1]), atol=ROUNDED) and len(hours) >= 3
    axis = json.loads(html.unescape(first_group('data-chart="([^"]*)"', text)))["axis"]
    assert np.allclose(across, np.interp(times, axis[:2], axis[2:]), atol=ROUNDED)
    assert float(first_group('class="mark" x1="([^"]*)"', text)) == across[2]


@pytest.mark.parametrize("low, high", [(123400, 123460), (99950, 100050), (2.0001e-4, 2.0004e-4), (0, 3e6), (-7, 0),
                                       (1000.2, 1000.9), (0, 2e-9)])
def test_labels_of_ticks_equal_their_values(low, high):
    """They are equal to round-off, also far from zero and from one."""
    ticks = charts.ticks(charts.Scale(low, high, 0, 100), 4)
    values, texts = zip(*ticks)
    assert len(ticks) >= 3 and [float(text) for text in texts] == pytest.approx(values, rel=1e-12)


@pytest.mark.parametrize("low, high, expected", [
    (2, 60, "2 5 10 20 50"), (0.1, 99, "0.1 0.2 0.5 1 2 5 10 20 50"), (1, 1e3, "1 10 100 1000"),
    (1e-7, 1e7, "1e-7 0.0001 0.1 100 1e5"), (3, 4, "3 4")])
def test_a_logarithmic_axis_has_powers_of_ten_and_few_ticks(low, high, expected):
    """Axes of less than three decades also have 2 and 5 times these powers. An axis with fewer than two ticks shows its
    ends."""
    ticks = charts.ticks(charts.Scale(low, high, 0, 100, log=True))
    assert " ".join(text for _, text in ticks) == expected
    assert [value for value, _ in ticks] == pytest.approx([float(text) for text in expected.split()], rel=1e-12)


@pytest.mark.parametrize("values, log", [([40.0, 60.0], False), ([-2.0, -1.0], False), ([7.0], False), ([0.0], False),
                                         ([0.3, 30.0], True), ([5.0], True)])
def test_no_value_is_at_the_end_of_a_padded_axis(values, log):
    scale = charts.across(*charts.padded(values, log), log)
    places = [float(scale(value)) for value in values]
    assert charts.LEFT + 10 < min(places) <= max(places) < charts.WIDTH - charts.RIGHT - 10


def test_a_legend_names_each_line_by_its_colour():
    lines = [charts.Line(name, np.arange(2.0), np.full(2, value)) for name, value in (("one", 1.0), ("two", 4.0))]
    text = charts.svg(charts.Chart("title", "axis", lines))
    assert re.findall(r'class="line(\d)" points="0,5 24,5"/></svg>(\w+)</span>', text) == [("0", "one"), ("1", "two")]
    low, high = re.findall(r'class="line[01]" points="\S+,(\S+) \d', text)[2:]
    assert float(low) > float(high)  # a drawing's y grows downwards


def test_charts_draw_gaps_constants_and_single_points():
    text = charts.svg(chart([1.0, 2.0, np.nan, 3.0, 4.0, np.nan, 5.0]))
    assert text.count("<polyline") == 2 and text.count("<circle") == 1 and "nan" not in text
    for constant in (0.0, 2.9, -3.0, 1e-30, 1e30):
        flat = drawn(chart([constant] * 3))
        assert np.ptp(flat[:, 1]) == 0 and charts.TOP <= flat[0, 1] <= charts.HEIGHT - charts.BOTTOM


@pytest.mark.parametrize("times, expected", [
    ([0, 1, 2, 3], ([0, 1, 2, 2, 3], [5, 4, 4, 2, 1])),
    ([0, 1.5, 2.5, 3], ([0, 1.5, 2, 2, 2.5, 3], [5, 4, 4, 2, 2, 1])),
    ([0, 0.5, 1, 1.5], ([0, 0.5, 1, 1.5], [5, 4, 2, 1]))])
def test_a_jump_of_a_supply_is_drawn_as_a_jump(times, expected):
    """Concentrations at rest keep the value of the last row before. Nothing else jumps, and no linear table does."""
    supply = 'substrates.donor.supply=[["0 h", "9 mg/L"], ["1 h", "9 g/m3"], ["2 h", "3 mg/L"]]'
    values = np.array([5.0, 4.0, 2.0, 1.0])

    def curve(name, *more):
        tables = scene_tables(load_scene("base", [supply, *more]))
        return [column.tolist() for column in with_jumps(name, np.array(times, float), values, tables)]

    assert curve("effluent_donor_mg_per_L") == list(expected)
    unchanged = [list(times), values.tolist()]
    assert curve("thickness_um") == curve("mean_velocity_m_per_d") == unchanged
    linear = f'substrates.donor.supply={{table={supply.partition("=")[2]}, between="linear"}}'
    assert curve("effluent_donor_mg_per_L", linear) == unchanged
    assert curve("effluent_donor_mg_per_L", "numerics.transport=gear") == unchanged
    head = 'flow.head=[["0 h", "1e-3 cm"], ["2 h", "2e-3 cm"]]'
    stress = "wall_traction_max_MPa"  # test_scene_course.py has the columns of each table
    assert curve(stress, head) == unchanged
    assert curve(stress, head, "growth.fluid_forces=included") == list(expected)


def pulsed(count, pulse):
    """A run of steps with lengths that differ, and rates of 1 in all of them except the step ``pulse``."""
    ends = np.cumsum(np.where(np.arange(count) % 2, 0.5, 10.0))
    start = np.append(0.0, ends[:-1])
    rates = np.where(np.arange(count) == pulse, 5.0, 1.0)
    ledger = {f"{name}_{part}_pg_per_m": 1e6 * rates * (ends - start) for name in SUBSTRATES for part in PARTS}
    ledger |= {f"biomass_{part}_pg_per_m": np.ones(count) for part in ("made", "after")}
    record = {"tables": {}, "scene": "pulsed", "status": "finished"}
    return Run(None, record, {"time_h": np.array([0.0, ends[-1]])}, {"start_h": start, "end_h": ends, **ledger})


LEDGERS = [f"{name}_{part}_ug_per_m_per_h" for name in SUBSTRATES for part in PARTS]


@pytest.mark.parametrize("name", LEDGERS)
@pytest.mark.parametrize("make", [quantities.charts_of, lambda run: quantities.overlaid([run], ["one"])],
                         ids=["report", "compare"])
def test_means_over_steps_are_drawn_as_steps(name, make):
    """A pulse in a short step has its own height and length, in each chart of a ledger on both pages."""
    kind = next(kind for kind in quantities.KINDS if name in kind.drawn)
    drawings = [chart for chart in make(pulsed(7, 3)) if chart.title.startswith(kind.title)]
    label = quantities._named(name).label
    (line,) = [line for chart in drawings for line in chart.lines
               if label in (line.label, chart.title.rpartition(": ")[2])]
    assert line.times.tolist() == [0, 10, 10, 10.5, 10.5, 20.5, 20.5, 21, 21, 31, 31, 31.5, 31.5, 41.5]
    assert line.values == pytest.approx([1] * 6 + [5] * 2 + [1] * 6)
    corners = drawn(replace(drawings[0], lines=[line]))
    assert (np.diff(corners, axis=0) == 0).any(axis=1).all(), "horizontal and vertical lines only"


def test_many_steps_are_merged_to_their_means():
    run = pulsed(5001, 777)
    times, values = quantities.mean_rates(run.ledger["start_h"], run.ledger["end_h"],
                                          run.ledger["donor_out_pg_per_m"])
    assert len(times) == charts.MOST_POINTS and (times[0], times[-1]) == (0, run.times[-1])
    assert (times[1:-1:2] == times[2::2]).all()
    assert values[::2] @ (times[1::2] - times[::2]) == pytest.approx(run.ledger["donor_out_pg_per_m"].sum(), rel=1e-12)


def test_many_points_are_thinned_with_both_ends():
    line = charts.Line("x", np.arange(5000.0), np.arange(5000.0) ** 2)
    thin = charts.thinned(line)
    assert len(thin.times) == charts.MOST_POINTS and thin.times[[0, -1]].tolist() == [0, 4999]
    assert (thin.values == thin.times**2).all()


def test_the_colours_of_values_are_those_of_matplotlib():
    """To 6 of 255, the error of linear colours between a sixteenth of the scale."""
    colours = np.array([[*bytes.fromhex(colour[1:])] for colour in viridis(256)])
    assert np.abs(colours - 255 * np.array(matplotlib.colormaps["viridis"].colors)).max() < 6.5
    assert viridis(5, 0.25, 0.75) == viridis(9)[2:7]
