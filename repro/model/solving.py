"""The flow and the substrates in the geometry of a pore."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from repro.errors import TransportError
from repro.fem.brief import brief
from repro.fem.space import Space
from repro.model import flow
from repro.model.flow import Flow
from repro.model.interface import Interface, interface_of
from repro.model.meshing import peclet
from repro.model.pore import Pore
from repro.model.transport_in_time import TransportInTime, transport_in_time
from repro.scene import Flow as Drive
from repro.scene import Kinetics, MissingError, Scene, Substrates, at_time
from repro.scene import Pore as Channel
from repro.schemes import Scheme

if TYPE_CHECKING:
    from repro.model.transport import Concentrations, Fluxes, Problem

#: Below this Peclet number u W / D the supply through the inlet is of the size of round-off.
SLOWEST = 1e-8


@dataclass(frozen=True, eq=False)
class SolvedSubstrates:
    """The substrates in the geometry of a pore; like :class:`Solved`, but no attribute is None."""

    problem: Problem
    concentrations: Concentrations
    fluxes: tuple[Fluxes, Fluxes]


@brief
@dataclass(frozen=True, eq=False)
class Solved:
    """Flow and substrates in the geometry of a pore, and the fluxes of acceptor and donor.

    An attribute is None if the scene does not model it.
    """

    flow: Flow | None
    problem: Problem | None
    concentrations: Concentrations | None
    fluxes: tuple[Fluxes, Fluxes] | None = None

    @property
    def substrates(self) -> SolvedSubstrates:
        """The substrates. Raises MissingError if the scene does not model them."""
        if self.problem is None or self.concentrations is None or self.fluxes is None:
            raise MissingError("a solution for the substrates is needed here")
        return SolvedSubstrates(self.problem, self.concentrations, self.fluxes)

    @property
    def mean_velocity(self) -> float:
        """Mean velocity, um/h; zero without flow."""
        return self.flow.mean_velocity if self.flow else 0.0


@dataclass(frozen=True, eq=False)
class Solver:
    """Data from which flow and substrates are solved.

    channel: section [pore]; drive, substrates, kinetics: sections [flow], [substrates] and
    [kinetics], None if the scene does not have them. Sections may have tables over time. interface,
    scheme, transport: methods of solution.
    """

    channel: Channel
    drive: Drive | None
    substrates: Substrates | None
    kinetics: Kinetics | None
    interface: Interface
    scheme: Scheme
    transport: TransportInTime

    @classmethod
    def of(cls, scene: Scene) -> Solver:
        """The solver of a scene."""
        numerics = scene.numerics
        return cls(scene.pore, scene.flow, scene.substrates, scene.kinetics,
                   interface_of(numerics.interface), numerics.scheme,
                   transport_in_time(numerics.transport))

    def solve_flow(self, space: Space, drive: Drive) -> Flow:
        """Stokes flow on a space of velocities; drive: without tables."""
        return flow.solve(space, drive, self.channel.length, interface=self.interface)

    def solve(self, pore: Pore, over: float = 0.0) -> Solved:
        """Solve in the geometry of a pore, at its time, by :func:`solve`."""
        carried = None
        if self.drive:
            carried = self.solve_flow(pore.space, at_time(self.drive, pore.time))
        if self.substrates is None:
            return Solved(carried, None, None)
        supplied = at_time(self.substrates, pore.time)
        if carried and not self.transport.stores:
            peclet_number = peclet(supplied, self.channel.width, carried.mean_velocity)
            if peclet_number < SLOWEST:
                raise TransportError(f"the Peclet number u W / D is {peclet_number:.2g}, under "
                                     f"{SLOWEST:g}: nothing is supplied through the inlet; leave "
                                     "[flow] out for pure diffusion")
        from repro.model import substrates  # a scene without [substrates] does not load them
        return Solved(carried, *substrates.solve(supplied, self.kinetics, self.scheme,
                                                 self.transport, pore, carried, over))


def solve(scene: Scene, pore: Pore, over: float = 0.0) -> Solved:
    """Solve the flow and the substrates that a scene models, in the geometry of a pore.

    Parameters
    ----------
    scene : Scene
        Its tables over time are evaluated at the time of the pore.
    pore : Pore
    over : float
        Time (h) during which the biomass of ``pore`` grows at the rates being solved for. The mean
        biomass over this time takes up the substrates.

    Returns
    -------
    Solved

    Raises
    ------
    LinearError, TransportError, Unresolved
        If the flow or the substrates cannot be solved.
    """
    return Solver.of(scene).solve(pore, over)
