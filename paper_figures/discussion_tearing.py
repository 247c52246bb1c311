"""Where the aggregate would tear: the largest principal stress over time, its location, and the effect of the fluid.
Not in the paper."""

from __future__ import annotations

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from paper_figures import figure_6, style
from repro.errors import GrowthError
from verification.claims.fluid_and_aggregate import peak, pressed, tension
from verification.claims.levels import CONVERGED, PAIRED, Level, at_level, cached
from verification.claims.runs import BASE, WIDE, Body, bodies, load_packaged

TITLE = "Addition. Where the aggregate would tear"
RUNS = ()
CLAIMS = ("C40", "C46")
COMPUTED = CLAIMS

LEVEL = Level(CONVERGED, PAIRED[1])
NAMES, COLOURS = ("Base", "Wide"), (style.BLUE, style.RED)
RUN_OVERRIDES = (BASE, WIDE)
#: Hours between the outlines.
EVERY = 5.0
PASCAL = 1e6  # Pa in one MPa


@cached
def stress_history(run: tuple[str, ...], forced: bool) -> np.ndarray:
    """Largest principal stress (Pa), its location (um) and the time (h) of every row after t = 0, (n, 4), with or
    without the fluid's forces. The history ends where shape and flow do not converge."""
    rows = []
    for body in bodies(run)[1:]:
        try:
            value, x, y, hours = tension(pressed(body) if forced else body)
        except GrowthError:
            break
        rows.append((PASCAL * value, x, y, hours))
    return np.array(rows)


@style.styled
def draw() -> Figure:
    """Stress over time in both runs, and its location in Wide without and with the fluid's forces."""
    figure = style.figure(5.6)
    panels = figure.subplot_mosaic([["size"], ["without"], ["with"]], height_ratios=[1.2, 1, 1])
    with at_level(LEVEL):
        _sizes(panels["size"])
        norm = Normalize(0, bodies(RUN_OVERRIDES[1])[-1].pore.time)
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
            size, _, _, hours = stress_history(run, forced).T
            axes.plot(hours, size, line, color=colour)
    handles = [Line2D([], [], color=colour, label=name) for name, colour in zip(NAMES, COLOURS)]
    handles += [Line2D([], [], color=style.BLACK, linestyle=line, label=label)
                for line, label in (("-", "growth only"), ("--", "with the fluid's forces"))]
    axes.legend(handles=handles, loc="upper left")
    axes.set(title="largest principal stress", xlabel="time (h)", ylabel="Pa", yscale="log", xlim=(0, None))
    style.grid(axes)


def _places(axes: Axes, colours: ScalarMappable, forced: bool) -> None:
    """Outlines every EVERY hours, and the location of the largest stress in every row."""
    outlined = [body for body in bodies(RUN_OVERRIDES[1]) if body.pore.time % EVERY == 0]
    reach = np.concatenate([body.outline.points[:, 0] for body in outlined])
    ends, width = (reach.min() - figure_6.MARGIN, reach.max() + figure_6.MARGIN), outlined[0].grid.width
    style.pore(axes, ends, width, 2.5)
    axes.set_anchor("W")
    for body in outlined:
        style.aggregate(axes, _rim(body), filled=False, edgecolor=colours.to_rgba(body.pore.time), linewidth=0.7)
    _, x, y, hours = stress_history(RUN_OVERRIDES[1], forced).T
    axes.scatter(x, y, c=colours.to_rgba(hours), s=16, edgecolors="black", linewidths=0.4, zorder=5)


def _rim(body: Body) -> np.ndarray:
    return figure_6.smooth(body.outline.corners.points, body.grid.width)


def caption() -> str:
    """Caption, with stress and location at the end of both runs, and the effect of the fluid's forces."""
    with at_level(LEVEL):
        ends = [(bodies(run)[-1].pore.time, peak(bodies(run)[-1])) for run in RUN_OVERRIDES]
        forced = stress_history(RUN_OVERRIDES[1], True)
        without = stress_history(RUN_OVERRIDES[1], False)[len(forced) - 1]
        modulus = PASCAL * load_packaged(*RUN_OVERRIDES[0]).growth.shear_modulus
        last = bodies(RUN_OVERRIDES[1])[-1].pore.time
    peaks = "; ".join(f"{name} {modulus * stress.value:.3g} Pa at ({stress.x:.0f}, {stress.y:.0f}) µm and {hours:g} h"
                     for name, (hours, stress) in zip(NAMES, ends))
    size, x, y, hours = forced[-1]
    note = ("" if hours == last else " Later the head that drives the constant velocity bends the plug so far that "
                                     "shape and flow do not converge.")
    return (f"(a) Largest principal stress of a triangle of the aggregate, whose modulus is {modulus:g} Pa. Means over "
            f"a tenth of the pore's width on this mesh: {peaks}; C40 reports how the location depends on the mesh. "
            f"(b) Its location in Wide, with outlines every {EVERY:g} h: first in the middle, then near the lower "
            f"wall. (c) The same aggregates in equilibrium with the fluid's forces: {size:.3g} Pa instead of "
            f"{without[0]:.3g} Pa at {hours:g} h, at ({x:.0f}, {y:.0f}) µm instead of ({without[1]:.0f}, "
            f"{without[2]:.0f}) µm.{note}")
