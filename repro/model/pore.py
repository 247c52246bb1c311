"""The state of a pore at one time."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from repro.fem.brief import brief
from repro.fem.mesh import Mesh, Region
from repro.fem.outline import Outline
from repro.fem.space import Space
from repro.fem.walls import WELD, Walls
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
    aggregate at each corner of the mesh, zero in the fluid; concentrations: the last known ones,
    None before the first; front: divisor of the element sizes at the aggregates, for a front of the
    substrates in them; focus: place in the list of the aggregate from which the pore is seen.
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
        """Does an aggregate touch all walls?"""
        return self.spanning > 0

    @property
    def spanning(self) -> int:
        """Number of aggregates that touch all walls."""
        return sum(body.spans for body in self.bodies)

    @property
    def welded(self) -> bool:
        """Are its two aggregates welded to each other?"""
        return any((body.wall == WELD).any() for body in self.bodies)

    @property
    def accumulates(self) -> bool:
        """Does strain add up over the steps? Only then do folds and stresses have a meaning."""
        return all(body.configuration.accumulates for body in self.bodies)

    @property
    def biot(self) -> float:
        """Largest limit of Biot of the aggregates' energies; zero if none has a limit."""
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
        """(N, 2) um, positions at t = 0 of the nodes' material; in the fluid, the present ones."""
        origin = self.mesh.points.copy()
        for body, region in zip(self.bodies, self.mesh.regions):
            origin[region.nodes] = body.reference
        return origin

    def name_of(self, number: int) -> str:
        """An aggregate in messages, by its place in the list."""
        name = self.bodies[number].name
        return "the aggregate" if len(self.bodies) == 1 and name == "1" else f"aggregate {name}"

    def with_masses(self, active: np.ndarray, inert: np.ndarray) -> Pore:
        """The pore with X_A and X_I (r, q) um2 mg/L at the points of the reaction."""
        bodies = [replace(body, active=self.of(region, active), inert=self.of(region, inert))
                  for body, region in zip(self.bodies, self.mesh.regions)]
        return replace(self, bodies=tuple(bodies))

    def of(self, region: Region, values: np.ndarray) -> np.ndarray:
        """(r, q) values at the points of the reaction in one aggregate, from those in all."""
        return values[self.space.integration.rows(region)]

    def joined(self, amounts: Iterable[np.ndarray]) -> np.ndarray:
        """(r, q) amounts of all aggregates, from those of each."""
        total = np.zeros_like(self.space.reaction.dx)
        for amount, region in zip(amounts, self.mesh.regions):
            total[self.space.integration.rows(region)] = amount
        total.setflags(write=False)  # a change would not reach the aggregates
        return total

    def moved(self, points: np.ndarray) -> Pore:
        """The pore with the nodes of its mesh at ``points`` (N, 2) um."""
        return replace(self, space=Space(self.mesh.moved(points)))

    def composition(self, maximum_density: float) -> tuple[float, float, float]:
        """Share of X_I in the biomass, and the least and the largest (X_A + X_I) / X_m: means over
        curved triangles, or values at the nodes of straight ones. The constraint J = theta keeps
        both near one; at single points of a curved triangle it does not."""
        inert = self.inert
        area = self.space.reaction.dx.sum(axis=1)
        density = (self.active + inert).sum(axis=1) / area / maximum_density
        return float(inert.sum() / self.mass), float(density.min()), float(density.max())

    def focused(self, number: int | None) -> Pore:
        """The pore seen from one aggregate, by its place in the list; None: from none."""
        return replace(self, focus=number)

    # The aggregate from which the pore is seen, or the only one.

    @property
    def number(self) -> int:
        """Its place in the lists. Raises MissingError in a clean channel."""
        if self.focus is not None:
            return self.focus
        if len(self.bodies) > 1:
            raise ValueError(f"the pore has {len(self.bodies)} aggregates; focused(number) sees "
                             "one of them")
        return 0 if self.bodies else needed(None, "an aggregate")

    @property
    def body(self) -> Body:
        """The aggregate."""
        return self.bodies[self.number]

    @property
    def region(self) -> Region:
        """Its region of the mesh."""
        return self.mesh.regions[self.number]

    @property
    def outline(self) -> Outline | None:
        """Its boundary, None in a clean channel."""
        return self.outlines[self.number] if self.bodies else None

    @property
    def boundary(self) -> Outline:
        """Its boundary. Raises MissingError in a clean channel."""
        return needed(self.outline, "an aggregate")

    @property
    def walls(self) -> Walls:
        """The walls that it sees: that of its seed, then the opposite one."""
        return self.body.seat.walls(self.mesh.walls)

    def with_body(self, **changes: Any) -> Pore:
        """The pore with changes of its aggregate."""
        bodies = list(self.bodies)
        bodies[self.number] = replace(self.body, **changes)
        return replace(self, bodies=tuple(bodies))

    def placed(self, position: np.ndarray, pressure: np.ndarray) -> Pore:
        """The pore with its aggregate's nodes at positions (n, 2) um and pressures at its corners;
        the other nodes stay in place."""
        points = self.mesh.points.copy()
        points[self.region.nodes] = position
        pressures = self.pressure.copy()
        pressures[self.region.corner_nodes] = pressure
        return replace(self.moved(points), pressure=pressures)
