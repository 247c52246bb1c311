"""Lines and dots on labelled axes as inline SVG, in the colours of the page around it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from html import escape

#: Colours of a page in which pictures are, by class: from the first value to the last.
LEVELS = 7
WIDTH, HEIGHT = 460, 330
#: Room around the picture for what is written.
LEFT = 62
RIGHT = 12
TOP = 14
BOTTOM = 48


@dataclass(frozen=True)
class Axis:
    """A label and the ends of what is shown, on a linear or logarithmic scale.

    `words` stand at 0, 1, 2, ...
    """

    label: str
    low: float
    high: float
    log: bool = False
    words: tuple[str, ...] = ()

    def part(self, value: float) -> float:
        """Where a value is, from 0 to 1."""
        if self.log:
            return math.log(value / self.low) / math.log(self.high / self.low)
        return (value - self.low) / (self.high - self.low)

    def ticks(self) -> list[float]:
        """Round values between the ends, or the places of the words."""
        if self.words:
            return [float(place) for place in range(len(self.words))]
        if self.log:
            return self._decades()
        first = math.ceil(self.low / self._step - 1e-9)
        last = math.floor(self.high / self._step + 1e-9)
        return [k * self._step for k in range(first, last + 1)]

    @property
    def _step(self) -> float:
        """From one tick to the next."""
        return _round_step((self.high - self.low) / 5)

    def _decades(self) -> list[float]:
        """Powers of ten between the ends, with 2 and 5 times these where there are few."""
        decades = range(math.floor(math.log10(self.low)), math.ceil(math.log10(self.high)) + 1)
        steps = (1, 2, 5) if self.high < 1000 * self.low else (1,)
        found = [step * 10.0**decade for decade in decades for step in steps]
        found = [value for value in found if 0.999 * self.low <= value <= 1.001 * self.high]
        return found if len(found) > 1 else [self.low, self.high]

    def said(self, value: float) -> str:
        """What stands at a tick: four digits, or as many as tell it from the next one."""
        if self.words:
            return escape(self.words[int(value)])
        over = 1.0 if self.log else max(abs(self.low), abs(self.high)) / self._step
        return f"{value:.{max(4, 1 + math.ceil(math.log10(over)))}g}"


def _round_step(least: float) -> float:
    """The next of 1, 2, 5, 10, 20, ..."""
    power = 10.0 ** math.floor(math.log10(least))
    return next(step * power for step in (1, 2, 5, 10) if step * power >= 0.999 * least)


def around(label: str, values: Sequence[float], log: bool, zero: bool = False) -> Axis:
    """An axis with all of the values on it and a margin; from zero on where that is asked for."""
    low, high = min(values), max(values)
    if log:
        margin = (high / low) ** 0.06 if high > low else 2.0
        return Axis(label, low / margin, high * margin, True)
    low = 0.0 if zero else low
    margin = 0.06 * (high - low) or 0.5 * abs(high) or 1.0
    return Axis(label, low if zero else low - margin, high + margin)


def at(x: Axis, y: Axis, point: tuple[float, float]) -> tuple[float, float]:
    """The place of a point in the picture."""
    across = LEFT + x.part(point[0]) * (WIDTH - LEFT - RIGHT)
    down = HEIGHT - BOTTOM - y.part(point[1]) * (HEIGHT - TOP - BOTTOM)
    return round(across, 1), round(down, 1)


def line(places: Sequence[tuple[float, float]], level: int, said: str) -> str:
    """A line through places of the picture; `said` is shown where the pointer is."""
    path = " ".join(f"{x},{y}" for x, y in places)
    return (f'<polyline class="line level{level}" points="{path}"><title>{escape(said)}</title>'
            "</polyline>")


def dot(place: tuple[float, float], level: int, said: str) -> str:
    """A dot."""
    x, y = place
    return (f'<circle class="dot level{level}" cx="{x}" cy="{y}" r="5">'
            f"<title>{escape(said)}</title></circle>")


def later(place: tuple[float, float], level: int, said: str) -> str:
    """A hollow triangle that points up: the value is larger than where it stands."""
    x, y = place
    corners = f"{x - 6},{y + 5} {x + 6},{y + 5} {x},{y - 6}"
    return (f'<polygon class="later level{level}" points="{corners}"><title>{escape(said)}</title>'
            "</polygon>")


def plot(x: Axis, y: Axis, said: str, marks: Sequence[str]) -> str:
    """The whole picture; `said` is what it shows, for who cannot see it."""
    right, floor = WIDTH - RIGHT, HEIGHT - BOTTOM
    parts = [f'<rect class="frame" x="{LEFT}" y="{TOP}" width="{right - LEFT}" '
             f'height="{floor - TOP}"/>']
    parts += [_upright(at(x, y, (value, y.low))[0], x.said(value)) for value in x.ticks()]
    parts += [_across(at(x, y, (x.low, value))[1], y.said(value)) for value in y.ticks()]
    return (f'<svg viewBox="0 0 {WIDTH} {HEIGHT}" role="img" aria-label="{escape(said)}">'
            f'{"".join(parts)}{_labels(x, y)}{"".join(marks)}</svg>')


def _upright(place: float, text: str) -> str:
    """A line of the grid at a tick of the axis across."""
    floor = HEIGHT - BOTTOM
    return (f'<line class="grid" x1="{place}" x2="{place}" y1="{TOP}" y2="{floor}"/>'
            f'<text x="{place}" y="{floor + 17}" text-anchor="middle">{text}</text>')


def _across(place: float, text: str) -> str:
    """A line of the grid at a tick of the axis upwards."""
    return (f'<line class="grid" x1="{LEFT}" x2="{WIDTH - RIGHT}" y1="{place}" y2="{place}"/>'
            f'<text x="{LEFT - 6}" y="{place + 4}" text-anchor="end">{text}</text>')


def _labels(x: Axis, y: Axis) -> str:
    """What the axes show, below and on the left."""
    across, middle = (LEFT + WIDTH - RIGHT) / 2, (TOP + HEIGHT - BOTTOM) / 2
    return (f'<text x="{across}" y="{HEIGHT - 8}" text-anchor="middle">{escape(x.label)}</text>'
            f'<text transform="translate(15 {middle}) rotate(-90)" text-anchor="middle">'
            f"{escape(y.label)}</text>")
