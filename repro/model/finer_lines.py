"""Smaller triangles beside contact lines. The aggregates keep their shapes and their fields."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from repro.fem.mesh import Mesh, Region
from repro.fem.refinement import Bisection, refined
from repro.fem.space import Space
from repro.model.pore import Pore
from repro.model.solid import Solid, material


def with_finer_lines(pore: Pore, lines: np.ndarray, size: float,
                     gradation: float) -> tuple[Pore, Bisection]:
    """Bisect the triangles beside points ``lines`` (K, 2) um, down to a size (um).

    The size grows by ``gradation`` times the distance from the points. The shapes do not change.
    The result has neither masses nor substrates.
    """
    def size_at(where: np.ndarray) -> np.ndarray:
        return size + gradation * np.linalg.norm(where[:, None] - lines, axis=2).min(axis=1)

    bisection = refined(pore.mesh, pore.outlines, size_at)
    space = Space(bisection.mesh)
    origins = [bisection.nodal(pore.mesh.from_region(region, body.reference))
               for body, region in zip(pore.bodies, pore.mesh.regions)]
    solids = [material(space, region, origin[region.nodes], body.solid.energy)
              for body, origin, region in zip(pore.bodies, origins, space.mesh.regions)]
    expanded = bisection.of_each([body.theta * body.solid.at.dx for body in pore.bodies],
                                 _areas(pore, pore.mesh, [body.solid for body in pore.bodies]),
                                 _areas(pore, space.mesh, solids),
                                 pore.bodies[0].solid.shape.table)
    none = np.empty((0, 0))
    bodies = []
    for body, before, after, outline, solid, amount in zip(
            pore.bodies, pore.mesh.regions, space.mesh.regions, bisection.outlines, solids,
            expanded):
        def carry(positions: np.ndarray, before: Region = before,
                  after: Region = after) -> np.ndarray:
            return bisection.nodal(pore.mesh.from_region(before, positions))[after.nodes]

        bodies.append(replace(body, wall=outline.wall, fixed=outline.fixed, active=none,
                              inert=none, solid=solid, theta=amount / solid.at.dx,
                              configuration=body.configuration.carried(carry)))
    fine = replace(pore, space=space, bodies=tuple(bodies), concentrations=None,
                   pressure=bisection.at_corners(pore.pressure))
    return fine, bisection


def _areas(pore: Pore, mesh: Mesh, solids: Sequence[Solid]) -> list[np.ndarray]:
    """For each aggregate, (t, q) um2, areas of the points where growth is integrated.

    They are areas at t = 0 if strain adds up, and present areas otherwise. The expansion over this
    area is smooth.
    """
    if pore.accumulates:
        return [solid.at.dx for solid in solids]
    return [solid.at.dx * solid.strained(mesh.points[region.nodes]).J
            for solid, region in zip(solids, mesh.regions)]
