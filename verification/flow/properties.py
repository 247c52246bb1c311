"""What no viscous flow may do, whatever its numbers: lose flux or energy, know its direction, gain by an obstacle.

Element sizes that grow with the distance from the aggregate, against one size everywhere.
"""

from __future__ import annotations

from functools import cache, partial
from itertools import product

import numpy as np

from repro.fem import elements
from repro.fem.assembly import saddle_blocks
from repro.fem.mesh import Mesh
from repro.fem.space import Space
from repro.model import flow, pore
from repro.scene import parse_scene
from verification.flow.closed_forms import LENGTH, drive
from verification.kernel.case import Check, Outcome, at_least, at_most, between, case
from verification.problems import meshes, norms

WIDTH, ENDS, RATIO = 50.0, (-75.0, 75.0), 2000.0
FORMS = ("laplacian", "traction")
#: Every order with both forms, by label.
EVERY = {f"order {order}, {form}": (order, form) for order in (1, 2, 3) for form in FORMS}
HIGHER = {label: given for label, given in EVERY.items() if given[0] > 1}
#: Refinement of the meshes of each order.
REFINED = {1: 1.0, 2: 0.5, 3: 0.4}


@cache
def _half_disc(radius: float, order: int = 1, lean: float = 0.0, reach: float = 75.0) -> Space:
    """Functions of an order on the mesh around a half-disc that is sheared by ``lean``."""
    return Space(meshes.half_disc(radius, REFINED[order], (-reach, reach), WIDTH, geometry=min(order, 2), lean=lean),
                 order)


@cache
def _plugged(order: int) -> Space:
    return meshes.space_on(meshes.plug(ENDS, WIDTH, 30.0, 3.1 if order == 1 else 6.0, meshes.cut), order)


@case("flow-sections", kind="property", norm="largest relative error of the flux through 25 sections",
      claim="The same flux passes every section of a pore, plugged or not: to round-off for w = u - tau grad p of "
            "linear elements and for u itself of quadratic and cubic ones, in both forms",
      mutants=("tau-of-water", "carried-by-u-plus", "inlet-not-scaled", "curved-straight-divergence",
               "inlet-parabola"), ways="1 2 3")
def sections() -> Outcome:
    checks, why = [], "(2) tested with linear ramps, round-off"
    pores = {"plug": (_plugged, 0.003), "half-disc of 40 um": (partial(_half_disc, 40.0), 0.012),
             "half-disc of 46 um": (partial(_half_disc, 46.0), 0.008)}
    for name, (of, drop) in pores.items():
        grid, linear = of(1).mesh, flow.unit_flow(of(1), RATIO)
        carried = linear.velocity[grid.triangles].mean(axis=1) - linear.correction
        checks += [at_most(f"w, {name}", flux_error(grid, carried), 1e-9, why),
                   at_most(f"u, {name}", flux_error(grid, carried + linear.correction), drop,
                           "the defect of u on a coarse mesh, with margin")]
        for order, interface in product((2, 3), FORMS):
            found = flow.unit_flow(of(order), RATIO, interface=interface)
            checks.append(at_most(f"u, {name}, order {order}, {interface}", _carried_error(of(order), found.velocity),
                                  1e-9, why))
    return Outcome(tuple(checks))


def _ramps(grid: Mesh):
    """Values at the corners of functions that fall from one at the inlet to zero at the outlet, one for each section.
    """
    for x in np.linspace(-65.0, 65.0, 25):
        yield np.clip((x + 5.0 - grid.points[: grid.corners, 0]) / 10.0, 0.0, 1.0)


def flux_error(grid: Mesh, carried: np.ndarray) -> float:
    """Largest error of the flux of a field (T, 2) through sections, each a ramp of linear functions."""
    worst = 0.0
    for ramp in _ramps(grid):
        slope = np.einsum("tai,ta->ti", grid.gradients, ramp[grid.triangles])
        flux = -np.sum(grid.areas * np.sum(carried * slope, axis=1))
        worst = max(worst, abs(flux / grid.width - 1))
    return worst


def _carried_error(space: Space, velocity: np.ndarray) -> float:
    """The same of a velocity (n, 2) at the nodes of a space."""
    grid, worst = space.mesh, 0.0
    _, weight, shape = norms.fine(space)
    at = np.einsum("qa,tai->tqi", shape, velocity[space.cells])
    linear = elements.points(grid.points[grid.cells], elements.table(1, grid.geometry, norms.FINE)).slopes
    for ramp in _ramps(grid):
        slope = np.einsum("tqia,ta->tqi", linear, ramp[grid.triangles])
        flux = -np.sum(weight * np.sum(at * slope, axis=2))
        worst = max(worst, abs(flux / grid.width - 1))
    return worst


@case("flow-energy", kind="property", norm="relative difference",
      claim="The work of the inlet is what viscosity and stabilisation dissipate, of order 2 and 3 the head loss times "
            "the flux, and the flow is linear in its drive",
      mutants=("correction-not-scaled", "loss-per-width"), over=EVERY)
def energy(order: int, interface: str):
    space = _half_disc(25.0, order)
    unit = flow.unit_flow(space, RATIO, interface=interface)
    work, dissipated = _power(space, unit, interface)
    driven = [flow.scaled(unit, space.mesh, LENGTH, drive(head=head)) for head in (10.0, 20.0)]
    yield at_most("work less dissipation", abs(work / dissipated - 1), 1e-9, "symmetry of the weak form, round-off")
    yield at_most("twice the head, twice the flow", _off_twice(*driven), 1e-12, "linearity, round-off")
    yield at_most("head given, head lost", abs(driven[0].head_loss / 10.0 - 1), 1e-12, "linearity, round-off")
    if order > 1:
        yield at_most("loss times flux", abs(unit.loss * WIDTH / dissipated - 1), 1e-9,
                      "the loss is the work of the inlet, round-off")


def _off_twice(once: flow.Flow, twice: flow.Flow) -> float:
    """By how much the ratios of the fields of two flows differ from two."""
    fields = [(getattr(once, name), getattr(twice, name)) for name in ("velocity", "head", "correction")]
    return max(abs(np.abs(b).max() / np.abs(a).max() - 2) for a, b in fields if a is not None)


def _power(space: Space, unit: flow.UnitFlow, interface: str) -> tuple[float, float]:
    """Work of the inlet's forces on the unit flow, and a(u, u) + (tau grad p, grad p)."""
    grid, cells, pressure = space.mesh, space.cells, flow.pressure_space(space).cells
    viscosity, count = np.where(grid.biomass, RATIO, 1.0), space.cells.shape[1]
    blocks = saddle_blocks(flow.viscous(space, viscosity, interface), flow.divergence(space))
    local = np.concatenate([unit.velocity[cells, 0], unit.velocity[cells, 1], unit.pressure[pressure]], axis=1)
    moving = local[:, : 2 * count]
    upper = np.einsum("tab,ta,tb->", blocks[:, : 2 * count, : 2 * count], moving, moving)
    force = np.bincount(cells.ravel(), np.einsum("tij,tj->ti", blocks, local)[:, :count].ravel(), space.count)
    inlet = space.end_nodes(space.dofs.inlet)
    work = float(force[inlet] @ unit.velocity[inlet, 0])
    if space.order > 1:
        return work, float(upper)
    tau = grid.circumdiameter**2 / (100.0 * viscosity)
    slope = np.einsum("tai,ta->ti", grid.gradients, unit.pressure[grid.triangles])
    return work, float(upper + np.sum(tau * grid.areas * np.sum(slope**2, axis=1)))


@case("flow-reversed", kind="property", norm="L2 of the difference of both velocities, in the middle and everywhere",
      claim="Flow through a leaning aggregate is its mirror image's flow mirrored, since Stokes flow is reversible",
      mutants=("outlet-free",), over=EVERY)
def reversed_flow(order: int, interface: str):
    space = _half_disc(25.0, order, lean=0.6, reach=150.0)
    mirror = Space(_mirrored(space.mesh), order)
    there, back = (flow.unit_flow(way, RATIO, interface=interface).velocity for way in (space, mirror))
    near = np.abs(space.mesh.points[space.mesh.triangles, 0]).max(axis=1) < 40
    for where, chosen, bound, why in (
            ("around the aggregate", near, 1e-6, "what differs at inlet and outlet decays like exp(-4.2 x / W)"),
            ("everywhere", near | True, 5e-4, "second order, in the layer where inlet and outlet differ")):
        size = _size(space, there - back * [1.0, -1.0], chosen) / _size(space, there, near | True)
        yield at_most(f"difference {where}", size, bound, why)


def _mirrored(grid: Mesh) -> Mesh:
    """The mesh with inlet and outlet exchanged, nodes numbered as before."""
    cells = grid.cells[:, [2, 1, 0, 4, 3, 5][: grid.cells.shape[1]]]
    return Mesh.of(grid.points * [-1.0, 1.0], cells, grid.biomass, grid.loop, WIDTH, grid.ends)


def _size(space: Space, field: np.ndarray, chosen: np.ndarray) -> float:
    """L2 norm of a field (n, 2) over the triangles ``chosen``."""
    _, weight, shape = norms.fine(space, chosen)
    at = np.einsum("qa,tai->tqi", shape, field[space.cells[chosen]])
    return float(np.sqrt(np.sum(weight[..., None] * at**2)))


RATIOS = np.array([1.0, 2.0, 10.0, 100.0, 2000.0, 1e5])


@case("flow-obstacle", kind="property", norm="head losses for six lambda, over that of the clean channel",
      claim="Viscous biomass never raises the conductivity: the loss rises with lambda, ever more slowly, and with R",
      mutants=("thin-biomass",), over=EVERY)
def obstacle(order: int, interface: str):
    """Losses of four half-discs."""
    losses = np.array([[flow.unit_flow(_half_disc(radius, order), ratio, interface=interface).loss for ratio in RATIOS]
                       for radius in (5.0, 25.0, 40.0, 46.0)])
    slopes = np.diff(losses, axis=1) / np.diff(RATIOS)
    why = "least dissipation (Helmholtz): the loss is the least of functions that are linear in lambda"
    return [at_least("least rise with lambda, over the loss",
                     (np.diff(losses, axis=1) / losses[:, 1:]).min(), 0.0, why),
            at_most("largest slope over the one before", (slopes[:, 1:] / slopes[:, :-1]).max(), 1.0, why),
            at_least("least rise with R at lambda = 2000, over the loss",
                     (np.diff(losses[:, 4]) / losses[1:, 4]).min(), 0.0, "nested obstacles: " + why)]


#: Weights of the nodes of an edge, exact for polynomials of the order.
SIMPSON = {2: np.array([1, 4, 1]) / 6, 3: np.array([1, 3, 3, 1]) / 8}


@case("flow-curved-flux", kind="property", norm="flux through sections over that of the inlet",
      claim="What comes in goes through every section, order 2 and 3 and both forms: exactly at the outlet, and as "
            "well as the mesh resolves it across the aggregate",
      mutants=("curved-straight-divergence",), over=HIGHER, because="order 1: flow-sections")
def curved_flux(order: int, interface: str):
    """Fluxes by the midpoint rule across the pore, and over the outlet by Simpson's rules."""
    space = Space(meshes.half_disc(20.0, 1.2, ENDS, WIDTH, geometry=2), order)
    velocity = flow.unit_flow(space, RATIO, interface=interface).velocity
    y = (np.arange(2000) + 0.5) / 2000 * WIDTH
    out = space.end_lengths(space.dofs.outlet) @ velocity[space.dofs.outlet, 0] @ SIMPSON[order] / WIDTH
    checks = [_whole("outlet", out, 1e-11, "q = 1: round-off")]
    for x in (-40.0, -20.0, -7.0, 0.0, 13.0, 33.0):
        through = norms.field_at(space, velocity, np.column_stack([np.full(len(y), x), y]))[:, 0].mean()
        checks.append(_whole(f"x = {x:g} um", through, 1e-4,
                             "div u vanishes in the mean only of each test function: third order"))
    return checks


def _whole(name: str, value: float, apart: float, why: str) -> Check:
    return between(name, value, 1 - apart, 1 + apart, why)


SCHEMES = {"paper": ({"preset": "paper"}, 5e-3), "accurate": ({"preset": "accurate"}, 1e-3),
           "cubic": ({"preset": "accurate", "elements": "cubic"}, 1e-3)}


@case("flow-graded", kind="property",
      norm="relative difference of the loss; nodes over those of graded sizes; largest over least edge",
      claim="With one element size everywhere the loss of a half-disc is that of sizes which grow with the distance "
            "from it, for more than twice the nodes, on straight triangles and on curved ones of order 2 and 3",
      mutants=("gradation-ignored", "gradation-not-passed"), over=SCHEMES, ways="1 2",
      because="fast: elements as of accurate")
def graded(numerics: dict[str, str], bound: float):
    (loss, nodes), (even, many) = (_graded_half_disc(numerics, gradation) for gradation in (0.25, 0.0))
    return (at_most("loss", abs(loss / even - 1), bound,
                    "errors near the aggregate rule: those of the preset's elements there"),
            at_most("nodes", nodes / many, 0.5, "half"))


def _graded_half_disc(numerics: dict[str, str], gradation: float) -> tuple[float, int]:
    """Loss of the pore and nodes of its mesh."""
    tables = {"pore": {"width": "50 um"}, "aggregate": {"radius": "10 um"},
              "flow": {"mean_velocity": "2.9 m/day"}, "numerics": {**numerics, "gradation": gradation}}
    scene = parse_scene(tables, "half disc", "half_disc.toml")
    now = pore.seeded(scene)
    return pore.solve(scene, now).flow.head_loss, len(now.mesh.points)
