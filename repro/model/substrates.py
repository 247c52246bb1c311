"""The substrates in the geometry of a pore, by the method of ``numerics.transport``."""

from __future__ import annotations

from typing import TYPE_CHECKING

from repro.model import transport
from repro.model.flow import Flow
from repro.model.kinetics import Sink
from repro.model.transport import Concentrations, Fluxes, Problem
from repro.scene import Scene, needed

if TYPE_CHECKING:
    from repro.model.pore import Pore


def solve(scene: Scene, pore: Pore, flow: Flow | None,
          over: float) -> tuple[Problem, Concentrations, tuple[Fluxes, Fluxes]]:
    """Solve the substrates of a scene without tables in a pore.

    The flow and the time ``over`` (h) are those of :func:`repro.model.solving.solve`.
    """
    numerics = scene.numerics
    sections = needed(scene.substrates, "[substrates]")
    problem = transport.problem(pore.space, flow, sections, scene.kinetics, numerics.scheme)
    sink = Sink(pore.active, over) if scene.kinetics else None
    state = SETTLED[numerics.transport](problem, sink, pore.concentrations)
    return problem, state, transport.fluxes(problem, sink, state)


def steady(problem: Problem, sink: Sink | None, guess: Concentrations | None) -> Concentrations:
    """Solve for steady concentrations; if several exist, for those that the guess leads to.

    With a law of uptake that is not monotone several states may be steady. :func:`settle` then
    leads to one of them, with the biomass at rest, and Newton's method starts from there.
    Parameters, result and errors are those of :func:`repro.model.transport.steady`.
    """
    if problem.law is not None and not problem.law.both.monotone:
        guess = settle(problem, sink, guess)
    return transport.steady(problem, sink, guess)


def settle(problem: Problem, sink: Sink | None, guess: Concentrations | None) -> Concentrations:
    """Return :func:`repro.model.gear.settle`."""
    from repro.model import gear  # most scenes need no transient
    return gear.settle(problem, sink, guess)


#: By the values of ``numerics.transport``.
SETTLED = {"gear": settle, "quasi_steady": steady}
