"""C43: base under its constant head, carried on through contact with the opposite wall to a hundredth of its velocity.

The paper's own run of base ends at 19.4 h; what it says of clogging that restricts the supply, of where the aggregate
grows once it spans the pore, and of how sharply the conductivity then falls, is judged here where the head is given and
not the velocity.
"""

from __future__ import annotations

import numpy as np

from repro.model import biomass
from verification.claims import Finding, at_least, at_most, claim
from verification.claims.growth_pattern import growth_rates, made
from verification.claims.levels import BESIDE_PAIRED, PAIRED
from verification.claims.restored import Body, bodies
from verification.claims.runs import WIDE, around_contact, series

END = 76
HOURS = (*range(2, 73), 72.5, 73, 73.5, 74, 74.5, 75, 75.5, END)
#: Base carried on through contact.
CLOSING = ("base", f'growth.end="{END} h"',
           "output.times=[" + ", ".join(f'"{hour} h"' for hour in dict.fromkeys(HOURS)) + "]")
NEW = "2026-11-22"
ORDER = "an order of magnitude"


@claim("C43", "1, 4", "as biomass grows, permeability falls, which restricts flow and supply; once the pore is "
                      "spanned, "
       "growth is on the upgradient side and the conductivity falls sharply: under constant head too", fine=PAIRED,
       beside=BESIDE_PAIRED)
def throttled() -> Finding:
    """Base to 76 h: flow, uptake and growth at the end over their first or largest values; where it grows; decay of
    active biomass over its synthesis; and the fall of the conductivity in the 5 h up to contact, as in C16."""
    rows, last = series(*CLOSING), bodies(CLOSING)[-1]
    velocity, uptake = rows["mean_velocity_m_per_d"], consumed(rows)
    rate = specific_growth(rows)
    up, down = made(last, growth_rates(last.pore, last.solved))
    words, upgradient = "restricts", "only upgradient"
    checks = (
        at_most("velocity just after contact over that at t = 0", words, contact()[1] / velocity[0], 0.1, ORDER,
                date=NEW),
        at_most(f"acceptor taken up at {END} h over the most ever", words, uptake[-1] / uptake.max(), 0.1, ORDER,
                date=NEW),
        at_most(f"growth rate of the area, last hours to {END} h over the first 2 h", words, rate[-1] / rate[0], 0.1,
                ORDER, date=NEW),
        at_most(f"decay over synthesis of active biomass at {END} h", "restricts, and does not end it",
                decay_share(last), 1.0, "the active biomass still increases", date=NEW),
        at_least(f"biomass made upgradient, rate at {END} h (%)", upgradient, 100 * up / (up + down), 95,
                 "95 %, as in C12", date=NEW),
        at_least("fall of the conductivity in the 5 h up to contact (times)", "falls sharply", fall(), 10,
                 "an order of magnitude, as in C16", date=NEW))
    return Finding(checks, reason=_reason(rows, 100 * up / (up + down)), note=lambda: _told(rows))


def contact() -> tuple[float, float, float]:
    """Velocity (m/d) of the last shape with a film and of the first in contact, and when that is (h)."""
    found = around_contact(*CLOSING)
    before, after = found["mean_velocity_m_per_d"]
    return float(before), float(after), float(found["time_h"][1])


def consumed(rows: dict[str, np.ndarray], supply: float = 10.0) -> np.ndarray:
    """(n,) acceptor taken up per time and width of the pore, m/d mg/L: u_ave (C_supply - C_effluent)."""
    return rows["mean_velocity_m_per_d"] * (supply - rows["effluent_acceptor_mg_per_L"])


def specific_growth(rows: dict[str, np.ndarray]) -> np.ndarray:
    """(n - 1,) mean growth rate (1/h) of the aggregate's area between rows."""
    return np.diff(np.log(rows["aggregate_area_um2"])) / np.diff(rows["time_h"])


def decay_share(found: Body) -> float:
    """Decay over synthesis of active biomass, both terms of (9) over the whole aggregate."""
    now, solved = found.pore, found.solved
    kinetics = solved.problem.kinetics
    rates = biomass.rates(now.space, solved.concentrations, solved.problem.substrates, kinetics)
    decay = float((now.active * rates.remains).sum()) / (1 - kinetics.degradable_fraction)
    return decay / (float((now.active * rates.growth).sum()) + decay)


def fall() -> float:
    """How many times the conductivity, under constant head the velocity, falls in the 5 h up to contact."""
    rows, (_, closed, touched) = series(*CLOSING), contact()
    early = rows["time_h"] < touched
    before = np.interp(touched - 5.0, rows["time_h"][early], np.log(rows["mean_velocity_m_per_d"][early]))
    return float(np.exp(before) / closed)


def fastest(rows: dict[str, np.ndarray]) -> tuple[float, float]:
    """Largest rate of decline of the conductivity (1/h) between rows, and the middle of that time (h)."""
    time, share = rows["time_h"], np.log(rows["conductivity_m_per_d"])
    rates = -np.diff(share) / np.diff(time)
    worst = int(rates.argmax())
    return float(rates[worst]), float(0.5 * (time[worst] + time[worst + 1]))


def _reason(rows: dict[str, np.ndarray], upgradient: float) -> str:
    film, closed, touched = contact()
    share = rows["mean_velocity_m_per_d"] / rows["mean_velocity_m_per_d"][0]
    tenth = float(np.interp(-0.1, -share, rows["time_h"]))
    return (f"flow and supply are restricted long before the pore is spanned: a tenth of the velocity is left at "
            f"{tenth:.1f} h, and from then on the aggregate starves. The last film closes at {touched:.1f} h only, "
            "and the "
            f"velocity falls in the 5 h before from {closed * fall():.3g} to {closed:.3g} m/d, of which a factor of "
            f"{film / closed:.2g} is the film that closes at once (2.3.3): the sharp fall of C16 needs the velocity to "
            f"be kept up. Most of the growth, but not all, is upgradient: {upgradient:.0f} %. Decay never balances it, "
            "since (9) lets it go on in proportion to m_A as growth does: where the acceptor is used up both stop")


def _told(rows: dict[str, np.ndarray]) -> str:
    _, closed, touched = contact()
    before, free = rows["time_h"] < touched, series(*WIDE)
    rate, when = fastest({name: column[before] for name, column in rows.items()})
    wide_rate, wide_when = fastest(free)
    hundredth = 100 * closed / rows["mean_velocity_m_per_d"][0]
    return (f"The velocity after contact, at {touched:.1f} h, is {hundredth:.2g} % of the first. Until contact the "
            f"conductivity declines at {rate:.2g} 1/h at most, at {when:.3g} h; in wide, at constant velocity, at "
            f"{wide_rate:.2g} 1/h, at {wide_when:.3g} h. Decay over synthesis is "
            + ", ".join(f"{decay_share(found):.2g} at {found.pore.time:g} h" for found in bodies(CLOSING)[::12]) + ".")
