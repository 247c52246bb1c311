"""Limits, symmetries and time steps of the coupled model.

Limits: no growth, no viscosity jump, no stiffness, and growth at the supply, where the area follows
(9)-(10) in closed form.

Results do not depend on units or on left and right. They hardly depend on storage of the substrates, or on the meshed
part of the pore.

The midpoint rule and the presets: order in time, an independent solver.
"""

from dataclasses import replace
from functools import cache
from unittest import mock

import numpy as np
import pytest

from reference import poiseuille, whole_run
from repro.fem import linear
from repro.fem.space import Space
from repro.fem.walls import FREE
from repro.march import midpoint
from repro.march.simulation import simulate
from repro.march.state import Report
from repro.model import flow, solving
from repro.model.meshing import seeded
from repro.model.resistance import Viscous
from repro.model.stages import Stages
from repro.scene import Scene
from verification.evidence.cases import parametrize
from verification.evidence.checks import at_least, at_most, each_at_most, refine, study
from verification.problems import meshes, runs
from verification.problems.channels import NAMES, both
from verification.problems.schemes import exchange, load_scene


@pytest.mark.case("coupling-no-growth", kind="property", mutants=("increase-not-taken",), runs_with="paper")
@parametrize("*changes", runs.EVERY)
def test_no_growth(changes, record):
    """If biomass neither takes up substrates nor decays, the pore does not change, and C is the supply everywhere.

    Norm: t = 0 against 1 h: arrays of geometry, flow and C that differ in any bit; largest |X_A / X_m - 1|.
    """
    scene = runs.base("1 h", 'kinetics.decay_coefficient="0 1/d"', 'kinetics.maximum_utilization_rate="0 1/d"',
                      *changes)
    first, last = list(simulate(scene))
    pairs = [(report.pore.mesh.points, report.pore.body.theta, report.pore.inert, report.solved.flow.velocity,
              report.solved.flow.head, report.solved.concentrations.acceptor, report.solved.concentrations.donor)
             for report in (first, last)]
    differing = sum(not np.array_equal(a, b) for a, b in zip(*pairs))
    record(at_most("arrays that differ", differing, 0.0, "nothing changes: bit for bit"),
           at_most("X_A", runs.density_drift(scene, last), 1e-14, "(34) multiplies and divides by the same areas"),
           at_most("C over the supply, less 1", _lack(last),
                   *(LINEAR_BOUND if scene.numerics.scheme.order == 1 else HIGHER_BOUND)))


def _lack(instant: Report) -> float:
    """Largest |C / supply - 1|."""
    return np.abs(both(instant.solved.concentrations) / 10.0 - 1).max()


def _poiseuille(scene: Scene) -> float:
    """Mean velocity (um/h) of the clean channel under the scene's head."""
    viscosity = scene.flow.kinematic_viscosity / scene.flow.gravity
    return scene.flow.head / poiseuille.head_loss(scene.pore.length, scene.pore.width, 1.0, viscosity)


#: Bounds of |C / supply - 1|. w is divergence-free against the functions of C if these are linear. Taylor-Hood's u is
#: divergence-free against functions of one order less, and jumps of viscosity bend it.
LINEAR_BOUND = 1e-12, runs.ROUND_OFF
HIGHER_BOUND = 1e-4, "div u is zero against functions of one order less than C's: error in space"


@pytest.mark.case(
    "coupling-equal-viscosities", kind="property", mutants=("tau-jumps", "stale-flow", "extent-not-subtracted"),
    references=("poiseuille",), runs_with="paper")
@parametrize("*changes", runs.EVERY)
def test_equal_viscosities(changes, record):
    """The flow through a growing aggregate with the viscosity of water is that of an empty channel.

    Norm: relative difference of the mean velocity from Poiseuille's, and of u from that in an empty channel on the same
    mesh; base from 25 um, 1 h, lambda = 1.
    """
    scene = runs.base("1 h", 'aggregate.radius="25 um"', "flow.viscosity_ratio=1.0", *changes)
    first, last = list(simulate(scene))
    grid = last.pore.mesh
    computed = last.solved.flow
    bare = replace(grid, topology=replace(grid.topology, region=0 * grid.topology.region))
    empty = flow.unit_flow(Space(bare), Viscous(7.0))
    record(at_most("u", np.abs(computed.velocity / computed.mean_velocity - empty.velocity).max(), 1e-13,
                   runs.ROUND_OFF),
           at_most("mean velocity", abs(computed.mean_velocity / _poiseuille(scene) - 1), 5e-3,
                   "linear elements: first order in the mesh, 0.3 % as in a clean channel"),
           at_least("growth of the area", last.pore.outline.area / first.pore.outline.area, 1.1,
                    "else nothing is tested"))


@pytest.mark.case("coupling-stiffness", kind="property", mutants=("modulus-in-the-shape",), runs_with="paper")
@parametrize("*changes", runs.EVERY)
def test_stiffness(changes, record):
    """Without tractions the shape does not depend on mu_L: 0.001 and 10 MPa give the same aggregate.

    Norm: largest difference of a node's position (um) at 1 h.
    """
    soft, stiff = (runs.last(runs.base("1 h", f'growth.shear_modulus="{value} MPa"', *changes)).pore
                   for value in (0.001, 10))
    seed = seeded(runs.base("1 h", *changes)).outline.area
    record(at_most("positions", np.abs(soft.mesh.points - stiff.mesh.points).max(), 0.0,
                   "without tractions mu_L does not occur in the equations"),
           at_least("growth of the area", soft.outline.area / seed, 1.1, "else nothing is tested"))


EVERY_HOUR = (1.0, 2.0, 3.0, 4.0, 5.0, 6.0)
OF_UPDATES = 1e-8, "J = theta to the stabilisation, and C to 1e-8 of the supply: D is a million times D_A"


@pytest.mark.case(
    "coupling-uniform-growth", kind="exact",
    mutants=("growth-three-percent-low", "euler-biomass", "inert-not-in-the-area", "theta-anew-at-a-remesh",
             "geometry-of-the-step-before"), runs_with="paper")
@parametrize("*changes", runs.every(0.3))
def test_uniform_growth(changes, record):
    """If diffusion keeps the supply everywhere, the aggregate stays a half-disc through a remesh, and its mass grows
    exactly exponentially.

    Norm: largest relative error of area and mass, every hour to 6 h; largest deviation of the outline from a half-disc.
    """
    scene = runs.supplied_everywhere(runs.base("6 h", *changes, times=EVERY_HOUR))
    seed = seeded(scene).outline
    instants = runs.reports_of(scene)
    expected = seed.area * np.array([runs.mass_after(scene, hour) for hour in EVERY_HOUR])
    sizes = {"area": [instant.pore.outline.area for instant in instants],
             "mass": [instant.pore.mass / scene.kinetics.maximum_density for instant in instants]}
    record(each_at_most({name: np.abs(size / expected - 1).max() for name, size in sizes.items()}, *OF_UPDATES),
           at_most("outline", _unround(instants[-1], expected[-1]), *_roundness(scene, seed)),
           at_least("remeshes", sum(i.remeshes for i in instants), 1.0, "else they are not tested"))


def _roundness(scene, seed) -> tuple[float, str]:
    """Bound of the deviation of the outline from a half-disc, and its origin."""
    if seed.geometry == 2:
        return 1e-4, "arcs that are parabolas: (edge / R)^4 / 100"
    chord = 1 - np.sqrt(2 * seed.area / np.pi) / scene.aggregate.radius
    return 1.5 * chord + 1e-3, "polygon for arc, and linear elements"


def _unround(instant, area: float) -> float:
    """Largest distance of the interface's nodes from the half-disc with an area, over its radius."""
    outline = instant.pore.outline
    radius = np.hypot(*outline.points[outline.wall == FREE].T)
    return np.abs(radius / np.sqrt(2 * area / np.pi) - 1).max()


#: The scene base to 1 h in other units.
FOREIGN = ('pore.width="0.05 mm"', 'pore.length="0.06 cm"', 'aggregate.radius="5e-6 m"', 'flow.head="1e-5 m"',
           'substrates.acceptor.supply="10 g/m^3"', 'substrates.donor.supply="0.01 g/L"',
           'substrates.acceptor.diffusivity="232 mm^2/day"', 'flow.gravity="981 cm/s^2"',
           'flow.kinematic_viscosity="1.003e-6 m^2/s"', 'kinetics.maximum_density="30 g/L"',
           'growth.time_step="720 s"', 'growth.shear_modulus="10 kPa"')


@pytest.mark.case("coupling-foreign-units", kind="property", mutants=("rounded-twice",), runs_with="1 2")
@parametrize("*changes", runs.WITH_EXACT)
def test_foreign_units(changes, record):
    """A scene written in other units is the same scene, bit for bit.

    Norm: largest difference of a node's position (um), and of C, at 1 h.
    """
    standard = runs.last(runs.base("1 h", *changes))
    foreign = runs.last(runs.base("60 min", *changes, *FOREIGN))
    pairs = {"positions": (standard.pore.mesh.points, foreign.pore.mesh.points),
             "C_A": (standard.solved.concentrations.acceptor, foreign.solved.concentrations.acceptor)}
    differences = {name: np.abs(a - b).max() for name, (a, b) in pairs.items()}
    record(each_at_most(differences, 0.0, "the same numbers after reading"))


@pytest.mark.case(
    "coupling-mirror", kind="property", mutants=("one-supply-held", "fixed-beside-the-middle"), runs_with="paper")
@parametrize("*changes", runs.every(0.5))
def test_mirror(changes, record):
    """Without flow an aggregate grows equally to both sides.

    Norm: difference of the tips' distances from the origin, and of C_A left and right, relative.
    """
    last = runs.last(runs.without_flow(runs.base("8 h", *changes)))
    outline, space = last.pore.outline, last.pore.space
    tips = abs(outline.downstream + outline.upstream) / outline.downstream
    x = np.linspace(1.0, 70.0, 70)
    sides = [meshes.field_at(space, last.solved.concentrations.acceptor, np.column_stack([s * x, 0.3 + 0 * x]))
             for s in (-1, 1)]
    record(at_most("tips", tips, 3e-6, "unsymmetric mesh: a tenth of the error of C_A"),
           at_most("C_A", np.abs(np.subtract(*sides)).max() / 10.0, 1e-4, "unsymmetric mesh: error in space"),
           at_least("area over the seed's", outline.area / 39.27, 2.0, "else nothing is tested"))


SLOWER = (16.0, 8.0, 4.0, 2.0)


@pytest.mark.slow
@pytest.mark.case(
    "coupling-quasi-steady", kind="property", mutants=("rates-two-percent-low",), runs_with="paper",
    omitted="fast, accurate, exact: the transient scheme requires updates")
@parametrize("*changes", runs.kinds(0.4))
def test_quasi_steady(changes, record):
    """The paper's transient scheme and quasi-steady substrates give the same aggregate, up to the lag of the
    substrates, which is proportional to their storage.

    Norm: relative difference at 0.6 h, and that of C_A at the nodes over the supply; base from 25 um at 2.9 m/d, with
    D, u and X_m divided by 16 to 2: steady states and growth do not change, and substrates are 16 to 2 times slower.
    """
    errors = refine(_lag, SLOWER, *changes)
    record([study(name, SLOWER, values, 1, "lag: first order in storage over reaction, 2e-4 for base", ceiling=3e-6,
                  band=0.15) for name, values in errors.items()])


def _lag(factor: float, *changes: str) -> dict[str, float]:
    """Difference between the quasi-steady and the transient run, with substrates ``factor`` times slower relative to
    growth."""
    quasi_steady, transient = (runs.last(_slower(factor, name, *changes)) for name in ("quasi_steady", "gear"))
    expected = runs.numbers(transient)
    difference = quasi_steady.solved.concentrations.acceptor - transient.solved.concentrations.acceptor
    return {**{name: abs(value / expected[name] - 1) for name, value in runs.numbers(quasi_steady).items()},
            "C_A": np.abs(difference).max() / 10.0}


def _slower(factor: float, transport: str, *changes: str):
    scene = runs.base("0.6 h", 'aggregate.radius="25 um"', f'numerics.transport="{transport}"',
                      f'kinetics.maximum_density="{30 / factor} g/L"', *changes)
    scene = runs.with_diffusivities(scene, lambda water, biomass: (water / factor, biomass / factor))
    return runs.at_velocity(scene, runs.SPEED / factor)


@pytest.mark.slow
@pytest.mark.case(
    "coupling-extent", kind="property", mutants=("extent-not-subtracted", "inlet-held", "head-on-the-mesh-alone"),
    runs_with="paper")
@parametrize("*changes", {f"R = {radius}, {label}": (f'aggregate.radius="{radius}"', *changes)
                          for radius, labelled in (("5 um", runs.kinds(0.6, 2.0)), ("25 um", runs.every(0.6, 2.0)))
                          for label, changes in labelled.items()})
def test_extent(changes, record):
    """The central mesh, with (6) and (26) beyond it, gives the results of a mesh of the whole pore.

    Norm: relative difference of conductivity and effluents, and difference of section means of C along the central
    mesh over the supply; t = 0, refinement 2 (linear) and 0.6.
    """
    (central, near), (full, far) = (_solved(f'numerics.extent="{name}"', *changes) for name in ("central", "full"))
    for name, bound in BOUNDS.items():
        record(at_most(name, abs(central[name] / full[name] - 1), *bound))
    record(at_most("C", np.abs(near - far).max() / 10.0, *BOUNDS_OF_C.get(changes[1:], (4e-4, IN_SPACE))))


IN_SPACE = "error in space, 0.1 % at refinement 1, a quarter of that here"
#: Bound of the difference of section means of C on the coarser mesh of a preset.
BOUNDS_OF_C = {(runs.with_preset("fast"),): (2.5e-3, "error in space: a quarter of the 1 % that the preset promises")}
BOUNDS = {"conductivity": (1e-3, "first order in the mesh: 0.17 % in a clean channel at this refinement; both meshes "
                           "share most of it"),
          "effluent acceptor": (4e-4, IN_SPACE), "effluent donor": (4e-4, IN_SPACE)}


def _solved(*changes: str):
    """Conductivity and effluents of base at t = 0, and section means along its central mesh."""
    scene = load_scene("base", changes)
    seed = seeded(scene)
    solved = solving.solve(scene, seed)
    reach = min(10 * scene.aggregate.radius, 1.5 * scene.pore.width) + scene.aggregate.radius
    x = np.linspace(-reach, reach, runs.SECTIONS)
    leaving = {f"effluent {name}": flux.effluent for name, flux in zip(NAMES, solved.fluxes)}
    return {"conductivity": solved.flow.conductivity, **leaving}, runs.section_means(seed, solved, x)


RULE_STEPS = (1, 2, 4, 8, 16)


def _equal_steps(scene, steps: int) -> np.ndarray:
    """Area and upstream tip after 2 h in equal steps on one mesh. Raises RuntimeError at a remesh."""
    state = seeded(scene)
    for _ in range(steps):
        solved = solving.solve(scene, state)
        state = replace(state, concentrations=solved.concentrations)
        step = midpoint.attempt(Stages.of(scene), state, solved, 2.0 / steps).step
        if step.remeshed:
            raise RuntimeError("a new mesh: the error in space would not be common")
        state = step.pore
    return np.array([state.outline.area, state.outline.upstream])


@pytest.mark.case(
    "coupling-midpoint-order", kind="property", mutants=("curved-rates-of-the-start", "midpoint-rates-of-the-start"),
    runs_with="fast",
    omitted="paper: coupling-averaged-base; accurate, exact: equal steps have no tolerance, as in fast")
@parametrize("elements", {each: (each,) for each in runs.ELEMENTS}, slow=("quadratic",))
def test_midpoint_order(elements, record):
    """The midpoint rule is of second order in time, with every kind of elements.

    Norm: relative difference between a run and that with half the step; base from a seed of 25 um, 2 h, no remesh.
    """
    scene = load_scene("base", (runs.with_preset("fast"), runs.with_elements(elements), "numerics.refinement=0.5",
                                'aggregate.radius="25 um"'))
    values = np.array([_equal_steps(scene, steps) for steps in RULE_STEPS])
    changes = np.abs(np.diff(values, axis=0) / values[-1])
    record([study(name, 2 / np.array(RULE_STEPS[:-1]), column, 2, "midpoint rule", ceiling=2e-5, band=0.15)
            for name, column in zip(("area", "upstream tip"), changes.T)])


TIMES = (19.2, 19.4)


@cache
def _reference():
    """Numbers of base at TIMES (2, 8) by the independent solver, and the largest estimate of their error."""
    solution = whole_run.converged(whole_run.Pore(), TIMES, rings=(6, 8), steps=(8, 16))
    farthest = solution.values + np.abs(solution.space) + np.abs(solution.time)
    return solution.values, runs.errors(farthest, solution.values).max()


@pytest.mark.slow
@pytest.mark.case(
    "coupling-presets", kind="cross-code",
    mutants=("curved-rates-of-the-start", "fluid-diffusivity", "uptake-without-decay", "exact-steps-of-accurate",
             "sketch-steps-too-long"),
    references=("whole_run",), runs_with="2",
    omitted="paper, order 1: its error is that of linear elements, see bench")
@parametrize(
    "bound, preset", {"sketch": (1e-2, "sketch"), "fast": (1e-2, "fast"), "accurate": (1e-3, "accurate"),
                      "exact": (1e-4, "exact")})
def test_presets(bound, preset, record):
    """Each of the eight numbers of base is within 1 % with presets sketch and fast, within 0.1 % with accurate, and
    within 0.01 % with exact.

    Norm: largest difference at 19.2 and 19.4 h to an independent solver, extrapolated in space and time: relative, of
    effluents over the supply.
    """
    expected, error = _reference()
    record(at_most("error of the reference", error, 5e-5, "half of the bound for exact"))
    computed = runs.values(TIMES, runs.with_preset(preset))
    for name, errors in zip(whole_run.NAMES, runs.errors(computed, expected).T):
        record(at_most(name, errors.max(), bound, "the error that the preset promises"))


@pytest.mark.case("coupling-jacobian-reused", kind="property", mutants=("newton-never-reused",))
@parametrize("*changes", {**{f"{kind}, fast": (runs.with_preset("fast"), runs.with_elements(kind))
                             for kind in runs.ELEMENTS},
                          "linear, paper": (runs.with_preset("paper"),),
                          "quadratic, accurate": (runs.with_preset("accurate"),),
                          "quadratic, exact": (runs.with_preset("exact"),)})
def test_jacobian_reused(changes, record):
    """Newton's methods that reuse a derivative give the same results with fewer factorisations.

    Norm: relative difference of the area, the tips and the conductivity at 2 h; factorisations over those with fresh
    derivatives; base from a seed of 25 um.
    """
    (fresh, fresh_count), (modified, modified_count) = (_factorisations(kept, *changes) for kept in (False, True))
    record(at_most("difference", np.abs(modified / fresh - 1).max(), 1e-8,
                   "Newton's tolerances, 1e-10 and less, times the steps"),
           at_most("factorisations", modified_count / fresh_count, 0.8, "a third of Newton's factorisations is saved"))


def _factorisations(modified: bool, *changes: str) -> tuple[np.ndarray, int]:
    """Area, tips and conductivity at 2 h, and the number of factorised matrices."""
    scene = runs.base("2 h", *changes, 'aggregate.radius="25 um"', 'growth.time_step="1 h"',
                      exchange(modified_newton=modified))
    with mock.patch.object(linear, "factorised", wraps=linear.factorised) as factorised:
        last = runs.last(scene)
    shape, flow = last.pore.outline, last.solved.flow
    return np.array([shape.area, shape.upstream, shape.downstream, flow.conductivity]), factorised.call_count
