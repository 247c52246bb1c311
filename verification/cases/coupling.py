"""Limits, symmetries and time steps of the coupled model.

Limits: no growth, no biomass, no viscosity jump, no stiffness, and growth at the supply, where the area follows
(9)-(10) in closed form.

Results do not depend on units, on left and right, or, where the theory is reversible, on the direction of flow. They
hardly depend on the time step, on storage of the substrates, or on the meshed part of the pore.

The midpoint rule and the presets: order in time, the limit of the paper's updates, an independent solver.
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
from repro.march.simulation import shaped, simulate
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


REFINEMENTS = (1.0, 1.4, 2.0, 2.8)
#: Origins of the bounds in a clean channel: linear elements, and the others.
LAYER = "first order: the stabilisation spoils one layer of elements at both ends of the mesh"
PARABOLA = "the elements contain the parabola: round-off"


@pytest.mark.case(
    "coupling-clean-channel", kind="exact", mutants=("extent-not-subtracted", "head-on-the-mesh-alone"),
    references=("poiseuille",), runs_with="paper")
@parametrize("*changes", runs.every(0.3))
def test_clean_channel(changes, record):
    """A scene without an aggregate is a clean channel: Poiseuille's flow under the head, and C the supply everywhere.

    Norm: refinement 1 to 2.8: mean velocity under the head relative to Poiseuille's; largest |C / supply - 1|.

    Record the order of linear elements, and the errors of the others.
    """
    if load_scene("base", changes).numerics.scheme.order > 1:
        error, lack = _clean(*changes)
        record(at_most("mean velocity", error, 1e-9, PARABOLA))
    else:
        errors, lacks = zip(*(_clean(*changes, f"numerics.refinement={refinement}") for refinement in REFINEMENTS))
        lack = max(lacks)
        record(study("mean velocity", 1 / np.array(REFINEMENTS), errors, 1, LAYER, ceiling=2e-3))
    record(at_most("C", lack, 1e-12, runs.ROUND_OFF))


def _clean(*changes: str) -> tuple[float, float]:
    """Relative error of the mean velocity; largest |C / supply - 1|."""
    scene = load_scene("base", changes)
    report = next(simulate(replace(scene, aggregates=(), kinetics=None, growth=None)))
    return abs(report.solved.flow.mean_velocity / _poiseuille(scene) - 1), _lack(report)


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
                   "linear elements: first order in the mesh, 0.3 % as in coupling-clean-channel"),
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
OF_LONG_STEPS = 1e-6, "J = theta, and C to 1e-7 of the supply"
#: Changes of a scene, by label, with the steps of a preset.
LONG = {**{kind: (runs.with_preset("fast"), runs.with_elements(kind), runs.coarser(kind, 0.2))
           for kind in runs.ELEMENTS},
        **{preset: (runs.with_preset(preset),) for preset in runs.QUADRATIC[1:]}}


def uniform_growth(hours: tuple[float, ...], bound: float, origin: str, *changes: str):
    """Checks of a run with rows at some hours, the last of which is its end."""
    scene = runs.supplied_everywhere(runs.base(f"{hours[-1]} h", *changes, times=hours))
    seed = seeded(scene).outline
    instants = runs.reports_of(scene)
    expected = seed.area * np.array([runs.mass_after(scene, hour) for hour in hours])
    sizes = {"area": [instant.pore.outline.area for instant in instants],
             "mass": [instant.pore.mass / scene.kinetics.maximum_density for instant in instants]}
    yield each_at_most({name: np.abs(size / expected - 1).max() for name, size in sizes.items()}, bound, origin)
    yield at_most("outline", _unround(instants[-1], expected[-1]), *_roundness(scene, seed))
    yield at_least("remeshes", sum(i.remeshes for i in instants), 1.0, "else they are not tested")


@pytest.mark.case(
    "coupling-uniform-growth", kind="exact",
    mutants=("growth-three-percent-low", "euler-biomass", "inert-not-in-the-area", "theta-anew-at-a-remesh",
             "geometry-of-the-step-before"), runs_with="paper")
@parametrize(
    "*setup",
    {kind: (EVERY_HOUR, *OF_UPDATES, *changes) for kind, changes in runs.every(0.3).items()})
def test_uniform_growth(setup, record):
    """If diffusion keeps the supply everywhere, the aggregate stays a half-disc through a remesh, and its mass grows
    exactly exponentially.

    Norm: largest relative error of area and mass, every hour to 6 h; largest deviation of the outline from a half-disc.
    """
    record(uniform_growth(*setup))


@pytest.mark.case(
    "coupling-curved-uniform-growth", kind="exact",
    mutants=("theta-power", "curved-mass-lost", "curved-half-of-the-half"), runs_with="fast",
    omitted="paper: coupling-uniform-growth")
@parametrize("*setup", {kind: ((9.0,), *OF_LONG_STEPS, *changes) for kind, changes in LONG.items()})
def test_curved_uniform_growth(setup, record):
    """If diffusion keeps the supply everywhere, the aggregate stays a half-disc through remeshes and a few long steps
    of the midpoint rule, and its mass grows exactly exponentially.

    Norm: relative error of area and mass; largest deviation of the outline from a half-disc.
    """
    record(uniform_growth(*setup))


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


@pytest.mark.case("coupling-reversed", kind="property", mutants=("inlet-held",), runs_with="paper")
@parametrize("*changes", runs.every(0.6, 2.0))
def test_reversed(changes, record):
    """Reversed flow has the same resistance (Stokes flow is reversible). If uptake is of first order, it loses the same
    amount of substrate (reciprocity of (7), (11) and (12)).

    Norm: relative difference between a lopsided aggregate and its mirror image, refinement 2, t = 0.
    """
    forward, mirrored = (_lopsided(sign, *changes) for sign in (1.0, -1.0))
    differences = {name: abs(forward[name] / mirrored[name] - 1) for name in forward}
    record(at_most("conductivity", differences["conductivity"], 3e-4, ERROR),
           at_most("effluent", differences["effluent"], 3e-4, ERROR),
           at_least("C at the inlet, which no theorem constrains", differences["inlet"], 3e-3,
                    "else the aggregate is not lopsided"))


ERROR = "error in space: linear elements 9e-4, 2e-4, 6e-5 at refinement 1, 1.4, 2"


#: Uptake of the donor alone, 0.5/h C_D / (1 mg/L).
FIRST_ORDER = ('substrates.acceptor.half_saturation="1e-9 mg/L"', 'substrates.donor.half_saturation="1e9 mg/L"',
               'kinetics.maximum_utilization_rate="5e8 1/h"', 'kinetics.decay_coefficient="0 1/d"',
               "kinetics.acceptor_to_donor_ratio=1e-12")


def _lopsided(sign: float, *changes: str) -> dict[str, float]:
    """Conductivity, and C at the outlet and the inlet, with uptake of first order."""
    scene = load_scene("base", (*changes, *FIRST_ORDER))
    scene = shaped(scene, _outline(sign, 80 * scene.numerics.scheme.order))
    solved = solving.solve(scene, seeded(scene))
    donor = solved.fluxes[1]
    return {"conductivity": solved.flow.conductivity, "effluent": donor.effluent, "inlet": donor.inlet}


def _outline(sign: float, edges: int) -> np.ndarray:
    """(edges + 1, 2) um: r = 24 um (1 + 0.35 cos a - 0.15 cos 2a), or its mirror image for sign = -1."""
    angle = np.linspace(np.pi, 0.0, edges + 1)
    radius = 24.0 * (1 + 0.35 * sign * np.cos(angle) - 0.15 * np.cos(2 * angle))
    return runs.standing(radius * np.cos(angle), radius * np.sin(angle))

#: Shape updates (h).
STEPS = (0.8, 0.4, 0.2, 0.1)


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
    omitted="paper: coupling-midpoint-limit; accurate, exact: equal steps have no tolerance, as in fast")
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


@pytest.mark.slow
@pytest.mark.case(
    "coupling-midpoint-limit", kind="property",
    mutants=("midpoint-rates-of-the-start", "rates-at-the-start", "stale-flow"), runs_with="paper",
    omitted="fast, accurate, exact: coupling-midpoint-order; their own tolerances would show")
@parametrize("*changes", runs.kinds(0.3, 0.6))
def test_midpoint_limit(changes, record):
    """With short steps the paper's shape updates and the midpoint rule agree on the same triangles: the loop of updates
    has first order in the step, because the geometry is frozen within a step.

    Norm: relative difference at 3.2 h from a seed of 25 um, base, no remesh.
    """
    short = (exchange(steps="midpoint"), "numerics.tolerance=0.00003")
    reports = [runs.last(runs.base("3.2 h", 'aggregate.radius="25 um"', *changes, *setting))
             for setting in (short, *((f'growth.time_step="{step} h"',) for step in STEPS))]
    record(at_most("remeshes, all runs", sum(instant.remeshes for instant in reports), 0.0,
                   "one mesh: the error in space is common"))
    exact, *rows = map(runs.numbers, reports)
    for name, value in exact.items():
        record(study(name, STEPS, [abs(row[name] / value - 1) for row in rows], 1, "frozen geometry: first order",
                     ceiling=2e-3, band=0.15))


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
