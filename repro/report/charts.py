"""Line charts as inline SVG, drawn from numbers alone: the same numbers, the same bytes.

Colours and fonts are the page's (classes ``line0`` ... ``line7``); what a pointer is told goes into
``data-chart``.
"""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import dataclass
from html import escape

import numpy as np

WIDTH, HEIGHT = 360, 224
#: Room around the drawing for what is written.
LEFT = 72
RIGHT = 10
TOP = 8
BOTTOM = 38
COLOURS = 8
#: A positive quantity that spans more than this factor is drawn on a logarithmic scale.
LOG_FROM = 30.0
MOST_POINTS = 1000  # drawn of a line


@dataclass(frozen=True, eq=False)
class Line:
    """One line of a chart: times (n,) in h and values (n,), gaps where they are not finite."""

    label: str
    times: np.ndarray
    values: np.ndarray
    dots: bool = False  # drawn as separate dots


@dataclass(frozen=True, eq=False)
class Chart:
    """Lines over time; `axis` names what is drawn and its unit; `marks` are times (h) of events."""

    title: str
    axis: str
    lines: Sequence[Line]
    marks: Sequence[float] = ()


@dataclass(frozen=True)
class Scale:
    """From values to places along an axis."""

    low: float
    high: float
    start: float
    end: float
    log: bool = False

    def __call__(self, value):
        low, high = self._even(self.low), self._even(self.high)
        return self.start + (self._even(value) - low) / (high - low) * (self.end - self.start)

    def _even(self, value):
        """The value, or its logarithm: what is spaced evenly along the axis."""
        return np.log10(value) if self.log else np.asarray(value, float)


def svg(chart: Chart) -> str:
    """A figure with title, legend and drawing."""
    lines = [thinned(line) for line in chart.lines]
    x, y = _scales(lines)
    body = _grid(x, y) + "".join(_mark(x, time) for time in chart.marks if x.low <= time <= x.high)
    body += "".join(_drawn(line, k, x, y) for k, line in enumerate(lines))
    body += _names(chart.axis + (" (log scale)" if y.log else ""))
    body += (f'<line class="now" x1="0" x2="0" y1="{TOP}" y2="{HEIGHT - BOTTOM}" '
             'visibility="hidden"/>')
    title = escape(chart.title)
    return (f'<figure class="chart" data-chart="{escape(_told(lines, x))}">'
            f"<figcaption>{title}{_legend(lines)}</figcaption>"
            f'<svg viewBox="0 0 {WIDTH} {HEIGHT}" role="img" aria-label="{title} over time">{body}'
            "</svg><output>&nbsp;</output></figure>")


def _names(up: str) -> str:
    """What the axes show: time, and upwards what is drawn."""
    across, middle = (LEFT + WIDTH - RIGHT) / 2, (TOP + HEIGHT - BOTTOM) / 2
    return (f'<text class="name" x="{across:g}" y="{HEIGHT - 4}">time (h)</text>'
            f'<text class="name" transform="translate(10 {middle:g}) rotate(-90)">'
            f"{escape(up)}</text>")


def thinned(line: Line) -> Line:
    """At most MOST_POINTS of a line's points, evenly chosen, the first and last among them."""
    if len(line.times) <= MOST_POINTS:
        return line
    chosen = np.linspace(0, len(line.times) - 1, MOST_POINTS).round().astype(int)
    return Line(line.label, line.times[chosen], line.values[chosen], line.dots)


def _scales(lines: Sequence[Line]) -> tuple[Scale, Scale]:
    times = np.concatenate([line.times for line in lines])
    values = np.concatenate([line.values[np.isfinite(line.values)] for line in lines])
    low, high = float(values.min()), float(values.max())
    log = low > 0 and high / LOG_FROM > low
    if log:
        low = 10.0 ** math.floor(math.log10(low))
        high = 10.0 ** math.ceil(math.log10(high))
    else:
        low, high = _roomy(low, high)
    first, last = float(times.min()), float(times.max())
    return (Scale(first, last if last > first else first + 1, LEFT, WIDTH - RIGHT),
            Scale(low, high, HEIGHT - BOTTOM, TOP, log))


def _roomy(low: float, high: float) -> tuple[float, float]:
    """A range with its ticks inside: from zero where that is near, wide enough for a constant."""
    span = high - low
    if span <= 1e-9 * max(abs(low), abs(high)) or span == 0:
        span = abs(high) or 1.0
        return (min(low, 0.0) - 0.1 * span * (low < 0), max(high, 0.0) + 0.1 * span * (high >= 0))
    low = 0.0 if 0 < low < 0.5 * high else low
    high = 0.0 if 0 > high > 0.5 * low else high
    step = _step(high - low, 4)
    return math.floor(low / step + 1e-9) * step, math.ceil(high / step - 1e-9) * step


def _step(span: float, parts: int) -> float:
    """1, 2 or 5 times a power of ten, so that about so many steps make the span."""
    power = 10.0 ** math.floor(math.log10(span / parts))
    return next(k * power for k in (1, 2, 5, 10) if k * power >= span / parts * (1 - 1e-9))


def ticks(scale: Scale, parts: int = 5) -> list[tuple[float, str]]:
    """Round values within a scale, with their texts."""
    if scale.log:
        first, last = round(math.log10(scale.low)), round(math.log10(scale.high))
        every = -(-(last - first) // 6)
        return [(10.0**k, number(10.0**k)) for k in range(first, last + 1, every)]
    step = _step(scale.high - scale.low, parts)
    steps = range(math.ceil(scale.low / step - 1e-6), math.floor(scale.high / step + 1e-6) + 1)
    digits = -math.floor(math.log10(step) + 1e-9)
    return [(k * step, number(k * step, digits)) for k in steps]


def number(value: float, digits: int | None = None) -> str:
    """A number as a reader likes it: as many decimals as `digits`, which may be negative, or six
    significant ones; far from one with a power of ten and the same decimals, or four digits."""
    if value == 0:
        return "0"
    if not 1e-3 <= abs(value) < 1e5:
        known = 4 if digits is None else math.floor(math.log10(abs(value)) + 1e-9) + digits + 1
        mantissa, _, power = f"{value:.{max(1, known)}g}".partition("e")
        return f"{mantissa}e{int(power)}" if power else mantissa
    return f"{value:.{max(0, digits)}f}" if digits is not None else f"{value:.6g}"


def _grid(x: Scale, y: Scale) -> str:
    """Lines across with their values, and the time axis with its ticks."""
    right, bottom = WIDTH - RIGHT, HEIGHT - BOTTOM
    rows = "".join(_row(y(value), text) for value, text in ticks(y, 4))
    columns = "".join(_tick(x(value), text) for value, text in ticks(x))
    axis = f'<line class="tick" x1="{LEFT}" x2="{right}" y1="{bottom}" y2="{bottom}"/>'
    return rows + columns + axis


def _row(place: float, text: str) -> str:
    """A line across the drawing, with the value that it stands for."""
    return (f'<line class="grid" x1="{LEFT}" x2="{WIDTH - RIGHT}" '
            f'y1="{place:.1f}" y2="{place:.1f}"/>'
            f'<text class="y" x="{LEFT - 5}" y="{place + 3.5:.1f}">{text}</text>')


def _tick(place: float, text: str) -> str:
    """A tick of the time axis, with its time."""
    bottom = HEIGHT - BOTTOM
    return (f'<line class="tick" x1="{place:.1f}" x2="{place:.1f}" '
            f'y1="{bottom}" y2="{bottom + 4}"/>'
            f'<text class="x" x="{place:.1f}" y="{bottom + 15}">{text}</text>')


def _mark(x: Scale, time: float) -> str:
    place = f"{x(time):.1f}"
    return f'<line class="mark" x1="{place}" x2="{place}" y1="{TOP}" y2="{HEIGHT - BOTTOM}"/>'


def _drawn(line: Line, k: int, x: Scale, y: Scale) -> str:
    """A line's pieces between gaps; a piece of one point is a dot."""
    known = np.flatnonzero(np.isfinite(line.values) & ((line.values > 0) | (not y.log)))
    pieces = np.split(known, np.flatnonzero(np.diff(known) > 1) + 1)
    return "".join(_piece(x(line.times[piece]), y(line.values[piece]), k, line.dots)
                   for piece in pieces)


def _piece(across: np.ndarray, up: np.ndarray, k: int, dots: bool) -> str:
    points = [f"{a:.1f},{b:.1f}" for a, b in zip(across, up)]
    if len(points) > 1 and not dots:
        return f'<polyline class="line{k % COLOURS}" points="{" ".join(points)}"/>'
    places = (point.split(",") for point in points)
    return "".join(f'<circle class="dot{k % COLOURS}" cx="{a}" cy="{b}" r="2.6"/>'
                   for a, b in places)


def _legend(lines: Sequence[Line]) -> str:
    if len(lines) < 2:
        return ""
    entries = "".join(f"<span>{swatch(k, line.dots)}{escape(line.label)}</span>"
                      for k, line in enumerate(lines))
    return f'<span class="legend">{entries}</span>'


def swatch(k: int, dots: bool = False) -> str:
    """A sample of a line for a legend."""
    kind = (f'<circle class="dot{k % COLOURS}" cx="12" cy="5" r="2.6"/>' if dots else
            f'<polyline class="line{k % COLOURS}" points="0,5 24,5"/>')
    return f'<svg class="swatch" viewBox="0 0 24 10" aria-hidden="true">{kind}</svg>'


def _told(lines: Sequence[Line], x: Scale) -> str:
    """What a pointer is told, as JSON: the time axis and the lines' numbers.

    The axis is four numbers: from which time to which, and from where to where in the drawing.
    """
    numbers = [{"label": line.label, "t": _short(line.times), "y": _short(line.values)}
               for line in lines]
    told = {"axis": [x.low, x.high, x.start, x.end], "lines": numbers}
    return json.dumps(told, separators=(",", ":"), allow_nan=False)


def _short(values: np.ndarray) -> list[float | None]:
    return [float(f"{value:.6g}") if math.isfinite(value) else None for value in values.tolist()]
