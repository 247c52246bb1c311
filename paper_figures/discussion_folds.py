"""Where pores like Base and Wide fold, in width, supply and drive, and when. Not in the paper."""

from __future__ import annotations

from collections import Counter

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure

from paper_figures import style
from verification.problems import family

TITLE = "Addition. Pores whose aggregate folds"
RUNS = ()
CLAIMS = ("C48", "C49")

#: Titles of the drives. A head has the gradient of Base.
DRIVES = {"head": "head of Base", "0.3 m/day": "0.3 m/d", "10 m/day": "10 m/d"}
#: The verdict of a run whose end comes before contact with the opposite wall.
BEFORE_CONTACT = "end before contact"
#: Markers of verdicts other than a fold.
MARKERS = {BEFORE_CONTACT: ("x", "ends before contact"), family.ARRIVES: ("o", "reaches its end"),
           family.PORE_END: ("s", "reaches an end of the pore")}
TIMES = LogNorm(20.0, 500.0)


@style.styled
def draw() -> Figure:
    """A panel for each drive; colours of triangles are times of folds."""
    figure = style.figure(2.9)
    panels = figure.subplots(1, 3, sharey=True)
    for axes, drive in zip(panels, DRIVES):
        _panel(axes, [row for row in family.read_record().values() if row["drive"] == drive])
        axes.set_title(DRIVES[drive])
        style.grid(axes)
    panels[0].set_ylabel("supply (mg/L)")
    panels[0].plot(50.0, 10.0, "*", color=style.BLUE, markersize=8, label="Base")
    for axes in panels[1:]:
        axes.plot(100.0, 10.0, "D", color=style.RED, markersize=5, label="Wide, 2.9 m/d")
    figure.colorbar(ScalarMappable(TIMES, style.MAP), ax=panels, label="time of the fold (h)")
    handles = {label: line for axes in panels for line, label in zip(*axes.get_legend_handles_labels())}
    figure.legend(handles.values(), handles.keys(), loc="outside lower center", ncols=3)
    style.number_panels(*panels)
    return figure


def _panel(axes: Axes, rows: list[dict]) -> None:
    for verdict, (marker, label) in MARKERS.items():
        width, supply = _places(rows, verdict)
        axes.plot(width, supply, marker, color=style.FAINT, markerfacecolor="none", markersize=4, label=label)
    width, supply = _places(rows, family.FOLD)
    times = [row["times_h"][-1] for row in rows if row["verdict"] == family.FOLD]
    axes.scatter(width, supply, c=times, norm=TIMES, cmap=style.MAP, marker="^", edgecolor=style.BLACK, linewidth=0.5,
                 label="folds", zorder=3)
    axes.set(xscale="log", yscale="log", xlim=(23, 217), ylim=(0.2, 140), xlabel="width (µm)",
             xticks=(25, 50, 100, 200), xticklabels=("25", "50", "100", "200"))
    axes.minorticks_off()


def _places(rows: list[dict], verdict: str) -> np.ndarray:
    """(2, n) widths and supplies of the members with a verdict."""
    return np.array([(row["width"], row["supply"]) for row in rows if _verdict(row) == verdict]).reshape(-1, 2).T


def _verdict(row: dict) -> str:
    """The recorded verdict; `BEFORE_CONTACT` if the run reaches its end without contact, and may fold later."""
    return BEFORE_CONTACT if family.ends_before_contact(row) else row["verdict"]


def caption() -> str:
    """Caption, with the numbers of runs."""
    rows = list(family.read_record().values())
    folds = [row for row in rows if row["verdict"] == family.FOLD]
    times = [row["times_h"][-1] for row in folds]
    return (f"{len(rows)} pores drawn at random, 24 widths long, with seeds of 0.1 to 0.35 widths, each run in `fast` "
            f"for three times the earliest possible time of contact. In {len(folds)} of them growth compresses the "
            f"surface of the aggregate until it folds, after {min(times):.3g} to {max(times):.3g} h; the narrowest of "
            f"these is {min(row['width'] for row in folds):.0f} µm wide. By the drive: {_by_drive(rows)}. The shares "
            "are lower bounds: a run that ends before contact (crosses) may fold later, as three do at 0.3 m/d that "
            "were continued (docs/design.md). The pores that fold are wide, and their aggregates starve. A fold is "
            "found where the stretch falls below a threshold of a half-space; a margin above it, 0.68, was fitted to "
            "runs that failed. A blue star marks Base, and a red diamond Wide, whose velocity lies between those of "
            "(b) and (c). The rows are those "
            "of `verification/report/pores.jsonl`, which `python -m verification.problems.family` writes.")


def _by_drive(rows: list[dict]) -> str:
    """The folds with each drive, and the runs that end before contact."""
    counts = {drive: Counter(_verdict(row) for row in rows if row["drive"] == drive) for drive in DRIVES}
    return "; ".join(f"{title}, {counts[drive][family.FOLD]} of {counts[drive].total()} fold, and "
                     f"{counts[drive][BEFORE_CONTACT]} end before contact" for drive, title in DRIVES.items())
