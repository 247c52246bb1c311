"""What no viscous flow may do, whatever its numbers: lose flux or energy, know its direction, gain by an obstacle."""

from __future__ import annotations

from functools import cache

import numpy as np

from repro.fem import geometry, mesh
from repro.fem.assembly import each, saddle_blocks
from repro.fem.mesh import PoreMesh
from repro.model import flow
from verification.case import Outcome, at_least, at_most, case
from verification.flow import grids

WIDTH, ENDS, RATIO = 50.0, (-75.0, 75.0), 2000.0


@cache
def _half_disc(radius: float, lean: float = 0.0, reach: float = 75.0) -> PoreMesh:
    """The mesh around a half-disc that is sheared by ``lean``."""
    seed = geometry.seed(radius)
    points = seed.points + lean * seed.points[:, [1]] * [1.0, 0.0]
    outline = geometry.Outline(points, seed.wall, seed.fixed, points)
    return mesh.generate(outline, (-reach, reach), geometry.Sizing(WIDTH, 1.0, 2.0))[0]


@case("flow-sections", kind="property", norm="largest relative error of the flux through 25 sections",
      claim="The same flux passes every section of a pore, plugged or not: to round-off for w = u - tau grad p",
      mutants=("tau-of-water", "carried-by-u-plus", "inlet-not-scaled"))
def sections() -> Outcome:
    plug = grids.channel(ENDS, WIDTH, 3.1, lambda x, y: np.abs(x) < 30, across=(-30.0, 30.0))
    checks = []
    for name, grid, drop in (("plug", plug, 0.003), ("half-disc of 40 um", _half_disc(40.0), 0.012),
                             ("half-disc of 46 um", _half_disc(46.0), 0.008)):
        found = flow.unit_flow(grid, RATIO)
        carried = found.velocity[grid.triangles].mean(axis=1) - found.correction
        checks += [at_most(f"w, {name}", _flux_error(grid, carried), 1e-9, "(2) tested with linear ramps, round-off"),
                   at_most(f"u, {name}", _flux_error(grid, carried + found.correction), drop,
                           "the defect of u on a coarse mesh, with margin (trap 3: 98 %)")]
    return Outcome(tuple(checks))


def _flux_error(grid: PoreMesh, carried: np.ndarray) -> float:
    """Largest error of the flux of a field (T, 2) through sections, each a ramp of linear functions."""
    worst = 0.0
    for x in np.linspace(-65.0, 65.0, 25):
        ramp = np.clip((x + 5.0 - grid.points[:, 0]) / 10.0, 0.0, 1.0)
        slope = np.einsum("tai,ta->ti", grid.gradients, ramp[grid.triangles])
        flux = -np.sum(grid.areas * np.sum(carried * slope, axis=1))
        worst = max(worst, abs(flux / grid.width - 1))
    return worst


@case("flow-energy", kind="property", norm="relative difference",
      claim="The work of the inlet is what viscosity and stabilisation dissipate, and the flow is linear in its drive",
      mutants=("correction-not-scaled",))
def energy() -> Outcome:
    grid = _half_disc(25.0)
    unit = flow.unit_flow(grid, RATIO)
    work, dissipated = _power(grid, unit)
    driven = [flow.scaled(unit, grid, 600.0, 3e-4, head=head, mean_velocity=None) for head in (10.0, 20.0)]
    twice = [abs(np.abs(b).max() / np.abs(a).max() - 2) for a, b in
             zip(*((f.velocity, f.head, f.correction) for f in driven))]
    return Outcome((at_most("work less dissipation", abs(work / dissipated - 1), 1e-9,
                            "symmetry of the weak form, round-off"),
                    at_most("twice the head, twice the flow", max(twice), 1e-12, "linearity, round-off"),
                    at_most("head given, head lost", abs(driven[0].head_loss / 10.0 - 1), 1e-12,
                            "linearity, round-off")))


def _power(grid: PoreMesh, unit: flow.UnitFlow) -> tuple[float, float]:
    """Work of the inlet's forces on the unit flow, and a(u, u) + (tau grad p, grad p)."""
    found = flow.forms(grid)
    dofs, viscosity = found.cells, np.where(grid.biomass, RATIO, 1.0)
    local = np.concatenate([unit.velocity[dofs, 0], unit.velocity[dofs, 1], unit.pressure[dofs]], axis=1)
    upper = np.einsum("tab,tbi,tai,t->", found.laplace, unit.velocity[dofs], unit.velocity[dofs], viscosity)
    blocks = saddle_blocks(flow._viscous(found, viscosity, "laplacian"), found.divergence,
                           each(0 * viscosity, found.laplace))
    force = np.bincount(dofs.ravel(), np.einsum("tij,tj->ti", blocks, local)[:, :3].ravel(), len(grid.points))
    tau = grid.circumdiameter**2 / (100.0 * viscosity)
    lower = np.einsum("tab,ta,tb,t->", found.laplace, unit.pressure[dofs], unit.pressure[dofs], tau)
    return float(force[grid.inlet] @ unit.velocity[grid.inlet, 0]), float(upper + lower)


@case("flow-reversed", kind="property", norm="L2 of the difference of both velocities, in the middle and everywhere",
      claim="Flow through a leaning aggregate is its mirror image's flow mirrored, since Stokes flow is reversible",
      mutants=("outlet-free",))
def reversed_flow() -> Outcome:
    grid = _half_disc(25.0, lean=0.6, reach=150.0)
    mirror = PoreMesh(grid.points * [-1.0, 1.0], grid.triangles[:, ::-1], grid.biomass, grid.loop, WIDTH, grid.ends)
    checks = []
    for interface in ("laplacian", "traction"):
        there, back = (flow.unit_flow(way, RATIO, interface=interface).velocity for way in (grid, mirror))
        apart = np.sum((there - back * [1.0, -1.0]) ** 2, axis=1)
        near = np.abs(grid.points[:, 0]) < 40
        for where, chosen, bound, why in (
                ("around the aggregate", near, 1e-6, "what differs at inlet and outlet decays like exp(-4.2 x / W)"),
                ("everywhere", near | True, 5e-4, "second order, in the layer where inlet and outlet differ")):
            size = np.sqrt(grid.lumped() @ (apart * chosen) / (grid.lumped() @ np.sum(there**2, axis=1)))
            checks.append(at_most(f"difference {where}, {interface}", size, bound, why))
    return Outcome(tuple(checks))


RATIOS = np.array([1.0, 2.0, 10.0, 100.0, 2000.0, 1e5])


@case("flow-obstacle", kind="property", norm="head losses for six lambda, over that of the clean channel",
      claim="Viscous biomass never raises the conductivity: the loss rises with lambda, ever more slowly, and with R",
      mutants=("thin-biomass",))
def obstacle() -> Outcome:
    losses = np.array([[flow.unit_flow(_half_disc(radius), ratio).loss for ratio in RATIOS]
                       for radius in (5.0, 25.0, 40.0, 46.0)])
    slopes = np.diff(losses, axis=1) / np.diff(RATIOS)
    why = "least dissipation (Helmholtz): the loss is the least of functions that are linear in lambda"
    return Outcome((at_least("least rise with lambda, over the loss", (np.diff(losses, axis=1) / losses[:, 1:]).min(),
                             0.0, why),
                    at_most("largest slope over the one before", (slopes[:, 1:] / slopes[:, :-1]).max(), 1.0, why),
                    at_least("least rise with R at lambda = 2000, over the loss",
                             (np.diff(losses[:, 4]) / losses[1:, 4]).min(), 0.0, "nested obstacles: " + why)))
