"""Plane Poiseuille flow in a clean channel, and through a plug, which leaves its profile alone in the Laplacian form.

The stabilised pressure meets a condition that is not its own at inlet and outlet, dp/dn = 0, in a layer of one element:
linear velocities are of second order, but the head loss (6), a difference of mean pressures *at* both ends, is of first
order. Elements of order 2 and 3 hold a parabola and a linear head: all is exact.

A layer of biomass along the lower wall of a long channel: two viscous layers, exact for any ratio of viscosities.

The inlet's parabola turns into the layered profile within a few layers' thicknesses (like exp(-1.1 x / h) in biomass);
the middle of the layer is ten of them away from its ends, where what is left is under 1e-4. The layers meet in a shear
that both forms of [E2] have alike, but in the traction form a layer that is held below and free above forgets its ends
more slowly, like exp(-z x / h) with cos z = z, z = 0.739. Elements of order 2 and 3 hold both parabolas: a coarse mesh
of a longer layer shows that they err by what is left alone.

A closed form in the paper's own geometry: how the head loss rises as biomass gets a little thicker than water.

A viscous disc in a sheared fluid: Schmid & Podladchikov's closed form, and its twin in the Laplacian form of [E2].

The pressure jumps at the interface by as much as it varies, and the continuous one of (3.2) smears the jump over one
layer of elements: an error of order one over an area of order h, 1/2 in L2 whatever the elements. What it costs the
velocity is of first order (its square, by duality): quadratic elements show it where lambda = 10, while beside the
second-order error of linear ones it is not to be seen on these meshes, nor where lambda = 2000 holds the disc stiff.
There curved elements, whose disc is round, keep their own orders until the jump's share is larger.
"""

from __future__ import annotations

from functools import cache

import numpy as np

from reference import layered_channel, poiseuille, viscous_inclusion
from repro.fem import mesher
from repro.fem.mesh import Mesh, curved
from repro.fem.sizing import Sizing
from repro.fem.space import Space
from repro.model import flow
from repro.scene import Flow as Drive
from verification.kernel.case import Check, Outcome, Profile, Study, at_most, case, refine, study
from verification.problems import boxes, meshes, norms
from verification.problems.boxes import Problem

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
      mutants=("saddle-sign", "tau-linear", "upper-wall-slips", "outlet-free", "unmeshed-forgotten"),
      ways="1", because="orders 2, 3: flow-curved-poiseuille")
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


PLUG, PLUG_SIZES, PLUG_DRAWS = 30.0, (8.0, 4.0, 2.0, 1.0), (12, 8, 4, 1)


@case("flow-plug", kind="exact", norm="root mean square over random meshes of a size: L2 of u over the mesh, relative "
      "error of the head loss",
      claim="Through a plug the Laplacian form keeps Poiseuille's profile and loses lambda times its head there",
      mutants=("tau-of-water",), ways="1", because="orders 2, 3: flow-curved-poiseuille")
def plug() -> Outcome:
    errors = refine(lambda level: meshes.root_mean_square(
        lambda draw: _plug_errors(PLUG_SIZES[level], draw), PLUG_DRAWS[level]), range(len(PLUG_SIZES)))
    studies = (study("velocity", PLUG_SIZES, errors["velocity"], 2, SECOND, ceiling=5e-4),
               study("head loss", PLUG_SIZES, errors["loss"], 2, "second order: the plug's inside outweighs the ends",
                     ceiling=1e-3))
    return Outcome(studies=studies, profiles=(_profile("in the plug", _plugged(PLUG_SIZES[1], 0), RATIO, 0.0),))


@cache
def _plugged(size: float, draw: int) -> Mesh:
    return meshes.plug(ENDS, WIDTH, PLUG, size, meshes.cut, int(100 * size) + draw)


def _plug_errors(size: float, draw: int) -> dict[str, float]:
    grid = _plugged(size, draw)
    found, length = flow.unit_flow(Space(grid, 1), RATIO), 2 * PLUG
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
      claim="With quadratic and cubic elements a clean channel, in both forms, and one with a plug of biomass of 2000 "
            "times the viscosity have the parabola at every node and the loss (6) of each part, on any mesh; the work "
            "of the inlet is that loss",
      mutants=("viscosity-swapped", "loss-per-width", "inlet-parabola", "whole-pore-twice", "outlet-free",
               "cubic-edge-crossed"), over={"order 2": (2,), "order 3": (3,)},
      because="order 1: flow-poiseuille, flow-plug")
def channels(order: int):
    """Of a clean channel in both forms, and of the plug in the Laplacian form."""
    kinds = ((1.0, "laplacian"), (1.0, "traction"), (RATIO, "laplacian"))
    return [_channel(order, ratio, interface) for ratio, interface in kinds]


@cache
def _curved_plug() -> Mesh:
    """A channel of six-node triangles with biomass from wall to wall."""
    return curved(meshes.plug(CURVED_ENDS, WIDTH, HALF, 8.0, seed=3), None)


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


LAYER, LAYER_END, BEYOND, MIDDLE = 12.5, 125.0, 15.0, 25.0
RATIOS = (1.0, 10.0, 100.0, 2000.0, 1e5, 1e8)
SIZES, DRAWS = LAYER / np.array([1.5, 3.0, 6.0, 12.0]), (16, 12, 6, 1)
#: Errors of the finest meshes may reach this.
CEILINGS = {"velocity": 1e-3, "velocity in the layer": 1e-3, "gradient": 1.2e-3}


#: Half length (um) of the layer of orders 2 and 3, and what is left of its ends in its middle: exp(-0.739 * 18).
LONG, LEFT = 250.0, 2e-6


@case("flow-layers", kind="exact", slow=True, norm="middle of a long layer, root mean square over random meshes of a "
      "size: L2 of u, of u within the layer (relative to that), and relative error of the pressure gradient",
      claim="Along a layer of biomass the flow is that of two viscous layers, for lambda from 1 to 1e8, to second "
            "order with linear elements in both forms and on any mesh with quadratic and cubic ones",
      mutants=("tau-of-water", "viscosity-swapped"), ways="1 2 3")
def layers() -> Outcome:
    studies = [part for ratio in RATIOS for part in _studies(ratio, "laplacian")]
    studies += _studies(2000.0, "traction")[:1]  # what is left of the ends rules in the layer
    checks = [check for order in (2, 3) for ratio in RATIOS for interface in ("laplacian", "traction")
              for check in _held(order, ratio, interface)]
    return Outcome(tuple(checks), tuple(studies), tuple(_layers_profile(ratio) for ratio in RATIOS))


def _studies(ratio: float, interface: str) -> list[Study]:
    """Of linear elements."""
    errors = refine(_errors, range(len(SIZES)), ratio, interface)
    return [study(f"{name}, lambda = {ratio:g}, {interface}", SIZES, errors[name], 2, SECOND, ceiling=ceiling)
            for name, ceiling in CEILINGS.items()]


def _held(order: int, ratio: float, interface: str) -> list[Check]:
    """Of higher ones."""
    errors = _layered(Space(_long_layer(), order), ratio, interface)
    return [at_most(f"{name}, order {order}, lambda = {ratio:g}, {interface}", error, LEFT,
                    "what is left of the layer's ends") for name, error in errors.items()]


def _errors(level: int, ratio: float, interface: str) -> dict[str, float]:
    return meshes.root_mean_square(lambda draw: _layered(Space(_grid(level, draw), 1), ratio, interface), DRAWS[level])


@cache
def _grid(level: int, draw: int) -> Mesh:
    return _layers_channel(LAYER_END, level, draw)


@cache
def _long_layer() -> Mesh:
    """Of six-node triangles."""
    return curved(_layers_channel(LONG, 0, 0), None)


def _layers_channel(half: float, level: int, draw: int) -> Mesh:
    """The layer from -half to half (um), and clean water beyond."""
    end = half + BEYOND
    return meshes.cut((-end, end), WIDTH, SIZES[level], lambda x, y: (y < LAYER) & (np.abs(x) < half),
                         across=(-half, half), along=(LAYER,), seed=int(1000 * SIZES[level]) + draw)


def _layered(space: Space, ratio: float, interface: str) -> dict[str, float]:
    grid, found = space.mesh, flow.unit_flow(space, ratio, interface=interface)
    middle = np.abs(grid.points[grid.triangles, 0].mean(axis=1)) < MIDDLE

    def exact(x, y):
        return np.stack([layered_channel.velocity(y, WIDTH, LAYER, ratio), 0 * y], axis=-1)

    gradient = layered_channel.gradient(WIDTH, LAYER, ratio)
    return {"velocity": norms.field_error(space, found.velocity, exact, middle),
            "velocity in the layer": norms.field_error(space, found.velocity, exact, middle & grid.biomass),
            "gradient": abs(slope(flow.pressure_space(space), found.pressure, middle) / gradient - 1)}


def slope(space: Space, pressure: np.ndarray, chosen: np.ndarray) -> float:
    """-dp/dx by least squares over some triangles."""
    where, weight, shape = norms.fine(space, chosen)
    x, p = where[..., 0], pressure[space.cells[chosen]] @ shape.T
    x = x - np.sum(weight * x) / weight.sum()
    return float(-np.sum(weight * p * x) / np.sum(weight * x**2))


def _layers_profile(ratio: float) -> Profile:
    grid, y = _grid(1, 0), np.linspace(0.0, WIDTH, 101)
    where = np.column_stack([np.zeros_like(y), y])
    ours = norms.sample(grid.points, grid.triangles, flow.unit_flow(Space(grid, 1), ratio).velocity[:, 0], where)
    exact = layered_channel.velocity(y, WIDTH, LAYER, ratio)
    return Profile(f"lambda = {ratio:g}", "y (um)", "u_x / u_ave",
                   (("ours", "ours", y, ours), ("exact", "exact", y, exact)))


RADIUS = 25.0
RISE_REFINEMENTS, RISE_DRAWS = (0.5, 1.0, 2.0, 4.0), (3, 3, 3, 1)
#: Half the difference of lambda in the central difference, whose own error is of the order of its square.
STEP = 1e-3
RISE_SECOND = "second order, like the dissipation of linear elements; what the ends spoil is in both losses"


#: Refinement of the mesh of orders 2 and 3, and what they may err by: straight triangles hold the parabola, and those
#: beside the arc all but their bow, which is of fourth order in the loss.
CURVED, BOW = 0.5, 1e-5


@case("flow-first-rise", kind="exact", norm="root mean square over meshes of about a size: "
      "relative error of d(head loss)/d(lambda) by a central difference",
      claim="At lambda = 1 the head loss rises with lambda by what Poiseuille flow dissipates in a half-disc: to "
            "second order with linear elements, on a coarse mesh with quadratic and cubic ones",
      mutants=("viscosity-swapped", "loss-per-width"), ways="1 2 3")
def first_rise() -> Outcome:
    studies, checks = [], []
    for interface in ("laplacian", "traction"):
        errors = refine(_rise_errors, range(len(RISE_REFINEMENTS)), interface)
        studies.append(study(f"rise, {interface}", errors["size"], errors["rise"], 2, RISE_SECOND, ceiling=4e-4))
        checks += [at_most(f"rise, order {order}, {interface}", _rise_error(CURVED, interface, order)["rise"], BOW,
                           "the parabola is held but for the bow of the triangles beside the arc")
                   for order in (2, 3)]
    return Outcome(tuple(checks), tuple(studies))


@cache
def _rise_grid(refinement: float, geometry: int) -> Mesh:
    return meshes.half_disc(RADIUS, refinement, ENDS, WIDTH, geometry=geometry)


def _rise_errors(level: int, interface: str) -> dict[str, float]:
    return meshes.root_mean_square(
        lambda draw: _rise_error(RISE_REFINEMENTS[level] * meshes.SPREAD[draw], interface, 1), RISE_DRAWS[level])


def _rise_error(refinement: float, interface: str, order: int) -> dict[str, float]:
    grid = _rise_grid(refinement, min(order, 2))
    space = Space(grid, order)
    below, above = (flow.unit_flow(space, 1 + step, interface=interface).loss for step in (-STEP, STEP))
    where, weight, _ = norms.fine(space, grid.biomass)
    exact = np.sum(weight * poiseuille.dissipation(where[..., 1], WIDTH)) / WIDTH
    return {"size": norms.mean_size(grid), "rise": abs((above - below) / (2 * STEP) / exact - 1)}


DISC_ENDS = (-25.0, 25.0)
CENTRE, DISC_RADIUS, ANGLE = np.array([2.0, 24.0]), 15.0, 0.4
DISC_SIZES, DISC_DRAWS = (4.8, 2.4, 1.2, 0.6), (12, 8, 4, 1)
DISC_SECOND = "linear elements: second order; the jump's own share is smaller on these meshes"
JUMP = "1/2, from above: a continuous pressure cannot jump, the smooth part of the error falls faster"
STIFF = JUMP + "; more so where lambda multiplies the error of the disc's strain"


@case("flow-inclusion", kind="exact", norm="root mean square over random meshes of a size, relative L2 of u and p",
      claim="A viscous disc under pure shear strains as the closed form says, for lambda = 10 and 2000 in both forms",
      mutants=("traction-transposed", "normal-stress-halved"),
      ways="1", because="orders 2, 3: flow-inclusion-quadratic")
def inclusion() -> Outcome:
    studies, profiles = [], []
    for interface in ("traction", "laplacian"):
        for ratio in (10.0, 2000.0):
            errors = refine(_disc_errors, range(len(DISC_SIZES)), _problem(ratio, interface, 1), DISC_SIZES, DISC_DRAWS)
            where = f"lambda = {ratio:g}, {interface}"
            studies += [study(f"velocity, {where}", DISC_SIZES, errors["velocity"], 2, DISC_SECOND, ceiling=1e-3),
                        _pressure_study(f"pressure, {where}", DISC_SIZES, errors["pressure"], ratio)]
            profiles.append(_disc_profile(ratio, interface))
    return Outcome(studies=tuple(studies), profiles=tuple(profiles))


QUADRATIC_SIZES, QUADRATIC_DRAWS = (6.0, 3.0, 1.5, 0.75), (12, 8, 4, 1)
ROUND_SIZES, ROUND_DRAWS = {2: QUADRATIC_SIZES, 3: (8.0, 4.0, 2.0, 1.0)}, (6, 4, 2, 1)
SLOW = "from 2 (chords of the circle) or more down to 1 (the jump)"
#: Lowest and highest order, and largest last error, of the velocity where lambda = 2000 and the disc is round.
ROUND = {2: (2.5, 3.3, "third order in L2, from below while the circle has few edges", 5e-5),
         3: (0.9, 4.3, "from 4 (cubic elements) down to 1 (the jump)", 1e-5)}


@case("flow-inclusion-quadratic", kind="exact", slow=True,
      norm="root mean square over random meshes of a size, relative L2 of u and p",
      claim="Quadratic and cubic velocities show what the jump of the pressure costs: first order where the disc gives "
            "way, in both forms; a stiff disc shows the chords of its polygon, second order, or, round, the full order",
      mutants=("normal-stress-halved", "curved-straight-divergence"), ways="2 3", because="order 1: flow-inclusion")
def inclusion_quadratic() -> Outcome:
    soft, stiff = (refine(_disc_errors, range(len(DISC_SIZES)), _problem(ratio, "traction", 2), QUADRATIC_SIZES,
                          QUADRATIC_DRAWS) for ratio in (10.0, 2000.0))
    studies = [Study("velocity, lambda = 10", np.array(QUADRATIC_SIZES), soft["velocity"], 0.9, 1.8, SLOW, 1e-3),
               study("velocity, lambda = 2000", QUADRATIC_SIZES, stiff["velocity"], 2,
                     "chords of the circle: second order", ceiling=3e-4),
               _pressure_study("pressure, lambda = 10", QUADRATIC_SIZES, soft["pressure"]),
               _pressure_study("pressure, lambda = 2000", QUADRATIC_SIZES, stiff["pressure"])]
    for order in (2, 3):
        for interface in ("traction", "laplacian"):
            studies += _round_studies(order, interface)
    return Outcome(studies=tuple(studies))


def _round_studies(order: int, interface: str) -> list[Study]:
    """Of a disc bounded by arcs."""
    sizes, where = np.array(ROUND_SIZES[order]), f"round, order {order}, {interface}"
    soft, stiff = (refine(_disc_errors, range(len(sizes)), _problem(ratio, interface, order), sizes, ROUND_DRAWS,
                          meshes.round_disc) for ratio in (10.0, 2000.0))
    low, high, why, ceiling = ROUND[order]
    return [Study(f"velocity, lambda = 10, {where}", sizes, soft["velocity"], 0.9, 1.8, SLOW, 1e-3),
            Study(f"velocity, lambda = 2000, {where}", sizes, stiff["velocity"], low, high, why, ceiling),
            _pressure_study(f"pressure, lambda = 10, {where}", sizes, soft["pressure"]),
            _pressure_study(f"pressure, lambda = 2000, {where}", sizes, stiff["pressure"])]


def _pressure_study(name: str, sizes, errors, ratio: float = 10.0) -> Study:
    low, high, why = (0.35, 0.8, JUMP) if ratio == 10.0 else (0.35, 1.2, STIFF)
    return Study(name, np.array(sizes), errors, low, high, why, 0.3)


@cache
def _disc_grid(size: float, draw: int, kind=meshes.disc) -> Mesh:
    return kind(DISC_ENDS, WIDTH, size, CENTRE, DISC_RADIUS, seed=int(1000 * size) + draw)


def _problem(ratio: float, interface: str, order: int) -> Problem:
    def exact(x, y):
        return viscous_inclusion.fields(x - CENTRE[0], y - CENTRE[1], DISC_RADIUS, ratio, interface, ANGLE)

    return Problem(ratio, interface, order, exact)


def _disc_errors(level: int, problem: Problem, sizes, draws, kind=meshes.disc) -> dict[str, float]:
    return meshes.root_mean_square(lambda draw: boxes.errors(_disc_grid(sizes[level], draw, kind), problem),
                                   draws[level])


def _disc_profile(ratio: float, interface: str) -> Profile:
    """The velocity along y on a slanting line through the disc."""
    problem, grid, s = _problem(ratio, interface, 1), _disc_grid(DISC_SIZES[2], 0), np.linspace(-24.0, 24.0, 97)
    where = CENTRE + np.column_stack([0.9 * s, 0.5 * s])
    ours = norms.sample(grid.points, grid.triangles, boxes.solve(grid, problem)[0], where)
    exact = problem.exact(*where.T)[0]
    return Profile(f"lambda = {ratio:g}, {interface}", "along a line through the disc (um)", "u_y / (um per unit time)",
                   (("ours", "ours", s, ours[:, 1]), ("exact", "exact", s, exact[:, 1])))
