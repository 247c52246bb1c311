"""Flow (2.1, 3.2) against closed forms and against Taylor-Hood elements of scikit-fem on curved meshes of their own.

The stabilised pressure meets a condition that is not its own at inlet and outlet, dp/dn = 0, in a layer of one element:
velocities are of second order, but the head loss (6), a difference of mean pressures *at* both ends, is of first order.
"""

from __future__ import annotations

from functools import cache

import numpy as np

from reference import layered_channel, poiseuille, taylor_hood
from repro import flow, geometry, mesh
from repro.assembly import each, saddle_blocks
from verification import meshes, norms
from verification.case import Outcome, Profile, at_most, case
from verification.convergence import refine, study

WIDTH, ENDS, LAMBDA = 50.0, (-75.0, 75.0), 2000.0
REFINEMENTS = (0.8, 1.25, 2.0, 3.2)
SECOND = "linear elements: second order in L2"
JUMP = "3/2: the head jumps at the interface, a continuous one cannot (lambda = 2000 hides it: almost a rigid body)"
ENDS_FIRST = "first order: the stabilisation's own condition dp/dn = 0 at both ends spoils one layer of elements"


def _channel_velocity(x, y):
    return np.stack([poiseuille.velocity(y, WIDTH), 0 * y], axis=-1)


@case("flow-poiseuille", kind="exact", norm="L2 of u over the mesh; relative error of the head loss",
      claim="In a clean channel the flow is plane Poiseuille's",
      mutants=("saddle-sign",))
def poiseuille_channel() -> Outcome:
    errors = refine(_clean, REFINEMENTS)
    studies = (study("velocity", errors["size"], errors["velocity"], 2, SECOND, ceiling=1e-3),
               study("head loss", errors["size"], errors["loss"], 1, ENDS_FIRST, ceiling=1e-2))
    return Outcome(studies=studies)


def _clean(refinement: float) -> dict[str, float]:
    grid, _ = mesh.generate(None, ENDS, WIDTH, refinement, 2.0)
    found = flow.scaled(flow.unit_flow(grid, 1.0), grid, 600.0, 3e-4, head=None, mean_velocity=2.0)
    exact = poiseuille.head_loss(ENDS[1] - ENDS[0], WIDTH, 2.0, 3e-4)
    velocity = norms.l2_error(grid.points, grid.triangles, found.velocity, lambda x, y: 2 * _channel_velocity(x, y))
    return {"size": norms.mean_size(grid), "velocity": velocity, "loss": abs(found.meshed_loss / exact - 1)}


LAYER, LAYER_END, MIDDLE = 12.5, 110.0, 15.0
LAYER_SIZES = LAYER / np.array([3, 4.6, 7, 11])
DRAWS = 3


@case("flow-layers", kind="exact", norm="middle of a long layer, root mean square over three random meshes a size: "
      "L2 of u, of u within the layer (relative to that), and relative error of the pressure gradient",
      claim="Along a layer of biomass the flow is that of two viscous layers, for lambda = 1, 2000 and 1e8",
      mutants=("tau-of-water",))
def layers() -> Outcome:
    studies, profiles = [], []
    for ratio in (1.0, LAMBDA, 1e8):
        errors = refine(_layered_draws, LAYER_SIZES, ratio)
        for name, ceiling in (("velocity", 2e-3), ("velocity in the layer", 1e-2), ("gradient", 4e-3)):
            studies.append(study(f"{name}, lambda = {ratio:g}", errors["size"], errors[name], 2, SECOND,
                                 ceiling=ceiling))
        profiles.append(_layer_profile(ratio))
    return Outcome(studies=tuple(studies), profiles=tuple(profiles))


def _layered_draws(size: float, ratio: float) -> dict[str, float]:
    """Root mean square of each error over several meshes of one size."""
    rows = [_layered(size, ratio, draw) for draw in range(DRAWS)]
    return {name: float(np.sqrt(np.mean([row[name] ** 2 for row in rows]))) for name in rows[0]}


@cache
def _layer_mesh(size: float, draw: int):
    ends = (-LAYER_END - 25.0, LAYER_END + 25.0)
    return meshes.channel(ends, WIDTH, size, lambda x, y: (y < LAYER) & (np.abs(x) < LAYER_END),
                          across=(-LAYER_END, LAYER_END), along=(LAYER,), seed=int(1000 * size) + draw)


def _layered(size: float, ratio: float, draw: int) -> dict[str, float]:
    grid = _layer_mesh(size, draw)
    found = flow.unit_flow(grid, ratio)
    middle = np.abs(grid.points[grid.triangles, 0].mean(axis=1)) < MIDDLE

    def exact(x, y):
        return np.stack([layered_channel.velocity(y, WIDTH, LAYER, ratio), 0 * y], axis=-1)

    gradient = layered_channel.gradient(WIDTH, LAYER, ratio)
    return {"size": size, "velocity": norms.l2_error(grid.points, grid.triangles[middle], found.velocity, exact),
            "velocity in the layer": norms.l2_error(grid.points, grid.triangles[middle & grid.biomass],
                                                    found.velocity, exact),
            "gradient": abs(_slope(grid, grid.triangles[middle], found.pressure) / gradient - 1)}


def _slope(grid, triangles, pressure) -> float:
    """-dp/dx by least squares over some triangles."""
    where, weight, shape = norms.quadrature(grid.points, triangles)
    x, p = where[..., 0], np.einsum("qa,ta->tq", shape, pressure[triangles])
    x = x - np.sum(weight * x) / weight.sum()
    return float(-np.sum(weight * p * x) / np.sum(weight * x**2))


def _layer_profile(ratio: float) -> Profile:
    grid, y = _layer_mesh(LAYER_SIZES[1], 0), np.linspace(0.0, WIDTH, 101)
    where = np.column_stack([np.zeros_like(y), y])
    ours = norms.sample(grid.points, grid.triangles, flow.unit_flow(grid, ratio).velocity[:, 0], where)
    exact = layered_channel.velocity(y, WIDTH, LAYER, ratio)
    return Profile(f"lambda = {ratio:g}", "y (um)", "u_x / u_ave",
                   (("ours", "ours", y, ours), ("exact", "exact", y, exact)))


PLUG_SIZES = (5.0, 3.1, 2.0, 1.25)


def _plugged(size: float):
    return meshes.channel(ENDS, WIDTH, size, lambda x, y: np.abs(x) < 30, across=(-30.0, 30.0), seed=int(100 * size))


@case("flow-plug", kind="exact", norm="L2 of u over the mesh; relative error of the head loss",
      claim="Through a plug the Laplacian form keeps Poiseuille's profile and loses lambda times its head there",
      mutants=("tau-of-water",))
def plug() -> Outcome:
    errors = refine(_plug_errors, PLUG_SIZES)
    return Outcome(studies=(study("velocity", PLUG_SIZES, errors["velocity"], 2, SECOND, ceiling=1e-3),
                            study("head loss", PLUG_SIZES, errors["loss"], 2, "the plug's inside outweighs the ends",
                                  ceiling=2e-3)))


def _plug_errors(size: float) -> dict[str, float]:
    grid = _plugged(size)
    found = flow.unit_flow(grid, LAMBDA)
    exact = poiseuille.head_loss(90.0, WIDTH, 1.0, 1.0) + poiseuille.head_loss(60.0, WIDTH, 1.0, LAMBDA)
    return {"velocity": norms.l2_error(grid.points, grid.triangles, found.velocity, _channel_velocity),
            "loss": abs(found.loss / exact - 1)}


@case("flow-sections", kind="property", norm="largest relative error of the flux through 25 sections",
      claim="The same flux passes every section of a pore, plugged or not: to round-off for w = u - tau grad p",
      mutants=("tau-of-water", "carried-by-u-plus", "inlet-not-scaled"))
def sections() -> Outcome:
    half_disc, _ = mesh.generate(geometry.seed(40.0), ENDS, WIDTH, 1.0, 2.0)
    checks = []
    for name, grid, drop in (("plug", _plugged(3.1), 0.005), ("half-disc of 40 um", half_disc, 0.05)):
        found = flow.unit_flow(grid, LAMBDA)
        carried = found.velocity[grid.triangles].mean(axis=1) - found.correction
        checks += [at_most(f"w, {name}", _flux_error(grid, carried), 1e-9, "(2) tested with linear ramps, round-off"),
                   at_most(f"u, {name}", _flux_error(grid, carried + found.correction), drop,
                           "the defect of u on a coarse mesh, with margin (trap 3: 98 %)")]
    return Outcome(tuple(checks))


def _flux_error(grid, carried: np.ndarray) -> float:
    """Largest error of the flux of a field (T, 2) through sections, each a ramp of linear functions."""
    worst = 0.0
    for x in np.linspace(-65.0, 65.0, 25):
        ramp = np.clip((x + 5.0 - grid.points[:, 0]) / 10.0, 0.0, 1.0)
        slope = np.einsum("tai,ta->ti", grid.gradients, ramp[grid.triangles])
        flux = -np.sum(grid.areas * np.sum(carried * slope, axis=1))
        worst = max(worst, abs(flux / grid.width - 1))
    return worst


@cache
def _taylor_hood(radius: float, ratio: float = LAMBDA, interface: str = "laplacian"):
    return taylor_hood.stokes(taylor_hood.half_disc(WIDTH, ENDS, radius, 2, 8), ratio, interface)


def _against_taylor_hood(refinement: float, radius: float, ratio: float, interface: str) -> dict[str, float]:
    grid, _ = mesh.generate(geometry.seed(radius, refinement), ENDS, WIDTH, refinement, 2.0)
    found, trusted = flow.unit_flow(grid, ratio, interface=interface), _taylor_hood(radius, ratio, interface)
    apart = norms.sample(grid.points, grid.triangles, found.velocity, trusted.points) - trusted.velocity
    size, area = np.sum(trusted.velocity**2, axis=1), trusted.areas
    return {"size": norms.mean_size(grid), "loss": abs(found.loss / trusted.loss - 1),
            "velocity": float(np.sqrt(np.sum(area * np.sum(apart**2, axis=1)) / np.sum(area * size)))}


@case("flow-half-disc", kind="cross-code", norm="L2 of the difference in u, and relative difference of the head loss",
      claim="Around a half-disc in the paper's pore velocity and head loss are Taylor-Hood's, in both forms of [E2]",
      mutants=("traction-transposed",))
def half_disc() -> Outcome:
    studies = []
    for radius, ratio, interface, order, why in ((5.0, LAMBDA, "laplacian", 2, SECOND),
                                                 (25.0, LAMBDA, "laplacian", 2, SECOND),
                                                 (40.0, 10.0, "traction", 1.5, JUMP)):
        errors = refine(_against_taylor_hood, REFINEMENTS, radius, ratio, interface)
        where = f"R = {radius:g} um, lambda = {ratio:g}, {interface}"
        studies.append(study(f"velocity, {where}", errors["size"], errors["velocity"], order, why, ceiling=1e-3))
        if radius == 5.0:
            studies.append(study(f"head loss, {where}", errors["size"], errors["loss"], 1, ENDS_FIRST, ceiling=1e-2))
    return Outcome(studies=tuple(studies))


@case("flow-half-disc-quadratic", kind="cross-code", norm="relative difference of the head loss",
      claim="The same forms with quadratic velocities give Taylor-Hood's head loss to 0.1 %",
      mutants=("quadratic-stabilised",))
def half_disc_quadratic() -> Outcome:
    def measure(refinement):
        grid, _ = mesh.generate(geometry.seed(25.0, refinement), ENDS, WIDTH, refinement, 2.0)
        return {"size": norms.mean_size(grid),
                "loss": abs(flow.unit_flow(grid, LAMBDA, order=2).loss / _taylor_hood(25.0).loss - 1)}

    errors = refine(measure, (0.5, 0.8, 1.25, 2.0))
    return Outcome(studies=(study("head loss", errors["size"], errors["loss"], 2, "the chords of the arc: second order",
                                  ceiling=1e-3),))


@case("flow-energy", kind="property", norm="relative difference",
      claim="The work of the inlet is what viscosity and stabilisation dissipate, and the flow is linear in its drive",
      mutants=("correction-not-scaled",))
def energy() -> Outcome:
    grid, _ = mesh.generate(geometry.seed(25.0), ENDS, WIDTH, 1.0, 2.0)
    unit = flow.unit_flow(grid, LAMBDA)
    work, dissipated = _power(grid, unit)
    driven = [flow.scaled(unit, grid, 600.0, 3e-4, head=head, mean_velocity=None) for head in (10.0, 20.0)]
    twice = [abs(np.abs(b).max() / np.abs(a).max() - 2) for a, b in
             zip(*((f.velocity, f.head, f.correction) for f in driven))]
    return Outcome((at_most("work less dissipation", abs(work / dissipated - 1), 1e-9,
                            "symmetry of the weak form, round-off"),
                    at_most("twice the head, twice the flow", max(twice), 1e-12, "linearity, round-off"),
                    at_most("head given, head lost", abs(driven[0].head_loss / 10.0 - 1), 1e-12,
                            "linearity, round-off")))


def _power(grid, unit) -> tuple[float, float]:
    """Work of the inlet's forces on the unit flow, and a(u, u) + (tau grad p, grad p)."""
    found = flow.forms(grid)
    dofs, viscosity = found.basis.element_dofs.T, np.where(grid.biomass, LAMBDA, 1.0)
    local = np.concatenate([unit.velocity[dofs, 0], unit.velocity[dofs, 1], unit.pressure[dofs]], axis=1)
    upper = np.einsum("tab,tbi,tai,t->", found.laplace, unit.velocity[dofs], unit.velocity[dofs], viscosity)
    blocks = saddle_blocks(flow._viscous(found, viscosity, "laplacian"), found.divergence,
                           each(0 * viscosity, found.laplace))
    force = np.bincount(dofs.ravel(), np.einsum("tij,tj->ti", blocks, local)[:, :3].ravel(), len(grid.points))
    tau = grid.circumdiameter**2 / (100.0 * viscosity)
    lower = np.einsum("tab,ta,tb,t->", found.laplace, unit.pressure[dofs], unit.pressure[dofs], tau)
    return float(force[grid.inlet] @ unit.velocity[grid.inlet, 0]), float(upper + lower)
