"""Meshes of a scene (3.1): their element sizes, the first outline, and the pore at t = 0."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import cycle
from math import inf

import numpy as np

from repro.errors import MeshError
from repro.fem import mesher, sizing
from repro.fem.linear import Method
from repro.fem.mesh import Mesh, Region
from repro.fem.outline import Outline, half_disc, polygon
from repro.fem.sizing import Sizing
from repro.fem.space import Space
from repro.fem.walls import Seat, Walls, channel_walls
from repro.model.body import Body
from repro.model.configuration import configuration_of
from repro.model.energies import energy_of
from repro.model.flow import poiseuille_loss
from repro.model.interface import interface_of
from repro.model.pore import Pore
from repro.model.resistance import resistance_of
from repro.model.solid import material
from repro.scene import Aggregate, Growth, Numerics, Scene, Substrates, at_largest, needed
from repro.scene import Flow as Drive
from repro.scene import Pore as Channel

#: The largest refinement that scenes accept.
MOST_REFINED = 20.0
#: Refinement of quadratic elements over Pe^(1/3): the concentration boundary layer is W Pe^(-1/3)
#: thick (Leveque). With four elements across the pore and this factor, concentrations upstream of
#: an aggregate exceed the supply by less than 0.01 %.
BOUNDARY_LAYER = 0.15
#: Largest refinement for layers. A finer mesh has more nodes, the square of this, than the 32-bit
#: indices of sparse matrices can count.
FINEST_LAYERS = 2.0**15.5
#: W over the least length of the edges at the tips of an outline.
MOST_AT_TIPS = 20_000.0


def walls_of(scene: Scene) -> Walls:
    """The walls of a scene's pore."""
    bonded = bool(scene.growth and scene.growth.bonded)
    return channel_walls(scene.pore.width, bonded, scene.pore.upper_wall)


def film(scene: Scene) -> float:
    """Thickness (um) below which a film closes. It is also the thinnest film that a mesh resolves.

    Without growth it is the default of growth.minimum_film.
    """
    return (scene.growth or Growth(end=0.0)).minimum_film


def least_gap(scene: Scene) -> float:
    """Distance (um) of an aggregate from the opposite wall at which the film there closes."""
    _, opposite = walls_of(scene)  # an aggregate's own wall is never a plane of symmetry
    return film(scene) * opposite.part


def resolution(scene: Scene) -> float:
    """Divisor of the element sizes outside films: ``numerics.refinement``, or more for layers.

    The layers follow from the largest mean velocity (:func:`fastest`). Raises MeshError if no mesh
    resolves them.
    """
    if not (scene.numerics.scheme.follows_layers and scene.flow and scene.substrates):
        return scene.numerics.refinement
    layers = BOUNDARY_LAYER * _largest_peclet(scene) ** (1 / 3)
    if layers > FINEST_LAYERS:
        raise MeshError(f"no mesh resolves the boundary layers: {thin_layers(scene)}")
    return max(scene.numerics.refinement, layers)


def _largest_peclet(scene: Scene) -> float:
    speed = fastest(needed(scene.flow, "a flow"), scene.pore)
    return peclet(needed(scene.substrates, "substrates"), scene.pore.width, speed)


def peclet(substrates: Substrates, width: float, speed: float) -> float:
    """u W / D with the smallest diffusivity; width: W, um; speed: mean velocity u, um/h."""
    return speed * width / substrates.slowest


def thin_layers(scene: Scene) -> str:
    """Text with the Peclet number of a scene with flow and substrates, and the keys that reduce it.
    """
    by_head = "flow.head or flow.gravity, a larger flow.kinematic_viscosity"
    drive = needed(scene.flow, "a flow")
    other = "flow.rate" if drive.rate is not None else "flow.mean_velocity"
    substrates = needed(scene.substrates, "substrates").modelled
    diffusivities = " and ".join(f"substrates.{name}.diffusivity*" for name in substrates)
    return (f"the Peclet number u W / D is {_largest_peclet(scene):.2g}; a smaller "
            f"{other if drive.head is None else by_head}, or larger {diffusivities} are needed")


def fastest(drive: Drive, channel: Channel) -> float:
    """Largest mean velocity (um/h) of a flow. Under a head it is the velocity in a clean channel.
    """
    largest = at_largest(drive)
    if largest.mean_velocity is not None:
        return largest.mean_velocity
    loss = poiseuille_loss(channel.length, channel.whole_width)
    return largest.driving_head * drive.gravity / drive.kinematic_viscosity / loss


def sized(scene: Scene) -> Sizing:
    """Element sizes of a scene's meshes, without a front of the substrates.

    Boundary layers refine all elements except in films, because a film is thinner than its layers.
    """
    least = film(scene)
    across = scene.numerics.contact_elements
    if scene.flow:
        across = max(across, resistance_of(scene.flow).contact_elements)
    return Sizing(walls_of(scene), resolution(scene), least, scene.numerics.gradation,
                  contact=least / across if across else inf,
                  film_refinement=scene.numerics.refinement)


@dataclass(frozen=True, eq=False)
class Meshing:
    """Data from which the meshes of a scene are generated and moved.

    channel: section [pore] of the scene; sizes: of the elements, without a front; numerics: section
    [numerics], for the extent and the order of a mesh, and for the linear solver.
    """

    channel: Channel
    sizes: Sizing
    numerics: Numerics

    @classmethod
    def of(cls, scene: Scene) -> Meshing:
        """The meshing of a scene."""
        return cls(scene.pore, sized(scene), scene.numerics)

    def around(self, outlines: Sequence[Outline],
               front: float = 1.0) -> tuple[Mesh, list[Outline]]:
        """Generate a mesh around aggregates, with the extent of 3.1.

        Also returns the outlines with their nodes on the mesh. See
        :func:`repro.fem.mesher.generate_around`; front: as :attr:`Pore.front`.
        """
        numerics = self.numerics
        sizes = replace(self.sizes, front=front)
        return mesher.generate_around(outlines, self.extent(outlines), sizes,
                                      numerics.scheme.order, Method(numerics.solver))

    def extent(self, outlines: Sequence[Outline]) -> tuple[float, float]:
        """x (um) of both ends of a mesh around aggregates (3.1)."""
        extents = [sizing.meshed_extent(outline, self.sizes.whole_width, self.channel.length,
                                        self.numerics.whole_pore)
                   for outline in outlines or (None,)]
        firsts, lasts = zip(*extents)
        return min(firsts), max(lasts)


def size_at_tips(numerics: Numerics, width: float) -> float:
    """Length (um) of the edges at an outline's tips; width: of the pore, um."""
    finest = min(numerics.scheme.edges_at_tips * numerics.refinement**2, MOST_AT_TIPS)
    return width / finest


@dataclass(frozen=True, eq=False)
class Seeding:
    """Data from which the pore at t = 0 is made.

    seeds: sections [aggregate], none in a clean channel; names: of these aggregates;
    maximum_density: X_m, mg/L, zero without kinetics; growth: section [growth], None if nothing
    grows.
    """

    meshing: Meshing
    seeds: tuple[Aggregate, ...]
    names: list[str]
    maximum_density: float
    growth: Growth | None

    @classmethod
    def of(cls, scene: Scene) -> Seeding:
        """The seeding of a scene."""
        density = scene.kinetics.maximum_density if scene.kinetics else 0.0
        return cls(Meshing.of(scene), scene.aggregates, scene.labels, density, scene.growth)

    def outlines(self, front: float = 1.0) -> list[Outline]:
        """The boundaries of the aggregates; front: as :attr:`Pore.front`."""
        return [self._outline(seed, front) for seed in self.seeds]

    def _outline(self, seed: Aggregate, front: float) -> Outline:
        """The boundary of one aggregate."""
        numerics = self.meshing.numerics
        sizes = self.meshing.sizes
        geometry = numerics.scheme.order
        wall = sizes.walls[("lower", "upper").index(seed.wall)]
        if seed.radius is None:
            points = np.array(seed.outline) + [seed.position, 0.0]
            return polygon(points, Seat(wall.number).walls(sizes.walls), geometry, seed.smooth,
                           size_at_tips(numerics, self.meshing.channel.width),
                           bends=interface_of(numerics.interface).bends)
        across = sizing.ACROSS_AGGREGATE * sizes.refinement * front
        return half_disc(seed.radius, across, geometry, seed.position, wall)

    def pore(self, front: float, outline: Outline | None = None) -> Pore:
        """The pore at t = 0, as :func:`seeded` makes it."""
        return self.around([outline] if outline else self.outlines(front), front)

    def around(self, outlines: Sequence[Outline], front: float = 1.0) -> Pore:
        """The pore at t = 0 with aggregates in ``outlines``.

        Each aggregate has the composition of a seed, in turn. If the numbers of outlines and seeds
        differ, the aggregates are named by numbers.
        """
        mesh, outlines = self.meshing.around(outlines, front)
        space = Space(mesh)
        fractions = cycle([seed.inert_fraction for seed in self.seeds] or [0.0])
        own = len(outlines) == len(self.seeds)
        names = self.names if own else [str(k + 1) for k in range(len(outlines))]
        bodies = [self._body(space, *each)
                  for each in zip(mesh.regions, outlines, fractions, names)]
        return Pore(0.0, space, tuple(bodies), np.zeros(mesh.corners), front=front)

    def _body(self, space: Space, region: Region, outline: Outline, fraction: float,
              name: str) -> Body:
        """The aggregate of a region; fraction: of inert biomass; name: in messages."""
        total = self.maximum_density * space.reaction.dx[space.integration.rows(region)]
        inert = total * fraction
        solid = material(space, region, space.mesh.points[region.nodes], energy_of(self.growth))
        theta = np.ones((len(region.triangles), len(solid.shape.table.weights)))
        return Body(outline.wall, outline.fixed, total - inert, inert, theta, solid,
                    configuration_of(self.growth, solid.reference), seat=outline.seat,
                    name=name)


def initial_outlines(scene: Scene) -> list[Outline]:
    """The boundaries of the aggregates at t = 0."""
    return Seeding.of(scene).outlines()


def seeded(scene: Scene, front: float = 1.0, outline: Outline | None = None) -> Pore:
    """Make the pore at t = 0: X_A + X_I = X_m in the aggregate (Table 1), or a clean channel.

    Parameters
    ----------
    scene : Scene
    front : float
        As :attr:`Pore.front`.
    outline : Outline, optional
        Replaces the scene's outlines.

    Returns
    -------
    Pore

    Raises
    ------
    MeshError
        If no mesh can be made around the outline.
    """
    return Seeding.of(scene).pore(front, outline)
