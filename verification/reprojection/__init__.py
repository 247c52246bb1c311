"""Reprojection (30)-(34) and the transfer to a new mesh: what is conserved, what is reproduced."""

from __future__ import annotations

from functools import cache

import numpy as np

from repro import reprojection
from repro.mesh import triangle_areas
from verification import meshes, norms
from verification.case import Outcome, at_least, at_most, case
from verification.convergence import refine, study

ROUND_OFF = "round-off"
ENDS, WIDTH = (0.0, 40.0), 25.0


@cache
def _grid(size: float, seed: int):
    return meshes.rectangle(ENDS, WIDTH, size, seed=seed)


def _integral(points, triangles, field) -> float:
    return float(np.sum(triangle_areas(points, triangles)[:, None] / 3 * field[triangles]))


def _steep(x, y):
    """A layer one hundred times thinner than the domain."""
    return 1 + np.tanh((x - 18 + 0.4 * y) / 0.5)


@case("reprojection-supermesh", kind="exact",
      norm="relative difference of areas; largest difference of linear fields over their size",
      claim="The common pieces of two meshes cover both; linear fields pass from one to the other; any integral is "
            "kept",
      mutants=("clip-two-sides",))
def supermesh() -> Outcome:
    (p, t), (q, s) = _grid(2.0, 1), _grid(1.3, 2)
    corners, _, _ = reprojection.supermesh(p, t, q, s)
    edge = corners[:, 1:] - corners[:, :1]
    area = 0.5 * np.abs(edge[:, 0, 0] * edge[:, 1, 1] - edge[:, 0, 1] * edge[:, 1, 0]).sum()
    linear, rough = 3 + 2 * p[:, 0] - p[:, 1], np.random.default_rng(5).uniform(0, 1, len(p))
    found = reprojection.project(p, t, np.column_stack([linear, rough]), q, s)
    exact = 3 + 2 * q[:, 0] - q[:, 1]
    return Outcome((at_most("area", abs(area / 1000.0 - 1), 1e-12, ROUND_OFF),
                    at_most("linear field", np.abs(found[:, 0] - exact).max() / np.ptp(exact), 1e-11, ROUND_OFF),
                    at_most("integral of a random field",
                            abs(_integral(q, s, found[:, 1]) / _integral(p, t, rough) - 1), 1e-11, ROUND_OFF)))


@case("reprojection-order", kind="manufactured",
      norm="L2 of a smooth field, interpolated on one mesh and projected to another",
      claim="The projection loses nothing of the accuracy of linear elements",
      mutants=("corners-for-middles",))
def order() -> Outcome:
    def smooth(x, y):
        return 2 + np.sin(0.3 * x) * np.cos(0.2 * y)

    def measure(size):
        (p, t), (q, s) = _grid(size, 3), _grid(0.9 * size, 4)
        found = reprojection.project(p, t, smooth(*p.T)[:, None], q, s)
        return {"field": norms.l2_error(q, s, found[:, 0], smooth)}

    sizes = (4.0, 2.5, 1.6, 1.0)
    return Outcome(studies=(study("field", sizes, refine(measure, sizes)["field"], 2, "linear elements: second order",
                                  ceiling=5e-3),))


@case("reprojection-chain", kind="property", norm="relative drift of the integral of a steep field over 40 remeshes",
      claim="Forty remeshes of a steep field conserve its mass to round-off; linear interpolation does not (trap 5)",
      mutants=("linear-transfer",))
def chain() -> Outcome:
    grids = [_grid(1.6, 1), _grid(1.6, 2), _grid(1.9, 3)]
    drift = {}
    for name, carry in (("projection", reprojection.project),
                        ("interpolation", lambda p, t, f, q, s: reprojection.interpolate(p, t, f, q))):
        p, t = grids[0]
        field = _steep(*p.T)[:, None]
        start = _integral(p, t, field[:, 0])
        for k in range(1, 41):
            q, s = grids[k % 3]
            field = carry(p, t, field, q, s)
            p, t = q, s
        drift[name] = abs(_integral(p, t, field[:, 0]) / start - 1)
    return Outcome((at_most("projection", drift["projection"], 1e-11, "issue 3"),
                    at_least("interpolation, for comparison", drift["interpolation"], 1e-3,
                             "not conserving: the case would see it")))


@case("reprojection-mass", kind="property", norm="largest relative difference",
      claim="(34) keeps the mass of every node, and constants where all areas scale alike",
      mutants=("inverse-ratio",))
def mass() -> Outcome:
    grid = meshes.channel((-20.0, 20.0), WIDTH, 2.0, lambda x, y: y < 10, along=(10.0,), seed=6)
    random = np.random.default_rng(7)
    field = np.where(grid.lumped(grid.biomass) > 0, random.uniform(1, 2, len(grid.points)), 0.0)
    before = grid.lumped(grid.biomass)
    moved = grid.moved(grid.points + 0.2 * np.sin(grid.points))
    stretched = grid.moved(1.3 * grid.points)
    found = reprojection.reproject(field, before, moved.lumped(grid.biomass))
    inside = before > 0
    kept = np.abs(found * moved.lumped(grid.biomass) - field * before)[inside].max() / (field * before).max()
    scaled = reprojection.reproject(field, before, stretched.lumped(grid.biomass))
    return Outcome((at_most("mass of a node", kept, 1e-13, ROUND_OFF),
                    at_most("all areas times 1.69", np.abs(scaled * 1.69 - field).max(), 1e-12, ROUND_OFF),
                    at_most("outside the biomass", np.abs(found[~inside]).max(), 0.0, "(34): biomass nodes only")))
