"""Wide with a permeable body in place of the pseudoviscosity: conductivity, and the flow through film and body. Not in
the paper."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from paper_figures import runs, states, style
from paper_figures.states import State

TITLE = "Addition. A permeable body instead of a pseudoviscosity"
RUNS = (runs.WIDE_FAST, *runs.PERMEABLE)
CLAIMS = ("C42", "C17")

COLOURS = (style.BLACK, style.RED, style.BLUE)
LOOKS = ("-", "-", "--")
#: When (h) the velocity over the aggregate's top is drawn: with a film left, and with a plug.
MOMENTS = (34.0, 40.0)
LABELS = ("viscosity ratio 2000", *(f"permeability {value:.2g} m²" for value in runs.PERMEABILITIES))


@style.styled
def draw(*folders: Path) -> Figure:
    """Conductivity over time, and the velocity across the pore at x = 0 before contact and after it."""
    folders = folders or tuple(runs.folders(RUNS))
    made = style.figure(2.9)
    panels = made.subplots(1, 3, width_ratios=[1.5, 1, 1])
    for folder, label, colour, look in zip(folders, LABELS, COLOURS, LOOKS):
        table = states.series(folder)
        panels[0].plot(table["time_h"], table["conductivity_m_per_d"], look, color=colour, label=label)
    panels[0].set(title="conductivity of the pore", xlabel="time (h)", ylabel="m/d", yscale="log", xlim=(0, None))
    panels[0].legend(loc="lower left")
    for axes, hours in zip(panels[1:], MOMENTS):
        _profiles(axes, folders, hours)
    for axes in panels:
        axes.grid(alpha=0.25, linewidth=0.4)
    style.number_panels(*panels)
    return made


def _profiles(axes: Axes, folders: tuple[Path, ...], hours: float) -> None:
    for folder, colour, look in zip(folders, COLOURS, LOOKS):
        state = nearest(folder, hours)
        axes.plot(*profile(state), look, color=colour)
        axes.axhline(top(state), color=style.FAINT, linewidth=0.8, linestyle=":")
    axes.set(title=f"velocity at x = 0, {state.time:g} h", xlabel="m/d", ylabel=style.Y_LABEL, ylim=(0, state.width),
             xlim=(0, None))


def nearest(folder: Path, hours: float) -> State:
    """The fields whose time (h) is the nearest."""
    return states.read(*min(states.times(folder), key=lambda each: abs(each[0] - hours)))


def profile(state: State) -> tuple[np.ndarray, np.ndarray]:
    """u_x (m/d) and y (um) at x = 0, closer to each other near the upper wall."""
    y = state.width * (1 - np.linspace(1.0, 0.0, 400) ** 2)
    return state.at("velocity_m_per_d", np.column_stack([np.zeros_like(y), y]))[:, 0], y


def top(state: State) -> float:
    """Height (um) of the aggregate."""
    return float(state.points[state.body, 1].max())


def caption(*folders: Path) -> str:
    """What is seen, with the conductivities at both moments."""
    folders = folders or tuple(runs.folders(RUNS))
    tables = [states.series(folder) for folder in folders]
    film, plug = (", ".join(f"{float(np.interp(hours, t['time_h'], t['conductivity_m_per_d'])):.3g}" for t in tables)
                  for hours in MOMENTS)
    return (f"Wide with the raised viscosity of the paper (black), with Brinkman's drag of a permeability of "
            f"{runs.PERMEABILITIES[0]:.2g} m² (red), and of W²/(12 λ) = {runs.PERMEABILITIES[1]:.2g} m² (blue, dashed), "
            "with which a pore that is filled over its length conducts as with the viscosity. (a) Conductivity: the "
            f"same while the aggregate leaves most of the pore open; at {MOMENTS[0]:g} h {film} m/d, at "
            f"{MOMENTS[1]:g} h {plug} m/d. (b), (c) Velocity across the pore at x = 0, with the top of the aggregates "
            "dotted: through a viscous body it is a parabola, through a permeable one it is even, and a tight one "
            "leaves the film nearly all of it.")
