"""Plate 2: the last expansion of Base and the deformation of the mesh."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import TriMesh
from matplotlib.figure import Figure
from matplotlib.tri import Triangulation

from paper_figures import runs, states, style
from paper_figures.states import State
from repro.fem.transfer import interpolate

TITLE = "Plate 2. One expansion of the aggregate and the deformation of the mesh"
RUNS = (runs.BASE,)
CLAIMS = ("C08", "C11", "C24", "C31")

#: Ratio of arrows to displacements in (b) and in (a), and the least distance (um) between two arrows in (a).
CLOSE_UP_FACTOR, MESHED_PART_FACTOR, APART = 5, 15, 7.0


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
    _meshed_part(meshed_part, before, after)
    colours = _close_up(near, before, after)
    figure.colorbar(colours, ax=[meshed_part, near], location="right", label="expansion θ since t = 0 (–)", aspect=40)
    meshed_part.set_title(f"meshed part, {np.ptp(after.ends):.0f} µm long (printed: 210; C08), displacements × "
                          f"{MESHED_PART_FACTOR}")
    near.set_title(f"aggregate: shape before (dashed) and after (line), displacements × {CLOSE_UP_FACTOR}")
    style.number_panels(meshed_part, near)
    return figure


def _meshed_part(axes: Axes, before: State, after: State) -> None:
    """Theta in colour, the new mesh, and arrows that are APART."""
    _theta(axes, after)
    axes.triplot(after.triangulation, color=style.FAINT, linewidth=0.3, zorder=2)
    nodes, moved_to = displaced(before, after)
    start = before.points[nodes]
    few = scattered(start)
    _arrows(axes, start[few], moved_to[few], MESHED_PART_FACTOR)


def _close_up(axes: Axes, before: State, after: State) -> TriMesh:
    """Theta in colour, both meshes, both outlines and all arrows; return the colours for a colour bar."""
    colours = _theta(axes, after)
    if same_mesh(before, after):
        axes.triplot(Triangulation(*before.points.T, before.triangles[~before.biomass]), color=style.SKY,
                     linewidth=0.5, zorder=2)
    axes.triplot(after.triangulation, color=style.BLACK, linewidth=0.35, alpha=0.7, zorder=3)
    style.aggregate(axes, before.rim, filled=False, edgecolor="white", linestyle="--", linewidth=1.0, zorder=4)
    nodes, moved_to = displaced(before, after)
    _arrows(axes, before.points[nodes], moved_to, CLOSE_UP_FACTOR)
    return colours


def _theta(axes: Axes, after: State) -> TriMesh:
    """Theta in colour within the new outline."""
    style.aggregate(axes, after.rim, filled=False, zorder=4)
    return axes.tripcolor(after.aggregate, after.cells["theta"][after.biomass], cmap=style.MAP, zorder=1)


def _arrows(axes: Axes, start: np.ndarray, end: np.ndarray, factor: float) -> None:
    """Arrows ``factor`` times as long as the displacements from start (K, 2) to end."""
    axes.quiver(*start.T, *(factor * (end - start)).T, color=style.RED, angles="xy", scale_units="xy", scale=1,
                width=0.0018, headwidth=4, headlength=5, zorder=5)


def scattered(points: np.ndarray) -> np.ndarray:
    """Numbers of points (K, 2), each APART (um) or more from those before it."""
    chosen: list[int] = []
    for number, point in enumerate(points):
        if all(np.hypot(*(points[other] - point)) >= APART for other in chosen):
            chosen.append(number)
    return np.array(chosen)


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
    mesh = ("In (b) the mesh of the fluid before the expansion is blue, the mesh after it black"
            if same_mesh(before, after) else
            "This step includes a remesh, so that only the new mesh and the aggregate's displacements are shown")
    return (f"Growth in Base from {shaped:g} to {end:g} h expands the aggregate from the dashed outline to the full "
            f"one. Red arrows are displacements times {CLOSE_UP_FACTOR} (the largest is {largest:.2f} µm), in (a) "
            f"those of nodes {APART:g} µm apart. {mesh}. Colour: expansion since t = 0, from {theta.min():.1f} to "
            f"{theta.max():.1f}. The meshed part is {np.ptp(after.ends):.0f} µm long, the aggregate reaches "
            f"{-after.rim[:, 0].min():.2f} µm upstream and {after.rim[:, 0].max():.2f} µm downstream of the seed's "
            "centre.")
