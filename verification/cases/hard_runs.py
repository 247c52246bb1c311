"""Hard cases of meshes and runs.

Meshes: fifty remeshes, nearly cocircular points, a poor initial mesh. Runs: tiny and large seeds, huge and tiny units,
1e5 nodes in one step, random parameters.
"""

from dataclasses import replace
from functools import cache, partial

import numpy as np

from repro.fem import sizing, transfer
from repro.fem.mesh import POOR, POOR_ALLOWED, Mesh
from repro.fem.outline import half_disc
from repro.fem.space import Space
from repro.fem.walls import FREE
from repro.march import midpoint
from repro.march.state import StepResult
from repro.model import flow, remeshing, solving
from repro.model.meshing import Meshing, seeded
from repro.model.pore import Pore
from repro.model.remeshing import Remeshing
from repro.model.resistance import Viscous
from repro.model.stages import Stages
from repro.scene import Scene, parse_scene, scene_tables
from verification.cases.hard_mechanics import CLOSING
from verification.cases.hard_stages import exponential
from verification.evidence.checks import Check, at_least, at_most
from verification.problems import hard
from verification.problems import runs as problems
from verification.problems.hard import DRIVE, EFFLUENTS, SHAPE, TOLERANCE, HardCase, Run

FIFTY = 50


def remeshes(preset: str) -> list:
    """Fifty remeshes around the aggregate of base at 4 h, with sizes that differ by a third; then a step."""
    run = hard.run_packaged("base", preset, 'aggregate.radius="20 um"', 'growth.end="4 h"', 'output.times=["4 h"]')
    original = run.scene
    first, speed = run.instants[-1].pore, run.instants[-1].solved.flow.mean_velocity
    last = first
    for index in range(FIFTY):
        finer = replace(original.numerics, refinement=original.numerics.refinement * (0.85, 1.0, 1.15)[index % 3])
        last, _ = remeshing.remesh(Remeshing.of(replace(original, numerics=finer)), last, last, speed)
    unremeshed, after = (_numbers(original, _step(original, start).pore) for start in (first, last))
    return [run, *_conserved(first, last),
            *hard.alike("after a step more, with and without them", NAMES, after, unremeshed, preset)]


def _conserved(first: Pore, last: Pore) -> list[Check]:
    before, after = (state.space.integration.to_nodes(state.inert / (state.active + state.inert))[state.mesh.body]
                     for state in (first, last))
    beyond = max(before.min() - after.min(), after.max() - before.max(), 0.0) / np.ptp(before)
    return [at_most("area, relative change", abs(last.outline.area / first.outline.area - 1), 1e-10,
                    "outlines are split on themselves"),
            at_most("biomass, relative change", abs(last.mass / first.mass - 1), 1e-8, "the transfer conserves it"),
            at_most("X_I, relative change", abs(last.inert.sum() / first.inert.sum() - 1), 1e-8, "as above"),
            at_most("share of X_I beyond where it was, over its range", beyond, 0.05,
                    "projection overshoots by a part of a jump, and this field has none")]


def _step(scene: Scene, start: Pore):
    """A step of 12 min."""
    return midpoint.attempt(Stages.of(scene), *hard.solved_in(scene, start), 0.2).step


NAMES = ("area", "thickness", "upstream tip", "conductivity")


def _numbers(scene: Scene, state: Pore) -> list[float]:
    """Values of NAMES."""
    shape = state.outline
    solution = solving.Solver.of(scene).solve_flow(state.space, scene.flow)
    return [shape.area, shape.thickness, shape.upstream, solution.conductivity]


REMESHES = HardCase(
    13, "remeshes", "Fifty forced remeshes",
    "The area and biomass of before, and X_I and the next step of a run without them",
    "Mass that drifts by percents (30 % in 40 remeshes by linear interpolation), or places at t = 0 that fold",
    {"base at 4 h": remeshes},
    mutants=("hard-inert-degraded-at-a-remesh", "theta-anew-at-a-remesh"))


def cocircular(preset: str) -> list:
    """Outlines with nodes on a circle up to 1e-15, 1e-12, 1e-9 and 1e-6 of its radius."""
    scene = hard.load("base", preset)
    checks, (_, exact) = [], _mesh_and_loss(scene, 0.0)
    for size in (1e-15, 1e-12, 1e-9, 1e-6):
        grid, loss = _mesh_and_loss(scene, size)
        corners = grid.straight
        covered = corners.areas.sum() / (corners.width * np.ptp(corners.ends))
        checks += [at_most(f"area covered, noise {size:g}", abs(covered - 1), 1e-12, "round-off"),
                   at_least(f"least quality, noise {size:g}", corners.quality.min(), 0.2,
                            "a third of the limit for a poor triangle"),
                   hard.promised(f"head loss against no noise, noise {size:g}", abs(loss / exact - 1), preset)]
    return checks


def _mesh_and_loss(scene: Scene, noise: float) -> tuple[Mesh, float]:
    """(mesh, head loss) around a half-disc of 20 um with noise on its nodes."""
    numerics = scene.numerics
    shape = half_disc(20.0, sizing.ACROSS_AGGREGATE * numerics.refinement, numerics.scheme.order)
    free = shape.wall == FREE
    points = shape.points.copy()
    points[free] += 20.0 * noise * np.random.default_rng(7).uniform(-1, 1, (free.sum(), 2))
    grid, _ = Meshing.of(scene).around([replace(shape, points=points)])
    return grid, flow.unit_flow(Space(grid), Viscous(2000.0)).loss


#: Transfer of nodal fields between meshes, by geometry.
TRANSFER = {1: transfer.project, 2: transfer.interpolated}


def nearly_same(preset: str) -> list:
    """The transfer between nearly equal meshes, which have pieces without area and nodes on edges."""
    scene = hard.load("base", preset, 'aggregate.radius="20 um"')
    grid = seeded(scene).mesh
    places, cells = grid.points[grid.body], grid.topology.body_cells
    field = np.sin(places / 7.0)
    inner = ~np.isin(np.arange(len(places)), grid.regions[0].own_loop)
    checks, random = [], np.random.default_rng(8)
    for noise in (0.0, 1e-14, 1e-11, 1e-8):
        moved_places = places.copy()
        moved_places[inner] += noise * random.uniform(-1, 1, (inner.sum(), 2))
        carried = TRANSFER[grid.geometry](places, cells, field, moved_places, cells)
        checks.append(at_most(f"largest change of a field of size one, noise {noise:g} um",
                              np.abs(carried - field).max(), 1e-9 + noise, "the identity, and the change of the field"))
    return checks


COCIRCULAR = HardCase(
    18, "cocircular", "Nearly cocircular points",
    "A mesh that covers the pore, the flow of the exact circle, and the identity between nearly equal meshes",
    "A Delaunay triangulation with slivers or holes, a supermesh that loses pieces",
    {"outline": cocircular, "transfer": nearly_same},
    mutants=("hard-shallowest-taken",))


def poor(preset: str) -> list:
    """Base from 20 um with poor triangles in the fluid: two steps of 12 min against those from a good mesh."""
    scene = hard.load("base", preset, 'aggregate.radius="20 um"')
    good, _ = hard.solved_seed(scene)
    bad, count = _with_poor_triangles(good)
    ends = []
    for start in (good, bad):
        first = _step(scene, start)
        second = _step(scene, first.pore)
        ends.append(_numbers(scene, second.pore))
    return [at_least("poor triangles at the start", count, POOR_ALLOWED + 1, "else less is tested"),
            at_least("remeshed on the way", first.remeshed or second.remeshed, 1, "3.5"),
            *hard.alike("after two steps", NAMES, ends[1], ends[0], preset)]


def _with_poor_triangles(good: Pore) -> tuple[Pore, int]:
    """The pore with straight edges and randomly moved inner nodes of the fluid, and its number of poor triangles.

    The nodes move as far as possible without turning a triangle over.
    """
    random = np.random.default_rng(9)
    topology = good.mesh.topology
    straight = good.mesh.straight
    keep = np.concatenate([straight.body, topology.walls, topology.inlet, topology.outlet])
    inner = np.setdiff1d(np.arange(good.mesh.corners), keep)
    push = np.zeros_like(straight.points)
    push[inner] = random.uniform(-1, 1, (len(inner), 2)) * np.sqrt(Space(straight).lumped()[inner])[:, None]
    for part in 0.9 ** np.arange(60):
        points = good.mesh.with_middles(straight.points + part * push)
        points[good.mesh.body] = good.mesh.points[good.mesh.body]
        moved = good.moved(points)
        if moved.mesh.areas.min() > 0.02 * straight.areas.min() and not moved.mesh.turned_over().any():
            return moved, np.count_nonzero(moved.mesh.quality < POOR)
    raise RuntimeError("no displacement leaves all triangles upright")


POOR_MESH = HardCase(
    19, "poor-mesh", "Poor initial mesh",
    "A new mesh within two steps, and the shape and flow of a good start",
    "Triangles that are turned over without an error",
    {"nodes moved at random": poor}, refusable=("nodes moved at random",),
    mutants=("hard-poor-mesh-kept",))


#: Powers of length and time in the units of columns.
COLUMNS = {
    "time_h": (0, 1), "mean_velocity_m_per_d": (1, -1), "head_loss_cm": (1, 0), "conductivity_m_per_d": (1, -1),
    "aggregate_area_um2": (2, 0), "thickness_um": (1, 0), "upstream_um": (1, 0), "downstream_um": (1, 0),
    "meshed_length_um": (1, 0),
    **dict.fromkeys((*EFFLUENTS, "acceptor_min_mg_per_L", "inert_fraction"), (0, 0)),
}


def units(preset: str, length: float, time: float) -> list:
    """Base from 15 um for 2.4 h, in other units."""
    scene = hard.load("base", preset, 'aggregate.radius="15 um"', 'growth.end="2.4 h"', 'growth.time_step="1.2 h"',
                        'output.times=["2.4 h"]')
    rescaled = parse_scene(scene_tables(problems.scaled(scene, length, time)), "scaled", "scaled")
    plain, converted = hard.run_scene(scene), hard.run_scene(rescaled)
    exact = np.log2(length) % 1 == 0
    bound, origin = (1e-9, "dimensions; round-off") if exact else (
        TOLERANCE[preset], "round-off makes another mesh; " + hard.PROMISED[preset])
    return [plain, converted, *(
        at_most(f"{column}, relative difference",
                abs(converted.last[column] / (length**along * time**during) / plain.last[column] - 1), bound, origin)
        for column, (along, during) in COLUMNS.items())]


SCALES = {"lengths x 1e6": (1e6, 1.0), "lengths x 2^20": (2.0**20, 1.0), "lengths / 2^10": (2.0**-10, 1.0),
          "times x 1e-6": (1.0, 1e-6), "times x 1e6": (1.0, 1e6), "times x 1e-9": (1.0, 1e-9)}
UNITS = HardCase(
    17, "units", "Extreme units: lengths times 1e6, times times 1e-6",
    "The same numbers times their unit",
    "A length or a time in the code: a tolerance, a smallest step, a size",
    {label: partial(units, length=length, time=time) for label, (length, time) in SCALES.items()},
    refusable=tuple(SCALES),
    mutants=("length-scale",))

#: Random keys of the scene with their units and physical ranges. The radius is over the width.
RANGES = {
    "pore.width": ("um", 20.0, 200.0), "aggregate.radius": ("um", 0.04, 0.8),
    "flow.mean_velocity": ("m/day", 0.03, 30.0), "flow.viscosity_ratio": ("", 1.0, 1e5),
    "substrates.acceptor.supply": ("mg/L", 0.1, 50.0), "substrates.donor.supply": ("mg/L", 0.1, 50.0),
    "substrates.acceptor.half_saturation": ("mg/L", 0.05, 10.0),
    "substrates.donor.half_saturation": ("mg/L", 0.05, 10.0),
    "kinetics.maximum_utilization_rate": ("1/day", 0.5, 12.0), "kinetics.decay_coefficient": ("1/day", 0.02, 0.5),
    "kinetics.maximum_density": ("mg/L", 5e3, 1e5), "growth.minimum_contact_angle": ("deg", 5.0, 45.0),
    "growth.end": ("h", 0.4, 3.0),
}


def at_random(preset: str, seed: int) -> list[Run]:
    """One draw: the logarithms of the values are uniform in their ranges."""
    random = np.random.default_rng(seed)
    value = {key: low * (high / low) ** random.uniform() for key, (_, low, high) in RANGES.items()}
    value["aggregate.radius"] *= value["pore.width"]
    changes = [f'{key}="{value[key]!r} {unit}"' if unit else f"{key}={value[key]!r}"
               for key, (unit, _, _) in RANGES.items()]
    return [hard.run_packaged("wide", preset, *changes, f'output.times=["{value["growth.end"]!r} h"]', density=CLOSING)]


DRAWS = range(10)
RANDOM = HardCase(
    22, "random", "Parameters drawn at random within physical ranges",
    "Balances, bounds and area by biomass in every run, or a refusal that says what to change",
    "A run that ends with NaN, or that creates or loses mass",
    {f"draw {seed}": partial(at_random, seed=seed) for seed in DRAWS},
    refusable=tuple(f"draw {seed}" for seed in DRAWS),
    mutants=("reprojection-left-out",))

def grow_seed(preset: str, name: str, radius: float, end: str) -> list:
    """Growth from a seed between the exponentials at its least concentrations and at the supply."""
    changes = (f'aggregate.radius="{radius} um"', f'growth.end="{end}"', f'output.times=["{end}"]')
    run, _, checks = hard.against(name, preset, changes, *SHAPE, *DRIVE)
    return [*checks, *exponential(run)]


SEEDS = HardCase(
    14, "seeds", "Seeds of 0.5 and 20 um",
    "Growth between the exponentials at the least concentrations and at the supply, and a finer run's shape",
    "Elements of a seed that is 1/200 of the pore, or a seed that is starved at once",
    {"0.5 um in 100 um": partial(grow_seed, name="wide", radius=0.5, end="8 h"),
     "20 um in 50 um": partial(grow_seed, name="base", radius=20.0, end="4 h")},
    mutants=("curved-half-of-the-half",))

#: Preset and refinement with which base has 1e5 nodes, by order. fast and accurate differ in the tolerance of the step
#: alone.
HUGE = {1: ("paper", 11.4), 2: ("accurate", 5.7)}


@cache
def _first_step(preset: str, *changes: str) -> tuple[Run, StepResult]:
    """The seed of 15 um with its flow and transport as a Run, and one step of 6 min from it."""
    run = hard.run_packaged("base", preset, 'aggregate.radius="15 um"', *hard.FIXED, *changes)
    seed = run.instants[0]
    return run, problems.step(run.scene, seed.pore, seed.solved, 0.1)


def huge(preset: str) -> list:
    """One step of 6 min with 1e5 nodes, against the mesh of the preset."""
    run, own_step = _first_step(preset)
    fine_preset, refinement = HUGE[run.scene.numerics.scheme.order]
    fine, fine_step = _first_step(fine_preset, f"numerics.refinement={refinement}")
    outlines = [step.pore.outline for step in (own_step, fine_step)]
    shapes = [(outline.area, outline.thickness, outline.upstream) for outline in outlines]
    return [fine, run, at_least("nodes", fine.instants[0].pore.space.count, 1e5, "else less is tested"),
            at_most("in - out - consumed over the step, over in", problems.substrate_defect([fine_step.ledger]),
                    1e-12 * fine.last["nodes"], "Newton's tolerance of 1e-12 a row, times the rows"),
            at_most("biomass after - before - made, over after", problems.biomass_defect([fine_step.ledger]),
                    hard.BALANCE, hard.MEAN),
            *hard.close(run, fine, preset, *DRIVE, *EFFLUENTS),
            *hard.alike("after the step, own mesh", NAMES, *shapes, preset)]


LARGE = HardCase(
    20, "large", "1e5 nodes in one step",
    "The shape and flow that the preset's own mesh gives to its tolerance, balances closed",
    "A system too large to be solved, or solved badly: residuals grow with the condition",
    {"base, 15 um": huge},
    mutants=("hard-keys-overflow",))


@hard.parametrize(REMESHES, COCIRCULAR, POOR_MESH, SEEDS, UNITS, LARGE, RANDOM)
def test_runs(case, preset, record, record_property):
    hard.judge(case, preset, record, record_property)
