"""The fluid's traction on the aggregate (20), (22): its balance, a closed form, and how little it does in base."""

from __future__ import annotations

from functools import cache

import numpy as np
from scipy.integrate import simpson
from skfem.quadrature import get_quadrature_tri

from reference import layered_channel
from repro.fem.elements import derivatives, values
from repro.fem.mesh import Mesh
from repro.fem.outline import FREE
from repro.fem.space import Space
from repro.march import updates
from repro.march.loop import Instant
from repro.model import contact, flow, pore, traction
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


def nodal(scene, space: Space) -> tuple[np.ndarray, Flow]:
    """Nodal forces (N, 2) um2 of head on the nodes of a mesh, and the flow."""
    found = pore.solve_flow(scene, space)
    viscosity = scene.flow.kinematic_viscosity / scene.flow.gravity
    return traction.nodal(space, found, viscosity, scene.numerics.interface), found


@case("coupling-traction-balance", kind="property",
      norm="x-force on the interface against minus that by the aggregate's own triangles, and forces at nodes within "
           "the fluid, over the largest; drag on a half-disc over head loss times W less wall shear, less 1",
      claim="What the fluid does to the aggregate the aggregate does to the fluid; no force is left in the fluid; the "
            "drag is what the ends' pressure and the walls' shear leave over",
      mutants=("traction-pressure-left-out", "traction-form-mixed", "traction-of-both-phases"))
def balance() -> Outcome:
    checks = [check for elements in runs.ELEMENTS for form in FORMS for check in _balanced(elements, form)]
    errors = refine(_drag_error, REFINEMENTS)
    return Outcome(tuple(checks), (study("drag", 1 / np.array(REFINEMENTS), errors["drag"], 1,
                                         "shear from the slopes of linear triangles: first order"),))


def _balanced(elements: str, form: str) -> list:
    """Checks at t = 0 with one kind of elements and one form of the flow."""
    scene = loaded_scene(f'numerics.interface="{form}"', runs.of(elements))
    now = pore.seeded(scene)
    on, found = nodal(scene, now.space)
    mesh = now.mesh
    x, y = mesh.points.T
    rim = np.isin(x, mesh.ends) | np.isin(y, (0.0, mesh.width))
    rim[mesh.body] = True
    free = mesh.loop[now.wall == FREE]
    largest = np.abs(on[free]).max()
    apart = on[free] + _by_biomass(scene, now, found)[free]
    return [at_most(f"force within the fluid, {form}, {elements}", np.abs(on[~rim]).max() / largest, 1e-9, BOTH_ENDS),
            at_most(f"action and reaction, {form}, {elements}", np.abs(apart).max() / largest, 1e-9, BOTH_ENDS)]


def _by_biomass(scene, now: pore.Pore, found: Flow) -> np.ndarray:
    """(N, 2) um2 of head: forces of the biomass' triangles, lambda times as viscous, triangle by triangle."""
    viscosity = scene.flow.viscosity_ratio * scene.flow.kinematic_viscosity / scene.flow.gravity
    mesh, space, pressure = now.mesh, now.space, flow.pressure_space(now.space)
    total = np.zeros_like(mesh.points)
    for cell in np.flatnonzero(mesh.biomass):
        nodes = mesh.cells[cell]
        for weight, place in RULES[space.order]:
            J = mesh.points[nodes].T @ _derivatives(mesh.geometry, place)
            grad = found.velocity[space.cells[cell]].T @ _derivatives(space.order, place) @ np.linalg.inv(J)
            if scene.numerics.interface == "traction":
                grad = grad + grad.T
            head = float(values(pressure.order, place[None])[0] @ found.head[pressure.cells[cell]])
            slope = _derivatives(mesh.geometry, place) @ np.linalg.inv(J)
            total[nodes] += weight * np.linalg.det(J) * slope @ (head * np.eye(2) - viscosity * grad).T
    return total


def _rule(degree: int) -> list[tuple[float, np.ndarray]]:
    """(weight, place) of scikit-fem's quadrature of a degree on the unit triangle."""
    places, weights = get_quadrature_tri(degree)
    return list(zip(weights, places.T))


#: Quadratures by the order of the elements: those of the package, without which the balance is no identity of its own
#: equations; on linear triangles a middle point is exact.
RULES = {1: _rule(1), 2: _rule(6), 3: _rule(8)}


def _derivatives(order: int, place: np.ndarray) -> np.ndarray:
    """(k, 2) of the functions of an order at a place on the unit triangle."""
    return derivatives(order, place[None])[0]


def _drag_error(refinement: float) -> dict[str, float]:
    """The drag on a half-disc against head loss times W less the shear on the walls, from the slopes beside them."""
    scene = loaded_scene(f"numerics.refinement={refinement}")
    now = pore.seeded(scene)
    on, found = nodal(scene, now.space)
    viscosity = scene.flow.kinematic_viscosity / scene.flow.gravity
    left = found.meshed_loss * now.mesh.width - viscosity * _wall_shear(now.mesh, found.velocity)
    return {"drag": abs(on[now.mesh.loop, 0].sum() / left - 1)}


def _wall_shear(grid: Mesh, velocity: np.ndarray) -> float:
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
    checks = [at_most(f"shear, order {order}", abs(_shear(Space(layers._long_layer(), order))), 1e-5,
                      "both parabolas are held; what is left of the layer's ends") for order in (2, 3)]
    return Outcome(tuple(checks), (study("shear", layers.SIZES, errors["shear"], 2, "forces as residuals of linear "
                                         "elements: second order, as the flux", ceiling=1e-3),))


LAYER_DRAWS = (16, 12, 6, 2)


def _shear_error(level: int, draw: int) -> float:
    return _shear(Space(layers._grid(level, draw), 1))


def _shear(space: Space) -> float:
    """Relative error of the mean shear on the middle of the layer."""
    mesh, ratio, half = space.mesh, 2000.0, 40.0
    found = flow.unit_flow(space, ratio)
    as_flow = Flow(1.0, found.velocity, found.pressure, found.correction, 1.0, 1.0, 1.0)
    on = traction.nodal(space, as_flow, 1.0, "laplacian")
    line = np.flatnonzero((mesh.points[:, 1] == layers.LAYER) & (np.abs(mesh.points[:, 0]) < layers.LAYER_END))
    x, shear = mesh.points[line, 0], on[line, 0]
    weight = np.clip((half + 10 - np.abs(x)) / 10, 0, 1)  # level, then ramps: the sum is a tested integral
    length = _tested(mesh, line, weight)
    gradient = layered_channel.gradient(layers.WIDTH, layers.LAYER, ratio)
    exact = gradient * (layered_channel._stress(layers.WIDTH, layers.LAYER, ratio) - layers.LAYER)
    return float(weight @ shear / length / exact - 1)


def _tested(mesh: Mesh, line: np.ndarray, weight: np.ndarray) -> float:
    """Integral over a line of nodes of a function with values there: by trapezia, or by Simpson's rule where every
    second node is a middle."""
    order = np.argsort(mesh.points[line, 0])
    x, values = mesh.points[line[order], 0], weight[order]
    if mesh.geometry == 1:
        return float(np.trapezoid(values, x))
    return float(simpson(values, x=x))


@case("coupling-traction-base", kind="property",
      norm="base at 4, 10 and 16 h, steps of 24 min: largest move of the interface by the fluid in the next step, over "
           "the thickness",
      claim="The fluid's forces are small against those of growth (C26): they move base's interface by less than 1e-4",
      mutants=("density-squared", "forces-thousandfold"))
def small_in_base() -> Outcome:
    checks = []
    for elements in runs.ELEMENTS:
        moves = [_move_in_base(hours, elements) for hours in (4, 10, 16)]
        checks += [at_most(f"largest move, {elements}", max(moves), 1e-4, "0.1 Pa of the fluid on a stiffness of 2 to "
                           "10 kPa, some times for the slender shape"),
                   at_least(f"least move, {elements}", min(moves), 1e-7, "else no force has acted")]
    return Outcome(tuple(checks))


@cache
def _pores(end: int, elements: str) -> Instant:
    return runs.last(runs.base(f"{end} h", 'growth.time_step="24 min"', runs.coarser(elements, 0.2, 0.6),
                               runs.of(elements)))


def _move_in_base(hours: int, elements: str) -> float:
    """Both from the same pore: on the same mesh."""
    found, shapes = _pores(hours, elements), []
    for word in ("neglected", "included"):
        scene = runs.base(f"{hours} h", runs.coarser(elements, 0.2, 0.6), runs.of(elements),
                          f'growth.fluid_forces="{word}"')
        grown, _, _ = updates.make_biomass(scene, found.pore, found.solved, 0.4)
        shapes.append(contact.expand(scene, grown, updates.enlarged(scene, found.pore, grown))[0])
    return float(np.abs(shapes[1].mesh.points - shapes[0].mesh.points).max() / shapes[0].outline.thickness)
