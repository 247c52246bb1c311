"""Hard cases of the substrates: starved pores, an exhausted substrate, fronts of zero order, kinetics saturated."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np

from reference import slab
from repro.model import transport
from repro.model.kinetics import Sink
from verification import meshes
from verification.case import Check, at_least, at_most, between
from verification.hard import common
from verification.hard.common import EFFLUENTS, FIXED, HardCase, Run

BOTH = ("acceptor", "donor")


def supply(acceptor: float, donor: float) -> tuple[str, str]:
    """Supplies, mg/L."""
    return tuple(f'substrates.{name}.supply="{value} mg/L"' for name, value in zip(BOTH, (acceptor, donor)))


def disc(radius: float, *changes: str) -> tuple[str, ...]:
    """A half-disc (um) that does not grow, in the wide pore."""
    return (*FIXED, f'aggregate.radius="{radius} um"', *changes)


SLOW = 'flow.mean_velocity="0.35 m/day"'


def same_root(found: Run) -> list[Check]:
    """Newton's method must come to one solution from above, from zero and from far below zero, where the law of Monod
    has its spurious roots."""
    state, apart = found.instants[-1].solved.concentrations, 0.0
    both = found.scene.substrates
    for part in (0.0, 1.0, -7.6):
        other = common.steady(found, part * both.acceptor.supply, part * both.donor.supply)
        for name in BOTH:
            size = getattr(both, name).supply
            apart = max(apart, np.abs(getattr(other, name) - getattr(state, name)).max() / size)
    return [at_most("largest difference of C over the supply, from four starts", apart, 1e-6,
                    "uptake is monotone: one solution; Newton's tolerance, times the system's condition")]


def starved(*changes: str):
    """A part: a starved half-disc."""
    def part(preset: str) -> list:
        found, fine = common.run("wide", preset, *changes), common.reference("wide", *changes)
        return [found, *common.close(found, fine, preset, *EFFLUENTS), *same_root(found)]
    return part


STARVED = HardCase(
    1, "starved", "Starved pore",
    "One solution from every start, nowhere under zero, with the effluents of a finer run",
    "A negative root of the Monod terms (C_A = -76 mg/L with a closed balance was seen)",
    {"0.35 m/d, R = 27 um": starved(*disc(27, SLOW, 'pore.width="50 um"')),
     "0.35 m/d, R = 42 um": starved(*disc(42, SLOW, 'pore.width="50 um"')),
     "supply 0.15 mg/L": starved(*disc(40, *supply(0.15, 0.15))),
     "supply 0.02 K_s": starved(*disc(40, *supply(0.02, 0.02)))},
    mutants=("hard-newton-too-soon",))


def exhausted(preset: str, scarce: str) -> list:
    """One substrate at 10 mg/L, the other at 1000 mg/L; then that at 1e6 mg/L."""
    changes = disc(80, SLOW)
    given = {name: 10.0 if name == scarce else 1000.0 for name in BOTH}
    found = common.run("wide", preset, *changes, *supply(*given.values()))
    plenty = [1e6 if value == 1000.0 else value for value in given.values()]
    more = common.run("wide", preset, *changes, *supply(*plenty))
    column = f"effluent_{scarce}_mg_per_L"
    return [found, *_stoichiometry(found),
            at_most(f"least {scarce} over its supply", found.last[f"{scarce}_min_mg_per_L"] / 10, 0.02,
                    "else less is tested"),
            at_most(f"{column}: 1000 mg/L of the other for 1e6, over the supply",
                    abs(found.last[column] - more.last[column]) / 10, 2e-3,
                    "the other's m is 0.997 or more: uptake changes by less, and so does what leaves")]


def _stoichiometry(found: Run) -> list[Check]:
    """(7) less F times (8) is what decay takes, d_c f_d b X m_A, whatever the concentrations."""
    law, both = found.scene.kinetics, found.scene.substrates
    acceptor, donor = (flux.consumed for flux in found.instants[-1].solved.fluxes)
    decay = law.decay_oxygen_demand * law.degradable_fraction * law.decay_coefficient * law.maximum_density
    decay *= found.last["aggregate_area_um2"]
    C = found.instants[-1].solved.concentrations.acceptor
    ends = np.array([max(C.min(), 0.0), C.max()])
    m = ends / (ends + both.acceptor.half_saturation)
    low, high = (acceptor - decay * m[::-1]) / (law.acceptor_to_donor_ratio * donor)
    return [between("acceptor taken up for decay, over what m_A = 1 would take",
                    (acceptor - law.acceptor_to_donor_ratio * donor) / decay, m[0] * (1 - 1e-9), m[1] * (1 + 1e-9),
                    "its mean m_A lies between those of the least and the largest C_A"),
            between("F times donor, over acceptor less decay's share", 1.0, low, high, "as above")]


EXHAUSTED = HardCase(
    2, "exhausted", "One substrate exhausted, the other in excess",
    "Uptake in the ratio of (7) and (8), and no change of what leaves when the excess is a thousandfold",
    "Uptake of what is not there, or a substrate in excess that is clipped or overshoots",
    {f"{scarce} exhausted": partial(exhausted, scarce=scarce) for scarce in BOTH},
    mutants=("hard-decay-unlimited",))


def front(radius: float, *more: str):
    """A part: half saturations of a millionth of the supply."""
    def part(preset: str) -> list:
        changes = disc(radius, *(f'substrates.{name}.half_saturation="1e-5 mg/L"' for name in BOTH), *more)
        found = common.run("wide", preset, *changes)
        fine = common.reference("wide", *changes, refinement=0.8)
        return [found, *common.close(found, fine, preset, *EFFLUENTS)]
    return part


#: Half thickness and films of the slab, um; its penetration depth over the half thickness.
HALF, FILM, DEPTH = 40.0, 20.0, 0.6


def slab_front(preset: str) -> list:
    """The stage alone: a slab between films of still water, in which the donor is used up at 0.6 of the way in."""
    size, bound, origin = FRONT[preset]
    end, width = HALF + FILM, 1.5 * size
    grid = meshes.channel((-end, end), width, size, lambda x, y: np.abs(x) < HALF, across=(-HALF, HALF), seed=1)
    made = common.scene("wide", preset)
    donor = replace(made.substrates.donor, half_saturation=1e-6 * made.substrates.donor.supply)
    acceptor = replace(made.substrates.acceptor, half_saturation=1e-6 * made.substrates.acceptor.supply)
    depth, ratio = DEPTH * HALF, donor.diffusivity_in_aggregate / donor.diffusivity
    sink = donor.supply * donor.diffusivity_in_aggregate / (depth**2 / 2 + FILM * ratio * depth)
    law = replace(made.kinetics, decay_coefficient=0.0, acceptor_to_donor_ratio=1e-9)
    space = common.space_on(grid, made)
    problem = transport.problem(space, None, replace(made.substrates, acceptor=acceptor, donor=donor), law)
    active = Sink(sink / law.maximum_utilization_rate * space.reaction.dx)
    state = transport.steady(problem, active)
    given = (donor.supply, sink, HALF, donor.diffusivity_in_aggregate, FILM, donor.diffusivity)
    exact = slab.zero_order(space.points[:, 0], *given)
    entering = transport.fluxes(problem, active, state)[1].consumed / (2 * width * sink)
    return [at_most("C_D over the supply, largest error at a node", np.abs(state.donor - exact).max() / donor.supply,
                    bound, origin),
            at_most("depth of the front, over that of the closed form", abs(entering / depth - 1), bound, origin),
            at_least("least C_D over the supply", state.donor.min() / donor.supply, common.LOWEST, "UNRESOLVED")]


#: Size of the elements, um; bound; its origin. Behind the front C'' jumps from s / D to zero, so that whatever the
#: order an element is off by s h^2 / (8 D) at the most.
FRONT = {preset: (size, size**2 / 8 / (DEPTH**2 * HALF**2 / 2 + FILM * DEPTH * HALF * 0.8),
                  "the jump of C'' at the front: s h^2 / (8 D_B)")
         for preset, size in (("paper", 6.0), ("fast", 12.0), ("accurate", 5.0), ("cubic", 12.0))}
ZERO_ORDER = HardCase(
    3, "zero-order", "Half saturations of a millionth of the supply: fronts of zero order",
    "The closed form of zero-order uptake in a slab, and the effluents of a finer run around half-discs",
    "Newton's method that cycles at the front, or concentrations under zero behind it",
    {"slab": slab_front, "R = 60 um": front(60), "R = 80 um": front(80), "0.35 m/d, R = 40 um": front(40, SLOW)},
    refusable=("slab",),
    mutants=("hard-front-smoothed", "hard-newton-unshortened"))


def saturated(preset: str) -> list:
    """Base with a supply of 1000 K_s: m is one to a few parts in a thousand, growth exponential."""
    found = common.run("base", preset, *supply(1000, 1000), 'growth.time_step="0.5 h"', 'output.times=["6 h", "12 h"]',
                       'growth.end="12 h"')
    return [found, *exponential(found)]


def exponential(found: Run) -> list[Check]:
    """Biomass over that at the start against (9)-(10) at the supply, and at the least concentrations of the run."""
    law, both = found.scene.kinetics, found.scene.substrates
    time = found.last["time_h"]

    def rates(acceptor, donor):
        m_a, m_d = acceptor / (acceptor + both.acceptor.half_saturation), donor / (donor + both.donor.half_saturation)
        return (m_a * (law.maximum_utilization_rate * law.yield_coefficient * m_d - law.decay_coefficient),
                m_a * law.decay_coefficient * (1 - law.degradable_fraction))

    rise, left = rates(both.acceptor.supply, both.donor.supply)
    least, _ = rates(*(min(line[f"{name}_min_mg_per_L"] for line in found.rows) for name in BOTH))
    most = np.exp(rise * time) + left / rise * np.expm1(rise * time)
    grown = found.last["aggregate_area_um2"] / found.rows[0]["aggregate_area_um2"]
    return [between("area over that of the seed", grown, np.exp(least * time), most,
                    "rates at the least C of the run, and at the supply")]


SATURATED = HardCase(
    21, "saturated", "Supply of 1000 K_s",
    "Growth between the exponentials at the least concentration and at the supply, 0.3 % apart in their rates",
    "A balance that no longer closes, as uptake is a small part of what passes", {"base": saturated},
    mutants=("decay-leaves-all",))

CASES = (STARVED, EXHAUSTED, ZERO_ORDER, SATURATED)
