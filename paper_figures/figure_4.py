"""Figure 4: the first mesh of Base."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from paper_figures import runs, states, style

TITLE = "Figure 4. The mesh at the start of Base"
RUNS = (runs.INITIAL_MESH,)
CLAIMS = ("C07", "C19")


@style.styled
def draw(folder: Path) -> Figure:
    """Fluid and aggregate with every triangle."""
    state = states.first(folder)
    figure = style.figure(3.5)
    axes = figure.subplots()
    style.pore(axes, state.ends, state.width, 0.8)
    style.aggregate(axes, state.rim, linewidth=1.0, zorder=3, alpha=0.8)
    axes.triplot(state.triangulation, color=style.BLACK, linewidth=0.35, zorder=4)
    axes.set_title(f"{np.ptp(state.ends):.0f} µm long (printed: 110)")
    return figure


def caption(folder: Path) -> str:
    """Caption, with the numbers of the mesh."""
    state = states.first(folder)
    across = state.rim[:, 0].max() - state.rim[:, 0].min()
    return (f"The meshed part of the pore at t = 0: {np.ptp(state.ends):.0f} µm between the two walls, around a seed "
            f"of {across:.0f} µm (amber). The mesh has {len(state.points)} nodes and "
            f"{len(state.triangles)} triangles, {np.count_nonzero(state.biomass)} of them in the aggregate; one mesh "
            "serves flow, substrates and growth.")
