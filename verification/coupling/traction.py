"""The fluid's traction on the aggregate (20), (22): its balance, a closed form, and how little it does in base."""

from __future__ import annotations

from functools import cache

import numpy as np

from reference import layered_channel
from repro.fem import geometry
from repro.fem.mesh import PoreMesh
from repro.march import coupling
from repro.model import flow, pore, shape, traction
from repro.model.flow import Flow
from verification.case import Outcome, at_least, at_most, case
from verification.convergence import refine, study
from verification.coupling import runs
from verification.flow import grids, layers

FORMS = ("laplacian", "traction")
BOTH_ENDS = "the momentum balance of the solver's own equations: round-off"
REFINEMENTS = (1.0, 1.4, 2.0, 2.8)


def loaded_scene(*changes: str, radius: float = 25.0):
    return runs.base("1 h", f'aggregate.radius="{radius} um"', 'growth.fluid_forces="included"', *changes)


def nodal(scene, now: pore.Pore) -> tuple[np.ndarray, Flow]:
    """Nodal forces (N, 2) um2 of head in the geometry of a pore, and its flow."""
    found = pore.solve_flow(scene, now)
    viscosity = scene.flow.kinematic_viscosity / scene.flow.gravity
    return traction.nodal(now.mesh, found, viscosity, scene.numerics.interface), found


@case("coupling-traction-balance", kind="property",
      norm="x-force on the interface against minus that by the aggregate's own triangles, and forces at nodes within "
           "the fluid, over the largest; drag on a half-disc over head loss times W less wall shear, less 1",
      claim="What the fluid does to the aggregate the aggregate does to the fluid; no force is left in the fluid; the "
            "drag is what the ends' pressure and the walls' shear leave over",
      mutants=("traction-pressure-left-out", "traction-form-mixed", "traction-of-both-phases"))
def balance() -> Outcome:
    checks = []
    for form in FORMS:
        scene = loaded_scene(f'numerics.interface="{form}"')
        now = pore.seeded(scene)
        on, found = nodal(scene, now)
        inside = np.setdiff1d(now.mesh.fluid, np.concatenate([now.mesh.walls, now.mesh.inlet, now.mesh.outlet,
                                                              now.mesh.body]))
        free = now.mesh.loop[now.wall == geometry.FREE]
        checks += [at_most(f"force within the fluid, {form}", np.abs(on[inside]).max() / np.abs(on[free]).max(), 1e-9,
                           BOTH_ENDS),
                   at_most(f"action and reaction, {form}", np.abs(on[free] + _by_biomass(scene, now, found)[free]).max()
                           / np.abs(on[free]).max(), 1e-9, BOTH_ENDS)]
    errors = refine(_drag_error, REFINEMENTS)
    return Outcome(tuple(checks), (study("drag", 1 / np.array(REFINEMENTS), errors["drag"], 1,
                                         "shear from the slopes of linear triangles: first order"),))


def _by_biomass(scene, now: pore.Pore, found: Flow) -> np.ndarray:
    """(N, 2) um2 of head: forces of the biomass' triangles, lambda times as viscous, triangle by triangle."""
    viscosity = scene.flow.viscosity_ratio * scene.flow.kinematic_viscosity / scene.flow.gravity
    total = np.zeros_like(now.mesh.points)
    for nodes, area, slope in zip(now.mesh.triangles[now.mesh.biomass], now.mesh.areas[now.mesh.biomass],
                                  now.mesh.gradients[now.mesh.biomass]):
        grad = found.velocity[nodes].T @ slope
        if scene.numerics.interface == "traction":
            grad = grad + grad.T
        total[nodes] += area * slope @ (found.head[nodes].mean() * np.eye(2) - viscosity * grad).T
    return total


def _drag_error(refinement: float) -> dict[str, float]:
    """The drag on a half-disc against head loss times W less the shear on the walls, from the slopes beside them."""
    scene = loaded_scene(f"numerics.refinement={refinement}")
    now = pore.seeded(scene)
    on, found = nodal(scene, now)
    viscosity = scene.flow.kinematic_viscosity / scene.flow.gravity
    left = found.meshed_loss * now.mesh.width - viscosity * _wall_shear(now.mesh, found.velocity)
    return {"drag": abs(on[now.mesh.loop, 0].sum() / left - 1)}


def _wall_shear(grid: PoreMesh, velocity: np.ndarray) -> float:
    """Integral of |du_x/dy| over the fluid's part of both walls, um/h."""
    total = 0.0
    for nodes, slope, wet in zip(grid.triangles, grid.gradients, ~grid.biomass):
        y = grid.points[nodes, 1]
        for wall, sign in ((0.0, 1.0), (grid.width, -1.0)):
            on = y == wall
            if wet and np.count_nonzero(on) == 2:
                total += sign * np.ptp(grid.points[nodes[on], 0]) * (velocity[nodes, 0] @ slope[:, 1])
    return total


@case("coupling-traction-layer", kind="exact",
      norm="x-force on the middle of a layer of biomass, lambda = 2000, over the shear stress of two viscous layers, "
           "less 1, root mean square over random meshes of a size",
      claim="The shear that the fluid exerts on a layer of biomass is that of two viscous layers",
      mutants=("traction-pressure-left-out", "traction-transposed-gradient"))
def layer() -> Outcome:
    errors = refine(lambda level: grids.root_mean_square(lambda draw: {"shear": _shear_error(level, draw)},
                                                         LAYER_DRAWS[level]), range(len(layers.SIZES)))
    return Outcome(studies=(study("shear", layers.SIZES, errors["shear"], 2, "forces as residuals of linear elements: "
                                  "second order, as the flux", ceiling=1e-3),))


LAYER_DRAWS = (16, 12, 6, 2)


def _shear_error(level: int, draw: int) -> float:
    grid, ratio, half = layers._grid(level, draw), 2000.0, 40.0
    found = flow.unit_flow(grid, ratio)
    as_flow = Flow(1.0, found.velocity, found.pressure, found.correction, 1.0, 1.0, 1.0)
    on = traction.nodal(grid, as_flow, 1.0, "laplacian")
    line = np.flatnonzero((grid.points[:, 1] == layers.LAYER) & (np.abs(grid.points[:, 0]) < layers.LAYER_END))
    line = line[np.argsort(grid.points[line, 0])]
    x = grid.points[line, 0]
    weight = np.clip((half + 10 - np.abs(x)) / 10, 0, 1)  # level, then ramps: the sum is a tested integral
    length = np.trapezoid(weight, x)
    gradient = layered_channel.gradient(layers.WIDTH, layers.LAYER, ratio)
    exact = gradient * (layered_channel._stress(layers.WIDTH, layers.LAYER, ratio) - layers.LAYER)
    return float(weight @ on[line, 0] / length / exact - 1)


@case("coupling-traction-base", kind="property",
      norm="base at 4, 10 and 16 h, steps of 24 min: largest move of the interface by the fluid in the next step, over "
           "the thickness",
      claim="The fluid's forces are small against those of growth (C26): they move base's interface by less than 1e-4",
      mutants=("density-squared", "forces-thousandfold"))
def small_in_base() -> Outcome:
    moves = [_move_in_base(hours) for hours in (4, 10, 16)]
    return Outcome((at_most("largest move", max(moves), 1e-4, "0.1 Pa of the fluid on a stiffness of 2 to 10 kPa, some "
                            "times for the slender shape"),
                    at_least("least move", min(moves), 1e-7, "else no force has acted")))


@cache
def _pores(end: int) -> coupling.Instant:
    return runs.last(runs.base(f"{end} h", 'growth.time_step="24 min"', "numerics.refinement=0.6"))


def _move_in_base(hours: int) -> float:
    """Both from the same pore: on the same mesh."""
    found = _pores(hours)
    shapes = []
    for word in ("neglected", "included"):
        scene = runs.base(f"{hours} h", "numerics.refinement=0.6", f'growth.fluid_forces="{word}"')
        grown, _, _ = coupling.make_biomass(scene, found.pore, found.solved, 0.4)
        theta = grown.theta * (1 + coupling.increase(found.pore, grown) / scene.kinetics.maximum_density)
        shapes.append(shape.expand(scene, grown, theta)[0])
    return float(np.abs(shapes[1].mesh.points - shapes[0].mesh.points).max() / shapes[0].outline.thickness)
