"""Figure 6: outlines of the aggregate of Wide."""

from __future__ import annotations

from pathlib import Path

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import BoundaryNorm
from matplotlib.figure import Figure
from shapely import Polygon, box

from paper_figures import runs, states, style
from repro.run.cache import provenance

TITLE = "Figure 6. Outlines of an aggregate that meets the opposite wall"
RUNS = (runs.WIDE,)
CLAIMS = ("C12", "C25", "C29", "C31")

#: Hours between outlines.
EVERY = 5.0
#: Channel shown on both sides of the widest one, um.
MARGIN = 15.0


@style.styled
def draw(folder: Path | None = None) -> Figure:
    """One outline every EVERY hours, coloured by its time."""
    made = style.figure(2.75)
    outlines(made.subplots(), folder or runs.wide_run())
    return made


def outlines(axes: Axes, folder: Path) -> None:
    """The channel with the outlines of a run, the latest at the back, and a scale of their times."""
    shown = states.every(folder, EVERY)
    first, last = min(s.rim[:, 0].min() for s in shown), max(s.rim[:, 0].max() for s in shown)
    style.channel(axes, (first - MARGIN, last + MARGIN), shown[0].width, 2.5)
    style.fluid(axes, (first - MARGIN, last + MARGIN), shown[0].width)
    norm = BoundaryNorm(EVERY * (np.arange(len(shown) + 1) - 0.5), 256)
    colours = ScalarMappable(norm, matplotlib.colormaps["viridis_r"])
    for state in reversed(shown):
        style.aggregate(axes, state.rim, facecolor=colours.to_rgba(state.time), edgecolor="white", linewidth=0.9)
    axes.figure.colorbar(colours, ax=axes, location="bottom", label="time (h)", ticks=[s.time for s in shown],
                         aspect=50, shrink=0.8)


def upstream_share(folder: Path) -> float:
    """Share of the area covered anew between the last two outlines that lies upstream of the seed's centre."""
    old, new = (Polygon(state.rim) for state in states.every(folder, EVERY)[-2:])
    gained = new.difference(old)
    left, low, _, high = gained.bounds
    return gained.intersection(box(left, low, 0, high)).area / gained.area


def caption(folder: Path | None = None) -> str:
    """What is seen, when contact came, and how the run ended."""
    folder = folder or runs.wide_run()
    table, shown = states.series(folder), states.every(folder, EVERY)
    touching = table["time_h"][table["contact"] > 0]
    contact = (f"It touches the opposite wall from {touching[0]:g} h on" if len(touching) else
               "It does not reach the opposite wall")
    return (f"The aggregate of Wide every {EVERY:g} h from 0 to {shown[-1].time:g} h, between the walls of a pore "
            f"{shown[0].width:.0f} µm wide at a constant mean velocity of {table['mean_velocity_m_per_d'][0]:.1f} m/d, "
            f"from left to right. {contact} and spans x from {table['upstream_um'][-1]:.0f} to "
            f"{table['downstream_um'][-1]:.0f} µm at the end. Of the area covered between the last two outlines, "
            f"{100 * upstream_share(folder):.1f} % lies upstream of the first centre. The run ended at "
            f"{table['time_h'][-1]:g} h: {provenance(folder)['status']}.")
