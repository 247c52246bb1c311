"""Optional forces of the fluid on the aggregate, t0 and f0 of (20) and (22); 2.3.3 neglects them.

The momentum balance of the fluid's triangles, tested with the nodal functions of the interface,
gives the force on the fluid there. The opposite force acts on the aggregate (consistent nodal
forces). With head phi and velocity u,

    f_i = - integral over the fluid's triangles of sigma grad N_i
    sigma = rho nu grad u - rho g phi

In the traction form [E2] rho nu (grad u + grad u^T) replaces rho nu grad u. The scene's flow
determines the form, so that the forces on the aggregate, the walls and the ends add up to zero, to
round-off. If hardly any water flows through the aggregate, both forms give the same traction,
because u is about zero along the interface and div u = 0. At a contact line the force tangential to
the wall includes the shear on half an edge of the wall. The force normal to the wall acts on the
wall, because y of the aggregate is constrained there. The zero of the head does not matter, because
a uniform pressure has no effect on an incompressible body that touches only walls and fluid.

In a permeable aggregate (section 5, :mod:`repro.model.brinkman`) the stress of the water is
continuous at the interface, and the water transmits it to the biomass by its drag. The biomass has
no traction on its surface. In its volume it has the body force

    f0 = rho nu u / k
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from repro.fem import elements, transfer
from repro.fem.mesh import Mesh
from repro.fem.space import Space
from repro.model import flow, mesh_motion, remeshing
from repro.model.flow import MPA_PER_UM, Flow
from repro.model.interface import Interface, interface_of
from repro.model.meshing import Meshing
from repro.model.pore import Pore
from repro.model.resistance import resistance_of
from repro.scene import Flow as Drive
from repro.scene import Scene, at_time, needed

#: The mesh moves to a new shape if their distance over W is larger than this.
ROUND_OFF = 1e-14


@dataclass(frozen=True, eq=False)
class Surroundings:
    """The mesh in which the flow around a shape is solved. It may differ from the pore's mesh.

    nodes: (k, a) for each of the k aggregate nodes of ``mesh``, indices of a nodes in the pore's
    ``mesh.body``; share: (k, a) weights of these nodes. The position of an aggregate node is the
    weighted mean of theirs, and its force is distributed to them by the same weights.
    """

    mesh: Mesh
    nodes: np.ndarray
    share: np.ndarray


@dataclass(frozen=True, eq=False)
class Fluid:
    """Data from which the fluid forces on an aggregate are computed.

    meshing: of the scene; drive: section [flow], which may have a table over time; interface: form
    of the viscous term; shear_modulus: mu_L, MPa.
    """

    meshing: Meshing
    drive: Drive
    interface: Interface
    shear_modulus: float

    @classmethod
    def of(cls, scene: Scene) -> Fluid:
        """The fluid of a scene with flow and growth."""
        drive = needed(scene.flow, "[flow]")
        return cls(Meshing.of(scene), drive, interface_of(scene.numerics.interface),
                   scene.growing.growth.shear_modulus)


def surroundings(meshing: Meshing, before: Pore, shaped: Pore) -> Surroundings:
    """The mesh of ``before`` moved with the aggregates to ``shaped``, or a new mesh if needed."""
    mesh = before.mesh if shaped is before else remeshing.moved_mesh(meshing, before, shaped)
    if mesh is not None:
        nodes = np.arange(len(mesh.body))[:, None]
        return Surroundings(mesh, nodes, np.ones(nodes.shape))
    return _generated(meshing, shaped)


def _generated(meshing: Meshing, shaped: Pore) -> Surroundings:
    """A new mesh around a shape."""
    mesh, _ = meshing.around(shaped.outlines)
    cells = shaped.mesh.topology.body_cells
    at = transfer.located(shaped.mesh.points[shaped.mesh.body], cells, mesh.points[mesh.body])
    return Surroundings(mesh, cells[at.triangle], elements.values(mesh.geometry, at.local))


def follow(meshing: Meshing, around: Surroundings, shaped: Pore) -> Surroundings:
    """The mesh ``around`` moved to another shape, or a new mesh if a triangle is turned over."""
    mesh = around.mesh
    positions = shaped.mesh.points[shaped.mesh.body]
    places = np.einsum("ka,kai->ki", around.share, positions[around.nodes])
    if np.abs(places - mesh.points[mesh.body]).max() <= ROUND_OFF * mesh.width:
        return around
    mesh = mesh_motion.moved(mesh, places)
    if mesh.areas.min() <= 0 or mesh.turned_over().any():
        return _generated(meshing, shaped)
    return replace(around, mesh=mesh)


def forces(fluid: Fluid, around: Surroundings, shaped: Pore) -> np.ndarray:
    """(n, 2) um: nodal forces over mu_L on ``shaped.mesh.body``, by the flow around the shape."""
    mesh = around.mesh
    drive = at_time(fluid.drive, shaped.time)
    space = Space(mesh)
    flow_field = flow.solve(space, drive, fluid.meshing.channel.length, interface=fluid.interface)
    on = on_aggregate(space, flow_field, drive, fluid.interface)[mesh.body]
    total = np.zeros((len(shaped.mesh.body), 2))
    np.add.at(total, around.nodes, around.share[..., None] * on[:, None])
    return MPA_PER_UM * drive.density * drive.gravity / fluid.shear_modulus * total


class SurroundingFlow:
    """The flow around successive shapes of a grown pore.

    The mesh moves from shape to shape. For the first shape, and for each shape whose contact has
    changed, it is made again from the mesh of the grown pore (:func:`surroundings`).
    """

    def __init__(self, fluid: Fluid, grown: Pore):
        self._fluid = fluid
        self._grown = grown
        self._last = grown
        self._around = surroundings(fluid.meshing, grown, grown)

    def forces(self, shaped: Pore) -> np.ndarray:
        """(n, 2) um, :func:`forces` on a shape."""
        meshing = self._fluid.meshing
        last = self._last
        self._last = shaped
        if shaped is not last and (last is self._grown
                                   or not remeshing.same_contact(shaped, last)):
            self._around = surroundings(meshing, self._grown, shaped)
        self._around = follow(meshing, self._around, shaped)
        return forces(self._fluid, self._around, shaped)


def on_aggregate(space: Space, solution: Flow, drive: Drive,
                 interface: Interface) -> np.ndarray:
    """(N, 2) um2 of head: forces of the water on the aggregates at all nodes, over rho g.

    They are tractions on the surface, or the drag in a permeable aggregate.
    """
    viscosity = drive.kinematic_viscosity / drive.gravity
    resistance = resistance_of(drive)
    if resistance.permeable:
        return seepage(space, solution, viscosity / resistance.permeability)
    return nodal(space, solution, viscosity, interface)


def seepage(space: Space, solution: Flow, drag: float) -> np.ndarray:
    """(N, 2) um2 of head: forces of Darcy's drag in the aggregate, f0 in (20), over rho g.

    drag: nu_water / (g k), h/um.
    """
    mesh = space.mesh
    cells = mesh.cells[mesh.biomass]
    velocity = solution.velocity[space.cells[mesh.biomass]]
    functions = space.at.values
    of_water = np.einsum("tq,qb,tbi->tqi", space.at.dx[mesh.biomass], functions, velocity)
    local = drag * np.einsum("tqi,qa->tai", of_water, functions)
    return np.column_stack([np.bincount(cells.ravel(), local[..., i].ravel(), len(mesh.points))
                            for i in (0, 1)])


def nodal(space: Space, solution: Flow, viscosity: float,
          interface: Interface) -> np.ndarray:
    """(N, 2) um2 of head: nodal forces of the fluid's triangles on all nodes, over rho g.

    viscosity: nu_water / g, um h.
    """
    mesh = space.mesh
    wet = ~mesh.biomass
    at = space.gradients_at
    gradients = at.gradients[wet]
    grad = np.einsum("tai,tqka->tqik", solution.velocity[space.cells[wet]], gradients)
    head = solution.head[mesh.triangles[wet]] @ space.gradient_table.linear.T
    stress = viscosity * interface.rate(grad) - head[..., None, None] * np.eye(2)
    local = -np.einsum("tq,tqik,tqka->tai", at.dx[wet], stress, gradients)
    nodes = mesh.cells[wet].ravel()
    return np.column_stack([np.bincount(nodes, local[..., i].ravel(), len(mesh.points))
                            for i in (0, 1)])
