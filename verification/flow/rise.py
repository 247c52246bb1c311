"""A closed form in the paper's own geometry: how the head loss rises as biomass gets a little thicker than water."""

from __future__ import annotations

from functools import cache

import numpy as np

from reference import poiseuille
from repro.fem import geometry, mesh
from repro.fem.mesh import PoreMesh
from repro.model import flow
from verification import norms
from verification.case import Outcome, case
from verification.convergence import refine, study
from verification.flow import grids

WIDTH, ENDS, RADIUS = 50.0, (-75.0, 75.0), 25.0
REFINEMENTS, DRAWS = (0.5, 1.0, 2.0, 4.0), (3, 3, 3, 1)
#: Half the difference of lambda in the central difference, whose own error is of the order of its square.
STEP = 1e-3
SECOND = "second order, like the dissipation of linear elements; what the ends spoil is in both losses"


@case("flow-first-rise", kind="exact", norm="root mean square over meshes of about a size: "
      "relative error of d(head loss)/d(lambda) by a central difference",
      claim="At lambda = 1 the head loss rises with lambda by what Poiseuille flow dissipates in a half-disc",
      mutants=("viscosity-swapped",))
def first_rise() -> Outcome:
    studies = []
    for interface in ("laplacian", "traction"):
        errors = refine(_rise_errors, range(len(REFINEMENTS)), interface)
        studies.append(study(f"rise, {interface}", errors["size"], errors["rise"], 2, SECOND, ceiling=4e-4))
    return Outcome(studies=tuple(studies))


@cache
def _grid(refinement: float) -> PoreMesh:
    return mesh.generate(geometry.seed(RADIUS, refinement), ENDS, geometry.Sizing(WIDTH, refinement, 2.0))[0]


def _rise_errors(level: int, interface: str) -> dict[str, float]:
    return grids.root_mean_square(
        lambda draw: _rise_error(REFINEMENTS[level] * grids.SPREAD[draw], interface), DRAWS[level])


def _rise_error(refinement: float, interface: str) -> dict[str, float]:
    grid = _grid(refinement)
    below, above = (flow.unit_flow(grid, 1 + step, interface=interface).loss for step in (-STEP, STEP))
    where, weight, _ = norms.quadrature(grid.points, grid.triangles[grid.biomass])
    exact = np.sum(weight * poiseuille.dissipation(where[..., 1], WIDTH)) / WIDTH
    return {"size": norms.mean_size(grid), "rise": abs((above - below) / (2 * STEP) / exact - 1)}
