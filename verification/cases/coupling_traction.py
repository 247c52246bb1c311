"""The fluid's traction on the aggregate (20), (22): its balance, a closed form, and how little it does in base.

The aggregate under the fluid's traction: closed forms, and that shape and flow agree.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.integrate import simpson

from reference import layered_channel
from repro.fem.mesh import Mesh
from repro.fem.newton import relative
from repro.fem.outline import FREE, Outline
from repro.fem.space import Space
from repro.march.loop import Instant
from repro.march.simulation import simulate
from repro.model import contact, flow, growth, mesh_motion, pore, traction
from repro.model.flow import Flow
from verification.cases import flow as flow_cases
from verification.evidence.cases import combined, parametrize
from verification.evidence.checks import at_least, at_most, between, each_at_most, refine, studies, study
from verification.problems import runs

FORMS = ("laplacian", "traction")
#: Every kind of elements on the paper's mesh, and the presets on theirs.
DEFAULT = runs.every(1.0)
#: A mesh three times finer than a cubic one of the default size takes longer than all others together.
REMESHED = DEFAULT | {"cubic": runs.every(0.5)["cubic"]}
BOTH_ENDS = "the momentum balance of the solver's own equations: round-off"
REFINEMENTS = (1.0, 1.4, 2.0, 2.8)


def loaded_scene(*changes: str):
    return runs.base("1 h", 'aggregate.radius="25 um"', 'growth.fluid_forces="included"', *changes)


def nodal(scene, space: Space) -> tuple[np.ndarray, Flow]:
    """Nodal forces (N, 2) um2 of head on the nodes of a mesh, and the flow."""
    found = pore.solve_flow(scene, space)
    viscosity = scene.flow.kinematic_viscosity / scene.flow.gravity
    return traction.nodal(space, found, viscosity, scene.numerics.interface), found


@pytest.mark.case(
    "coupling-traction-balance", kind="property",
    claim="What the fluid does to the aggregate the aggregate does to the fluid; no force is left in the fluid; the "
          "drag is what the ends' pressure and the walls' shear leave over",
    norm="x-force on the interface against minus that by the aggregate's own triangles, and forces at nodes within "
         "the fluid, over the largest; drag on a half-disc over head loss times W less wall shear, less 1",
    mutants=("traction-pressure-left-out", "traction-form-mixed", "traction-of-both-phases"), runs_with="paper")
@parametrize("*changes", {f"{form}, {label}": (f'numerics.interface="{form}"', *changes) for form in FORMS
                          for label, changes in DEFAULT.items()})
def test_traction_balance(changes, record):
    """Checks at t = 0 with one form of the flow; the drag's order with linear elements and the paper's form."""
    scene = loaded_scene(*changes)
    now = pore.seeded(scene)
    on, found = nodal(scene, now.space)
    mesh = now.mesh
    x, y = mesh.points.T
    rim = np.isin(x, mesh.ends) | np.isin(y, (0.0, mesh.width))
    rim[mesh.body] = True
    free = mesh.loop[now.wall == FREE]
    largest = np.abs(on[free]).max()
    apart = on[free] + _by_biomass(scene, now, found)[free]
    record(each_at_most({"force within the fluid": np.abs(on[~rim]).max() / largest,
                         "action and reaction": np.abs(apart).max() / largest}, 1e-9, BOTH_ENDS))
    if now.space.order == 1 and scene.numerics.interface == FORMS[0]:
        record(study("drag", 1 / np.array(REFINEMENTS), [*map(_drag_error, REFINEMENTS)], 1,
                     "shear from the slopes of linear triangles: first order"))


def _by_biomass(scene, now: pore.Pore, found: Flow) -> np.ndarray:
    """(N, 2) um2 of head: forces of the biomass' triangles, lambda times as viscous, as of a mesh on which biomass and
    fluid are exchanged."""
    mesh = now.mesh
    other = replace(mesh, topology=replace(mesh.topology, biomass=~mesh.biomass))
    viscosity = scene.flow.viscosity_ratio * scene.flow.kinematic_viscosity / scene.flow.gravity
    return traction.nodal(Space(other, now.space.order), found, viscosity, scene.numerics.interface)


def _drag_error(refinement: float) -> float:
    """Relative error of the drag on a half-disc against head loss times W less the shear on the walls, from the slopes
    beside them."""
    scene = loaded_scene(f"numerics.refinement={refinement}")
    now = pore.seeded(scene)
    on, found = nodal(scene, now.space)
    viscosity = scene.flow.kinematic_viscosity / scene.flow.gravity
    left = found.meshed_loss * now.mesh.width - viscosity * _wall_shear(now.mesh, found.velocity)
    return abs(on[now.mesh.loop, 0].sum() / left - 1)


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


@pytest.mark.case(
    "coupling-traction-layer", kind="exact",
    claim="The shear that the fluid exerts on a layer of biomass is that of two viscous layers",
    norm="x-force on the middle of a layer of biomass, lambda = 2000, over the shear stress of two viscous layers, "
         "less 1, root mean square over random meshes of a size",
    mutants=("traction-pressure-left-out", "traction-transposed-gradient"), references=("layered_channel",))
@parametrize("order", combined(flow_cases.ORDERS))
def test_traction_layer(order, record):
    if order > 1:
        record(at_most("shear", abs(_shear(Space(flow_cases.long_layer(), order))), 1e-5,
                       "both parabolas are held; what is left of the layer's ends"))
        return
    record(studies(refine(_shear_error, LAYER_DRAWS), {
        "shear": (2, "forces as residuals of linear elements: second order, as the flux", 1e-3)}))


#: How many meshes of each level.
LAYER_DRAWS = dict(enumerate((16, 12, 6, 2)))


def _shear_error(level: int, draw: int) -> dict[str, float]:
    return {"size": flow_cases.SIZES[level], "shear": _shear(Space(flow_cases.layer_grid(level, draw), 1))}


def _shear(space: Space) -> float:
    """Relative error of the mean shear on the middle of the layer."""
    mesh = space.mesh
    ratio = 2000.0
    found = flow.unit_flow(space, ratio)
    as_flow = Flow(1.0, found.velocity, found.pressure, found.correction, 1.0, 1.0, 1.0)
    on = traction.nodal(space, as_flow, 1.0, "laplacian")
    along, across = mesh.points.T
    line = np.flatnonzero((across == flow_cases.LAYER) & (np.abs(along) < flow_cases.LAYER_END))
    x, shear = mesh.points[line, 0], on[line, 0]
    weight = np.clip((50 - np.abs(x)) / 10, 0, 1)  # level, then ramps: the sum is a tested integral
    length = _tested(mesh, line, weight)
    gradient = layered_channel.gradient(flow_cases.WIDTH, flow_cases.LAYER, ratio)
    exact = gradient * (layered_channel.stress(flow_cases.WIDTH, flow_cases.LAYER, ratio) - flow_cases.LAYER)
    return weight @ shear / length / exact - 1


def _tested(mesh: Mesh, line: np.ndarray, weight: np.ndarray) -> float:
    """Integral over a line of nodes of a function with values there: by trapezia, or by Simpson's rule where every
    second node is a middle."""
    order = np.argsort(mesh.points[line, 0])
    x, values = mesh.points[line[order], 0], weight[order]
    if mesh.geometry == 1:
        return np.trapezoid(values, x)
    return simpson(values, x=x)


@pytest.mark.case(
    "coupling-traction-base", kind="property",
    claim="The fluid's forces are small against those of growth (C26): they move base's interface by less than 1e-4",
    norm="base at 4, 10 and 16 h, steps of 24 min: largest move of the interface by the fluid in the next step, over "
         "the thickness",
    mutants=("density-squared", "forces-thousandfold"), runs_with="paper")
@parametrize("*changes", runs.every(0.2, 0.6))
def test_traction_base(changes, record):
    _, *found = simulate(runs.base("16 h", 'growth.time_step="24 min"', *changes, times=(4, 10, 16)))
    moves = [_next_move(instant, *changes) for instant in found]
    record(at_most("largest move", max(moves), 1e-4, "0.1 Pa of the fluid on a stiffness of 2 to 10 kPa, some times "
                   "for the slender shape"),
           at_least("least move", min(moves), 1e-7, "else no force has acted"))


def _next_move(found: Instant, *changes: str) -> float:
    """Both from the same pore: on the same mesh."""
    scenes = (runs.base("16 h", *changes, f'growth.fluid_forces="{word}"') for word in ("neglected", "included"))
    plain, pushed = (runs.next_shape(scene, found.pore, found.solved, 0.4) for scene in scenes)
    return np.abs(pushed.mesh.points - plain.mesh.points).max() / plain.outline.thickness


@pytest.mark.case(
    "coupling-traction-even", kind="exact",
    claim="An even pressure of the fluid, five times mu_L and more, moves nothing: the aggregate is incompressible, "
          "and its P takes the pressure up",
    norm="largest move of a node, over R; P over mu_L less what it was and the pressure; forces at free nodes less "
         "those of an even pressure, over the largest",
    mutants=("traction-pressure-left-out", "forces-pushed"), runs_with="paper")
@parametrize("*changes", DEFAULT)
def test_traction_even(changes, record):
    scene = loaded_scene(*changes)
    now = pore.seeded(scene)
    theta = _uneven(now, 0.002)
    plain = contact._at_rest(scene, now, theta, now, None, contact.PATIENT).pore
    space = now.moved(mesh_motion.move(now.mesh, plain.mesh.points[now.mesh.body], 1.0, 100.0)).space
    mesh = space.mesh
    still = Flow(0.0, np.zeros((space.count, 2)), np.full(flow.pressure_space(space).count, 5.0), None, 0.0, 0.0, 0.0)
    on = traction.nodal(space, still, 1.0, "laplacian")
    by_hand = -5.0 * _normals(plain.outline)
    apart = (on[mesh.loop] - by_hand)[plain.wall == FREE]
    record(at_most("forces", np.abs(apart).max() / np.abs(by_hand).max(), 1e-12, "the divergence theorem: round-off"))
    for sign in (1.0, -1.0):
        pushed = contact._at_rest(scene, now, theta, now, sign * on[mesh.body], contact.PATIENT).pore
        apart = np.abs(pushed.mesh.points - plain.mesh.points).max() / 25.0
        change = (pushed.pressure - plain.pressure)[mesh.topology.body_corners] + sign * 5.0
        record(at_most(f"move, {sign:+g}", apart, 1e-9, "J = theta: Newton's tolerance"))
        record(at_most(f"P, {sign:+g}", np.abs(change).max(), 1e-8, "Newton's tolerance"))


def _uneven(now: pore.Pore, slope: float) -> np.ndarray:
    """(t, q) theta of a seed times 1.1 + slope x."""
    shape = now.body.shape
    return now.theta * (1.1 + slope * now.body.reference[shape.cells, 0] @ shape.table.shape.T)


def _normals(outline: Outline) -> np.ndarray:
    """(M, 2) outward normals times length of the edges, shared between their nodes: by how much the area grows as a
    node moves by one, of which it is a quadratic function."""
    def area(move):
        return replace(outline, points=outline.points + move.reshape(-1, 2)).area

    moves = np.eye(outline.points.size)
    return np.array([area(move) - area(-move) for move in moves]).reshape(-1, 2) / 2


FACTORS = (800.0, 400.0, 200.0, 100.0)


def _said(factor: float, *changes: str):
    """A scene in water ``factor`` times as dense at the same velocities (0: without fluid forces)."""
    if factor == 0:
        return loaded_scene(*changes, 'growth.fluid_forces="neglected"')
    return loaded_scene(*changes, f'flow.density="{998 * factor} mg/cm^3"')


@cache
def _moved(factor: float, *changes: str) -> tuple[pore.Pore, pore.Pore, np.ndarray]:
    """A half-disc of 25 um, what a step of uneven growth makes of it, and its theta."""
    said = _said(factor, *changes)
    now = pore.seeded(said)
    theta = _uneven(now, -0.002)
    return now, contact.expand(said, now, theta).pore, theta


@pytest.mark.slow
@pytest.mark.case(
    "coupling-traction-fixed-point", kind="property",
    claim="The move is proportional to the force as the force falls, and shape and flow agree in the end",
    norm="nodes' move by the fluid, over the force's factor and R, against that of the factor below; defect of the "
         "equilibrium under the forces of the flow around its own shape, and around the shape before",
    mutants=("forces-of-the-first-round", "forces-pushed", "density-squared"), runs_with="paper")
@parametrize("*changes", DEFAULT)
def test_traction_fixed_point(changes, record):
    plain = _moved(0.0, *changes)[1].mesh.points
    moves = [(_moved(factor, *changes)[1].mesh.points - plain) / factor for factor in (*FACTORS, 1.0)]
    size = np.abs(moves[-1]).max()
    apart = [np.abs(move - moves[-1]).max() / size for move in moves[:-1]]
    own, before = _defects(*changes)
    record(study("move over force", FACTORS, apart, 1, "quadratic remainder of a smooth map: first order",
                 ceiling=1e-3))
    record(at_most("defect with its own flow", own, 1e-8, "nodes at rest to 1e-8 of R"))
    record(at_least("defect with the flow before", before, 1e-5, "else no round is needed"))
    record(between("downstream tip's move at factor 1, over the upstream one's", _tips(moves[-1], *changes), 0.2, 5.0,
                   "both are pushed downstream"))
    record(at_most("largest move at factor 1, over R", size / 25.0, 1e-4, "0.1 Pa on 10 kPa"))


def _tips(move: np.ndarray, *changes: str) -> float:
    """Move along x of the downstream contact line over that of the upstream one."""
    mesh = _moved(0.0, *changes)[0].mesh
    x, along = mesh.points[mesh.loop, 0], move[mesh.loop, 0]
    return along[x.argmax()] / along[x.argmin()]


def _defects(*changes: str) -> tuple[float, float]:
    """Residual of the equilibrium over the size of its terms under the forces around its own shape, and the last's."""
    said = _said(FACTORS[-1], *changes)
    now, found, theta = _moved(FACTORS[-1], *changes)
    nodes, body = now.mesh.body, now.body
    held = contact.constrained(len(nodes), now.mesh.topology.body_loop, now.wall, now.fixed)
    stabilising, defects = None, []
    if body.shape.geometry == 1:
        cells = body.shape.cells
        stabilising = growth.gradient_stabilisation(now.mesh.points[nodes], cells, np.ones(len(cells)))
    place, pressure = found.mesh.points[nodes], found.pressure[now.mesh.topology.body_corners]
    rest = growth.System(body, held, stabilising=stabilising).under(theta, place, place, pressure)
    for around in (found, now):
        forces = traction.forces(said, traction.surroundings(said, now, around), around)
        load = np.concatenate([forces.T.ravel(), np.zeros(len(pressure))])
        defects.append(relative((rest.residual - load)[rest.free], (rest.size + np.abs(load))[rest.free]))
    return tuple(defects)


#: The least refinement at which the mesh of a seed that followed is not fine enough.
ANEW = 1.35


@pytest.mark.case(
    "coupling-traction-remeshed", kind="property",
    claim="Where a new mesh must be made for the flow, its forces go to the aggregate's nodes, sum and moment kept",
    norm="sum along x and moment of the forces on an outline's nodes against those on the nodes of a new mesh around "
         "it, and the sum against that on the mesh that followed; relative",
    mutants=("forces-shared-evenly",), runs_with="paper")
@parametrize("*changes", REMESHED)
def test_traction_remeshed(changes, record):
    now, found, _ = _moved(0.0, *changes)
    coarse = loaded_scene(*changes)
    fine = loaded_scene(*changes, f"numerics.refinement={max(ANEW, 3 * coarse.numerics.refinement)}")
    mesh, _ = pore.generate(fine, found.outline)
    on = nodal(fine, Space(mesh, found.space.order))[0]
    scale = traction.MPA_PER_UM * fine.flow.density * fine.flow.gravity / fine.growth.shear_modulus
    new = _sums(mesh.points[mesh.loop], scale * on[mesh.loop])
    places = found.mesh.points[now.mesh.body]
    both = [traction.forces(scene, traction.surroundings(scene, now, found), found) for scene in (fine, coarse)]
    ours, followed = (_sums(places, forces) for forces in both)
    record(at_most("new mesh, nodes of the outline", np.abs(ours / new - 1).max(), 1e-9, runs.ROUND_OFF),
           at_most("new mesh, mesh that followed, x", abs(ours[0] / followed[0] - 1), 0.02,
                   "the drag's own error at this refinement: 0.012"),
           at_least("nodes, new over old", len(mesh.loop) / len(now.mesh.loop), 1.5,
                    "else none was split"))


def _sums(places: np.ndarray, on: np.ndarray) -> np.ndarray:
    """Sum along x, and moment of the forces."""
    return np.array([on[:, 0].sum(), np.sum(places[:, 0] * on[:, 1] - places[:, 1] * on[:, 0])])
