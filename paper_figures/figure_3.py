"""Figure 3: the meshed part of the pore and the conditions on each boundary, drawn with the model's own geometry."""

from __future__ import annotations

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from paper_figures import runs, style
from paper_figures.figure_2 import THICKNESS, inflow
from repro import Scene
from repro.fem.outline import Outline, half_disc
from repro.fem.sizing import ACROSS_AGGREGATE, meshed_extent
from repro.fem.walls import BOTTOM

TITLE = "Figure 3. Conditions at the ends of the pore and of its meshed part"
RUNS = ()
CLAIMS = ("C07", "C08", "C19", "C20")

Ends = tuple[float, float]


@style.styled
def draw(scene: Scene | None = None) -> Figure:
    """The pore of a scene, Base by default, with its meshed part, and a close-up of that part."""
    scene = scene or runs.BASE.load()
    outline = half_disc(THICKNESS * scene.pore.width, 3 * ACROSS_AGGREGATE)
    ends = meshed_extent(outline, scene.pore.width, scene.pore.length)
    figure = style.figure(4.0)
    pore, part = figure.subplots(2, 1, height_ratios=[1, 2.6])
    _pore(pore, scene, outline, ends)
    _part(part, scene, outline, ends)
    style.number_panels(pore, part)
    return figure


def _pore(axes: Axes, scene: Scene, outline: Outline, ends: Ends) -> None:
    """The pore with the closed forms that apply outside the meshed part."""
    width, end = scene.pore.width, scene.pore.length / 2
    style.channel(axes, (-end, end), width, 4)
    style.aggregate(axes, outline.points, zorder=2)
    axes.add_patch(Rectangle((ends[0], 0), ends[1] - ends[0], width, facecolor=style.FLUID, edgecolor=style.BLUE,
                             linewidth=1.2, zorder=1))
    inflow(axes, (-end, end), width, 0.1 * end)
    upstream = r"$C_\mathrm{supply} - C \propto e^{\,u_\mathrm{ave} x / D}$  (26)"
    for x, text in (((ends[0] - end) / 2 + 0.04 * end, upstream), ((ends[1] + end) / 2, "$C$ constant  (12)")):
        axes.text(x, width / 2, text + "\nPoiseuille flow", ha="center", va="center")
    axes.set(title="the pore to scale; its meshed part in blue", yticks=[0, width])


def _part(axes: Axes, scene: Scene, outline: Outline, ends: Ends) -> None:
    """The meshed part with the conditions on its boundaries."""
    width = scene.pore.width
    style.pore(axes, ends, width, 2)
    style.aggregate(axes, outline.points)
    axes.plot(*outline.points[outline.wall == BOTTOM].T, color=style.RED, linewidth=2.4, clip_on=False)
    inflow(axes, ends, width, 0.12 * ends[1])
    axes.set(title="the meshed part and its conditions", ylim=(-0.24 * width, 1.24 * width), yticks=[0, width])
    for side, start in ((0, outline.upstream), (1, outline.downstream)):
        style.dimension(axes, (start, 0.12 * width), (ends[side], 0.12 * width), f"{abs(ends[side] - start):g} µm")
    _conditions(axes, ends, width, outline.thickness)


def _conditions(axes: Axes, ends: Ends, width: float, radius: float) -> None:
    """The text on each boundary."""
    inlet = "inlet: $u_x$ parabolic, $u_y = 0$\n$u_x C - D\\,\\partial C/\\partial x = u_x C_\\mathrm{supply}$  (11)"
    outlet = "outlet: $\\partial u/\\partial x = 0$, mean $\\varphi = 0$\n$\\partial C/\\partial x = 0$  (12)"
    axes.text(0.84 * ends[0], 0.83 * width, inlet, ha="left", va="center")
    axes.text(0.98 * ends[1], 0.83 * width, outlet, ha="right", va="center")
    axes.text(0, 1.1 * width, "walls: $u = 0$, $\\partial C/\\partial y = 0$  (13)", ha="center", va="bottom")
    axes.text(0, 0.55 * radius, "biomass:\n$J = \\theta$  (24)", ha="center", va="center")
    axes.text(0, -0.1 * width, "contact with the wall: permanent, frictionless sliding, fixed midpoint",
              ha="center", va="top", color=style.RED)
    axes.text(0, 0.66 * width, "interface: no forces on the biomass", ha="center", va="center", color=style.RIM)


def caption(scene: Scene | None = None) -> str:
    """Caption, with the extents that the model chooses."""
    scene = scene or runs.BASE.load()
    width, length = scene.pore.width, scene.pore.length
    grown, seed = (meshed_extent(half_disc(radius, ACROSS_AGGREGATE), width, length)
                   for radius in (THICKNESS * width, scene.aggregate.radius))
    return (f"Drawn by the code that the model uses. (a) Only the part of the {length:g} µm long pore around the "
            "aggregate is meshed. Outside it the flow is that between two plates; concentrations follow (26) upstream "
            "and are constant downstream. (b) The conditions on the boundaries of that part; inlet and outlet have "
            "those of the pore's ends. A new mesh extends ten times the aggregate's thickness or 1.5 pore widths from "
            f"it, whichever is less. Its length is {grown[1] - grown[0]:g} µm around this half-disc, which is "
            f"{THICKNESS * width:g} µm thick, and {seed[1] - seed[0]:g} µm around the seed.")
