"""The substrates in the geometry of a pore."""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from repro.model import transport
from repro.model.flow import Flow
from repro.model.kinetics import Sink
from repro.model.transport import Concentrations, Fluxes, Problem
from repro.scene import Kinetics, Substrates
from repro.schemes import Scheme

if TYPE_CHECKING:
    from repro.model.pore import Pore
    from repro.model.transport_in_time import TransportInTime


def solve(supplied: Substrates, kinetics: Kinetics | None, scheme: Scheme,
          transport_in_time: TransportInTime, pore: Pore, flow: Flow | None,
          over: float) -> tuple[Problem, Concentrations, tuple[Fluxes, Fluxes]]:
    """Solve the substrates in a pore.

    supplied: section [substrates] at one time, without tables; kinetics: None without an aggregate;
    flow: None without flow; over: h, as for :func:`repro.model.solving.solve`.
    """
    problem = transport.problem(pore.space, flow, supplied, kinetics, scheme)
    sink = Sink(pore.active, over) if kinetics else None
    state = transport_in_time.settled(problem, sink, pore.concentrations)
    return problem, state, transport.fluxes(problem, sink, state)


def net_growth(problem: Problem, pore: Pore, state: Concentrations, constants: Kinetics) -> float:
    """Growth (um2 mg/L/h) of X_A + X_I in all aggregates.

    F3 + F4 follows from the uptake and the unmet demand (:mod:`repro.model.kinetics`).
    """
    balance = transport.Balance(problem, Sink(pore.active))
    fields = state.fields.ravel()
    acceptor, donor = uptakes(problem, pore, state).sum(axis=0) + balance.unmet(fields)
    decayed = acceptor - constants.acceptor_to_donor_ratio * donor
    return constants.yield_coefficient * donor - decayed / constants.decay_oxygen_demand


@lru_cache(maxsize=1)
def uptakes(problem: Problem, pore: Pore, state: Concentrations) -> np.ndarray:
    """(bodies, 2) um2 mg/L/h, uptake of acceptor and donor by each aggregate."""
    at_points = transport.Balance(problem, Sink(pore.active)).uptake(state.fields.ravel())
    by_body = np.zeros((len(pore.bodies), 2))
    for number, region in enumerate(pore.mesh.regions):
        own = pore.of(region, at_points).sum(axis=(0, 2))
        by_body[number, problem.substrates.places] = own
    return by_body
