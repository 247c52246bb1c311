"""Mesh motion (3.5): the mesh of the fluid follows the aggregate.

The displacement d of the fluid's nodes solves a pseudo-Stokes problem that may be compressed, (35):

    (grad d, grad v) - (P, div v) = 0,        (q, div d) - gamma (P, q) + sum_tau (tau grad P, grad q) = 0

with the flow's stabilisation tau = h^2 / c. Interface nodes move with the biomass; nodes of walls, inlet and outlet
slide along their line. gamma is not printed [E13]: 1 by default.
"""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
from skfem import Basis, BilinearForm, ElementTriP1, MeshTri

from repro import linear
from repro.flow import divergence, gradient_product
from repro.mesh import PoreMesh
from repro.timing import timed


@BilinearForm
def product(u, q, w):
    """(u, q)."""
    return u * q


@timed("mesh motion")
def move(mesh: PoreMesh, body: np.ndarray, compressibility: float, stabilisation: float) -> np.ndarray:
    """(N, 2) um: nodes of the whole mesh after the aggregate's nodes have moved.

    body: (n, 2) um, new places of ``mesh.body``; compressibility: gamma; stabilisation: c of tau = h^2 / c.
    The result may hold triangles that are turned over: that is for the caller to judge.
    """
    points = mesh.points.copy()
    points[mesh.body] = body
    displacement = _fluid_displacement(mesh, points - mesh.points, compressibility, stabilisation)
    points[mesh.fluid] = mesh.points[mesh.fluid] + displacement
    points[mesh.body] = body
    return points


def _fluid_displacement(mesh: PoreMesh, known: np.ndarray, gamma: float, c: float) -> np.ndarray:
    """(f, 2) displacement of ``mesh.fluid``; ``known`` (N, 2) holds the aggregate's."""
    fluid, count = mesh.fluid, len(mesh.fluid)
    local = np.full(len(mesh.points), -1)
    local[fluid] = np.arange(count)
    triangles = local[mesh.triangles[~mesh.biomass]]
    basis = Basis(MeshTri(mesh.points[fluid].T.copy(), triangles.T.copy()), ElementTriP1(), intorder=2)
    tau = np.broadcast_to((mesh.circumdiameter[~mesh.biomass] ** 2 / c)[:, None], basis.dx.shape)
    laplace = gradient_product.assemble(basis, k=np.ones(basis.dx.shape))
    lower = gradient_product.assemble(basis, k=tau) + gamma * product.assemble(basis)
    b_x, b_y = (divergence.assemble(basis, i=i) for i in (0, 1))
    system = sp.bmat([[laplace, None, -b_x.T], [None, laplace, -b_y.T], [-b_x, -b_y, -lower]], format="csr")
    held = _held(mesh)[fluid]
    value = np.concatenate([known[fluid, 0], known[fluid, 1], np.zeros(count)])
    free = np.flatnonzero(~np.concatenate([held[:, 0], held[:, 1], np.zeros(count, bool)]))
    place = np.empty(count)
    place[linear.node_order(count, triangles)] = np.arange(count)
    order = np.argsort(np.concatenate([place, place, place + 0.5])[free], kind="stable")
    value[free] = 0.0
    value[free] = linear.solve(system[free][:, free], -(system[free] @ value), order)
    return value[: 2 * count].reshape(2, count).T


def _held(mesh: PoreMesh) -> np.ndarray:
    """(N, 2) True where x or y of a node is prescribed: the aggregate's nodes, and across walls, inlet and outlet."""
    held = np.zeros((len(mesh.points), 2), bool)
    held[np.concatenate([mesh.inlet, mesh.outlet]), 0] = True
    held[mesh.walls, 1] = True
    held[mesh.body] = True
    return held
