"""How substrates change in time: at rest in each shape (2.2), or by the paper's transient (3.3).

``numerics.transport`` chooses the method; :func:`transport_in_time` alone knows its words. Both
classes have

    stores          True: the water keeps the substrates of earlier times. Balances then include
                    them, they may exceed the present supply, and the next step starts from them.
    settled         steady concentrations in a shape, from a guess; see
                    :func:`repro.model.transport.steady`
    make_biomass    integrates (9)-(10) over an update (h) in a fixed geometry: grown pore,
                    concentrations, flows
    growth_error    bound of the error (um2 mg/L) of the biomass made in an update. part: the
                    fraction of ``biomass`` that turns over at the fastest rate; turnover: of the
                    update, um2 mg/L; steepness: change of m_A + m_D for a change of the
                    concentrations by their supplies
"""

from __future__ import annotations

from typing import TYPE_CHECKING, TypeAlias

if TYPE_CHECKING:
    from repro.model.kinetics import Sink
    from repro.model.pore import Pore
    from repro.model.solving import Solved
    from repro.model.transport import Concentrations, Flows, Problem

#: Largest error of m(C) with Gear's method, over the change of m for a change by the supply: the
#: tolerance of its concentrations.
CONCENTRATION_TOLERANCE = 1e-3


class QuasiSteady:
    """Quasi-steady substrates; Heun's method for the biomass."""

    stores = False

    def settled(self, problem: Problem, sink: Sink | None,
                guess: Concentrations | None) -> Concentrations:
        """Newton's method. If a law of uptake is not monotone, several states may be steady. Gear's
        method then leads from the guess to one of them, with the biomass at rest."""
        from repro.model import transport  # a scene without [substrates] does not load it
        if problem.law is not None and not problem.law.both.monotone:
            guess = Gear().settled(problem, sink, guess)
        return transport.steady(problem, sink, guess)

    def make_biomass(self, previous: Pore, solved: Solved,
                     duration: float) -> tuple[Pore, Concentrations, Flows]:
        """Each biomass grows exponentially at its rate. The second rates are those of the steady
        concentrations over the grown biomass."""
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
        """The trapezoidal rule errs by part^2 / 12 of the turnover: 1e-3 in a step of base, where
        at most 2e-4 is measured (a tenth of the bound in the worst of 132 random scenes)."""
        return part**2 / 12 * turnover


class Gear:
    """The transient scheme for substrates and biomass, :mod:`repro.model.gear`."""

    stores = True

    def settled(self, problem: Problem, sink: Sink | None,
                guess: Concentrations | None) -> Concentrations:
        """The transient, until it is steady."""
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
        """Growth and uptake are integrated separately. Where a substrate runs out, m(C) errs by at
        most CONCENTRATION_TOLERANCE supply / K. The bound is this part, and at least
        CONCENTRATION_TOLERANCE, of the turnover at the fastest rate. Away from exhaustion at most
        4e-4 is measured."""
        return CONCENTRATION_TOLERANCE * max(1.0, steepness) * part * biomass


TransportInTime: TypeAlias = QuasiSteady | Gear


def transport_in_time(word: str) -> TransportInTime:
    """The method of a value of ``numerics.transport``."""
    return Gear() if word == "gear" else QuasiSteady()
