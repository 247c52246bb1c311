"""Plate 2: the last expansion of Base and the deformation of the mesh."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.tri import Triangulation

from paper_figures import runs, states, style
from paper_figures.states import State
from repro.fem.transfer import interpolate

TITLE = "Plate 2. One expansion of the aggregate and the deformation of the mesh"
RUNS = (runs.BASE,)
CLAIMS = ("C08", "C11", "C24", "C31")

#: Factor by which the arrows are longer than the displacements.
LENGTHENED = 5


@style.styled
def draw(folder: Path) -> Figure:
    """The meshed part, and a close-up of the aggregate."""
    before, after = states.last(folder, "before_expansion"), states.last(folder)
    figure = style.figure(5.1)
    meshed_part, near = figure.subplots(2, 1, height_ratios=[1, 1.75])
    style.channel(meshed_part, after.ends, after.width, 1.0)
    reach = 1.18 * np.abs(after.rim[:, 0]).max()
    style.channel(near, (-reach, reach), after.width, 0.5)
    near.set_ylim(-0.5, min(after.width + 0.5, 1.2 * after.rim[:, 1].max()))
    for axes, boldness in ((meshed_part, 0.6), (near, 1.0)):
        colours = _expansion(axes, before, after, boldness)
    figure.colorbar(colours, ax=[meshed_part, near], location="right", label="expansion θ since t = 0 (–)", aspect=40)
    meshed_part.set_title("meshed part")
    near.set_title(f"aggregate: shape before (dashed) and after (line), displacements × {LENGTHENED}")
    style.number_panels(meshed_part, near)
    return figure


def _expansion(axes: Axes, before: State, after: State, boldness: float):
    """Draw theta in colour, both meshes, both outlines and the arrows; return the colours for a colour bar."""
    theta = after.cells["theta"][after.biomass]
    colours = axes.tripcolor(after.aggregate, theta, cmap=style.MAP, zorder=1)
    nodes, moved_to = displaced(before, after)
    if same_mesh(before, after):
        axes.triplot(Triangulation(*before.points.T, before.triangles[~before.biomass]), color=style.SKY,
                     linewidth=0.5 * boldness, zorder=2)
    axes.triplot(after.triangulation, color=style.BLACK, linewidth=0.35 * boldness, alpha=0.7, zorder=3)
    style.aggregate(axes, before.rim, filled=False, edgecolor="white", linestyle="--", linewidth=boldness, zorder=4)
    style.aggregate(axes, after.rim, filled=False, linewidth=1.2 * boldness, zorder=4)
    start = before.points[nodes]
    axes.quiver(*start.T, *(LENGTHENED * (moved_to - start)).T, color=style.RED, angles="xy", scale_units="xy", scale=1,
                width=0.0016 * boldness, headwidth=4, headlength=5, zorder=5)
    return colours


def same_mesh(before: State, after: State) -> bool:
    """Whether the mesh has moved without a remesh."""
    return before.triangles.shape == after.triangles.shape and bool((before.triangles == after.triangles).all())


def displaced(before: State, after: State) -> tuple[np.ndarray, np.ndarray]:
    """Nodes of the mesh before the expansion, and their positions after it (K, 2).

    After a remesh the fluid has no displacement. The positions of the aggregate's nodes then follow from the positions
    of their material at t = 0.
    """
    if same_mesh(before, after):
        return np.arange(len(before.points)), after.points
    material = after.nodes["position_t0_um"][:, :2]
    initial_positions = before.nodes["position_t0_um"][before.body, :2]
    return before.body, interpolate(material, after.triangles[after.biomass], after.points, initial_positions)


def caption(folder: Path) -> str:
    """Caption, with the extremes of theta and of the displacement."""
    before, after = states.last(folder, "before_expansion"), states.last(folder)
    shaped, end = states.last_step(folder)
    nodes, moved_to = displaced(before, after)
    largest = np.linalg.norm(moved_to - before.points[nodes], axis=1).max()
    theta = after.cells["theta"][after.biomass]
    mesh = ("The mesh of the fluid before the expansion is blue, the mesh after it black" if same_mesh(before, after)
            else "This step includes a remesh, so that only the new mesh and the aggregate's displacements are shown")
    return (f"Growth in Base from {shaped:g} to {end:g} h expands the aggregate from the dashed outline to the full "
            f"one. Red arrows are displacements times {LENGTHENED} (the largest is {largest:.2f} µm). {mesh}. "
            f"Colour: expansion since t = 0, from {theta.min():.1f} to {theta.max():.1f}. The meshed part is "
            f"{np.ptp(after.ends):.0f} µm long, the aggregate reaches {-after.rim[:, 0].min():.2f} µm upstream and "
            f"{after.rim[:, 0].max():.2f} µm downstream of the seed's centre.")
