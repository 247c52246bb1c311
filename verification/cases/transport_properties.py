"""Properties of every solution: the balance closes, nothing is negative, and there is one steady state.

Substrates around a half-disc in scenes, including sharp fronts and fast water, are compared with finer meshes. A step
of the midpoint rule takes up substrates with the mean biomass of the step, at steady concentrations. At constant C_A
and C_D this is the integral of (7)-(10), and the new biomass balances the uptake.
"""

from contextlib import suppress
from dataclasses import replace
from functools import cache
from itertools import product

import numpy as np
import pytest

from reference.monod import uptake
from repro.errors import Unresolved
from repro.march.simulation import simulate
from repro.model import biomass, gear, grading, kinetics, solving, transport
from repro.model.kinetics import Sink
from repro.model.meshing import seeded
from repro.model.transport import Balance, Concentrations
from repro.scene import Scene
from verification.cases.transport_codes import box_around
from verification.evidence.cases import combined, parametrize
from verification.evidence.checks import Check, Study, at_least, at_most, each_at_most, study
from verification.problems import runs
from verification.problems.channels import NAMES, ORDERS, SCENE, both, rates, substrates_with
from verification.problems.schemes import Change, exchange, load_scene, scheme_on

SLOW = 0.35e6 / 24
#: Radius (um) and supplies of acceptor and donor (mg/L) of pores at 0.35 m/d whose biomass could take up far more.
STARVED = [(radius, *supplies) for radius in (27.0, 42.0)
           for supplies in ((0.15, 0.15), (0.15, 10.0), (10.0, 0.15), (10.0, 10.0))]
#: Changes of the scene base, whose preset is paper: elements of each order (curved ones are coarser), and presets.
KINDS: dict[str, tuple[Change, ...]] = {
    "linear, paper": (),
    "quadratic": (runs.with_elements("quadratic"), "numerics.refinement=0.5"),
    "fast": ('numerics.preset="fast"',), "accurate": ('numerics.preset="accurate"',)}
ROUND_OFF = "the sum of the weak form over its test functions; rows are solved to 1e-13 of terms 1e3 times the supply"


@cache
def _solved(kind: tuple[Change, ...], radius: float, acceptor: float = 10.0, donor: float = 10.0,
            speed: float | None = runs.SPEED, inlet: str = ""):
    """(Pore, Solved); speed: um/h, None: no flow; inlet: another one than that of the preset."""
    exchanges = [exchange(inlet=inlet)] if inlet else []
    scene = load_scene("base", [f'aggregate.radius="{radius} um"', f'substrates.acceptor.supply="{acceptor} mg/L"',
                                f'substrates.donor.supply="{donor} mg/L"', *exchanges, *kind])
    scene = runs.without_flow(scene) if speed is None else runs.at_velocity(scene, speed)
    seed = seeded(scene)
    return seed, solving.solve(scene, seed)


def _defect(flux) -> float:
    """(supplied - out - consumed) / supplied of a substrate."""
    return (flux.supplied - flux.out - flux.consumed) / flux.supplied


@pytest.mark.case(
    "transport-balance", kind="property",
    mutants=("carried-by-u", "weights-of-the-ends", "ledger-of-backward-euler", "printed-inlet-forgotten",
             "outlet-forgotten"))
@parametrize("kind", combined(KINDS))
def test_balance(kind, record):
    """The supply equals out + consumed to round-off, with flow and without, and with the printed inlet (11) if its
    (u_ave - u_x) C is counted [E4]. In the transient scheme it equals out + consumed + stored. Both hold with linear
    and quadratic elements.

    Norm: supplied - out - consumed over supplied; in time, less stored.
    """
    pores = {"R = 5 um": _solved(kind, 5.0), "R = 40 um": _solved(kind, 40.0),
             "R = 20 um, no flow": _solved(kind, 20.0, speed=None),
             "R = 30 um, printed inlet": _solved(kind, 30.0, speed=SLOW, inlet="mean")}
    for title, (seed, solved) in pores.items():
        beyond = _by_the_printed_inlet(seed, solved) if "printed" in title else (0.0, 0.0)
        for name, flux, enters in zip(NAMES, solved.fluxes, beyond):
            record(at_most(f"{name}, {title}", abs(_defect(flux) - enters), 1e-9, ROUND_OFF))
    timed = [pores["R = 5 um"], pores["R = 20 um, no flow"]]
    if seed.space.order == 1:
        timed.append(_solved(kind, 42.0, 10.0, 0.15, SLOW))
    record([_in_time(*solution) for solution in timed])


def _by_the_printed_inlet(seed, solved) -> list[float]:
    """(u_ave - u_x) C at the inlet over the supply, of both substrates.

    The integral is that of the weak form, lumped at the nodes with linear elements. The flux that enters is u_ave C_s
    less this.
    """
    space = seed.space
    difference = solved.flow.mean_velocity - solved.flow.velocity[:, 0]
    weight = space.inlet.assembled(difference)
    return [weight @ field / flux.supplied for field, flux in zip(both(solved.concentrations), solved.fluxes)]


AS_PRINTED = "numerics.preset=as_printed"
#: A seed just under the least film, which has a new mesh at contact.
TO_CONTACT = ('pore.width="20 um"', 'aggregate.radius="17.98 um"', 'flow.head="1e-2 cm"', 'growth.end="0.4 h"',
              "numerics.refinement=0.3", 'output.times=["0.4 h"]')


@pytest.mark.case(
    "transport-as-printed", kind="exact",
    mutants=("as-printed-carried-by-w", "as-printed-enters-locally", "as-printed-at-rest", "as-printed-projects"),
    runs_with="1", omitted="paper, order 2: they conserve, see transport-balance")
@pytest.mark.parametrize("radius", [5.0, 20.0, 40.0])
def test_as_printed(radius, record):
    """The scheme as printed loses what its parts lose: u, whose divergence is not zero in linear elements, makes
    substrate in the water; u_ave brings other amounts than u_x(y) carries away [E4]; interpolation to a new mesh makes
    or loses biomass [E8]; and the substrates are stored in the water (3.3).

    Norm: supplied - out - consumed over supplied at t = 0, less the integral of u . grad C over the mesh beyond the
    flux through its ends, less (u_ave - u_x) C at the inlet; the parts themselves.
    """
    seed, solved = _solved((AS_PRINTED,), radius)
    entering = _by_the_printed_inlet(seed, solved)
    for name, flux, field, enters in zip(NAMES, solved.fluxes, both(solved.concentrations), entering):
        made = _made_in_the_water(seed, solved, field) / flux.supplied
        record(at_most(f"{name}, defect less its parts", abs(_defect(flux) - made - enters), 1e-9, ROUND_OFF),
               at_least(f"{name}, made by u", abs(made), 1e-7, "not round-off"),
               at_least(f"{name}, brought by u_ave", abs(enters), 1e-7, "not round-off"))
    ledgers = [ledger for instant in simulate(load_scene("base", [AS_PRINTED, *TO_CONTACT]))
               for ledger in instant.ledgers]
    stored = max(abs(np.array(ledger.stored)).max() / max(ledger.supplied) for ledger in ledgers)
    record(at_least("biomass made or lost by interpolation, over the biomass", runs.biomass_defect(ledgers), 1e-9,
                    "not round-off"),
           at_least("stored in a step over supplied", stored, 1e-9, "not round-off"))


def _made_in_the_water(seed, solved, field: np.ndarray) -> float:
    """The integral of u . grad C on linear triangles less the flux u_x C through the ends, um2 mg/L/h."""
    mesh, u = seed.mesh, solved.flow.velocity
    corners, values = mesh.points[mesh.triangles], field[mesh.triangles]
    along, across = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    rises = values[:, 1:] - values[:, :1]
    twice_area = along[:, 0] * across[:, 1] - along[:, 1] * across[:, 0]
    gradient = np.stack([rises[:, 0] * across[:, 1] - rises[:, 1] * along[:, 1],
                         rises[:, 1] * along[:, 0] - rises[:, 0] * across[:, 0]], axis=1)  # times twice_area
    within = 0.5 * np.sum(np.sign(twice_area)[:, None] * u[mesh.triangles].mean(axis=1) * gradient)
    space = seed.space
    return within - (space.outlet.assembled(u[:, 0]) - space.inlet.assembled(u[:, 0])) @ field


def _in_time(seed, solved):
    """Check the balance over 36 s in controlled steps from the supply everywhere."""
    start = transport.supplied_everywhere(solved.problem)
    step = gear.advance(solved.problem, seed.active, seed.inert, start, 0.01)
    label = f"R = {seed.outline.thickness:.0f} um, in time" + ("" if solved.flow else ", no flow")
    return [at_most(f"{name}, {label}", abs(supplied - out - consumed - stored) / supplied, 3e-12,
                    "fluxes are integrated by the formula of the concentrations: round-off")
            for name, (supplied, out, consumed, stored, *_) in zip(NAMES, zip(*step.flows))]


@pytest.mark.case("transport-starved", kind="property", mutants=("newton-in-concentrations", "newton-stopped-early"))
@parametrize(
    "kind, radius, *supplies",
    {f"R = {row[0]:g} um, supplies {row[1]:g}, {row[2]:g} mg/L, {label}": (kind, *row)
     for (label, kind), row in product(KINDS.items(), STARVED)})
def test_starved(kind, radius, supplies, record):
    """Starved pores (0.35 m/d, radius 27 and 42 um, supplies of 0.15 and 10 mg/L) have one steady state, with C >= 0
    and a balance that closes to round-off. It does not depend on the start of Newton's method, and the transient scheme
    comes to rest in it. With quadratic elements C is not below the accepted undershoot.

    Norm: least C over the supply; balance as above; largest relative difference between ways to the steady state.
    """
    seed, solved = _solved(kind, radius, *supplies, SLOW)
    computed, linear = both(solved.concentrations), seed.space.order == 1
    least = max(-(field.min() / supply) for field, supply in zip(computed, supplies))
    bound, why = (0.0, "C >= 0") if linear else (1e-3, "the accepted undershoot")
    record(at_most("least C below zero", max(least, 0.0), bound, why))
    record(at_most("balance", max(abs(_defect(flux)) for flux in solved.fluxes), 1e-9, ROUND_OFF))
    record(at_most("from other first iterates", _spread(seed, solved, computed), 1e-8, "one steady state"))
    if linear and radius == STARVED[0][0]:
        at_rest = both(gear.settle(solved.problem, Sink(seed.active), None))
        record(at_most("the transient scheme at rest", np.abs(at_rest / computed - 1).max(), 1e-7,
                       "it stops when 1e-9 of the supply is left to change"))


def _spread(seed, solved, computed) -> float:
    """Largest difference between steady states from rich and random first iterates, up to 30 mg/L.

    It is over the concentration with linear elements, and over the supply with others, which may be zero.
    """
    random = np.random.default_rng(1)
    shape = computed.shape
    guesses = [np.full(shape, 30.0), random.uniform(0, 30.0, shape), random.uniform(0, 0.1, shape)]
    size = computed if seed.space.order == 1 else solved.problem.supply.reshape(2, -1)
    states = [both(transport.steady(solved.problem, Sink(seed.active), Concentrations(*guess))) for guess in guesses]
    return max(np.abs((state - computed) / size).max() for state in states)


SUPPLY = SCENE.substrates.acceptor.supply
PAPER, FAST, ACCURATE = map(runs.with_preset, runs.PRESETS)
#: Numerics of the fronts, and bounds of the difference of effluents between their mesh and a finer one.
FINER = "numerics.refinement=0.45"
SOLVED = {"fast": ((FAST, "numerics.refinement=0.25"), 1e-2), "accurate": ((FAST, FINER), 1e-3),
          "linear": ((PAPER,), 1e-2)}
HALVES = {f"K_s = {half}": half for half in ("1e-2 mg/L", "1e-3 mg/L", "1e-5 mg/L")}


@pytest.mark.slow
@pytest.mark.case("transport-curved-front", kind="property", mutants=("unpaired",), runs_with="2 paper")
@parametrize("half, solved", combined(HALVES, SOLVED))
def test_curved_front(half, solved, record):
    """Behind a front where the donor is used up, to half saturations of a millionth of the supply, both are taken up in
    their proportion, with linear and quadratic elements, and effluents are within the presets' accuracy. If a mesh is
    refused, the refinement is that of the refusal.

    Norm: consumed acceptor over F times consumed donor, less one; difference of effluents over the larger supply, to a
    mesh of refinement 1.3.
    """
    numerics, bound = solved
    coarse, fine = _front(half, *numerics), _front(half, FAST, "numerics.refinement=1.3")
    ratio = coarse[0].consumed / coarse[1].consumed / SCENE.kinetics.acceptor_to_donor_ratio
    record(at_most("proportion", abs(ratio - 1), 1e-9, "one rate for both: exact to Newton's tolerance"))
    difference = max(abs(a.effluent - b.effluent) for a, b in zip(coarse, fine)) / SUPPLY
    record(at_most("effluents", difference, bound, "the error that the preset promises"))


@cache
def _front(half: str, *numerics: str):
    """Ledgers of a thick half-disc without decay, which the donor (1 mg/L) does not cross.

    Elements are graded to the front. If they are refused, larger refinements are tried.
    """
    halves = (f'substrates.{name}.half_saturation="{half}"' for name in NAMES)
    scene = _half_disc(100.0, 60.0, "0.29 m/day", *numerics, *halves, 'substrates.donor.supply="1 mg/L"',
                       'kinetics.decay_coefficient="0 1/day"')
    for factor in (1.0, 1.5, 2.0):
        with suppress(Unresolved):
            return _resolved(scene, factor)
    return _resolved(scene, 3.0)


def _resolved(scene: Scene, factor: float):
    """Ledgers with a multiple of the scene's refinement."""
    scene = replace(scene, numerics=replace(scene.numerics, refinement=factor * scene.numerics.refinement))
    return grading.solve_graded(scene, seeded(scene))[1].fluxes


def _half_disc(width: float, radius: float, speed: str, *changes: str) -> Scene:
    """A half-disc in the scene wide, with another width of the pore."""
    return load_scene("wide", (f'pore.width="{width} um"', f'aggregate.radius="{radius} um"',
                               f'flow.mean_velocity="{speed}"', *changes))


@cache
def _carried(*scene_arguments):
    """Ledgers of a half-disc at t = 0, on the first mesh."""
    scene = _half_disc(*scene_arguments)
    return solving.solve(scene, seeded(scene)).fluxes


WITHIN = "0.1 %, the error that preset accurate promises"
TENTH = "a tenth of the error that preset fast promises"
#: A half-disc under fast water: numerics, bound of the difference of effluents and consumption from those of quadratic
#: elements of refinement 2.5, and its origin.
FASTEST = {"quadratic, accurate": ((ACCURATE, runs.with_elements("quadratic"), FINER), 1e-3, WITHIN),
           "fast": ((FAST,), 1e-3, TENTH + ": its elements there are accurate's")}


@pytest.mark.slow
@pytest.mark.case(
    "transport-curved-peclet", kind="property", mutants=("layers-ignored",),
    omitted="order 1 and paper: linear elements are not graded to boundary layers")
@parametrize("speed, preset", combined({speed: speed for speed in ("2.9 m/day", "29 m/day", "290 m/day")}, FASTEST))
def test_curved_peclet(speed, preset, record):
    """In fast water (u W / D to 3e4) the presets accurate and fast resolve boundary layers to 0.1 %.

    Norm: difference of effluents, over the supply, and of consumption, relative, to a mesh of refinement 2.5.
    """
    numerics, bound, why = preset
    finer = _carried(100.0, 60.0, speed, ACCURATE, "numerics.refinement=2.5")
    for name, flux, expected in zip(NAMES, _carried(100.0, 60.0, speed, *numerics), finer):
        record(each_at_most({"effluent": abs(flux.effluent - expected.effluent) / SUPPLY,
                             "consumed": abs(flux.consumed / expected.consumed - 1)}, bound, why, f" {name}"))


#: Lengths of a step (h); X_A more than doubles in the last.
HOURS = (0.2, 2.0, 8.0)
#: The paper's kinetics and diffusivities with the supply at both ends. Both substrates fall towards the wall.
OPEN = substrates_with(acceptor={"supply": 1.0})
#: Elements of each order on their own meshes, and those of presets.
MEAN: dict[str, int | str] = {**ORDERS, "paper": PAPER, "fast": FAST, "accurate": ACCURATE}


def _open(numerics: int | str) -> transport.Problem:
    """Substrates around a half-disc, with elements of an order or of a preset."""
    if isinstance(numerics, int):
        space = box_around(numerics)
    else:
        space = seeded(_half_disc(50.0, 20.0, "2.9 m/day", numerics)).space
    return transport.problem(space, None, OPEN, SCENE.kinetics, scheme_on(space))


@pytest.mark.case(
    "transport-mean-biomass", kind="exact",
    mutants=("biomass-of-the-start", "biomass-half-way", "mean-biomass-constant-in-c"), references=("monod",))
@parametrize("numerics", combined(MEAN))
def test_mean_biomass(numerics, record):
    """With the mean biomass of a step of hours, the new biomass is Y donor - (acceptor - F donor) / d_c, of the donor
    and the acceptor taken up, to round-off at any concentrations. At constant concentrations the uptake is the integral
    of (7)-(10) over the step. The tangent is the derivative of the uptake.

    Norm: new biomass - (Y donor - (acceptor - F donor) / d_c), over the new biomass; uptake at constant C, relative;
    remainder of a first-order Taylor expansion.
    """
    problem = _open(numerics)
    for hours in HOURS:
        record(_balanced(problem, hours))
        record(_integrated(problem, hours))
    record(_tangent(problem, HOURS[-1]))


def _balanced(problem: transport.Problem, hours: float) -> Check:
    """Check new biomass against uptake, at the steady concentrations of a step."""
    law = SCENE.kinetics
    active = law.maximum_density * problem.space.reaction.dx
    sink = Sink(active, hours)
    state = transport.steady(problem, sink)
    acceptor, donor = (hours * flux.consumed for flux in transport.fluxes(problem, sink, state))
    growth_rates = biomass.rates(problem.space, state, problem.law)
    grown = np.sum(kinetics.grow(active, 0 * active, growth_rates.growth, growth_rates.remains, hours)) - active.sum()
    F, d_c = law.acceptor_to_donor_ratio, law.decay_oxygen_demand
    expected = law.yield_coefficient * donor - (acceptor - F * donor) / d_c
    return at_most(f"new biomass, {hours:g} h", abs(grown - expected) / grown, 1e-12,
                   "one integral of growth and uptake in each point: round-off")


def _integrated(problem: transport.Problem, hours: float) -> Check:
    """Check uptake at constant concentrations against the integral of (7)-(10) over a step of exponential X_A."""
    concentrations, seeded = np.array([0.7, 4.0]), 300.0
    everywhere = Concentrations(*np.outer(concentrations, np.ones(problem.space.count)))
    ledgers = transport.fluxes(problem, Sink(seeded * problem.space.reaction.dx, hours), everywhere)
    sinks = uptake(*concentrations, rates(SCENE.kinetics, OPEN))
    growth, _ = runs.growth_rates(SCENE.kinetics, OPEN, *concentrations)
    expected = seeded * np.array(sinks) * np.expm1(growth * hours) / growth
    computed = hours * np.array([flux.consumed for flux in ledgers]) / problem.space.reaction.dx.sum()
    return at_most(f"uptake at constant C, {hours:g} h", np.abs(computed / expected - 1).max(), 1e-10,
                   "the integral of an exponential: round-off")


def _tangent(problem: transport.Problem, hours: float) -> Study:
    """Study of the remainders of the residual along a direction."""
    random = np.random.default_rng(13)
    balance = Balance(problem, Sink(SCENE.kinetics.maximum_density * problem.space.reaction.dx, hours))
    state, along = random.uniform(0.5, 1.0, (2, 2 * problem.space.count))
    steps = 0.05 * 0.5 ** np.arange(4)
    linear, start = problem.system.product(balance.tangent(state), along), balance.residual(state)
    remainders = [np.abs(balance.residual(state + s * along) - start - s * linear).max() for s in steps]
    return study(f"tangent, {hours:g} h", steps, remainders, 2, "Taylor's theorem: second order")
