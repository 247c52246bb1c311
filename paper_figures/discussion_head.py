"""Base under its constant head, beyond contact, and Wide at constant velocity. Not in the paper."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from paper_figures import figure_6, runs, states, style
from paper_figures.states import contact
from verification.claims.permeability import consumed, specific_growth

TITLE = "Addition. Clogging under a constant head"
RUNS = (runs.CLOSING, runs.WIDE_CONVERGED)
CLAIMS = ("C43", "C12", "C16")

#: Hours between the outlines of base.
EVERY = 10.0


@style.styled
def draw(closing: Path, wide: Path) -> Figure:
    """Outlines, conductivities of both runs, and flow, uptake and growth of Base over their largest values."""
    figure = style.figure(5.0)
    panels = figure.subplot_mosaic([["outlines", "outlines"], ["fall", "restricted"]], height_ratios=[1, 1.1])
    _outlines(panels["outlines"], closing)
    _fall(panels["fall"], closing, wide)
    _restricted(panels["restricted"], closing)
    for name in ("fall", "restricted"):
        style.grid(panels[name])
        panels[name].legend(loc="upper right", bbox_to_anchor=(0.93, 1.0))
    style.number_panels(*panels.values())
    return figure


def _outlines(axes: Axes, closing: Path) -> None:
    """Outlines as in Figure 6, and the first one in contact with the opposite wall."""
    figure_6.outlines(axes, closing, EVERY)
    axes.set_title("outlines of Base")
    contact_time = contact(closing)
    if np.isfinite(contact_time):
        state = states.near(closing, contact_time)
        style.aggregate(axes, figure_6.smooth(state.rim, state.width), filled=False, edgecolor=style.RED, zorder=5,
                        linestyle="--", label=f"in contact, {contact_time:g} h")
        axes.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0))


def _fall(axes: Axes, closing: Path, wide: Path) -> None:
    curves = ((closing, "Base (head)", style.BLUE), (wide, "Wide (velocity)", style.RED))
    for folder, name, colour in curves:
        table, contact_time = states.series(folder), contact(folder)
        axes.plot(table["time_h"], table["conductivity_m_per_d"] / table["conductivity_m_per_d"][0], color=colour,
                  label=name)
        if np.isfinite(contact_time):
            axes.axvline(contact_time, color=colour, linewidth=0.8, linestyle=":")
    axes.set(title="conductivity over its first value", xlabel="time (h)", yscale="log", xlim=(0, None))


def _restricted(axes: Axes, closing: Path) -> None:
    table = states.series(closing)
    uptake, rate = consumed(table), specific_growth(table)
    middles = 0.5 * (table["time_h"][1:] + table["time_h"][:-1])
    axes.plot(table["time_h"], table["mean_velocity_m_per_d"] / table["mean_velocity_m_per_d"].max(), color=style.BLUE,
              label="velocity")
    axes.plot(table["time_h"], uptake / uptake.max(), color=style.RED, label="acceptor taken up")
    axes.plot(middles, rate / rate.max(), color=style.BLACK, label="growth rate of the area")
    axes.set(title="Base, over the largest value", xlabel="time (h)", yscale="log", xlim=(0, None))


def caption(closing: Path, wide: Path) -> str:
    """Caption, with the velocities and the time of contact."""
    table, contact_time = states.series(closing), contact(closing)
    velocity = table["mean_velocity_m_per_d"]
    rate = specific_growth(table)
    contact_sentence = "The aggregate does not touch the opposite wall"
    if np.isfinite(contact_time):
        contact_sentence = f"The first row in contact with the opposite wall is that of {contact_time:g} h"
    return (f"Base, continued to {table['time_h'][-1]:g} h (preset `fast` with shorter steps). {contact_sentence}; "
            f"the velocity falls from {velocity[0]:.3g} to {velocity[-1]:.2g} m/d. (a) Outlines every {EVERY:g} h; "
            "the first one in contact is dashed. (b) Conductivity of Base and of Wide, whose mean velocity is "
            f"constant ({figure_6.ASSUMED}); dotted lines mark contact. (c) Velocity, uptake of the acceptor, and "
            f"growth rate of the area, which falls from {rate[0]:.2g} to {rate[-1]:.2g} 1/h. The constant head drives "
            "less and less water through the pore, so that the aggregate starves before it plugs the pore. At contact "
            "all three fall at once, since the film of 2.3.3 closes at once. A peak of the growth rate just before "
            "contact is not physical: it appears in the steps of the preset, which last up to 10 h, as a difference "
            "of rows that are interpolated within them, and vanishes with these shorter steps.")
