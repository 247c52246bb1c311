"""A layer of biomass along the lower wall of a long channel: two viscous layers, exact for any ratio of viscosities.

The inlet's parabola turns into the layered profile within a few layers' thicknesses (like exp(-1.1 x / h) in biomass);
the middle of the layer is ten of them away from its ends, where what is left is under 1e-4.
"""

from __future__ import annotations

from functools import cache

import numpy as np

from reference import layered_channel
from repro.fem.mesh import PoreMesh
from repro.model import flow
from verification import norms
from verification.case import Outcome, Profile, case
from verification.convergence import refine, study
from verification.flow import grids

WIDTH, LAYER, LAYER_END, BEYOND, MIDDLE = 50.0, 12.5, 125.0, 15.0, 25.0
RATIOS = (1.0, 10.0, 100.0, 2000.0, 1e5, 1e8)
SIZES, DRAWS = LAYER / np.array([1.5, 3.0, 6.0, 12.0]), (16, 12, 6, 1)
SECOND = "linear elements: second order in L2"
#: Errors of the finest meshes may reach this.
CEILINGS = {"velocity": 1e-3, "velocity in the layer": 1e-3, "gradient": 1.2e-3}


@case("flow-layers", kind="exact", slow=True, norm="middle of a long layer, root mean square over random meshes of a "
      "size: L2 of u, of u within the layer (relative to that), and relative error of the pressure gradient",
      claim="Along a layer of biomass the flow is that of two viscous layers, for lambda from 1 to 1e8",
      mutants=("tau-of-water",))
def layers() -> Outcome:
    studies, profiles = [], []
    for ratio in RATIOS:
        errors = refine(_errors, range(len(SIZES)), ratio)
        studies += [study(f"{name}, lambda = {ratio:g}", SIZES, errors[name], 2, SECOND, ceiling=ceiling)
                    for name, ceiling in CEILINGS.items()]
        profiles.append(_profile(ratio))
    return Outcome(studies=tuple(studies), profiles=tuple(profiles))


def _errors(level: int, ratio: float) -> dict[str, float]:
    return grids.root_mean_square(lambda draw: _layered(_grid(level, draw), ratio), DRAWS[level])


@cache
def _grid(level: int, draw: int) -> PoreMesh:
    end = LAYER_END + BEYOND
    return grids.channel((-end, end), WIDTH, SIZES[level], lambda x, y: (y < LAYER) & (np.abs(x) < LAYER_END),
                         across=(-LAYER_END, LAYER_END), along=(LAYER,), seed=int(1000 * SIZES[level]) + draw)


def _layered(grid: PoreMesh, ratio: float) -> dict[str, float]:
    found = flow.unit_flow(grid, ratio)
    middle = np.abs(grid.points[grid.triangles, 0].mean(axis=1)) < MIDDLE

    def exact(x, y):
        return np.stack([layered_channel.velocity(y, WIDTH, LAYER, ratio), 0 * y], axis=-1)

    gradient = layered_channel.gradient(WIDTH, LAYER, ratio)
    return {"velocity": norms.l2_error(grid.points, grid.triangles[middle], found.velocity, exact),
            "velocity in the layer": norms.l2_error(grid.points, grid.triangles[middle & grid.biomass],
                                                    found.velocity, exact),
            "gradient": abs(_slope(grid, grid.triangles[middle], found.pressure) / gradient - 1)}


def _slope(grid: PoreMesh, triangles, pressure) -> float:
    """-dp/dx by least squares over some triangles."""
    where, weight, shape = norms.quadrature(grid.points, triangles)
    x, p = where[..., 0], np.einsum("qa,ta->tq", shape, pressure[triangles])
    x = x - np.sum(weight * x) / weight.sum()
    return float(-np.sum(weight * p * x) / np.sum(weight * x**2))


def _profile(ratio: float) -> Profile:
    grid, y = _grid(1, 0), np.linspace(0.0, WIDTH, 101)
    where = np.column_stack([np.zeros_like(y), y])
    ours = norms.sample(grid.points, grid.triangles, flow.unit_flow(grid, ratio).velocity[:, 0], where)
    exact = layered_channel.velocity(y, WIDTH, LAYER, ratio)
    return Profile(f"lambda = {ratio:g}", "y (um)", "u_x / u_ave",
                   (("ours", "ours", y, ours), ("exact", "exact", y, exact)))
