"""C16, C17: what the aggregate does to the conductivity.

C43: base under its constant head, carried on through contact with the opposite wall to a hundredth of its velocity.

The paper's own run of base ends at 19.4 h; what it says of clogging that restricts the supply, of where the aggregate
grows once it spans the pore, and of how sharply the conductivity then falls, is judged here where the head is given and
not the velocity.
"""

from dataclasses import replace

import numpy as np

from repro.fem.mesher import generate
from repro.model import biomass
from repro.model.pore import sized
from verification.claims import CLOSED, LATER, Finding, at_least, at_most, claim, near
from verification.claims.growth_pattern import biomass_rates
from verification.claims.levels import ABOUT_WIDE, BESIDE_PAIRS, PAIRED
from verification.claims.runs import (
    WIDE,
    Body,
    Columns,
    around_contact,
    bodies,
    contact_time,
    flow_in,
    load_packaged,
    rows_at,
    series,
)


def clean(scene) -> float:
    """Conductivity of a scene's pore without aggregate, g W^2 / (12 nu), um/h."""
    return scene.flow.gravity * scene.pore.width**2 / (12 * scene.flow.kinematic_viscosity)


@claim("C16", "4, 2.1", "conductivity falls sharply when the aggregate spans the pore", **ABOUT_WIDE)
def spanning() -> Finding:
    """Conductivity of `wide` up to its contact, at it and after it. At contact it is that of the first shape in which a
    film has closed, by whole edges of the outline: it is known to first order in their length, to several percent,
    where the conductivity of later hours is known to less than one."""
    rows, touching = series(*WIDE), around_contact(*WIDE)
    clean_conductivity = 24e-6 * clean(load_packaged(*WIDE))
    time, share = rows["time_h"], rows["conductivity_m_per_d"] / clean_conductivity
    contact = contact_time(*WIDE)
    film, closed = (float(value) / clean_conductivity for value in touching["conductivity_m_per_d"])
    sharp, twice = "falls sharply", "sharper: twice as sharp at least"
    earlier, through, later = (falls(time, share, (film, closed, contact), since) for since in (-10, -5, 0))
    checks = (at_most("K / K_clean at contact", sharp, closed, 0.01, "orders of magnitude: two at least"),
              at_least("fall in the 5 h up to contact (times)", sharp, through, 10, "an order of magnitude"),
              at_least("the same over the fall in the 5 h before", sharp, through / earlier, 2, twice),
              at_least("the same over the fall in the 5 h after", sharp, through / later, 2, twice))
    before = 100 * np.log(film) / np.log(closed)
    change = (f"it falls as the aggregate comes to span the pore, not when it does: of the orders of magnitude lost by "
              f"contact {before:.0f} % are lost while a film is left, K / K_clean being {film:.2g} in the last shape "
              f"with a film and {closed:.2g} in the first without, {film / closed:.1f} times less")
    return Finding(checks, change=change, reason="the fall is not as sharp on every mesh")


def falls(time: np.ndarray, share: np.ndarray, touching: tuple[float, float, float], since: float) -> float:
    """The factor by which K / K_clean, or what goes with it, (n,) at times (h), falls in 5 h, from so long after
    contact (h; before it negative). touching: it with the last film and at contact, and when that is. Geometric between
    rows; at contact itself the second of both counts, as NumPy has it of two values in one place."""
    film, closed, contact = touching
    early = time < contact
    hours = np.concatenate([time[early], [contact, contact], time[~early]]) - contact
    values = np.log(np.concatenate([share[early], [film, closed], share[~early]]))
    first, last = np.exp(np.interp([since, since + 5], hours, values))
    return float(first / last)


@claim("C17", "2.1", "lambda = 2000 allows a permeability reduction of up to 2000 (pore filled over its length)",
       about=CLOSED)
def filled() -> Finding:
    """Clean over filled conductivity, biomass in every triangle of the whole pore, at the default mesh."""
    scene = load_packaged("flow_only")
    half = scene.pore.length / 2
    empty, _ = generate(None, (-half, half), sized(scene))
    full = replace(empty, topology=replace(empty.topology, biomass=~empty.biomass))
    open_, closed = (flow_in(scene, grid).conductivity for grid in (empty, full))
    check = near("reduction of the conductivity (times)", "up to 2000", open_ / closed, scene.flow.viscosity_ratio,
                 0.001 * scene.flow.viscosity_ratio,
                 "exact in the Laplacian form: the problems differ by the factor lambda alone")
    return Finding((check,))


END = 76
#: Base carried on through contact, with rows to END; its run ends later, so that its last rows are of one step.
CLOSING = ("base", f'growth.end="{END + 2} h"', rows_at(*range(2, 72), *np.arange(72.0, END, 0.5), END))
ORDER = "an order of magnitude"


@claim("C43", "1, 4", "as biomass grows, permeability falls, which restricts flow and supply; once the pore is "
       "spanned, growth is on the upgradient side and the conductivity falls sharply: under constant head too",
       fine=PAIRED, beside=BESIDE_PAIRS, date=LATER)
def throttled() -> Finding:
    """Base to 76 h: flow, uptake and growth at the end over their first or largest values; where it grows; decay of
    active biomass over its synthesis; and the fall of the conductivity in the 5 h up to contact, as in C16."""
    rows, last = series(*CLOSING), bodies(CLOSING)[-1]
    velocity, uptake = rows["mean_velocity_m_per_d"], consumed(rows)
    film, closed = around_contact(*CLOSING)["mean_velocity_m_per_d"]
    touched, rate = contact_time(*CLOSING), specific_growth(rows)
    fall = falls(rows["time_h"], velocity, (film, closed, touched), -5)
    tenth = float(np.interp(-0.1, -velocity / velocity[0], rows["time_h"]))
    up, down = biomass_rates(last)
    upgradient, words = 100 * up / (up + down), "restricts"
    checks = (
        at_most("velocity just after contact over that at t = 0", words, closed / velocity[0], 0.1, ORDER),
        at_most(f"acceptor taken up at {END} h over the most ever", words, uptake[-1] / uptake.max(), 0.1, ORDER),
        at_most(f"growth rate of the area, last hours to {END} h over the first 2 h", words, rate[-1] / rate[0], 0.1,
                ORDER),
        at_most(f"decay over synthesis of active biomass at {END} h", "restricts, and does not end it",
                decay_share(last), 1.0, "the active biomass still increases"),
        at_least(f"biomass made upgradient, rate at {END} h (%)", "only upgradient", upgradient, 95, "95 %, as in C12"),
        at_least("fall of the conductivity in the 5 h up to contact (times)", "falls sharply", fall, 10,
                 "an order of magnitude, as in C16"))
    reason = ("flow and supply are restricted long before the pore is spanned: a tenth of the velocity is left at "
              f"{tenth:.1f} h, and from then on the aggregate starves. The last film closes at {touched:.1f} h only, "
              f"and the velocity falls in the 5 h before from {closed * fall:.3g} to {closed:.3g} m/d, of which a "
              f"factor of {film / closed:.2g} is the film that closes at once (2.3.3): the sharp fall of C16 needs the "
              f"velocity to be kept up. Most of the growth, but not all, is upgradient: {upgradient:.0f} %. Decay "
              "never balances it, since (9) lets it go on in proportion to m_A as growth does: where the acceptor is "
              "used up both stop")
    decays = ", ".join(f"{decay_share(aggregate):.2g} at {aggregate.pore.time:g} h"
                       for aggregate in bodies(CLOSING)[::12])
    return Finding(checks, reason=reason, note=f"Decay over synthesis is {decays}.")


def consumed(rows: Columns) -> np.ndarray:
    """(n,) acceptor taken up per time and width of the pore, m/d mg/L: u_ave (10 mg/L - C_effluent)."""
    return rows["mean_velocity_m_per_d"] * (10.0 - rows["effluent_acceptor_mg_per_L"])


def specific_growth(rows: Columns) -> np.ndarray:
    """(n - 1,) mean growth rate (1/h) of the aggregate's area between rows."""
    return np.diff(np.log(rows["aggregate_area_um2"])) / np.diff(rows["time_h"])


def decay_share(aggregate: Body) -> float:
    """Decay over synthesis of active biomass, both terms of (9) over the whole aggregate."""
    pore, solved = aggregate.pore, aggregate.solved
    law = solved.problem.law
    rates = biomass.rates(pore.space, solved.concentrations, law)
    decay = float((pore.active * rates.remains).sum()) / (1 - law.constants.degradable_fraction)
    return decay / (float((pore.active * rates.growth).sum()) + decay)
