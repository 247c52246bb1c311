"""C16, C17: what the aggregate does to the conductivity."""

from __future__ import annotations

import numpy as np

from repro.fem.mesh import Mesh
from repro.fem.mesher import generate
from repro.fem.outline import BOTTOM, TOP, Outline
from repro.model.pore import sized
from verification.claims import Finding, at_least, at_most, claim, near
from verification.claims.levels import ALONE, WIDE_SIZES
from verification.claims.runs import WIDE, scene, series
from verification.claims.states import flow_in, half_disc

#: Thicknesses over the pore's width: the last leaves a film of 2 um in a pore of 50 um.
BLOCKED = (0.1, 0.3, 0.5, 0.7, 0.8, 0.9, 0.96)


def clean(said) -> float:
    """Conductivity of a scene's pore without aggregate, g W^2 / (12 nu), um/h."""
    return said.flow.gravity * said.pore.width**2 / (12 * said.flow.kinematic_viscosity)


@claim("C16", "4, 2.1", "conductivity falls sharply when the aggregate spans the pore",
       "python -m verification.claims C16", (WIDE,), sizes=WIDE_SIZES)
def spanning() -> Finding:
    """Conductivity of `wide` through contact, of half-discs up to a 2 um film, and of a plug of length 2 W."""
    rows = series(*WIDE)
    time, share = rows["time_h"], rows["conductivity_m_per_d"] / (24e-6 * clean(scene(*WIDE)))
    contact = int(np.flatnonzero(rows["contact"] == 1)[0])
    earlier, through, later = (_fall(time, share, time[contact] + shift) for shift in (-5, 0, 5))
    said = scene("flow_only")
    ours, exact = plug(said, 2 * said.pore.width)
    sharp = "falls sharply"
    twice = "sharper: twice as sharp at least"
    checks = (at_most("K / K_clean at contact", sharp, share[contact], 0.01, "orders of magnitude: two at least"),
              at_least("fall in the 5 h up to contact (times)", sharp, through, 10, "an order of magnitude"),
              at_least("the same over the fall in the 5 h before", sharp, through / earlier, 2, twice),
              at_least("the same over the fall in the 5 h after", sharp, through / later, 2, twice),
              near("K / K_clean of a plug of length 2 W", "forced through", ours, exact, relative=0.01,
                   why="exact, 1 / (1 + (lambda - 1) 2 W / L); 1 % for the mesh"))
    return Finding(checks, note=_course(time, share, contact) + " " + _half_discs(said))


def _fall(time: np.ndarray, share: np.ndarray, end: float) -> float:
    """Factor by which the conductivity falls in the 5 h up to a time (h)."""
    return float(np.interp(end - 5, time, share) / np.interp(end, time, share))


def _course(time: np.ndarray, share: np.ndarray, contact: int) -> str:
    told = ", ".join(f"{share[i]:.2g} at {time[i]:g} h" for i in (contact - 1, contact, -1))
    return (f"Wide, K / K_clean: {told}; contact comes at the second of these times, so that most of the fall "
            f"comes with the narrowing of the film.")


def _half_discs(said) -> str:
    pores = [half_disc(said, part * said.pore.width, 1.5 * said.pore.width) for part in BLOCKED]
    told = ", ".join(f"{flow_in(said, grid).conductivity / clean(said):.3g} at {part:g}"
                     for part, grid in zip(BLOCKED, pores))
    return f"Half-discs in a 50 um pore, K / K_clean at R / W: {told}."


def plug(said, length: float) -> tuple[float, float]:
    """K / K_clean with biomass over the whole width and a length (um): computed, and exact (parallel flow)."""
    half, width = length / 2, said.pore.width
    points = np.array([[-half, 0.0], [0.0, 0.0], [half, 0.0], [half, width], [0.0, width], [-half, width]])
    wall = np.repeat([BOTTOM, TOP], 3)
    outline = Outline(points, wall, np.zeros(6, bool), points)
    ends = -half - 1.5 * width, half + 1.5 * width
    grid, _ = generate(outline, ends, sized(said))
    exact = 1 / (1 + (said.flow.viscosity_ratio - 1) * length / said.pore.length)
    return flow_in(said, grid).conductivity / clean(said), exact


@claim("C17", "2.1", "lambda = 2000 allows a permeability reduction of up to 2000 (pore filled over its length)",
       "python -m verification.claims C17", steps=ALONE, fixed="nothing moves in it")
def filled() -> Finding:
    """Clean over filled conductivity, biomass in every triangle of the whole pore, at the default mesh."""
    said = scene("flow_only")
    half = said.pore.length / 2
    empty, _ = generate(None, (-half, half), sized(said))
    full = Mesh.of(empty.points, empty.cells, np.ones(len(empty.cells), bool), empty.loop, empty.width, empty.ends)
    open_, closed = (flow_in(said, grid).conductivity for grid in (empty, full))
    check = near("reduction of the conductivity (times)", "2000", open_ / closed, said.flow.viscosity_ratio,
                 relative=0.001, why="exact in the Laplacian form: the problems differ by the factor lambda alone")
    apart = 100 * (open_ / clean(said) - 1)
    return Finding((check,), note=f"The clean channel's own conductivity is {apart:+.2f} % from g W^2 / (12 nu).")
