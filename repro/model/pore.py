"""The state of a pore at an instant, and what is solved in its geometry."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from repro.errors import TransportError
from repro.fem import geometry, mesh
from repro.fem.geometry import Outline
from repro.fem.mesh import PoreMesh
from repro.model import flow, gear, transport

#: The thinnest film to resolve where no [growth] says when it closes (Table 1), um.
MINIMUM_FILM = 2.0
#: Under this Peclet number u W / D the inlet supplies nothing that could be told from round-off.
SLOWEST = 1e-9


@dataclass(frozen=True, eq=False)
class Pore:
    """Geometry and biomass at one time.

    time: h; wall: (M,) contact of each node of ``mesh.loop``; fixed: (M,) its x is held; active, inert: X_A, X_I (N,)
    mg/L, zero outside the aggregate; origin: (N, 2) um, where the material at a node was at t = 0 (meaningful in the
    aggregate); theta: (t,) expansion since t = 0 of each biomass triangle; pressure: (N,) P / mu_L;
    concentrations: the last known ones, None before the first.
    """

    time: float
    mesh: PoreMesh
    wall: np.ndarray
    fixed: np.ndarray
    active: np.ndarray
    inert: np.ndarray
    origin: np.ndarray
    theta: np.ndarray
    pressure: np.ndarray
    concentrations: transport.Concentrations | None = None

    @property
    def outline(self) -> Outline | None:
        """Boundary of the aggregate, None in a clean channel."""
        loop = self.mesh.loop
        if len(loop) == 0:
            return None
        return Outline(self.mesh.points[loop], self.wall, self.fixed, self.origin[loop])

    @property
    def contact(self) -> bool:
        """Does the aggregate touch the opposite wall?"""
        return bool((self.wall == geometry.TOP).any())

    def composition(self, maximum_density: float) -> tuple[float, float, float]:
        """Share of X_I in the biomass, and the least and the largest (X_A + X_I) / X_m."""
        weight, total = self.mesh.lumped(self.mesh.biomass), self.active + self.inert
        density = total[self.mesh.body] / maximum_density
        return float(weight @ self.inert / (weight @ total)), float(density.min()), float(density.max())


@dataclass(frozen=True, eq=False)
class Solved:
    """Flow and substrates in the geometry of a pore, and the ledgers of acceptor and donor; None where the scene does
    not model them."""

    flow: flow.Flow | None
    problem: transport.Problem | None
    concentrations: transport.Concentrations | None
    fluxes: tuple[transport.Fluxes, transport.Fluxes] | None = None


def film(scene) -> float:
    """Thickness (um) at which a film closes, and the least that the mesh resolves."""
    return scene.growth.minimum_film if scene.growth else MINIMUM_FILM


def sizing(scene) -> geometry.Sizing:
    """How large the elements of its meshes are to be."""
    return geometry.Sizing(scene.pore.width, scene.numerics.refinement, film(scene), scene.numerics.gradation)


def seeded(scene) -> Pore:
    """The pore at t = 0: X_A = X_m in a half-disc (Table 1), or a clean channel."""
    numerics, width = scene.numerics, scene.pore.width
    outline = geometry.seed(scene.aggregate.radius, numerics.refinement) if scene.aggregate else None
    ends = geometry.meshed_extent(outline, width, scene.pore.length, numerics.extent == "full")
    grid, outline = mesh.generate(outline, ends, sizing(scene))
    count = len(grid.points)
    density = scene.kinetics.maximum_density if scene.kinetics else 0.0
    active = np.zeros(count)
    active[grid.body] = density
    wall, fixed = (outline.wall, outline.fixed) if outline else (np.empty(0, int), np.empty(0, bool))
    return Pore(0.0, grid, wall, fixed, active, np.zeros(count), grid.points.copy(),
                np.ones(np.count_nonzero(grid.biomass)), np.zeros(count))


def solve(scene, pore: Pore) -> Solved:
    """Flow, then substrates, in the geometry of the pore: what the scene's sections ask for."""
    carried = solve_flow(scene, pore) if scene.flow else None
    if scene.substrates is None:
        return Solved(carried, None, None)
    problem = transport.problem(pore.mesh, carried, scene.substrates, scene.kinetics, scene.numerics.inlet,
                                scene.numerics.jacobian == "reused")
    find = gear.settle
    if scene.numerics.transport != "gear":
        refuse_no_supply(scene, carried)
        find = transport.steady
    state = find(problem, pore.active, pore.concentrations)
    return Solved(carried, problem, state, transport.fluxes(problem, pore.active, state))


def peclet(scene, speed: float) -> float:
    """u W / D with the smaller diffusivity, for a mean velocity (um/h)."""
    kinds = (scene.substrates.acceptor, scene.substrates.donor)
    return speed * scene.pore.width / min(min(s.diffusivity, s.diffusivity_in_aggregate) for s in kinds)


def refuse_no_supply(scene, carried: flow.Flow | None) -> None:
    """Raises TransportError where the flow is too slow to supply anything: no state would be steady."""
    if carried and peclet(scene, carried.mean_velocity) < SLOWEST:
        raise TransportError(f"the Peclet number u W / D is {peclet(scene, carried.mean_velocity):.2g}, under "
                             f"{SLOWEST:g}: nothing is supplied through the inlet; leave [flow] out for pure diffusion")


def solve_flow(scene, pore: Pore) -> flow.Flow:
    """Stokes flow under the scene's head or mean velocity."""
    numerics, drive = scene.numerics, scene.flow
    unit = flow.unit_flow(pore.mesh, drive.viscosity_ratio, interface=numerics.interface,
                          stabilisation=numerics.flow_stabilisation, element=numerics.flow_element)
    return flow.scaled(unit, pore.mesh, scene.pore.length, drive.kinematic_viscosity / drive.gravity, head=drive.head,
                       mean_velocity=drive.mean_velocity)
