"""C42: a permeable body, with Brinkman's drag, in place of the pseudoviscosity: aggregate, film and plug.

Section 5 calls the raised viscosity artificial, names a porous material as another approach, says that it may make a
difference depending on the conditions, and does not evaluate it. Both laws are run here from the seed on. A pore that
is filled over its length conducts K_clean / lambda with the one and K_clean 12 k / W^2 with the other, so that lambda =
2000 is a permeability of W^2 / (12 lambda), no property of the biomass: it goes as the square of the pore's width.
"""

from __future__ import annotations

from verification.claims import Finding, at_least, at_most, claim
from verification.claims.accuracy import FEW, FEW_WORDS
from verification.claims.levels import COMPARED
from verification.claims.rheology import WHOLE
from verification.claims.runs import around_contact, at, scene, series

PLOTTED = 19.2
#: Of dense biomass, um2.
PERMEABILITY = 1e-3
NEW = "2026-11-22"
#: A pore as base to the shape that section 4 plots, and wide until its plug is 5 h old.
AGGREGATE = ("base", f'growth.end="{PLOTTED} h"', f'output.times=["{PLOTTED} h"]')
PLUG = WHOLE


def permeable(run: tuple[str, ...], permeability: float = PERMEABILITY) -> tuple[str, ...]:
    """A run with Brinkman's drag of a permeability (um2) and without the pseudoviscosity."""
    return (*run, 'flow.biomass="brinkman"', f'flow.permeability="{1e-12 * permeability:.6g} m^2"')


def equivalent(run: tuple[str, ...]) -> float:
    """W^2 / (12 lambda), um2: the permeability of which a body that fills the pore conducts as with lambda."""
    said = scene(*run)
    return said.pore.width**2 / 12 / said.flow.viscosity_ratio


@claim("C42", "5", "a porous material instead of a raised viscosity may lead to differences, depending on the "
                   "conditions",
       fine=COMPARED, beside=())
def drag_or_viscosity() -> Finding:
    """Conductivity with Brinkman's drag of a permeability of 1e-15 m2 over that with lambda = 2000: base at 19.2 h, an
    aggregate; wide just before contact, a film; and 5 h after it, a plug; and the times of contact."""
    ours, other = (conductivities(*pair) for pair in ((AGGREGATE, PLUG), tuple(map(permeable, (AGGREGATE, PLUG)))))
    changes = {name: 100 * (other[name] / ours[name] - 1) for name in ours}
    checks = (at_most("aggregate, base at 19.2 h: conductivity changes by (%)", "depending on the conditions",
                      abs(changes["aggregate"]), 100 * FEW, f"no difference: {FEW_WORDS}", date=NEW),
              at_least("film, wide before contact: conductivity changes by (%)", "differences", abs(changes["film"]),
                       100 * FEW, FEW_WORDS, date=NEW),
              at_least("plug, wide at 40 h: conductivity changes by (%)", "differences", abs(changes["plug"]),
                       100 * FEW, FEW_WORDS, date=NEW),
              at_most("wide: time of contact changes by (%)", "depending on the conditions", abs(changes["contact"]),
                      100 * FEW, f"no difference: {FEW_WORDS}", date=NEW))
    return Finding(checks, reason="it makes a difference elsewhere", note=lambda: _told(ours, other))


def conductivities(aggregate: tuple[str, ...], plug: tuple[str, ...]) -> dict[str, float]:
    """Conductivities (m/d) of an aggregate, a film and a plug, and the time of contact (h) of the last two."""
    touching = around_contact(*plug)
    return {"aggregate": at(aggregate, PLOTTED)["conductivity_m_per_d"],
            "film": float(touching["conductivity_m_per_d"][0]),
            "plug": float(series(*plug)["conductivity_m_per_d"][-1]), "contact": float(touching["time_h"][1])}


def _told(ours: dict[str, float], other: dict[str, float]) -> str:
    same = conductivities(*(permeable(run, equivalent(run)) for run in (AGGREGATE, PLUG)))
    rows = "; ".join(f"{name} {ours[name]:.3g}, {other[name]:.3g} and {same[name]:.3g} m/d"
                     for name in ("aggregate", "film", "plug"))
    clean = scene(*AGGREGATE).pore.width ** 2 / 12 / PERMEABILITY
    return (f"Conductivity with lambda = 2000, with 1e-15 m2, and with W^2 / (12 lambda), that is "
            f"{1e-12 * equivalent(AGGREGATE):.2g} m2 in base and {1e-12 * equivalent(PLUG):.2g} m2 in wide: {rows}. "
            f"Contact comes at {ours['contact']:.2f}, {other['contact']:.2f} and {same['contact']:.2f} h. With 1e-15 "
            "m2 "
            f"a filled pore of 50 um conducts {clean:.2g} times less than a clean one, where lambda allows 2000 (C17).")
