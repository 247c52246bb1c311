"""Homogeneous growth, which linear and quadratic elements hold exactly on any mesh: free and confined.

Patch tests: a body whose rim is held at F X has F inside, with constant pressure, on any mesh.

With all of its rim held the level of the pressure would be open, so that one end is free along its normal, or pulled.

The half-cylinder that grows by theta(R): shape and pressure against the closed form, far from t = 0.

The stabilisation wants dP/dn = 0 on the rim, where the exact pressure has a slope: in a layer of one element there the
pressure is wrong by O(h), which in the mean square over the body is O(h^(3/2)). That is also what is known: order one
for certain (Hughes, Franca and Balestra, 1986), 3/2 on meshes that are nearly regular (Eichel, Tobiska and Xie, 2011).
"""

from __future__ import annotations

from functools import cache

import numpy as np

from reference import neo_hookean
from repro.model import growth
from verification.kernel.case import Check, Outcome, Profile, at_most, case, refine, study
from verification.problems import bodies
from verification.problems.bodies import Supported

ROUND_OFF = "round-off: the elements hold it; Newton's method stops at 1e-11"


def exactly(name: str, held: Supported, found: growth.Equilibrium, F: np.ndarray, pressure: float) -> list[Check]:
    """Places, pressures and Cauchy stresses of an equilibrium against homogeneous F (2, 2) and P."""
    exact = neo_hookean.cauchy(F, pressure)
    reached = held.body.strained(found.position).F
    P = found.pressure[held.cells[:, :3]] @ held.body.shape.table.linear.T
    stress = growth.cauchy(reached, P)
    gap = np.abs(stress - [exact[0, 0], exact[1, 1], exact[2, 2], exact[0, 1]]).max()
    back, largest = found.position @ np.linalg.inv(F).T - held.reference, max(np.abs(exact).max(), abs(pressure))
    return [at_most(f"place, {name}", np.abs(back).max() / bodies.LENGTH, 1e-9, ROUND_OFF),
            at_most(f"pressure, {name}", np.abs(found.pressure - pressure).max() / largest, 1e-8, ROUND_OFF),
            at_most(f"stress, {name}", gap / largest, 1e-8, ROUND_OFF)]


NORM = "largest difference: places, carried back to t = 0, over the length; pressures and stresses over the largest"


def _supports(side, kind: int):
    """(name, held in x (n,), thetas, F and P of theta)."""
    return (("free", side["left"], (2.0, 36.0, 2000.0) if kind < 3 else (36.0,), _free),
            ("confined", side["left"] | side["right"], (2.0, 36.0) if kind < 3 else (36.0,), _confined))


@case("growth-homogeneous", kind="exact", norm=NORM,
      claim="Uniform growth, free to theta = 2000 and confined to one direction to theta = 36, has the exact shape, "
            "pressure and stress on any mesh of straight or of curved triangles [E11]",
      mutants=("theta-power", "third-power", "thickness-forgotten", "stress-across"), over=bodies.EVERY)
def homogeneous(kind: int):
    grid, side = bodies.rectangle(1.3 if kind == 1 else 2.0, 4, kind)
    for name, held, thetas, exact in _supports(side, kind):
        body = bodies.on_mesh(grid, kind, grid.points, np.column_stack([held, side["bottom"]]))
        for theta in thetas:
            found = bodies.grown(body, body.constant(theta))
            yield exactly(f"{name}, theta = {theta:g}", body, found, *exact(theta))


@case("growth-curved-homogeneous", kind="exact",
      norm="largest difference in position over the length, and in pressure over its size",
      claim="The same on a mesh that was made half way, its material grown before: theta counts from t = 0, whatever "
            "shape the search starts from, on straight and on curved triangles",
      mutants=("theta-since-the-start", "theta-power"), over=bodies.EVERY)
def made_half_way(kind: int):
    grid, side = bodies.rectangle(1.6, 4, kind)
    for top, made_at in ((2.0, 1.0), (36.0, 1.0), (36.0, 5.0)):
        for name, held, _, exact in _supports(side, kind):
            body = bodies.on_mesh(grid, kind, grid.points, np.column_stack([held, side["bottom"]]))
            start = grid.points @ exact(made_at)[0]
            found = growth.equilibrium(body.body, body.constant(top), start, body.resting, body.held, start)
            yield exactly(f"{name}, theta = {top:g}, mesh made at {made_at:g}", body, found, *exact(top))[:2]


def _free(theta: float):
    """F and P."""
    return np.sqrt(theta) * np.eye(2), neo_hookean.free_growth_pressure(theta)


def _confined(theta: float):
    """F and P."""
    return np.diag([1.0, theta]), neo_hookean.confined_growth_pressure(theta)


#: F = [[a, b], [0, d]] by a, b, d: squeezed along x, sheared by 3, half and 2000 times the area.
SHEARS = ((0.7, 0.9, 2.5), (1.0, 3.0, 2.0), (0.8, -0.5, 0.625), (20.0, 60.0, 100.0))
#: Elements (um) of straight and of curved triangles, and how far inner nodes are shaken at random (um).
SIZES, SHAKEN = {1: 1.3, 2: 2.0}, {1: 0.1, 2: 0.02}
TURN = np.array([[0.0, -1.0], [1.0, 0.0]])


@case("growth-patch", kind="exact", norm=NORM,
      claim="A body of straight or curved triangles whose rim is held at F X, but for an end that is free to move "
            "along its normal, has F inside and constant, exact pressure and stress: shears to 3, J from 0.5 to 2000, "
            "the end on each of the four sides",
      mutants=("theta-power", "untransposed", "thickness-forgotten", "held-short"), over=bodies.EVERY)
def patch(kind: int):
    ends = [np.linalg.matrix_power(TURN, turns) for turns in range(4)]
    return [_sheared(kind, Q, *shear) for Q, shear in zip(ends, SHEARS)]


def _sheared(kind: int, Q: np.ndarray, a: float, b: float, d: float) -> list[Check]:
    """A body turned by Q, a multiple of a right angle, with its end that was the upper one free along its normal."""
    grid, side = bodies.rectangle(SIZES[min(kind, 2)], 5, kind)
    rim = side["left"] | side["right"] | side["bottom"]
    held = np.abs(np.column_stack([rim | side["top"], rim]) @ Q.T) > 0
    body = bodies.on_mesh(grid, kind, grid.points @ Q.T, held)

    def F(part):
        return Q @ np.array([[a**part, part * b], [0.0, d**part]]) @ Q.T

    found = bodies.grown(body, body.constant(a * d), lambda part: body.reference @ F(part).T)
    pressure = -neo_hookean.cauchy(Q.T @ F(1.0) @ Q, 0.0)[1, 1]
    return exactly(f"a, b, d = {a:g}, {b:g}, {d:g}", body, found, F(1.0), pressure)


#: Any F: a turn, a shear in any direction, a stretch; and P over mu_L.
LOADED = (([[0.8, -0.6], [0.6, 0.8]], 0.4), ([[1.7, 2.1], [-0.8, 1.1]], -1.3), ([[-31.0, 45.0], [-42.0, -3.0]], 0.02))


@case("growth-patch-traction", kind="exact", norm=NORM,
      claim="A body of straight or curved triangles held at F X on three sides and pulled by the traction of F and P "
            "on the fourth has F and P inside, for any F, turned and sheared, J to 2000, and any P",
      mutants=("theta-power", "third-power", "untransposed", "one-corner-pressure"), over=bodies.EVERY)
def patch_traction(kind: int):
    return [_pulled(kind, np.array(F), P) for F, P in LOADED]


def _pulled(kind: int, F: np.ndarray, P: float) -> list[Check]:
    """A body whose side on the right is pulled, from places that are shaken."""
    grid, side = bodies.rectangle(SIZES[min(kind, 2)], 8, kind)
    inside = ~np.any(list(side.values()), axis=0)
    shake = np.random.default_rng(9).uniform(-1, 1, grid.points.shape) * inside[:, None] * SHAKEN[min(kind, 2)]
    J, held = np.linalg.det(F), side["left"] | side["bottom"] | side["top"]
    S = J * neo_hookean.cauchy(F, P)[:2, :2] @ np.linalg.inv(F).T
    body = bodies.on_mesh(grid, kind, grid.points, np.column_stack([held, held]))
    forces = bodies.traction(body, grid, lambda x, y: np.broadcast_to(S, (*x.shape, 2, 2)))
    found = bodies.equilibrium(body, body.constant(J), forces, (grid.points + shake) @ F.T)
    return exactly(f"F = {F.tolist()}, P = {P:g}", body, found, F, P)


REFINEMENTS = {1: (1.3, 2.2, 3.5, 6.0), 2: (0.3, 0.6, 1.2, 2.4), 3: (0.3, 0.6, 1.2, 2.4)}
SECOND = "linear elements: second order"
LAYER = "3/2 from a layer of one element at the rim, where the stabilisation wants dP/dn = 0"


def exact(top: float) -> bodies.HalfCylinder:
    """theta: a third of ``top`` in the middle, ``top`` on the rim."""
    return bodies.HalfCylinder(top / 3, top)


@cache
def cylinder(refinement: float, top: float, kind: int = 1):
    """(body, nodes of the arc, equilibrium)."""
    body, rim = bodies.half_disc(refinement, kind)
    return body, rim, bodies.grown(body, body.field(exact(top).theta))


def errors(refinement: float, top: float, kind: int = 1) -> dict[str, float]:
    """Size of the elements; largest error of the outline's radius; L2 of places and pressure over the body."""
    body, rim, found = cylinder(refinement, top, kind)
    start, end = (np.hypot(*places[rim].T) for places in (body.reference, found.position))
    return {"size": bodies.size(body),
            "outline": np.abs(end / exact(top).radius(start) - 1).max(),
            "place": bodies.place_error(body, found.position, exact(top).place),
            "pressure": bodies.pressure_error(body, found.pressure, exact(top).pressure)}


CYLINDER_NORM = ("largest relative error of the outline's radius; L2 of places and of the pressure over the body at "
                 "t = 0, relative")
CLAIM = "A half-disc that grows by theta(R), {} on the rim, becomes the exact half-disc, with the exact pressure"
WRONG = ("stabilisation-power", "stabilisation-too-weak", "stabilisation-of-rest", "stabilisation-sign")


@case("growth-half-cylinder", kind="exact", norm=CYLINDER_NORM, claim=CLAIM.format(36), mutants=(*WRONG, "theta-power"),
      ways="1", because="orders 2, 3: growth-curved-half-cylinder")
def half_cylinder() -> Outcome:
    return _outcome(36.0)


@case("growth-half-cylinder-2000", kind="exact", norm=CYLINDER_NORM, claim=CLAIM.format(2000), mutants=WRONG, slow=True,
      ways="1", because="orders 2, 3: growth-curved-half-cylinder")
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
    x, y = exact(top).place(*body.reference[rim].T).T
    return Profile(f"outline, theta to {top:g}", "x (um)", "y (um)",
                   (("ours", "ours", *found.position[rim].T), ("closed form", "exact", x, y)))


@case("growth-curved-half-cylinder", kind="exact", slow=True,
      norm="largest relative error of the outline's radius; L2 of positions and of the pressure over the body at t = 0",
      claim="A curved half-disc that grows by theta(R) becomes the exact half-disc: places to third order, the "
            "pressure to second, and as well at theta = 2000 as at 36; in scenes of quadratic and of cubic elements",
      mutants=("grad-div-dropped", "theta-power"), over={bodies.WORDS[kind]: (kind,) for kind in (2, 3)},
      because="order 1: growth-half-cylinder")
def curved_half_cylinder(kind: int):
    found = refine(errors, REFINEMENTS[kind], 36.0, kind)
    yield study("position, theta to 36", found["size"], found["place"], 3, "quadratic places: third order in L2",
                ceiling=1e-5, band=0.4)
    yield study("pressure, theta to 36", found["size"], found["pressure"], 2, "linear pressure: second order in L2",
                ceiling=2e-3)
    yield at_most("outline, theta to 36", found["outline"][-1], 1e-5, "under that of positions in L2")
    far = errors(REFINEMENTS[kind][-2], 2000.0, kind)
    for name in ("outline", "place", "pressure"):
        yield at_most(f"{name}, theta to 2000", far[name], 1.05 * found[name][-2],
                      "as at theta = 36: what is left of the error is in the shape of theta(R), not in its size")
    yield _pressure_profile(36.0, kind)


def _pressure_profile(top: float, kind: int = 1) -> Profile:
    body, _, found = cylinder(REFINEMENTS[kind][1], top, kind)
    R, line = np.hypot(*body.reference[:body.corners].T), np.linspace(0.01, bodies.RADIUS, 100)
    order = np.argsort(R)
    pressure = exact(top).pressure(line, 0 * line)
    return Profile(f"pressure, theta to {top:g}, {bodies.WORDS[kind]}", "R (um)", "P / mu_L",
                   (("nodes", "points", R[order], found.pressure[order]), ("closed form", "exact", line, pressure)))
