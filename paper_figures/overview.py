"""The picture in the README: Base near its end and the outlines of Wide.

`python -m paper_figures.overview` writes `paper_figures/overview.png`, which is committed. `make figures` does not
change it.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.image import imsave

from paper_figures import figure_6, runs, states, style
from paper_figures.states import State

CLAIMS = ("C35", *figure_6.CLAIMS)
TARGET = Path(__file__).parent / "overview.png"
PIXELS_WIDE, SHADES = 1600, 31
STREAMLINES = 10


@style.styled
def draw(base: Path, wide: Path) -> Figure:
    """Substrate and streamlines around the aggregate of Base, and the outlines of Wide."""
    figure = style.figure(5.5)
    above, below = figure.subplots(2, 1, height_ratios=[1, 1.08])
    state, (shaped, _) = states.last(base, "before_expansion"), states.last_step(base)
    _substrate(above, state)
    above.set_title(f"Base: electron acceptor and streamlines around the aggregate shaped at {shaped:g} h")
    figure_6.outlines(below, wide)
    below.set_title(f"Wide: outlines every {figure_6.EVERY:g} h")
    return figure


def _substrate(axes: Axes, state: State) -> None:
    """C_A in colour, with streamlines at equal increments of the flow."""
    style.channel(axes, state.ends, state.width, 1.2)
    colours = axes.tricontourf(state.triangulation, state.nodes["acceptor_mg_per_L"], levels=20, cmap=style.MAP)
    axes.contour(*stream(state), levels=np.linspace(0, 1, STREAMLINES + 1)[1:-1], colors="white", linewidths=0.7)
    style.aggregate(axes, state.rim)
    style.colour_bar(colours, axes, "electron acceptor (mg/L)")


def stream(state: State) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """x (K,), y (L,) and the share (L, K) of the flow that passes below (x, y)."""
    x, y = np.linspace(*state.ends, 241), np.linspace(0, state.width, 121)
    places = np.column_stack([part.ravel() for part in np.meshgrid(x, y)])
    u = state.at("velocity_m_per_d", places)[:, 0].reshape(len(y), len(x))
    below = np.vstack([0 * x, np.cumsum(0.5 * (u[1:] + u[:-1]), axis=0)])
    return x, y, below / below[-1]


@style.styled
def main() -> None:
    """Draw and write the picture. Rounding of its colours halves the size of the file."""
    figure = draw(*runs.folders([runs.BASE, runs.WIDE_CONVERGED]))
    figure.set_dpi(PIXELS_WIDE / style.PAGE)
    style.lay_out(figure)
    figure.canvas.draw()
    shades = np.asarray(figure.canvas.buffer_rgba()) / 255
    imsave(TARGET, np.round(shades * SHADES) / SHADES, metadata={"Software": None})


if __name__ == "__main__":
    main()
