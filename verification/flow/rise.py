"""A closed form in the paper's own geometry: how the head loss rises as biomass gets a little thicker than water."""

from __future__ import annotations

from functools import cache

import numpy as np

from reference import poiseuille
from repro.fem.mesh import Mesh
from repro.fem.space import Space
from repro.model import flow
from verification import meshes, norms
from verification.case import Outcome, at_most, case
from verification.convergence import refine, study
from verification.flow import grids

WIDTH, ENDS, RADIUS = 50.0, (-75.0, 75.0), 25.0
REFINEMENTS, DRAWS = (0.5, 1.0, 2.0, 4.0), (3, 3, 3, 1)
#: Half the difference of lambda in the central difference, whose own error is of the order of its square.
STEP = 1e-3
SECOND = "second order, like the dissipation of linear elements; what the ends spoil is in both losses"


#: Refinement of the mesh of orders 2 and 3, and what they may err by: straight triangles hold the parabola, and those
#: beside the arc all but their bow, which is of fourth order in the loss.
CURVED, BOW = 0.5, 1e-5


@case("flow-first-rise", kind="exact", norm="root mean square over meshes of about a size: "
      "relative error of d(head loss)/d(lambda) by a central difference",
      claim="At lambda = 1 the head loss rises with lambda by what Poiseuille flow dissipates in a half-disc: to "
            "second order with linear elements, on a coarse mesh with quadratic and cubic ones",
      mutants=("viscosity-swapped", "loss-per-width"))
def first_rise() -> Outcome:
    studies, checks = [], []
    for interface in ("laplacian", "traction"):
        errors = refine(_rise_errors, range(len(REFINEMENTS)), interface)
        studies.append(study(f"rise, {interface}", errors["size"], errors["rise"], 2, SECOND, ceiling=4e-4))
        checks += [at_most(f"rise, order {order}, {interface}", _rise_error(CURVED, interface, order)["rise"], BOW,
                           "the parabola is held but for the bow of the triangles beside the arc")
                   for order in (2, 3)]
    return Outcome(tuple(checks), tuple(studies))


@cache
def _grid(refinement: float, geometry: int) -> Mesh:
    return meshes.half_disc(RADIUS, refinement, ENDS, WIDTH, geometry=geometry)


def _rise_errors(level: int, interface: str) -> dict[str, float]:
    return grids.root_mean_square(
        lambda draw: _rise_error(REFINEMENTS[level] * grids.SPREAD[draw], interface, 1), DRAWS[level])


def _rise_error(refinement: float, interface: str, order: int) -> dict[str, float]:
    grid = _grid(refinement, min(order, 2))
    space = Space(grid, order)
    below, above = (flow.unit_flow(space, 1 + step, interface=interface).loss for step in (-STEP, STEP))
    where, weight, _ = norms.fine(space, grid.biomass)
    exact = np.sum(weight * poiseuille.dissipation(where[..., 1], WIDTH)) / WIDTH
    return {"size": norms.mean_size(grid), "rise": abs((above - below) / (2 * STEP) / exact - 1)}
