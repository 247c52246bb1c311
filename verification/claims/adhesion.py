"""C50, C51: a wall to which the aggregate is tightly bound (2.3.3). C52: the traction on the walls (5). C53: the
water's drag as a body force in a permeable aggregate (5, (20)).

The aggregate of base stands on the 10 um of wall under its seed. Runs are compared at 9 h: its area has grown fivefold,
and it does not touch the other wall. The paper prints no permeability. These claims use W^2 / (12 lambda), W the width
of the pore: a plug with this permeability conducts as much as a plug with the raised viscosity, lambda = 2000.
"""

from __future__ import annotations

import numpy as np

from repro.fem.walls import BOTTOM
from repro.model import adhesion
from verification.claims import FEW, FEW_WORDS, Finding, at_least, at_most, claim
from verification.claims.levels import COMPARED, PAIRED
from verification.claims.rheology import PLUG, conductivity_change, outline_shift
from verification.claims.runs import BASE, PLOTTED, Body, Run, body, contact_time, polygon, uncovered, until
from verification.problems.runs import contact_length

DEFINED = "2026-11-25 23:18"
#: Hour at which bonded and sliding aggregates are compared.
HOUR = 9
BONDED = 'growth.wall="bonded"'
FORCED = 'growth.fluid_forces="included"'
TO_HOUR = (*BASE, *until(HOUR))
#: "Highly": four times the "few percent" of the paper.
HIGHLY, HIGHLY_WORDS = 4 * FEW, "highly: four times a few percent"


@claim("C50", "2.3.3", "microorganisms tightly bound to the wall prevent extension along it, and lead to a highly "
       "distorted geometry", fine=PAIRED, beside=(), date=DEFINED)
def tightly_bound() -> Finding:
    """Compare base at 9 h on a wall to which it is bonded and on a wall on which it slides. The numbers are the area
    that only one outline covers, the mean distortion and the length of contact. The distortion is the larger principal
    stretch of F over the root of J. It is one if growth changes no shape."""
    sliding, bonded = (body((*TO_HOUR, *changes), HOUR) for changes in ((), (BONDED,)))
    area_difference = uncovered(polygon(sliding.outline), polygon(bonded.outline))
    checks = (at_least(f"outlines apart at {HOUR} h (% of the area)", "highly distorted", area_difference, 100 * HIGHLY,
                       HIGHLY_WORDS),
              at_least(f"mean distortion at {HOUR} h, less one (%)", "highly distorted",
                       100 * (distortion(bonded) - 1), 100 * HIGHLY, HIGHLY_WORDS),
              at_most(f"length of contact at {HOUR} h, over that with sliding (%)", "preventing extension",
                      100 * contact_length(bonded.outline, BOTTOM) / contact_length(sliding.outline, BOTTOM),
                      100 * (1 - HIGHLY), HIGHLY_WORDS))
    return Finding(checks, reason="the geometry differs less, or its difference is not known well enough",
                   note="On a wall along which the aggregate slides, the mean distortion is "
                        f"{100 * (distortion(sliding) - 1):.2g} %.")


def distortion(aggregate: Body) -> float:
    """Mean over the area of the larger principal stretch of F / J^(1/2)."""
    stretch = np.linalg.svd(aggregate.strained.F, compute_uv=False)[..., 0] / np.sqrt(aggregate.strained.J)
    weight = aggregate.pore.body.solid.at.dx * aggregate.strained.J
    return float(np.sum(weight * stretch) / weight.sum())


@claim("C51", "2.3.3", "finite elements would not perform well there, because of remeshing and the loss of information",
       fine=PAIRED, beside=(), date=DEFINED,
       unjudged="the paper states no accuracy, and its meshless alternative is not available here")
def remeshing_loses() -> Finding:
    """Wall traction of bonded base at 9 h with elements of two sizes."""
    peak = wall_traction(body((*TO_HOUR, BONDED), HOUR))
    return Finding((), note=f"The run of bonded base reaches {HOUR} h. The wall must then bear {1000 * peak:.3g} kPa.")


def wall_traction(aggregate: Body) -> float:
    """Largest traction on a wall (MPa)."""
    return adhesion.wall_peak(adhesion.Loading.of(aggregate.scene), aggregate.pore, aggregate.solved).value


@claim("C52", "5", "the adhesion that an aggregate requires stems from fluid flow and from its displacement boundary "
       "conditions along a surface", fine=PAIRED, beside=(), date=DEFINED)
def required_adhesion() -> Finding:
    """Largest traction on the walls, in the mean over W / 20: that of the fluid's forces on base at 19.2 h, on a wall
    on which it slides; and that on base at 9 h if it is bonded, against that if it slides."""
    plotted = (*BASE, *until(PLOTTED))
    unforced, forced = (wall_traction(body((*plotted, *changes), PLOTTED)) for changes in ((), (FORCED,)))
    sliding, bonded = (wall_traction(body((*TO_HOUR, *changes), HOUR)) for changes in ((), (BONDED,)))
    checks = (at_least("required by fluid flow, of what a wall must bear at 19.2 h (%)", "stemming from fluid flow",
                       100 * abs(forced - unforced) / max(forced, unforced), 100 * FEW, f"more than {FEW_WORDS}"),
              at_least("required by bonding, of what a wall must bear at 9 h (%)", "boundary conditions",
                       100 * abs(bonded - sliding) / max(bonded, sliding), 100 * FEW, f"more than {FEW_WORDS}"))
    return Finding(checks, reason="one of the two requires hardly any adhesion",
                   note=f"Walls must bear {1e6 * unforced:.3g} Pa at {PLOTTED} h without the fluid's forces and "
                        f"{1e6 * forced:.3g} Pa with them; at {HOUR} h {1e6 * sliding:.3g} Pa if the aggregate slides "
                        f"and {1e6 * bonded:.3g} Pa if it is bonded.")


#: lambda of Table 1.
LAMBDA = 2000


def permeable_runs(run: Run, width: float) -> tuple[Run, Run]:
    """A run in a pore of a width (um) with a permeable aggregate, without and with the drag on the biomass."""
    permeable = (*run, f'flow.permeability="{width**2 / (12 * LAMBDA)!r} um^2"')
    return permeable, (*permeable, FORCED)


@claim("C53", "5", "the action of water on a poroelastic aggregate as body forces may lead to differences, depending "
       "on the conditions", fine=COMPARED, beside=(), date=DEFINED)
def body_forces() -> Finding:
    """Compare runs in which the drag within a permeable aggregate acts on its shape with runs in which it does not. In
    wide at 40 h, a plug at constant velocity, one difference must exceed a few percent. In base at 19.2 h, at constant
    head, no difference may."""
    plug, open_pore = permeable_runs(PLUG, 100.0), permeable_runs((*BASE, *until(PLOTTED)), 50.0)
    area_apart = outline_shift(plug[1], 40, plug[0])[2]
    of_plug = {"outlines apart at 40 h, one moved onto the other (% of the area)": area_apart,
               "time of contact (%)": 100 * abs(contact_time(*plug[1]) / contact_time(*plug[0]) - 1),
               "conductivity at 40 h (%)": abs(conductivity_change(plug[1], (40,), plug[0]))}
    of_base = max(outline_shift(open_pore[1], PLOTTED, open_pore[0])[2],
                  abs(conductivity_change(open_pore[1], (PLOTTED,), open_pore[0])))
    name = max(of_plug, key=of_plug.get)
    checks = (at_least("wide: the most of three differences (%)", "may lead to differences", of_plug[name], 100 * FEW,
                       f"more than {FEW_WORDS}"),
              at_most("base: the larger of two differences (%)", "depending on the conditions", of_base, 100 * FEW,
                      FEW_WORDS))
    return Finding(checks, reason="the difference is a few percent in both, or in none",
                   change="the permeability W^2 / (12 lambda) is not the paper's",
                   note="Wide: " + "; ".join(f"{words} {value:.3g}" for words, value in of_plug.items()) + ".")
