"""Flow (2.1, 3.2): steady Stokes flow with a viscosity jump between fluid and biomass.

(1) ``(nu/g) lap u - grad phi = 0`` and (2) ``div u = 0``, with nu = nu_water in the fluid, lambda
nu_water in biomass; (3) parabolic profile at the inlet; (4) ``du/dx = 0`` and mean head zero at the
outlet; (5) u = 0 on the walls. In the weak form, with the velocity scaled to mean 1 um/h and p =
phi g / nu_water,

    a(u, v) - (p, div v) = 0
    (q, div u) + sum_tau (tau grad p, grad q) = 0

with nu_r = 1 or lambda, and a(u, v) of :mod:`repro.model.interface` [E2].
:mod:`repro.model.resistance` adds permeable aggregates.

Quadratic velocities with a linear pressure (Taylor-Hood) need no tau. Where the viscosity jumps,
the pressure jumps too. Each corner on the interface therefore has a pressure of the fluid and a
pressure of the biomass. With a single pressure the head loss errs by up to 1 % if the aggregate
spans the pore, and by 2 to 5 % if it bends (traction form), on every mesh that was tried. The
pressure does not jump if the viscosity of the aggregate is that of water, as in permeable
aggregates.

Linear velocities with a linear pressure need tau = h_tau^2 / (c nu_r). The paper prints no constant
c [E13]; ``reference/ERRATA.md`` reports its effect. By the second equation, w = u - tau grad p is
divergence-free against every linear q. Therefore w carries the substrates.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from repro.fem.assembly import ElementSystem, saddle_blocks, saddle_system
from repro.fem.brief import brief
from repro.fem.forms import each, product
from repro.fem.mesh import Mesh
from repro.fem.space import Space
from repro.model.interface import LAPLACIAN, Interface
from repro.model.resistance import WATER, Resistance, resistance_of
from repro.scene import Flow as Drive
from repro.timing import timed

#: rho g in MPa/um, for rho in mg/L and g in um/h^2.
MPA_PER_UM = 1e-3 * 1e-6 / 3600**2 * 1e-12
#: c of tau, not printed: with 25 to 400 the velocity of base changes by up to 0.8 % [E13].
STABILISATION = 100.0


@brief
@dataclass(frozen=True, eq=False)
class Flow:
    """Flow through the pore.

    mean_velocity: um/h; velocity: (n, 2) um/h at the nodes of its space; head: (m,) um at the
    mesh's corners, on the interface that of the fluid; correction: (T, 2) um/h, tau grad p, so that
    w = u - correction, None for quadratic velocities; meshed_loss, head_loss: um, over the meshed
    part and over the entire pore; conductivity: um/h; biomass_head: (m,) um, like head, but on the
    interface that of the biomass, None if the head does not jump there.
    """

    mean_velocity: float
    velocity: np.ndarray
    head: np.ndarray
    correction: np.ndarray | None
    meshed_loss: float
    head_loss: float
    conductivity: float
    biomass_head: np.ndarray | None = None


@dataclass(frozen=True, eq=False)
class UnitFlow:
    """Flow of mean velocity one.

    velocity: (n, 2) and correction: (T, 2), without unit; pressure: (m,) 1/um at the corners, on
    the interface that of the fluid; loss: 1/um, of pressure over the meshed part; biomass_pressure:
    (m,) 1/um, on the interface that of the biomass, None if the pressure does not jump. The head
    loss (6) is the loss times nu_water / g times the mean velocity.
    """

    velocity: np.ndarray
    pressure: np.ndarray
    correction: np.ndarray | None
    loss: float
    biomass_pressure: np.ndarray | None = None


def tau(mesh: Mesh, viscosity: np.ndarray | float) -> np.ndarray:
    """(T,) um2: h^2 / (c nu_r) of each triangle, for its viscosity nu_r."""
    return mesh.circumdiameter**2 / (STABILISATION * viscosity)


@dataclass(frozen=True, eq=False)
class Linear:
    """Linear velocity and pressure; tau: (T,) um2, of the stabilisation."""

    velocity: Space
    tau: np.ndarray

    @staticmethod
    def splits(resistance: Resistance) -> bool:
        """May the pressure jump across the interface? With tau each corner has one pressure."""
        return False

    @staticmethod
    def on(velocity: Space, viscosity: np.ndarray) -> Linear:
        """The pair with the paper's stabilisation; viscosity: (T,) nu_r."""
        return Linear(velocity, tau(velocity.mesh, viscosity))

    @property
    def lower(self) -> np.ndarray:
        """(T, 3, 3) of (tau grad p, grad q)."""
        mesh = self.velocity.mesh
        driven = each(self.tau, mesh.gradients)
        return each(mesh.areas, driven @ np.swapaxes(mesh.gradients, 1, 2))

    def prescribed(self) -> np.ndarray:
        """:func:`prescribed`, with u_x at the inlet scaled so that the discrete flux is u_ave W.

        On n linear elements, chords replace the parabola and lose 1 / n^2 of the flux.
        """
        inlet = self.velocity.inlet
        value = prescribed(self.velocity)
        flux = inlet.load(value[: self.velocity.count]).sum()
        value[inlet.nodes] *= self.velocity.mesh.width / flux
        return value

    def unit(self, u: np.ndarray, pressure: np.ndarray, work: float) -> UnitFlow:
        """The flow of a velocity and a pressure, with the loss (6)."""
        mesh = self.velocity.mesh
        slope = np.einsum("tai,ta->ti", mesh.gradients, pressure[mesh.triangles])
        loss = self.velocity.inlet.mean(pressure) - self.velocity.outlet.mean(pressure)
        return UnitFlow(u, pressure, self.tau[:, None] * slope, loss)


@dataclass(frozen=True, eq=False)
class TaylorHood:
    """Quadratic velocity with a linear pressure, which needs no tau."""

    velocity: Space
    lower: None = None

    @staticmethod
    def splits(resistance: Resistance) -> bool:
        """May the pressure jump across the interface? Each side then has its own pressure."""
        return resistance.pressure_jumps

    @staticmethod
    def on(velocity: Space, viscosity: np.ndarray) -> TaylorHood:
        """The pair; it does not depend on the viscosity."""
        return TaylorHood(velocity)

    def prescribed(self) -> np.ndarray:
        """:func:`prescribed`; quadratic velocities represent the parabola exactly."""
        return prescribed(self.velocity)

    def unit(self, u: np.ndarray, pressure: np.ndarray, work: float) -> UnitFlow:
        """The flow of a velocity and a pressure; work: 1/um, the loss (:func:`work`)."""
        return UnitFlow(u, pressure, None, work)


#: {order of the velocity: pair of velocity and pressure}.
PAIRS: dict[int, type[Linear] | type[TaylorHood]] = {1: Linear, 2: TaylorHood}


def poiseuille_loss(length: float, width: float) -> float:
    """Loss (1/um) of plane Poiseuille flow of mean velocity one over a length (um): 12 L / W^2."""
    return 12 * length / width**2


def interface_corners(mesh: Mesh) -> np.ndarray:
    """(d,) corners that fluid and biomass share."""
    return np.intersect1d(mesh.triangles[mesh.biomass], mesh.triangles[~mesh.biomass])


def doubled(mesh: Mesh, corners: np.ndarray) -> np.ndarray:
    """(T, 3) numbers of the pressures. In biomass the d last numbers replace ``corners`` (d,)."""
    own = np.arange(mesh.corners)
    own[corners] = mesh.corners + np.arange(len(corners))
    return np.where(mesh.biomass[:, None], own[mesh.triangles], mesh.triangles)


def divergence(velocity: Space) -> np.ndarray:
    """(T, 3, 2k) element matrices of (q, div u); columns: u_x of all nodes, then u_y."""
    at = velocity.gradients_at
    q = velocity.gradient_table.linear
    return product(q, at.dx, at.div)


@timed("flow")
def unit_flow(velocity: Space, resistance: Resistance = WATER, *,
              interface: Interface = LAPLACIAN) -> UnitFlow:
    """Stokes flow of mean velocity one through the meshed part, (1)-(5); see :func:`solve`."""
    mesh = velocity.mesh
    kind = PAIRS[velocity.order]
    splits = kind.splits(resistance)
    system = mesh.topology.system(("flow", interface, splits),
                                  lambda: _system(velocity, interface, splits))
    system, viscosity, drag = resistance.terms(velocity, system)
    pair = kind.on(velocity, viscosity)
    blocks = stokes(velocity, viscosity, interface, pair.lower, drag)
    value = np.zeros(len(system.constrained))
    value[: 2 * velocity.count] = pair.prescribed()
    load = system.product(blocks, value)
    solution = value + system.solve(blocks, -load)
    n = velocity.count
    u = solution[: 2 * n].reshape(2, n).T
    of_fluid, second = np.split(solution[2 * n:], [mesh.corners])
    unit = pair.unit(u, of_fluid, work(load, solution, mesh.width))
    if not splits:
        return unit
    of_biomass = of_fluid.copy()
    of_biomass[interface_corners(mesh)] = second
    return replace(unit, biomass_pressure=of_biomass)


def stokes(velocity: Space, viscosity: np.ndarray, interface: Interface,
           lower: np.ndarray | None, more: np.ndarray | None = None) -> np.ndarray:
    """(T, 2k + 3, 2k + 3) element matrices of velocity and pressure.

    viscosity: (T,) nu_r; lower: (T, 3, 3) of (tau grad p, grad q), None without tau; more: (T, 2k,
    2k) to add to a(u, v), None for nothing.
    """
    blocks = saddle_blocks(interface.a(velocity, viscosity), divergence(velocity), lower)
    if more is not None:
        size = more.shape[1]
        blocks[:, :size, :size] += more
    return blocks


def _system(velocity: Space, interface: Interface, splits: bool) -> ElementSystem:
    """The system with the conditions of the walls, a parabola at the inlet, and u_y = 0 at the
    outlet in the traction form [E10]. splits: may the pressure jump across the interface?"""
    dofs = velocity.dofs
    mesh = velocity.mesh
    constrained = np.zeros((velocity.count, 2), bool)
    constrained[velocity.inlet.nodes] = True
    for wall in mesh.walls:
        constrained[mesh.nodes_on(wall)] |= [wall.no_slip, True]
    if interface.straight_outlet:
        constrained[velocity.outlet.nodes, 1] = True
    corners = interface_corners(mesh) if splits else np.empty(0, int)
    return saddle_system(velocity.cells, doubled(mesh, corners), constrained, dofs.elimination,
                         mesh.topology.method, corners)


def prescribed(velocity: Space) -> np.ndarray:
    """(2n,) values of the constrained velocities: the parabola u_x at the inlet (3), or half of the
    parabola if one wall is a plane of symmetry."""
    value = np.zeros(2 * velocity.count)
    nodes = velocity.inlet.nodes
    wall, *_ = [wall for wall in velocity.mesh.walls if wall.no_slip]
    share = wall.gap(velocity.points[nodes]) / velocity.mesh.whole_width
    value[nodes] = 6 * share * (1 - share)
    return value


def work(load: np.ndarray, solution: np.ndarray, width: float) -> float:
    """Loss (1/um) as the work at the inlet per unit flux.

    It equals (6) if the flow is developed at the ends. It converges with twice the order of the
    velocity's gradient. load: (2n + m,), the system's matrix times the prescribed values; solution:
    (2n + m,), of the system.
    """
    return float(load @ solution) / width


def scaled(unit: UnitFlow, mesh: Mesh, length: float, drive: Drive) -> Flow:
    """Scale the unit flow to the head or the mean velocity of ``drive``; the problem is linear.

    The head is the loss over the entire pore, of a length (um) (2.1). The mean head at the outlet
    is zero (4).
    """
    viscosity = drive.kinematic_viscosity / drive.gravity
    beyond = length - (mesh.ends[1] - mesh.ends[0])
    total_loss = unit.loss + poiseuille_loss(beyond, mesh.whole_width)
    speed = drive.mean_velocity
    if speed is None:
        speed = drive.driving_head / (viscosity * total_loss)
    scale = viscosity * speed
    at_outlet = Space(mesh.straight).outlet.mean(unit.pressure)
    head = scale * (unit.pressure - at_outlet)
    correction = None if unit.correction is None else speed * unit.correction
    of_biomass = unit.biomass_pressure
    return Flow(speed, speed * unit.velocity, head, correction, scale * unit.loss,
                scale * total_loss, length / (viscosity * total_loss),
                None if of_biomass is None else scale * (of_biomass - at_outlet))


def solve(velocity: Space, drive: Drive, length: float, *,
          interface: Interface = LAPLACIAN) -> Flow:
    """Solve the Stokes flow through a pore, (1)-(6).

    Parameters
    ----------
    velocity : Space
        Space of the velocity, on the mesh of the pore.
    drive : repro.scene.Flow
        Head or mean velocity, viscosities, and the permeability of the biomass.
    length : float
        Length of the entire pore, um. Beyond the mesh the pore is a clean channel.
    interface : Interface
        Form of the viscous term [E2].

    Returns
    -------
    Flow

    Raises
    ------
    LinearError
        If the system cannot be solved.
    """
    unit = unit_flow(velocity, resistance_of(drive), interface=interface)
    return scaled(unit, velocity.mesh, length, drive)
