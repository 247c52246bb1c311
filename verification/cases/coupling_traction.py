"""The fluid's traction on the aggregate (20), (22): its balance, closed forms, and its small effect in base.

Under this traction the shape must be in equilibrium with the flow around it.
"""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from repro.fem.mesh import Mesh
from repro.fem.space import Space
from repro.fem.walls import FREE
from repro.march.simulation import simulate
from repro.march.state import Report
from repro.model import contact, flow, growth, mechanics, solving, traction
from repro.model.flow import Flow
from repro.model.interface import interface_of
from repro.model.mechanics import Mechanics, supports_of
from repro.model.meshing import Meshing, seeded
from repro.model.pore import Pore
from verification.evidence.cases import parametrize
from verification.evidence.checks import at_least, at_most, between, each_at_most, study
from verification.problems import runs

FORMS = ("laplacian", "traction")
#: Every kind of elements on the paper's mesh, and the presets on their meshes.
DEFAULT = runs.every(1.0)
BOTH_ENDS = "the momentum balance of the solver's own equations: round-off"
REFINEMENTS = (1.0, 1.4, 2.0, 2.8)


def loaded_scene(*changes: str):
    return runs.base("1 h", 'aggregate.radius="25 um"', 'growth.fluid_forces="included"', *changes)


def nodal_forces(scene, space: Space) -> tuple[np.ndarray, Flow]:
    """Nodal forces (N, 2) um2 of head on the nodes of a mesh, and the flow."""
    solution = solving.Solver.of(scene).solve_flow(space, scene.flow)
    viscosity = scene.flow.kinematic_viscosity / scene.flow.gravity
    return traction.nodal(space, solution, viscosity, interface_of(scene.numerics.interface)), solution


@pytest.mark.case(
    "coupling-traction-balance", kind="property",
    mutants=("traction-pressure-left-out", "traction-form-mixed", "traction-of-both-phases"), runs_with="paper")
@parametrize("*changes", {f"{form}, {label}": (f'numerics.interface="{form}"', *changes) for form in FORMS
                          for label, changes in DEFAULT.items()})
def test_traction_balance(changes, record):
    """The force of the fluid on the aggregate is opposite to that of the aggregate on the fluid, no force acts within
    the fluid, and the drag is the pressure on the ends less the shear on the walls.

    Norm: x-force on the interface against minus that by the aggregate's own triangles, and forces at nodes within the
    fluid, over the largest; drag on a half-disc over head loss times W less wall shear, less 1.

    Record the balance at t = 0, and the order of the drag with linear elements and the paper's form.
    """
    scene = loaded_scene(*changes)
    seed = seeded(scene)
    forces, solution = nodal_forces(scene, seed.space)
    mesh = seed.mesh
    x, y = mesh.points.T
    rim = np.isin(x, mesh.ends) | np.isin(y, (0.0, mesh.width))
    rim[mesh.body] = True
    free = mesh.loop[seed.body.wall == FREE]
    largest = np.abs(forces[free]).max()
    imbalance = forces[free] + _by_biomass(scene, seed, solution)[free]
    record(each_at_most({"force within the fluid": np.abs(forces[~rim]).max() / largest,
                         "action and reaction": np.abs(imbalance).max() / largest}, 1e-9, BOTH_ENDS))
    if seed.space.order == 1 and scene.numerics.interface == FORMS[0]:
        record(study("drag", 1 / np.array(REFINEMENTS), [*map(_drag_error, REFINEMENTS)], 1,
                     "shear from the slopes of linear triangles: first order"))


def _by_biomass(scene, state: Pore, solution: Flow) -> np.ndarray:
    """(N, 2) um2 of head, forces of the triangles of biomass, which are lambda times as viscous.

    They are computed on a mesh in which biomass and fluid are exchanged.
    """
    mesh = state.mesh
    exchanged = replace(mesh, topology=replace(mesh.topology, region=1 - mesh.topology.region))
    viscosity = scene.flow.viscosity_ratio * scene.flow.kinematic_viscosity / scene.flow.gravity
    if solution.biomass_head is not None:
        solution = replace(solution, head=solution.biomass_head)
    return traction.nodal(Space(exchanged), solution, viscosity, interface_of(scene.numerics.interface))


def _drag_error(refinement: float) -> float:
    """Relative error of the drag on a half-disc against head loss times W less the shear on the walls.

    The shear comes from the velocity gradients beside the walls.
    """
    scene = loaded_scene(f"numerics.refinement={refinement}")
    seed = seeded(scene)
    forces, solution = nodal_forces(scene, seed.space)
    viscosity = scene.flow.kinematic_viscosity / scene.flow.gravity
    expected = solution.meshed_loss * seed.mesh.width - viscosity * _wall_shear(seed.mesh, solution.velocity)
    return abs(forces[seed.mesh.loop, 0].sum() / expected - 1)


def _wall_shear(grid: Mesh, velocity: np.ndarray) -> float:
    """Integral of |du_x/dy| over the fluid's part of both walls, um/h."""
    total = 0.0
    for nodes, slope, wet in zip(grid.triangles, grid.gradients, ~grid.biomass):
        y = grid.points[nodes, 1]
        for wall, sign in ((0.0, 1.0), (grid.width, -1.0)):
            on_wall = y == wall
            if wet and np.count_nonzero(on_wall) == 2:
                total += sign * np.ptp(grid.points[nodes[on_wall], 0]) * (velocity[nodes, 0] @ slope[:, 1])
    return total


@pytest.mark.case(
    "coupling-traction-base", kind="property", mutants=("density-squared", "forces-thousandfold"), runs_with="paper")
@parametrize("*changes", runs.every(0.2, 0.6))
def test_traction_base(changes, record):
    """The fluid's forces are small against those of growth (C26): they displace base's interface by less than 1e-4 of
    its thickness.

    Norm: base at 4, 10 and 16 h, steps of 24 min: largest displacement of the interface by the fluid in the next step,
    over the thickness.
    """
    _, *reports = simulate(runs.base("16 h", 'growth.time_step="24 min"', *changes, times=(4, 10, 16)))
    moves = [_next_move(instant, *changes) for instant in reports]
    record(at_most("largest displacement", max(moves), 1e-4,
                   "0.1 Pa of the fluid on a stiffness of 2 to 10 kPa, and a few times that for a slender shape"),
           at_least("least displacement", min(moves), 1e-7, "else no force has acted"))


def _next_move(report: Report, *changes: str) -> float:
    """Largest displacement of the interface by the fluid in a step, over the thickness. Both shapes are on one mesh."""
    scenes = (runs.base("16 h", *changes, f'growth.fluid_forces="{word}"') for word in ("neglected", "included"))
    plain, pushed = (runs.next_shape(scene, report.pore, report.solved, 0.4) for scene in scenes)
    return np.abs(pushed.mesh.points - plain.mesh.points).max() / plain.outline.thickness


def _uneven(seed: Pore, slope: float) -> np.ndarray:
    """(t, q) theta of a seed times 1.1 + slope x."""
    shape = seed.body.solid.shape
    return seed.body.theta * (1.1 + slope * seed.body.reference[shape.cells, 0] @ shape.table.values.T)


FACTORS = (800.0, 400.0, 200.0, 100.0)


def _in_denser_water(factor: float, *changes: str):
    """A scene in water ``factor`` times as dense at the same velocities. 0: without fluid forces."""
    if factor == 0:
        return loaded_scene(*changes, 'growth.fluid_forces="neglected"')
    return loaded_scene(*changes, f'flow.density="{998 * factor} mg/cm^3"')


@cache
def _moved(factor: float, *changes: str) -> tuple[Pore, Pore, np.ndarray]:
    """A half-disc of 25 um, its shape after a step of uneven growth, and its theta."""
    scene = _in_denser_water(factor, *changes)
    seed = seeded(scene)
    theta = _uneven(seed, -0.002)
    return seed, contact.expand(Mechanics.of(scene), seed, [theta]).pore, theta


@pytest.mark.slow
@pytest.mark.case(
    "coupling-traction-fixed-point", kind="property",
    mutants=("forces-of-the-first-round", "forces-pushed", "density-squared"), runs_with="paper")
@parametrize("*changes", DEFAULT)
def test_traction_fixed_point(changes, record):
    """As the force falls, the displacement becomes proportional to it, and at the end shape and flow agree.

    Norm: displacement of the nodes by the fluid, over the factor of the force and R, against that with the factor 1;
    defect of the equilibrium under the forces of the flow around its own shape, and around the shape before.
    """
    plain = _moved(0.0, *changes)[1].mesh.points
    moves = [(_moved(factor, *changes)[1].mesh.points - plain) / factor for factor in (*FACTORS, 1.0)]
    size = np.abs(moves[-1]).max()
    differences = [np.abs(move - moves[-1]).max() / size for move in moves[:-1]]
    own_defect, previous_defect = _defects(*changes)
    record(study("displacement over force", FACTORS, differences, 1, "quadratic remainder of a smooth map: first order",
                 ceiling=1e-3))
    record(at_most("defect with its own flow", own_defect, 1e-8, "nodes at rest to 1e-8 of R"))
    record(at_least("defect with the flow before", previous_defect, 1e-5, "else no round is needed"))
    record(between("displacement of the downstream tip at factor 1, over that of the upstream tip",
                   _tips(moves[-1], *changes), 0.2, 5.0, "the flow pushes both downstream"))
    record(at_most("largest displacement at factor 1, over R", size / 25.0, 1e-4, "0.1 Pa on 10 kPa"))


def _tips(move: np.ndarray, *changes: str) -> float:
    """Displacement along x of the downstream contact line over that of the upstream one."""
    mesh = _moved(0.0, *changes)[0].mesh
    x, along = mesh.points[mesh.loop, 0], move[mesh.loop, 0]
    return along[x.argmax()] / along[x.argmin()]


def _defects(*changes: str) -> tuple[float, float]:
    """Relative residual of the equilibrium under the flow around its own shape, and around the previous shape."""
    scene = _in_denser_water(FACTORS[-1], *changes)
    seed, grown, theta = _moved(FACTORS[-1], *changes)
    nodes, solid = seed.mesh.body, seed.body.solid
    constrained_dofs = mechanics.constrained(len(nodes), seed.region.own_loop, seed.body.wall, seed.body.fixed)
    defects = []
    stabilisation = growth.STABILISATIONS[solid.shape.geometry].on(solid, seed.mesh.points[nodes])
    place, pressure = grown.mesh.points[nodes], grown.pressure[seed.mesh.topology.body_corners]
    for pore_of_flow in (grown, seed):
        fluid = traction.Fluid.of(scene)
        forces = traction.forces(fluid, traction.surroundings(fluid.meshing, seed, pore_of_flow), pore_of_flow)
        supports = supports_of(solid, grown, forces)
        system = growth.System(solid, constrained_dofs, stabilisation=stabilisation, forces=forces, supports=supports)
        defects.append(system.under(theta, place, place, pressure).defect)
    return tuple(defects)


#: The least refinement at which the moved mesh of a seed is too coarse.
REMESHED_FROM = 1.35


@pytest.mark.case("coupling-traction-remeshed", kind="property", mutants=("forces-shared-evenly",), runs_with="paper")
@parametrize("*changes", DEFAULT)
def test_traction_remeshed(changes, record):
    """If the flow requires a new mesh, its forces are transferred to the aggregate's nodes with their sum and moment.

    Norm: sum along x and moment of the forces on an outline's nodes against those on the nodes of a new mesh around it,
    and the sum against that on the moved mesh; relative.
    """
    seed, grown, _ = _moved(0.0, *changes)
    coarse = loaded_scene(*changes)
    fine = loaded_scene(*changes, f"numerics.refinement={max(REMESHED_FROM, 3 * coarse.numerics.refinement)}")
    mesh, _ = Meshing.of(fine).around([grown.outline])
    forces = nodal_forces(fine, Space(mesh))[0]
    scale = flow.MPA_PER_UM * fine.flow.density * fine.flow.gravity / fine.growth.shear_modulus
    new = _sums(mesh.points[mesh.loop], scale * forces[mesh.loop])
    places = grown.mesh.points[seed.mesh.body]
    both = [traction.forces(fluid, traction.surroundings(fluid.meshing, seed, grown), grown)
            for fluid in map(traction.Fluid.of, (fine, coarse))]
    transferred, on_moved_mesh = (_sums(places, forces) for forces in both)
    record(at_most("new mesh, nodes of the outline", np.abs(transferred / new - 1).max(), 1e-9, runs.ROUND_OFF),
           at_most("new mesh against moved mesh, x", abs(transferred[0] / on_moved_mesh[0] - 1), 0.02,
                   "the drag's own error at this refinement: 0.012"),
           at_least("nodes, new over old", len(mesh.loop) / len(seed.mesh.loop), 1.5,
                    "else none was split"))


def _sums(places: np.ndarray, forces: np.ndarray) -> np.ndarray:
    """Sum along x, and moment of the forces."""
    return np.array([forces[:, 0].sum(), np.sum(places[:, 0] * forces[:, 1] - places[:, 1] * forces[:, 0])])
