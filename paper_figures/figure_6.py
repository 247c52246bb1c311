"""Figure 6: outlines of the aggregate of Wide, with three supplies, since the paper prints none."""

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
from paper_figures.states import State
from verification.claims.runs import upstream_part
from verification.store import provenance

TITLE = "Figure 6. Outlines of an aggregate that meets the opposite wall"
RUNS = (runs.SUPPLIED[5], runs.WIDE_CONVERGED, runs.SUPPLIED[40])
#: Supplies of the runs, K_s of both substrates. The paper prints none.
SUPPLIES = (5, 10, 40)
#: For captions of figures with Wide.
ASSUMED = "the paper prints no supply for it, and 10 K_s of both substrates is assumed"
CLAIMS = ("C12", "C25", "C29", "C31")

#: Hours between outlines.
EVERY = 5.0
#: Length of channel drawn on both sides of the widest outline, and in the last panel of Figure 6, um.
MARGIN, LAST_MARGIN = 15.0, 50.0
#: Points of the drawn line for each edge of the outline.
PER_EDGE = 8


@style.styled
def draw(*folders: Path) -> Figure:
    """Outlines every EVERY hours with each supply, coloured by time."""
    figure = style.figure(4.9)
    panels = figure.subplots(len(folders), 1, height_ratios=[1, 1, 0.45])
    every = [states.every(folder, EVERY) for folder in folders]
    colours = scale(max(drawn[-1].time for drawn in every), EVERY)
    reach = span(sum(every[:-1], []), MARGIN)
    for axes, drawn, supply, margin in zip(panels, every, SUPPLIES, (MARGIN, MARGIN, LAST_MARGIN)):
        fill(axes, drawn, colours, reach if margin == MARGIN else span(drawn, margin), margin)
        axes.set_title(f"supply of {supply} K$_s$" + (", assumed for all other figures" if supply == 10 else ""))
    for axes in panels[:-1]:
        axes.set_xlabel("")
    style.number_panels(*panels)
    figure.colorbar(colours, ax=list(panels), location="right", label="time (h)", aspect=40,
                    ticks=EVERY * np.arange(1 + round(colours.norm.vmax / EVERY - 0.5)))
    return figure


def outlines(axes: Axes, folder: Path, hours: float | None = None) -> None:
    """Draw the outlines of a run every ``hours`` hours (default EVERY) with a colour scale of their times."""
    hours = hours or EVERY
    drawn = states.every(folder, hours)
    colours = scale(drawn[-1].time, hours)
    fill(axes, drawn, colours, span(drawn))
    style.colour_bar(colours, axes, "time (h)", ticks=[s.time for s in drawn])


def scale(last: float, hours: float) -> ScalarMappable:
    """The colour of each multiple of ``hours`` up to the last time."""
    norm = BoundaryNorm(hours * (np.arange(round(last / hours) + 2) - 0.5), 256)
    return ScalarMappable(norm, matplotlib.colormaps["viridis_r"])


def span(drawn: list[State], margin: float = MARGIN) -> tuple[float, float]:
    """x (um) from the first to the last outline, with a margin on both sides."""
    return min(s.rim[:, 0].min() for s in drawn) - margin, max(s.rim[:, 0].max() for s in drawn) + margin


def fill(axes: Axes, drawn: list[State], colours: ScalarMappable, reach: tuple[float, float],
         margin: float = MARGIN) -> None:
    """Draw outlines in their channel over a range of x with a margin, the latest at the back."""
    style.pore(axes, reach, drawn[0].width, margin / 6)
    for state in reversed(drawn):
        style.aggregate(axes, smooth(state.rim, state.width), facecolor=colours.to_rgba(state.time), edgecolor="white",
                        linewidth=0.9)
    first, high = reach[0] + margin, 0.5 * drawn[0].width
    style.arrow(axes, (first - 0.95 * margin, high), (first - 0.2 * margin, high), 8, 1.4)
    axes.text(first - 0.9 * margin, high + 0.27 * margin, "flow", color=style.BLUE, ha="left", va="bottom", fontsize=7)


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


def caption(*folders: Path) -> str:
    """Caption, with the times of contact and the ends of the runs."""
    drawn = states.every(folders[0], EVERY)
    velocity = states.series(folders[0])["mean_velocity_m_per_d"][0]
    results = "; ".join(f"({letter}) {supply} K_s: {_course(folder)}"
                        for letter, supply, folder in zip("abc", SUPPLIES, folders))
    usual, longer = (request.load().pore.length for request in (RUNS[0], RUNS[-1]))
    return (f"The aggregate of Wide every {EVERY:g} h, between the walls of a pore {drawn[0].width:.0f} µm wide at a "
            f"constant mean velocity of {velocity:.1f} m/d, from left to right. The paper prints no supply for its "
            "Figure 6, and no times or places of tips from which to infer one: 10 K_s of both substrates is assumed "
            f"elsewhere. {results}. In (c) the pore is {longer:.0f} µm long instead of {usual:.0f}, which this "
            "aggregate outgrows, and the scale is smaller. (b) shows the converged solution by which the claims are "
            "judged (preset `accurate`), the others the preset `fast`, none of them the paper's scheme. Between the "
            f"walls a spline joins the nodes of the outline. {_endings(folders)}")


def _course(folder: Path) -> str:
    """Contact, tips at the end, and the share of the last growth that is upstream."""
    table = states.series(folder)
    hours, contact_time = table["time_h"], states.contact(folder)
    contact = (f"contact between {hours[hours < contact_time][-1]:g} and {contact_time:g} h"
               if np.isfinite(contact_time) else "no contact")
    return (f"{contact}, from {table['upstream_um'][-1]:.0f} to {table['downstream_um'][-1]:.0f} µm at {hours[-1]:g} "
            f"h; {100 * upstream_share(folder):.1f} % of the area newly covered between the last two outlines lies "
            "upstream of the seed's centre")


def _endings(folders: tuple[Path, ...]) -> str:
    """How the runs ended."""
    endings = dict.fromkeys(provenance(folder)["status"] for folder in folders)
    return f"The runs ended: {', '.join(endings)}."
