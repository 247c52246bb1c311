"""Growth with another energy than the paper's: Gent's, which stiffens towards a limit of the strain."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import brentq

from reference import gent, neo_hookean
from repro.errors import GrowthError
from repro.model import growth
from repro.model.energies import Gent
from repro.model.solid import Strained
from verification.cases.growth import COMPONENTS, NORM, REFINEMENTS, REPRODUCED, SECOND, central_differences
from verification.evidence.cases import parametrize
from verification.evidence.checks import around, at_least, at_most, each_at_most, largest, refine, studies
from verification.problems import bodies

#: J_m. Growth by theta = 36 alone has I - 3 = 3.7; the half-cylinder below comes to 4.2.
LIMIT = 8.0
#: Error of the pressure on the finest straight triangles, from the layer at the rim in which the stabilisation imposes
#: dP/dn = 0. It is proportional to the slope of P there over the norm of P, which is 2.08 times that of the neo-Hookean
#: body, whose bound is 3e-3. The first bound, without this factor, was 4e-3; 4.1e-3 was seen.
LAYER = 6.2e-3
#: [[a, b], [0, d]] by a, b, d: sheared, squeezed, and grown to 36 times the area. I - 3 comes to 3.1, 2.4 and 4.5.
SHEARS = ((1.0, 1.8, 1.1), (0.7, 0.4, 2.5), (5.0, 2.0, 7.2))


def stiffened(body: bodies.Supported) -> bodies.Supported:
    """The same body with Gent's energy."""
    return replace(body, energy=Gent(LIMIT))


@pytest.mark.case(
    "growth-gent-patch", kind="exact", references=("gent",), mutants=("gent-limit-of-the-trace",), norm=NORM)
@parametrize("kind", bodies.EVERY)
def test_gent_patch(kind, record):
    """With Gent's energy, a body of straight or curved triangles has F inside, with constant and exact pressure and
    stress, if the positions of its rim are prescribed as F X and one end is free along its normal.
    """
    grid, side = bodies.rectangle({1: 1.3, 2: 2.0}[kind], 5, kind)
    rim = side["left"] | side["right"] | side["bottom"]
    body = stiffened(bodies.on_mesh(grid, rim | side["top"], rim))
    for a, b, d in SHEARS:
        def F(part, a=a, b=b, d=d):
            return np.array([[a**part, part * b], [0.0, d**part]])

        solution = bodies.grow(body, body.constant(a * d), lambda part, F=F: body.reference @ F(part).T)
        pressure = -gent.cauchy(F(1.0), 0.0, LIMIT)[1, 1]
        expected = gent.cauchy(F(1.0), pressure, LIMIT)
        P = solution.pressure[body.cells[:, :3]] @ body.shape.table.linear.T
        stress = growth.cauchy(body.strained(solution.position), P)
        record(each_at_most({
            "place": largest(solution.position @ np.linalg.inv(F(1.0)).T - body.reference) / bodies.LENGTH,
            "pressure": largest(solution.pressure - pressure) / largest(expected),
            "stress": largest(stress - expected[COMPONENTS]) / largest(expected)}, 1e-9, REPRODUCED,
            f", a, b, d = {a:g}, {b:g}, {d:g}"))


@pytest.mark.slow
@pytest.mark.case(
    "growth-gent-half-cylinder", kind="exact", references=("gent",), mutants=("gent-limit-of-the-trace",),
    norm="L2 of positions and of the pressure over the body at t = 0, relative")
@parametrize("kind", bodies.EVERY)
def test_gent_half_cylinder(kind, record):
    """A half-disc with Gent's energy that grows by theta(R), 36 on the rim and 12 in the middle, becomes the exact
    half-disc, with the exact pressure. That of the neo-Hookean body differs from it by more than a tenth in L2.
    """
    reference = bodies.HalfCylinder(12.0, 36.0)

    def pressure(x, y):
        R = np.maximum(np.hypot(x, y), 1e-6 * bodies.RADIUS)
        return gent.cylinder_pressure(R.ravel(), 12.0, 24.0, bodies.RADIUS, LIMIT).reshape(np.shape(R))

    def errors(refinement):
        body = stiffened(bodies.half_disc(refinement, kind)[0])
        solution = bodies.grow(body, body.field(reference.theta))
        return bodies.errors(body, solution, lambda x, y: (reference.place(x, y), pressure(x, y)))

    orders = {1: {"place": (2, SECOND, 2e-4), "pressure": (1.5, "3/2 from the layer at the rim", LAYER)},
              2: {"place": (around(3, 0.4), "quadratic places: third order in L2", 1e-5),
                  "pressure": (2, "linear pressure: second order in L2", 2e-3)}}
    record(studies(refine(errors, REFINEMENTS[kind]), orders[kind]))
    R = np.linspace(0.01, 1.0, 100) * bodies.RADIUS
    plain = neo_hookean.cylinder_pressure(R, 12.0, 24.0, bodies.RADIUS)
    change = gent.cylinder_pressure(R, 12.0, 24.0, bodies.RADIUS, LIMIT) - plain
    difference = np.sqrt(np.sum(R * change**2) / np.sum(R * plain**2))
    record(at_least("difference from the neo-Hookean pressure", difference, 0.1, "the energy matters here"))


@pytest.mark.case(
    "growth-gent-differences", kind="property", mutants=("gent-without-curvature", "gent-curvature-halved"),
    references=("gent",))
@parametrize("kind", bodies.EVERY)
def test_gent_differences(kind, record):
    """With Gent's energy, the stress is the derivative of the energy and the tangent that of the residual, by finite
    differences.

    Norm: largest difference to central differences, by the step.
    """
    random = np.random.default_rng(4)
    F = np.eye(2) + 0.3 * random.uniform(-1, 1, (20, 2, 2))
    P, G = random.standard_normal(20), 0.1 * random.standard_normal(F.shape)

    def energy(s):
        return gent.energy(F + s * G, LIMIT) + P * (np.linalg.det(F + s * G) - 1.3)

    slope = np.sum(Strained(F, Gent(LIMIT)).piola(P) * G, axis=(1, 2))
    record(central_differences("stress", slope, energy))
    body = stiffened(bodies.half_disc(0.6 if kind == 1 else 0.3, kind)[0])
    position = body.reference @ np.array([[1.1, 0.1], [0.2, 1.2]])
    pressure, theta = random.standard_normal(body.corners), random.uniform(1.1, 1.4, body.at.dx.shape)
    move, push = 0.3 * random.standard_normal(position.shape), random.standard_normal(body.corners)
    system = bodies.system(body, position, pressure, theta)
    linear = system.sparse.product(system.tangent(position, pressure), np.concatenate([*move.T, push]))

    def residual(s):
        return system.residual(position + s * move, pressure + s * push)

    record(central_differences("tangent", linear, residual))


@pytest.mark.case("growth-gent-limit", kind="property", mutants=("gent-without-limit",), runs_with="2",
                  omitted="order 1: the energy refuses before any element is asked")
def test_gent_limit(record):
    """A body with Gent's energy refuses growth beyond its limit, with an error that names the key, and accepts growth
    just below it.

    Norm: refusals.
    """
    grid, side = bodies.rectangle(2.0, 4, 2)
    body = replace(bodies.on_mesh(grid, side["left"], side["bottom"]), energy=Gent(3.0))
    limit = brentq(lambda theta: theta ** (-2 / 3) * (2 * theta + 1) - 6, 1.0, 100.0)
    accepted = bodies.grow(body, body.constant(0.9 * limit))
    with pytest.raises(GrowthError) as refused:
        bodies.grow(body, body.constant(1.1 * limit))
    grown = (body.at.dx * body.strained(accepted.position).J).sum() / body.at.dx.sum()
    record(at_most("area below the limit, less one", abs(grown / (0.9 * limit) - 1), 1e-9, REPRODUCED))
    names_key = "growth.limiting_invariant is 3" in str(refused.value)
    record(at_least("refusals that name the key", int(names_key), 1, "one clear error"))
