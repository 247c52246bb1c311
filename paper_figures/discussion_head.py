"""Base under its constant head, through contact, beside Wide at constant velocity. Not in the paper."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from paper_figures import figure_6, runs, states, style
from paper_figures.states import contact
from verification.claims.permeability import consumed, specific_growth

TITLE = "Addition. Clogging under a constant head"
RUNS = (runs.CLOSING, runs.WIDE)
CLAIMS = ("C43", "C12", "C16")

#: Hours between the outlines of base.
EVERY = 10.0


@style.styled
def draw(closing: Path, wide: Path) -> Figure:
    """Outlines, conductivities of both runs, and flow, uptake and growth of base over their largest."""
    made = style.figure(5.0)
    panels = made.subplot_mosaic([["outlines", "outlines"], ["fall", "restricted"]], height_ratios=[1, 1.1])
    _outlines(panels["outlines"], closing)
    _fall(panels["fall"], closing, wide)
    _restricted(panels["restricted"], closing)
    for name in ("fall", "restricted"):
        style.grid(panels[name])
        panels[name].legend(loc="upper right", bbox_to_anchor=(0.93, 1.0))
    style.number_panels(*panels.values())
    return made


def _outlines(axes: Axes, closing: Path) -> None:
    """As in Figure 6, and the first in contact with the opposite wall."""
    figure_6.outlines(axes, closing, EVERY)
    axes.set_title("outlines of Base")
    meets = contact(closing)
    if np.isfinite(meets):
        state = states.near(closing, meets)
        style.aggregate(axes, figure_6.smooth(state.rim, state.width), filled=False, edgecolor=style.RED, zorder=5,
                        linestyle="--", label=f"in contact, {meets:g} h")
        axes.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0))


def _fall(axes: Axes, closing: Path, wide: Path) -> None:
    named = ((closing, "Base (head)", style.BLUE), (wide, "Wide (velocity)", style.RED))
    for folder, name, colour in named:
        table, meets = states.series(folder), contact(folder)
        axes.plot(table["time_h"], table["conductivity_m_per_d"] / table["conductivity_m_per_d"][0], color=colour,
                  label=name)
        if np.isfinite(meets):
            axes.axvline(meets, color=colour, linewidth=0.8, linestyle=":")
    axes.set(title="conductivity over the first", xlabel="time (h)", yscale="log", xlim=(0, None))


def _restricted(axes: Axes, closing: Path) -> None:
    table = states.series(closing)
    taken, rate = consumed(table), specific_growth(table)
    middles = 0.5 * (table["time_h"][1:] + table["time_h"][:-1])
    axes.plot(table["time_h"], table["mean_velocity_m_per_d"] / table["mean_velocity_m_per_d"].max(), color=style.BLUE,
              label="velocity")
    axes.plot(table["time_h"], taken / taken.max(), color=style.RED, label="acceptor taken up")
    axes.plot(middles, rate / rate.max(), color=style.BLACK, label="growth rate of the area")
    axes.set(title="Base, over the largest", xlabel="time (h)", yscale="log", xlim=(0, None))


def caption(closing: Path, wide: Path) -> str:
    """What is seen, with the velocities and the time of contact."""
    table, meets = states.series(closing), contact(closing)
    velocity = table["mean_velocity_m_per_d"]
    rate = specific_growth(table)
    touched = (f"The first row in contact with the opposite wall is that of {meets:g} h" if np.isfinite(meets)
               else "The opposite wall is not touched")
    return (f"Base carried on to {table['time_h'][-1]:g} h (preset `fast`). {touched}; the velocity falls from "
            f"{velocity[0]:.3g} to {velocity[-1]:.2g} m/d. (a) Outlines every {EVERY:g} h, and dashed the first in "
            "contact; (b) conductivity, beside "
            "that of Wide, whose velocity is kept up, with the times of contact dotted; (c) velocity, acceptor taken "
            f"up, and growth rate of the area, which falls from {rate[0]:.2g} to {rate[-1]:.2g} 1/h: the head drives "
            "ever less water through, so that the aggregate starves before it plugs the pore.")
