"""The half-cylinder that grows by theta(R): shape and pressure against the closed form, far from t = 0.

The stabilisation wants dP/dn = 0 on the rim, where the exact pressure has a slope: in a layer of one element there the
pressure is wrong by O(h), which in the mean square over the body is O(h^(3/2)). That is also what is known: order one
for certain (Hughes, Franca and Balestra, 1986), 3/2 on meshes that are nearly regular (Eichel, Tobiska and Xie, 2011).
"""

from __future__ import annotations

from functools import cache

import numpy as np

from reference import neo_hookean
from verification.case import Outcome, Profile, at_most, case
from verification.convergence import refine, study
from verification.growth import bodies

REFINEMENTS = {1: (1.3, 2.2, 3.5, 6.0), 2: (0.3, 0.6, 1.2, 2.4), 3: (0.3, 0.6, 1.2, 2.4)}
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
def cylinder(refinement: float, top: float, kind: int = 1):
    """(body, nodes of the arc, equilibrium)."""
    body, rim = bodies.half_disc(refinement, kind)
    return body, rim, bodies.grown(body, body.field(theta(top)))


def errors(refinement: float, top: float, kind: int = 1) -> dict[str, float]:
    """Size of the elements; largest error of the outline's radius; L2 of places and pressure over the body."""
    body, rim, found = cylinder(refinement, top, kind)
    start, end = (np.hypot(*places[rim].T) for places in (body.reference, found.position))
    return {"size": bodies.size(body),
            "outline": np.abs(end / neo_hookean.cylinder_radius(start, *coefficients(top)) - 1).max(),
            "place": bodies.place_error(body, found.position, exact_place(top)),
            "pressure": bodies.pressure_error(body, found.pressure, exact_pressure(top))}


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
    found = refine(errors, REFINEMENTS[1], top)
    expected = (("outline", 2, SECOND, 2e-4), ("place", 2, SECOND, 2e-4), ("pressure", 1.5, LAYER, 3e-3))
    studies = tuple(study(name, found["size"], found[name], order, why, ceiling=ceiling)
                    for name, order, why, ceiling in expected)
    return Outcome(studies=studies, profiles=(_outlines(top), _pressure_profile(top)))


def _outlines(top: float) -> Profile:
    body, rim, found = cylinder(REFINEMENTS[1][0], top)
    rim = rim[np.argsort(body.reference[rim, 0])]
    x, y = exact_place(top)(*body.reference[rim].T).T
    return Profile(f"outline, theta to {top:g}", "x (um)", "y (um)",
                   (("ours", "ours", *found.position[rim].T), ("closed form", "exact", x, y)))


@case("growth-curved-half-cylinder", kind="exact", slow=True,
      norm="largest relative error of the outline's radius; L2 of positions and of the pressure over the body at t = 0",
      claim="A curved half-disc that grows by theta(R) becomes the exact half-disc: places to third order, the "
            "pressure to second, and as well at theta = 2000 as at 36; in scenes of quadratic and of cubic elements",
      mutants=("grad-div-dropped", "theta-power"))
def curved_half_cylinder() -> Outcome:
    checks, studies = [], []
    for kind in (2, 3):
        found, told = refine(errors, REFINEMENTS[kind], 36.0, kind), bodies.WORDS[kind]
        studies += [study(f"position, theta to 36, {told}", found["size"], found["place"], 3,
                          "quadratic places: third order in L2", ceiling=1e-5, band=0.4),
                    study(f"pressure, theta to 36, {told}", found["size"], found["pressure"], 2,
                          "linear pressure: second order in L2", ceiling=2e-3)]
        far = errors(REFINEMENTS[kind][-2], 2000.0, kind)
        checks += [at_most(f"{name}, theta to 2000, {told}", far[name], 1.05 * found[name][-2],
                           "as at theta = 36: what is left of the error is in the shape of theta(R), not in its size")
                   for name in ("outline", "place", "pressure")]
        checks.append(at_most(f"outline, theta to 36, {told}", found["outline"][-1], 1e-5,
                              "under that of positions in L2"))
    return Outcome(tuple(checks), tuple(studies), (_pressure_profile(36.0, 2),))


def _pressure_profile(top: float, kind: int = 1) -> Profile:
    body, _, found = cylinder(REFINEMENTS[kind][1], top, kind)
    R, line = np.hypot(*body.reference[:body.corners].T), np.linspace(0.01, bodies.RADIUS, 100)
    order = np.argsort(R)
    exact = neo_hookean.cylinder_pressure(line, *coefficients(top))
    return Profile(f"pressure, theta to {top:g}, {bodies.WORDS[kind]}", "R (um)", "P / mu_L",
                   (("nodes", "points", R[order], found.pressure[order]), ("closed form", "exact", line, exact)))
