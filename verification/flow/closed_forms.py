"""Plane Poiseuille flow in a clean channel, and through a plug, which leaves its profile alone in the Laplacian form.

The stabilised pressure meets a condition that is not its own at inlet and outlet, dp/dn = 0, in a layer of one element:
linear velocities are of second order, but the head loss (6), a difference of mean pressures *at* both ends, is of first
order. Elements of order 2 and 3 hold a parabola and a linear head: all is exact.
"""

from __future__ import annotations

from functools import cache

import numpy as np

from reference import poiseuille
from repro.fem import mesher
from repro.fem.mesh import Mesh, curved
from repro.fem.sizing import Sizing
from repro.fem.space import Space
from repro.model import flow
from repro.scene import Flow as Drive
from verification import meshes, norms
from verification.case import Check, Outcome, Profile, at_most, case
from verification.convergence import refine, study
from verification.flow import grids

WIDTH, ENDS, RATIO = 50.0, (-75.0, 75.0), 2000.0
REFINEMENTS = (0.7, 1.25, 2.2, 3.9)
#: Length of the whole pore (um) and nu / g (um h) in the cases that need them.
LENGTH, VISCOSITY = 600.0, 3e-4
SECOND = "linear elements: second order in L2"
ENDS_FIRST = "first order: the stabilisation's own condition dp/dn = 0 at both ends spoils one layer of elements"
ROUND_OFF = "round-off: the elements hold a parabola and a linear head"


def drive(**given) -> Drive:
    """A head (um) or a mean velocity (um/h), as a scene gives it."""
    return Drive(kinematic_viscosity=VISCOSITY, gravity=1.0, **given)


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
def _clean_mesh(refinement: float) -> Mesh:
    return mesher.generate(None, ENDS, Sizing(WIDTH, refinement, 2.0))[0]


def _clean(refinement: float, interface: str) -> dict[str, float]:
    grid = _clean_mesh(refinement)
    unit = flow.unit_flow(Space(grid, 1), 1.0, interface=interface)
    found = flow.scaled(unit, grid, LENGTH, drive(mean_velocity=2.0))
    exact = poiseuille.head_loss(ENDS[1] - ENDS[0], WIDTH, 2.0, VISCOSITY)
    velocity = norms.l2_error(grid.points, grid.triangles, found.velocity, lambda x, y: 2 * _velocity(x, y))
    return {"size": norms.mean_size(grid), "velocity": velocity, "loss": abs(found.meshed_loss / exact - 1),
            "conductivity": abs(found.conductivity / poiseuille.conductivity(WIDTH, VISCOSITY) - 1)}


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
def _plugged(size: float, draw: int) -> Mesh:
    return grids.channel(ENDS, WIDTH, size, lambda x, y: (PLUG[0] < x) & (x < PLUG[1]), across=PLUG,
                         seed=int(100 * size) + draw)


def _plug_errors(size: float, draw: int) -> dict[str, float]:
    grid = _plugged(size, draw)
    found, length = flow.unit_flow(Space(grid, 1), RATIO), PLUG[1] - PLUG[0]
    exact = sum(poiseuille.head_loss(part, WIDTH, 1.0, viscosity)
                for part, viscosity in ((ENDS[1] - ENDS[0] - length, 1.0), (length, RATIO)))
    return {"velocity": norms.l2_error(grid.points, grid.triangles, found.velocity, _velocity),
            "loss": abs(found.loss / exact - 1)}


def _profile(title: str, grid: Mesh, ratio: float, x: float) -> Profile:
    y = np.linspace(0.0, WIDTH, 101)
    ours = norms.sample(grid.points, grid.triangles, flow.unit_flow(Space(grid, 1), ratio).velocity[:, 0],
                        np.column_stack([np.full_like(y, x), y]))
    return Profile(title, "y (um)", "u_x / u_ave", (("ours", "ours", y, ours),
                                                    ("exact", "exact", y, poiseuille.velocity(y, WIDTH))))


#: Half length of the plug (um) on curved meshes, whose ends are not alike.
HALF, CURVED_ENDS = 20.0, (-60.0, 70.0)
NORM = "largest difference over the largest velocity; relative difference of losses"


@case("flow-curved-poiseuille", kind="exact", norm=NORM,
      claim="With quadratic elements a clean channel, in both forms, and one with a plug of biomass of 2000 times the "
            "viscosity have the parabola at every node and the loss (6) of each part, on any mesh; the work of the "
            "inlet is that loss",
      mutants=("viscosity-swapped", "loss-per-width", "inlet-parabola", "whole-pore-twice", "outlet-free"))
def quadratic_channels() -> Outcome:
    return Outcome(_channels(2))


@case("flow-cubic-poiseuille", kind="exact", norm=NORM,
      claim="The same holds with cubic elements",
      mutants=("cubic-edge-crossed", "loss-per-width", "inlet-parabola", "outlet-free"))
def cubic_channels() -> Outcome:
    return Outcome(_channels(3))


@cache
def _curved_plug() -> Mesh:
    """A channel of six-node triangles with biomass from wall to wall."""
    return curved(meshes.channel(CURVED_ENDS, WIDTH, 8.0, lambda x, y: np.abs(x) < HALF, across=(-HALF, HALF), seed=3),
                  None)


def _channels(order: int) -> tuple[Check, ...]:
    """Of a clean channel in both forms, and of the plug in the Laplacian form."""
    kinds = ((1.0, "laplacian"), (1.0, "traction"), (RATIO, "laplacian"))
    return tuple(check for ratio, interface in kinds for check in _channel(order, ratio, interface))


def _channel(order: int, ratio: float, interface: str) -> list[Check]:
    space, given = Space(_curved_plug(), order), drive(mean_velocity=2.0, viscosity_ratio=ratio)
    found = flow.solve(space, given, LENGTH, interface=interface)
    dofs, part = space.mesh.topology, CURVED_ENDS[1] - CURVED_ENDS[0]
    u = poiseuille.velocity(space.points[:, 1], WIDTH, given.mean_velocity)
    pieces = (part - 2 * HALF, 2 * HALF * ratio, LENGTH - part)
    lost = [poiseuille.head_loss(piece, WIDTH, given.mean_velocity, VISCOSITY) for piece in pieces]
    heads = found.head[dofs.inlet].mean() - found.head[dofs.outlet].mean()
    errors = {"u_x": np.abs(found.velocity[:, 0] - u).max() / u.max(),
              "u_y": np.abs(found.velocity[:, 1]).max() / u.max(),
              "loss as work": abs(found.meshed_loss / sum(lost[:2]) - 1),
              "loss of the whole pore": abs(found.head_loss / sum(lost) - 1),
              "difference of heads": abs(heads / sum(lost[:2]) - 1)}
    return [at_most(f"{name}, lambda = {ratio:g}, {interface}", error, 1e-10, ROUND_OFF)
            for name, error in errors.items()]
