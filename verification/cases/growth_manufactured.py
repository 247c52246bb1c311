"""Manufactured growth, with finite strain, uneven theta, shear and pressure, and the loads that balance it.

On random meshes of a square, three sides are prescribed, and the traction of the fourth determines the level of the
pressure. If the exact pressure has a slope on the rim, its order is that of the layer there (see
:mod:`verification.cases.growth`). Otherwise h_tau, which jumps from triangle to triangle, limits it: with one h for all
triangles the order is two (measured: 1.9 and 2.0 between 0.1 and 0.025), and with their own h it falls from two towards
3/2.
"""

import pytest

from reference import manufactured_growth
from verification.evidence.cases import parametrize
from verification.evidence.checks import around, refine, studies
from verification.problems import bodies

#: Element sizes of straight and of curved triangles, with the number of random meshes of each.
SIZES = {1: dict.fromkeys((0.2, 0.1, 0.05, 0.025), 3), 2: dict.fromkeys((0.2, 0.1, 0.05, 0.03), 6)}
LAYER = "3/2 from a layer of one element at the rim, where the stabilisation imposes dP/dn = 0"
UNEVEN = "no layer where dP/dn = 0: between 2, linear elements, and 3/2, for an h that jumps between triangles"
TAYLOR_HOOD = "quadratic positions: third order; linear pressure: second"
#: Orders of the pressure, by kind, and why.
ORDERS = {1: {"sloping": (1.5, LAYER), "flat on the rim": (1.75, UNEVEN)},
          2: {"sloping": (2, TAYLOR_HOOD), "flat on the rim": (2, TAYLOR_HOOD)}}
#: Order of positions and its origin, by kind; last errors of positions and pressure.
PLACES = {1: (2, "linear elements: second order"),
          2: (around(3, 0.45), TAYLOR_HOOD)}  # the coarsest square has five elements a side
CEILINGS = {1: (6e-4, 2e-2), 2: (3e-6, 4e-3)}


def _errors(size: float, seed: int, kind: int, exact) -> dict[str, float]:
    """Relative L2 errors on a random mesh of the unit square, whose side X = 1 is pulled.

    Newton's method starts from the exact positions without pressure.
    """
    grid, side = bodies.rectangle(size, round(1 / size) + seed, kind, 1.0, 1.0, bent=0.0)
    constrained = side["left"] | side["bottom"] | side["top"]
    body = bodies.on_mesh(grid, constrained, constrained)
    forces = bodies.body_force(body, exact.force) + bodies.traction(body, grid, exact.stress)
    solution = bodies.equilibrium(body, body.field(exact.theta), exact.place(*grid.points.T), forces)
    return bodies.errors(body, solution, lambda x, y: (exact.place(x, y), exact.pressure(x, y)))


@pytest.mark.slow
@pytest.mark.case(
    "growth-manufactured", kind="manufactured", mutants=("theta-power", "third-power", "stabilisation-sign"),
    references=("manufactured_growth",))
@parametrize("kind", bodies.EVERY)
def test_manufactured(kind, record):
    """A manufactured growth with theta from 1 to 6.5, shears to one and an uneven pressure, in equilibrium with body
    force and traction, converges with its order, with or without a slope of the pressure on the rim, on straight and on
    curved triangles.

    Norm: L2 of positions and pressure over the body at t = 0, relative, root mean square over three or four random
    meshes a size.
    """
    for name, (order, why) in ORDERS[kind].items():
        exact = manufactured_growth.growth(name)
        place, pressure = CEILINGS[kind]
        record(studies(refine(_errors, SIZES[kind], kind, exact),
                       {"place": (*PLACES[kind], place), "pressure": (order, why, pressure)}, f", {name}"))
