"""Wide with a permeable body in place of the pseudoviscosity: its conductivity over time. Not in the paper."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from paper_figures import runs, states, style

TITLE = "Addition. A permeable body instead of a pseudoviscosity"
RUNS = (runs.WIDE_FAST, *runs.PERMEABLE)
CLAIMS = ("C42", "C17")

COLOURS = (style.BLACK, style.RED, style.BLUE)
LOOKS = ("-", "-", "--")
LABELS = ("viscosity ratio 2000", *(f"permeability {value:.2g} m²" for value in runs.PERMEABILITIES))


#: When (h) conductivities are told: an aggregate, a film left, a plug.
MOMENTS = (20.0, 34.0, 40.0)


@style.styled
def draw(*folders: Path) -> Figure:
    """Conductivity over time, and over that with the pseudoviscosity."""
    made = style.figure(2.7)
    panels = made.subplots(1, 2)
    first = states.series(folders[0])
    for folder, label, colour, look in zip(folders, LABELS, COLOURS, LOOKS):
        table = states.series(folder)
        panels[0].plot(table["time_h"], table["conductivity_m_per_d"], look, color=colour, label=label)
        panels[1].plot(table["time_h"], table["conductivity_m_per_d"] / at(first, table["time_h"]), look, color=colour)
    panels[0].set(title="conductivity of the pore", ylabel="m/d")
    panels[0].legend(loc="lower left")
    panels[1].set(title="over that with the viscosity ratio")
    for axes in panels:
        axes.set(xlabel="time (h)", yscale="log", xlim=(0, None))
        style.grid(axes)
        axes.axvline(states.contact(folders[0]), color=style.FAINT, linewidth=0.8, linestyle=":")
    style.number_panels(*panels)
    return made


def at(table: dict[str, np.ndarray], hours: np.ndarray | tuple[float, ...]) -> np.ndarray:
    """Conductivity (m/d) at times (h), between rows in proportion."""
    return np.exp(np.interp(hours, table["time_h"], np.log(table["conductivity_m_per_d"])))


def caption(*folders: Path) -> str:
    """What is seen, with the conductivities of an aggregate, with a film left, and of a plug."""
    columns = [at(states.series(folder), MOMENTS) for folder in folders]
    told = "; ".join("{:.3g}, {:.3g}, {:.3g} m/d at {:g} h".format(*row) for row in zip(*columns, MOMENTS))
    return ("Wide with the raised viscosity of the paper (black), with Brinkman's drag of a permeability of "
            f"{runs.PERMEABILITIES[0]:.2g} m² (red), and of W²/(12 λ) = {runs.PERMEABILITIES[1]:.2g} m² (dashed), "
            "with which a pore that is filled over its length conducts as with the viscosity. (a) Conductivity: "
            f"{told}. (b) The same over that with the viscosity. While the pore is open the water goes around and the "
            "law does not matter; film and plug conduct what the biomass lets through. Dotted: contact.")
