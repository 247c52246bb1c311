"""Patch tests: a body whose rim is held at F X has F inside, with constant pressure, on any mesh.

With all of its rim held the level of the pressure would be open, so that one end is free along its normal, or pulled.
"""

from __future__ import annotations

import numpy as np

from reference import neo_hookean
from verification.case import Check, Outcome, case
from verification.growth import bodies, loaded
from verification.growth.homogeneous import NORM, exactly

#: F = [[a, b], [0, d]] by a, b, d: squeezed along x, sheared by 3, half and 2000 times the area.
SHEARS = ((0.7, 0.9, 2.5), (1.0, 3.0, 2.0), (0.8, -0.5, 0.625), (20.0, 60.0, 100.0))
#: Elements (um) of straight and of curved triangles, and how far inner nodes are shaken at random (um).
SIZES, SHAKEN = {1: 1.3, 2: 2.0}, {1: 0.1, 2: 0.02}
TURN = np.array([[0.0, -1.0], [1.0, 0.0]])


@case("growth-patch", kind="exact", norm=NORM,
      claim="A body of straight or curved triangles whose rim is held at F X, but for an end that is free to move "
            "along its normal, has F inside and constant, exact pressure and stress: shears to 3, J from 0.5 to 2000, "
            "the end on each of the four sides",
      mutants=("theta-power", "untransposed", "thickness-forgotten", "held-short"))
def patch() -> Outcome:
    ends = [np.linalg.matrix_power(TURN, turns) for turns in range(4)]
    checks = []
    for kind in bodies.KINDS[:2]:
        for Q, shear in zip(ends, SHEARS):
            checks += _sheared(kind, Q, *shear)
    return Outcome(tuple(checks))


def _sheared(kind: int, Q: np.ndarray, a: float, b: float, d: float) -> list[Check]:
    """A body turned by Q, a multiple of a right angle, with its end that was the upper one free along its normal."""
    grid, side = bodies.rectangle(SIZES[kind], 5, kind)
    rim = side["left"] | side["right"] | side["bottom"]
    held = np.abs(np.column_stack([rim | side["top"], rim]) @ Q.T) > 0
    body = bodies.on_mesh(grid, kind, grid.points @ Q.T, held)

    def F(part):
        return Q @ np.array([[a**part, part * b], [0.0, d**part]]) @ Q.T

    found = bodies.grown(body, body.constant(a * d), lambda part: body.reference @ F(part).T)
    pressure = -neo_hookean.cauchy(Q.T @ F(1.0) @ Q, 0.0)[1, 1]
    return exactly(f"a, b, d = {a:g}, {b:g}, {d:g}, {bodies.WORDS[kind]}", body, found, F(1.0), pressure)


#: Any F: a turn, a shear in any direction, a stretch; and P over mu_L.
LOADED = (([[0.8, -0.6], [0.6, 0.8]], 0.4), ([[1.7, 2.1], [-0.8, 1.1]], -1.3), ([[-31.0, 45.0], [-42.0, -3.0]], 0.02))


@case("growth-patch-traction", kind="exact", norm=NORM,
      claim="A body of straight or curved triangles held at F X on three sides and pulled by the traction of F and P "
            "on the fourth has F and P inside, for any F, turned and sheared, J to 2000, and any P",
      mutants=("theta-power", "third-power", "untransposed", "one-corner-pressure"))
def patch_traction() -> Outcome:
    checks = []
    for kind in bodies.KINDS[:2]:
        for F, P in LOADED:
            checks += _pulled(kind, np.array(F), P)
    return Outcome(tuple(checks))


def _pulled(kind: int, F: np.ndarray, P: float) -> list[Check]:
    """A body whose side on the right is pulled, from places that are shaken."""
    grid, side = bodies.rectangle(SIZES[kind], 8, kind)
    inside = ~np.any(list(side.values()), axis=0)
    shake = np.random.default_rng(9).uniform(-1, 1, grid.points.shape) * inside[:, None] * SHAKEN[kind]
    J, held = np.linalg.det(F), side["left"] | side["bottom"] | side["top"]
    S = J * neo_hookean.cauchy(F, P)[:2, :2] @ np.linalg.inv(F).T
    body = bodies.on_mesh(grid, kind, grid.points, np.column_stack([held, held]))
    forces = loaded.traction(body, grid, lambda x, y: np.broadcast_to(S, (*x.shape, 2, 2)))
    found = loaded.equilibrium(body, body.constant(J), forces, (grid.points + shake) @ F.T)
    return exactly(f"F = {F.tolist()}, P = {P:g}, {bodies.WORDS[kind]}", body, found, F, P)
