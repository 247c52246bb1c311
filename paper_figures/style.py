"""Style of the figures: sizes of a printed page, one font, colours for colour-blind readers, units."""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from pathlib import Path

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.cm import ScalarMappable
from matplotlib.figure import Figure
from matplotlib.patches import Polygon, Rectangle

#: Width of the journal's page, in.
PAGE = 6.9
RESOLUTION = 250
LAYOUT_PASSES = 2

#: Okabe and Ito's colours, with a red in place of their vermilion, named by their use.
BLUE, RED = "#0072B2", "#C1272D"
SKY, BLACK = "#56B4E9", "#000000"
FLUID, WALL = "#E6F1F9", "#555555"
BIOMASS, RIM = "#F3D08B", "#7A4A00"
FAINT = "#9A9A9A"
MAP = "viridis"

X_LABEL, Y_LABEL = "x (µm)", "y (µm)"

RULES = {
    "font.family": "DejaVu Sans", "font.size": 8, "axes.titlesize": 8, "axes.labelsize": 8, "legend.fontsize": 7.5,
    "xtick.labelsize": 7.5, "ytick.labelsize": 7.5, "axes.linewidth": 0.6, "lines.linewidth": 1.3,
    "xtick.major.width": 0.6, "ytick.major.width": 0.6, "axes.titlelocation": "left", "legend.frameon": False,
    "mathtext.fontset": "dejavusans", "pdf.fonttype": 42, "savefig.dpi": RESOLUTION, "figure.dpi": 100,
}


def styled(draw: Callable) -> Callable:
    """Decorator: apply RULES within the function only."""
    @wraps(draw)
    def within(*arguments, **keywords):
        with matplotlib.rc_context(RULES):
            return draw(*arguments, **keywords)
    return within


def figure(height: float, width: float = PAGE) -> Figure:
    """An empty figure (in) whose parts do not overlap."""
    figure = Figure(figsize=(width, height), layout="constrained")
    FigureCanvasAgg(figure)
    return figure


def lay_out(figure: Figure) -> None:
    """Fix the positions of the parts. Axes with equal scales leave free space, which requires a second pass."""
    for _ in range(LAYOUT_PASSES):
        figure.get_layout_engine().execute(figure)
    figure.set_layout_engine("none")


@styled
def save(figure: Figure, folder: Path, name: str) -> None:
    """Write `name`.pdf and `name`.png with one layout; repeated calls write the same bytes."""
    folder.mkdir(parents=True, exist_ok=True)
    lay_out(figure)
    figure.savefig(folder / f"{name}.pdf", metadata={"CreationDate": None})
    figure.savefig(folder / f"{name}.png", metadata={"Software": None})


def plane(axes: Axes, x: tuple[float, float], y: tuple[float, float]) -> None:
    """Equal axes in um."""
    axes.set(xlim=x, ylim=y, aspect="equal", xlabel=X_LABEL, ylabel=Y_LABEL)


def channel(axes: Axes, ends: tuple[float, float], width: float, margin: float) -> None:
    """The plane of a channel with its two walls, drawn `margin` um thick."""
    plane(axes, ends, (-margin, width + margin))
    for low in (-margin, width):
        axes.add_patch(Rectangle((ends[0], low), ends[1] - ends[0], margin, facecolor=WALL, linewidth=0))


def pore(axes: Axes, ends: tuple[float, float], width: float, margin: float) -> None:
    """A channel filled with fluid."""
    channel(axes, ends, width, margin)
    fluid(axes, ends, width)


def fluid(axes: Axes, ends: tuple[float, float], width: float) -> None:
    """Fluid from wall to wall."""
    axes.add_patch(Rectangle((ends[0], 0), ends[1] - ends[0], width, facecolor=FLUID, linewidth=0, zorder=0))


def aggregate(axes: Axes, points: np.ndarray, filled: bool = True, **style) -> None:
    """The outline of an aggregate (M, 2), optionally filled."""
    chosen = {"edgecolor": RIM, "linewidth": 1.2, "facecolor": BIOMASS if filled else "none", **style}
    axes.add_patch(Polygon(points, closed=True, **chosen))


def grid(axes: Axes) -> None:
    """Faint lines behind curves."""
    axes.grid(alpha=0.25, linewidth=0.4)


def colour_bar(colours: ScalarMappable, axes: Axes, label: str, **options) -> None:
    """A colour bar below the axes."""
    axes.figure.colorbar(colours, ax=axes, location="bottom", label=label, aspect=50, shrink=0.8, **options)


def arrow(axes: Axes, start: tuple[float, float], end: tuple[float, float], head: float = 5, width: float = 0.7,
          look: str = "-|>", color: str = BLUE) -> None:
    """A straight arrow between two points."""
    axes.annotate("", end, start, arrowprops={"arrowstyle": look, "color": color, "shrinkA": 0, "shrinkB": 0,
                                              "mutation_scale": head, "linewidth": width})


def number_panels(*panels: Axes) -> None:
    """(a), (b), ... before the titles."""
    for letter, axes in zip("abcdefgh", panels):
        axes.set_title(f"({letter}) {axes.get_title(loc='left')}".rstrip(), loc="left")


def dimension(axes: Axes, start: tuple[float, float], end: tuple[float, float], text: str) -> None:
    """A double arrow with its length: above a horizontal arrow, to the right of a vertical one."""
    arrow(axes, start, end, 6, look="<|-|>", color=BLACK)
    upright = start[0] == end[0]
    middle = (0.5 * (start[0] + end[0]), 0.5 * (start[1] + end[1]))
    axes.annotate(text, middle, (3, 0) if upright else (0, 2), textcoords="offset points",
                  ha="left" if upright else "center", va="center" if upright else "bottom")
