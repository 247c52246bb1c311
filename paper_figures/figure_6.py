"""Figure 6: outlines of the aggregate of Wide."""

from __future__ import annotations

from pathlib import Path

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import BoundaryNorm
from matplotlib.figure import Figure
from scipy.interpolate import CubicSpline
from shapely import Polygon

from paper_figures import runs, states, style
from verification.claims.runs import upstream_part
from verification.store import provenance

TITLE = "Figure 6. Outlines of an aggregate that meets the opposite wall"
RUNS = (runs.WIDE_CONVERGED,)
CLAIMS = ("C12", "C25", "C29", "C31")

#: Hours between outlines.
EVERY = 5.0
#: Length of channel drawn on both sides of the widest outline, um.
MARGIN = 15.0
#: Points of the drawn line for each edge of the outline.
PER_EDGE = 8


@style.styled
def draw(folder: Path) -> Figure:
    """Outlines every EVERY hours, coloured by time."""
    figure = style.figure(2.75)
    outlines(figure.subplots(), folder)
    return figure


def outlines(axes: Axes, folder: Path, hours: float | None = None) -> None:
    """Draw the outlines of a run every ``hours`` hours (default EVERY) in its channel, the latest at the back, with a
    colour scale of their times."""
    hours = hours or EVERY
    states_drawn = states.every(folder, hours)
    first, last = min(s.rim[:, 0].min() for s in states_drawn), max(s.rim[:, 0].max() for s in states_drawn)
    style.pore(axes, (first - MARGIN, last + MARGIN), states_drawn[0].width, 2.5)
    norm = BoundaryNorm(hours * (np.arange(len(states_drawn) + 1) - 0.5), 256)
    colours = ScalarMappable(norm, matplotlib.colormaps["viridis_r"])
    for state in reversed(states_drawn):
        style.aggregate(axes, smooth(state.rim, state.width), facecolor=colours.to_rgba(state.time), edgecolor="white",
                        linewidth=0.9)
    high = 0.5 * states_drawn[0].width
    style.arrow(axes, (first - 0.95 * MARGIN, high), (first - 0.2 * MARGIN, high), 8, 1.4)
    axes.text(first - 0.9 * MARGIN, high + 4, "flow", color=style.BLUE, ha="left", va="bottom", fontsize=7)
    style.colour_bar(colours, axes, "time (h)", ticks=[s.time for s in states_drawn])


def smooth(rim: np.ndarray, width: float) -> np.ndarray:
    """Smooth a closed outline (M, 2). Between the outline's corners on the walls, a cubic spline (K, 2) joins the nodes
    of each stretch."""
    wall = np.where(rim[:, 1] <= 0, 1, np.where(rim[:, 1] >= width, 2, 0))
    start = int(np.flatnonzero((wall > 0) & (np.roll(wall, -1) == 0))[0])
    points, wall = (np.roll(values, -start, axis=0) for values in (rim, wall))
    points, wall = np.vstack([points, points[:1]]), np.append(wall, wall[0])
    corners = np.flatnonzero(wall > 0)
    pieces = [points[a:b] if b == a + 1 else _curve(points[a: b + 1]) for a, b in zip(corners, corners[1:])]
    return np.clip(np.vstack(pieces), [-np.inf, 0.0], [np.inf, width])


def _curve(points: np.ndarray) -> np.ndarray:
    """A spline through points (m, 2), parametrized by length, without the last point."""
    along = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1)))
    finer = np.interp(np.linspace(0, len(points) - 1, PER_EDGE * (len(points) - 1) + 1), np.arange(len(points)), along)
    return CubicSpline(along, points)(finer)[:-1]


def upstream_share(folder: Path) -> float:
    """Share of the area newly covered between the last two outlines that lies upstream of the seed's centre."""
    return upstream_part(*(Polygon(state.rim) for state in states.every(folder, EVERY)[-2:]))


def caption(folder: Path) -> str:
    """Caption, with the time of contact and the end of the run."""
    table, states_drawn = states.series(folder), states.every(folder, EVERY)
    hours, contact_time = table["time_h"], states.contact(folder)
    contact = (f"It touches the opposite wall between {hours[hours < contact_time][-1]:g} and {contact_time:g} h"
               if np.isfinite(contact_time) else "It does not reach the opposite wall")
    velocity = table["mean_velocity_m_per_d"][0]
    return (f"The aggregate of Wide every {EVERY:g} h from 0 to {states_drawn[-1].time:g} h, between the walls of a "
            f"pore {states_drawn[0].width:.0f} µm wide at a constant mean velocity of {velocity:.1f} m/d, from left to "
            f"right. {contact} and spans x from {table['upstream_um'][-1]:.0f} to "
            f"{table['downstream_um'][-1]:.0f} µm at the end. Of the area newly covered between the last two outlines, "
            f"{100 * upstream_share(folder):.1f} % lies upstream of the seed's centre. The figure shows the converged "
            f"solution by which the claims are judged (preset `accurate`), not the paper's scheme. Between the walls a "
            f"spline joins the outline's nodes. The run ended at {hours[-1]:g} h: {provenance(folder)['status']}.")
