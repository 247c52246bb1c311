"""Wide with a permeable body in place of the pseudoviscosity: its conductivity over time. Not in the paper."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from paper_figures import figure_6, runs, states, style

TITLE = "Addition. A permeable body instead of a pseudoviscosity"
RUNS = (runs.WIDE_FAST, *runs.PERMEABLE)
CLAIMS = ("C42", "C17")

COLOURS = (style.BLACK, style.RED, style.BLUE)
LINES = ("-", "-", "--")
LABELS = ("viscosity ratio 2000", *(f"permeability {value:.2g} m²" for value in runs.PERMEABILITIES))


#: Times (h) of the conductivities in the caption. They show an aggregate, a remaining film and a plug.
REPORTED_HOURS = (20.0, 34.0, 40.0)


@style.styled
def draw(*folders: Path) -> Figure:
    """Conductivity over time, and its ratio to that with the pseudoviscosity."""
    figure = style.figure(2.7)
    panels = figure.subplots(1, 2)
    first = states.series(folders[0])
    for folder, label, colour, line in zip(folders, LABELS, COLOURS, LINES):
        table = states.series(folder)
        panels[0].plot(table["time_h"], table["conductivity_m_per_d"], line, color=colour, label=label)
        ratio = table["conductivity_m_per_d"] / conductivity_at(first, table["time_h"])
        panels[1].plot(table["time_h"], ratio, line, color=colour)
    panels[0].set(title="conductivity of the pore", ylabel="m/d")
    panels[0].legend(loc="lower left")
    panels[1].set(title="over that with the viscosity ratio")
    for axes in panels:
        axes.set(xlabel="time (h)", yscale="log", xlim=(0, None))
        style.grid(axes)
        axes.axvline(states.contact(folders[0]), color=style.FAINT, linewidth=0.8, linestyle=":")
    style.number_panels(*panels)
    return figure


def conductivity_at(table: dict[str, np.ndarray], hours: np.ndarray | tuple[float, ...]) -> np.ndarray:
    """Conductivity (m/d) at times (h), interpolated geometrically between rows."""
    return np.exp(np.interp(hours, table["time_h"], np.log(table["conductivity_m_per_d"])))


def caption(*folders: Path) -> str:
    """Caption, with the conductivities for an aggregate, a remaining film and a plug."""
    columns = [conductivity_at(states.series(folder), REPORTED_HOURS) for folder in folders]
    conductivities = "; ".join("{:.3g}, {:.3g}, {:.3g} m/d at {:g} h".format(*row)
                               for row in zip(*columns, REPORTED_HOURS))
    return (f"Wide ({figure_6.ASSUMED}) with the raised viscosity of the paper (black) and with Brinkman's drag for "
            f"permeabilities of {runs.PERMEABILITIES[0]:.2g} m² (red) and W²/(12 λ) = {runs.PERMEABILITIES[1]:.2g} m² "
            "(dashed). With the latter, a pore filled over its length has the same conductivity as with the raised "
            f"viscosity. (a) Conductivity: {conductivities}. (b) The same over that with the raised viscosity. While "
            "the pore is open the water flows around the aggregate and the law has no effect. After that, the "
            "permeability of the biomass determines the conductivity of film and plug. Dotted: contact.")
