"""Line charts: where their lines are, their scales, and their gaps."""

import re

import numpy as np

from repro.report import charts
from tests.pages import first

ROUNDED = 0.11  # of a difference of two places, each rounded to 0.1


def drawn(chart):
    """Points (n, 2) of the first polyline, in the drawing's units."""
    text = first('<polyline class="line0" points="([^"]*)"', charts.svg(chart).split("</figcaption>")[1])
    return np.array([[float(one) for one in pair.split(",")] for pair in text.split()])


def chart(values, times=None, **more):
    times = np.arange(len(values), dtype=float) if times is None else np.asarray(times, float)
    return charts.Chart("title", "axis", [charts.Line("one", times, np.asarray(values, float), **more)])


def test_a_line_is_where_its_numbers_and_the_ticks_say():
    """Places between two labelled ticks are linear in the value."""
    values, times = np.array([2.0, 5.0, 3.5, 9.0]), np.array([0.0, 1.0, 4.0, 10.0])
    made = chart(values, times)
    ticks = re.findall('<text class="y" x="[^"]*" y="([^"]*)">([^<]*)<', charts.svg(made))
    heights, told = np.array([float(y) - 3.5 for y, _ in ticks]), np.array([float(text) for _, text in ticks])
    assert len(told) >= 3 and told.min() <= values.min() and told.max() >= values.max() - np.diff(told)[0]
    order = np.argsort(told)
    assert (np.diff(heights[order]) < 0).all()  # a drawing's y grows downwards
    assert np.allclose(drawn(made)[:, 1], np.interp(values, told[order], heights[order]), atol=ROUNDED)
    across = drawn(made)[:, 0]
    assert np.allclose((across - across[0]) / (across[-1] - across[0]), times / 10, atol=1e-3)


def test_a_wide_range_is_logarithmic():
    made = chart([1.0, 10.0, 100.0, 1000.0])
    assert np.allclose(np.diff(drawn(made)[:, 1]), np.diff(drawn(made)[:, 1])[0], atol=ROUNDED)
    assert "axis (log scale)" in charts.svg(made) and "log scale" not in charts.svg(chart([0.0, 10.0, 1000.0]))


def test_gaps_constants_and_single_points():
    text = charts.svg(chart([1.0, 2.0, np.nan, 3.0, 4.0, np.nan, 5.0]))
    assert text.count("<polyline") == 2 and text.count("<circle") == 1 and "nan" not in text
    for constant in (0.0, 2.9, -3.0, 1e-30, 1e30):
        flat = drawn(chart([constant] * 3))
        assert np.ptp(flat[:, 1]) == 0 and charts.TOP <= flat[0, 1] <= charts.HEIGHT - charts.BOTTOM


def test_many_points_are_thinned_with_both_ends():
    line = charts.Line("x", np.arange(5000.0), np.arange(5000.0) ** 2)
    thin = charts.thinned(line)
    assert len(thin.times) == charts.MOST_POINTS and thin.times[[0, -1]].tolist() == [0, 4999]
    assert (thin.values == thin.times**2).all()
