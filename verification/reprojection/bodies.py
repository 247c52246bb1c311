"""Aggregates in states that are known by construction, and one update of them without flow or substrates."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from repro.fem import geometry, mesh
from repro.model import pore, remeshing, shape
from repro.model.pore import Pore, Solved
from repro.model.transport import Concentrations
from repro.scene import load_scene
from verification.reprojection import grids

WIDTH, FILM = 50.0, 2.0
#: X_m of Table 1, mg/L.
DENSITY = 3e4


def scene(*changes: str):
    """The base scene with changes: what (34) and the transfer read of it."""
    return load_scene("base", changes)


def placed(outline: geometry.Outline, refinement: float, density=lambda x, y: DENSITY + 0 * x,
           ends=(-75.0, 75.0)) -> Pore:
    """An aggregate at t = 0 with X_A = density(x, y), on a mesh of its own."""
    grid, outline = mesh.generate(outline, ends, geometry.Sizing(WIDTH, refinement, FILM))
    active, none = np.zeros(len(grid.points)), np.zeros(len(grid.points))
    active[grid.body] = density(*grid.points[grid.body].T)
    return Pore(0.0, grid, outline.wall, outline.fixed, active, none, grid.points.copy(),
                np.ones(np.count_nonzero(grid.biomass)), none)


def quiet(now: Pore) -> Solved:
    """No flow, no substrates."""
    none = np.zeros(len(now.mesh.points))
    return Solved(None, None, Concentrations(none, none))


def remeshed(given, now: Pore, expanded: Pore | None = None) -> Pore:
    """A new mesh around the aggregate."""
    return remeshing.remesh(given, now, now if expanded is None else expanded, quiet(now))


def expanded(given, now: Pore, made) -> Pore:
    """The shape after X_A has grown by the factors 1 + made (N,), (28)-(34), on the old mesh."""
    grown = replace(now, active=now.active * (1 + made))
    more = (grown.active - now.active)[now.mesh.triangles[now.mesh.biomass]].mean(axis=1)
    return shape.expand(given, grown, now.theta * (1 + more / DENSITY))[0]


def updated(given, now: Pore, made) -> tuple[Pore, bool]:
    """A whole update: growth, then a moved mesh or a new one, and which of them it is."""
    return remeshing.new_mesh(given, now, expanded(given, now, made), quiet(now))


def seed(radius: float, refinement: float = 1.0) -> Pore:
    """A half-disc at t = 0 in the base scene."""
    return pore.seeded(scene(f'aggregate.radius="{radius} um"', f"numerics.refinement={refinement}"))


def node_areas(now: Pore) -> np.ndarray:
    """(N,) a third of the area of the biomass triangles at each node, um2: triangle by triangle."""
    found = np.zeros(len(now.mesh.points))
    for nodes in now.mesh.triangles[now.mesh.biomass]:
        found[nodes] += abs(np.linalg.det(now.mesh.points[nodes[1:]] - now.mesh.points[nodes[0]])) / 6
    return found


def mass(now: Pore) -> float:
    """Integral of X_A + X_I over the aggregate, um2 mg/L."""
    return grids.integral((now.mesh.points, now.mesh.triangles[now.mesh.biomass]), now.active + now.inert)
