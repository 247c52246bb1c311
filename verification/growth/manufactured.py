"""A growth that is made up, at finite strain, with theta, shear and pressure uneven and the loads to hold it.

Random meshes of a square, three sides held and the fourth pulled by its traction, so that the pressure's level is
determined. Where the exact pressure has a slope on the rim its order is that of the layer there (see
:mod:`verification.growth.cylinder`). Where it has none, what is left is h_tau, which jumps from triangle to triangle:
with one h for all of them the order is two (measured: 1.9 and 2.0 between 0.1 and 0.025), with their own it falls from
two towards 3/2.
"""

from __future__ import annotations

import numpy as np

from reference import manufactured_growth
from repro.fem import transfer
from repro.model import growth
from verification.case import Outcome, Profile, case
from verification.convergence import BAND, refine, study
from verification.growth import bodies, loaded
from verification.growth.bodies import Supported

#: Elements of straight and of curved triangles, and of how many random meshes of each size errors are averaged.
SIZES, DRAWS = {1: (0.2, 0.1, 0.05, 0.025), 2: (0.2, 0.1, 0.05, 0.03)}, {1: 3, 2: 6}
LAYER = "3/2 from a layer of one element at the rim, where the stabilisation wants dP/dn = 0"
UNEVEN = "no layer where dP/dn = 0: between 2, linear elements, and 3/2, for an h that jumps between triangles"
TAYLOR_HOOD = "quadratic places: third order; linear pressure: second"
#: Orders of the pressure, by kind, and why.
ORDERS = {1: {"sloping": (1.5, LAYER), "flat on the rim": (1.75, UNEVEN)},
          2: {"sloping": (2, TAYLOR_HOOD), "flat on the rim": (2, TAYLOR_HOOD)}}
#: Order of places, why, and the last errors of places and of the pressure, by kind.
PLACES = {1: (2, "linear elements: second order"), 2: (3, TAYLOR_HOOD)}
BANDS = {1: BAND, 2: 0.45}  # the coarsest square has five elements a side
CEILINGS = {1: (6e-4, 2e-2), 2: (3e-6, 4e-3)}


def _solved(size: float, seed: int, kind: int, exact) -> tuple[Supported, growth.Equilibrium]:
    """The unit square, its side X = 1 pulled, from the exact places of the nodes and no pressure."""
    grid, side = bodies.rectangle(size, seed, kind, 1.0, 1.0, bent=0.0)
    held = side["left"] | side["bottom"] | side["top"]
    body = bodies.on_mesh(grid, kind, grid.points, np.column_stack([held, held]))
    forces = loaded.body_force(body, exact.force) + loaded.traction(body, grid, exact.stress)
    return body, loaded.equilibrium(body, body.field(exact.theta), forces, exact.place(*grid.points.T))


def _errors(size: float, kind: int, exact) -> dict[str, float]:
    """Root mean square over DRAWS random meshes of the relative L2 errors."""
    rows = []
    for seed in range(DRAWS[kind]):
        body, found = _solved(size, round(1 / size) + seed, kind, exact)
        rows.append((bodies.size(body), bodies.place_error(body, found.position, exact.place),
                     bodies.pressure_error(body, found.pressure, exact.pressure)))
    return dict(zip(("size", "place", "pressure"), np.sqrt(np.mean(np.square(rows), axis=0))))


@case("growth-manufactured", kind="manufactured", norm="L2 of places and pressure over the body at t = 0, relative, "
      "root mean square over three or four random meshes a size",
      claim="A made-up growth with theta from 1 to 6.5, shears to one and an uneven pressure, held by body force and "
            "traction, is found at its order, whether the pressure has a slope on the rim or not, on straight and on "
            "curved triangles",
      mutants=("theta-power", "third-power", "stabilisation-sign"))
def manufactured() -> Outcome:
    studies, profiles = [], []
    for kind, orders in ORDERS.items():
        for name, (order, why) in orders.items():
            exact, told = manufactured_growth.growth(name), f"{name}, {bodies.WORDS[kind]}"
            found, (place, pressure) = refine(_errors, SIZES[kind], kind, exact), CEILINGS[kind]
            studies += [study(f"place, {told}", found["size"], found["place"], *PLACES[kind], ceiling=place,
                              band=BANDS[kind]),
                        study(f"pressure, {told}", found["size"], found["pressure"], order, why, ceiling=pressure)]
            if kind == 1:
                profiles.append(_profile(name, exact))
    return Outcome(studies=tuple(studies), profiles=tuple(profiles))


def _profile(name: str, exact) -> Profile:
    """The pressure along Y = 1/2."""
    body, found = _solved(SIZES[1][2], 0, 1, exact)
    x = np.linspace(0, 1, 60)
    line = np.column_stack([x, np.full(len(x), 0.5)])
    ours = transfer.interpolate(body.reference, body.cells, found.pressure[:, None], line)[:, 0]
    return Profile(f"P at Y = 1/2, {name}", "X", "P / mu_L",
                   (("ours", "ours", x, ours), ("exact", "exact", x, exact.pressure(*line.T))))
