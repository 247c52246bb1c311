"""Equilibrium of a grown aggregate between the walls (2.3, 3.4): its loads and its constraints.

A :class:`Closing` closes films and wedges (2.3.3). One subclass moves nodes
(:mod:`repro.model.closing_by_nodes`), the other contact lines
(:mod:`repro.model.closing_by_lines`).
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, field
from math import inf

import numpy as np

from repro.fem.division import Division
from repro.fem.outline import Outline
from repro.fem.refinement import Bisection
from repro.fem.walls import touches_wall
from repro.model import growth
from repro.model.contact_lines import Advances, SearchOptions
from repro.model.pore import Pore
from repro.model.solid import Solid
from repro.model.support import Support
from repro.model.traction import Fluid
from repro.scene import Growth, Numerics, Scene

#: Largest number of rounds in which closing films change the contact surfaces in one step.
CONTACT_ROUNDS = 60


@dataclass(frozen=True, eq=False)
class Mechanics:
    """Data from which the shape of a grown aggregate is computed.

    keys: section [growth] of the scene; numerics: Newton's method; fluid:
    its forces on the aggregate, None if they are neglected.
    """

    keys: Growth
    numerics: Numerics
    fluid: Fluid | None = None

    @classmethod
    def of(cls, scene: Scene) -> Mechanics:
        """The mechanics of a scene with growth."""
        keys = scene.growing.growth
        fluid = Fluid.of(scene) if keys.has_fluid_forces else None
        return cls(keys, scene.numerics, fluid)


@dataclass(frozen=True, eq=False)
class Expansion:
    """Aggregates in their new shapes.

    pore: with the fluid's nodes not yet moved, on the divided mesh if a contact line lies
    within an arc; iterations: of Newton's method; gaps: um, of the aggregate with the thinnest film
    at a wall that it does not touch, this film in the old and in the new shape before films close;
    divisions: one after the other, for each aggregate with lines within arcs; advances: {(number,
    wall, direction): um} by which contact lines of an aggregate, by its place in the list, have
    advanced along its grown outline; bisection: of the grown pore's mesh, before the divisions;
    None if no triangle is bisected.
    """

    pore: Pore
    iterations: int
    gaps: tuple[float, float] = (inf, inf)
    divisions: tuple[Division, ...] = ()
    advances: Advances = field(default_factory=dict)
    bisection: Bisection | None = None

    @property
    def position(self) -> np.ndarray:
        """(N, 2) um, new positions of the grown pore's nodes."""
        points = self.pore.mesh.points
        for division in self.divisions[::-1]:
            points = division.restricted(points)
        return self.bisection.restricted(points) if self.bisection else points

    def joined(self, other: Expansion) -> Expansion:
        """This expansion and then that of another aggregate in its pore."""
        gaps = min(self.gaps, other.gaps, key=lambda each: each[1])
        return Expansion(other.pore, self.iterations + other.iterations, gaps,
                         self.divisions + other.divisions, {**self.advances, **other.advances})

    def amounts(self, amounts: np.ndarray, grown: Pore) -> np.ndarray:
        """Carry amounts (r, q) from the points of the grown pore's aggregates to those of the new
        shapes. For expansions without a bisection."""
        parts = [grown.of(region, amounts) for region in grown.mesh.regions]
        for division in self.divisions:
            parts[division.number] = division.amounts(parts[division.number], grown.space.table)
        return self.pore.joined(parts)

    def gathered(self, loads: np.ndarray) -> np.ndarray:
        """(n, 2) loads on the nodes of the grown aggregates, from those on the new shapes' nodes.
        For expansions without a bisection."""
        mesh = self.pore.mesh
        nodal = mesh.from_body(loads)
        for division in self.divisions[::-1]:
            nodal = division.gathered_loads(nodal)
            mesh = division.parent
        return nodal[mesh.body]


@dataclass(eq=False)
class Closing(ABC):
    """Closing of the films and wedges that are too thin while an aggregate takes its new shape.

    grown: the pore with its new theta, in the old shape, seen from the aggregate; start: a pore on
    the same mesh with the shape and pressure from which the search starts; forces: (n, 2) um,
    constant nodal forces on the aggregate over mu_L, None for no forces; search: its options.
    """

    mechanics: Mechanics
    grown: Pore
    start: Pore
    forces: np.ndarray | None
    search: SearchOptions

    @abstractmethod
    def close(self) -> Expansion:
        """The shape in which no film and no wedge is too thin. Raises GrowthError, and FirstContact
        if the first contact comes too late for ``search``."""


def equilibrium(mechanics: Mechanics, grown: Pore, start: Pore, forces: np.ndarray | None, *,
                last: np.ndarray | None = None, patient: bool = True) -> tuple[Pore, int]:
    """Equilibrium of a grown pore under its theta, and the count of Newton iterations.

    ``start`` has the contact, and the shape and pressure from which Newton's method starts.
    """
    solid, target_J = grown.body.strained
    nodes = grown.region.nodes
    inside = grown.region.corner_nodes
    locked, target = constraints(grown, start)
    rest = growth.equilibrium(solid, target_J, start.mesh.points[nodes], start.pressure[inside],
                              locked, target, forces=forces, last=last, patient=patient,
                              supports=supports_of(solid, start, forces),
                              modified_newton=mechanics.numerics.scheme.modified_newton)
    shape = grown.placed(rest.position, rest.pressure)
    return shape.with_body(wall=start.body.wall), rest.iterations


def constraints(grown: Pore, shape: Pore) -> tuple[np.ndarray, np.ndarray]:
    """(n, 2) True where a coordinate is prescribed, and (n, 2) um, its prescribed value.

    x is prescribed at fixed points, y on the walls (2.3.3). Every point that lay on a bonded wall
    before the step keeps its position.
    """
    rim = shape.region.own_loop
    before = grown.mesh.points[grown.region.nodes]
    touched = shape.body.wall
    fixed = shape.body.fixed
    target = shape.mesh.points[shape.region.nodes].copy()
    for wall in shape.walls:
        target[rim[touched == wall.number], 1] = wall.y
        fixed = fixed | (wall.bonded & wall.holds(before[rim]))
    target[rim[fixed], 0] = before[rim[fixed], 0]
    return constrained(len(target), rim, touched, fixed), target


def supports_of(solid: Solid, shape: Pore, forces: np.ndarray | None) -> list[Support]:
    """The supports of the contact surfaces of ``solid``, by :func:`surface_supports`.

    Without ``forces`` (n, 2) one surface alone bears none, because the forces of growth along the
    pore add up to zero.
    """
    bearing = surface_supports(solid, shape)
    alone = len(bearing) == 1 and not any(wall.bonded for wall in shape.walls)
    return [] if alone and forces is None else bearing


def surface_supports(solid: Solid, shape: Pore) -> list[Support]:
    """The supports of the contact surfaces of ``solid`` that slide and have a fixed point.

    A surface of a single node has no length; the node bears its force.
    """
    outline = shape.boundary
    rim = shape.region.own_loop
    walls = shape.walls
    bearing = []
    for wall in walls:
        edges = rim[outline.edges_on(wall.number)]
        points = rim[outline.fixed & (outline.wall == wall.number) & (not wall.bonded)]
        if len(edges) and len(points):
            bearing.append(Support.on(int(points[0]), edges, solid.reference))
    return bearing


def constrained(count: int, rim: np.ndarray, wall: np.ndarray, fixed: np.ndarray) -> np.ndarray:
    """(count, 2) True where a coordinate is prescribed: x at fixed points, y on the walls (2.3.3).

    rim: (M,) the boundary's nodes among all; wall, fixed: (M,), as in an outline.
    """
    prescribed = np.zeros((count, 2), bool)
    prescribed[rim[fixed], 0] = True
    prescribed[rim[touches_wall(wall)], 1] = True
    return prescribed


def with_new_surfaces(pore: Pore) -> Pore:
    """The pore with fixed points in the middles of contact surfaces that have just formed."""
    outline = pore.boundary
    fixed = outline.fixed
    for wall in pore.walls:
        if wall.keeps_point and not outline.fixed[outline.wall == wall.number].any():
            fixed = fixed | middle_of(outline, wall.number)
    return pore.with_body(fixed=fixed)


def middle_of(outline: Outline, wall: int) -> np.ndarray:
    """(M,) True at the node nearest to the middle of the contact surface with a wall; the corner
    before it if that node is the middle of an arc."""
    on = outline.wall == wall
    x = outline.points[:, 0]
    chosen = np.zeros(len(on), bool)
    if on.any():
        middle = 0.5 * (x[on].min() + x[on].max())
        index = int(np.flatnonzero(on)[np.argmin(np.abs(x[on] - middle))])
        chosen[index - index % outline.geometry] = True
    return chosen
