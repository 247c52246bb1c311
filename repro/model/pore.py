"""The state of a pore at one time."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from repro.fem import welds
from repro.fem.brief import brief
from repro.fem.mesh import Mesh, Region
from repro.fem.outline import Outline
from repro.fem.space import Space
from repro.fem.walls import FREE, Walls, touched
from repro.model.body import Body
from repro.scene import needed

if TYPE_CHECKING:
    from repro.model.transport import Concentrations


@brief
@dataclass(frozen=True, eq=False)
class Pore:
    """Geometry and biomass at one time.

    time: h; space: of velocity and concentrations, on the mesh; bodies: the aggregates, in the
    order of the mesh's regions, none in a clean channel; pressure: (corners,) P / mu_L of the
    aggregates at each corner of the mesh, zero in the fluid; concentrations: the last computed
    ones, None before the first solution; front: divisor of the element sizes at the aggregates, for
    a front of the substrates in them; focus: index of the aggregate to which ``body``, ``region``,
    ``boundary``, ``walls`` and ``with_body`` refer, None for the only one.
    """

    time: float
    space: Space
    bodies: tuple[Body, ...]
    pressure: np.ndarray
    concentrations: Concentrations | None = None
    front: float = 1.0
    focus: int | None = None

    @property
    def mesh(self) -> Mesh:
        """The mesh of the space."""
        return self.space.mesh

    @property
    def active(self) -> np.ndarray:
        """X_A of all aggregates, (r, q) um2 mg/L at the points of the reaction."""
        return self.joined([body.active for body in self.bodies])

    @property
    def inert(self) -> np.ndarray:
        """X_I of all aggregates, (r, q) um2 mg/L at the points of the reaction."""
        return self.joined([body.inert for body in self.bodies])

    @property
    def mass(self) -> float:
        """X_A + X_I of all aggregates, um2 mg/L."""
        return sum((body.mass for body in self.bodies), 0.0)

    @property
    def contact(self) -> bool:
        """Do aggregates plug the pore: does one touch both walls, with those welded to it?"""
        return any(len(self.walls_of(group)) > 1 for group in self.groups)

    @property
    def spanning(self) -> int:
        """Number of aggregates that touch both walls, or their wall and another aggregate."""
        return sum(body.spans for body in self.bodies)

    @cached_property
    def welds(self) -> list[tuple[int, int]]:
        """Indices of the two aggregates of each weld."""
        return welds.pairs([body.wall for body in self.bodies])

    @cached_property
    def groups(self) -> list[tuple[int, ...]]:
        """Indices of the aggregates that move together: one alone, or all that are welded."""
        group_of = list(range(len(self.bodies)))
        for pair in self.welds:
            first, second = sorted(group_of[number] for number in pair)
            group_of = [first if group == second else group for group in group_of]
        return [tuple(number for number, own in enumerate(group_of) if own == group)
                for group in sorted(set(group_of))]

    def group_of(self, number: int) -> tuple[int, ...]:
        """The group of an aggregate; number: its index."""
        return next(group for group in self.groups if number in group)

    def walls_of(self, group: Sequence[int]) -> set[int]:
        """Numbers of the walls that the aggregates of a group touch."""
        numbers = (touched(self.bodies[number].wall).tolist() for number in group)
        return set().union(*numbers) - {FREE}

    def common_walls(self, pair: tuple[int, int]) -> list[int]:
        """Numbers of the walls that the groups of two aggregates both touch."""
        first, second = (self.walls_of(self.group_of(number)) for number in pair)
        return sorted(first & second)

    @property
    def accumulates(self) -> bool:
        """Does strain add up over the steps? Folds and stresses have a meaning only then."""
        return all(body.configuration.accumulates for body in self.bodies)

    @property
    def biot(self) -> float:
        """Largest of Biot's limits of the aggregates' energies; zero if none has a limit."""
        return max((body.solid.energy.biot or 0.0 for body in self.bodies), default=0.0)

    @cached_property
    def outlines(self) -> tuple[Outline, ...]:
        """Boundaries of the aggregates."""
        mesh = self.mesh
        return tuple(Outline(mesh.points[region.loop], body.wall, body.fixed,
                             body.reference[region.own_loop], mesh.geometry, body.seat)
                     for body, region in zip(self.bodies, mesh.regions))

    @property
    def origin(self) -> np.ndarray:
        """(N, 2) um, positions at t = 0 of the nodes' material; present positions in the fluid."""
        origin = self.mesh.points.copy()
        for body, region in zip(self.bodies, self.mesh.regions):
            origin[region.nodes] = body.reference
        return origin

    def name_of(self, number: int) -> str:
        """Name in messages of the aggregate with index ``number``."""
        name = self.bodies[number].name
        return "the aggregate" if len(self.bodies) == 1 and name == "1" else f"aggregate {name}"

    def with_masses(self, active: np.ndarray, inert: np.ndarray) -> Pore:
        """The pore with X_A and X_I (r, q) um2 mg/L at the points of the reaction."""
        bodies = [replace(body, active=self.of(region, active), inert=self.of(region, inert))
                  for body, region in zip(self.bodies, self.mesh.regions)]
        return replace(self, bodies=tuple(bodies))

    def of(self, region: Region, values: np.ndarray) -> np.ndarray:
        """(r, q) values at one aggregate's points of the reaction, from values at all points."""
        return values[self.space.integration.rows(region)]

    def joined(self, amounts: Iterable[np.ndarray]) -> np.ndarray:
        """(r, q) amounts at all points of the reaction, from amounts (r, q) of each aggregate."""
        total = np.zeros_like(self.space.reaction.dx)
        for amount, region in zip(amounts, self.mesh.regions):
            total[self.space.integration.rows(region)] = amount
        total.setflags(write=False)  # a change would not reach the aggregates
        return total

    def moved(self, points: np.ndarray) -> Pore:
        """The pore with the nodes of its mesh at ``points`` (N, 2) um."""
        return replace(self, space=Space(self.mesh.moved(points)))

    def composition(self, maximum_density: float) -> tuple[float, float, float]:
        """Fraction of X_I in the biomass, and the least and the largest density over X_m.

        Densities are means over curved triangles, or values at the nodes of straight triangles. The
        constraint J = theta keeps these densities near X_m. It does not at single points of a
        curved triangle.
        """
        inert = self.inert
        area = self.space.reaction.dx.sum(axis=1)
        density = (self.active + inert).sum(axis=1) / area / maximum_density
        return float(inert.sum() / self.mass), float(density.min()), float(density.max())

    def focused(self, number: int | None) -> Pore:
        """The pore with its focus on the aggregate with index ``number``, or without a focus."""
        return replace(self, focus=number)

    # Members below refer to the aggregate in focus, or to the only one.

    @property
    def number(self) -> int:
        """Index of the aggregate in focus, or of the only one.

        Raises MissingError in a clean channel, and ValueError if there are several aggregates and
        no focus.
        """
        if self.focus is not None:
            return self.focus
        if len(self.bodies) > 1:
            raise ValueError(f"the pore has {len(self.bodies)} aggregates; focused(number) selects "
                             "one of them")
        return 0 if self.bodies else needed(None, "an aggregate")

    @property
    def body(self) -> Body:
        """The aggregate."""
        return self.bodies[self.number]

    @property
    def region(self) -> Region:
        """Region of the aggregate in the mesh."""
        return self.mesh.regions[self.number]

    @property
    def outline(self) -> Outline | None:
        """Boundary of the aggregate, None in a clean channel."""
        return self.outlines[self.number] if self.bodies else None

    @property
    def boundary(self) -> Outline:
        """Boundary of the aggregate. Raises MissingError in a clean channel."""
        return needed(self.outline, "an aggregate")

    @property
    def walls(self) -> Walls:
        """The wall of the aggregate's seed, then the opposite wall."""
        return self.body.seat.walls(self.mesh.walls)

    def with_body(self, **changes: Any) -> Pore:
        """The pore with changed attributes of the aggregate."""
        bodies = list(self.bodies)
        bodies[self.number] = replace(self.body, **changes)
        return replace(self, bodies=tuple(bodies))

    def placed(self, position: np.ndarray, pressure: np.ndarray) -> Pore:
        """The pore with new positions (n, 2) um and pressures (corners of the aggregate,) of the
        aggregate. Other nodes stay in place."""
        points = self.mesh.points.copy()
        points[self.region.nodes] = position
        pressures = self.pressure.copy()
        pressures[self.region.corner_nodes] = pressure
        return replace(self.moved(points), pressure=pressures)
