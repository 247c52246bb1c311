"""Where the biomass sits: conductivity against the biomass of one to eight aggregates. Not in the paper."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Wedge

from paper_figures import states, style
from paper_figures.runs import FAST, Request
from repro.runs.status import COMPLETED
from verification.problems.arrangements import ARRANGEMENTS, COMPARED, seeds
from verification.problems.hard import clean_conductivity

TITLE = "Addition. Where the biomass sits"
CLAIMS = ()

#: Radius (um) of a single seed; n seeds have the same total area. Width and length of Base, um.
RADIUS, WIDTH, LENGTH = 10.0, 50.0, 600.0
#: Both drives: the section [flow], and the last hour.
DRIVES = {"head": ('{head="1e-3 cm"}', 60), "velocity": ('{mean_velocity="2.9 m/day"}', 30)}
COLOURS = (style.BLACK, style.RED, style.BLUE, style.RIM, style.SKY)
#: Losses of permeability at nearly equal amounts of biomass in micromodels (Jiao et al. 2025).
PUBLISHED = (0.78, 0.94)


def _request(name: str, drive: str) -> Request:
    flow, end = DRIVES[drive]
    label = f"{name.replace(' ', '_')}_{drive}"
    return Request("base", (FAST, seeds(ARRANGEMENTS[name], RADIUS), f"flow={flow}", f'growth.end="{end} h"',
                            'output.every="1 h"'), label)


KEYS = [(name, drive) for name in ARRANGEMENTS for drive in DRIVES]
RUNS = tuple(_request(*key) for key in KEYS)


@style.styled
def draw(*folders: Path) -> Figure:
    """The arrangements, their conductivities against the biomass, and their losses at one amount."""
    figure = style.figure(4.6)
    panels = figure.subplot_mosaic([["seeds", "seeds"], ["curves", "losses"]], height_ratios=[1, 1.6],
                                   width_ratios=[1.5, 1])
    _seeds(panels["seeds"])
    _curves(panels["curves"], folders)
    _losses(panels["losses"], folders)
    style.number_panels(*panels.values())
    return figure


def _seeds(axes: Axes) -> None:
    """The pores with their seeds, one above the other."""
    for row, (places, colour) in enumerate(zip(ARRANGEMENTS.values(), COLOURS)):
        low = -row * 1.5 * WIDTH
        axes.axhspan(low, low + WIDTH, color=style.FLUID, zorder=0)
        for level in (low, low + WIDTH):
            axes.axhline(level, color=style.WALL, linewidth=0.8)
        radius = RADIUS / math.sqrt(len(places))
        for x, wall in places:
            start, centre = (0, low) if wall == "lower" else (180, low + WIDTH)
            axes.add_patch(Wedge((x, centre), radius, start, start + 180, facecolor=colour, zorder=2))
    axes.set(xlim=(-LENGTH / 2, LENGTH / 2), aspect="equal", xlabel=style.X_LABEL,
             yticks=[(0.5 - 1.5 * row) * WIDTH for row in range(len(ARRANGEMENTS))], yticklabels=list(ARRANGEMENTS),
             title="seeds of the same total area")
    axes.tick_params(axis="y", length=0)
    for label, colour in zip(axes.get_yticklabels(), COLOURS):
        label.set_color(colour)


def _curves(axes: Axes, folders: tuple[Path, ...]) -> None:
    """Conductivity over that of the clean pore, against the biomass; dashed at constant velocity."""
    for (name, drive), folder in zip(KEYS, folders):
        area, lost = _course(folder)
        colour = COLOURS[list(ARRANGEMENTS).index(name)]
        if drive == "head":
            axes.plot(area, 1 - lost, color=colour)
        else:
            axes.plot(area, 1 - lost, "--", color=colour)
    axes.axvline(COMPARED, color=style.FAINT, linewidth=0.8, linestyle=":")
    axes.set(yscale="log", xlim=(0, 2.0), ylim=(5e-3, 1.1), xlabel=r"area of all aggregates, $A / W^2$",
             ylabel=r"conductivity, $K / K_0$", title="full: constant head; dashed: constant velocity")
    style.grid(axes)


def _losses(axes: Axes, folders: tuple[Path, ...]) -> None:
    """Losses at the compared amount under the head, and the published range."""
    losses = list(compared(folders)["head"].values())
    axes.barh(range(len(losses)), losses, color=COLOURS)
    axes.axvspan(*PUBLISHED, color=style.FAINT, alpha=0.3, linewidth=0, label="Jiao et al. 2025")
    axes.set(yticks=range(len(losses)), yticklabels=list(ARRANGEMENTS), xlim=(0, 1),
             xlabel=r"loss of conductivity, $1 - K / K_0$", title=f"at $A = {COMPARED:g}\\,W^2$")
    axes.invert_yaxis()
    axes.legend(loc="lower right")


def _course(folder: Path) -> tuple[np.ndarray, np.ndarray]:
    """Total area over W^2, and the loss of conductivity, of all rows."""
    table = states.series(folder)
    clean = clean_conductivity(RUNS[0].load())
    return table["aggregate_area_um2"] / WIDTH**2, 1 - table["conductivity_m_per_d"] / clean


def compared(folders: tuple[Path, ...]) -> dict[str, dict[str, float]]:
    """Loss of conductivity at the compared amount, by drive and arrangement; NaN if a run ends before."""
    losses: dict[str, dict[str, float]] = {drive: {} for drive in DRIVES}
    for (name, drive), folder in zip(KEYS, folders):
        area, lost = _course(folder)
        losses[drive][name] = float(np.interp(COMPARED, area, lost, right=np.nan))
    return losses


def caption(*folders: Path) -> str:
    """Caption, with the losses at the compared amount."""
    losses = compared(folders)
    head = losses["head"]
    least, most = min(head, key=head.__getitem__), max(head, key=head.__getitem__)
    apart = max(abs(losses["velocity"][name] - head[name]) for name in head)
    ended = [f"{name} (constant {drive})" for (name, drive), folder in zip(KEYS, folders)
             if states.status(folder) != COMPLETED]
    early = f" These runs end before the last hour: {', '.join(ended)}." if ended else ""
    stated = ", ".join(f"{name} {100 * loss:.0f} %" for name, loss in head.items())
    factor = (1 - head[least]) / (1 - head[most])
    published = " to ".join(f"{100 * loss:.0f}" for loss in PUBLISHED)
    return ("The pore of Base with one to eight seeds of the same total area (preset `fast`). (a) The seeds. (b) "
            "Conductivity over that of the clean pore, against the area of all aggregates. Where two of them meet, "
            f"they join, and the curve goes on (growth.meeting = \"weld\").{early} "
            f"(c) At an area of {COMPARED:g} W² the loss is: {stated}. So the same biomass leaves "
            f"{factor:.1f} times as much conductivity as {least} than as {most}. The drive changes a loss by "
            f"{100 * apart:.1f} percentage points at most. In micromodels Jiao et al. (2025) measured losses of "
            f"{published} % at nearly equal amounts of biomass, depending on where it sat: the band.")
