"""Mass balances of a step, their defects, and the check that ends a run.

Defects are relative. A positive defect means that too much was supplied or made. If all amounts are
as small as round-off, the defect is relative to a floor: round-off divided by LARGEST. A step
balances to round-off, except with the options that :func:`refuse` lists. A larger defect is an
error of the code or of its use.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from repro.errors import BalanceError
from repro.model.pore import Pore
from repro.model.transport_in_time import TransportInTime, transport_in_time
from repro.model.uptake_law import uptake_law
from repro.scene import Kinetics, Scene, Substrate, Substrates, at_largest
from repro.schemes import Scheme

if TYPE_CHECKING:
    from repro.model.transport import Problem

#: Largest accepted defect of a balance of masses.
LARGEST = 1e-6
#: Bound of the round-off in the difference of two masses, relative to a mass. Pairwise summation in
#: blocks of 128 in 8 lanes errs by at most (16 + log2(n / 128)) eps, less than 40 eps for any mesh.
#: A difference has two sums of X_A and two of X_I, so it errs by up to 4e-14.
ROUND_OFF = 1e-13


@dataclass(frozen=True)
class Ledger:
    """Mass balance of one step, per unit depth (um2 mg/L = 1e-12 g/m).

    start, end: times (h); supplied, out, consumed, stored, unmet: of acceptor and donor, where
    unmet is the demand that no modelled substrate meets (:mod:`repro.model.kinetics`); detached:
    biomass that erosion has removed in the step, plus the biomass of aggregates that have left the
    pore at its end.
    """

    start: float
    end: float
    supplied: tuple[float, float]
    out: tuple[float, float]
    consumed: tuple[float, float]
    stored: tuple[float, float]
    biomass_before: float
    biomass_made: float
    biomass_after: float
    unmet: tuple[float, float] = (0.0, 0.0)
    detached: float = 0.0


@dataclass(frozen=True, eq=False)
class Limits:
    """Data of a scene from which the accepted defects of a run follow.

    width: um, of the pore; substrates: with the largest supply of each over time.
    """

    width: float
    substrates: Substrates
    kinetics: Kinetics
    scheme: Scheme
    transport: TransportInTime

    @classmethod
    def of(cls, scene: Scene) -> Limits:
        """The limits of a scene with growth."""
        substrates, kinetics, _ = scene.growing
        return cls(scene.pore.width, at_largest(substrates), kinetics, scene.numerics.scheme,
                   transport_in_time(scene.numerics.transport))


def defect(supplied: float, out: float, consumed: float, stored: float = 0.0,
           least_scale: float = 0.0) -> float:
    """(supplied - out - consumed - stored) / max(abs(supplied), consumed, least_scale).

    Zero if the divisor is zero.
    """
    scale = max(abs(supplied), consumed, least_scale)
    return (supplied - out - consumed - stored) / scale if scale else 0.0


def floor(problem: Problem, k: int, supply: float) -> float:
    """Round-off in the flux (um2 mg/L/h) of the acceptor (k = 0) or the donor (1), over LARGEST.

    Round-off is eps times the sum of the magnitudes of all terms of the substrate's equations if
    its concentration is ``supply`` (mg/L) everywhere.
    """
    n = problem.space.count
    k -= problem.substrates.places.start
    terms = problem.magnitude.data[slice(*problem.magnitude.indptr[[k * n, k * n + n]])]
    return float(np.finfo(float).eps / LARGEST * supply * terms.sum())


def substrate(ledger: Ledger, k: int, least_scale: float = 0.0) -> float:
    """Relative defect of the acceptor (k = 0) or the donor (1)."""
    return defect(ledger.supplied[k], ledger.out[k], ledger.consumed[k], ledger.stored[k],
                  least_scale)


def biomass(ledger: Ledger) -> float:
    """Relative defect of the biomass: (after - before - made) / after; zero in a clean channel.

    ``after`` includes the detached biomass.
    """
    after = ledger.biomass_after + ledger.detached
    missing = after - ledger.biomass_before - ledger.biomass_made
    return missing / after if after else missing


def demand_terms(kinetics: Kinetics, ledger: Ledger) -> tuple[float, float]:
    """Biomass grown, Y donor, and decayed, (acceptor - F donor) / d_c, um2 mg/L (7)-(10).

    acceptor, donor: the consumed amount plus the unmet demand.
    """
    acceptor, donor = (used + unmet for used, unmet in zip(ledger.consumed, ledger.unmet))
    return (kinetics.yield_coefficient * donor,
            (acceptor - kinetics.acceptor_to_donor_ratio * donor) / kinetics.decay_oxygen_demand)


def demand_scale(kinetics: Kinetics, ledger: Ledger) -> float:
    """The larger of :func:`demand_terms`, um2 mg/L; at least ROUND_OFF / LARGEST of the biomass."""
    floor = ROUND_OFF / LARGEST * ledger.biomass_before
    return max(*map(abs, demand_terms(kinetics, ledger)), floor)


def oxygen_demand(kinetics: Kinetics, ledger: Ledger) -> float:
    """Relative defect of the oxygen demand: (made - grown + decayed) / :func:`demand_scale`; zero
    in a clean channel, which has no biomass."""
    if not ledger.biomass_before:
        return 0.0
    grown, decayed = demand_terms(kinetics, ledger)
    return (ledger.biomass_made - grown + decayed) / demand_scale(kinetics, ledger)


def refuse(limits: Limits, after: Pore, ledger: Ledger) -> None:
    """Raise BalanceError if a defect of the step that ends in ``after`` is larger than LARGEST.

    Known defects of some schemes are reported but not refused: the substrates with the printed
    inlet [E4] or the printed carrier, and the biomass with interpolation [E8]. The limit for the
    oxygen demand is :func:`accepted_demand`.
    """
    defects = {}
    if limits.scheme.conserves_substrates:
        for name, kind in limits.substrates.modelled.items():
            exchanged = _exchanged(limits, after, ledger, kind)
            defects[name] = substrate(ledger, ("acceptor", "donor").index(name), exchanged)
    if limits.scheme.conserves_biomass:
        defects["biomass"] = biomass(ledger)
    wrong = {name: part for name, part in defects.items() if not abs(part) <= LARGEST}
    demand = oxygen_demand(limits.kinetics, ledger)
    if not abs(demand) <= accepted_demand(limits, ledger):
        wrong["oxygen demand"] = demand
    if wrong:
        message = ", ".join(f"{part:.2g} of the {name}" for name, part in wrong.items())
        first, last = after.mesh.ends
        raise BalanceError(f"the step to t = {ledger.end:g} h does not balance between x = "
                           f"{first:.4g} and {last:.4g} um: it lacks {message}")


def accepted_demand(limits: Limits, ledger: Ledger) -> float:
    """Largest accepted defect of the oxygen demand in a step.

    The midpoint rule balances to round-off. In the paper's updates the error has a bound, which
    depends on the method of transport and on dt times the fastest rate, k Y + b.
    """
    if limits.scheme.controls_error or not ledger.biomass_before:
        return LARGEST
    kinetics = limits.kinetics
    supplies = [kind.supply for kind in limits.substrates.modelled.values()]
    laws = list(zip(uptake_law(limits.substrates, kinetics), supplies))
    steepness = sum(law.proportional(supply) for law, supply in laws)
    fastest = (kinetics.maximum_utilization_rate * kinetics.yield_coefficient
               + kinetics.decay_coefficient)
    for law, supply in laws:
        fastest *= max(1.0, law.largest(supply))
    part = fastest * (ledger.end - ledger.start)
    error = limits.transport.growth_error(part, ledger.biomass_before,
                                          _turned_over(kinetics, ledger), steepness)
    return LARGEST + error / demand_scale(kinetics, ledger)


def _turned_over(kinetics: Kinetics, ledger: Ledger) -> float:
    """Turnover in a step (um2 mg/L of biomass): the sum of the magnitudes of all terms of the
    oxygen demand."""
    acceptor, donor = (used + unmet for used, unmet in zip(ledger.consumed, ledger.unmet))
    demand = kinetics.decay_oxygen_demand
    of_donor = kinetics.acceptor_to_donor_ratio / demand + kinetics.yield_coefficient
    return acceptor / demand + abs(ledger.biomass_made) + of_donor * donor


def _exchanged(limits: Limits, after: Pore, ledger: Ledger, kind: Substrate) -> float:
    """Amount exchanged other than by flow, um2 mg/L: a lower bound of the defect's divisor.

    It is the diffusion in a step. If the transport stores substrates, it is at least the content of
    the mesh.
    """
    fastest = max(kind.diffusivity, kind.diffusivity_in_aggregate)
    exchanged = (ledger.end - ledger.start) * fastest * kind.supply
    if not limits.transport.stores:
        return exchanged
    first, last = after.mesh.ends
    return max(exchanged, (last - first) * limits.width * kind.supply)
