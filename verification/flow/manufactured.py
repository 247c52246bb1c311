"""Manufactured flow through a straight interface: nothing jumps but the viscosity, so that no order is reduced.

The force of the strong form (1) acts in both phases. The stabilisation takes no notice of it, as in (3.2), where there
is none: it stays consistent to second order.
"""

from __future__ import annotations

from functools import cache

import numpy as np

from reference import manufactured_flow
from repro.fem.mesh import PoreMesh
from verification import norms
from verification.case import Outcome, Profile, case
from verification.convergence import Study, refine, study
from verification.flow import boxes, grids
from verification.flow.boxes import Problem

SIZES, DRAWS = (0.14, 0.07, 0.035, 0.0175), (10, 6, 3, 1)
LAYERS = "3/2 at first (layers of one element along the rim, dp/dn = 0), 1 in the end (linear elements)"
FORMS = [(ratio, interface) for interface in ("traction", "laplacian") for ratio in (10.0, 2000.0)]


@case("flow-manufactured", kind="manufactured",
      norm="root mean square over random meshes of a size, relative L2 of u and p",
      claim="Where nothing jumps but the viscosity all orders are full, for lambda = 10 and 2000 in both forms",
      mutants=("saddle-sign",))
def manufactured() -> Outcome:
    studies, profiles = [], []
    for ratio, interface in FORMS:
        errors, where = _series(ratio, interface, 1), f"lambda = {ratio:g}, {interface}"
        studies += [study(f"velocity, {where}", SIZES, errors["velocity"], 2, "linear elements: second order in L2",
                          ceiling=2e-4),
                    Study(f"pressure, {where}", np.array(SIZES), errors["pressure"], 0.9, 1.7, LAYERS, 0.06)]
        profiles.append(_profile(ratio, interface))
    return Outcome(studies=tuple(studies), profiles=tuple(profiles))


@case("flow-manufactured-quadratic", kind="manufactured", slow=True,
      norm="root mean square over random meshes of a size, relative L2 of u and p",
      claim="The same flow with quadratic velocities is of third order, its pressure of second",
      mutants=("quadratic-stabilised",))
def manufactured_quadratic() -> Outcome:
    studies = []
    for ratio, interface in FORMS:
        errors, where = _series(ratio, interface, 2), f"lambda = {ratio:g}, {interface}"
        studies += [study(f"velocity, {where}", SIZES, errors["velocity"], 3, "quadratic elements: third order in L2",
                          ceiling=1e-6),
                    Study(f"pressure, {where}", np.array(SIZES), errors["pressure"], 1.7, 3.3,
                          "linear pressure: second order in the end, the velocity's third at first; 0.3 on both sides",
                          3e-4)]
    return Outcome(studies=tuple(studies))


def _series(ratio: float, interface: str, order: int) -> dict[str, np.ndarray]:
    problem = _problem(ratio, interface, order)
    return refine(lambda level: grids.root_mean_square(
        lambda draw: boxes.errors(_grid(SIZES[level], draw), problem), DRAWS[level]), range(len(SIZES)))


@cache
def _grid(size: float, draw: int) -> PoreMesh:
    """A box of unit width cut by the interface, which goes through the origin; both turned by ANGLE."""
    grid = grids.channel((-0.6, 0.5), 1.0, size, lambda x, y: x > 0, across=(0.0,), seed=int(1e4 * size) + draw)
    (s, t), turn = (grid.points - [0.0, 0.5]).T, manufactured_flow.ANGLE
    return grid.moved(np.column_stack([s * np.cos(turn) - t * np.sin(turn), s * np.sin(turn) + t * np.cos(turn)]))


@cache
def _problem(ratio: float, interface: str, order: int) -> Problem:
    velocity, pressure, force = manufactured_flow.evaluated(ratio, interface)
    return Problem(ratio, interface, order, lambda x, y: (velocity(x, y), pressure(x, y)), force)


def _profile(ratio: float, interface: str) -> Profile:
    """The velocity along the interface, on a line across it."""
    problem, grid, s = _problem(ratio, interface, 1), _grid(SIZES[1], 0), np.linspace(-0.5, 0.45, 96)
    turn = manufactured_flow.ANGLE
    where, along = np.column_stack([np.cos(turn) * s, np.sin(turn) * s]), np.array([-np.sin(turn), np.cos(turn)])
    ours = norms.sample(grid.points, grid.triangles, boxes.solve(grid, problem)[0], where)
    return Profile(f"lambda = {ratio:g}, {interface}", "across the interface", "velocity along it",
                   (("ours", "ours", s, ours @ along), ("exact", "exact", s, problem.exact(*where.T)[0] @ along)))
