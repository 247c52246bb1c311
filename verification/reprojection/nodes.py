"""(30)-(34): the mass in every point of the reaction is kept as the aggregate expands."""

from __future__ import annotations

import numpy as np

from repro.fem.outline import FREE
from verification.case import Outcome, at_least, at_most, case
from verification.reprojection import bodies

#: The seed's radius (um), the increase of the biomass in an update, and how many of them: the area grows eightfold.
RADIUS, INCREASE, UPDATES = 5.0, 0.08, 27


@case("reprojection-mass", kind="exact",
      norm="largest relative difference over the aggregate's nodes (linear) or quadrature points; weights of the "
           "points less those worked out here, over the largest",
      claim="(34) keeps the mass of every node or quadrature point, X_A and X_I alike, over the biomass triangles "
            "around it and no others",
      mutants=("reprojection-left-out", "inverse-ratio", "fluid-triangles-too"))
def node_mass() -> Outcome:
    return Outcome(tuple(check for order in bodies.ORDERS for check in _kept(order)))


def _kept(order: int) -> list:
    """Checks of one update of a half-disc of 20 um with elements of an order."""
    def density(x, y):
        return bodies.DENSITY * (1 + 0.02 * np.sin(0.3 * x + 0.2 * y))

    now = bodies.placed(bodies.half_disc(20.0, order=order), 1.0, density, order=order)
    x, y = bodies.places(now.space)
    weight, made = bodies.areas(now), 0.05 * (1 + np.sin(0.2 * x))
    now.inert[:] = (50 + y) * weight
    after = bodies.expanded(bodies.scene(order=order), now, made)
    ratio = bodies.areas(after) / weight
    dx = after.space.reaction.dx
    kept = {"X_A": ratio * (after.active / dx) / (density(x, y) * (1 + made)),
            "X_I": ratio * (after.inert / dx) / (50 + y)}
    name = bodies.ORDERS[order]
    return [*(at_most(f"{kind}, {name}", np.abs(found - 1).max(), 1e-12, "(34): round-off")
              for kind, found in kept.items()),
            at_most(f"weights, {name}", np.abs(dx - bodies.areas(after)).max() / dx.max(), 1e-12,
                    "biomass triangles only: round-off"),
            at_least(f"spread of the ratios of areas, {name}", np.ptp(ratio), 0.05, "else nothing is tested")]


@case("reprojection-half-disc", kind="exact",
      norm="largest relative error of radius, density, theta and mass in 27 updates, two remeshes among them",
      claim="A half-disc that grows by 8 % an update everywhere stays one, of radius R_0 sqrt(theta), and (34) returns "
            "its density to X_m in every point, through remeshes as well",
      mutants=("reprojection-left-out", "inverse-ratio", "theta-forgotten", "extent-kept-too-long"))
def half_disc() -> Outcome:
    return Outcome(tuple(check for order in bodies.ORDERS for check in _grown(order)))


def _grown(order: int) -> list:
    """Checks of 27 updates with elements of an order."""
    given, now, rows, renewed = bodies.scene(order=order), bodies.seed(RADIUS, order=order), [], []
    first = now.mass
    for update in range(1, UPDATES + 1):
        now, anew = bodies.updated(given, now, INCREASE)
        renewed += [update] if anew else []
        rows.append(_errors(now, (1 + INCREASE) ** update, first))
    name, round_off = bodies.ORDERS[order], (1e-12, "closed form: round-off")
    bounds = {quantity: round_off for quantity in rows[0]}
    if order > 1:
        bounds["radius"] = 1e-4, "arcs that are parabolas: (edge / R)^4 / 100"
    checks = [at_most(f"{quantity}, {name}", max(row[quantity] for row in rows), *bound)
              for quantity, bound in bounds.items()]
    return [*checks, at_least(f"remeshes, {name}", len(renewed), 2.0, "else the transfer is not tested"),
            at_most(f"first remesh, updates from (3.1)'s, {name}", abs(renewed[0] - _first_remesh()), 0.0,
                    "meshed to 11 R_0, remade beyond 8 R")]


def _errors(now, theta: float, first: float) -> dict[str, float]:
    """Relative errors against the closed form; the outline's nodes are on the arc."""
    distance = np.hypot(*now.outline.points[now.wall == FREE].T)
    active, _ = bodies.densities(now)
    return {"radius": np.abs(distance / (RADIUS * np.sqrt(theta)) - 1).max(),
            "density": np.abs(active / bodies.DENSITY - 1).max(),
            "theta": np.abs(now.theta / theta - 1).max(), "mass": abs(now.mass / first / theta - 1)}


def _first_remesh() -> int:
    """The first update after which 8 R_0 sqrt(theta) > 11 R_0."""
    return int(np.ceil(2 * np.log(11 / 8) / np.log(1 + INCREASE)))
