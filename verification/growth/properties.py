"""What holds for any body: what a motion or another unit must not change, and what growth must keep."""

from __future__ import annotations

import numpy as np

from repro.fem import elements
from repro.model import growth
from verification.case import Check, Outcome, at_most, case
from verification.growth import bodies
from verification.growth.bodies import Supported

ROUND_OFF = "round-off; Newton's method stops at 1e-11"


def _uneven(body: Supported) -> np.ndarray:
    """(t, q) theta from 1.2 to 4, uneven along x and y."""
    return body.field(_theta)


def _theta(x, y):
    return 2.6 + 0.9 * x / bodies.RADIUS + 0.5 * np.sin(3 * y / bodies.RADIUS)


@case("growth-rigid", kind="property", norm="largest sum, over the largest nodal force; largest difference, over the "
      "same",
      claim="The nodal forces of any state of a body have no resultant and no moment, and turn with the body by any "
            "angle, while what they ask of the volume stays (objectivity)",
      mutants=("untransposed",))
def rigid() -> Outcome:
    return Outcome((*_rigid(1), *_rigid(2)))


def _rigid(kind: int) -> list[Check]:
    (body, _), told = bodies.half_disc(1.0 if kind == 1 else 0.5, kind), bodies.WORDS[kind]
    random, x = np.random.default_rng(11), body.reference
    place = 6 * x @ np.array([[1.1, -0.3], [0.6, 0.9]]) + 0.3 * random.standard_normal(x.shape)
    pressure, theta = random.standard_normal(body.corners), _uneven(body)
    forces, volume = _forces(body, place, pressure, theta)
    most = np.abs(forces).max()
    moment = np.sum(place[:, 0] * forces[:, 1] - place[:, 1] * forces[:, 0]) / np.abs(place).max()
    checks = [at_most(f"resultant, {told}", np.abs(forces.sum(axis=0)).max() / most, 1e-11, ROUND_OFF),
              at_most(f"moment over the largest distance, {told}", abs(moment) / most, 1e-11, ROUND_OFF)]
    for angle in (0.4, 1.9, 4.0):
        Q = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
        turned, same = _forces(body, place @ Q.T + [70.0, -30.0], pressure, theta)
        changed = np.abs(same - volume).max() / np.abs(volume).max()
        checks += [at_most(f"forces, {angle:g} rad, {told}", np.abs(turned - forces @ Q.T).max() / most, 1e-10,
                           ROUND_OFF),
                   at_most(f"volume, {angle:g} rad, {told}", changed, 1e-10, ROUND_OFF)]
    return checks


def _forces(body: Supported, place, pressure, theta):
    """Nodal forces (n, 2), and the residual of J = theta (corners,)."""
    system = bodies.system(body, place, theta)
    system.under(theta, place, place, pressure)
    x, y, volume = np.split(system.residual(place, pressure), [len(place), 2 * len(place)])
    return np.column_stack([x, y]), volume


#: Refinements of each kind, and factors of theta.
GROWN = {1: ((0.6, 1.0), (1.0, 15.0), (1.5, 500.0)), 2: ((0.3, 1.0), (0.6, 15.0)), 3: ((0.4, 5.0),)}


@case("growth-area", kind="property", norm="relative difference of the area",
      claim="However unevenly a body grows, it gets the area that was asked for, the integral of theta, to round-off: "
            "the sum of the rows J = theta, in which the stabilisation cancels (24)",
      mutants=("theta-power", "stabilisation-diagonal"))
def area() -> Outcome:
    checks = []
    for kind, rows in GROWN.items():
        for refinement, factor in rows:
            body, _ = bodies.half_disc(refinement, kind)
            random = np.random.default_rng(12).uniform(0.7, 1.4, (len(body.cells), 1))
            theta = factor * (random if kind == 1 else 1.0) * _uneven(body)
            found = bodies.grown(body, theta)
            asked, got = float(np.vdot(body.body.at.dx, theta)), _area(body, found.position)
            checks.append(at_most(f"area, theta to {theta.max():.0f}, {bodies.WORDS[kind]}", abs(got / asked - 1),
                                  1e-11, ROUND_OFF))
    return Outcome(tuple(checks))


def _area(body: Supported, position: np.ndarray) -> float:
    """Of the present shape, um2."""
    of = elements.table(body.geometry, body.geometry, bodies.DEGREE)
    return float(elements.weights(position[body.cells], of).sum())


@case("growth-units", kind="property", norm="largest difference: of places, carried back, over the radius; of "
      "pressures over the largest",
      claim="In metres for micrometres, on a wall that stands upright, or in a mirror, a body grows to the same shape "
            "with the same pressure over mu_L",
      mutants=("h-not-squared",))
def units() -> Outcome:
    return Outcome((*_units(1), *_units(2)))


def _units(kind: int) -> list[Check]:
    changes = {"in metres": 1e-6 * np.eye(2), "upright": np.array([[0.0, -1.0], [1.0, 0.0]]),
               "mirrored": np.diag([-1.0, 1.0])}
    ours, checks, told = _changed(np.eye(2), kind), [], bodies.WORDS[kind]
    for name, change in changes.items():
        found = _changed(change, kind)
        back = found.position @ np.linalg.inv(change).T - ours.position
        gap = np.abs(found.pressure - ours.pressure).max() / np.abs(ours.pressure).max()
        checks += [at_most(f"place, {name}, {told}", np.abs(back).max() / bodies.RADIUS, 1e-9, ROUND_OFF),
                   at_most(f"pressure, {name}, {told}", gap, 1e-8, ROUND_OFF)]
    return checks


#: Corners and middles of a triangle in the order of its mirror image.
MIRRORED = [2, 1, 0, 4, 3, 5]


def _changed(change: np.ndarray, kind: int) -> growth.Equilibrium:
    """Uneven growth of a half-disc whose places, supports and order of corners are changed by a matrix (2, 2)."""
    body, _ = bodies.half_disc(1.0 if kind == 1 else 0.4, kind)
    cells = body.cells
    if np.linalg.det(change) < 0:
        cells = cells[:, MIRRORED[: cells.shape[1]]]
    shape = growth.Shape(cells, body.corners, body.body.shape.degree)
    other = Supported(growth.Body(shape, body.reference @ change.T), np.abs(body.held @ change.T) > 0)
    back = np.linalg.inv(change).T
    theta = other.field(lambda x, y: _theta(*np.moveaxis(np.stack([x, y], axis=-1) @ back, -1, 0)))
    return bodies.grown(other, theta)
