"""What holds for any body: what a motion or another unit must not change, and what growth must keep."""

from __future__ import annotations

import numpy as np

from repro.fem.mesh import triangle_areas
from repro.model import growth
from verification.case import Outcome, at_most, case
from verification.growth import bodies

ROUND_OFF = "round-off; Newton's method stops at 1e-11"


def _uneven(body: growth.Body) -> np.ndarray:
    """(t,) theta from 1.2 to 4, uneven along x and y."""
    x, y = bodies.middles(body).T / bodies.RADIUS
    return 2.6 + 0.9 * x + 0.5 * np.sin(3 * y)


@case("growth-rigid", kind="property", norm="largest sum, over the largest nodal force; largest difference, over the "
      "same",
      claim="The nodal forces of any state of a body have no resultant and no moment, and turn with the body by any "
            "angle, while what they ask of the volume stays (objectivity)",
      mutants=("untransposed",))
def rigid() -> Outcome:
    body, _ = bodies.half_disc(1.0)
    random, x = np.random.default_rng(11), body.reference
    place = 6 * x @ np.array([[1.1, -0.3], [0.6, 0.9]]) + 0.3 * random.standard_normal(x.shape)
    pressure, theta = random.standard_normal(len(x)), _uneven(body)
    forces, volume = _forces(body, place, pressure, theta)
    most = np.abs(forces).max()
    moment = np.sum(place[:, 0] * forces[:, 1] - place[:, 1] * forces[:, 0]) / np.abs(place).max()
    checks = [at_most("resultant", np.abs(forces.sum(axis=0)).max() / most, 1e-11, ROUND_OFF),
              at_most("moment over the largest distance", abs(moment) / most, 1e-11, ROUND_OFF)]
    for angle in (0.4, 1.9, 4.0):
        Q = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
        turned, same = _forces(body, place @ Q.T + [70.0, -30.0], pressure, theta)
        checks += [at_most(f"forces, {angle:g} rad", np.abs(turned - forces @ Q.T).max() / most, 1e-10, ROUND_OFF),
                   at_most(f"volume, {angle:g} rad", np.abs(same - volume).max() / np.abs(volume).max(), 1e-10,
                           ROUND_OFF)]
    return Outcome(tuple(checks))


def _forces(body, place, pressure, theta):
    """Nodal forces (n, 2), and the residual of J = theta (n,)."""
    system = growth.System(body, growth.stabilisation(place, body.triangles, theta))
    x, y, volume = np.split(system.residual(place, pressure, theta)[0], 3)
    return np.column_stack([x, y]), volume


@case("growth-area", kind="property", norm="relative difference of the area",
      claim="However unevenly a body grows, it gets the area that was asked for, the integral of theta, to round-off: "
            "the sum of the rows J = theta, in which the stabilisation cancels (24)",
      mutants=("theta-power", "stabilisation-diagonal"))
def area() -> Outcome:
    checks = []
    for refinement, factor in ((0.6, 1.0), (1.0, 15.0), (1.5, 500.0)):
        body, _ = bodies.half_disc(refinement)
        random = np.random.default_rng(12).uniform(0.7, 1.4, len(body.triangles))
        theta = factor * random * _uneven(body)
        found = bodies.grown(body, theta)
        asked = triangle_areas(body.reference, body.triangles) @ theta
        got = triangle_areas(found.position, body.triangles).sum()
        checks.append(at_most(f"area, theta to {theta.max():.0f}", abs(got / asked - 1), 1e-11, ROUND_OFF))
    return Outcome(tuple(checks))


@case("growth-units", kind="property", norm="largest difference: of places, carried back, over the radius; of "
      "pressures over the largest",
      claim="In metres for micrometres, on a wall that stands upright, or in a mirror, a body grows to the same shape "
            "with the same pressure over mu_L",
      mutants=("h-not-squared",))
def units() -> Outcome:
    changes = {"in metres": 1e-6 * np.eye(2), "upright": np.array([[0.0, -1.0], [1.0, 0.0]]),
               "mirrored": np.diag([-1.0, 1.0])}
    ours, checks = _changed(np.eye(2)), []
    for name, change in changes.items():
        found = _changed(change)
        back = found.position @ np.linalg.inv(change).T - ours.position
        gap = np.abs(found.pressure - ours.pressure).max() / np.abs(ours.pressure).max()
        checks += [at_most(f"place, {name}", np.abs(back).max() / bodies.RADIUS, 1e-9, ROUND_OFF),
                   at_most(f"pressure, {name}", gap, 1e-8, ROUND_OFF)]
    return Outcome(tuple(checks))


def _changed(change: np.ndarray) -> growth.Equilibrium:
    """Uneven growth of a half-disc whose places, supports and order of corners are changed by a matrix (2, 2)."""
    body, _ = bodies.half_disc(1.0)
    triangles = body.triangles if np.linalg.det(change) > 0 else body.triangles[:, ::-1]
    held = np.abs(body.held @ change.T) > 0
    return bodies.grown(growth.Body(body.reference @ change.T, triangles, held), _uneven(body))
