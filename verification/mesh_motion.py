"""Mesh motion (3.5), (35): exact displacements, and no triangle turned over where the aggregate grows as in a run."""

from __future__ import annotations

import numpy as np

from repro import geometry, mesh, mesh_motion
from verification import meshes
from verification.case import Outcome, at_least, at_most, case

GAMMA, STABILISATION = 1.0, 100.0


@case("mesh_motion-plug", kind="exact",
      norm="largest difference of displacement over the plug's, for gamma = 0.01, 1, 100",
      claim="A plug that slides and stretches along the pore stretches the fluid linearly on both sides",
      mutant="the sign of gamma; interface nodes left behind; wall nodes held in x")
def plug() -> Outcome:
    grid = meshes.channel((-60.0, 60.0), 30.0, 3.0, lambda x, y: np.abs(x) < 20, across=(-20.0, 20.0), seed=1)
    x = grid.points[:, 0]
    shift = np.where(x < -20, (x + 60) / 40 * 2.0, np.where(x > 20, (60 - x) / 40 * 5.0, 2.0 + 3.0 * (x + 20) / 40))
    exact = grid.points + np.column_stack([shift, 0 * x])
    checks = [at_most(f"gamma = {gamma:g}", np.abs(_moved(grid, exact, gamma) - exact).max() / 5, 1e-9,
                      "round-off: the field is linear")
              for gamma in (0.01, GAMMA, 100.0)]
    return Outcome((*checks, at_most("at rest", np.abs(_moved(grid, grid.points, GAMMA) - grid.points).max(), 0.0,
                                     "nothing moves")))


def _moved(grid, points, gamma):
    return mesh_motion.move(grid, points[grid.body], gamma, STABILISATION)


@case("mesh_motion-growth", kind="property",
      norm="least quality and area of the moved triangles; distance from their line",
      claim="An aggregate that doubles its area in steps of 2 % leaves no triangle turned over, and boundary nodes on "
            "their lines",
      mutant="fluid nodes left in place (a stale mesh); gamma -> the displacement of the biomass applied to the wall")
def growth() -> Outcome:
    checks = []
    for radius, factor in ((5.0, 2.0), (20.0, 2.0), (35.0, 1.3)):
        grid, _ = mesh.generate(geometry.seed(radius), (-75.0, 75.0), 50.0, 1.0, 2.0)
        first = grid
        steps = int(np.ceil(np.log(factor) / np.log(1.02)))
        for _ in range(steps):
            grid = grid.moved(mesh_motion.move(grid, grid.points[grid.body] * factor ** (0.5 / steps), GAMMA,
                                               STABILISATION))
        apart = max(np.abs(grid.points[first.walls, 1] - first.points[first.walls, 1]).max(),
                    np.abs(grid.points[first.inlet, 0] - first.points[first.inlet, 0]).max())
        checks += [at_least(f"least area over its own at first, R = {radius:g} um", (grid.areas / first.areas).min(),
                            0.05, "not turned over"),
                   at_most(f"area of fluid and biomass, R = {radius:g} um", abs(grid.areas.sum() / 7500 - 1), 1e-12,
                           "no gap, no overlap"),
                   at_most(f"off its line, R = {radius:g} um", apart, 0.0, "nodes slide")]
    return Outcome(tuple(checks))
