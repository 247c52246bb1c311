"""Both runs against time: conductivity, velocity, effluents and size. Not in the paper."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from paper_figures import figure_6, runs, states, style

TITLE = "Addition. Both runs against time"
RUNS = (runs.BASE, runs.WIDE_CONVERGED)
CLAIMS = ("C01", "C02", "C03", "C04", "C09", "C16", "C17", "C30")

NAMES, COLOURS = ("Base", "Wide"), (style.BLUE, style.RED)

#: Column, title, unit, and whether its scale is logarithmic, of each panel.
CURVES = (("conductivity_m_per_d", "hydraulic conductivity of the pore", "m/d", True),
          ("mean_velocity_m_per_d", "mean velocity", "m/d", False),
          ("effluent_{}_mg_per_L", "effluent concentrations", "mg/L", False),
          ("aggregate_area_um2", "area of the aggregate", "µm²", True))
#: Time (h) and value that the paper prints of Base, by column.
PRINTED = {"mean_velocity_m_per_d": ((0.0, 2.9), (19.4, 1.5)), "effluent_{}_mg_per_L": ((19.4, 4.19), (19.4, 6.13))}


@style.styled
def draw(base: Path, wide: Path) -> Figure:
    """Four panels over time; each run has a colour."""
    tables = [states.series(folder) for folder in (base, wide)]
    figure = style.figure(4.6)
    panels = figure.subplots(2, 2, sharex=True).ravel()
    for axes, (column, title, unit, log) in zip(panels, CURVES):
        for table, colour in reversed(list(zip(tables, COLOURS))):
            axes.plot(table["time_h"], table[column.format("acceptor")], color=colour)
            if "{}" in column:
                axes.plot(table["time_h"], table[column.format("donor")], color=colour, linestyle="--")
        axes.set(title=title, ylabel=unit, yscale="log" if log else "linear")
        for time, value in PRINTED.get(column, ()):
            axes.scatter(time, value, marker="x", s=36, color=style.BLACK, linewidths=1.4, zorder=3,
                         clip_on=False)
            axes.annotate(f"{value:g}", (time, value), (3, -13), textcoords="offset points")
        if "{}" in column:
            end = tables[0]["time_h"][-1]
            axes.scatter([end, end], compared_effluents(base), s=18, facecolors="white", edgecolors=COLOURS[0],
                         zorder=4)
        if not log:
            axes.set_ylim(0)
        for time in _contact_times(base, wide):
            axes.axvline(time, color=style.FAINT, linewidth=0.8, linestyle=":")
        style.grid(axes)
    for axes in panels[2:]:
        axes.set(xlabel="time (h)", xlim=(0, None))
    panels[0].legend(handles=[Line2D([], [], color=c, label=n) for n, c in zip(NAMES, COLOURS)], loc="lower left")
    panels[2].legend(handles=[Line2D([], [], color=style.BLACK, linestyle=line, label=name) for name, line in
                              (("acceptor", "-"), ("donor", "--"))], loc="upper right")
    style.number_panels(*panels)
    return figure


def compared_effluents(base: Path) -> list[float]:
    """Effluents (mg/L) of acceptor and donor at the end of Base before the aggregate expands."""
    state = states.last(base, "before_expansion")
    return [state.carried(f"{name}_mg_per_L", 1) for name in ("acceptor", "donor")]


def _contact_times(*folders: Path) -> list[float]:
    """Times of contact of the runs that touch the opposite wall."""
    return [time for time in map(states.contact, folders) if np.isfinite(time)]


def caption(base: Path, wide: Path) -> str:
    """Caption, with first and last values."""
    tables = [states.series(folder) for folder in (base, wide)]
    falls = [t["conductivity_m_per_d"][0] / t["conductivity_m_per_d"][-1] for t in tables]
    contact = " and ".join(f"{time:g} h" for time in _contact_times(base, wide))
    dotted = f" The dotted line marks contact with the opposite wall in Wide, at {contact}." if contact else ""
    return (f"Base (blue, constant head, to {tables[0]['time_h'][-1]:g} h, in the paper's scheme) and Wide (red, "
            f"constant mean velocity, to {tables[1]['time_h'][-1]:g} h, in the converged solution; "
            f"{figure_6.ASSUMED}). Crosses: the values that the paper prints of Base; at 19.4 h it plots the shape of "
            f"19.2 h (E12). (a) Hydraulic conductivity of the whole pore, which falls by a factor of {falls[0]:.3g} "
            f"in Base and {falls[1]:.3g} in Wide; (b) mean velocity; (c) flow-weighted concentrations of acceptor "
            "(full) and donor (dashed) at the outlet, and, as circles, those of Base at 19.4 h before the aggregate "
            f"expands, the state that the paper plots; (d) area of the aggregate.{dotted}")
