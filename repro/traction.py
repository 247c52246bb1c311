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

from dataclasses import replace

import numpy as np

from repro import geometry, pore, remeshing
from repro.flow import Flow
from repro.mesh import PoreMesh
from repro.pore import Pore

#: rho g in MPa/um, for rho in mg/L and g in um/h^2.
MPA_PER_UM = 1e-3 * 1e-6 / 3600**2 * 1e-12


def forces(scene, before: Pore, shaped: Pore) -> np.ndarray:
    """(n, 2) um: nodal forces over mu_L on ``shaped.mesh.body`` by the flow around that shape.

    before: a pore of the same topology with a good mesh; the fluid's nodes of ``shaped`` need not have followed.
    """
    grid = before.mesh if shaped is before else remeshing.followed(scene, before, shaped)
    new = grid is None
    if new:
        grid, _ = remeshing.anew(scene, shaped.outline)
    found = pore.solve_flow(scene, replace(shaped, mesh=grid))
    drive = scene.flow
    scale = MPA_PER_UM * drive.density * drive.gravity / scene.growth.shear_modulus
    on = scale * nodal(grid, found, drive.kinematic_viscosity / drive.gravity, scene.numerics.interface)
    if not new:
        return on[shaped.mesh.body]
    loaded = np.zeros((len(shaped.mesh.body), 2))
    loaded[shaped.mesh.body_loop] = _shared_out(shaped.outline, grid.points[grid.loop], on[grid.loop])
    return loaded


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


def _shared_out(outline: geometry.Outline, places: np.ndarray, on: np.ndarray) -> np.ndarray:
    """(M, 2) forces at the outline's nodes that stand for forces ``on`` (K, 2) at places (K, 2) along its interface:
    each is shared between the ends of its edge so that force and moment stay."""
    first = np.flatnonzero(outline.interface_edges())
    last = (first + 1) % len(outline.points)
    start, along = outline.points[first], outline.points[last] - outline.points[first]
    part = np.einsum("kei,ei->ke", places[:, None] - start, along) / np.sum(along**2, axis=1)
    part = np.clip(part, 0.0, 1.0)
    nearest = np.hypot(*np.moveaxis(start + part[..., None] * along - places[:, None], 2, 0)).argmin(axis=1)
    part = part[np.arange(len(places)), nearest][:, None]
    found = np.zeros_like(outline.points)
    np.add.at(found, first[nearest], (1 - part) * on)
    np.add.at(found, last[nearest], part * on)
    return found
