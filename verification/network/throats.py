"""Ten throats of the example of a network as whole runs, against the two laws for networks.

A run has the seed of the example, and the same head loss and supplies at every time. Its tables over time keep their
values for a step of the example. Its flow follows from its own shape. The law is the model of the example for one
throat with this history, in steps of 6 min. The example itself takes steps of 2 h.

**The throats.** Of the 80 throats with flow, those that end with A / W^2 over one (THICK) and the others are put in
order of A / W^2 at the end. The ten are four of the first and six of the others, at even distances from the first to
the last in each order.

**The bounds**, which precede the runs, follow from those that the laws state. Let A(t) be the area of a run, and b the
bound of the uptake at the present state. For any shape of the area A the law of resistance states r_least <= r <=
r_most, so that the velocity at the given head loss lies in u(A, r_most) <= u <= u(A, r_least). The uptakes U of the
law rise with u, so those of the run lie between U(A, u_least) / (1 + b) and U(A, u_most) (1 + b). Three facts narrow
them. Water brings no more than u W C. The acceptor exceeds F times the donor by the demand of decay, which is at most
d_c f_d b_decay X_m A. Of the biomass at most (1 - f_d) b_decay t is inert after t hours, which the law of uptake does
not know: it is divided from the lower bound only. The growth of the area,

    dA/dt = (Y U_D - (U_A - F U_D) / d_c) / X_m,

rises with U_D and falls with U_A. Let G_most(A, t) be dA/dt with the largest admitted U_D and the least U_A, and
G_least(A, t) dA/dt with the least U_D and the largest U_A. Then G_least <= dA/dt <= G_most for any shape. By the
comparison theorem for scalar equations the
solutions of dA/dt = G_most and of dA/dt = G_least from the same seed enclose A(t), whatever the signs of dG/dA: the
errors of both laws compound over the growth in them, with its feedback on the flow. PRESET is added to both sides for
the error of the preset `fast`. The bounds of flow and uptake are those of the laws at the two areas.

The resistance law states its bounds for aggregates that grew at 0.5 to 6 m/d with W^2 / 2500 mg/L or more of both
substrates. The example leaves this range where the flow is slow or the supply is used up. `in_range` reports where it
does; the bounds are judged there as well.
"""

from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np

import repro
from repro.network.uptakes import Uptake
from repro.results import M_PER_D
from repro.scene import load_scene
from verification.network.histories import History, rounded

#: A / W^2 at the end that separates the two groups of throats, and the number of throats from each group.
THICK = 1.0
OF_THICK, OF_OTHERS = 4, 6
#: Length of a throat (um).
LENGTH = 600.0
#: nu (m2/s) and g (m/s2) of the example.
VISCOSITY, GRAVITY = 1e-6, 9.81
#: g / (12 nu), m/d per um2 at a slope of 1.
PER_HEAD = GRAVITY / (12 * VISCOSITY) * 86400 * 1e-12
#: Steps of the law in each step of the example.
SUBSTEPS = 20
#: Error of the preset `fast` (README), relative.
PRESET = 0.01
#: Times (h) that are compared.
TIMES = (12.0, 24.0, 36.0, 48.0)
#: Velocities (m/d) and the least supply over W^2 (mg/L/um2) of the shapes behind the law of resistance.
VELOCITIES, LEAST_SUPPLY = (0.5, 6.0), 1 / 2500
#: Sides of the law: the law itself, and its largest and least value.
LAW = 0
MOST, LEAST = 1, -1
#: Number of areas between both bounds at which the other bounds are computed. A larger area takes up more substrate and
#: lets less water pass.
TRIALS = 9
QUANTITIES = ("area_um2", "velocity_m_per_d", "acceptor_pg_per_m_h", "donor_pg_per_m_h")
EXPECTED = Path(__file__).with_name("throats_expected.csv")
#: Digits of EXPECTED.
DIGITS = 6
#: A number, or a number for each of several throats or times.
Values = float | np.ndarray
EXPECTED_COLUMNS = ["throat", "time_h", "in_range", "example_area_um2",
                    *(f"{name}_{part}" for name in QUANTITIES for part in ("law", "least", "most"))]


class Conditions(NamedTuple):
    """Conditions in n throats at a time (h). width: (n,) um; head_loss: (n,) um; supplies: (2, n) mg/L."""

    time: float
    width: np.ndarray
    head_loss: np.ndarray
    supplies: np.ndarray


def chosen(all_throats: list[History]) -> list[History]:
    """The ten throats in the order of their areas at the end, the largest first."""
    ordered = sorted((one for one in all_throats if one.flows), key=lambda one: -one.share)
    thick = [one for one in ordered if one.share > THICK]
    others = ordered[len(thick):]
    return [*evenly(thick, OF_THICK), *evenly(others, OF_OTHERS)]


def evenly(throats: list[History], count: int) -> list[History]:
    """Some throats of a list at even distances, with the first and the last."""
    return [throats[k] for k in np.linspace(0, len(throats) - 1, count).round().astype(int)]


def conditions(throats: list[History], index: int, time: float) -> Conditions:
    """The conditions from a time of the histories on. The direction of the flow does not matter to a half-disc."""
    return Conditions(time, np.array([one.width for one in throats]),
                      np.array([abs(one.head_loss[index]) for one in throats]),
                      np.array([one.supplies[:, index] for one in throats]).T)


def mean_velocity(width: Values, head_loss: Values, resistance: Values) -> Values:
    """m/d in a throat of a width (um) at a head loss (um), with the added resistance r."""
    return PER_HEAD * width**2 * head_loss / (LENGTH + resistance * width)


def resistance(width: Values, head_loss: Values, speed: Values) -> Values:
    """r of a throat with this mean velocity (m/d): the inverse of :func:`mean_velocity`."""
    return (PER_HEAD * width**2 * head_loss / speed - LENGTH) / width


def velocity(area: np.ndarray, at: Conditions, side: int) -> np.ndarray:
    """(n,) m/d by the law of resistance. The largest velocity is that with the least resistance."""
    added = repro.added_resistance(area, at.width)
    return mean_velocity(at.width, at.head_loss, {LAW: added.length, MOST: added.least, LEAST: added.most}[side])


class Taken(NamedTuple):
    """Uptakes of n throats. acceptor, donor: (n,) pg/m/h; growth: (n,) um2/h."""

    acceptor: np.ndarray
    donor: np.ndarray
    growth: np.ndarray


def uptake(area: np.ndarray, at: Conditions, side: int) -> Taken:
    """Uptakes and growth by the law, or their bounds for any aggregate of this area."""
    speed = velocity(area, at, side)
    law = repro.uptake(area, at.width, speed, *at.supplies)
    if side == LAW:
        return Taken(law.acceptor, law.donor, law.growth)
    inflow = speed / M_PER_D * at.width * at.supplies
    return (_most if side == MOST else _least)(area, at.time, law, inflow)


def _most(area: np.ndarray, time: float, law: Uptake, inflow: np.ndarray) -> Taken:
    ratio = KINETICS.acceptor_to_donor_ratio
    acceptor = np.minimum((1 + law.bound) * law.acceptor, inflow[0])
    donor = np.minimum(np.minimum((1 + law.bound) * law.donor, inflow[1]), acceptor / ratio)
    least_acceptor = np.maximum(law.acceptor / (1 + law.bound), ratio * donor)
    return Taken(acceptor, donor, growth(least_acceptor, donor))


def _least(area: np.ndarray, time: float, law: Uptake, inflow: np.ndarray) -> Taken:
    inert = (1 - KINETICS.degradable_fraction) * KINETICS.decay_coefficient * time
    acceptor, donor = ((1 - inert) / (1 + law.bound) * part for part in (law.acceptor, law.donor))
    need = KINETICS.acceptor_to_donor_ratio * donor
    decay = KINETICS.degradable_fraction * KINETICS.decay_coefficient * KINETICS.maximum_density * area
    most_acceptor = np.minimum(np.minimum((1 + law.bound) * law.acceptor, inflow[0]),
                               need + KINETICS.decay_oxygen_demand * decay)
    return Taken(acceptor, donor, growth(most_acceptor, donor))


def growth(acceptor: np.ndarray, donor: np.ndarray) -> np.ndarray:
    """(n,) um2/h, by (9) and (10)."""
    decayed = (acceptor - KINETICS.acceptor_to_donor_ratio * donor) / KINETICS.decay_oxygen_demand
    return (KINETICS.yield_coefficient * donor - decayed) / KINETICS.maximum_density


KINETICS = load_scene("base").kinetics


def areas(throats: list[History], side: int, substeps: int = SUBSTEPS) -> np.ndarray:
    """(n, m) um2 at the times of the histories, by the law or on a side of its bounds; the midpoint rule."""
    times = throats[0].time
    reached = [np.array([one.area[0] for one in throats])]
    for index, (start, end) in enumerate(zip(times, times[1:])):
        step, area = (end - start) / substeps, reached[-1]
        for k in range(substeps):
            at = conditions(throats, index, start + (k + 1) * step)
            area = _midpoint(area, step, lambda trial, at=at: uptake(trial, at, side).growth)
        reached.append(area)
    return np.array(reached).T


def _midpoint(area: np.ndarray, step: float, rate: Callable[[np.ndarray], np.ndarray]) -> np.ndarray:
    middle = np.maximum(area + 0.5 * step * rate(area), 0.0)
    return np.maximum(area + step * rate(middle), 0.0)


def expected(throats: list[History]) -> list[list]:
    """Rows of EXPECTED: the law and its bounds at TIMES."""
    lines = []
    for time, of_time in zip(TIMES, at_times(throats)):
        for k, one in enumerate(throats):
            area = float(one.area[np.searchsorted(one.time, time)])
            bounds = [rounded(value, DIGITS) for value in of_time[:, k].ravel()]
            lines.append([one.number, time, int(in_range(one, time)), area, *bounds])
    return lines


def at_times(throats: list[History]) -> np.ndarray:
    """(times, quantities, n, 3) the law, its least and its most value at TIMES."""
    reached = np.array([areas(throats, side) for side in (LAW, LEAST, MOST)])
    indices = np.searchsorted(throats[0].time, TIMES)
    return np.array([values(reached[:, :, index], conditions(throats, index, time))
                     for index, time in zip(indices, TIMES)])


def values(area: np.ndarray, at: Conditions) -> np.ndarray:
    """(quantities, n, 3) the law, its least and its most value, from the areas (3, n) of these sides."""
    low, high = (1 - PRESET) * area[1], (1 + PRESET) * area[2]
    trials = np.linspace(low, high, TRIALS)
    law = np.array(quantities(area[0], at, LAW))
    least = np.min([quantities(trial, at, LEAST) for trial in trials], axis=0)
    most = np.max([quantities(trial, at, MOST) for trial in trials], axis=0)
    least[1:] *= 1 - PRESET
    most[1:] *= 1 + PRESET
    return np.stack([law, least, most], axis=-1)


def quantities(area: np.ndarray, at: Conditions, side: int) -> tuple[np.ndarray, ...]:
    """(n,) each of QUANTITIES for aggregates of an area, by the law or on a side of its bounds."""
    taken = uptake(area, at, side)
    return area, velocity(area, at, side), taken.acceptor, taken.donor


def in_range(one: History, time: float) -> bool:
    """Whether the conditions up to a time are within those of the shapes behind the law of resistance."""
    until = one.time <= time
    added = repro.added_resistance(one.area[until], one.width)
    speed = mean_velocity(one.width, np.abs(one.head_loss[until]), added.length)
    supplied = (one.supplies[:, until] >= LEAST_SUPPLY * one.width**2).all()
    return bool(supplied and (speed >= VELOCITIES[0]).all() and (speed <= VELOCITIES[1]).all())
