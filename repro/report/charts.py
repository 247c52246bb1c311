"""Charts as inline SVG. The same numbers give the same bytes.

``svg`` draws lines over time for the pages of runs. The pages of sweeps draw other charts with
``across``, ``upwards``, ``drawing`` and the marks. The page sets colours and fonts (classes
``line0`` ... ``line7``); ``data-chart`` has the numbers for the pointer.
"""

import json
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from html import escape

import numpy as np

WIDTH, HEIGHT = 360, 224
#: Margins around the drawing for text.
LEFT = 72
RIGHT = 10
TOP = 8
BOTTOM = 38
COLOURS = 8
#: A positive quantity that varies by more than this factor has a logarithmic scale.
LOG_FROM = 30.0
MOST_POINTS = 1000  # drawn of a line
EQUAL = 1e-9  # relative difference of values that a chart would draw as one


@dataclass(frozen=True, eq=False)
class Line:
    """One line of a chart: times (n,) in h and values (n,), not finite in gaps."""

    label: str
    times: np.ndarray
    values: np.ndarray

    @property
    def constant(self) -> bool:
        """Whether its finite values are equal, to round-off, or there are none."""
        finite = self.values[np.isfinite(self.values)]
        return not len(finite) or bool(np.ptp(finite) <= EQUAL * np.abs(finite).max())


@dataclass(frozen=True, eq=False)
class Chart:
    """Lines over time; `axis` is the quantity with its unit; `marks` are times (h) of events;
    `of_mesh`: the mesh and its numerics, not the pore."""

    title: str
    axis: str
    lines: Sequence[Line]
    marks: Sequence[float] = ()
    of_mesh: bool = False


@dataclass(frozen=True)
class Scale:
    """Maps values to positions along an axis; `words` label the positions 0, 1, 2, ..."""

    low: float
    high: float
    start: float
    end: float
    log: bool = False
    words: Sequence[str] = ()

    def __call__(self, value):
        even = np.log10 if self.log else np.asarray
        low, high = even(self.low), even(self.high)
        return self.start + (even(value) - low) / (high - low) * (self.end - self.start)


def across(low: float, high: float, log: bool = False, words: Sequence[str] = ()) -> Scale:
    """The scale of the axis from left to right."""
    return Scale(low, high, LEFT, WIDTH - RIGHT, log, words)


def upwards(low: float, high: float, log: bool = False) -> Scale:
    """The scale of the axis from below."""
    return Scale(low, high, HEIGHT - BOTTOM, TOP, log)


def svg(chart: Chart) -> str:
    """A figure with title, legend and drawing."""
    lines = [thinned(line) for line in chart.lines]
    times = np.concatenate([line.times for line in lines])
    values = np.concatenate([line.values[np.isfinite(line.values)] for line in lines])
    log = is_wide(values)
    first, last = float(times.min()), float(times.max())
    x = across(first, last if last > first else first + 1)
    y = upwards(*limits(values, log), log)
    upright = f'y1="{TOP}" y2="{HEIGHT - BOTTOM}"'
    places = [f"{x(time):.1f}" for time in chart.marks if x.low <= time <= x.high]
    marks = "".join(f'<line class="mark" x1="{place}" x2="{place}" {upright}/>' for place in places)
    marks += "".join(curve(x, y, line.times, line.values, k) for k, line in enumerate(lines))
    marks += f'<line class="now" x1="0" x2="0" {upright} visibility="hidden"/>'
    plot = drawing(x, y, ("time (h)", chart.axis), f"{chart.title} over time", marks)
    entries = "".join(f"<span>{swatch(k)}{escape(line.label)}</span>"
                      for k, line in enumerate(lines))
    legend = f'<span class="legend">{entries}</span>' if len(lines) > 1 else ""
    return (f'<figure class="chart" data-chart="{escape(_pointer_data(lines, x))}">'
            f"<figcaption>{escape(chart.title)}{legend}</figcaption>"
            f"{plot}<output>&nbsp;</output></figure>")


def drawing(x: Scale, y: Scale, axes: tuple[str, str], label: str, marks: str) -> str:
    """The drawing without title; axes: labels of x and y; label: description in words.

    A grid of horizontal lines has the values, and the axis below has ticks.
    """
    right, bottom = WIDTH - RIGHT, HEIGHT - BOTTOM
    rows = "".join(f'<line class="grid" x1="{LEFT}" x2="{right}" '
                   f'y1="{y(value):.1f}" y2="{y(value):.1f}"/>'
                   f'<text class="y" x="{LEFT - 5}" y="{y(value) + 3.5:.1f}">{escape(text)}</text>'
                   for value, text in ticks(y, 4))
    columns = "".join(f'<line class="tick" x1="{x(value):.1f}" x2="{x(value):.1f}" '
                      f'y1="{bottom}" y2="{bottom + 4}"/>'
                      f'<text class="x" x="{x(value):.1f}" y="{bottom + 15}">{escape(text)}</text>'
                      for value, text in ticks(x))
    axis = f'<line class="tick" x1="{LEFT}" x2="{right}" y1="{bottom}" y2="{bottom}"/>'
    center, middle = (LEFT + right) / 2, (TOP + bottom) / 2
    up = axes[1] + " (log scale)" * y.log
    return (f'<svg viewBox="0 0 {WIDTH} {HEIGHT}" role="img" aria-label="{escape(label)}">'
            f"{rows}{columns}{axis}{marks}"
            f'<text class="name" x="{center:g}" y="{HEIGHT - 4}">{escape(axes[0])}</text>'
            f'<text class="name" transform="translate(10 {middle:g}) rotate(-90)">'
            f"{escape(up)}</text></svg>")


def thinned(line: Line) -> Line:
    """A line with at most MOST_POINTS points, evenly chosen, with the first and the last."""
    if len(line.times) <= MOST_POINTS:
        return line
    chosen = np.linspace(0, len(line.times) - 1, MOST_POINTS).round().astype(int)
    return replace(line, times=line.times[chosen], values=line.values[chosen])


def is_wide(values: Sequence[float] | np.ndarray) -> bool:
    """Do positive values need a logarithmic scale?"""
    return bool(0 < min(values) < max(values) / LOG_FROM)


def limits(values: Sequence[float] | np.ndarray, log: bool) -> tuple[float, float]:
    """The round ends of an axis that shows these values.

    A linear axis begins at zero if zero is near, and contains a constant.
    """
    low, high = float(min(values)), float(max(values))
    if log:
        return 10.0 ** math.floor(math.log10(low)), 10.0 ** math.ceil(math.log10(high))
    span = high - low
    if span <= EQUAL * max(abs(low), abs(high)):
        span = abs(high) or 1.0
        return min(low, 0.0) - 0.1 * span * (low < 0), max(high, 0.0) + 0.1 * span * (high >= 0)
    low = 0.0 if 0 < low < 0.5 * high else low
    high = 0.0 if 0 > high > 0.5 * low else high
    step = _step(high - low, 4)
    return math.floor(low / step + 1e-9) * step, math.ceil(high / step - 1e-9) * step


def padded(values: Sequence[float], log: bool) -> tuple[float, float]:
    """The ends of an axis with margins beside the values."""
    low, high = min(values), max(values)
    if log:
        factor = (high / low) ** 0.06 if high > low else 2.0
        return low / factor, high * factor
    margin = 0.06 * (high - low) or 0.5 * abs(high) or 1.0
    return low - margin, high + margin


def _step(span: float, parts: int) -> float:
    """The step, 1, 2 or 5 times a power of ten, that divides a span into about `parts` parts."""
    power = 10.0 ** math.floor(math.log10(span / parts))
    return next(k * power for k in (1, 2, 5, 10) if k * power >= span / parts * (1 - 1e-9))


def ticks(scale: Scale, parts: int = 5) -> list[tuple[float, str]]:
    """Round values within a scale with their texts, or its words.

    A logarithmic scale has about six powers of ten; within three decades also 2 and 5 times these.
    """
    if scale.words:
        return [(float(place), word) for place, word in enumerate(scale.words)]
    if not scale.log:
        step = _step(scale.high - scale.low, parts)
        steps = range(math.ceil(scale.low / step - 1e-6), math.floor(scale.high / step + 1e-6) + 1)
        digits = -math.floor(math.log10(step) + 1e-9)
        return [(k * step, number(k * step, digits)) for k in steps]
    low, high = scale.low * (1 - 1e-9), scale.high * (1 + 1e-9)
    first = math.floor(math.log10(scale.low) + 1e-9)
    last = math.ceil(math.log10(scale.high) - 1e-9)
    factors = (1, 2, 5) if high < 999 * low else (1,)
    powers = range(first, last + 1, -(-(last - first) // 6))
    values = [factor * 10.0**power for power in powers for factor in factors]
    visible = [value for value in values if low <= value <= high]
    return [(value, number(value))
            for value in (visible if len(visible) > 1 else (scale.low, scale.high))]


def number(value: float, digits: int | None = None) -> str:
    """Format a number with `digits` decimals (may be negative), or six significant digits.

    A number far from one has a power of ten, with the same decimals or four significant digits.
    """
    if value == 0:
        return "0"
    if not 1e-3 <= abs(value) < 1e5:
        decimals = 4 if digits is None else math.floor(math.log10(abs(value)) + 1e-9) + digits + 1
        mantissa, _, power = f"{value:.{max(1, decimals)}g}".partition("e")
        return f"{mantissa}e{int(power)}" if power else mantissa
    return f"{value:.{max(0, digits)}f}" if digits is not None else f"{value:.6g}"


def curve(x: Scale, y: Scale, coordinates: np.ndarray, values: np.ndarray, colour: int,
          *, title: str = "") -> str:
    """Values (n,) at coordinates (n,): lines between gaps; dots for single points."""
    is_drawable = np.isfinite(coordinates) & np.isfinite(values)
    for scale, numbers in ((x, coordinates), (y, values)):
        is_drawable &= (numbers > 0) | (not scale.log)
    drawable = np.flatnonzero(is_drawable)
    pieces = np.split(drawable, np.flatnonzero(np.diff(drawable) > 1) + 1)
    drawn = ""
    for piece in pieces:
        points = list(map(point, x(coordinates[piece]), y(values[piece])))
        drawn += (polyline(points, colour, title) if len(points) > 1 else
                  "".join(dot(place, colour, title) for place in points))
    return drawn


def point(x: float, y: float) -> str:
    """Format a point of the drawing."""
    return f"{x:.1f},{y:.1f}"


def polyline(points: Sequence[str], colour: int, title: str = "") -> str:
    """A line through points; the pointer shows `title`."""
    return _element("polyline", f'class="line{colour % COLOURS}" points="{" ".join(points)}"',
                    title)


def dot(place: str, colour: int, title: str = "", radius: float = 2.6) -> str:
    """A dot at a point."""
    x, y = place.split(",")
    return _element("circle", f'class="dot{colour % COLOURS}" cx="{x}" cy="{y}" r="{radius:g}"',
                    title)


def triangle(place: str, colour: int, title: str = "") -> str:
    """A hollow triangle at a point. It points up: the value is larger than its position."""
    x, y = map(float, place.split(","))
    corners = [point(x - 5, y + 4), point(x + 5, y + 4), point(x, y - 5)]
    return _element("polygon", f'class="line{colour % COLOURS}" points="{" ".join(corners)}"',
                    title)


def _element(name: str, attributes: str, title: str) -> str:
    if not title:
        return f"<{name} {attributes}/>"
    return f"<{name} {attributes}><title>{escape(title)}</title></{name}>"


def swatch(k: int) -> str:
    """A sample of a line for a legend."""
    line = polyline(["0,5", "24,5"], k)
    return f'<svg class="swatch" viewBox="0 0 24 10" aria-hidden="true">{line}</svg>'


def _pointer_data(lines: Sequence[Line], x: Scale) -> str:
    """The data for the pointer, as JSON: the time axis and the numbers of the lines.

    The axis is four numbers: its first and last time, and their positions in the drawing.
    """
    def short(values: np.ndarray) -> list[float | None]:
        return [float(f"{value:.6g}") if math.isfinite(value) else None for value in values]

    numbers = [{"label": line.label, "t": short(line.times), "y": short(line.values)}
               for line in lines]
    pointer_data = {"axis": [x.low, x.high, x.start, x.end], "lines": numbers}
    return json.dumps(pointer_data, separators=(",", ":"), allow_nan=False)
