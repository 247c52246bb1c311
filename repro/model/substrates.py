"""The substrates in the geometry of a pore."""

from __future__ import annotations

from typing import TYPE_CHECKING

from repro.model import transport
from repro.model.flow import Flow
from repro.model.kinetics import Sink
from repro.model.transport import Concentrations, Fluxes, Problem
from repro.model.transport_in_time import transport_in_time
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
    method = transport_in_time(numerics.transport)
    state = method.settled(problem, sink, pore.concentrations)
    return problem, state, transport.fluxes(problem, sink, state)
