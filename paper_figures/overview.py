"""The pictures in README and replication note: Base near its end with the outlines of Wide, and three figures.

`python -m paper_figures.overview` writes them as PNG files into `paper_figures`, which are committed. `make figures`
does not change them.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.image import imsave

from paper_figures import discussion_biomass, figure_6, runs, states, style, time_series
from paper_figures.states import State

#: Figures of the note.
IN_NOTE = {"time_series": time_series, "discussion_biomass": discussion_biomass, "figure_6": figure_6}
FOLDER = Path(__file__).parent
PIXELS_WIDE, SHADES = 1600, 31
STREAMLINES = 10


@style.styled
def draw(base: Path, wide: Path) -> Figure:
    """Substrate and streamlines around the aggregate of Base, and the outlines of Wide, whose supply is assumed."""
    figure = style.figure(5.5)
    above, below = figure.subplots(2, 1, height_ratios=[1, 1.08])
    state, (shaped, _) = states.last(base, "before_expansion"), states.last_step(base)
    _substrate(above, state)
    above.set_title(f"Base: electron acceptor and streamlines around the aggregate shaped at {shaped:g} h")
    figure_6.outlines(below, wide)
    below.set_title(f"Wide: outlines every {figure_6.EVERY:g} h, with an assumed supply of 10 K$_s$")
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
    """Draw and write the pictures."""
    _write(draw(*runs.folders([runs.BASE, runs.WIDE_CONVERGED])), "overview")
    for name, module in IN_NOTE.items():
        _write(module.draw(*runs.folders(module.RUNS)), name)


def _write(figure: Figure, name: str) -> None:
    """Write a picture. Rounding of its colours halves the size of the file."""
    figure.set_dpi(PIXELS_WIDE / style.PAGE)
    style.lay_out(figure)
    figure.canvas.draw()
    shades = np.asarray(figure.canvas.buffer_rgba()) / 255
    imsave(FOLDER / f"{name}.png", np.round(shades * SHADES) / SHADES, metadata={"Software": None})


if __name__ == "__main__":
    main()
