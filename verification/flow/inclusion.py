"""A viscous disc in a sheared fluid: Schmid & Podladchikov's closed form, and its twin in the Laplacian form of [E2].

The pressure jumps at the interface by as much as it varies, and the continuous one of (3.2) smears the jump over one
layer of elements: an error of order one over an area of order h, 1/2 in L2 whatever the elements. What it costs the
velocity is of first order (its square, by duality): quadratic elements show it where lambda = 10, while beside the
second-order error of linear ones it is not to be seen on these meshes, nor where lambda = 2000 holds the disc stiff.
There curved elements, whose disc is round, keep their own orders until the jump's share is larger.
"""

from __future__ import annotations

from functools import cache

import numpy as np

from reference import viscous_inclusion
from repro.fem.mesh import Mesh
from verification import norms
from verification.case import Outcome, Profile, case
from verification.convergence import Study, refine, study
from verification.flow import boxes, grids
from verification.flow.boxes import Problem

ENDS, WIDTH = (-25.0, 25.0), 50.0
CENTRE, RADIUS, ANGLE = np.array([2.0, 24.0]), 15.0, 0.4
SIZES, DRAWS = (4.8, 2.4, 1.2, 0.6), (12, 8, 4, 1)
SECOND = "linear elements: second order; the jump's own share is smaller on these meshes"
JUMP = "1/2, from above: a continuous pressure cannot jump, the smooth part of the error falls faster"
STIFF = JUMP + "; more so where lambda multiplies the error of the disc's strain"


@case("flow-inclusion", kind="exact", norm="root mean square over random meshes of a size, relative L2 of u and p",
      claim="A viscous disc under pure shear strains as the closed form says, for lambda = 10 and 2000 in both forms",
      mutants=("traction-transposed", "normal-stress-halved"))
def inclusion() -> Outcome:
    studies, profiles = [], []
    for interface in ("traction", "laplacian"):
        for ratio in (10.0, 2000.0):
            errors = refine(_errors, range(len(SIZES)), _problem(ratio, interface, 1), SIZES, DRAWS)
            where = f"lambda = {ratio:g}, {interface}"
            studies += [study(f"velocity, {where}", SIZES, errors["velocity"], 2, SECOND, ceiling=1e-3),
                        _pressure_study(f"pressure, {where}", SIZES, errors["pressure"], ratio)]
            profiles.append(_profile(ratio, interface))
    return Outcome(studies=tuple(studies), profiles=tuple(profiles))


QUADRATIC_SIZES, QUADRATIC_DRAWS = (6.0, 3.0, 1.5, 0.75), (12, 8, 4, 1)
ROUND_SIZES, ROUND_DRAWS = {2: QUADRATIC_SIZES, 3: (8.0, 4.0, 2.0, 1.0)}, (6, 4, 2, 1)
SLOW = "from 2 (chords of the circle) or more down to 1 (the jump)"
#: Lowest and highest order, and largest last error, of the velocity where lambda = 2000 and the disc is round.
ROUND = {2: (2.5, 3.3, "third order in L2, from below while the circle has few edges", 5e-5),
         3: (0.9, 4.3, "from 4 (cubic elements) down to 1 (the jump)", 1e-5)}


@case("flow-inclusion-quadratic", kind="exact", slow=True,
      norm="root mean square over random meshes of a size, relative L2 of u and p",
      claim="Quadratic and cubic velocities show what the jump of the pressure costs: first order where the disc gives "
            "way, in both forms; a stiff disc shows the chords of its polygon, second order, or, round, the full order",
      mutants=("normal-stress-halved", "curved-straight-divergence"))
def inclusion_quadratic() -> Outcome:
    soft, stiff = (refine(_errors, range(len(SIZES)), _problem(ratio, "traction", 2), QUADRATIC_SIZES, QUADRATIC_DRAWS)
                   for ratio in (10.0, 2000.0))
    studies = [Study("velocity, lambda = 10", np.array(QUADRATIC_SIZES), soft["velocity"], 0.9, 1.8, SLOW, 1e-3),
               study("velocity, lambda = 2000", QUADRATIC_SIZES, stiff["velocity"], 2,
                     "chords of the circle: second order", ceiling=3e-4),
               _pressure_study("pressure, lambda = 10", QUADRATIC_SIZES, soft["pressure"]),
               _pressure_study("pressure, lambda = 2000", QUADRATIC_SIZES, stiff["pressure"])]
    for order in (2, 3):
        for interface in ("traction", "laplacian"):
            studies += _round_studies(order, interface)
    return Outcome(studies=tuple(studies))


def _round_studies(order: int, interface: str) -> list[Study]:
    """Of a disc bounded by arcs."""
    sizes, where = np.array(ROUND_SIZES[order]), f"round, order {order}, {interface}"
    soft, stiff = (refine(_errors, range(len(sizes)), _problem(ratio, interface, order), sizes, ROUND_DRAWS,
                          grids.round_disc) for ratio in (10.0, 2000.0))
    low, high, why, ceiling = ROUND[order]
    return [Study(f"velocity, lambda = 10, {where}", sizes, soft["velocity"], 0.9, 1.8, SLOW, 1e-3),
            Study(f"velocity, lambda = 2000, {where}", sizes, stiff["velocity"], low, high, why, ceiling),
            _pressure_study(f"pressure, lambda = 10, {where}", sizes, soft["pressure"]),
            _pressure_study(f"pressure, lambda = 2000, {where}", sizes, stiff["pressure"])]


def _pressure_study(name: str, sizes, errors, ratio: float = 10.0) -> Study:
    low, high, why = (0.35, 0.8, JUMP) if ratio == 10.0 else (0.35, 1.2, STIFF)
    return Study(name, np.array(sizes), errors, low, high, why, 0.3)


@cache
def _grid(size: float, draw: int, kind=grids.disc) -> Mesh:
    return kind(ENDS, WIDTH, size, CENTRE, RADIUS, seed=int(1000 * size) + draw)


def _problem(ratio: float, interface: str, order: int) -> Problem:
    def exact(x, y):
        return viscous_inclusion.fields(x - CENTRE[0], y - CENTRE[1], RADIUS, ratio, interface, ANGLE)

    return Problem(ratio, interface, order, exact)


def _errors(level: int, problem: Problem, sizes, draws, kind=grids.disc) -> dict[str, float]:
    return grids.root_mean_square(lambda draw: boxes.errors(_grid(sizes[level], draw, kind), problem), draws[level])


def _profile(ratio: float, interface: str) -> Profile:
    """The velocity along y on a slanting line through the disc."""
    problem, grid, s = _problem(ratio, interface, 1), _grid(SIZES[2], 0), np.linspace(-24.0, 24.0, 97)
    where = CENTRE + np.column_stack([0.9 * s, 0.5 * s])
    ours = norms.sample(grid.points, grid.triangles, boxes.solve(grid, problem)[0], where)
    exact = problem.exact(*where.T)[0]
    return Profile(f"lambda = {ratio:g}, {interface}", "along a line through the disc (um)", "u_y / (um per unit time)",
                   (("ours", "ours", s, ours[:, 1]), ("exact", "exact", s, exact[:, 1])))
