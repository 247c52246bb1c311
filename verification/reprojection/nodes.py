"""(30)-(34): the mass of every node is kept as the aggregate expands."""

from __future__ import annotations

import numpy as np

from repro.fem import geometry
from verification.case import Outcome, at_least, at_most, case
from verification.reprojection import bodies

#: The seed's radius (um), the increase of the biomass in an update, and how many of them: the area grows eightfold.
RADIUS, INCREASE, UPDATES = 5.0, 0.08, 27


@case("reprojection-mass", kind="exact",
      norm="largest relative difference over the nodes of the aggregate; largest value outside it",
      claim="(34) keeps the mass of every node, X_A and X_I alike, over the biomass triangles around it and no others",
      mutants=("inverse-ratio", "fluid-triangles-too"))
def node_mass() -> Outcome:
    now = bodies.placed(geometry.seed(20.0), 1.0, lambda x, y: bodies.DENSITY * (1 + 0.02 * np.sin(0.3 * x + 0.2 * y)))
    body, made = now.mesh.body, 0.05 * (1 + np.sin(0.2 * now.mesh.points[:, 0]))
    now.inert[body] = 50 + now.mesh.points[body, 1]
    after = bodies.expanded(bodies.scene(), now, made)
    ratio = (bodies.node_areas(after)[body] / bodies.node_areas(now)[body])
    outside = np.setdiff1d(np.arange(len(made)), body)
    kept = {"X_A": ratio * after.active[body] / (now.active * (1 + made))[body],
            "X_I": ratio * after.inert[body] / now.inert[body]}
    return Outcome((*(at_most(name, np.abs(found - 1).max(), 1e-12, "(34): round-off") for name, found in kept.items()),
                    at_most("outside the aggregate", np.abs(after.active[outside]).max(), 0.0, "biomass nodes only"),
                    at_least("spread of the ratios of areas", np.ptp(ratio), 0.05, "else nothing is tested")))


@case("reprojection-half-disc", kind="exact",
      norm="largest relative error of radius, density, theta and mass in 27 updates, two remeshes among them",
      claim="A half-disc that grows by 8 % an update everywhere stays one, of radius R_0 sqrt(theta), and (34) returns "
            "its density to X_m at every node, through remeshes as well",
      mutants=("inverse-ratio", "theta-forgotten", "extent-kept-too-long"))
def half_disc() -> Outcome:
    given, now, rows, renewed = bodies.scene(), bodies.seed(RADIUS), [], []
    first = bodies.mass(now)
    for update in range(1, UPDATES + 1):
        now, anew = bodies.updated(given, now, INCREASE)
        renewed += [update] if anew else []
        rows.append(_errors(now, (1 + INCREASE) ** update, first))
    checks = [at_most(name, max(row[name] for row in rows), 1e-12, "closed form: round-off") for name in rows[0]]
    return Outcome((*checks, at_least("remeshes", len(renewed), 2.0, "else the transfer is not tested"),
                    at_most("first remesh, updates from (3.1)'s", abs(renewed[0] - _first_remesh()), 0.0,
                            "meshed to 11 R_0, remade beyond 8 R")))


def _errors(now, theta: float, first: float) -> dict[str, float]:
    """Relative errors against the closed form; the outline's nodes are on the arc."""
    distance = np.hypot(*now.outline.points[now.wall == geometry.FREE].T)
    return {"radius": np.abs(distance / (RADIUS * np.sqrt(theta)) - 1).max(),
            "density": np.abs(now.active[now.mesh.body] / bodies.DENSITY - 1).max(),
            "theta": np.abs(now.theta / theta - 1).max(), "mass": abs(bodies.mass(now) / first / theta - 1)}


def _first_remesh() -> int:
    """The first update after which 8 R_0 sqrt(theta) > 11 R_0."""
    return int(np.ceil(2 * np.log(11 / 8) / np.log(1 + INCREASE)))
