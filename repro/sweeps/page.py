"""``summary.html``: the laws of a single pore that a sweep finds, and how its runs ended.

It needs no network.
"""

from __future__ import annotations

from html import escape

import numpy as np

from repro.report import charts
from repro.report.page import policy
from repro.results import write_text
from repro.results.files import whole
from repro.results.quantities import Quantity
from repro.sweeps.design import Factor, label
from repro.sweeps.state import Sweep
from repro.sweeps.table import NUMBERS, Told

#: Viridis, dark to light on a light page and without its darkest part on a dark one: told apart by
#: the colour-blind.
LIGHT = ("#440154", "#46327e", "#365c8d", "#277f8e", "#1fa187", "#4ab36b", "#86a51a")
DARK = ("#8d7fe0", "#6f93dd", "#4fa5d0", "#35b7ae", "#5ac883", "#a5d84a", "#fde725")
LEVELS = len(LIGHT)
#: Of the dots of runs.
RADIUS = 4


def _levels(colours: tuple[str, ...]) -> str:
    """The colours as the style names them."""
    return " ".join(f"--level{i}: {colour};" for i, colour in enumerate(colours))


LOOK = """
:root { color-scheme: light dark; --ink: #1c1c1c; --soft: #5a5a5a; --line: #d9d9d6; --page: #fff;
        --bad: #a5330d; LIGHT }
@media (prefers-color-scheme: dark) {
  :root { --ink: #ececea; --soft: #a9a9a6; --line: #3a3c40; --page: #15171a; --bad: #ff9b73; DARK }
}
body { max-width: 66rem; margin: 0 auto; padding: 1.5rem 1rem 3rem; color: var(--ink);
       background: var(--page); font: 1rem/1.5 system-ui, sans-serif; overflow-wrap: anywhere; }
h1 { font-size: 1.5rem; line-height: 1.25; } h2 { font-size: 1.1rem; margin: 2rem 0 .5rem; }
.note { color: var(--soft); } .bad { color: var(--bad); }
.pictures { display: grid; gap: 1.5rem;
            grid-template-columns: repeat(auto-fit, minmax(min(100%, 25rem), 1fr)); }
figure { margin: 0; } figcaption { color: var(--soft); font-size: .9rem; }
svg { display: block; width: 100%; max-width: 34rem; height: auto; overflow: visible; }
svg text { fill: var(--ink); font-size: 10px; } text.y { text-anchor: end; }
text.x, text.name { text-anchor: middle; }
.grid { stroke: var(--line); } .tick { stroke: var(--soft); } circle { stroke: var(--page); }
polyline, polygon { fill: none; stroke-width: 1.5; }
.key { display: flex; flex-wrap: wrap; gap: .2rem 1rem; padding: 0; list-style: none;
       font-size: .9rem; }
.key svg { display: inline-block; width: 1.6rem; height: .7rem; margin-right: .35rem; }
.wide { overflow-x: auto; }
.wide td:first-child { position: sticky; left: 0; background: var(--page); }
table { border-collapse: collapse; font-size: .9rem; font-variant-numeric: tabular-nums; }
th, td { text-align: right; padding: .25rem .6rem; border-bottom: 1px solid var(--line);
         overflow-wrap: normal; }
th { vertical-align: bottom; } td.text, th.text { text-align: left; } a { color: inherit; }
""".replace("LIGHT", _levels(LIGHT)).replace("DARK", _levels(DARK))
LOOK += "".join(f".line{i} {{ stroke: var(--level{i}); }} "
                f".dot{i} {{ fill: var(--level{i}); }}\n"
                for i in range(LEVELS))
#: The numbers of a run that its row shows.
SHOWN = """end_h clogging_time_h clogging_biomass contact_time_h contact_biomass
wall_time_s""".split()


def write(sweep: Sweep, told: list[Told], clogged: float) -> None:
    """Write ``summary.html``."""
    with whole(sweep.folder / "summary.html") as beside:
        write_text(beside, page(sweep, told, clogged))


def page(sweep: Sweep, told: list[Told], clogged: float) -> str:
    """The whole page."""
    done = sum(one.done for one in told)
    title = f"Sweep of {escape(sweep.source)}"
    varied = "".join(f"<li>{escape(_described(factor))}</li>" for factor in sweep.factors)
    return f"""<!DOCTYPE html>
<html lang="en"><head><meta charset="utf-8"/>
<meta http-equiv="Content-Security-Policy" content="{policy(LOOK)}"/>
<meta name="viewport" content="width=device-width, initial-scale=1"/>
<title>{title}</title><style>{LOOK}</style></head><body>
<h1>{title}</h1>
<p>{done} of {len(told)} runs have come to their end. Varied:</p><ul>{varied}</ul>
<p class="note">Biomass is the aggregate's area over the pore's. Conductivity is relative to that of
the run's start. A pore counts as clogged where that has fallen to {clogged:g}; contact is the first
row in which the aggregate touches the opposite wall. Between the rows of a run what is shown is
interpolated: <code>output.times</code> makes more.</p>
{_conductivity(sweep, told)}
{_clogging(sweep, told, clogged)}
<h2>Runs</h2>{_table(sweep, told)}
</body></html>
"""


def _described(factor: Factor) -> str:
    if factor.spacing == "list":
        return f"{factor.key}: {', '.join(map(factor.short, factor.values))}"
    count = f", {factor.count} values" if factor.count else ""
    first, last = map(factor.short, factor.values)
    return f"{factor.key}: {first} to {last}, {factor.spacing}{count}"


def _log(factor: Factor) -> bool:
    """Is it shown on a logarithmic scale?"""
    numbers = [_number(factor, value) for value in factor.values] if factor.numeric else [1.0]
    return factor.spacing == "log" or factor.spacing == "list" and charts.is_wide(numbers)


def _number(factor: Factor, value: float | str) -> float:
    """Words are numbered in their order."""
    return float(factor.values.index(value)) if isinstance(value, str) else value


def _level(factor: Factor, value: float | str) -> int:
    """The colour of a value."""
    numbers = [_number(factor, each) for each in factor.values]
    low, high = min(numbers), max(numbers)
    if low == high:
        return 0
    colours = charts.Scale(low, high, 0, LEVELS - 1, _log(factor))
    return round(float(colours(_number(factor, value))))


def _key(factor: Factor, told: list[Told], which: int) -> str:
    """What the colours stand for."""
    values = sorted({one.point.values[which] for one in told},
                    key=lambda value: _number(factor, value))
    if len(values) > 2 * LEVELS:
        last = len(values) - 1
        values = [values[round(i * last / (LEVELS - 1))] for i in range(LEVELS)]
    entries = "".join(_entry(factor, value) for value in values)
    return f'<ul class="key"><li>{escape(factor.key)}</li>{entries}</ul>'


def _entry(factor: Factor, value: float | str) -> str:
    """A value in the key, beside a line in its colour."""
    return f"<li>{charts.swatch(_level(factor, value))}{escape(factor.short(value))}</li>"


def _said(sweep: Sweep, one: Told) -> str:
    return f"run {one.point.index}: {label(sweep.factors, one.point.values)}"


def _conductivity(sweep: Sweep, told: list[Told]) -> str:
    """Conductivity against biomass, a line a run.

    There is a picture for each key that is varied, coloured by it.
    """
    shown = [one for one in told
             if np.isfinite(one.relative).any() and np.isfinite(one.biomass).any()]
    head = "<h2>Conductivity against biomass</h2>"
    if not shown:
        return f'{head}<p class="note">No run has both a flow and an aggregate.</p>'
    figures = "".join(f"<figure>{_coloured(sweep, shown, which)}</figure>"
                      for which in range(len(sweep.factors)))
    return f'{head}<div class="pictures">{figures}</div>'


def _coloured(sweep: Sweep, shown: list[Told], which: int) -> str:
    """A line a run, coloured by one of the keys that are varied."""
    factor = sweep.factors[which]
    biomass = np.concatenate([one.biomass for one in shown])
    relative = np.concatenate([one.relative for one in shown])
    x, y = charts.across(*_ends(biomass)), charts.upwards(*_ends(relative))
    lines = [charts.curve(x, y, one.biomass, one.relative, _level(factor, one.point.values[which]),
                          _said(sweep, one)) for one in shown]
    axes = "biomass: aggregate area / pore area", "conductivity / initial conductivity"
    label = f"Conductivity against biomass, coloured by {factor.key}"
    return charts.drawing(x, y, axes, label, "".join(lines)) + _key(factor, shown, which)


def _ends(values) -> tuple[float, float, bool]:
    """The ends of an axis for positive values, and whether it is logarithmic: from zero, or
    logarithmic where the values go far."""
    known = np.array(values)[np.isfinite(values)]
    log = charts.is_wide(known)
    low, high = charts.limits(known if log else [0.0, *known], log)
    return low, high, log


def _clogging(sweep: Sweep, told: list[Told], clogged: float) -> str:
    """Clogging time against each key that is varied, coloured by another one."""
    shown = [one for one in told
             if _time(one) > 0 and (one.done or one.numbers["clogging_time_h"])]
    head = "<h2>Clogging time</h2>"
    if not shown:
        return f'{head}<p class="note">No run has both a flow and a length in time.</p>'
    figures = "".join(f"<figure>{_times(sweep, shown, which, clogged)}</figure>"
                      for which in range(len(sweep.factors)))
    return (f'{head}<p class="note">A hollow triangle stands at the end of a run that was not '
            f'clogged by then.</p><div class="pictures">{figures}</div>')


def _times(sweep: Sweep, shown: list[Told], which: int, clogged: float) -> str:
    factor, other = sweep.factors[which], (which + 1) % len(sweep.factors)
    x = _across(factor, [_number(factor, one.point.values[which]) for one in shown])
    y = charts.upwards(*_ends([_time(one) for one in shown]))
    lines: list[str] = []
    marks: list[str] = []
    alike: dict[tuple, tuple[int, list]] = {}
    for one in sorted(shown, key=lambda one: _number(factor, one.point.values[which])):
        reached = one.numbers["clogging_time_h"] is not None
        place = charts.point(x(_number(factor, one.point.values[which])), y(_time(one)))
        level = _level(sweep.factors[other], one.point.values[other])
        said = f"{_said(sweep, one)}: {'' if reached else 'after '}{_time(one):.4g} h"
        marks.append(charts.dot(place, level, said, RADIUS) if reached else
                     charts.triangle(place, level, said))
        rest = one.point.values[:which] + one.point.values[which + 1:]
        alike.setdefault(rest, (level, []))[1].extend([place] if reached else [])
    if len(sweep.factors) > 1:
        lines = [charts.polyline(places, level)
                 for level, places in alike.values() if len(places) > 1]
    key = _key(sweep.factors[other], shown, other) if other != which else ""
    axes = _named(factor), f"time to {clogged:g} of the conductivity (h)"
    label = f"Clogging time against {factor.key}"
    return charts.drawing(x, y, axes, label, "".join(lines + marks)) + key


def _across(factor: Factor, numbers: list[float]) -> charts.Scale:
    """The axis of a key that is varied."""
    if not factor.numeric:
        return charts.across(-0.5, len(factor.values) - 0.5, words=factor.values)
    log = _log(factor)
    return charts.across(*charts.padded(numbers, log), log)


def _named(factor: Factor) -> str:
    """A key and its unit."""
    return f"{factor.key} ({factor.unit})" if factor.unit else factor.key


def _time(one: Told) -> float:
    """When a pore has clogged, or how long it has been simulated (h).

    Zero where there is no flow to clog.
    """
    if not np.isfinite(one.relative).any():
        return 0.0
    reached = one.numbers["clogging_time_h"]
    return float(one.times[-1]) if reached is None else reached


def _table(sweep: Sweep, told: list[Told]) -> str:
    known = {each.name: each for each in NUMBERS}
    names = ["run", *(factor.key for factor in sweep.factors),
             *(_above(known[name]) for name in SHOWN)]
    head = "".join(f"<th>{escape(name)}</th>" for name in names) + '<th class="text">status</th>'
    rows = "".join(_row(sweep, one) for one in told)
    failures = "".join(f'<li class="bad">run {one.point.index}: {escape(one.status)}</li>'
                       for one in told if not one.done)
    return (f'<div class="wide"><table><thead><tr>{head}</tr></thead><tbody>{rows}</tbody></table>'
            f"</div><ul>{failures}</ul>")


def _above(number: Quantity) -> str:
    """What stands above a number: "end (h)"."""
    return f"{number.label} ({number.unit.shown})" if number.unit.shown else number.label


def _row(sweep: Sweep, one: Told) -> str:
    values = [factor.short(value) for factor, value in zip(sweep.factors, one.point.values)]
    numbers = [_short(one.numbers[name]) for name in SHOWN]
    cells = "".join(f"<td>{escape(text)}</td>" for text in (*values, *numbers))
    link = f'<td><a href="runs/{escape(one.point.name)}/">{one.point.index}</a></td>'
    status = escape(one.status if one.done else one.status.partition(":")[0])
    return f'<tr>{link}{cells}<td class="text{"" if one.done else " bad"}">{status}</td></tr>'


def _short(value: float | None) -> str:
    return "" if value is None else f"{value:.4g}"
