"""The state of a pore at one time."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from repro.fem.brief import brief
from repro.fem.mesh import Mesh
from repro.fem.outline import Outline
from repro.fem.space import Space
from repro.model.body import Body
from repro.model.configuration import FromStart, ReferenceConfiguration
from repro.scene import needed

if TYPE_CHECKING:
    from repro.model.transport import Concentrations


@brief
@dataclass(frozen=True, eq=False)
class Pore:
    """Geometry and biomass at one time.

    time: h; space: of velocity and concentrations, on the mesh; wall: (M,) contact of each node of
    the mesh's loop; fixed: (M,) its x is constrained; active, inert: X_A, X_I, (r, q) um2 mg/L at
    the points of the reaction; theta: (t, q) expansion since t = 0 in the aggregate's triangles;
    body: the aggregate as it was at t = 0; pressure: (corners,) P / mu_L; concentrations: the last
    known ones, None before the first; front: divisor of the element sizes at the aggregate, for a
    front of the substrates in it; configuration: from which strain counts; origin_known: False
    if ``body`` is no longer the aggregate of t = 0: without strain since then, a new mesh replaces
    places at t = 0 that fold by the present ones; line_speeds: (2, 2) um/h, speeds of the contact
    lines, None if unknown. A row has the lines of one wall, the lower wall first: the line where a
    free surface begins along the loop, then the line where one ends.
    """

    time: float
    space: Space
    wall: np.ndarray
    fixed: np.ndarray
    active: np.ndarray
    inert: np.ndarray
    theta: np.ndarray
    body: Body
    pressure: np.ndarray
    concentrations: Concentrations | None = None
    front: float = 1.0
    configuration: ReferenceConfiguration = FromStart()
    line_speeds: np.ndarray | None = None
    origin_known: bool = True

    @property
    def unstrained(self) -> np.ndarray:
        """(n, 2) um, the aggregate's nodes in the shape from which strain counts."""
        return self.configuration.unstrained(self.body)

    @property
    def strained_body(self) -> tuple[Body, np.ndarray]:
        """The aggregate in that shape, and its expansion (t, q) since then."""
        return self.configuration.strained(self.body, self.theta)

    @property
    def mesh(self) -> Mesh:
        """The mesh of the space."""
        return self.space.mesh

    @property
    def origin(self) -> np.ndarray:
        """(N, 2) um, positions at t = 0 of the nodes' material; in the fluid, the present ones."""
        return self.mesh.from_body(self.body.reference, self.mesh.points)

    @cached_property
    def outline(self) -> Outline | None:
        """Boundary of the aggregate, None in a clean channel."""
        loop = self.mesh.loop
        if len(loop) == 0:
            return None
        origin = self.body.reference[self.mesh.topology.body_loop]
        return Outline(self.mesh.points[loop], self.wall, self.fixed, origin, self.mesh.geometry)

    @property
    def boundary(self) -> Outline:
        """The outline of the aggregate. Raises MissingError in a clean channel."""
        return needed(self.outline, "an aggregate")

    @property
    def contact(self) -> bool:
        """Does the aggregate touch all walls?"""
        return all((self.wall == wall.number).any() for wall in self.mesh.walls)

    @property
    def mass(self) -> float:
        """X_A + X_I, integrated over the aggregate, um2 mg/L."""
        return float(self.active.sum() + self.inert.sum())

    def moved(self, points: np.ndarray) -> Pore:
        """The pore with the nodes of its mesh at ``points`` (N, 2) um."""
        return replace(self, space=Space(self.mesh.moved(points)))

    def with_body(self, position: np.ndarray, pressure: np.ndarray) -> Pore:
        """The pore with its aggregate's nodes at positions (n, 2) um and pressures at its corners;
        the fluid's nodes stay in place."""
        points = self.mesh.from_body(position, self.mesh.points)
        pressures = self.pressure.copy()
        pressures[self.mesh.topology.body_corners] = pressure
        return replace(self.moved(points), pressure=pressures)

    def composition(self, maximum_density: float) -> tuple[float, float, float]:
        """Share of X_I in the biomass, and the least and the largest (X_A + X_I) / X_m. The
        constraint J = theta keeps both near one."""
        density = (self.active + self.inert) / self.space.reaction.dx / maximum_density
        return float(self.inert.sum() / self.mass), float(density.min()), float(density.max())
