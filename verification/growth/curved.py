"""Growth mechanics on curved triangles (quadratic places, linear pressure) against closed forms, to theta = 2000."""

from __future__ import annotations

from functools import cache

import numpy as np

from reference import neo_hookean
from repro.curved import elements, growth, pore
from repro.curved.mesh import curved
from repro.fem import geometry
from repro.model.shape import held_at
from repro.scene import parse_scene
from verification import meshes
from verification.case import Outcome, Profile, at_most, case
from verification.convergence import refine, study

RADIUS, REFINEMENTS = 20.0, (0.3, 0.6, 1.2, 2.4)
ROUND_OFF = "round-off of Newton's method"


@cache
def _half_disc(refinement: float):
    """(Body, nodes of its free rim) of a half-disc that slides on a wall, its middle fixed."""
    tables = {"pore": {"width": "50 um"}, "aggregate": {"radius": f"{RADIUS} um"}, "substrates": {},
              "numerics": {"refinement": refinement}}
    now = pore.seeded(parse_scene(tables, "half disc", "half_disc.toml"))
    rim, shape = now.mesh.body_loop, now.outline
    held = held_at(len(now.mesh.body), rim, shape.wall, shape.fixed)
    return growth.of(now, held), rim[shape.wall == geometry.FREE]


def _coefficients(top: float) -> tuple[float, float]:
    """theta = a + c (R / R_0)^2: a third of ``top`` in the middle, ``top`` on the rim."""
    return top / 3, 2 * top / 3


@cache
def _cylinder(refinement: float, top: float):
    body, rim = _half_disc(refinement)
    inner, more = _coefficients(top)
    theta = inner + more * np.sum(body.origin**2, axis=1) / RADIUS**2
    return body, rim, growth.equilibrium(body, theta, body.origin, np.zeros(body.corners), body.origin)


def _mean_square(at, values) -> float:
    """Root of the integral of |values|^2, (t, q) or (t, q, 2), over the body at t = 0."""
    weight = at.dx.reshape(at.dx.shape + (1,) * (values.ndim - 2))
    return float(np.sqrt(np.sum(weight * values**2)))


def _in_points(values, cells) -> np.ndarray:
    """(t, q, 2) places (n, 2) in the points of the quadrature."""
    return np.stack([elements.at_points(values[:, k], cells) for k in (0, 1)], axis=-1)


def _cylinder_errors(refinement: float, top: float) -> dict[str, float]:
    body, rim, found = _cylinder(refinement, top)
    given, at = (*_coefficients(top), RADIUS), body.places
    X = _in_points(body.origin, body.cells)
    R = np.hypot(X[..., 0], X[..., 1])
    place = X * (neo_hookean.cylinder_radius(R, *given) / R)[..., None]
    push = neo_hookean.cylinder_pressure(R.ravel(), *given).reshape(R.shape)
    ours = found.pressure[body.cells[:, :3]] @ elements.LINEAR.T
    start, end = (np.hypot(*places[rim].T) for places in (body.origin, found.position))
    return {"size": 1 / np.sqrt(len(body.cells)),
            "outline": np.abs(end / neo_hookean.cylinder_radius(start, *given) - 1).max(),
            "position": _mean_square(at, _in_points(found.position, body.cells) - place) / _mean_square(at, place),
            "pressure": _mean_square(at, ours - push) / _mean_square(at, push)}


@case("growth-curved-half-cylinder", kind="exact", slow=True,
      norm="largest relative error of the outline's radius; L2 of positions and of the pressure over the body at t = 0",
      claim="A curved half-disc that grows by theta(R) becomes the exact half-disc: places to third order, the "
            "pressure to second, and as well at theta = 2000 as at 36",
      mutants=("curved-grad-div-dropped",))
def half_cylinder() -> Outcome:
    errors = refine(_cylinder_errors, REFINEMENTS, 36.0)
    studies = [study(f"{name}, theta to 36", errors["size"], errors[name], order, why, ceiling=ceiling, band=band)
               for name, order, why, ceiling, band in (
                   ("position", 3, "quadratic places: third order in L2", 1e-5, 0.4),
                   ("pressure", 2, "linear pressure: second order in L2", 2e-3, 0.3))]
    far = _cylinder_errors(REFINEMENTS[-2], 2000.0)
    checks = [at_most(f"{name}, theta to 2000", far[name], 1.05 * errors[name][-2],
                      "as at theta = 36: what is left of the error is in the shape of theta(R), not in its size")
              for name in ("outline", "position", "pressure")]
    checks.append(at_most("outline, theta to 36", errors["outline"][-1], 1e-5, "under that of positions in L2"))
    return Outcome(tuple(checks), tuple(studies), (_pressure_profile(36.0),))


def _pressure_profile(top: float) -> Profile:
    body, _, found = _cylinder(REFINEMENTS[1], top)
    R, line = np.hypot(*body.origin[:body.corners].T), np.linspace(0.01, RADIUS, 100)
    order = np.argsort(R)
    exact = neo_hookean.cylinder_pressure(line, *_coefficients(top), RADIUS)
    return Profile(f"theta to {top:g}", "R (um)", "P / mu_L",
                   (("corners", "points", R[order], found.pressure[order]), ("closed form", "exact", line, exact)))


@cache
def _rectangle():
    """(mesh, nodes on the left, right and lower side) of 10 x 7 um of biomass, its inner edges bent at random."""
    straight = meshes.channel((0.0, 10.0), 7.0, 1.6, lambda x, y: x > -1, seed=4)
    grid = curved(straight, None)
    points, random = grid.points.copy(), np.random.default_rng(5)
    on = np.column_stack([points[:, 0] == 0, points[:, 0] == 10, points[:, 1] == 0, points[:, 1] == 7])
    inner = np.flatnonzero((np.arange(len(points)) >= grid.corners) & ~on.any(axis=1))
    points[inner] += random.uniform(-0.12, 0.12, (len(inner), 2))
    return grid.moved(points), *on.T[:3]


def _body(origin, reference, held):
    grid = _rectangle()[0]
    return growth.Body(origin, reference, grid.cells, grid.corners, held)


@case("growth-curved-homogeneous", kind="exact",
      norm="largest difference in position over the length, and in pressure over its size",
      claim="Free and confined uniform growth to theta = 36 are exact on curved triangles too, also where the mesh was "
            "made half way: theta since t = 0 is J of that shape times the expansion since",
      mutants=("curved-expansion-forgotten", "curved-theta-power"))
def homogeneous() -> Outcome:
    grid, left, right, bottom = _rectangle()
    free, confined = np.column_stack([left, bottom]), np.column_stack([left | right, bottom])
    checks = []
    for top, made_at in ((2.0, 1.0), (36.0, 1.0), (36.0, 5.0)):
        P = -(top ** (-5 / 3)) * (top**2 - (2 + top**2) / 3)
        for name, held, power, push in (("free", free, (0.5, 0.5), neo_hookean.free_growth_pressure(top)),
                                        ("confined", confined, (0.0, 1.0), P)):
            start = grid.points * made_at ** np.array(power)
            body = _body(grid.points, start, held)
            found = growth.equilibrium(body, np.full(len(start), top / made_at), start, np.zeros(body.corners), start)
            exact, told = grid.points * top ** np.array(power), f"{name}, theta = {top:g}, mesh made at {made_at:g}"
            checks += [at_most(f"position, {told}", np.abs(found.position - exact).max() / 10, 1e-9, ROUND_OFF),
                       at_most(f"pressure, {told}", np.abs(found.pressure / push - 1).max(), 1e-8, ROUND_OFF)]
    return Outcome(tuple(checks))


@case("growth-curved-taylor", kind="property", norm="remainder of a first-order Taylor expansion; largest difference "
      "over the largest force",
      claim="The element tangent on curved triangles is the derivative of the residual, is symmetric, and the residual "
            "turns with the body",
      mutants=("curved-tangent-without-grad-div", "curved-constraint-sign", "curved-stress-transposed"))
def taylor() -> Outcome:
    grid = _rectangle()[0]
    body = _body(grid.points, grid.points, np.zeros((len(grid.points), 2), bool))
    system, random = growth.System(body), np.random.default_rng(6)
    theta = np.full(body.places.dx.shape, 1.4)
    here = grid.points @ np.array([[1.2, 0.1], [0.2, 1.1]])
    push, move = random.standard_normal(body.corners), 0.05 * random.standard_normal(here.shape)
    more, steps = random.standard_normal(body.corners), 0.25 * 0.5 ** np.arange(4)
    tangents = system.tangent(here, push, theta)
    direction = np.concatenate([move[:, 0], move[:, 1], more])
    linear = system.sparse.product(tangents, direction)
    start = system.residual(here, push, theta)[0]
    left = [np.abs(system.residual(here + s * move, push + s * more, theta)[0] - start - s * linear).max()
            for s in steps]
    Q = np.array([[0.6, -0.8], [0.8, 0.6]])
    turned, n = system.residual(here @ Q.T, push, theta)[0], 2 * len(here)
    apart = np.abs(turned[:n].reshape(2, -1) - Q @ start[:n].reshape(2, -1)).max() / np.abs(start[:n]).max()
    skew = np.abs(tangents - np.swapaxes(tangents, 1, 2)).max() / np.abs(tangents).max()
    return Outcome((at_most("objectivity", apart, 1e-12, "round-off"), at_most("symmetry", skew, 1e-13, "round-off"),
                    at_most("J, turned", np.abs(turned[n:] - start[n:]).max(), 1e-11, "round-off")),
                   (study("residual", steps, left, 2, "Taylor's theorem: second order", band=0.25),))
