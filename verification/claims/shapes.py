"""C29, C31: the shapes of base and wide."""

from __future__ import annotations

import numpy as np

from repro.fem.outline import BOTTOM, FREE, TOP, Outline
from verification.claims import Finding, at_least, at_most, claim, without_limit
from verification.claims.accuracy import FEW
from verification.claims.levels import WIDE_FINE
from verification.claims.restored import bodies
from verification.claims.runs import BASE, WIDE, scene, series

#: Every so many rows are told: 5 h.
TOLD = 5


@claim("C29", "Fig 6", "the aggregate is squeezed between the walls as it grows",
       fine=WIDE_FINE)
def squeezed() -> Finding:
    """Outlines of wide: inside the channel; length over thickness; lengths of both contact surfaces.

    A contact surface grows by whole edges of the outline: the least that it grows in an update has no limit.
    """
    rows, width = series(*WIDE), scene(*WIDE).pore.width
    outlines, after = [found.outline for found in bodies(WIDE)], rows["contact"] == 1
    beyond = max(max(0.0 - o.points[:, 1].min(), o.points[:, 1].max() - width) for o in outlines)
    slender = np.array([(o.downstream - o.upstream) / o.thickness for o in outlines])
    surfaces = np.array([[contact_length(o, wall) for wall in (BOTTOM, TOP)] for o in outlines])
    rates = np.diff(surfaces[after], axis=0) / np.diff(rows["time_h"][after])[:, None]
    checks = (at_most("how far an outline leaves the channel (um)", "between the walls", beyond, 1e-9, "none"),
              at_most("largest length over thickness before contact", "half-disc: 2", slender[~after].max(),
                      2 * (1 + FEW), "a few percent"),
              at_least("the same at the end", "squeezed", slender[-1], 3, "half as much again as a half-disc's 2"),
              at_least("thickness of a free half-disc of the last area, over W", "squeezed",
                       np.sqrt(2 * outlines[-1].area / np.pi) / width, 1 + FEW, "more than fits, by a few percent"),
              without_limit(at_least("least rate at which a contact surface grows (um/h)", "as it grows", rates.min(),
                                     0.0, "both grow in each update")))
    told = "; ".join(f"{time:g} h: {ratio:.2f}, {low:.0f} and {high:.0f} um" for time, ratio, (low, high) in
                     list(zip(rows["time_h"], slender, surfaces))[::TOLD])
    return Finding(checks, note=f"Contact at {rows['time_h'][after][0]:g} h. Length over thickness, contact surfaces: "
                   f"{told}.", reason="not on every mesh")


def contact_length(outline: Outline, wall: int) -> float:
    """Length (um) of the contact surface with a wall."""
    x = outline.points[outline.wall == wall, 0]
    return float(np.ptp(x)) if len(x) else 0.0


@claim("C31", "2.3.3, 4", "the shape stays a half-disc until it is limited or squeezed",
       fine=WIDE_FINE)
def stays_half_disc() -> Finding:
    """Largest deviation of the interface from a half-disc of the same area around the middle of its base."""
    base, wide = (np.array([100 * deviation(found.outline) for found in bodies(run)]) for run in (BASE, WIDE))
    rows, few = series(*WIDE), 100 * FEW
    before = rows["contact"] == 0
    checks = (at_most("base: largest deviation (% of R)", "half-disc", base.max(), few, "a few percent"),
              at_most("wide before contact: largest deviation (% of R)", "half-disc", wide[before].max(), few,
                      "a few percent"),
              at_least("wide at its end: deviation (% of R)", "until squeezed", wide[-1], few,
                       "more than a few percent"))
    half = scene(*WIDE).substrates.acceptor.half_saturation
    limited = rows["time_h"][rows["acceptor_min_mg_per_L"] < half]
    centre = 0.5 * (rows["upstream_um"] + rows["downstream_um"])
    told = ", ".join(f"{value:.2g} at {time:g} h" for time, value in list(zip(rows["time_h"], wide))[::TOLD])
    return Finding(checks, note=f"Base (%): {base[0]:.2g} at first, which is the polygon's own, {base[-1]:.2g} at "
                   f"last. Wide (%): {told}. Somewhere in it C_A falls under K_s at {min(limited, default=np.inf):g} "
                   f"h: its growth is then limited, but shows as a shift of the whole half-disc, its centre being "
                   f"{-centre[before][-1]:.1f} um upstream at {rows['time_h'][before][-1]:g} h.",
                   reason="the deviation is not decided by these meshes")


def deviation(outline: Outline) -> float:
    """Largest | r / R - 1 | over the free nodes, r from the lower contact surface's middle, R = (2 area / pi)^(1/2)."""
    low = outline.points[outline.wall == BOTTOM, 0]
    free = outline.points[outline.wall == FREE] - [0.5 * (low.min() + low.max()), 0.0]
    return float(np.abs(np.hypot(*free.T) / np.sqrt(2 * outline.area / np.pi) - 1).max())
