"""Homogeneous growth, which linear and quadratic elements hold exactly on any mesh: free and confined."""

from __future__ import annotations

import numpy as np

from reference import neo_hookean
from repro.model import growth
from verification.case import Check, Outcome, at_most, case
from verification.growth import bodies
from verification.growth.bodies import Supported

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
      mutants=("theta-power", "third-power", "thickness-forgotten", "stress-across"))
def homogeneous() -> Outcome:
    checks = []
    for kind in bodies.KINDS:
        grid, side = bodies.rectangle(1.3 if kind == 1 else 2.0, 4, kind)
        for name, held, thetas, exact in _supports(side, kind):
            body = bodies.on_mesh(grid, kind, grid.points, np.column_stack([held, side["bottom"]]))
            for theta in thetas:
                found = bodies.grown(body, body.constant(theta))
                told = f"{name}, theta = {theta:g}, {bodies.WORDS[kind]}"
                checks += exactly(told, body, found, *exact(theta))
    return Outcome(tuple(checks))


@case("growth-curved-homogeneous", kind="exact",
      norm="largest difference in position over the length, and in pressure over its size",
      claim="The same on a mesh that was made half way, its material grown before: theta counts from t = 0, whatever "
            "shape the search starts from, on straight and on curved triangles",
      mutants=("theta-since-the-start", "theta-power"))
def made_half_way() -> Outcome:
    checks = []
    for kind in bodies.KINDS:
        grid, side = bodies.rectangle(1.6, 4, kind)
        for top, made_at in ((2.0, 1.0), (36.0, 1.0), (36.0, 5.0)):
            for name, held, F, pressure in (
                    ("free", side["left"], np.sqrt(top) * np.eye(2), neo_hookean.free_growth_pressure(top)),
                    ("confined", side["left"] | side["right"], np.diag([1.0, top]),
                     neo_hookean.confined_growth_pressure(top))):
                body = bodies.on_mesh(grid, kind, grid.points, np.column_stack([held, side["bottom"]]))
                start = grid.points @ (np.sqrt(made_at) * np.eye(2) if name == "free" else np.diag([1.0, made_at]))
                found = growth.equilibrium(body.body, body.constant(top), start, body.resting, body.held, start)
                told = f"{name}, theta = {top:g}, mesh made at {made_at:g}, {bodies.WORDS[kind]}"
                checks += exactly(told, body, found, F, pressure)[:2]
    return Outcome(tuple(checks))


def _free(theta: float):
    """F and P."""
    return np.sqrt(theta) * np.eye(2), neo_hookean.free_growth_pressure(theta)


def _confined(theta: float):
    """F and P."""
    return np.diag([1.0, theta]), neo_hookean.confined_growth_pressure(theta)
