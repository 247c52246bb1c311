"""The page that compares runs."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from pathlib import Path

import numpy as np

from repro.report import charts, page, quantities
from repro.report.reading import Run
from repro.results import names
from repro.scene.units import alike

#: A value of this many times another one is not a percentage any more.
TIMES = 10.0


def build(runs: Sequence[Run]) -> str:
    """The text of the page, which compares each further run with the first one."""
    labels = short([run.folder for run in runs])
    figures = "".join(map(charts.svg, quantities.overlaid(runs, labels)))
    body = (_head(runs, labels) + _scenes(runs, labels) + _values(runs, labels)
            + page.section("Over time", f'<div class="charts">{figures}</div>' if figures else ""))
    return page.page("Runs compared", body, ["errors.js", "charts.js"])


def short(folders: Sequence[Path]) -> list[str]:
    """The names of the folders, or their full paths if two names are the same."""
    folder_names = [folder.resolve().name for folder in folders]
    if len(set(folder_names)) == len(folder_names):
        return folder_names
    return [str(folder) for folder in folders]


def _head(runs: Sequence[Run], labels: Sequence[str]) -> str:
    rows = "".join(map(_item, range(len(runs)), runs, labels))
    return f'<header><h1>{len(runs)} runs compared</h1><ul class="runs">{rows}</ul></header>\n'


def _item(k: int, run: Run, label: str) -> str:
    """Run number k in the list of runs."""
    return (f"<li>{charts.swatch(k)}<b>{escape(label)}</b>: {escape(_describe_run(run))}; "
            f"{escape(str(run.folder))}</li>")


def _describe_run(run: Run) -> str:
    last = f" to t = {run.times[-1]:.6g} h" if len(run.times) else ", no row"
    return f"{run.record['scene']}, {run.record['status']}{last}"


def differences(runs: Sequence[Run]) -> list[tuple[str, ...]]:
    """(key, value in each run) of the keys of the scenes that are not the same in all runs.

    The value is "-" if a run does not have the key.
    """
    scenes = [page.flat(run.record["tables"]) for run in runs]
    keys = dict.fromkeys(key for keys in scenes for key in keys)
    return [(key, *_value_texts(key, scenes)) for key in keys if _differs(key, scenes)]


def _differs(key: str, scenes: Sequence[dict[str, object]]) -> bool:
    """Does the value of a key in any scene differ from that in the first one?"""
    return not all(alike(keys.get(key), scenes[0].get(key)) for keys in scenes)


def _value_texts(key: str, scenes: Sequence[dict[str, object]]) -> list[str]:
    """The value of a key in each scene, as text."""
    return [page.format_value(keys[key]) if key in keys else "-" for keys in scenes]


def _scenes(runs: Sequence[Run], labels: Sequence[str]) -> str:
    differing = page.table("", ["key", *labels], differences(runs))
    nothing = "<p>Nothing: the scenes are the same.</p>"
    return page.section("What differs in the scenes", differing or nothing)


def common_time(runs: Sequence[Run]) -> float | None:
    """The last time (h) that all runs with rows have reached; None without rows."""
    return min((float(run.times[-1]) for run in runs if len(run.times)), default=None)


def values(runs: Sequence[Run], time: float) -> dict[str, list[float | None]]:
    """The value of each column in each run at a time (h), linear between rows; None if unknown."""
    columns = dict.fromkeys(name for run in runs for name in run.series
                            if name not in names.NOT_COMPARED)
    return {name: _in_each(runs, name, time) for name in columns}


def _in_each(runs: Sequence[Run], name: str, time: float) -> list[float | None]:
    return [_at(run, name, time) for run in runs]


def _at(run: Run, name: str, time: float) -> float | None:
    if name not in run.series or not len(run.times) or time < run.times[0]:
        return None
    value = float(np.interp(time, run.times, run.series[name]))
    return value if np.isfinite(value) else None


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
