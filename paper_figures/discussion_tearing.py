"""Where the aggregate would tear: the largest principal stress over time, its place, and the fluid. Not in the
paper."""

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
from verification.claims.runs import BASE, WIDE, Body, bodies, scene

TITLE = "Addition. Where the aggregate would tear"
RUNS = ()
CLAIMS = ("C40", "C46")
COMPUTED = CLAIMS

LEVEL = Level(CONVERGED, PAIRED[1])
NAMES, COLOURS = ("Base", "Wide"), (style.BLUE, style.RED)
COURSES = (BASE, WIDE)
#: Hours between the outlines, and the rows whose places are drawn.
EVERY = 5.0
PASCAL = 1e6  # in a MPa


@cached
def course(run: tuple[str, ...], forced: bool) -> np.ndarray:
    """(n, 4) largest principal stress (Pa), its place (um) and time (h) of every row but that of t = 0, with or without
    the fluid's forces, as far as shape and flow agree."""
    rows = []
    for found in bodies(run)[1:]:
        try:
            value, x, y, hours = tension(pressed(found) if forced else found)
        except GrowthError:
            break
        rows.append((PASCAL * value, x, y, hours))
    return np.array(rows)


@style.styled
def draw() -> Figure:
    """Size over time of both runs, and the places in Wide without and with the fluid's forces."""
    made = style.figure(5.6)
    panels = made.subplot_mosaic([["size"], ["without"], ["with"]], height_ratios=[1.2, 1, 1])
    with at_level(LEVEL):
        _sizes(panels["size"])
        norm = Normalize(0, bodies(COURSES[1])[-1].pore.time)
        colours = ScalarMappable(norm, matplotlib.colormaps["viridis_r"])
        for name, forced in (("without", False), ("with", True)):
            _places(panels[name], colours, forced)
    panels["without"].set(title="places in Wide, growth alone", xlabel="")
    panels["with"].set_title("places in Wide, with the fluid's forces")
    made.colorbar(colours, ax=[panels["without"], panels["with"]], label="time (h)", aspect=30)
    style.number_panels(*panels.values())
    return made


def _sizes(axes: Axes) -> None:
    for run, colour in zip(COURSES, COLOURS):
        for forced, look in ((False, "-"), (True, "--")):
            size, _, _, hours = course(run, forced).T
            axes.plot(hours, size, look, color=colour)
    handles = [Line2D([], [], color=colour, label=name) for name, colour in zip(NAMES, COLOURS)]
    handles += [Line2D([], [], color=style.BLACK, linestyle=look, label=label)
                for look, label in (("-", "growth alone"), ("--", "with the fluid's forces"))]
    axes.legend(handles=handles, loc="upper left")
    axes.set(title="largest principal stress", xlabel="time (h)", ylabel="Pa", yscale="log", xlim=(0, None))
    style.grid(axes)


def _places(axes: Axes, colours: ScalarMappable, forced: bool) -> None:
    """Outlines every EVERY hours, and where the stress is largest in every row."""
    shown = [found for found in bodies(COURSES[1]) if found.pore.time % EVERY == 0]
    reach = np.concatenate([found.outline.points[:, 0] for found in shown])
    ends, width = (reach.min() - figure_6.MARGIN, reach.max() + figure_6.MARGIN), shown[0].grid.width
    style.pore(axes, ends, width, 2.5)
    axes.set_anchor("W")
    for found in shown:
        style.aggregate(axes, _rim(found), filled=False, edgecolor=colours.to_rgba(found.pore.time), linewidth=0.7)
    _, x, y, hours = course(COURSES[1], forced).T
    axes.scatter(x, y, c=colours.to_rgba(hours), s=16, edgecolors="black", linewidths=0.4, zorder=5)


def _rim(found: Body) -> np.ndarray:
    return figure_6.smooth(found.outline.corners.points, found.grid.width)


def caption() -> str:
    """What is seen: size and place at the end of both runs, and how far the fluid's forces go."""
    with at_level(LEVEL):
        ends = [(bodies(run)[-1].pore.time, peak(bodies(run)[-1])) for run in COURSES]
        forced = course(COURSES[1], True)
        without = course(COURSES[1], False)[len(forced) - 1]
        modulus, last = PASCAL * scene(*COURSES[0]).growth.shear_modulus, bodies(COURSES[1])[-1].pore.time
    told = "; ".join(f"{name} {modulus * most.value:.3g} Pa at ({most.x:.0f}, {most.y:.0f}) µm and {hours:g} h"
                     for name, (hours, most) in zip(NAMES, ends))
    size, x, y, hours = forced[-1]
    until = ("" if hours == last else " Later the head that drives the constant velocity through the plug bends it so "
                                      "far that shape and flow do not agree.")
    return (f"(a) Largest principal stress of a triangle of the aggregate, of a modulus of {modulus:g} Pa. In the mean "
            f"over a tenth of the pore's width, on this mesh: {told}; C40 tells how far the place hangs on the mesh. "
            f"(b) Where it is in Wide, between outlines every {EVERY:g} h: in the middle first, then near the lower "
            f"wall. (c) The same aggregates at rest under the fluid's forces: {size:.3g} Pa instead of "
            f"{without[0]:.3g} Pa at {hours:g} h, at ({x:.0f}, {y:.0f}) µm instead of ({without[1]:.0f}, "
            f"{without[2]:.0f}) µm.{until}")
