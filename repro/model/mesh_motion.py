"""Mesh motion (3.5): the mesh of the fluid follows the aggregate.

The displacement d of the fluid's corners solves a pseudo-Stokes problem that may be compressed,
(35):

    (grad d, grad v) - (P, div v) = 0
    (q, div d) + gamma (P, q) + sum_tau (tau grad P, grad q) = 0

with linear functions and the flow's stabilisation tau = h^2 / c. Interface nodes move with the
biomass; corners of walls, inlet and outlet slide along their line. gamma is not printed [E13]: 1 by
default. Edges of the fluid stay straight but at the interface.
"""

from __future__ import annotations

import numpy as np

from repro.fem.assembly import ElementSystem, each, mass, saddle_blocks, saddle_system
from repro.fem.mesh import Mesh
from repro.fem.space import Space
from repro.model.flow import divergence
from repro.timing import timed


@timed("mesh motion")
def move(mesh: Mesh, body: np.ndarray, compressibility: float, stabilisation: float) -> np.ndarray:
    """(N, 2) um: nodes of the whole mesh after the aggregate's nodes have moved.

    body: (n, 2) um, new places of ``mesh.body``; compressibility: gamma; stabilisation: c of tau =
    h^2 / c. The result may hold triangles that are turned over: that is for the caller to judge.
    """
    straight = mesh.straight
    points = mesh.points.copy()
    points[mesh.body] = body
    known = points[: mesh.corners] - straight.points
    moved = _fluid_displacement(straight, known, compressibility, stabilisation)
    corners = straight.points.copy()
    corners[straight.topology.fluid] += moved
    found = mesh.with_middles(corners)
    found[mesh.body] = body
    return found


def _fluid_displacement(mesh: Mesh, known: np.ndarray, gamma: float, c: float) -> np.ndarray:
    """(f, 2) displacement of the fluid's corners; known: (N, 2) that of the aggregate, zero
    elsewhere."""
    fluid = mesh.topology.fluid
    there = ~mesh.biomass
    space = Space(mesh, 1)
    laplace = space.stiffness[there]
    lower = each(mesh.circumdiameter[there] ** 2 / c, laplace) + gamma * mass(mesh.areas[there])
    elements = saddle_blocks(laplace, divergence(space)[there], lower)
    system = mesh.topology.system("mesh motion", lambda: _system(mesh))
    value = np.concatenate([known[fluid, 0], known[fluid, 1], np.zeros(len(fluid))])
    solution = system.solve(elements, np.zeros(len(value)), value)
    return solution[: 2 * len(fluid)].reshape(2, -1).T


def _system(mesh: Mesh) -> ElementSystem:
    """The pseudo-Stokes system of the fluid's triangles, its unknowns numbered as ``fluid``."""
    fluid = mesh.topology.fluid
    triangles = np.searchsorted(fluid, mesh.triangles[~mesh.biomass])
    return saddle_system(triangles, triangles, _held(mesh)[fluid], method=mesh.topology.method)


def _held(mesh: Mesh) -> np.ndarray:
    """(N, 2) True where x or y of a node is prescribed: in the aggregate, and across walls, inlet
    and outlet."""
    topology = mesh.topology
    held = np.zeros((len(mesh.points), 2), bool)
    held[np.concatenate([topology.inlet, topology.outlet]), 0] = True
    held[topology.walls, 1] = True
    held[mesh.body] = True
    return held
