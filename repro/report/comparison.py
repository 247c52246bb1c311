"""The page that compares runs."""

from collections.abc import Sequence
from html import escape
from pathlib import Path

import numpy as np

from repro.report import charts, page, quantities
from repro.report.reading import Run
from repro.results import names
from repro.results.quantities import none_if_nan
from repro.scene.units import alike

#: A value of this many times another one is not a percentage any more.
TIMES = 10.0


def build(runs: Sequence[Run]) -> str:
    """The text of the page, which compares each further run with the first one."""
    labels = short([run.folder for run in runs])
    differing = page.table("", ["key", *labels], differences(runs))
    nothing = "<p>Nothing: the scenes are the same.</p>"
    figures = "".join(map(charts.svg, quantities.overlaid(runs, labels)))
    body = (_head(runs, labels) + page.section("What differs in the scenes", differing or nothing)
            + _values(runs, labels)
            + page.section("Over time", f'<div class="charts">{figures}</div>' if figures else ""))
    return page.page("Runs compared", body, ["errors.js", "charts.js"])


def short(folders: Sequence[Path]) -> list[str]:
    """The names of the folders, or their full paths if two names are the same."""
    folder_names = [folder.resolve().name for folder in folders]
    if len(set(folder_names)) == len(folder_names):
        return folder_names
    return [str(folder) for folder in folders]


def _head(runs: Sequence[Run], labels: Sequence[str]) -> str:
    rows = ""
    for k, (run, label) in enumerate(zip(runs, labels)):
        last = f" to t = {run.times[-1]:.6g} h" if len(run.times) else ", no row"
        ended = f"{run.record['scene']}, {run.record['status']}{last}"
        rows += (f"<li>{charts.swatch(k)}<b>{escape(label)}</b>: {escape(ended)}; "
                 f"{escape(str(run.folder))}</li>")
    return f'<header><h1>{len(runs)} runs compared</h1><ul class="runs">{rows}</ul></header>\n'


def differences(runs: Sequence[Run]) -> list[tuple[str, ...]]:
    """(key, value in each run) of the keys of the scenes that are not the same in all runs.

    The value is "-" if a run does not have the key.
    """
    scenes = [page.flat(run.record["tables"]) for run in runs]
    keys = dict.fromkeys(key for keys in scenes for key in keys)
    return [(key, *(page.format_value(scene[key]) if key in scene else "-" for scene in scenes))
            for key in keys
            if not all(alike(scene.get(key), scenes[0].get(key)) for scene in scenes)]


def common_time(runs: Sequence[Run]) -> float | None:
    """The last time (h) that all runs with rows have reached; None without rows."""
    return min((float(run.times[-1]) for run in runs if len(run.times)), default=None)


def values(runs: Sequence[Run], time: float) -> dict[str, list[float | None]]:
    """The value of each column in each run at a time (h), linear between rows; None if unknown."""
    columns = dict.fromkeys(name for run in runs for name in run.series
                            if name not in names.NOT_COMPARED)

    return {name: [none_if_nan(np.interp(time, run.times, run.series.get(name, run.times * np.nan),
                                         left=np.nan) if len(run.times) else np.nan)
                   for run in runs] for name in columns}


def _values(runs: Sequence[Run], labels: Sequence[str]) -> str:
    time = common_time(runs)
    if time is None:
        return ""
    head = ["", labels[0], *(text for label in labels[1:] for text in (label, "difference"))]
    rows = [_row(name, run_values) for name, run_values in values(runs, time).items()
            if run_values != [None] * len(runs)]
    note = (f'<p class="note">At t = {time:.6g} h, the last time that every run has reached, '
            "linear between rows. Differences are relative to the first run; those of coordinates "
            "are in um.</p>")
    return page.section("Values at the common last time", note, page.table("", head, rows))


def _row(name: str, run_values: Sequence[float | None]) -> list[str]:
    """The words of a column, the value of the first run, then that of each other run with its
    difference."""
    symbol, factor = names.readable_unit(name, [np.array(run_values, float)])
    first, *others = [value if value is None else factor * value for value in run_values]
    texts = [names.with_unit(name, symbol), _text(first)]
    for value in others:
        texts += [_text(value), _text_difference(first, value, name.endswith(names.COORDINATES))]
    return texts


def _text(value: float | None) -> str:
    return "-" if value is None else charts.number(value)


def _text_difference(first: float | None, value: float | None, is_coordinate: bool) -> str:
    if first is None or value is None:
        return "-"
    if value == first:
        return "0"
    if is_coordinate:
        return f"{value - first:+.3g} um"
    if first == 0:
        return "-"
    if abs(value) >= TIMES * abs(first):
        return f"{value / first:.3g} times"
    return f"{100 * (value - first) / abs(first):+.3g} %"
