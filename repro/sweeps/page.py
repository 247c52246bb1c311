"""``summary.html``: charts of the runs of a sweep, and how each run ended.

The page needs no network.
"""

from collections.abc import Callable, Iterable
from functools import partial
from html import escape

import numpy as np

from repro.report import charts
from repro.report import page as html
from repro.report.colours import viridis
from repro.results import write_text
from repro.results.names import ANSWER, KNOWN
from repro.sweeps.design import Factor, label
from repro.sweeps.folder import Sweep
from repro.sweeps.table import NUMBERS, SweepRun

#: Number of colours of a scale.
LEVELS = 7
#: The parts of viridis that are visible on a light page and on a dark one.
ON_LIGHT, ON_DARK = (0.0, 0.65), (0.35, 1.0)


def write(sweep: Sweep, runs: list[SweepRun], clogged: float) -> None:
    """Write ``summary.html``."""
    write_text(sweep.folder / "summary.html", page(sweep, runs, clogged))


def page(sweep: Sweep, runs: list[SweepRun], clogged: float) -> str:
    """The text of the page."""
    finished = sum(run.is_over for run in runs)
    title = f"Sweep of {sweep.source}"
    varied = "".join(f"<li>{escape(_describe(factor))}</li>" for factor in sweep.factors)
    body = f"""<h1>{escape(title)}</h1>
<p>{finished} of {len(runs)} runs have come to their end. Varied:</p><ul>{varied}</ul>
<p class="note">Biomass is the aggregate's area over the pore's. Conductivity is relative to that at
the start of the run. A pore counts as clogged once it has fallen to {clogged:g}; contact is the
first row in which the aggregate touches the opposite wall. Values between the rows of a run are
interpolated; <code>output.times</code> adds rows.</p>
{_conductivity(sweep, runs)}{_clogging(sweep, runs, clogged)}{_last(sweep, runs)}
{html.section("Runs", _table(sweep, runs))}"""
    return html.page(title, body, style="sweep.css", rules=_colours())


def _colours() -> str:
    """The colours of lines and dots, as rules of style."""
    light, dark = ("".join(f".line{k} {{ stroke: {colour}; }} .dot{k} {{ fill: {colour}; }}\n"
                           for k, colour in enumerate(colours))
                   for colours in (viridis(LEVELS, *ON_LIGHT), viridis(LEVELS, *ON_DARK)))
    return f"{light}@media (prefers-color-scheme: dark) {{\n{dark}}}\n"


def _describe(factor: Factor) -> str:
    values = list(dict.fromkeys(factor.values))
    first, last = factor.short(min(values)), factor.short(max(values))
    if factor.is_range:
        count = f", {factor.count} values" if factor.count else ""
        return f"{factor.key}: {first} to {last}, {factor.spacing}{count}"
    if len(values) <= 2 * LEVELS or not factor.numeric:
        return f"{factor.key}: {', '.join(map(factor.short, values))}"
    return f"{factor.key}: {len(values)} values from {first} to {last}"


def _is_logarithmic(factor: Factor) -> bool:
    """Does the factor need a logarithmic scale?"""
    numbers = [_number(factor, value) for value in factor.values] if factor.numeric else [1.0]
    return factor.is_log or not factor.is_range and charts.is_wide(numbers)


def _number(factor: Factor, value: float | str) -> float:
    """A numeric value, or the position of a word among the values."""
    return float(factor.values.index(value)) if isinstance(value, str) else value


def _level(factor: Factor, value: float | str) -> int:
    """The number of the colour of a value."""
    numbers = [_number(factor, each) for each in factor.values]
    low, high = min(numbers), max(numbers)
    if low == high:
        return 0
    colours = charts.Scale(low, high, 0, LEVELS - 1, _is_logarithmic(factor))
    return round(float(colours(_number(factor, value))))


def _key(factor: Factor, runs: list[SweepRun], k: int) -> str:
    """The legend of the colours: values, each beside a line in its colour."""
    values = sorted({run.point.values[k] for run in runs}, key=partial(_number, factor))
    if len(values) > 2 * LEVELS:
        last = len(values) - 1
        values = [values[round(i * last / (LEVELS - 1))] for i in range(LEVELS)]
    entries = "".join(f"<li>{charts.swatch(_level(factor, value))}"
                      f"{escape(factor.short(value))}</li>" for value in values)
    return f'<ul class="key"><li>{escape(factor.key)}</li>{entries}</ul>'


def _run_title(sweep: Sweep, run: SweepRun) -> str:
    return f"run {run.point.index}: {label(sweep.factors, run.point.values)}"


def _pictures(sweep: Sweep, title: str, runs: list[SweepRun], needs: str,
              draw: Callable[[list[SweepRun], int], str], note: str = "") -> str:
    """A section with a chart of runs for each varied key, by its number; needs: the parts that no
    run has together if there is no run to draw."""
    if not runs:
        return html.section(title, f'<p class="note">No run has both {needs}.</p>')
    figures = "".join(f"<figure>{draw(runs, k)}</figure>" for k in range(len(sweep.factors)))
    return html.section(title, note, f'<div class="pictures">{figures}</div>')


def _conductivity(sweep: Sweep, runs: list[SweepRun]) -> str:
    """Conductivity against biomass, one line for each run.

    Each varied key has a chart that is coloured by it.
    """
    plotted = [run for run in runs
               if np.isfinite(run.relative).any() and np.isfinite(run.biomass).any()]
    return _pictures(sweep, "Conductivity against biomass", plotted, "a flow and an aggregate",
                     partial(_coloured, sweep))


def _coloured(sweep: Sweep, plotted: list[SweepRun], k: int) -> str:
    """A chart with one line for each run, coloured by factor k."""
    factor = sweep.factors[k]
    x = charts.across(*_ends(np.concatenate([run.biomass for run in plotted])))
    y = charts.upwards(*_ends(np.concatenate([run.relative for run in plotted])))
    lines = [charts.curve(x, y, run.biomass, run.relative, _level(factor, run.point.values[k]),
                          title=_run_title(sweep, run)) for run in plotted]
    axes = "biomass: aggregate area / pore area", "conductivity / initial conductivity"
    label = f"Conductivity against biomass, coloured by {factor.key}"
    return charts.drawing(x, y, axes, label, "".join(lines)) + _key(factor, plotted, k)


def _ends(values) -> tuple[float, float, bool]:
    """The ends of an axis for positive values, and whether it is logarithmic. A linear axis begins
    at zero; an axis over a wide range is logarithmic."""
    finite = np.array(values)[np.isfinite(values)]
    log = charts.is_wide(finite)
    low, high = charts.limits(finite if log else [0.0, *finite], log)
    return low, high, log


def _clogging(sweep: Sweep, runs: list[SweepRun], clogged: float) -> str:
    """Clogging time against each varied key, coloured by the next one."""
    plotted = [run for run in runs
               if _time(run) > 0 and (run.is_over or run.numbers["clogging_time_h"])]
    axis = f"time to {clogged:g} of the conductivity (h)"
    note = ('<p class="note">A hollow triangle stands at the end of a run that was not clogged by '
            "then.</p>")
    return _pictures(sweep, "Clogging time", plotted, "a flow and a length in time",
                     partial(_against, sweep, _time, axis, "Clogging time"), note)


def _last(sweep: Sweep, runs: list[SweepRun]) -> str:
    """The last conductivity of the runs, or the last biomass without flow, against each varied key.

    Unlike the time of clogging, this value exists for a pore that does not clog.
    """
    flowing = [run for run in runs if np.isfinite(run.relative).any()]
    plotted = flowing or [run for run in runs if np.isfinite(run.biomass).any()]
    axis = "conductivity / initial conductivity" if flowing else "aggregate area / pore area"
    draw = partial(_against, sweep, lambda run: (run.relative if flowing else run.biomass)[-1],
                   axis, "Last row of each run")
    return _pictures(sweep, "At the end of each run", plotted, "rows and a flow or an aggregate",
                     draw)


def _against(sweep: Sweep, value: Callable[[SweepRun], float], axis: str, title: str,
             plotted: list[SweepRun], k: int) -> str:
    """A value of each run against varied key k, coloured by the next one. A triangle marks a run
    that ends before it clogs."""
    factor, colour_index = sweep.factors[k], (k + 1) % len(sweep.factors)
    coloured_by = sweep.factors[colour_index]
    x = _across(factor, [_number(factor, run.point.values[k]) for run in plotted])
    y = charts.upwards(*_ends([value(run) for run in plotted]))
    marks: list[str] = []
    series: dict[tuple, tuple[int, list]] = {}
    for run in sorted(plotted, key=lambda run: _number(factor, run.point.values[k])):
        reached = value is not _time or run.numbers["clogging_time_h"] is not None
        place = charts.point(x(_number(factor, run.point.values[k])), y(value(run)))
        level = _level(coloured_by, run.point.values[colour_index])
        unit = " h" if value is _time else ""
        text = f"{_run_title(sweep, run)}: {'' if reached else 'after '}{value(run):.4g}{unit}"
        marks.append(charts.dot(place, level, text, 4.0) if reached else
                     charts.triangle(place, level, text))
        rest = run.point.values[:k] + run.point.values[k + 1:]
        series.setdefault(rest, (level, []))[1].extend([place] if reached else [])
    lines = [charts.polyline(places, level) for level, places in series.values()
             if len(places) > 1 < len(sweep.factors)]
    key = _key(coloured_by, plotted, colour_index) if colour_index != k else ""
    name = f"{factor.key} ({factor.unit})" if factor.unit else factor.key
    return charts.drawing(x, y, (name, axis), f"{title} against {factor.key}",
                          "".join(lines + marks)) + key


def _across(factor: Factor, numbers: list[float]) -> charts.Scale:
    """The horizontal axis of a varied key."""
    if not factor.numeric:
        return charts.across(-0.5, len(factor.values) - 0.5, words=factor.values)
    log = _is_logarithmic(factor)
    return charts.across(*charts.padded(numbers, log), log)


def _time(run: SweepRun) -> float:
    """The time (h) at which a pore clogs, or the last simulated time if it does not.

    Zero without flow.
    """
    if not np.isfinite(run.relative).any():
        return 0.0
    reached = run.numbers["clogging_time_h"]
    return float(run.times[-1]) if reached is None else reached


def _table(sweep: Sweep, runs: list[SweepRun]) -> str:
    quantities = KNOWN | {each.name: each for each in NUMBERS}
    values = [run.numbers | run.final for run in runs]
    candidates = ("end_h", "clogging_time_h", "clogging_biomass", "contact_time_h",
                  "contact_biomass", *ANSWER, "wall_time_s")
    shown = [name for name in candidates
             if any(each.get(name) is not None for each in values)]
    names = ["run", *(factor.key for factor in sweep.factors)]
    for number in map(quantities.__getitem__, shown):
        symbol = number.unit.symbol
        names.append(f"{number.label} ({symbol})" if symbol else number.label)
    head = "".join(f"<th>{escape(name)}</th>" for name in names) + '<th class="text">status</th>'
    rows = "".join(_row(sweep, run, map(each.get, shown)) for run, each in zip(runs, values))
    failures = "".join(f'<li class="bad">run {run.point.index}: {escape(run.status)}</li>'
                       for run in runs if not run.is_over)
    return (f'<div class="wide"><table><thead><tr>{head}</tr></thead><tbody>{rows}</tbody></table>'
            f"</div><ul>{failures}</ul>")


def _row(sweep: Sweep, run: SweepRun, numbers: Iterable[float | None]) -> str:
    texts = [factor.short(value) for factor, value in zip(sweep.factors, run.point.values)]
    texts += ["" if value is None else f"{value:.4g}" for value in numbers]
    cells = "".join(f"<td>{escape(text)}</td>" for text in texts)
    link = f'<td><a href="runs/{escape(run.point.name)}/">{run.point.index}</a></td>'
    status = escape(run.status if run.is_over else run.status.partition(":")[0])
    return f'<tr>{link}{cells}<td class="text{"" if run.is_over else " bad"}">{status}</td></tr>'
