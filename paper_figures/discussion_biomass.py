"""Less biomass plugs a pore as an aggregate than as layers: conductivity and uptake against biomass. Not in the
paper."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from paper_figures import runs, states, style
from verification.claims import discussed
from verification.claims.discussed import LAYERS, layered_share
from verification.claims.permeability import clean

TITLE = "Addition. The same biomass as an aggregate and as layers"
RUNS = (runs.WIDE,)
CLAIMS = ("C38", "C45")
COMPUTED = ("C45",)

#: Parts filled by layers at which their conductivity is drawn, and their uptake, which takes a solution each.
DRAWN, TAKEN_UP = LAYERS[:-1:40], np.linspace(0.0, 0.4, 17)
#: Walls with layers: label and line.
WALLS = {1: ("layer on one wall", "-"), 2: ("layers on both walls", "--")}


@style.styled
def draw(folder: Path) -> Figure:
    """Conductivity and uptake over the part of the pore that is filled."""
    made = style.figure(2.6)
    panels = made.subplots(1, 2)
    _conductivity(panels[0], folder)
    _uptake(panels[1], folder)
    for axes in panels:
        axes.set_xlabel("part of the pore that is biomass")
        style.grid(axes)
        axes.legend()
    style.number_panels(*panels)
    return made


def _conductivity(axes: Axes, folder: Path) -> None:
    scene, table = runs.WIDE.load(), states.series(folder)
    axes.plot(filled(table), table["conductivity_m_per_d"] / (24e-6 * clean(scene)), color=style.RED, label="aggregate")
    for walls, (label, look) in WALLS.items():
        shares = [layered_share(scene.flow.viscosity_ratio, float(part), walls) for part in DRAWN]
        axes.plot(DRAWN, shares, look, color=style.BLUE, label=label)
    axes.set(title="conductivity over that of the clean pore", yscale="log", xlim=(0, 1))


def _uptake(axes: Axes, folder: Path) -> None:
    table = states.series(folder)
    axes.plot(filled(table), discussed.shares(table), color=style.RED, label="aggregate")
    for walls, (label, look) in WALLS.items():
        shares = [discussed.in_the_model(part, walls) for part in TAKEN_UP[1:]]
        axes.plot(TAKEN_UP, [0.0, *shares], look + ".", markersize=3, color=style.BLUE, label=label)
    axes.set(title="part of the acceptor that is taken up", xlim=(0, TAKEN_UP[-1]), ylim=(0, 1.03))


def filled(table: dict[str, np.ndarray]) -> np.ndarray:
    """(n,) parts of the pore that the aggregate fills."""
    scene = runs.WIDE.load()
    return table["aggregate_area_um2"] / (scene.pore.width * scene.pore.length)


def caption(folder: Path) -> str:
    """What is seen, with the parts at the end of the run."""
    table = states.series(folder)
    part, scene = float(filled(table)[-1]), runs.WIDE.load()
    falls = table["conductivity_m_per_d"][0] / table["conductivity_m_per_d"][-1]
    layers = 1 / layered_share(scene.flow.viscosity_ratio, part, 1)
    return (f"The aggregate of Wide (red) from 0 to {table['time_h'][-1]:g} h, and layers of uniform thickness over "
            "the whole pore (blue; conductivity of parallel flow in closed form, uptake solved by the model with the "
            "layers as its aggregate), against the biomass. At its end the aggregate fills "
            f"{100 * part:.1f} % of the pore and has made it {falls:.3g} times less conductive; a layer of that "
            f"biomass makes it {layers:.2g} times less. Porosity does not determine permeability. (b) At the same mean "
            f"velocity and supply, the aggregate takes up {100 * discussed.shares(table)[-1]:.0f} % of the acceptor in "
            "the end.")
