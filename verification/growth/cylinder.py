"""The half-cylinder that grows by theta(R): shape and pressure against the closed form, far from t = 0.

The stabilisation wants dP/dn = 0 on the rim, where the exact pressure has a slope: in a layer of one element there the
pressure is wrong by O(h), which in the mean square over the body is O(h^(3/2)). That is also what is known: order one
for certain (Hughes, Franca and Balestra, 1986), 3/2 on meshes that are nearly regular (Eichel, Tobiska and Xie, 2011).
"""

from __future__ import annotations

from functools import cache

import numpy as np

from reference import neo_hookean
from verification import norms
from verification.case import Outcome, Profile, case
from verification.convergence import refine, study
from verification.growth import bodies

REFINEMENTS = (1.3, 2.2, 3.5, 6.0)
SECOND = "linear elements: second order"
LAYER = "3/2 from a layer of one element at the rim, where the stabilisation wants dP/dn = 0"


def coefficients(top: float) -> tuple[float, float, float]:
    """theta = a + c (R / R_0)^2: a third of ``top`` in the middle, ``top`` on the rim; a, c, R_0."""
    return top / 3, 2 * top / 3, bodies.RADIUS


def theta(top: float):
    """theta(X, Y)."""
    inner, more, outer = coefficients(top)
    return lambda x, y: inner + more * (x**2 + y**2) / outer**2


def exact_place(top: float):
    """Place (..., 2) of what was at X, Y."""
    def place(x, y):
        R = np.hypot(x, y)
        return np.stack([x, y], axis=-1) * (neo_hookean.cylinder_radius(R, *coefficients(top)) / R)[..., None]
    return place


def exact_pressure(top: float):
    """P over mu_L of what was at X, Y."""
    return lambda x, y: neo_hookean.cylinder_pressure(np.hypot(x, y).ravel(), *coefficients(top)).reshape(np.shape(x))


@cache
def cylinder(refinement: float, top: float):
    """(body, nodes of the arc, equilibrium)."""
    body, rim = bodies.half_disc(refinement)
    return body, rim, bodies.grown(body, theta(top)(*bodies.middles(body).T))


def errors(refinement: float, top: float) -> dict[str, float]:
    """Size of the elements; largest error of the outline's radius; L2 of places and pressure over the body."""
    body, rim, found = cylinder(refinement, top)
    X, t = body.reference, body.triangles
    start, end = (np.hypot(*places[rim].T) for places in (X, found.position))
    return {"size": bodies.size(body),
            "outline": np.abs(end / neo_hookean.cylinder_radius(start, *coefficients(top)) - 1).max(),
            "place": norms.l2_error(X, t, found.position, exact_place(top)),
            "pressure": norms.l2_error(X, t, found.pressure, exact_pressure(top))}


NORM = ("largest relative error of the outline's radius; L2 of places and of the pressure over the body at t = 0, "
        "relative")
CLAIM = "A half-disc that grows by theta(R), {} on the rim, becomes the exact half-disc, with the exact pressure"
WRONG = ("stabilisation-power", "stabilisation-too-weak", "stabilisation-of-rest", "stabilisation-sign")


@case("growth-half-cylinder", kind="exact", norm=NORM, claim=CLAIM.format(36), mutants=(*WRONG, "theta-power"))
def half_cylinder() -> Outcome:
    return _outcome(36.0)


@case("growth-half-cylinder-2000", kind="exact", norm=NORM, claim=CLAIM.format(2000), mutants=WRONG, slow=True)
def half_cylinder_2000() -> Outcome:
    return _outcome(2000.0)


def _outcome(top: float) -> Outcome:
    found = refine(errors, REFINEMENTS, top)
    expected = (("outline", 2, SECOND, 2e-4), ("place", 2, SECOND, 2e-4), ("pressure", 1.5, LAYER, 3e-3))
    studies = tuple(study(name, found["size"], found[name], order, why, ceiling=ceiling)
                    for name, order, why, ceiling in expected)
    return Outcome(studies=studies, profiles=(_outlines(top), _pressure_profile(top)))


def _outlines(top: float) -> Profile:
    body, rim, found = cylinder(REFINEMENTS[0], top)
    rim = rim[np.argsort(body.reference[rim, 0])]
    x, y = exact_place(top)(*body.reference[rim].T).T
    return Profile(f"outline, theta to {top:g}", "x (um)", "y (um)",
                   (("ours", "ours", *found.position[rim].T), ("closed form", "exact", x, y)))


def _pressure_profile(top: float) -> Profile:
    body, _, found = cylinder(REFINEMENTS[1], top)
    R, line = np.hypot(*body.reference.T), np.linspace(0.01, bodies.RADIUS, 100)
    order = np.argsort(R)
    exact = neo_hookean.cylinder_pressure(line, *coefficients(top))
    return Profile(f"pressure, theta to {top:g}", "R (um)", "P / mu_L",
                   (("nodes", "points", R[order], found.pressure[order]), ("closed form", "exact", line, exact)))
