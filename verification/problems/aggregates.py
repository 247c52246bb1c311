"""Aggregates in states that are known by construction, and one update of them without flow or substrates."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from repro.fem.mesh import Mesh
from repro.fem.outline import Outline
from repro.fem.space import Space
from repro.march import updates
from repro.model import contact, pore, remeshing
from repro.model.pore import Pore
from repro.scene import load_scene
from verification.evidence.cases import combined
from verification.problems import channels, meshes, pairs, runs

WIDTH = 50.0
#: X_m of Table 1, mg/L.
DENSITY = 3e4
#: Every order of the elements, by the names that scenes have for them.
EVERY = combined(channels.ORDERS)


def scene(*changes: str, order: int = 1):
    """The base scene with changes: what (34) and the transfer read of it."""
    return load_scene("base", (runs.of(channels.WORDS[order]), *changes))


def uniform(x, y) -> np.ndarray:
    """X_m everywhere."""
    return DENSITY + 0 * x


def placed(around: Outline, refinement: float, density=uniform, ends=(-75.0, 75.0), order: int = 1) -> Pore:
    """An aggregate at t = 0 with X_A = density(x, y), on a mesh of its own."""
    return at_start(*meshes.around(around, refinement, ends, WIDTH), order, density)


def at_start(grid: Mesh, around: Outline, order: int, density=uniform) -> Pore:
    """The same on a mesh that is there."""
    space = Space(grid, order)
    active = density(*places(space)) * space.reaction.dx
    body = pore.material(space, grid.points[grid.body])
    return Pore(0.0, space, around.wall, around.fixed, active, 0 * active, np.ones_like(body.at.dx), body,
                np.zeros(grid.corners))


def places(space: Space) -> np.ndarray:
    """(2, r, q) um, the points of the reaction."""
    pieces = space.reaction
    return np.einsum("qk,rki->irq", pieces.values, space.points[pieces.cells])


def remeshed(given, now: Pore, speed: float = 0.0) -> Pore:
    """A new mesh around the aggregate; speed: mean velocity, um/h."""
    return remeshing.remesh(given, now, now, speed)[0]


def expanded(given, now: Pore, made) -> Pore:
    """The shape after X_A has grown by the factors 1 + made (r, q), (28)-(34), on the old mesh."""
    grown = replace(now, active=now.active * (1 + made))
    return contact.expand(given, grown, updates.enlarged(given, now, grown)).pore


def updated(given, now: Pore, made) -> tuple[Pore, bool]:
    """A whole update: growth, then a moved mesh or a new one, and which of them it is."""
    return remeshing.new_mesh(given, now, expanded(given, now, made), 0.0)


def seed(radius: float, refinement: float = 1.0, order: int = 1) -> Pore:
    """A half-disc at t = 0 in the base scene."""
    return pore.seeded(scene(f'aggregate.radius="{radius} um"', f"numerics.refinement={refinement}", order=order))


def areas(now: Pore) -> np.ndarray:
    """(r, q) um2, the weights of the points of the reaction, worked out here: at nodes a third of the area of the
    biomass triangles around them, triangle by triangle; else the quadrature's weights times the map's determinant."""
    mesh = now.mesh
    if now.space.order == 1:
        found = np.zeros(len(mesh.points))
        for nodes in mesh.triangles[mesh.biomass]:
            found[nodes] += abs(np.linalg.det(mesh.points[nodes[1:]] - mesh.points[nodes[0]])) / 6
        return found[mesh.body, None]
    return pairs.curved_weights(mesh.points[mesh.cells[mesh.biomass]], now.space.table.linear, now.space.table.weights)


def densities(now: Pore) -> tuple[np.ndarray, np.ndarray]:
    """X_A and X_I (r, q) mg/L in the points of the reaction."""
    weight = areas(now)
    return now.active / weight, now.inert / weight
