"""Plane Poiseuille flow in a clean channel, and through a plug, which leaves its profile alone in the Laplacian form.

The stabilised pressure meets a condition that is not its own at inlet and outlet, dp/dn = 0, in a layer of one element:
velocities are of second order, but the head loss (6), a difference of mean pressures *at* both ends, is of first order.
"""

from __future__ import annotations

from functools import cache

import numpy as np

from reference import poiseuille
from repro.fem import geometry, mesh
from repro.fem.mesh import PoreMesh
from repro.model import flow
from verification import norms
from verification.case import Outcome, Profile, case
from verification.convergence import refine, study
from verification.flow import grids

WIDTH, ENDS, RATIO = 50.0, (-75.0, 75.0), 2000.0
REFINEMENTS = (0.7, 1.25, 2.2, 3.9)
SECOND = "linear elements: second order in L2"
ENDS_FIRST = "first order: the stabilisation's own condition dp/dn = 0 at both ends spoils one layer of elements"


@case("flow-poiseuille", kind="exact", norm="L2 of u over the mesh; relative error of the head loss over it, and of "
      "the conductivity of a pore of 600 um",
      claim="In a clean channel the flow is plane Poiseuille's, in both forms of [E2]",
      mutants=("saddle-sign", "tau-linear", "upper-wall-slips", "outlet-free", "unmeshed-forgotten"))
def poiseuille_channel() -> Outcome:
    studies = []
    for interface in ("laplacian", "traction"):
        errors = refine(_clean, REFINEMENTS, interface)
        studies += [study(f"velocity, {interface}", errors["size"], errors["velocity"], 2, SECOND, ceiling=3e-4),
                    study(f"head loss, {interface}", errors["size"], errors["loss"], 1, ENDS_FIRST, ceiling=6e-3),
                    study(f"conductivity, {interface}", errors["size"], errors["conductivity"], 1, ENDS_FIRST,
                          ceiling=1.5e-3)]
    return Outcome(studies=tuple(studies), profiles=(_profile("clean channel", _clean_mesh(REFINEMENTS[0]), 1.0, 0.0),))


@cache
def _clean_mesh(refinement: float) -> PoreMesh:
    return mesh.generate(None, ENDS, geometry.Sizing(WIDTH, refinement, 2.0))[0]


def _clean(refinement: float, interface: str) -> dict[str, float]:
    grid, length, nu = _clean_mesh(refinement), 600.0, 3e-4
    found = flow.scaled(flow.unit_flow(grid, 1.0, interface=interface), grid, length, nu, head=None, mean_velocity=2.0)
    exact = poiseuille.head_loss(ENDS[1] - ENDS[0], WIDTH, 2.0, nu)
    velocity = norms.l2_error(grid.points, grid.triangles, found.velocity, lambda x, y: 2 * _velocity(x, y))
    return {"size": norms.mean_size(grid), "velocity": velocity, "loss": abs(found.meshed_loss / exact - 1),
            "conductivity": abs(found.conductivity / poiseuille.conductivity(WIDTH, nu) - 1)}


def _velocity(x, y):
    return np.stack([poiseuille.velocity(y, WIDTH), 0 * y], axis=-1)


PLUG, PLUG_SIZES, PLUG_DRAWS = (-30.0, 30.0), (8.0, 4.0, 2.0, 1.0), (12, 8, 4, 1)


@case("flow-plug", kind="exact", norm="root mean square over random meshes of a size: L2 of u over the mesh, relative "
      "error of the head loss",
      claim="Through a plug the Laplacian form keeps Poiseuille's profile and loses lambda times its head there",
      mutants=("tau-of-water",))
def plug() -> Outcome:
    errors = refine(lambda level: grids.root_mean_square(
        lambda draw: _plug_errors(PLUG_SIZES[level], draw), PLUG_DRAWS[level]), range(len(PLUG_SIZES)))
    studies = (study("velocity", PLUG_SIZES, errors["velocity"], 2, SECOND, ceiling=5e-4),
               study("head loss", PLUG_SIZES, errors["loss"], 2, "second order: the plug's inside outweighs the ends",
                     ceiling=1e-3))
    return Outcome(studies=studies, profiles=(_profile("in the plug", _plugged(PLUG_SIZES[1], 0), RATIO, 0.0),))


@cache
def _plugged(size: float, draw: int) -> PoreMesh:
    return grids.channel(ENDS, WIDTH, size, lambda x, y: (PLUG[0] < x) & (x < PLUG[1]), across=PLUG,
                         seed=int(100 * size) + draw)


def _plug_errors(size: float, draw: int) -> dict[str, float]:
    grid = _plugged(size, draw)
    found, length = flow.unit_flow(grid, RATIO), PLUG[1] - PLUG[0]
    exact = sum(poiseuille.head_loss(part, WIDTH, 1.0, viscosity)
                for part, viscosity in ((ENDS[1] - ENDS[0] - length, 1.0), (length, RATIO)))
    return {"velocity": norms.l2_error(grid.points, grid.triangles, found.velocity, _velocity),
            "loss": abs(found.loss / exact - 1)}


def _profile(title: str, grid: PoreMesh, ratio: float, x: float) -> Profile:
    y = np.linspace(0.0, WIDTH, 101)
    ours = norms.sample(grid.points, grid.triangles, flow.unit_flow(grid, ratio).velocity[:, 0],
                        np.column_stack([np.full_like(y, x), y]))
    return Profile(title, "y (um)", "u_x / u_ave", (("ours", "ours", y, ours),
                                                    ("exact", "exact", y, poiseuille.velocity(y, WIDTH))))
