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
from repro.model import growth
from verification import meshes, norms
from verification.case import Outcome, Profile, case
from verification.convergence import refine, study
from verification.growth import bodies, loaded

SIZES, DRAWS = (0.2, 0.1, 0.05, 0.025), 3
LAYER = "3/2 from a layer of one element at the rim, where the stabilisation wants dP/dn = 0"
UNEVEN = "no layer where dP/dn = 0: between 2, linear elements, and 3/2, for an h that jumps between triangles"
ORDERS = {"sloping": (1.5, LAYER), "flat on the rim": (1.75, UNEVEN)}


def _solved(size: float, seed: int, exact) -> tuple[growth.Body, growth.Equilibrium]:
    """The unit square, its side X = 1 pulled, from the exact places of the nodes and no pressure."""
    points, triangles = meshes.rectangle((0.0, 1.0), 1.0, size, seed=seed)
    x, y = points.T
    held = (x == 0) | (y == 0) | (y == 1)
    body = growth.Body(points, triangles, np.column_stack([held, held]))
    forces = loaded.body_force(body, exact.force) + loaded.traction(body, x == 1, exact.stress)
    return body, loaded.equilibrium(body, exact.theta(*bodies.middles(body).T), forces, exact.place(x, y))


def _errors(size: float, exact) -> dict[str, float]:
    """Root mean square over DRAWS random meshes of the relative L2 errors."""
    rows = []
    for seed in range(DRAWS):
        body, found = _solved(size, round(1 / size) + seed, exact)
        t = body.triangles
        rows.append((bodies.size(body), norms.l2_error(body.reference, t, found.position, exact.place),
                     norms.l2_error(body.reference, t, found.pressure, exact.pressure)))
    return dict(zip(("size", "place", "pressure"), np.sqrt(np.mean(np.square(rows), axis=0))))


@case("growth-manufactured", kind="manufactured", norm="L2 of places and pressure over the body at t = 0, relative, "
      "root mean square over three random meshes a size",
      claim="A made-up growth with theta from 1 to 6.5, shears to one and an uneven pressure, held by body force and "
            "traction, is found at its order, whether the pressure has a slope on the rim or not",
      mutants=("theta-power", "third-power", "stabilisation-sign"))
def manufactured() -> Outcome:
    studies, profiles = [], []
    for name, (order, why) in ORDERS.items():
        exact = manufactured_growth.growth(name)
        found = refine(_errors, SIZES, exact)
        studies += [study(f"place, {name}", found["size"], found["place"], 2, "linear elements: second order",
                          ceiling=6e-4),
                    study(f"pressure, {name}", found["size"], found["pressure"], order, why, ceiling=2e-2)]
        profiles.append(_profile(name, exact))
    return Outcome(studies=tuple(studies), profiles=tuple(profiles))


def _profile(name: str, exact) -> Profile:
    """The pressure along Y = 1/2."""
    body, found = _solved(SIZES[2], 0, exact)
    x = np.linspace(0, 1, 60)
    line = np.column_stack([x, np.full(len(x), 0.5)])
    ours = norms.sample(body.reference, body.triangles, found.pressure, line)
    return Profile(f"P at Y = 1/2, {name}", "X", "P / mu_L",
                   (("ours", "ours", x, ours), ("exact", "exact", x, exact.pressure(*line.T))))
