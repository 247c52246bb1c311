"""Substrates in time: steady in each shape (2.2), or by the paper's transient scheme (3.3).

``numerics.transport`` selects the method by :func:`transport_in_time`. Both classes have

    stores          does the water store substrates of earlier times? If so, balances include the
                    stored amounts, concentrations may exceed the present supply, and the next step
                    starts from them.
    settled         steady concentrations in a shape, from a guess; see
                    :func:`repro.model.transport.steady`
    make_biomass    integrates (9)-(10) over an update (h) in a fixed geometry; returns the grown
                    pore, concentrations and flows
    growth_error    bound of the error (um2 mg/L) of the biomass made in an update. part: fraction
                    of ``biomass`` that turns over at the fastest rate; turnover: in the update, um2
                    mg/L; steepness: change of m_A + m_D if concentrations change by their supplies
"""

from __future__ import annotations

from typing import TYPE_CHECKING, TypeAlias

if TYPE_CHECKING:
    from repro.model.kinetics import Sink
    from repro.model.pore import Pore
    from repro.model.solving import Solved
    from repro.model.transport import Concentrations, Flows, Problem


class QuasiSteady:
    """Quasi-steady substrates, with Heun's method for the biomass."""

    stores = False

    def settled(self, problem: Problem, sink: Sink | None,
                guess: Concentrations | None) -> Concentrations:
        """Steady concentrations by Newton's method.

        If a law of uptake is not monotone, several states may be steady. Gear's method with
        constant biomass then leads from the guess to one of them.
        """
        from repro.model import transport  # a scene without [substrates] does not load it
        if problem.law is not None and not problem.law.uptake_law.monotone:
            guess = Gear().settled(problem, sink, guess)
        return transport.steady(problem, sink, guess)

    def make_biomass(self, previous: Pore, solved: Solved,
                     duration: float) -> tuple[Pore, Concentrations, Flows]:
        """Grow the biomass exponentially at the mean of two rates.

        The first rates are those at the start, the second ones those at the steady concentrations
        with the biomass grown at the first rates.
        """
        from repro.model.biomass import Rates, grow, rates
        from repro.model.kinetics import Sink
        from repro.model.transport import fluxes, integrated
        problem = solved.substrates.problem
        start = solved.substrates.concentrations
        first = rates(previous.space, start, problem.rate_law)
        guess = grow(previous, first, duration)
        end = self.settled(problem, Sink(guess.active), start)
        second = rates(previous.space, end, problem.rate_law)
        mean = Rates((first.growth + second.growth) / 2, (first.remains + second.remains) / 2)
        at_start = fluxes(problem, Sink(previous.active), start)
        at_end = fluxes(problem, Sink(guess.active), end)
        return grow(previous, mean, duration), end, integrated(duration, at_start, at_end)

    def growth_error(self, part: float, biomass: float, turnover: float, steepness: float) -> float:
        """Bound of the error of the trapezoidal rule: part^2 / 12 of the turnover.

        In a step of base this is 1e-3; the largest measured error is 2e-4. In the worst of 132
        random scenes the error is a tenth of the bound.
        """
        return part**2 / 12 * turnover


class Gear:
    """The transient scheme for substrates and biomass, :mod:`repro.model.gear`."""

    stores = True

    def settled(self, problem: Problem, sink: Sink | None,
                guess: Concentrations | None) -> Concentrations:
        """The transient scheme, until it is steady."""
        from repro.model import gear  # most scenes need no transient
        return gear.settle(problem, sink, guess)

    def make_biomass(self, previous: Pore, solved: Solved,
                     duration: float) -> tuple[Pore, Concentrations, Flows]:
        """Substrates and biomass advance together."""
        from repro.model import gear
        start = solved.substrates
        end = gear.advance(start.problem, previous.active, previous.inert, start.concentrations,
                           duration)
        after = previous.with_masses(end.active, end.inert)
        return after, end.concentrations, end.flows

    def growth_error(self, part: float, biomass: float, turnover: float, steepness: float) -> float:
        """Bound of the error due to separate integrations of growth and uptake.

        The concentrations err by at most ``gear.TOLERANCE`` of the supply. Where a substrate is
        exhausted, m(C) errs by this times supply / K. The bound is this part, or the tolerance if
        larger, of the turnover at the fastest rate. Away from exhaustion the largest measured error
        is 4e-4.
        """
        from repro.model import gear
        return gear.TOLERANCE * max(1.0, steepness) * part * biomass


TransportInTime: TypeAlias = QuasiSteady | Gear


def transport_in_time(word: str) -> TransportInTime:
    """The method of a value of ``numerics.transport``."""
    return Gear() if word == "gear" else QuasiSteady()
