"""Aggregates in known states, and one update of an aggregate without flow and substrates."""


import numpy as np

from repro.fem.mesh import Mesh
from repro.fem.outline import Outline
from repro.fem.space import Space
from repro.model import remeshing
from repro.model.body import Body
from repro.model.energies import NEO_HOOKEAN
from repro.model.meshing import seeded
from repro.model.pore import Pore
from repro.model.remeshing import Remeshing
from repro.model.solid import material
from repro.model.stages import Stages
from verification.evidence.cases import combined
from verification.problems import channels, meshes, pairs, runs
from verification.problems.schemes import Change, load_scene

WIDTH = 50.0
#: X_m of Table 1, mg/L.
DENSITY = 3e4
#: All orders of elements, by their names in scenes.
EVERY = combined(channels.ORDERS)


def base_scene(*changes: Change, order: int = 1):
    """The base scene with changes. Only (34) and the transfer use it."""
    return load_scene("base", (runs.with_elements(channels.WORDS[order]), *changes))


def uniform(x, y) -> np.ndarray:
    """A density of X_m everywhere."""
    return DENSITY + 0 * x


def seed_around(around: Outline, refinement: float, density=uniform, ends=(-75.0, 75.0), order: int = 1) -> Pore:
    """An aggregate at t = 0 with X_A = density(x, y), on a new mesh around an outline."""
    return seed_on(*meshes.around(around, refinement, ends, WIDTH), density)


def seed_on(grid: Mesh, around: Outline, density=uniform) -> Pore:
    """An aggregate at t = 0 with X_A = density(x, y), on an existing mesh."""
    space = Space(grid)
    active = density(*reaction_points(space)) * space.reaction.dx
    solid = material(space, grid.regions[0], grid.points[grid.body], NEO_HOOKEAN)
    body = Body(around.wall, around.fixed, active, 0 * active, np.ones_like(solid.at.dx), solid)
    return Pore(0.0, space, (body,), np.zeros(grid.corners))


def reaction_points(space: Space) -> np.ndarray:
    """(2, r, q) um, the points of the reaction."""
    pieces = space.reaction
    return np.einsum("qk,rki->irq", pieces.values, space.points[pieces.cells])


def remesh(scene, pore: Pore, speed: float = 0.0) -> Pore:
    """A new mesh around the aggregate; speed: mean velocity, um/h."""
    return remeshing.remesh(Remeshing.of(scene), pore, pore, speed)[0]


def expand(scene, pore: Pore, increase) -> Pore:
    """The shape after X_A has grown by the factors 1 + increase (r, q), (28)-(34), on the old mesh."""
    grown = pore.with_body(active=pore.active * (1 + increase))
    return Stages.of(scene).expand(pore, grown).pore


def update(scene, pore: Pore, increase) -> tuple[Pore, bool]:
    """One update: growth, then a moved or a new mesh. Also return whether the mesh is new."""
    return remeshing.new_mesh(Remeshing.of(scene), pore, expand(scene, pore, increase), 0.0)


def seed(radius: float, refinement: float = 1.0, order: int = 1) -> Pore:
    """A half-disc at t = 0 in the base scene."""
    return seeded(base_scene(f'aggregate.radius="{radius} um"', f"numerics.refinement={refinement}", order=order))


def areas(pore: Pore) -> np.ndarray:
    """(r, q) um2, the weights of the points of the reaction, computed independently of the package.

    A node has a third of the area of the biomass triangles around it. A quadrature point has the weight of the rule
    times the determinant of the map.
    """
    mesh = pore.mesh
    if pore.space.order == 1:
        node_areas = np.zeros(len(mesh.points))
        for nodes in mesh.triangles[mesh.biomass]:
            node_areas[nodes] += abs(np.linalg.det(mesh.points[nodes[1:]] - mesh.points[nodes[0]])) / 6
        return node_areas[mesh.body, None]
    table = pore.space.table
    return pairs.curved_weights(mesh.points[mesh.cells[mesh.biomass]], table.linear, table.weights)


def densities(pore: Pore) -> tuple[np.ndarray, np.ndarray]:
    """X_A and X_I (r, q) mg/L in the points of the reaction."""
    weight = areas(pore)
    return pore.active / weight, pore.inert / weight
