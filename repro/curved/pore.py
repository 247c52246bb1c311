"""The state of a pore on a curved mesh, and what is solved in its geometry; as :mod:`repro.model.pore`."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from repro.curved import elements, flow, outline, transport
from repro.curved.fields import space
from repro.curved.mesh import CurvedMesh, curved, unlocked
from repro.curved.outline import Arcs
from repro.fem import geometry
from repro.fem import mesh as linear_mesh
from repro.model.flow import poiseuille_loss
from repro.model.pore import Solved, film, peclet, refuse_no_supply
from repro.model.transport import Concentrations
from repro.timing import timed

#: Elements are made no larger than this asks for: the concentration boundary layer is W Pe^(-1/3) thick (Leveque), and
#: with four elements across the pore and this factor an overshoot upstream of an aggregate stays under 1 %.
BOUNDARY_LAYER = 0.15
#: Rounds in which arcs that bend too much for the triangles beside them are halved.
HALVINGS = 6


@dataclass(frozen=True, eq=False)
class Pore:
    """Geometry and biomass at one time.

    time: h; wall, fixed: (2 M,) of each node of ``mesh.loop``; origin: (N, 2) um, places of the material at t = 0;
    reference: (N, 2) um, places when the mesh was made; active, inert: (N,) mass of X_A and X_I per area of the
    reference over X_m: their sum is the expansion since then, and X_A = X_m active / (active + inert); zero outside the
    aggregate; pressure: (corners,) P / mu_L; concentrations: a first guess of them.
    """

    time: float
    mesh: CurvedMesh
    wall: np.ndarray
    fixed: np.ndarray
    active: np.ndarray
    inert: np.ndarray
    origin: np.ndarray
    reference: np.ndarray
    pressure: np.ndarray
    concentrations: Concentrations | None = None

    @cached_property
    def outline(self) -> Arcs | None:
        """Boundary of the aggregate, corners and middles in turn; None in a clean channel."""
        loop = self.mesh.loop
        if len(loop) == 0:
            return None
        return Arcs(self.mesh.points[loop], self.wall, self.fixed, self.origin[loop])

    @property
    def contact(self) -> bool:
        """Does the aggregate touch the opposite wall?"""
        return bool((self.wall == geometry.TOP).any())

    def mass(self) -> float:
        """(X_A + X_I) / X_m integrated over the aggregate, um2."""
        return float(self.weights() @ (self.active + self.inert))

    def inert_mass(self) -> float:
        """X_I / X_m integrated over the aggregate, um2."""
        return float(self.weights() @ self.inert)

    def weights(self) -> np.ndarray:
        """(N,) integrals of the nodal functions over the aggregate as it was when the mesh was made, um2."""
        def found():
            return elements.weights(elements.places(self.reference[self.mesh.cells[self.mesh.biomass]]).dx, self.mesh)
        return self.mesh.once("reference weights", found)

    def composition(self, maximum_density: float) -> tuple[float, float, float]:
        """Share of X_I in the biomass, and the least and the largest (X_A + X_I) / X_m, which the constraint J = theta
        keeps near one."""
        cells = self.mesh.cells[self.mesh.biomass]
        expansion = elements.at_points(self.active + self.inert, cells)
        before = elements.places(self.reference[cells]).dx
        density = expansion * before / self.mesh.places.dx[self.mesh.biomass]
        return self.inert_mass() / self.mass(), float(density.min()), float(density.max())


def resolution(scene) -> float:
    """What element sizes are divided by: ``numerics.refinement``, or more where boundary layers ask for it.

    The speed is the scene's mean velocity, or that of the clean channel under its head.
    """
    if scene.flow is None or scene.substrates is None:
        return scene.numerics.refinement
    return max(scene.numerics.refinement, BOUNDARY_LAYER * peclet(scene, _fastest(scene)) ** (1 / 3))


def sizing(scene) -> geometry.Sizing:
    """How large the elements of its meshes are to be."""
    return geometry.Sizing(scene.pore.width, resolution(scene), film(scene), scene.numerics.gradation)


def _fastest(scene) -> float:
    drive = scene.flow
    if drive.head is None:
        return drive.mean_velocity
    return drive.head * drive.gravity / drive.kinematic_viscosity / poiseuille_loss(scene.pore.length, scene.pore.width)


def seeded(scene) -> Pore:
    """The pore at t = 0."""
    start = outline.seed(scene.aggregate.radius, resolution(scene)) if scene.aggregate else None
    grid, start = generate(scene, start)
    count = len(grid.points)
    active = np.zeros(count)
    active[grid.body] = 1.0 if scene.kinetics else 0.0
    wall, fixed = (start.wall, start.fixed) if start else (np.empty(0, int), np.empty(0, bool))
    return Pore(0.0, grid, wall, fixed, active, np.zeros(count), grid.points,
                grid.points, np.zeros(grid.corners))


@timed("meshing")
def generate(scene, around: Arcs | None) -> tuple[CurvedMesh, Arcs | None]:
    """A new curved mesh around an aggregate (None: a clean channel), and the outline with the nodes that it has there.

    Raises MeshError where the outline crosses itself or the channel's ends, or where a curved triangle is turned over.
    """
    width = scene.pore.width
    wanted = sizing(scene)
    ends = geometry.meshed_extent(around, width, scene.pore.length,
                                  scene.numerics.extent == "full")
    if around is None:
        straight = linear_mesh.around(None, ends, wanted)
        return curved(straight, np.empty((0, 2))), None
    for _ in range(HALVINGS):
        around = outline.split(around, wanted)
        polygon = outline.corners(around)
        linear_mesh.check_outline(polygon, ends, width)
        straight = unlocked(linear_mesh.around(polygon, ends, wanted))
        grid = curved(straight, around.points[1::2])
        strained = grid.strained_arcs()
        if not strained.any():
            break
        around = outline.halved(around, strained)
    return grid.checked(), around


def active_biomass(scene, now: Pore) -> np.ndarray:
    """(N,) X_A, mg/L."""
    theta = now.active + now.inert
    there = theta > 0
    return scene.kinetics.maximum_density * np.where(there, now.active / np.where(there, theta, 1.0), 0.0)


def solve(scene, now: Pore) -> Solved:
    """Flow, then substrates, in the geometry of the pore: what the scene's sections ask for; at the mesh's nodes, of
    whatever order they are found with."""
    order = scene.numerics.order
    here = space(now.mesh, order)
    carried = flow.solve(now.mesh, scene.flow, scene.pore.length, order) if scene.flow else None
    shown = replace(carried, velocity=here.to_mesh(carried.velocity)) if carried else None
    if scene.substrates is None:
        return Solved(shown, None, None)
    refuse_no_supply(scene, carried)
    found = transport.problem(now.mesh, carried, scene.substrates, scene.kinetics, scene.numerics.jacobian == "reused",
                              order)
    active = active_biomass(scene, now) if scene.kinetics else None
    state = transport.steady(found, active, _at(here.of_mesh, now.concentrations))
    return Solved(shown, found, _at(here.to_mesh, state), transport.fluxes(found, active, state))


def _at(nodes: Callable[[np.ndarray], np.ndarray], state: Concentrations | None) -> Concentrations | None:
    """Concentrations at other nodes."""
    return state and replace(state, acceptor=nodes(state.acceptor), donor=nodes(state.donor))
