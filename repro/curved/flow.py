"""Flow (2.1) with Taylor-Hood elements: quadratic velocity and linear head, or cubic and quadratic, no stabilisation.

The head loss is the work of the inlet per unit flux, which is (6) where the flow is developed, and of the order of the
energy: twice that of the velocity's gradient.
"""

from __future__ import annotations

import numpy as np

from repro.curved.fields import Space, space
from repro.curved.mesh import CurvedMesh
from repro.fem.assembly import each, saddle_blocks, saddle_system
from repro.model.flow import Flow, poiseuille_loss
from repro.timing import timed


@timed("flow")
def solve(mesh: CurvedMesh, drive, length: float, order: int = 2) -> Flow:
    """Flow through a pore of a length (um) under the drive of a scene; velocity (n, 2) um/h at the nodes of its order
    (2 or 3, :mod:`repro.curved.fields`), head (corners,) um."""
    velocity, pressure, loss = unit_flow(mesh, drive.viscosity_ratio, order)
    viscosity = drive.kinematic_viscosity / drive.gravity
    whole = loss + poiseuille_loss(length - (mesh.ends[1] - mesh.ends[0]), mesh.width)
    speed = drive.head / (viscosity * whole) if drive.mean_velocity is None else drive.mean_velocity
    scale = viscosity * speed
    return Flow(speed, speed * velocity, scale * pressure[: mesh.corners], np.zeros((0, 2)), scale * loss,
                scale * whole, length / (viscosity * whole))


def unit_flow(mesh: CurvedMesh, viscosity_ratio: float, order: int = 2) -> tuple[np.ndarray, np.ndarray, float]:
    """Velocity (n, 2), pressure 1/um at the nodes of an order less, and loss over the meshed part, 1/um, at mean
    velocity one (1)-(6)."""
    here = space(mesh, order)
    blocks = stokes(here, np.where(mesh.biomass, viscosity_ratio, 1.0))
    system = mesh.once(("flow", order), lambda: _system(here))
    value, inlet = np.zeros(len(system.held)), here.end_nodes(here.inlet)
    share = here.points[inlet, 1] / mesh.width
    value[inlet] = 6 * share * (1 - share)
    held = system.product(blocks, value)
    found = value + system.solve(blocks, -held)
    loss = float(held @ found) / mesh.width
    return found[: 2 * here.count].reshape(2, here.count).T, found[2 * here.count:], loss


def stokes(here: Space, viscosity: np.ndarray) -> np.ndarray:
    """(T, 2k + h, 2k + h) element matrices of (nu grad u, grad v) - (p, div v) - (q, div u); viscosity: (T,)."""
    at = here.at
    slopes = at.slopes.reshape(*at.dx.shape, -1)  # of u_x by x for its nodes, then of u_y by y
    divergence = here.of.head.T @ (at.dx[:, :, None] * slopes)
    return saddle_blocks(each(viscosity, here.stiffness), divergence)


def _system(here: Space):
    held = np.zeros((here.count, 2), bool)
    held[np.concatenate([here.walls, here.end_nodes(here.inlet)])] = True
    return saddle_system(here.cells, here.head_cells, held, here.order)
