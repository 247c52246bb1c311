"""Figure 5: the velocity field of Base at its end, before the last expansion."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from paper_figures import runs, states, style
from paper_figures.states import State
from repro.fem.transfer import located

TITLE = "Figure 5. Stokes flow around the aggregate"
RUNS = (runs.BASE,)
CLAIMS = ("C01", "C02", "C35")

#: Distance between arrows, um.
SPACING = 5.0


@style.styled
def draw(folder: Path) -> Figure:
    """Speed in colour, velocity as arrows."""
    state = states.last(folder, "before_expansion")
    figure = style.figure(2.65)
    axes = figure.subplots()
    style.channel(axes, state.ends, state.width, 1.2)
    speed = np.linalg.norm(state.nodes["velocity_m_per_d"], axis=1)
    colours = axes.tricontourf(state.triangulation, speed, levels=np.linspace(0, speed.max(), 21), cmap="Blues",
                               vmax=1.5 * speed.max())
    style.aggregate(axes, state.rim, alpha=0.8)
    points = _grid(state)
    axes.quiver(*points.T, *state.at("velocity_m_per_d", points).T, color=style.BLACK, angles="xy", scale_units="xy",
                scale=speed.max() / (1.25 * SPACING), width=0.0013, headwidth=4, headlength=5)
    style.colour_bar(colours, axes, "speed (m/d)", ticks=np.arange(0, speed.max(), 0.5))
    return figure


def _grid(state: State) -> np.ndarray:
    """Positions of the arrows (K, 2), symmetric about x = 0 and away from walls and ends."""
    reach = SPACING * np.floor(min(-state.ends[0], state.ends[1]) / SPACING - 0.5)
    x = np.arange(-reach, reach + SPACING / 2, SPACING)
    y = np.arange(SPACING / 2, state.width, SPACING)
    return np.column_stack([part.ravel() for part in np.meshgrid(x, y)])


def share_through(state: State) -> float:
    """Share of the flow at x = 0 that passes through the aggregate."""
    y = (np.arange(2000) + 0.5) * state.width / 2000
    points = np.column_stack([0 * y, y])
    inside = state.biomass[located(state.points, state.triangles, points).triangle]
    u = state.at("velocity_m_per_d", points)[:, 0]
    return float(u[inside].sum() / u.sum())


def caption(folder: Path) -> str:
    """Caption, with the velocities of the run."""
    shaped, end = states.last_step(folder)
    initial, velocity, final = (states.row(folder, t)["mean_velocity_m_per_d"] for t in (0.0, shaped, end))
    through = share_through(states.last(folder, "before_expansion"))
    return (f"Velocity in Base at t = {end:g} h before the aggregate expands, in the shape of {shaped:g} h: speed in "
            f"colour, arrows in proportion to the velocity, the aggregate in amber. The "
            f"water in the aggregate is 2000 times more viscous and {100 * through:.2g} % of the flow crosses it at "
            f"x = 0. Under a constant head the mean velocity has fallen from {initial:.2f} m/d to {velocity:.2f} m/d "
            f"in this shape, and falls to {final:.2f} m/d in the next one.")
