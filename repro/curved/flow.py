"""Flow (2.1) with Taylor-Hood elements: quadratic velocity, linear head, no stabilisation; as :mod:`repro.flow`.

The head loss is the work of the inlet per unit flux, which is (6) where the flow is developed, and of the order of the
energy: twice that of the velocity's gradient.
"""

from __future__ import annotations

import numpy as np

from repro.assembly import saddle_blocks, saddle_system, two_components
from repro.curved import elements
from repro.curved.mesh import CurvedMesh
from repro.flow import Flow, poiseuille_loss
from repro.timing import timed


@timed("flow")
def solve(mesh: CurvedMesh, drive, length: float) -> Flow:
    """Flow through a pore of a length (um) under the drive of a scene; velocity (N, 2) um/h, head (corners,) um."""
    velocity, pressure, loss = unit_flow(mesh, drive.viscosity_ratio)
    viscosity = drive.kinematic_viscosity / drive.gravity
    whole = loss + poiseuille_loss(length - (mesh.ends[1] - mesh.ends[0]), mesh.width)
    speed = drive.head / (viscosity * whole) if drive.mean_velocity is None else drive.mean_velocity
    scale = viscosity * speed
    return Flow(speed, speed * velocity, scale * pressure, np.zeros((0, 2)), scale * loss, scale * whole,
                length / (viscosity * whole))


def unit_flow(mesh: CurvedMesh, viscosity_ratio: float) -> tuple[np.ndarray, np.ndarray, float]:
    """Velocity (N, 2), pressure (corners,) 1/um, and loss over the meshed part, 1/um, at mean velocity one (1)-(6)."""
    at, viscosity = mesh.places, np.where(mesh.biomass, viscosity_ratio, 1.0)
    slopes = np.swapaxes(at.grad, 2, 3).reshape(*at.dx.shape, 12)  # of u_x by x for its six nodes, then of u_y by y
    divergence = elements.LINEAR.T @ (at.dx[:, :, None] * slopes)
    blocks = saddle_blocks(two_components(elements.stiffness(viscosity, at)), divergence,
                           np.zeros((len(mesh.cells), 3, 3)))
    system = mesh.once("flow", lambda: _system(mesh))
    count = len(mesh.points)
    value = np.zeros(len(system.held))
    share = mesh.points[mesh.inlet, 1] / mesh.width
    value[mesh.inlet] = 6 * share * (1 - share)
    found = system.solve(blocks, np.zeros(len(value)), value)
    force = np.bincount(system.unknowns.ravel(), (blocks @ found[system.unknowns][:, :, None]).ravel(), len(value))
    loss = float(force[mesh.inlet] @ value[mesh.inlet]) / mesh.width
    return found[: 2 * count].reshape(2, count).T, found[2 * count:], loss


def _system(mesh: CurvedMesh):
    held = np.zeros((len(mesh.points), 2), bool)
    held[np.concatenate([mesh.walls, mesh.inlet])] = True
    return saddle_system(mesh.cells, mesh.cells[:, :3], held, mesh.order)
