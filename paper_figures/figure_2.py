"""Figure 2: the pore, its domains and boundaries, drawn with the model's own geometry."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from paper_figures import runs, style
from repro import Scene
from repro.fem.outline import Outline, half_disc
from repro.fem.sizing import ACROSS_AGGREGATE
from repro.fem.walls import BOTTOM, TOP, channel_walls
from repro.model.closing_by_nodes import closing_nodes

TITLE = "Figure 2. The pore, its domains and boundaries"
RUNS = ()
CLAIMS = ("C29", "C31")

#: Thickness of the schematic aggregate over the pore's width. In runs it grows from that of the seed up to one.
THICKNESS = 0.6


@style.styled
def draw() -> Figure:
    """The pore to scale, a close-up of the aggregate, and the closing of a thin layer of fluid."""
    scene = runs.BASE.load()
    figure = style.figure(4.1)
    panels = figure.subplot_mosaic([["pore", "pore"], ["domains", "closing"]], height_ratios=[1, 2.4],
                                 width_ratios=[1.45, 1])
    outline = half_disc(THICKNESS * scene.pore.width, 3 * ACROSS_AGGREGATE)
    _pore(panels["pore"], scene, outline)
    _domains(panels["domains"], scene, outline)
    _closing(panels["closing"], scene)
    style.number_panels(*panels.values())
    return figure


def _pore(axes: Axes, scene: Scene, outline: Outline) -> None:
    """The pore to scale."""
    width, end = scene.pore.width, scene.pore.length / 2
    style.pore(axes, (-end, end), width, 4)
    style.aggregate(axes, outline.points)
    axes.set(title="the pore to scale", ylim=(-4, 2 * width), xlim=(-1.1 * end, 1.1 * end))
    axes.set_axis_off()
    for x, name, side in ((-end, r"$\Gamma_\mathrm{in}$", "right"), (end, r"$\Gamma_\mathrm{out}$", "left")):
        axes.plot([x, x], [0, width], color=style.BLUE, linewidth=1.6)
        axes.text(x + np.sign(x) * 5, width / 2, name, ha=side, va="center")
    inflow(axes, (-end, end), width, 0.1 * end)
    style.dimension(axes, (-end, 1.4 * width), (end, 1.4 * width), f"$L_\\mathrm{{pore}}$ = {2 * end:g} µm")
    style.dimension(axes, (0.5 * end, 0), (0.5 * end, width), f"$W_\\mathrm{{pore}}$ = {width:g} µm")


def inflow(axes: Axes, ends: tuple[float, float], width: float, length: float) -> None:
    """Arrows of the parabolic velocity at the inlet; the longest has `length` um."""
    for y in np.linspace(0, width, 7)[1:-1]:
        tip = ends[0] + 4 * length * y * (width - y) / width**2
        style.arrow(axes, (ends[0], y), (tip, y))


def _domains(axes: Axes, scene: Scene, outline: Outline) -> None:
    """Domains and boundaries around the aggregate, with its fixed point."""
    width, reach = scene.pore.width, 1.5 * outline.thickness
    style.pore(axes, (-reach, reach), width, 2)
    style.aggregate(axes, outline.points)
    axes.plot(*outline.points[outline.wall == BOTTOM].T, color=style.RED, linewidth=2.4, clip_on=False)
    axes.plot(*outline.points[outline.fixed].T, "o", color=style.BLACK, markersize=4, clip_on=False, zorder=5)
    axes.set_title("domains and boundaries")
    radius = outline.thickness
    style.dimension(axes, (0, 0.02 * radius), (0, radius), r"$R_\mathrm{aggregate}$")
    for x, y, text in ((-0.45, 0.42, r"$\Omega_B$"), (-1.1, 1.2, r"$\Omega_F$"), (1.05, 0.72, r"$\Gamma_{B-F}$"),
                       (1.2, 1.5, r"$\Gamma_w$"), (1.2, 0.1, r"$\Gamma_w$"), (0.55, 0.12, r"$\Gamma_{B-w}$"),
                       (-0.35, 0.12, "fixed point")):
        axes.text(x * radius, y * radius, text, ha="center", va="center")


def _closing(axes: Axes, scene: Scene) -> None:
    """An aggregate at the opposite wall: the nodes that `closing_nodes` joins to it, and the least allowed gap."""
    width = scene.pore.width
    film, angle = scene.growth.minimum_film, scene.growth.minimum_contact_angle
    outline = flattened(width)
    joins = closing_nodes(outline, channel_walls(width), film, angle) == TOP
    line = outline.points[outline.wall == TOP, 0].max()
    steps = np.array([0, film / np.tan(angle), 3 * film / np.tan(angle)])
    low, high = (line - 3, line + 17), (width - 9.5, width + 2.5)
    style.plane(axes, low, high)
    axes.axhspan(width, high[1], color=style.WALL, linewidth=0)
    style.fluid(axes, low, width)
    style.aggregate(axes, outline.points)
    axes.plot(line + steps, width - np.minimum(film, np.tan(angle) * steps), "--", color=style.BLUE)
    right = joins & (outline.points[:, 0] > 0)
    axes.plot(*outline.points[right].T, "o", color=style.RED, markersize=3.5)
    axes.plot(line, width, "|", color=style.BLUE, markersize=11, markeredgewidth=1.8)
    axes.set_title("contact with the other wall")
    axes.text(line, width + 1.2, "contact line", color="white", ha="left", va="center")
    axes.text(line - 2.5, width - 3, "these nodes join the wall", color=style.RED, va="center")
    axes.text(line - 2.5, width - 6.5, f"least gap: {film:g} µm,\n{np.degrees(angle):.1f}° at the contact", va="center",
              color=style.BLUE)


def flattened(width: float) -> Outline:
    """A half-disc slightly thicker than the pore's width, truncated by the opposite wall."""
    disc = half_disc(1.02 * width, 4 * ACROSS_AGGREGATE)
    beyond = disc.points[:, 1] >= width
    points = np.column_stack([disc.points[:, 0], np.minimum(disc.points[:, 1], width)])
    return Outline(points, np.where(beyond, TOP, disc.wall), disc.fixed, points)


def caption() -> str:
    """Caption, with the model's dimensions."""
    scene = runs.BASE.load()
    film, angle = scene.growth.minimum_film, np.degrees(scene.growth.minimum_contact_angle)
    return (f"Drawn by the code that the model uses. (a) A pore {scene.pore.length:g} µm long and "
            f"{scene.pore.width:g} µm wide (Base) with an aggregate on its lower wall; water enters on the left with "
            "a parabolic velocity. (b) Fluid Ω_F and biomass Ω_B, their interface Γ_B-F, the walls Γ_w, and the "
            "contact surface Γ_B-w (red), on which the aggregate slides; its midpoint (black dot), the origin, is "
            f"fixed. The half-disc is {THICKNESS * scene.pore.width:g} µm thick, the seed of the runs "
            f"{scene.aggregate.radius:g} µm. (c) At the opposite wall, fluid thinner than {film:g} µm, or than a "
            f"wedge of {angle:.1f}° beside the contact line (dashed), closes. The nodes in red join the wall next.")
