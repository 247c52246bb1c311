"""The fluid's traction on the aggregate, the t0 of (20) and (22): an option, which 2.3.3 neglects.

The momentum balance of the fluid's triangles alone, tested with the nodal functions of the interface, is what the fluid
is pushed with there; the aggregate is pushed back (consistent nodal forces). With head phi and velocity u,

    f_i = - sum over fluid triangles of |tau| sigma grad N_i,        sigma = rho nu grad u - rho g phi

or rho nu (grad u + grad u^T) in the traction form [E2]: the form of the scene's flow, so that the forces on the
aggregate, the walls and the ends add up to nothing, to round-off. Where hardly anything flows through the aggregate
both forms are the same traction: u is about zero along the interface and div u = 0. At a contact line the force along
the wall holds the shear of half an edge of wall; that across it is the wall's, as the aggregate's y is held there. The
head counts from the mean at the outlet, which does not matter: an even pressure does nothing to an incompressible body
that touches walls and fluid alone.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from repro.errors import GrowthError
from repro.fem import reprojection
from repro.fem.mesh import PoreMesh
from repro.model import mesh_motion, pore, remeshing
from repro.model.flow import Flow
from repro.model.pore import Pore

#: rho g in MPa/um, for rho in mg/L and g in um/h^2.
MPA_PER_UM = 1e-3 * 1e-6 / 3600**2 * 1e-12
#: A shape this near to that of the mesh around it, over W, needs no other.
ROUND_OFF = 1e-14


@dataclass(frozen=True, eq=False)
class Surroundings:
    """The mesh in which the flow around a shape is solved. It may be another than the aggregate's own.

    grid: the mesh; nodes: (k, a) numbers in ``mesh.body`` of the aggregate's own mesh, and share: (k, a) their weights:
    a node of ``grid.body`` is the mean of their places, and what pushes it pushes them in these shares.
    """

    grid: PoreMesh
    nodes: np.ndarray
    share: np.ndarray


def surroundings(scene, before: Pore, shaped: Pore) -> Surroundings:
    """The mesh that has followed the aggregate from a pore with a good mesh, or a new one where that is due."""
    grid = before.mesh if shaped is before else remeshing.followed(scene, before, shaped)
    if grid is not None:
        own = np.arange(len(grid.body))[:, None]
        return Surroundings(grid, own, np.ones(own.shape))
    grid, _ = remeshing.anew(scene, shaped.outline)
    body = shaped.mesh.body
    found, share = reprojection.locate(shaped.mesh.points[body], shaped.mesh.body_triangles, grid.points[grid.body])
    return Surroundings(grid, shaped.mesh.body_triangles[found], share)


def forces(scene, around: Surroundings, shaped: Pore) -> np.ndarray:
    """(n, 2) um: nodal forces over mu_L on ``shaped.mesh.body`` by the flow around that shape."""
    grid, own = around.grid, shaped.mesh.points[shaped.mesh.body]
    places = np.einsum("ka,kai->ki", around.share, own[around.nodes])
    if np.abs(places - grid.points[grid.body]).max() > ROUND_OFF * grid.width:
        numerics = scene.numerics
        grid = grid.moved(mesh_motion.move(grid, places, numerics.mesh_compressibility, numerics.flow_stabilisation))
    if grid.areas.min() <= 0:
        raise GrowthError("the fluid's forces move the aggregate so far that the mesh around it turns over; "
                          'try a shorter growth.time_step, or growth.fluid_forces = "neglected"')
    drive = scene.flow
    found = pore.solve_flow(scene, replace(shaped, mesh=grid))
    on = nodal(grid, found, drive.kinematic_viscosity / drive.gravity, scene.numerics.interface)[grid.body]
    total = np.zeros_like(own)
    np.add.at(total, around.nodes, around.share[..., None] * on[:, None])
    return MPA_PER_UM * drive.density * drive.gravity / scene.growth.shear_modulus * total


def nodal(grid: PoreMesh, found: Flow, viscosity: float, interface: str) -> np.ndarray:
    """(N, 2) um2 of head: forces of the fluid's triangles on all nodes, over rho g; zero inside fluid and aggregate.

    viscosity: nu_water / g, um h; interface: "laplacian" or "traction".
    """
    wet = ~grid.biomass
    nodes, slopes = grid.triangles[wet], grid.gradients[wet]
    grad = np.einsum("tai,tak->tik", found.velocity[nodes], slopes)
    if interface == "traction":
        grad = grad + np.swapaxes(grad, 1, 2)
    stress = viscosity * grad - found.head[nodes].mean(axis=1)[:, None, None] * np.eye(2)
    local = -grid.areas[wet][:, None, None] * np.einsum("tik,tak->tai", stress, slopes)
    return np.column_stack([np.bincount(nodes.ravel(), local[..., i].ravel(), len(grid.points)) for i in (0, 1)])
