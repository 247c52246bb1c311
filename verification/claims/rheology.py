"""C41: the effect of the rheology and of the conditions of contact that the paper chose. The alternatives are
stress-free new biomass (5), other fixed points, and film and contact angle halved and doubled (2.3.3).

The paper calls its rheology open to argument and expects no substantial effect on its conclusions. It calls the
boundary conditions debatable and reasonable. Its conclusions are an outline as in Figure 6, contact after a day and a
half, and a conductivity that falls at contact. Each choice is changed alone in wide, in which all of them have an
effect.

Outlines are compared where they lie, and moved along the pore onto each other. Only its fixed points keep an aggregate
in place: if they are rechosen, it slides. The distance has no limit as the mesh is refined. A fixed point is the node
nearest to the middle of a contact surface, and the elements there are 5 to 24 um long. Two points support an elastic
plane, and the force at each vanishes as one over the logarithm of the element size, so the meshes around both determine
the slide.
The conductivity is a mean over the hours after contact. A contact surface grows by entire edges, so single rows jump by
several percent, at other times in each run.

C42: a permeable body, with Brinkman's drag, in place of the pseudoviscosity: aggregate, film and plug.

Section 5 calls the raised viscosity artificial, names a porous material as another approach, says that it may make a
difference depending on the conditions, and does not evaluate it. Runs from the seed on compare both laws. A filled pore
has the conductivity K_clean / lambda with the raised viscosity, and K_clean 12 k / W^2 with the permeability k. lambda
= 2000 is therefore a permeability of W^2 / (12 lambda). It is no property of the biomass, because it goes as the square
of the pore's width.
"""

import numpy as np
from shapely.affinity import translate

from verification.claims import (
    FEW,
    FEW_WORDS,
    TRANSPORT,
    TRANSPORT_WORDS,
    Finding,
    PaperCheck,
    at_least,
    at_most,
    claim,
    without_limit,
)
from verification.claims.levels import COMPARED, MANY
from verification.claims.runs import (
    AFTER,
    BASE,
    PLOTTED,
    RECHOSEN,
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
#: One choice each, in words and as changes of the scene.
VARIANTS = {
    "born stress-free": STRESS_FREE,
    "middles rechosen": RECHOSEN,
    "film halved": 'growth.minimum_film="1 um"',
    "film doubled": 'growth.minimum_film="4 um"',
    "angle halved": 'growth.minimum_contact_angle="8.35 deg"',
    "angle doubled": 'growth.minimum_contact_angle="33.4 deg"'}


@claim("C41", "5, 2.3.3", "another rheology, and other conditions where the aggregate meets the walls, are unlikely to "
       "affect the conclusions substantially", fine=MANY, beside=(), date="2026-11-22 14:59")
def other_rheology() -> Finding:
    """Wide with one choice changed at a time: area that only one of the two outlines covers at 40 h, where they lie and
    moved onto each other along the pore; shift of the time of contact; and change of the conductivity after it, in the
    first hour and in the mean."""
    checks = tuple(check for name, change in VARIANTS.items() for check in _changes(name, (*WIDE_TO_END, change)))
    worst = "; ".join(f"{check.quantity} {check.value:.3g}" for check in checks if not check.holds)
    shift = outline_shift((*WIDE_TO_END, RECHOSEN))[0]
    note = (f"The fixed points alone keep an aggregate in place: with rechosen middles it slides {shift:.1f} um "
            "downstream while it grows upstream, which has no limit as the mesh is refined. The least angle determines "
            "how much of the narrow wedges beside the contact is filled. The paper expects no effect of the rheology, "
            "and calls the conditions at the walls debatable and reasonable.")
    return Finding(checks, note=note,
                   reason=f"changes by more than a few percent: {worst or 'none, but a bar reaches over the bound'}")


def _changes(name: str, run: Run) -> tuple[PaperCheck, ...]:
    """What a variant of WIDE_TO_END changes."""
    _, in_place, moved = outline_shift(run)
    changes = {f"outlines moved onto each other at {END} h (% of the area)": moved,
               f"outlines where they lie at {END} h (% of the area)": in_place,
               "time of contact (%)": 100 * (contact_time(*run) / contact_time(*WIDE_TO_END) - 1),
               f"conductivity, mean of {AFTER[0]:g} to {AFTER[-1]:g} h (%)": conductivity_change(run),
               f"conductivity at {AFTER[0]:g} h (%)": conductivity_change(run, AFTER[:1])}
    return tuple(without_limit(at_most(f"{name}: {quantity}", "not substantially", abs(change), 100 * FEW, FEW_WORDS))
                 for quantity, change in changes.items())


def outline_shift(run: Run, hour: float = END, plain: Run = WIDE_TO_END) -> tuple[float, float, float]:
    """Compare the outline of a run at an hour with that of a plain run: the shift (um) of its centroid downstream, and
    the area that only one of both covers (%), before and after the shift is removed."""
    default, variant = (polygon(body(chosen, hour).outline) for chosen in (plain, run))
    moved = variant.centroid.x - default.centroid.x
    return moved, uncovered(default, variant), uncovered(default, translate(variant, -moved))


def conductivity_change(run: Run, hours: tuple[float, ...] = AFTER, plain: Run = WIDE_TO_END) -> float:
    """Geometric mean of the conductivity in rows at some hours, against that of a plain run, in percent."""
    key = "conductivity_m_per_d"
    return 100 * float(np.exp(np.mean([np.log(at(run, hour)[key] / at(plain, hour)[key]) for hour in hours])) - 1)


#: Of dense biomass, um2.
PERMEABILITY = 1e-3
#: Wide until its plug is 5 h old.
PLUG = ("wide", *until(END))
#: lambda of Table 1.
LAMBDA = 2000


def permeable(run: Run, permeability: float) -> Run:
    """A run with Brinkman's drag of a permeability (um2) and without the pseudoviscosity."""
    return (*run, f'flow.permeability="{permeability!r} um^2"')


def as_permeable(run: Run, width: float) -> Run:
    """A permeable run in a pore of a width (um): a filled pore conducts as much as with the raised viscosity."""
    return permeable(run, width**2 / (12 * LAMBDA))


@claim("C42", "5", "a porous material instead of a raised viscosity may lead to differences, depending on the "
                   "conditions", fine=COMPARED, beside=(), date="2026-11-29 23:14")
def drag_or_viscosity() -> Finding:
    """Conductivity with Brinkman's drag against that with lambda = 2000: base at 19.2 h, an aggregate; wide just before
    contact, a film; and 5 h after it, a plug. The permeability W^2 / (12 lambda) gives a filled pore the same
    conductivity. "May": one scene is enough. Here the drag acts on the flow alone, and in C53 on the shape, too. The
    note has the conductivities with 1e-15 m2. Those of wide were known from a figure when it was judged."""
    viscous = conductivities(BASE, WIDE_TO_END)
    alike = conductivities(as_permeable(BASE, 50.0), as_permeable(PLUG, 100.0))
    changes = {name: 100 * (alike[name] / viscous[name] - 1) for name in viscous}
    check = at_least("conductivity with the drag of a permeability W^2 / (12 lambda), changed, the most of three "
                     "states (%)", "may lead to differences", max(map(abs, changes.values())), 100 * TRANSPORT,
                     TRANSPORT_WORDS)
    listed = ", ".join(f"{name} {change:+.2g} %" for name, change in changes.items())
    return Finding((check,), change="the permeability W^2 / (12 lambda) is not the paper's",
                   reason="no conductivity differs by more than the paper's accuracy",
                   note=lambda: f"Changes: {listed}. {_less_permeable(viscous)}")


def _less_permeable(viscous: dict[str, float]) -> str:
    """Describe the conductivities with PERMEABILITY."""
    less = conductivities(permeable(BASE, PERMEABILITY), permeable(PLUG, PERMEABILITY))
    rows = "; ".join(f"{name} {viscous[name]:.3g} and {less[name]:.3g} m/d" for name in viscous)
    return f"Conductivity with lambda = 2000 and with 1e-15 m2: {rows}."


def conductivities(aggregate: Run, plug: Run) -> dict[str, float]:
    """Conductivities (m/d) of an aggregate, a film and a plug."""
    return {"aggregate": at(aggregate, PLOTTED)["conductivity_m_per_d"],
            "film": float(around_contact(*plug)["conductivity_m_per_d"][0]),
            "plug": at(plug, END)["conductivity_m_per_d"]}
