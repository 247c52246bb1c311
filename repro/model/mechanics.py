"""Equilibrium of a grown aggregate between the walls (2.3, 3.4): its loads and its constraints.

A :class:`Closing` closes films and wedges (2.3.3). One subclass joins nodes to a wall
(:mod:`repro.model.closing_by_nodes`). The other subclass moves contact lines
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
from repro.fem.walls import FREE, touched
from repro.model import growth
from repro.model.contact_lines import Advances, SearchOptions
from repro.model.pore import Pore
from repro.model.solid import Solid
from repro.model.support import Support
from repro.model.traction import Fluid
from repro.scene import Growth, Numerics, Scene

#: Largest number of rounds in one step in which closing films change the contact surfaces.
CONTACT_ROUNDS = 60


@dataclass(frozen=True, eq=False)
class Mechanics:
    """Data from which the shape of a grown aggregate is computed.

    keys: section [growth] of the scene; numerics: section [numerics]; fluid: data of the fluid
    forces, None if these are neglected.
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

    pore: with the new shapes. The fluid's nodes are not yet moved, and the mesh is divided if a
    contact line lies within an arc; iterations: of Newton's method; gaps: um, thinnest film at a
    wall without contact, in the old shape, and in the new shape before films close, infinite if
    this shape was not computed; divisions: in their order, one for each aggregate with contact
    lines within arcs; advances: {(index of the aggregate, wall, direction): um along its grown
    outline}; bisection: of the grown pore's mesh, before the divisions; None if no triangle is
    bisected.
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
        """This expansion followed by ``other``, the expansion of another aggregate in its pore."""
        gaps = min(self.gaps, other.gaps, key=lambda each: each[1])
        return Expansion(other.pore, self.iterations + other.iterations, gaps,
                         self.divisions + other.divisions, {**self.advances, **other.advances})

    def amounts(self, amounts: np.ndarray, grown: Pore) -> np.ndarray:
        """Carry amounts (r, q) from the points of ``grown`` to the points of the new shapes.

        The expansion must not have a bisection.
        """
        parts = [grown.of(region, amounts) for region in grown.mesh.regions]
        for division in self.divisions:
            parts[division.number] = division.amounts(parts[division.number], grown.space.table)
        return self.pore.joined(parts)

    def gathered(self, loads: np.ndarray) -> np.ndarray:
        """(n, 2) loads on the nodes of the grown aggregates, from loads on the new shapes' nodes.

        The expansion must not have a bisection.
        """
        mesh = self.pore.mesh
        nodal = mesh.from_body(loads)
        for division in self.divisions[::-1]:
            nodal = division.gathered_loads(nodal)
            mesh = division.parent
        return nodal[mesh.body]


@dataclass(eq=False)
class Closing(ABC):
    """Closing of thin films and wedges while an aggregate takes its new shape.

    grown: the pore with its new theta, in the old shape, focused on the aggregate; start: a pore on
    the same mesh with the shape and pressure from which the search starts; forces: (n, 2) um,
    constant nodal forces on the aggregate over mu_L, None for no forces; search: options of the
    search for contact lines.
    """

    mechanics: Mechanics
    grown: Pore
    start: Pore
    forces: np.ndarray | None
    search: SearchOptions

    @abstractmethod
    def close(self) -> Expansion:
        """The shape in which no film and no wedge is too thin.

        Raises GrowthError if there is no equilibrium or contact does not come to rest, and
        FirstContact if the film at the first contact is thinner than ``search`` accepts.
        """


def equilibrium(mechanics: Mechanics, grown: Pore, start: Pore, forces: np.ndarray | None, *,
                last: np.ndarray | None = None, patient: bool = True) -> tuple[Pore, int]:
    """Equilibrium of a grown pore under its theta, and the number of Newton iterations.

    start: a pore with the contact, and with the shape and pressure from which Newton's method
    starts.
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
    """(n, 2) True where a coordinate is prescribed, and (n, 2) um, positions with these values.

    x is prescribed at fixed points, y on the walls (2.3.3). Every node that is on a bonded wall
    before the step keeps its position.
    """
    rim = shape.region.own_loop
    before = grown.mesh.points[grown.region.nodes]
    walls = shape.body.wall
    fixed = shape.body.fixed
    target = shape.mesh.points[shape.region.nodes].copy()
    for wall in shape.walls:
        target[rim[touched(walls) == wall.number], 1] = wall.y
        fixed = fixed | (wall.bonded & wall.holds(before[rim]))
    target[rim[fixed], 0] = before[rim[fixed], 0]
    return constrained(len(target), rim, walls, fixed), target


def supports_of(solid: Solid, shape: Pore, forces: np.ndarray | None) -> list[Support]:
    """The supports of the contact surfaces of ``solid``, by :func:`surface_supports`.

    Without ``forces`` (n, 2) a single sliding surface needs no support, because the forces of
    growth along the pore add up to zero.
    """
    bearing = surface_supports(solid, shape)
    alone = len(bearing) == 1 and not any(wall.bonded for wall in shape.walls)
    return [] if alone and forces is None else bearing


def surface_supports(solid: Solid, shape: Pore) -> list[Support]:
    """The supports of the contact surfaces of ``solid`` that slide and have a fixed point.

    A surface of a single node has no length and no support; a force at the node keeps it in place.
    """
    outline = shape.boundary
    rim = shape.region.own_loop
    walls = shape.walls
    bearing = []
    for wall in walls:
        edges = rim[outline.edges_on(wall.number)]
        points = rim[outline.fixed & outline.touches(wall.number) & (not wall.bonded)]
        if len(edges) and len(points):
            bearing.append(Support.on(int(points[0]), edges, solid.reference))
    return bearing


def constrained(count: int, rim: np.ndarray, wall: np.ndarray, fixed: np.ndarray) -> np.ndarray:
    """(count, 2) True where a coordinate is prescribed: x at fixed points, y on the walls (2.3.3).

    rim: (M,) indices of the boundary's nodes; wall, fixed: (M,), as in an outline.
    """
    prescribed = np.zeros((count, 2), bool)
    prescribed[rim[fixed], 0] = True
    prescribed[rim[touched(wall) != FREE], 1] = True
    return prescribed


def with_new_surfaces(pore: Pore) -> Pore:
    """The pore with a fixed point in the middle of each new contact surface."""
    outline = pore.boundary
    fixed = outline.fixed
    for wall in pore.walls:
        if wall.keeps_point and not outline.fixed[outline.touches(wall.number)].any():
            fixed = fixed | middle_of(outline, wall.number)
    return pore.with_body(fixed=fixed)


def middle_of(outline: Outline, wall: int) -> np.ndarray:
    """(M,) True at the node nearest to the middle of the contact surface with a wall.

    If this node is the middle of an arc, the corner before it is chosen.
    """
    on = outline.touches(wall)
    x = outline.points[:, 0]
    chosen = np.zeros(len(on), bool)
    if on.any():
        middle = 0.5 * (x[on].min() + x[on].max())
        index = int(np.flatnonzero(on)[np.argmin(np.abs(x[on] - middle))])
        chosen[index - index % outline.geometry] = True
    return chosen
