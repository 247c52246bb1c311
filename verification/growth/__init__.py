"""Growth mechanics (2.3, 3.4) against closed forms: homogeneous growth, and the half-cylinder that grows unevenly."""

from __future__ import annotations

from functools import cache

import numpy as np

from reference import neo_hookean
from repro import geometry, growth, mesh
from verification import meshes, norms
from verification.case import Outcome, Profile, at_most, case
from verification.convergence import refine, study

RADIUS, REFINEMENTS = 20.0, (0.6, 1.0, 1.6, 2.5)
ROUND_OFF, SECOND = "round-off", "linear elements: second order"
#: theta is raised by this factor at a time.
FACTOR = 1.5


def _admissible(count: int = 200):
    """Random F with det F from 0.5 to 2000 and moderate shear, and random pressures."""
    random = np.random.default_rng(1)
    F = np.eye(2) + 0.3 * random.standard_normal((count, 2, 2))
    F[np.linalg.det(F) < 0.2] = np.eye(2)
    scale = np.sqrt(10 ** random.uniform(-0.3, 3.3, count) / np.linalg.det(F))
    return scale[:, None, None] * F, random.standard_normal(count)


@case("growth-stress", kind="exact", norm="largest difference over the largest stress, 200 random F to J = 2000",
      claim="The Cauchy stress of any homogeneous F and P is the closed form, it turns with the body (objectivity), "
            "and it is symmetric",
      mutants=("third-power",))
def stress() -> Outcome:
    F, P = _admissible()
    exact = np.array([neo_hookean.cauchy(f, p) for f, p in zip(F, P)])
    xx, yy, zz, xy = growth.cauchy(F, P).T
    ours = np.moveaxis(np.array([[xx, xy, 0 * xx], [xy, yy, 0 * xx], [0 * xx, 0 * xx, zz]]), -1, 0)
    full = np.einsum("nik,njk->nij", growth.piola(F, P), F) / np.linalg.det(F)[:, None, None]
    angle = np.linspace(0, 6, len(F))
    Q = np.moveaxis(np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]), -1, 0)
    size, first = np.abs(exact).max(axis=(1, 2)), np.abs(growth.piola(F, P)).max(axis=(1, 2))
    turned = growth.piola(Q @ F, P) - Q @ growth.piola(F, P)
    return Outcome((at_most("stress", np.max(np.abs(ours - exact).max(axis=(1, 2)) / size), 1e-11, ROUND_OFF),
                    at_most("symmetry", np.max(np.abs(full[:, 0, 1] - full[:, 1, 0]) / size), 1e-11, ROUND_OFF),
                    at_most("objectivity", np.max(np.abs(turned).max(axis=(1, 2)) / first), 1e-11, ROUND_OFF)))


@case("growth-taylor", kind="property", norm="remainder of a first-order Taylor expansion over the size of the step",
      claim="Stress is the derivative of the energy, the tangent that of the stress, and the element tangent that of "
            "the residual",
      mutants=("tangent-coefficient",))
def taylor() -> Outcome:
    steps = 0.1 * 0.5 ** np.arange(4)
    F, P = _admissible(20)
    F = F / np.sqrt(np.linalg.det(F))[:, None, None]
    G = np.random.default_rng(2).standard_normal(F.shape) * 0.2

    def potential(A):
        return growth.energy(A) + P * (np.linalg.det(A) - 1.3)

    slope = np.sum(growth.piola(F, P) * G, axis=(1, 2))
    energy = [np.abs(potential(F + s * G) - potential(F) - s * slope).max() for s in steps]
    linear = np.einsum("nikjl,njl->nik", growth.tangent(F, P), G)
    forces = [np.abs(growth.piola(F + s * G, P) - growth.piola(F, P) - s * linear).max() for s in steps]
    why = "Taylor's theorem: second order"
    return Outcome(studies=(study("energy", steps, energy, 2, why, band=0.25),
                            study("stress", steps, forces, 2, why, band=0.25),
                            study("residual", steps, _residual_remainders(steps), 2, why, band=0.25)))


def _residual_remainders(steps):
    """Of the discrete residual of a sheared half-disc in a random direction."""
    body, _ = _half_disc(0.6)
    theta, random = np.full(len(body.triangles), 1.2), np.random.default_rng(3)
    position = body.reference @ np.array([[1.1, 0.1], [0.2, 1.2]])
    pressure = random.standard_normal(len(position))
    system = growth.System(body, growth.stabilisation(position, body.triangles, theta))
    move, push = 0.3 * random.standard_normal(position.shape), random.standard_normal(len(position))
    slopes = system.tangent(position, pressure)
    direction = np.concatenate([move[:, 0], move[:, 1], push])
    linear = np.bincount(system.unknowns.ravel(), np.einsum("tij,tj->ti", slopes, direction[system.unknowns]).ravel(),
                         len(direction))
    start = system.residual(position, pressure, theta)[0]
    moved = [system.residual(position + s * move, pressure + s * push, theta)[0] for s in steps]
    return [np.abs(there - start - s * linear).max() for s, there in zip(steps, moved)]


@case("growth-homogeneous", kind="exact",
      norm="largest difference in position over the length, and in pressure over its size",
      claim="Free and confined uniform growth to theta = 36 are reproduced exactly on any mesh: linear elements hold "
            "them",
      mutants=("theta-power",))
def homogeneous() -> Outcome:
    points, triangles = meshes.rectangle((0.0, 10.0), 7.0, 1.3, seed=4)
    left, right, bottom = points[:, 0] == 0, points[:, 0] == 10, points[:, 1] == 0
    free = np.column_stack([left, bottom])
    confined = np.column_stack([left | right, bottom])
    checks = []
    for top in (2.0, 36.0):
        confined_pressure = -(top ** (-5 / 3)) * (top**2 - (2 + top**2) / 3)
        for name, held, stretch, pressure in (
                ("free", free, np.sqrt([top, top]), neo_hookean.free_growth_pressure(top)),
                ("confined", confined, np.array([1.0, top]), confined_pressure)):
            body = growth.Body(points, triangles, held)
            found = _grown(body, np.full(len(triangles), top))
            checks += [at_most(f"position, {name}, theta = {top:g}",
                               np.abs(found.position / stretch - points).max() / 10, 1e-9, ROUND_OFF),
                       at_most(f"pressure, {name}, theta = {top:g}", np.abs(found.pressure / pressure - 1).max(),
                               1e-8, ROUND_OFF)]
    return Outcome(tuple(checks))


def _grown(body, theta):
    """Equilibrium under theta (t,), raised by FACTOR at a time."""
    position, pressure = body.reference, np.zeros(len(body.reference))
    parts = int(np.ceil(np.log(theta.max()) / np.log(FACTOR)))
    for part in np.arange(1, parts + 1) / parts:
        found = growth.equilibrium(body, theta**part, position, pressure, body.reference)
        position, pressure = found.position, found.pressure
    return found


@cache
def _half_disc(refinement: float):
    """(Body, rim (M,)) of a half-disc on a wall on which it slides, its middle fixed."""
    outline = geometry.seed(RADIUS, refinement)
    grid, outline = mesh.generate(outline, (-60.0, 60.0), 50.0, refinement, 2.0)
    rim = grid.body_loop
    held = np.zeros((len(grid.body), 2), bool)
    held[rim[outline.fixed], 0] = True
    held[rim[outline.wall != geometry.FREE], 1] = True
    return growth.Body(grid.points[grid.body], grid.body_triangles, held), rim[outline.wall == geometry.FREE]


def _coefficients(top: float) -> tuple[float, float]:
    """theta = a + c (R / R_0)^2: a third of ``top`` in the middle, ``top`` on the rim."""
    return top / 3, 2 * top / 3


@cache
def _cylinder(refinement: float, top: float):
    body, rim = _half_disc(refinement)
    inner, more = _coefficients(top)
    middle = body.reference[body.triangles].mean(axis=1)
    return body, rim, _grown(body, inner + more * np.sum(middle**2, axis=1) / RADIUS**2)


def _cylinder_errors(refinement: float, top: float) -> dict[str, float]:
    body, rim, found = _cylinder(refinement, top)
    given = (*_coefficients(top), RADIUS)
    start, end = (np.hypot(*places[rim].T) for places in (body.reference, found.position))

    def exact_pressure(x, y):
        return neo_hookean.cylinder_pressure(np.hypot(x, y).ravel(), *given).reshape(x.shape)

    def exact_position(x, y):
        R = np.hypot(x, y)
        return np.stack([x, y], axis=-1) * (neo_hookean.cylinder_radius(R, *given) / R)[..., None]

    t = body.triangles
    return {"size": 1 / np.sqrt(len(t)), "outline": np.abs(end / neo_hookean.cylinder_radius(start, *given) - 1).max(),
            "position": norms.l2_error(body.reference, t, found.position, exact_position),
            "pressure": norms.l2_error(body.reference, t, found.pressure, exact_pressure)}


@case("growth-half-cylinder", kind="exact",
      norm="largest relative error of the outline's radius; L2 of positions and of the "
      "pressure over the body at t = 0, relative",
      claim="A half-disc that grows by theta(R) becomes the exact half-disc, with the exact pressure, to theta = 36 "
            "and 2000",
      mutants=("stabilisation-power", "stabilisation-too-weak"))
def half_cylinder() -> Outcome:
    studies, profiles = [], []
    for top in (36.0, 2000.0):
        errors = refine(_cylinder_errors, REFINEMENTS, top)
        for name, order, ceiling in (("outline", 2, 2e-3), ("position", 2, 2e-3), ("pressure", 1.5, 5e-2)):
            why = SECOND if order == 2 else "stabilised linear pressure: between first and second order"
            studies.append(study(f"{name}, theta to {top:g}", errors["size"], errors[name], order, why,
                                 ceiling=ceiling))
        profiles.append(_pressure_profile(top))
    return Outcome(studies=tuple(studies), profiles=tuple(profiles))


def _pressure_profile(top: float) -> Profile:
    body, _, found = _cylinder(REFINEMENTS[1], top)
    R, line = np.hypot(*body.reference.T), np.linspace(0.01, RADIUS, 100)
    order = np.argsort(R)
    exact = neo_hookean.cylinder_pressure(line, *_coefficients(top), RADIUS)
    return Profile(f"theta to {top:g}", "R (um)", "P / mu_L",
                   (("nodes", "points", R[order], found.pressure[order]), ("closed form", "exact", line, exact)))
