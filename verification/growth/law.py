"""The law itself (14)-(24): stress against its closed form, derivatives against differences, the stabilisation (27).

What holds for any body: what a motion or another unit must not change, and what growth must keep.
"""

from __future__ import annotations

import numpy as np

from reference import neo_hookean
from repro.fem import elements
from repro.model import growth
from verification.kernel.case import Outcome, at_most, case, study
from verification.problems import bodies
from verification.problems.bodies import Supported

ROUND_OFF, STEPS = "round-off", 0.1 * 0.5 ** np.arange(4)
TAYLOR, CENTRAL = "Taylor's theorem: second order", "central differences: second order"


def admissible(count: int = 200) -> tuple[np.ndarray, np.ndarray]:
    """Random F (count, 2, 2) with shears to 3 and det F from 0.5 to 2000, and random pressures."""
    random = np.random.default_rng(1)
    F = np.eye(2) + 0.3 * random.standard_normal((count, 2, 2))
    F[np.linalg.det(F) < 0.2] = np.eye(2)
    shear = np.tile(np.eye(2), (count, 1, 1))
    shear[:, 0, 1] = random.uniform(-3, 3, count)
    scale = np.sqrt(10 ** random.uniform(-0.3, 3.3, count) / np.linalg.det(F))
    return scale[:, None, None] * F @ shear, random.standard_normal(count)


def _turns(count: int) -> np.ndarray:
    """Rotations (count, 2, 2)."""
    c, s = np.cos(np.linspace(0, 6, count)), np.sin(np.linspace(0, 6, count))
    return np.moveaxis(np.array([[c, -s], [s, c]]), -1, 0)


@case("growth-stress", kind="exact", norm="largest difference over the largest stress, 200 random F with shears to 3 "
      "and J to 2000",
      claim="The Cauchy stress of any homogeneous F and P is the closed form; it turns with the body (objectivity), "
            "does not see a turn before the deformation (isotropy), and is symmetric",
      mutants=("third-power", "thickness-forgotten", "stress-across", "untransposed"), ways="1 2 3")
def stress() -> Outcome:
    F, P = admissible()
    exact = np.array([neo_hookean.cauchy(f, p) for f, p in zip(F, P)])
    xx, yy, zz, xy = growth.cauchy(F, P).T
    ours = np.moveaxis(np.array([[xx, xy, 0 * xx], [xy, yy, 0 * xx], [0 * xx, 0 * xx, zz]]), -1, 0)
    S, Q = growth.piola(F, P), _turns(len(F))
    full = S @ np.swapaxes(F, 1, 2) / np.linalg.det(F)[:, None, None]
    size, first = np.abs(exact).max(axis=(1, 2)), np.abs(S).max(axis=(1, 2))
    numbers = {"stress": np.abs(ours - exact).max(axis=(1, 2)) / size,
               "symmetry": np.abs(full[:, 0, 1] - full[:, 1, 0]) / size,
               "objectivity": np.abs(growth.piola(Q @ F, P) - Q @ S).max(axis=(1, 2)) / first,
               "isotropy": np.abs(growth.piola(F @ Q, P) - S @ Q).max(axis=(1, 2)) / first}
    return Outcome(tuple(at_most(name, value.max(), 1e-11, ROUND_OFF) for name, value in numbers.items()))


def _near_one():
    """Twenty F of det F = 1 with pressures, and directions to go from there."""
    F, P = admissible(20)
    F = F / np.sqrt(np.linalg.det(F))[:, None, None]
    return F, P, np.random.default_rng(2).standard_normal(F.shape) * 0.1


def _potential(F, P):
    return growth.energy(F) + P * (np.linalg.det(F) - 1.3)


def _law(which: str):
    """The energy's slope along a direction, or the stress's, and itself after a step."""
    F, P, G = _near_one()
    if which == "energy":
        return np.sum(growth.piola(F, P) * G, axis=(1, 2)), lambda s: _potential(F + s * G, P)
    return np.einsum("nikjl,njl->nik", bodies.moduli(F, P), G), lambda s: growth.piola(F + s * G, P)


#: What is differentiated: the laws, and the residual of a body of each kind.
SLOPES = {"energy": ("energy",), "stress": ("stress",), **{f"residual, {word}": kind for word, kind in
                                                           bodies.EVERY.items()}}


def _slope(of: str | int):
    return _law(of) if isinstance(of, str) else _body_slope(of)


@case("growth-differences", kind="property", norm="largest difference to central differences, by the step",
      claim="Stress is the derivative of the energy, the tangent that of the stress, and the element tangent that of "
            "the residual: by finite differences",
      mutants=("third-power", "element-tangent-coefficient", "one-corner-pressure"), over=SLOPES)
def differences(of: str | int):
    slope, value = _slope(of)
    errors = [np.abs((value(s) - value(-s)) / (2 * s) - slope).max() for s in STEPS]
    return study("difference", STEPS, errors, 2, CENTRAL)


@case("growth-taylor", kind="property", norm="remainder of a first-order Taylor expansion over the size of the step",
      claim="Stress is the derivative of the energy, the tangent that of the stress, and the element tangent that of "
            "the residual: by Taylor remainders",
      mutants=("element-tangent-coefficient", "one-corner-pressure"), over=SLOPES)
def taylor(of: str | int):
    slope, value = _slope(of)
    errors = [np.abs(value(s) - value(0.0) - s * slope).max() for s in STEPS]
    return study("remainder", STEPS, errors, 2, TAYLOR)


def _body_slope(kind: int):
    """The discrete residual of a sheared half-disc in a random direction: its slope, and itself after a step."""
    body, _ = bodies.half_disc(0.6 if kind == 1 else 0.3, kind)
    random = np.random.default_rng(3)
    position = body.reference @ np.array([[1.1, 0.1], [0.2, 1.2]])
    pressure = random.standard_normal(body.corners)
    theta = random.uniform(1.1, 1.4, body.body.at.dx.shape)
    system = bodies.system(body, position, theta)
    system.under(theta, position, position, pressure)
    move, push = 0.3 * random.standard_normal(position.shape), random.standard_normal(body.corners)
    direction = np.concatenate([move[:, 0], move[:, 1], push])
    linear = system.sparse.product(system.tangent(position, pressure), direction)
    return linear, lambda s: system.residual(position + s * move, pressure + s * push)


@case("growth-curved-taylor", kind="property", norm="remainder of a first-order Taylor expansion; largest difference "
      "over the largest force",
      claim="On straight triangles, and on curved ones with their inner edges bent, the element tangent is the "
            "derivative of the residual, is symmetric, and the residual turns with the body",
      mutants=("tangent-without-grad-div", "constraint-sign", "stress-transposed", "element-tangent-coefficient"),
      over=bodies.EVERY)
def curved_taylor(kind: int):
    """Checks and the study of one kind of triangles."""
    grid, side = bodies.rectangle(1.6, 4, kind)
    body = bodies.on_mesh(grid, kind, grid.points, np.column_stack([side["left"], side["bottom"]]))
    random, theta = np.random.default_rng(6), body.constant(1.4)
    here = grid.points @ np.array([[1.2, 0.1], [0.2, 1.1]])
    push, move = random.standard_normal(body.corners), 0.05 * random.standard_normal(here.shape)
    more, steps = random.standard_normal(body.corners), 0.25 * 0.5 ** np.arange(4)
    system = bodies.system(body, here, theta)
    system.under(theta, here, here, push)
    tangents, start = system.tangent(here, push), system.residual(here, push)
    linear = system.sparse.product(tangents, np.concatenate([move[:, 0], move[:, 1], more]))
    left = [np.abs(system.residual(here + s * move, push + s * more) - start - s * linear).max() for s in steps]
    Q = np.array([[0.6, -0.8], [0.8, 0.6]])
    turned, n = system.residual(here @ Q.T, push), 2 * len(here)
    apart = np.abs(turned[:n].reshape(2, -1) - Q @ start[:n].reshape(2, -1)).max() / np.abs(start[:n]).max()
    skew = np.abs(tangents - np.swapaxes(tangents, 1, 2)).max() / np.abs(tangents).max()
    return ([at_most("objectivity", apart, 1e-12, ROUND_OFF),
             at_most("symmetry", skew, 1e-13, ROUND_OFF),
             at_most("J, turned", np.abs(turned[n:] - start[n:]).max(), 1e-11, ROUND_OFF)],
            study("residual", steps, left, 2, TAYLOR, band=0.25))


@case("growth-stabilisation", kind="exact", norm="largest relative difference over the triangles of a random mesh",
      claim="On a pressure of constant gradient g the stabilisation of a triangle is |tau| h^2 theta^(2/3) / 12 |g|^2, "
            "h the diameter of the circle through its corners [E6]",
      mutants=("stabilisation-power", "stabilisation-too-weak", "circumradius"),
      ways="1", because="orders 2, 3: the pressure is not stabilised")
def stabilisation() -> Outcome:
    grid, _ = bodies.rectangle(1.3, 6)
    points, triangles = grid.points, grid.triangles
    theta, g = np.random.default_rng(7).uniform(1, 2000, len(triangles)), np.array([0.3, -0.7])
    a, b, c = (points[triangles[:, i]] for i in range(3))
    edges = np.stack([b - a, c - a], axis=1)
    centre = np.linalg.solve(2 * edges, np.sum(edges**2, axis=2)[..., None])[..., 0]
    exact = np.linalg.det(edges) / 2 * 4 * np.sum(centre**2, axis=1) * theta ** (2 / 3) / 12 * (g @ g)
    pressure = (points @ g)[triangles]
    found = np.einsum("ta,tab,tb->t", pressure, growth.gradient_stabilisation(points, triangles, theta), pressure)
    return Outcome((at_most("stabilisation", np.abs(found / exact - 1).max(), 1e-11, ROUND_OFF),))


KEPT_ROUND_OFF = "round-off; Newton's method stops at 1e-11"


def _uneven(body: Supported) -> np.ndarray:
    """(t, q) theta from 1.2 to 4, uneven along x and y."""
    return body.field(_theta)


def _theta(x, y):
    return 2.6 + 0.9 * x / bodies.RADIUS + 0.5 * np.sin(3 * y / bodies.RADIUS)


@case("growth-rigid", kind="property", norm="largest sum, over the largest nodal force; largest difference, over the "
      "same",
      claim="The nodal forces of any state of a body have no resultant and no moment, and turn with the body by any "
            "angle, while what they ask of the volume stays (objectivity)",
      mutants=("untransposed",), over=bodies.EVERY)
def rigid(kind: int):
    body, _ = bodies.half_disc(1.0 if kind == 1 else 0.5, kind)
    random, x = np.random.default_rng(11), body.reference
    place = 6 * x @ np.array([[1.1, -0.3], [0.6, 0.9]]) + 0.3 * random.standard_normal(x.shape)
    pressure, theta = random.standard_normal(body.corners), _uneven(body)
    forces, volume = _forces(body, place, pressure, theta)
    most = np.abs(forces).max()
    moment = np.sum(place[:, 0] * forces[:, 1] - place[:, 1] * forces[:, 0]) / np.abs(place).max()
    checks = [at_most("resultant", np.abs(forces.sum(axis=0)).max() / most, 1e-11, KEPT_ROUND_OFF),
              at_most("moment over the largest distance", abs(moment) / most, 1e-11, KEPT_ROUND_OFF)]
    for angle in (0.4, 1.9, 4.0):
        Q = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
        turned, same = _forces(body, place @ Q.T + [70.0, -30.0], pressure, theta)
        changed = np.abs(same - volume).max() / np.abs(volume).max()
        checks += [at_most(f"forces, {angle:g} rad", np.abs(turned - forces @ Q.T).max() / most, 1e-10,
                           KEPT_ROUND_OFF),
                   at_most(f"volume, {angle:g} rad", changed, 1e-10, KEPT_ROUND_OFF)]
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
      mutants=("theta-power", "stabilisation-diagonal"), over=bodies.EVERY)
def area(kind: int):
    for refinement, factor in GROWN[kind]:
        body, _ = bodies.half_disc(refinement, kind)
        random = np.random.default_rng(12).uniform(0.7, 1.4, (len(body.cells), 1))
        theta = factor * (random if kind == 1 else 1.0) * _uneven(body)
        found = bodies.grown(body, theta)
        asked, got = float(np.vdot(body.body.at.dx, theta)), _area(body, found.position)
        yield at_most(f"area, theta to {theta.max():.0f}", abs(got / asked - 1), 1e-11, KEPT_ROUND_OFF)


def _area(body: Supported, position: np.ndarray) -> float:
    """Of the present shape, um2."""
    of = elements.table(body.geometry, body.geometry, bodies.DEGREE)
    return float(elements.weights(position[body.cells], of).sum())


@case("growth-units", kind="property", norm="largest difference: of places, carried back, over the radius; of "
      "pressures over the largest",
      claim="In metres for micrometres, on a wall that stands upright, or in a mirror, a body grows to the same shape "
            "with the same pressure over mu_L",
      mutants=("h-not-squared",), over=bodies.EVERY)
def units(kind: int):
    changes = {"in metres": 1e-6 * np.eye(2), "upright": np.array([[0.0, -1.0], [1.0, 0.0]]),
               "mirrored": np.diag([-1.0, 1.0])}
    ours, checks = _changed(np.eye(2), kind), []
    for name, change in changes.items():
        found = _changed(change, kind)
        back = found.position @ np.linalg.inv(change).T - ours.position
        gap = np.abs(found.pressure - ours.pressure).max() / np.abs(ours.pressure).max()
        checks += [at_most(f"place, {name}", np.abs(back).max() / bodies.RADIUS, 1e-9, KEPT_ROUND_OFF),
                   at_most(f"pressure, {name}", gap, 1e-8, KEPT_ROUND_OFF)]
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
