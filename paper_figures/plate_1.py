"""Plate 1: substrates and biomass of Base at its end, before the last expansion."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from matplotlib.tri import Triangulation

from paper_figures import runs, states, style

TITLE = "Plate 1. Substrates and biomass before the aggregate expands"
RUNS = (runs.BASE,)
CLAIMS = ("C03", "C04", "C05", "C06", "C10", "C33")

CONTOURS = 20
#: The values that the paper prints, K_s. It names the donor at the inlet, but the number is the acceptor's (E9).
PRINTED_INLET, PRINTED_EFFLUENTS = {"acceptor": " (~7*)", "donor": ""}, {"acceptor": "4.19", "donor": "6.13"}


@style.styled
def draw(folder: Path) -> Figure:
    """C_A and C_D in the meshed part, X_A and X_I over X_m; each has a colour scale."""
    state = states.last(folder, "before_expansion")
    figure = style.figure(4.35)
    panels = figure.subplot_mosaic([["acceptor", "donor"], ["active", "inert"]], height_ratios=[1, 1.7])
    for name, symbol in (("acceptor", "$C_A$"), ("donor", "$C_D$")):
        style.channel(panels[name], state.ends, state.width, 1.5)
        _shade(panels[name], state.triangulation, state.nodes[f"{name}_mg_per_L"], f"{symbol} (mg/L)")
        style.aggregate(panels[name], state.rim, filled=False, edgecolor="white")
        inlet, outlet = (state.carried(f"{name}_mg_per_L", side) for side in (0, 1))
        panels[name].set_title(f"{name}: {inlet:.2f}{PRINTED_INLET[name]} in, {outlet:.2f} "
                               f"({PRINTED_EFFLUENTS[name]}) out")
    for name, label, scale in (("active", "$X_A / X_m$ (–)", 1), ("inert", "$X_I / X_m$ (10$^{-3}$)", 1e3)):
        margin = 0.06 * np.ptp(state.rim[:, 0])
        style.plane(panels[name], (state.rim[:, 0].min() - margin, state.rim[:, 0].max() + margin),
                    (-margin / 2, state.rim[:, 1].max() + margin))
        _shade(panels[name], state.aggregate, scale * state.nodes[f"{name}_biomass"], label)
        style.aggregate(panels[name], state.rim, filled=False)
        panels[name].set_title(f"{name} biomass")
    style.number_panels(*panels.values())
    return figure


def _shade(axes: Axes, triangulation: Triangulation, values: np.ndarray, label: str) -> None:
    """Colours, with CONTOURS equally spaced lines between the extremes of the values in the triangles."""
    inside = values[triangulation.triangles]
    levels = np.linspace(inside.min(), inside.max(), CONTOURS + 2)
    colours = axes.tricontourf(triangulation, values, levels=levels, cmap=style.MAP)
    axes.tricontour(triangulation, values, levels=levels[1:-1], colors=style.BLACK, linewidths=0.4)
    bar = axes.figure.colorbar(colours, ax=axes, location="bottom", label=label, aspect=30, pad=0.02)
    bar.locator = MaxNLocator(5)
    bar.update_ticks()


def caption(folder: Path) -> str:
    """Caption, with the extremes and the concentrations at inlet and outlet."""
    shaped, end = states.last_step(folder)
    state = states.last(folder, "before_expansion")
    acceptor = [state.carried("acceptor_mg_per_L", side) for side in (0, 1)]
    donor = [state.carried("donor_mg_per_L", side) for side in (0, 1)]
    active, inert = (state.nodes[f"{name}_biomass"][state.body] for name in ("active", "inert"))
    return (f"Base at t = {end:g} h before the aggregate expands: the shape is that of {shaped:g} h and contains the "
            "biomass grown since. (a, b) The substrates in the meshed part; the flow is from left to right. The "
            f"flow-weighted mean of the acceptor falls from {acceptor[0]:.2f} mg/L at the inlet of the meshed part to "
            f"{acceptor[1]:.2f} mg/L at the outlet, "
            f"the donor from {donor[0]:.2f} to {donor[1]:.2f} mg/L (1 mg/L is 1 K_s; the values in parentheses are "
            f"printed; * the paper prints ~7 as the donor's, E9){_start(folder, shaped)}. (c, d) "
            "Active and inert biomass over X_m, from which (34) leaves the density 0.1 % apart at the interface: "
            f"X_A from {active.min():.4f} to {active.max():.4f}, X_I from {inert.min():.5f} to "
            f"{inert.max():.5f}. Each panel has {CONTOURS} equally spaced contour lines and a separate colour scale.")


def _start(folder: Path, shaped: float) -> str:
    """The effluents in the same shape before biomass has grown in it."""
    row = states.row(folder, shaped)
    return (f"; at {shaped:g} h, with less biomass in the same shape, {row['effluent_acceptor_mg_per_L']:.2f} and "
            f"{row['effluent_donor_mg_per_L']:.2f} mg/L left")
