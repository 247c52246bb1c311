"""The data of a scene that the stages of a step use, without optional sections."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from repro.model import biomass, contact, growing, remeshing
from repro.model.biomass import Rates
from repro.model.contact_lines import PATIENT, SearchOptions
from repro.model.grading import Grading
from repro.model.mechanics import Expansion, Mechanics
from repro.model.pore import Pore
from repro.model.remeshing import GeneratedMesh, Remeshing
from repro.model.solving import Solved, Solver
from repro.model.transport_in_time import TransportInTime
from repro.scene import Growth, Scene, TimeTables, needed
from repro.scene import Pore as Channel

if TYPE_CHECKING:
    from repro.model.erosion import Erosion


@dataclass(frozen=True, eq=False)
class Stages:
    """The stages of a step of growth.

    growth: section [growth] of the scene; tables: of the scene over time, with the times at which
    steps end, and jumps; tolerance: numerics.tolerance of a step; grading: solves flow and
    substrates on a mesh that resolves them; mechanics: computes the shape of grown aggregates;
    erosion: of their surfaces, None without [growth.erosion].
    """

    growth: Growth
    tables: TimeTables
    tolerance: float
    grading: Grading
    mechanics: Mechanics
    erosion: Erosion | None = None

    @classmethod
    def of(cls, scene: Scene) -> Stages:
        """The stages of a scene with growth."""
        _, _, growth = scene.growing
        erosion = None
        if growth.erosion:
            from repro.model.erosion import Erosion  # a scene without erosion does not load it
            erosion = Erosion.of(scene)
        return cls(growth, scene.time_tables, scene.numerics.tolerance, Grading.of(scene),
                   Mechanics.of(scene), erosion)

    @property
    def solver(self) -> Solver:
        """Solver of flow and substrates on the mesh of a pore."""
        return self.grading.solver

    @property
    def remeshing(self) -> Remeshing:
        """Data for the mesh after a step."""
        return needed(self.grading.remeshing, "[growth]")

    @property
    def transport(self) -> TransportInTime:
        """Method for the substrates in time."""
        return self.solver.transport

    @property
    def channel(self) -> Channel:
        """Section [pore] of the scene."""
        return self.solver.channel

    def rates(self, pore: Pore, solved: Solved) -> Rates:
        """F3 / X_A and F4 / X_A, 1/h, at the points of the reaction."""
        substrates = solved.substrates
        return biomass.rates(pore.space, substrates.concentrations, substrates.problem.rate_law)

    def expand(self, previous: Pore, grown: Pore, guess: Pore | None = None,
               search: SearchOptions = PATIENT) -> Expansion:
        """Expand aggregates that have grown since ``previous``, by :func:`contact.expand`."""
        theta = growing.compute_theta(previous, grown, self.remeshing.maximum_density)
        return contact.expand(self.mechanics, grown, theta, guess, search)

    def without(self, pore: Pore, number: int, solved: Solved) -> Pore:
        """The pore without the aggregate with index ``number``, by :func:`remeshing.without`."""
        return remeshing.without(self.remeshing, pore, number, solved.mean_velocity)

    def weld(self, pore: Pore, pair: tuple[int, int], solved: Solved) -> Pore:
        """The pore after two aggregates have joined, by :func:`welding.join`."""
        from repro.model import welding  # a run without a weld does not load it
        return welding.join(self.mechanics, self.remeshing, pore, pair, solved.mean_velocity)

    def land(self, pore: Pore, place: tuple[int, int], solved: Solved) -> Pore:
        """The pore after a welded aggregate has touched a wall, by :func:`welding.land`."""
        from repro.model import welding
        return welding.land(self.mechanics, self.remeshing, pore, place, solved.mean_velocity)

    def new_mesh(self, previous: Pore, expanded: Pore, solved: Solved,
                 generated: Sequence[GeneratedMesh] = ()) -> tuple[Pore, bool]:
        """Give expanded aggregates a mesh, by :func:`remeshing.new_mesh`."""
        return remeshing.new_mesh(self.remeshing, previous, expanded, solved.mean_velocity,
                                  generated)
