"""Manufactured flow through a straight interface: nothing jumps but the viscosity, so that no order is reduced.

The force of the strong form (1) acts in both phases. The stabilisation of linear elements takes no notice of it, as in
(3.2), where there is none: it stays consistent to second order. On bent triangles the interface stays straight: the map
(s, t) -> (s, t + BEND s^2) leaves it so.
"""

from __future__ import annotations

from functools import cache

import numpy as np

from reference import manufactured_flow
from repro.fem.mesh import Mesh, curved
from verification.kernel.case import Outcome, Profile, Study, case, refine, study
from verification.problems import boxes, meshes, norms
from verification.problems.boxes import Problem

DRAWS = (10, 6, 3, 1)
SIZES, COARSE = (0.14, 0.07, 0.035, 0.0175), (0.28, 0.14, 0.07, 0.035)
FORMS = [(ratio, interface) for interface in ("traction", "laplacian") for ratio in (10.0, 2000.0)]
BEND, STRAIGHT = 0.2, None
FULL = "one more than the elements, in L2"
LAYERS = "3/2 at first (layers of one element along the rim, dp/dn = 0), 1 in the end (linear elements)"
BELOW = "that of the velocity's gradient in the end, the velocity's own at first; 0.3 on both sides"
#: Lowest and highest order of the pressure, for each order of the elements.
PRESSURE = {1: (0.9, 1.7, LAYERS), 2: (1.7, 3.3, BELOW), 3: (2.7, 4.3, BELOW)}


@case("flow-manufactured", kind="manufactured",
      norm="root mean square over random meshes of a size, relative L2 of u and p",
      claim="Where nothing jumps but the viscosity all orders are full, for lambda = 10 and 2000 in both forms",
      mutants=("saddle-sign",), ways="1", because="orders 2, 3: flow-manufactured-quadratic")
def manufactured() -> Outcome:
    studies = [part for form in FORMS for part in _studies(form, 1, STRAIGHT, SIZES, (2e-4, 0.06))]
    return Outcome(studies=tuple(studies), profiles=tuple(_profile(*form) for form in FORMS))


@case("flow-manufactured-quadratic", kind="manufactured", slow=True,
      norm="root mean square over random meshes of a size, relative L2 of u and p",
      claim="The same flow with quadratic velocities is of third order, its pressure of second; with cubic ones of "
            "fourth, its pressure of third",
      mutants=("traction-transposed", "cubic-lower-degree"), ways="2 3", because="order 1: flow-manufactured")
def manufactured_quadratic() -> Outcome:
    studies = [part for form in FORMS for part in (*_studies(form, 2, STRAIGHT, SIZES, (1e-6, 3e-4)),
                                                   *_studies(form, 3, STRAIGHT, COARSE, (1e-7, 5e-5)))]
    return Outcome(studies=tuple(studies))


@case("flow-curved-manufactured", kind="manufactured", slow=True,
      norm="root mean square over random meshes of a size, relative L2 of u and p",
      claim="On bent triangles quadratic velocities are of third order and cubic ones of fourth, their pressures of "
            "second and third, where the viscosity jumps tenfold at a straight interface, in both forms",
      mutants=("cubic-edge-crossed", "cubic-slope", "cubic-lower-degree", "curved-straight-divergence",
               "traction-transposed"), ways="2 3", because="order 1 has straight triangles: flow-manufactured")
def manufactured_curved() -> Outcome:
    studies = []
    for interface in ("laplacian", "traction"):
        studies += _studies((10.0, interface), 2, BEND, COARSE, (3e-5, 1e-3))
        studies += _studies((10.0, interface), 3, BEND, COARSE, (1e-6, 1e-4))
    return Outcome(studies=tuple(studies))


def _studies(form: tuple[float, str], order: int, bend: float | None, sizes, ceilings) -> tuple[Study, Study]:
    """Velocity and pressure of an order on meshes of some sizes; ceilings: their last errors at most."""
    problem, where = _problem(*form, order), f"order {order}, lambda = {form[0]:g}, {form[1]}"
    errors = refine(lambda level: meshes.root_mean_square(
        lambda draw: boxes.errors(_grid(sizes[level], draw, bend), problem), DRAWS[level]), range(len(sizes)))
    low, high, why = PRESSURE[order]
    return (study(f"velocity, {where}", sizes, errors["velocity"], order + 1, FULL, ceiling=ceilings[0]),
            Study(f"pressure, {where}", np.array(sizes), errors["pressure"], low, high, why, ceilings[1]))


@cache
def _grid(size: float, draw: int, bend: float | None) -> Mesh:
    """A box of unit width cut by the interface, which goes through the origin; both turned by ANGLE; bent triangles
    where ``bend`` is a number."""
    grid = meshes.cut((-0.6, 0.5), 1.0, size, lambda x, y: x > 0, across=(0.0,), seed=int(1e4 * size) + draw)
    if bend is not None:
        grid = curved(grid, None)
    s, t = (grid.points - [0.0, 0.5]).T
    t = t + (bend or 0.0) * s**2
    cos, sin = np.cos(manufactured_flow.ANGLE), np.sin(manufactured_flow.ANGLE)
    return grid.moved(np.column_stack([s * cos - t * sin, s * sin + t * cos]))


@cache
def _problem(ratio: float, interface: str, order: int) -> Problem:
    velocity, pressure, force = manufactured_flow.evaluated(ratio, interface)
    return Problem(ratio, interface, order, lambda x, y: (velocity(x, y), pressure(x, y)), force)


def _profile(ratio: float, interface: str) -> Profile:
    """The velocity along the interface, on a line across it."""
    problem, grid, s = _problem(ratio, interface, 1), _grid(SIZES[1], 0, STRAIGHT), np.linspace(-0.5, 0.45, 96)
    turn = manufactured_flow.ANGLE
    where, along = np.column_stack([np.cos(turn) * s, np.sin(turn) * s]), np.array([-np.sin(turn), np.cos(turn)])
    ours = norms.sample(grid.points, grid.triangles, boxes.solve(grid, problem)[0], where)
    return Profile(f"lambda = {ratio:g}, {interface}", "across the interface", "velocity along it",
                   (("ours", "ours", s, ours @ along), ("exact", "exact", s, problem.exact(*where.T)[0] @ along)))
