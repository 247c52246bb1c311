"""Defects of the balances of a step, and which of them end the run.

Defects are relative. A positive one means that too much was supplied or made. Where the amounts
themselves are of the size of round-off, the defect is relative to a floor instead: the amount of
which round-off is the part LARGEST. Apart from the stated exceptions of :func:`refuse`, a step
closes to round-off; any other defect is an error of the code or of its use.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from repro.errors import BalanceError
from repro.model.pore import Pore
from repro.model.transport import Problem
from repro.model.uptake_law import uptake_law
from repro.scene import Kinetics, Scene, needed

if TYPE_CHECKING:
    from repro.march.loop import Ledger

#: Largest defect that is accepted.
LARGEST = 1e-6
#: Of the oxygen demand with Gear's method, which takes growth and uptake by formulas of their own,
#: over what the biomass could turn over in the step.
GEAR = 1e-3
#: Relative to a mass, a bound of the round-off in the difference of two. Pairwise summation in
#: blocks of 128 in 8 lanes errs by (16 + log2(n / 128)) eps at most, less than 40 eps for any mesh;
#: a difference has two sums of X_A and two of X_I, and so up to 4e-14.
ROUND_OFF = 1e-13


def defect(supplied: float, out: float, consumed: float, stored: float = 0.0,
           room: float = 0.0) -> float:
    """(in - out - consumed - stored) over the largest of what comes in, what is consumed, and
    ``room``; zero where that is zero."""
    scale = max(abs(supplied), consumed, room)
    return (supplied - out - consumed - stored) / scale if scale else 0.0


def floor(problem: Problem, k: int, supply: float) -> float:
    """The flux (um2 mg/L/h) of which round-off is the part LARGEST, of the acceptor (k = 0) or the
    donor (1): eps over LARGEST of the sum of the sizes of all terms of its equations, at a supply
    (mg/L)."""
    n = problem.space.count
    own = problem.magnitude.data[slice(*problem.magnitude.indptr[[k * n, k * n + n]])]
    return float(np.finfo(float).eps / LARGEST * supply * own.sum())


def substrate(ledger: Ledger, k: int, room: float = 0.0) -> float:
    """Of the acceptor (k = 0) or the donor (1)."""
    return defect(ledger.supplied[k], ledger.out[k], ledger.consumed[k], ledger.stored[k], room)


def biomass(ledger: Ledger) -> float:
    """After less before less made, over after."""
    lacking = ledger.biomass_after - ledger.biomass_before - ledger.biomass_made
    return lacking / ledger.biomass_after


def demand_terms(kinetics: Kinetics, ledger: Ledger) -> tuple[float, float]:
    """Y donor, and (acceptor - F donor) / d_c, of what was consumed (7)-(10): what the donor makes
    and what decays, um2 mg/L."""
    acceptor, donor = ledger.consumed
    return (kinetics.yield_coefficient * donor,
            (acceptor - kinetics.acceptor_to_donor_ratio * donor) / kinetics.decay_oxygen_demand)


def demand_scale(kinetics: Kinetics, ledger: Ledger) -> float:
    """The larger of :func:`demand_terms`, um2 mg/L; at least the amount of which the round-off of a
    difference of two masses is the part LARGEST."""
    floor = ROUND_OFF / LARGEST * ledger.biomass_before
    return max(*map(abs, demand_terms(kinetics, ledger)), floor)


def oxygen_demand(kinetics: Kinetics, ledger: Ledger) -> float:
    """(made - grown + decayed) / :func:`demand_scale`."""
    grown, decayed = demand_terms(kinetics, ledger)
    return (ledger.biomass_made - grown + decayed) / demand_scale(kinetics, ledger)


def refuse(scene: Scene, after: Pore, ledger: Ledger) -> None:
    """Raises BalanceError where a step that ends in ``after`` lacks more than LARGEST.

    But for stated defects, which are shown as they are: substrates with numerics.inlet = "mean"
    [E4], biomass with numerics.transfer = "linear" [E8], and the oxygen demand in the paper's
    updates, see :func:`accepted_demand`.
    """
    numerics = scene.numerics
    defects = {}
    if numerics.inlet != "mean":
        for k, name in enumerate(("acceptor", "donor")):
            defects[name] = substrate(ledger, k, _exchanged(scene, after, ledger, k))
    if numerics.transfer != "linear":
        defects["biomass"] = biomass(ledger)
    wrong = {name: part for name, part in defects.items() if not abs(part) <= LARGEST}
    kinetics = needed(scene.kinetics, "[kinetics]")
    demand = oxygen_demand(kinetics, ledger)
    if not abs(demand) <= accepted_demand(scene, ledger):
        wrong["oxygen demand"] = demand
    if wrong:
        told = ", ".join(f"{part:.2g} of the {name}" for name, part in wrong.items())
        first, last = after.mesh.ends
        raise BalanceError(f"the step to t = {ledger.end:g} h does not balance between x = "
                           f"{first:.4g} and {last:.4g} um: it lacks {told}; try a shorter "
                           "growth.time_step or a larger numerics.refinement, and report it")


def accepted_demand(scene: Scene, ledger: Ledger) -> float:
    """The largest defect of the oxygen demand that is accepted of a step.

    The midpoint rule closes to round-off. In the paper's updates the trapezoidal rule errs by (dt
    times the fastest rate, k Y + b)^2 / 12 of what is turned over, 1e-3 in a step of base, where
    2e-4 at most is measured (of 132 random scenes the worst came to a tenth of it). Gear's method
    controls concentrations to GEAR of the supply, and m(C) then errs by GEAR supply / K
    at most, where a substrate runs out. The accepted defect is that part of what the biomass could
    turn over at the fastest rate, GEAR at least (measured away from exhaustion: 4e-4 at most).
    """
    if scene.numerics.time == "midpoint":
        return LARGEST
    kinetics = needed(scene.kinetics, "[kinetics]")
    scale = demand_scale(kinetics, ledger)
    fastest = (kinetics.maximum_utilization_rate * kinetics.yield_coefficient
               + kinetics.decay_coefficient)
    part = fastest * (ledger.end - ledger.start)
    if scene.numerics.transport == "gear":
        return LARGEST + GEAR * _steepness(scene) * part * ledger.biomass_before / scale
    return LARGEST + part**2 / 12 * _turned_over(kinetics, ledger) / scale


def _steepness(scene: Scene) -> float:
    """Change of m_A and m_D for a change of both concentrations by their supplies, one at least."""
    both = needed(scene.substrates, "[substrates]")
    laws = uptake_law(both, needed(scene.kinetics, "[kinetics]"))
    supplies = both.acceptor.supply, both.donor.supply
    return max(1.0, sum(law.proportional(supply) for law, supply in zip(laws, supplies)))


def _turned_over(kinetics: Kinetics, ledger: Ledger) -> float:
    """Oxygen demand of all that is consumed and made, as biomass, um2 mg/L."""
    acceptor, donor = ledger.consumed
    demand = kinetics.decay_oxygen_demand
    of_donor = kinetics.acceptor_to_donor_ratio / demand + kinetics.yield_coefficient
    return acceptor / demand + abs(ledger.biomass_made) + of_donor * donor


def _exchanged(scene: Scene, after: Pore, ledger: Ledger, k: int) -> float:
    """What a supply brings about besides its flow, um2 mg/L: diffusion in a step, which the defect
    is small against where the flow is slow, and with Gear's method what the meshed part holds."""
    both = needed(scene.substrates, "[substrates]")
    kind = (both.acceptor, both.donor)[k]
    fastest = max(kind.diffusivity, kind.diffusivity_in_aggregate)
    exchanged = (ledger.end - ledger.start) * fastest * kind.supply
    if scene.numerics.transport != "gear":
        return exchanged
    first, last = after.mesh.ends
    return max(exchanged, (last - first) * scene.pore.width * kind.supply)
