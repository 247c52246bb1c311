"""Variants of Wide, each with one change of rheology or wall contact. Not in the paper."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from paper_figures import figure_6, runs, states, style
from paper_figures.states import contact

TITLE = "Addition. Another rheology and other conditions at the walls"
RUNS = (runs.WIDE_FAST, *runs.VARIANTS.values())
CLAIMS = ("C41",)

COLOURS = ("#000000", "#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9")
LABELS = ("as in the paper", *runs.VARIANTS)
#: The curves begin this many hours before the first contact.
BEFORE = 4.0


@style.styled
def draw(*folders: Path) -> Figure:
    """The last outlines, the conductivity around contact, and its changes; each run has a colour."""
    figure = style.figure(7.0)
    panels = figure.subplot_mosaic([["outlines"], ["conductivity"], ["changes"]], height_ratios=[1, 1, 1.2])
    _outlines(panels["outlines"], folders)
    _conductivity(panels["conductivity"], folders)
    _changes(panels["changes"], folders)
    panels["conductivity"].legend(loc="center left", bbox_to_anchor=(1.0, 0.5))
    style.number_panels(*panels.values())
    return figure


def _outlines(axes: Axes, folders: tuple[Path, ...]) -> None:
    last_states = [states.last(folder) for folder in folders]
    first, last = min(s.rim[:, 0].min() for s in last_states), max(s.rim[:, 0].max() for s in last_states)
    style.pore(axes, (first - figure_6.MARGIN, last + figure_6.MARGIN), last_states[0].width, 2.5)
    for number, (state, colour) in enumerate(zip(last_states, COLOURS)):
        style.aggregate(axes, figure_6.smooth(state.rim, state.width), filled=number == 0, edgecolor=colour,
                        linewidth=1.0, zorder=2 + 0.1 * number)
    axes.set_title(f"outlines at {last_states[0].time:g} h")


def _conductivity(axes: Axes, folders: tuple[Path, ...]) -> None:
    for number, (folder, label, colour) in enumerate(zip(folders, LABELS, COLOURS)):
        table = states.series(folder)
        axes.plot(table["time_h"], table["conductivity_m_per_d"], "-" if number == 0 else "--", color=colour,
                  label=label, linewidth=2.0 if number == 0 else 1.1, zorder=1 if number == 0 else 2)
    table = states.series(folders[0])
    first, end = _range(table, contact(folders[0]))
    conductivity = table["conductivity_m_per_d"][table["time_h"] >= first]
    axes.set(title="hydraulic conductivity of the pore", xlabel="time (h)", ylabel="m/d", yscale="log",
             xlim=(first, end), ylim=(0.7 * conductivity.min(), 1.4 * conductivity.max()))
    style.grid(axes)


def _range(table: dict[str, np.ndarray], contact_time: float) -> tuple[float, float]:
    """The hours of both panels: from BEFORE contact to the end."""
    end = float(table["time_h"][-1])
    return min(contact_time, end) - BEFORE, end


def _changes(axes: Axes, folders: tuple[Path, ...]) -> None:
    """Change of the conductivity (%) against the paper's choice at the same time, on a scale that is linear up to 1 %.
    """
    plain = states.series(folders[0])
    for folder, label, colour in zip(folders[1:], LABELS[1:], COLOURS[1:]):
        table = states.series(folder)
        reference = np.interp(table["time_h"], plain["time_h"], plain["conductivity_m_per_d"])
        axes.plot(table["time_h"], 100 * (table["conductivity_m_per_d"] / reference - 1), color=colour, label=label)
    axes.axhline(0.0, color=COLOURS[0], linewidth=0.8)
    axes.set(title="change of the conductivity at the same time", xlabel="time (h)", ylabel="%",
             xlim=_range(plain, contact(folders[0])))
    axes.set_yscale("symlog", linthresh=1.0)
    axes.set_yticks([-10, -1, 0, 1, 10, 100], labels=["-10", "-1", "0", "1", "10", "100"])
    style.grid(axes)


def caption(*folders: Path) -> str:
    """Caption, with the first rows in contact and the last conductivities."""
    tables = [states.series(folder) for folder in folders]
    results = "; ".join(f"{label}: {contact(folder):g} h and {table['conductivity_m_per_d'][-1]:.3g} m/d"
                     for label, folder, table in zip(LABELS, folders, tables))
    return (f"Wide ({figure_6.ASSUMED}) to {tables[0]['time_h'][-1]:g} h with one change at a time: new biomass is "
            "stress-free (section 5), or the least film or contact angle of 2.3.3 is halved or doubled; C41 also "
            "chooses the fixed midpoints of the contact surfaces anew. (a) The last outlines; (b) the "
            f"conductivity from {BEFORE:g} h before contact on; (c) its change in percent, linear up to 1 % and "
            "logarithmic beyond; the "
            f"peaks are contact at another time. First row in contact, and conductivity at the end: {results}.")
