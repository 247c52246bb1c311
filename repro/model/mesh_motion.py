"""Mesh motion (3.5): the mesh of the fluid follows the aggregate.

The displacement d of the fluid's nodes solves a pseudo-Stokes problem that may be compressed, (35):

    (grad d, grad v) - (P, div v) = 0,        (q, div d) + gamma (P, q) + sum_tau (tau grad P, grad q) = 0

with the flow's stabilisation tau = h^2 / c. Interface nodes move with the biomass; nodes of walls, inlet and outlet
slide along their line. gamma is not printed [E13]: 1 by default.
"""

from __future__ import annotations

import numpy as np

from repro.fem.assembly import each, mass, saddle_blocks, saddle_system
from repro.fem.mesh import PoreMesh
from repro.model.flow import forms
from repro.timing import timed


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
    """(f, 2) displacement of ``mesh.fluid``; ``known`` (N, 2) holds the aggregate's, and zero elsewhere."""
    fluid, there, found = mesh.fluid, ~mesh.biomass, forms(mesh)
    tau = mesh.circumdiameter[there] ** 2 / c
    laplace = found.laplace[there]
    lower = each(tau, laplace) + gamma * mass(mesh.areas[there])
    elements = saddle_blocks(laplace, found.divergence[there], lower)
    system = mesh.once("mesh motion", lambda: _system(mesh, mesh.triangles[there]))
    value = np.concatenate([known[fluid, 0], known[fluid, 1], np.zeros(len(fluid))])
    return system.solve(elements, np.zeros(len(value)), value)[: 2 * len(fluid)].reshape(2, -1).T


def _system(mesh: PoreMesh, triangles: np.ndarray):
    """The pseudo-Stokes system of the fluid's triangles (F, 3), its unknowns in the numbering of ``mesh.fluid``."""
    number = np.full(len(mesh.points), -1)
    number[mesh.fluid] = np.arange(len(mesh.fluid))
    return saddle_system(number[triangles], number[triangles], _held(mesh)[mesh.fluid])


def _held(mesh: PoreMesh) -> np.ndarray:
    """(N, 2) True where x or y of a node is prescribed: the aggregate's nodes, and across walls, inlet and outlet."""
    held = np.zeros((len(mesh.points), 2), bool)
    held[np.concatenate([mesh.inlet, mesh.outlet]), 0] = True
    held[mesh.walls, 1] = True
    held[mesh.body] = True
    return held
