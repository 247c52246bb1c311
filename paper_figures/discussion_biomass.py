"""An aggregate plugs a pore with less biomass than layers do: conductivity and uptake against biomass. Not in the
paper."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from paper_figures import figure_6, runs, states, style
from verification.claims import discussed
from verification.claims.discussed import LAYERS
from verification.claims.permeability import clean_per_day, layered_share

TITLE = "Addition. The same biomass as an aggregate and as layers"
RUNS = (runs.WIDE_CONVERGED,)
CLAIMS = ("C38", "C45")
COMPUTED = ("C45",)

#: Shares of the pore filled by layers, for their conductivity and for their uptake, which needs a solution each.
CONDUCTIVITY_SHARES, UPTAKE_SHARES = LAYERS[:-1:40], np.linspace(0.0, 0.4, 17)
#: Walls with layers: label and line.
WALLS = {1: ("layer on one wall", "-"), 2: ("layers on both walls", "--")}


@style.styled
def draw(folder: Path) -> Figure:
    """Conductivity and uptake over the share of the pore that is biomass."""
    figure = style.figure(2.6)
    panels = figure.subplots(1, 2)
    _conductivity(panels[0], folder)
    _uptake(panels[1], folder)
    for axes in panels:
        axes.set_xlabel("share of the pore that is biomass")
        style.grid(axes)
        axes.legend()
    style.number_panels(*panels)
    return figure


def _conductivity(axes: Axes, folder: Path) -> None:
    scene, table = runs.WIDE.load(), states.series(folder)
    axes.plot(filled(table), table["conductivity_m_per_d"] / clean_per_day(scene), color=style.RED, label="aggregate")
    for walls, (label, linestyle) in WALLS.items():
        shares = [layered_share(scene.flow.viscosity_ratio, float(part), walls) for part in CONDUCTIVITY_SHARES]
        axes.plot(CONDUCTIVITY_SHARES, shares, linestyle, color=style.BLUE, label=label)
    axes.set(title="conductivity over that of the clean pore", yscale="log", xlim=(0, 1))


def _uptake(axes: Axes, folder: Path) -> None:
    table = states.series(folder)
    axes.plot(filled(table), discussed.shares(table), color=style.RED, label="aggregate")
    for walls, (label, linestyle) in WALLS.items():
        shares = [discussed.share_of_layers(part, walls) for part in UPTAKE_SHARES[1:]]
        axes.plot(UPTAKE_SHARES, [0.0, *shares], linestyle, marker=".", markersize=3, color=style.BLUE, label=label)
    axes.set(title="share of the acceptor that is taken up", xlim=(0, UPTAKE_SHARES[-1]), ylim=(0, 1.03))


def filled(table: dict[str, np.ndarray]) -> np.ndarray:
    """Share of the pore that the aggregate fills, (n,)."""
    scene = runs.WIDE.load()
    return table["aggregate_area_um2"] / (scene.pore.width * scene.pore.length)


def caption(folder: Path) -> str:
    """Caption, with the shares at the end of the run."""
    table = states.series(folder)
    part, scene = float(filled(table)[-1]), runs.WIDE.load()
    falls = table["conductivity_m_per_d"][0] / table["conductivity_m_per_d"][-1]
    layers = 1 / layered_share(scene.flow.viscosity_ratio, part, 1)
    ratio = scene.flow.viscosity_ratio
    ends = [layered_share(ratio, float(CONDUCTIVITY_SHARES[-1]), walls) for walls in WALLS]
    return (f"The aggregate of Wide (red) from 0 to {table['time_h'][-1]:g} h ({figure_6.ASSUMED}), and layers of "
            "uniform thickness over the whole pore (blue), against the biomass. (a) The conductivity with layers is "
            "that of parallel flow in closed form. With layers on both walls it ends at 1 / lambda = "
            f"{1 / ratio:.1g}, that of a pore full of biomass ({ends[1]:.2g} at the last point); a layer on one wall "
            f"ends at 4 / lambda = {4 / ratio:.1g} ({ends[0]:.2g}): its face slips on the last film of water, and a "
            "channel that is free on one side conducts four times as well as one that sticks to both walls. Only when "
            "that film is thinner than W / lambda does it fall to 1 / lambda, too. At the end of the run the "
            f"aggregate fills {100 * part:.1f} % of the pore, whose conductivity has fallen by a factor of "
            f"{falls:.3g}; a layer of the same biomass reduces it by a factor of {layers:.2g}. Porosity does not "
            "determine permeability. (b) The model computes the uptake, with the same mean velocity and supply. At "
            f"the end the aggregate takes up {100 * discussed.shares(table)[-1]:.0f} % of the acceptor.")
