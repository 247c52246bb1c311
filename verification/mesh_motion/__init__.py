"""Mesh motion (3.5), (35): exact displacements, Taylor-Hood's, and no triangle turned over as the aggregate grows."""

from __future__ import annotations

from functools import cache

import numpy as np

from reference import taylor_hood
from repro import geometry, mesh, mesh_motion
from verification import meshes, norms
from verification.case import Outcome, at_least, at_most, case
from verification.convergence import refine, study

GAMMA, STABILISATION = 1.0, 100.0


@case("mesh_motion-plug", kind="exact",
      norm="largest difference of displacement over the plug's, for gamma = 0.01, 1, 100",
      claim="A plug that slides and stretches along the pore stretches the fluid linearly on both sides",
      mutants=("walls-held",))
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


@case("mesh_motion-half-disc", kind="cross-code", norm="L2 of the difference in displacement",
      claim="The fluid around a half-disc that grows by 5 % is displaced as Taylor-Hood elements displace it, for "
            "three gamma",
      mutants=("gamma-sign",))
def half_disc() -> Outcome:
    studies = []
    for gamma in (0.1, GAMMA, 10.0):
        errors = refine(_against_taylor_hood, (0.8, 1.25, 2.0, 3.2), gamma)
        studies.append(study(f"gamma = {gamma:g}", errors["size"], errors["displacement"], 2,
                             "linear elements: second order",
                             ceiling=5e-3))
    return Outcome(studies=tuple(studies))


@cache
def _trusted(gamma: float):
    return taylor_hood.follow(taylor_hood.half_disc(50.0, (-75.0, 75.0), 25.0, 2, 2), gamma)


def _against_taylor_hood(refinement: float, gamma: float) -> dict[str, float]:
    grid, _ = mesh.generate(geometry.seed(25.0, refinement), (-75.0, 75.0), 50.0, refinement, 2.0)
    ours, found = _moved(grid, 1.05 * grid.points, gamma) - grid.points, _trusted(gamma)
    apart = norms.sample(grid.points, grid.triangles, ours / 0.05, found.points) - found.velocity
    size = np.sum(found.areas * np.sum(found.velocity**2, axis=1))
    return {"size": norms.mean_size(grid),
            "displacement": float(np.sqrt(np.sum(found.areas * np.sum(apart**2, axis=1)) / size))}


@case("mesh_motion-growth", kind="property",
      norm="least quality and area of the moved triangles; distance from their line",
      claim="An aggregate that doubles its area in steps of 2 % leaves no triangle turned over, and boundary nodes on "
            "their lines",
      mutants=("stale-fluid",))
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
