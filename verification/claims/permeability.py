"""C16, C17: what the aggregate does to the conductivity."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from repro.fem.mesh import Mesh
from repro.fem.mesher import generate
from repro.fem.outline import BOTTOM, TOP, Outline
from repro.model.pore import sized
from verification.claims import CLOSED, Finding, at_least, at_most, claim, near
from verification.claims.levels import DEFAULT, WIDE_FINE, at_level
from verification.claims.runs import WIDE, around_contact, scene, series
from verification.claims.states import flow_in, half_disc

#: Thicknesses over the pore's width: the last leaves a film of 2 um in a pore of 50 um.
BLOCKED = (0.1, 0.3, 0.5, 0.7, 0.8, 0.9, 0.96)


def clean(said) -> float:
    """Conductivity of a scene's pore without aggregate, g W^2 / (12 nu), um/h."""
    return said.flow.gravity * said.pore.width**2 / (12 * said.flow.kinematic_viscosity)


@claim("C16", "4, 2.1", "conductivity falls sharply when the aggregate spans the pore", fine=WIDE_FINE)
def spanning() -> Finding:
    """Conductivity of `wide` up to its contact, at it and after it."""
    rows, touching = series(*WIDE), around_contact(*WIDE)
    whole = 24e-6 * clean(scene(*WIDE))
    time, share = rows["time_h"], rows["conductivity_m_per_d"] / whole
    contact = float(touching["time_h"][1])
    film, closed = (float(value) / whole for value in touching["conductivity_m_per_d"])
    course = Course(time, share, contact, film, closed)
    sharp, twice = "falls sharply", "sharper: twice as sharp at least"
    earlier, through, later = course.falls()
    checks = (at_most("K / K_clean at contact", sharp, closed, 0.01, "orders of magnitude: two at least"),
              at_least("fall in the 5 h up to contact (times)", sharp, through, 10, "an order of magnitude"),
              at_least("the same over the fall in the 5 h before", sharp, through / earlier, 2, twice),
              at_least("the same over the fall in the 5 h after", sharp, through / later, 2, twice))
    before = 100 * np.log(film) / np.log(closed)
    change = (f"it falls as the aggregate comes to span the pore, not when it does: of the orders of magnitude lost by "
              f"contact {before:.0f} % are lost while a film is left, K / K_clean being {film:.2g} in the last shape "
              f"with a film and {closed:.2g} in the first without, {film / closed:.1f} times less")
    return Finding(checks, change=change, reason="the fall is not as sharp on every mesh", note=_half_discs)


@dataclass(frozen=True, eq=False)
class Course:
    """K / K_clean (n,) at times (h), and just before and after contact."""

    time: np.ndarray
    share: np.ndarray
    contact: float
    film: float
    closed: float

    def falls(self) -> tuple[float, float, float]:
        """Factors by which it falls in the 5 h before the last 5 h up to contact, in these, and in the 5 h after;
        geometric between rows, on either side of contact."""
        early = self.time < self.contact
        first, second = (self._at(early, self.film, self.contact - shift) for shift in (10, 5))
        last = self._at(~early, self.closed, self.contact + 5)
        return first / second, second / self.closed, self.closed / last

    def _at(self, chosen: np.ndarray, end: float, when: float) -> float:
        order = np.argsort(np.append(self.time[chosen], self.contact))
        time, share = (np.append(column[chosen], value)[order]
                       for column, value in ((self.time, self.contact), (self.share, end)))
        return float(np.exp(np.interp(when, time, np.log(share))))


def _half_discs() -> str:
    with at_level(DEFAULT):
        said = scene("flow_only")
    ours, exact = plug(said, 2 * said.pore.width)
    pores = [half_disc(said, part * said.pore.width, 1.5 * said.pore.width) for part in BLOCKED]
    told = ", ".join(f"{flow_in(said, grid).conductivity / clean(said):.3g} at {part:g}"
                     for part, grid in zip(BLOCKED, pores))
    return (f"Half-discs in a 50 um pore, K / K_clean at R / W: {told}; a plug of length 2 W: {ours:.5f}, exactly "
            f"{exact:.5f}.")


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
       about=CLOSED)
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
