"""Homogeneous growth, which linear elements hold exactly on any mesh: free and confined."""

from __future__ import annotations

import numpy as np

from reference import neo_hookean
from repro.fem.mesh import gradients
from repro.model import growth
from verification.case import Check, Outcome, at_most, case
from verification.growth import bodies

ROUND_OFF = "round-off: linear elements hold it; Newton's method stops at 1e-11"


def exactly(name: str, body: growth.Body, found: growth.Equilibrium, F: np.ndarray, pressure: float) -> list[Check]:
    """Places, pressures and Cauchy stresses of an equilibrium against homogeneous F (2, 2) and P."""
    exact = neo_hookean.cauchy(F, pressure)
    reached = growth.deformation(found.position, body.triangles, gradients(body.reference, body.triangles))
    stress = growth.cauchy(reached, found.pressure[body.triangles].mean(axis=1))
    gap = np.abs(stress - [exact[0, 0], exact[1, 1], exact[2, 2], exact[0, 1]]).max()
    back, largest = found.position @ np.linalg.inv(F).T - body.reference, max(np.abs(exact).max(), abs(pressure))
    return [at_most(f"place, {name}", np.abs(back).max() / bodies.LENGTH, 1e-9, ROUND_OFF),
            at_most(f"pressure, {name}", np.abs(found.pressure - pressure).max() / largest, 1e-8, ROUND_OFF),
            at_most(f"stress, {name}", gap / largest, 1e-8, ROUND_OFF)]


NORM = "largest difference: places, carried back to t = 0, over the length; pressures and stresses over the largest"


@case("growth-homogeneous", kind="exact", norm=NORM,
      claim="Uniform growth, free to theta = 2000 and confined to one direction to theta = 36, has the exact shape, "
            "pressure and stress on any mesh [E11]",
      mutants=("theta-power", "third-power", "thickness-forgotten", "stress-across"))
def homogeneous() -> Outcome:
    points, triangles, side = bodies.rectangle(1.3, seed=4)
    checks = []
    for name, held, thetas, exact in (
            ("free", side["left"], (2.0, 36.0, 2000.0), _free),
            ("confined", side["left"] | side["right"], (2.0, 36.0), _confined)):
        body = growth.Body(points, triangles, np.column_stack([held, side["bottom"]]))
        for theta in thetas:
            found = bodies.grown(body, np.full(len(triangles), theta))
            checks += exactly(f"{name}, theta = {theta:g}", body, found, *exact(theta))
    return Outcome(tuple(checks))


def _free(theta: float):
    """F and P."""
    return np.sqrt(theta) * np.eye(2), neo_hookean.free_growth_pressure(theta)


def _confined(theta: float):
    """F and P."""
    return np.diag([1.0, theta]), neo_hookean.confined_growth_pressure(theta)
