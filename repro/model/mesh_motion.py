"""Mesh motion (3.5): the mesh of the fluid follows the aggregate.

The displacement d of the fluid's corners solves a compressible pseudo-Stokes problem, (35):

    (grad d, grad v) - (P, div v) = 0
    (q, div d) + gamma (P, q) + sum_tau (tau grad P, grad q) = 0

with linear functions and the flow's tau = h^2 / c. Interface nodes move with the biomass. Corners
on walls, inlet and outlet slide along them. The paper prints no gamma [E13]. All edges of the fluid
stay straight, except edges on the interface.
"""

from __future__ import annotations

import numpy as np

from repro.errors import MeshError, failing_as
from repro.fem.assembly import ElementSystem, saddle_blocks, saddle_system
from repro.fem.forms import each, mass
from repro.fem.mesh import Mesh
from repro.fem.space import Space
from repro.model.flow import divergence, tau
from repro.timing import timed

#: gamma, not printed. With 0.1 to 10 the velocity of base changes by up to 0.1 % [E13].
COMPRESSIBILITY = 1.0


def moved(mesh: Mesh, body: np.ndarray) -> Mesh:
    """Move a mesh with its aggregates; body: (n, 2) um, new positions of the nodes ``mesh.body``.
    """
    return mesh.moved(move(mesh, body, COMPRESSIBILITY))


@timed("mesh motion")
@failing_as(MeshError)
def move(mesh: Mesh, body: np.ndarray, compressibility: float) -> np.ndarray:
    """Move a mesh with its aggregates, (35).

    Parameters
    ----------
    mesh : Mesh
    body : (n, 2) float
        New positions of the nodes ``mesh.body``, um.
    compressibility : float
        gamma.

    Returns
    -------
    (N, 2) float
        New positions of all nodes, um. Triangles may be turned over; the caller tests this.
    """
    straight = mesh.straight
    points = mesh.points.copy()
    points[mesh.body] = body
    prescribed = points[: mesh.corners] - straight.points
    moved = _fluid_displacement(straight, prescribed, compressibility)
    corners = straight.points.copy()
    corners[straight.topology.fluid] += moved
    points = mesh.with_middles(corners)
    points[mesh.body] = body
    return points


def _fluid_displacement(mesh: Mesh, prescribed: np.ndarray, gamma: float) -> np.ndarray:
    """(f, 2) um, displacement of the fluid's corners.

    prescribed: (N, 2) um, displacement of the aggregates' corners, zero elsewhere.
    """
    fluid = mesh.topology.fluid
    wet = ~mesh.biomass
    space = Space(mesh)
    laplace = space.stiffness[wet]
    lower = each(tau(mesh, 1.0)[wet], laplace) + gamma * mass(mesh.areas[wet])
    elements = saddle_blocks(laplace, divergence(space)[wet], lower)
    system = mesh.topology.system("mesh motion", lambda: _system(mesh))
    value = np.concatenate([prescribed[fluid, 0], prescribed[fluid, 1], np.zeros(len(fluid))])
    solution = system.solve(elements, np.zeros(len(value)), value)
    return solution[: 2 * len(fluid)].reshape(2, -1).T


def _system(mesh: Mesh) -> ElementSystem:
    """The pseudo-Stokes system of the fluid's triangles, numbered as :attr:`Topology.fluid`."""
    fluid = mesh.topology.fluid
    triangles = np.searchsorted(fluid, mesh.triangles[~mesh.biomass])
    constrained = _constrained(mesh)[fluid]
    return saddle_system(triangles, triangles, constrained, method=mesh.topology.method)


def _constrained(mesh: Mesh) -> np.ndarray:
    """(N, 2) True where x or y is prescribed: both in the aggregates, y on walls, x on the ends."""
    topology = mesh.topology
    constrained = np.zeros((len(mesh.points), 2), bool)
    constrained[np.concatenate([topology.inlet, topology.outlet]), 0] = True
    constrained[topology.walls, 1] = True
    constrained[mesh.body] = True
    return constrained
