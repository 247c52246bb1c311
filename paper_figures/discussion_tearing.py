"""Where the aggregate would tear: the largest principal stress over time, its location, and the effect of the fluid.
Not in the paper.

The stress is a mean over a tenth of the pore's width, since a largest value in a point does not exist (C40, C46). A
location is drawn if two sizes of elements agree on it within a tenth of the width, and of the aggregate's length."""

from __future__ import annotations

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from paper_figures import figure_6, style
from verification.claims.adhesion import FORCED
from verification.claims.fluid_and_aggregate import AVERAGED_OVER, peak
from verification.claims.levels import CONVERGED, PAIRED, Level, at_level, cached
from verification.claims.runs import BASE, WIDE, Body, Run, bodies, load_packaged

TITLE = "Addition. Where the aggregate would tear"
RUNS = ()
CLAIMS = ("C40", "C46")
COMPUTED = CLAIMS

#: The drawn solution, and the one with which locations are compared.
LEVEL, COARSER = Level(CONVERGED, PAIRED[1]), Level(CONVERGED, PAIRED[2])
NAMES, COLOURS = ("Base", "Wide"), (style.BLUE, style.RED)
RUN_OVERRIDES = (BASE, WIDE)
#: Hours between the outlines.
EVERY = 5.0
PASCAL = 1e6  # Pa in one MPa


def with_forces(run: Run, forced: bool) -> Run:
    """A run, or the same with the fluid's forces on the aggregate from the seed on."""
    return (*run, FORCED) if forced else run


@cached
def stress_history(run: Run) -> np.ndarray:
    """Largest principal stress (Pa), its location (um), the time (h) and the length (um) of the aggregate in every
    second row of a run after t = 0, up to its end, (n, 5)."""
    rows = []
    for body in bodies(run)[:0:-2][::-1]:
        largest = peak(body)
        modulus = PASCAL * body.scene.growth.shear_modulus
        rows.append((modulus * largest.value, largest.x, largest.y, body.pore.time,
                     body.outline.downstream - body.outline.upstream))
    return np.array(rows)


def agreed(run: Run) -> np.ndarray:
    """The rows of a stress history whose locations agree with those on larger elements, (m, 5)."""
    rows = stress_history(run)
    with at_level(COARSER):
        apart = np.hypot(*(rows[:, 1:3] - stress_history(run)[:, 1:3]).T)
    return rows[apart <= AVERAGED_OVER * np.minimum(load_packaged(*run).pore.width, rows[:, 4])]


@style.styled
def draw() -> Figure:
    """Stress over time in both runs, and its location in Wide without and with the fluid's forces."""
    figure = style.figure(5.6)
    panels = figure.subplot_mosaic([["size"], ["without"], ["with"]], height_ratios=[1.2, 1, 1])
    with at_level(LEVEL):
        _sizes(panels["size"])
        norm = Normalize(0, bodies(WIDE)[-1].pore.time)
        colours = ScalarMappable(norm, matplotlib.colormaps["viridis_r"])
        for name, forced in (("without", False), ("with", True)):
            _places(panels[name], colours, forced)
    panels["without"].set(title="locations in Wide, growth only", xlabel="")
    panels["with"].set_title("locations in Wide, with the fluid's forces")
    figure.colorbar(colours, ax=[panels["without"], panels["with"]], label="time (h)", aspect=30)
    style.number_panels(*panels.values())
    return figure


def _sizes(axes: Axes) -> None:
    for run, colour in zip(RUN_OVERRIDES, COLOURS):
        for forced, line in ((False, "-"), (True, "--")):
            size, _, _, hours, _ = stress_history(with_forces(run, forced)).T
            axes.plot(hours, size, line, color=colour)
    handles = [Line2D([], [], color=colour, label=name) for name, colour in zip(NAMES, COLOURS)]
    handles += [Line2D([], [], color=style.BLACK, linestyle=line, label=label)
                for line, label in (("-", "growth only"), ("--", "with the fluid's forces"))]
    axes.legend(handles=handles, loc="lower right")
    axes.set(title="largest principal stress, mean over a tenth of the width", xlabel="time (h)", ylabel="Pa",
             yscale="log", xlim=(0, None))
    style.grid(axes)


def _places(axes: Axes, colours: ScalarMappable, forced: bool) -> None:
    """Outlines of a run every EVERY hours, and the locations of its largest stress that converge."""
    run = with_forces(WIDE, forced)
    outlined = [body for body in bodies(run) if body.pore.time % EVERY == 0]
    reach = np.concatenate([body.outline.points[:, 0] for body in outlined])
    ends, width = (reach.min() - figure_6.MARGIN, reach.max() + figure_6.MARGIN), outlined[0].grid.width
    style.pore(axes, ends, width, 2.5)
    axes.set_anchor("W")
    for body in outlined:
        style.aggregate(axes, _rim(body), filled=False, edgecolor=colours.to_rgba(body.pore.time), linewidth=0.7)
    _, x, y, hours, _ = agreed(run).T
    axes.scatter(x, y, c=colours.to_rgba(hours), s=16, edgecolors="black", linewidths=0.4, zorder=5)


def _rim(body: Body) -> np.ndarray:
    return figure_6.smooth(body.outline.corners.points, body.grid.width)


def caption() -> str:
    """Caption, with stresses at the end of both runs, how many locations converge, and the effect of the fluid."""
    with at_level(LEVEL):
        forced, without = (stress_history(with_forces(WIDE, kind)) for kind in (True, False))
        drawn = [f"{len(agreed(with_forces(WIDE, kind)))} of {len(rows)}"
                 for kind, rows in ((False, without), (True, forced))]
        ends = [(*stress_history(run)[-1, [0, 3]], name) for name, run in zip(NAMES, RUN_OVERRIDES)]
    peaks = "; ".join(f"{name} {value:.3g} Pa at {hours:g} h" for value, hours, name in ends)
    size, _, _, hours, _ = forced[-1]
    return (f"(a) Largest principal stress in the mean over a tenth of the pore's width: {peaks}. (b) Its location in "
            f"Wide ({figure_6.ASSUMED}), with outlines every {EVERY:g} h. Only locations that converge are shown: "
            "those that agree within this distance, and a tenth of the length of the aggregate, on elements "
            f"{PAIRED[1]:.3g} and {PAIRED[2]:.3g} times as large as those of the preset `accurate`, {drawn[0]} rows. "
            f"(c) The same in a run with the fluid's forces from the seed on, with its own outlines, {drawn[1]} rows: "
            f"{size:.3g} Pa instead of {without[-1, 0]:.3g} Pa at {hours:g} h.")
