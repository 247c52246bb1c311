"""Substrates against other codes: steady and in time, in slabs, and in a well-mixed box.

Dual Monod uptake in a slab under plug flow, steady: against scipy's collocation. Peclet numbers u l / D_A are 0.1, 1
and 5. Thiele's modulus l sqrt(k F X / (K_A D_A)) is 0.6, 1.9 and 6; the last slab, at Peclet number 0.1, is starved:
3e-4 of the acceptor's supply leaves it.

The modified Gear scheme (3.3): from the supply everywhere towards the steady profiles of the slab. X_A does not change
(no yield, and less than 1e-5 of it decays). The scheme is compared with an integrator that makes no error of its own,
on the same mesh.

Closed pores in which diffusion evens out every concentration: (7)-(10) are four ordinary equations. A seed in a closed
box whose diffusivities are so large that C_A and C_D are uniform to 1e-6; X_A and X_I then are too. With ``share`` of
the box biomass,

    dC_A/dt = -share X_A m_A (k F m_D + d_c f_d b)        dX_A/dt = X_A m_A (k Y m_D - b)
    dC_D/dt = -share X_A k m_A m_D                        dX_I/dt = X_A m_A b (1 - f_d)

are integrated by scipy to 1e-11. The box is followed for five days, by when half of the acceptor is gone.
"""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial import cKDTree
from skfem import Basis, MeshTri
from skfem.models import poisson

from reference import channel_bvp
from reference.monod import sink, sink_derivative, uptake
from repro.fem import outline
from repro.fem.elements import ELEMENTS
from repro.fem.sizing import ACROSS_AGGREGATE
from repro.fem.space import Space
from repro.model import gear, kinetics, transport
from verification.evidence.cases import combined, parametrize
from verification.evidence.checks import at_most, refine, studies
from verification.problems import meshes, runs
from verification.problems.channels import (
    CROSSED,
    EXPECTED,
    NAMES,
    ORDERS,
    SAMPLES,
    SCENE,
    SLAB,
    WIDE,
    both,
    length,
    pair,
    problem,
    rates,
    rms_errors,
    slab_space,
    speed_of,
    steady,
    substrates_with,
    uniform_masses,
)
from verification.problems.schemes import scheme_on

LINEAR, QUADRATIC = {"linear": 1}, {"quadratic": 2}
PECLETS = {f"Pe = {peclet:g}": peclet for peclet in (0.1, 1.0, 5.0)}
DENSITIES = {f"X = {density:g} mg/L": density for density in (3e3, 3e4, 3e5)}
#: Peclet number and density of the starved slab.
STARVED = (0.1, 3e5)
ITSELF_STARVED = "C_A in the starved slab over itself"
LAW = replace(SCENE.kinetics, yield_coefficient=1e-12)
#: h: 0.07, 0.2 and 0.7 s. Water diffuses across the slab in 0.6 s, and crosses it in 0.1 to 6 s.
TIMES = (2e-5, 6e-5, 2e-4)
#: Last errors: of linear elements by the density X, and of quadratic elements.
CEILINGS = {3e3: 1e-6, 3e4: 3e-5, 3e5: 4e-4}
QUADRATIC_CEILING = 1e-7


def each(expected: int, why: str, ceiling: float) -> dict[str, tuple]:
    """The same row for both substrates."""
    return dict.fromkeys(NAMES, (expected, why, ceiling))


@cache
def _computed(size: float, number: int, order: int, peclet: float, density: float, steps: int = 0, ends=CROSSED
          ) -> np.ndarray:
    """(times, 2, n) C, restarted at each interval with equal steps. Without steps: the steady state."""
    equations = problem(slab_space(size, number, order, ends), speed_of(peclet), law=LAW)
    if not steps:
        return both(steady(equations, density))[None]
    states = []
    active = uniform_masses(equations.space, density)
    state = transport.supplied_everywhere(equations)
    for interval in np.diff([0.0, *TIMES]):
        state = gear.advance(equations, active, 0 * active, state, interval, fixed_step=interval / steps).concentrations
        states.append(both(state))
    return np.array(states)


@cache
def exact(peclet: float, density: float, tolerance: float):
    """x -> (C_A, C_D), by solve_bvp."""
    return channel_bvp.solve(speed_of(peclet), pair("supply"), pair("diffusivity"), pair("diffusivity_in_aggregate"),
                             density, rates(SCENE.kinetics), SLAB, tolerance=tolerance)


#: Random meshes of each size (um), their ends, and solve_bvp's tolerance. At Peclet 5 solve_bvp accepts no smaller one.
COLLOCATED = {1: (SAMPLES, CROSSED, 1e-8), 2: ({3.2: 12, 1.6: 6, 0.8: 3, 0.4: 1}, WIDE, 1e-10)}


def collocation(order: int, peclet: float, density: float):
    samples, ends, tolerance = COLLOCATED[order]
    errors = refine(_distances, samples, order, peclet, density, ends, tolerance)
    if order > 1:
        yield studies(errors, {"C": (*EXPECTED[order], QUADRATIC_CEILING)})
        return
    yield studies(errors, each(*EXPECTED[1], CEILINGS[density]))
    if (peclet, density) == STARVED:
        yield studies(errors, {ITSELF_STARVED: (*EXPECTED[1], 6e-4)})


@pytest.mark.case(
    "transport-monod-collocation", kind="cross-code",
    mutants=("decay-demand", "no-inlet-flux", "ratio-on-the-donor-only", "reaction-in-the-fluid",
             "exchanged-substrates"), references=("channel_bvp",), omitted="order 2: transport-monod-higher")
@parametrize("*setup", combined(LINEAR, PECLETS, DENSITIES))
def test_monod_collocation(setup, record):
    """Dual Monod uptake under plug flow is solve_bvp's at Peclet 0.1, 1, 5 times Thiele numbers 0.6, 1.9, 6, from low
    uptake to starved.

    Norm: L2 of each substrate over the mesh, relative; starved: root mean square over the slab of C_A over its own
    value; several meshes a size.
    """
    record(collocation(*setup))


@pytest.mark.slow
@pytest.mark.case(
    "transport-monod-higher", kind="cross-code",
    mutants=("uptake-without-decay", "fluid-diffusivity", "reaction-evenly-weighted"), references=("channel_bvp",),
    omitted="order 1: transport-monod-collocation")
@parametrize("*setup", combined(QUADRATIC, {"Pe = 0.5": 0.5, "Pe = 1": 1.0, "Pe = 5": 5.0}, DENSITIES))
def test_monod_higher(setup, record):
    """Dual Monod uptake under plug flow on quadratic triangles is solve_bvp's, to third order, at Peclet 0.5, 1, 5
    times Thiele numbers 0.6, 1.9, 6, from low uptake to starved.

    Norm: root mean square over the mesh of both substrates less solve_bvp, over the supply.
    """
    record(collocation(*setup))


def _distances(size: float, number: int, order: int, peclet: float, density: float, ends, tolerance: float
               ) -> dict[str, float]:
    """Element size and differences from solve_bvp.

    They are relative for each substrate, over the larger supply for both together, and pointwise relative for the
    acceptor at the nodes of the slab.
    """
    space, exact_profile = slab_space(size, number, order, ends), exact(peclet, density, tolerance)
    computed, pieces = _computed(size, number, order, peclet, density, ends=ends)[0], space.reaction
    nodes = pieces.cells[:, 0]
    ratio = computed[0, nodes] / exact_profile(space.points[nodes, 0])[0]
    gap, scale = rms_errors(space, computed, lambda x, y: exact_profile(x))
    return {"size": length(space, size), **dict(zip(NAMES, gap / scale)), "C": np.hypot(*gap) / pair("supply")[0],
            ITSELF_STARVED: np.sqrt(np.average((ratio - 1) ** 2, weights=pieces.dx[:, 0]))}


def _over_the_supply(gap: np.ndarray) -> dict[str, float]:
    """Root mean squares of each substrate over space, the largest over time, over its supply. gap: (times, 2, ...)."""
    squares = np.mean(gap**2, axis=tuple(range(2, gap.ndim)))
    return dict(zip(NAMES, np.sqrt(squares).max(axis=0) / pair("supply")))


#: Steps of each of the three intervals.
STEPS = (16, 32, 64, 128)
#: Elements (um) of the studies in time.
COARSE = 4.0


def mass(space: Space) -> np.ndarray:
    """(n, n) um2, the mass matrix on a straight mesh by scikit-fem, lumped for order 1."""
    if space.order == 1:
        return np.diag(space.lumped())
    grid = space.mesh.fem
    basis = Basis(MeshTri(grid.p, grid.t), ELEMENTS[space.order].functions, intorder=8)
    _, nodes = cKDTree(basis.doflocs.T).query(space.points)
    return poisson.mass.assemble(basis).toarray()[np.ix_(nodes, nodes)]


def _exact_in_time(size: float, peclet: float, density: float, order: int) -> np.ndarray:
    """(times, 2, n) C by scipy's integrator to 1e-8.

    The equations in space are the same, M dC/dt = b - L C - X q at the points of the reaction.
    """
    space, law = slab_space(size, 0, order), rates(LAW)
    equations, pieces = problem(space, speed_of(peclet), law=LAW), space.reaction
    points = (pieces.values @ np.eye(space.count)[pieces.cells]).reshape(-1, space.count)
    back, read = (np.kron(np.eye(2), part) for part in (np.linalg.inv(mass(space)), points))
    load = uniform_masses(space, density).ravel()

    def rise(_, y):
        return back @ (equations.source - equations.operator @ y - read.T @ sink(read @ y, load, law))

    def slope(_, y):
        return back @ -(equations.operator.toarray() + read.T @ sink_derivative(read @ y, load, law) @ read)

    solution = solve_ivp(rise, (0.0, TIMES[-1]), equations.supply, jac=slope, method="BDF", t_eval=TIMES, rtol=1e-8,
                         atol=1e-8)
    return solution.y.T.reshape(len(TIMES), 2, -1)


#: Studies in time: order, Peclet number, density, and last error.
IN_TIME = {f"Pe = {peclet:g}, X = {density:g} mg/L, {word}": (ORDERS[word], peclet, density, ceiling)
           for word, peclet, density, ceiling in (
               ("linear", 0.1, 3e5, 2e-5), ("linear", 1.0, 3e4, 3e-6), ("linear", 5.0, 3e5, 1e-5),
               ("quadratic", 1.0, 3e4, 3e-6), ("quadratic", 5.0, 3e5, 1e-5))}


@pytest.mark.slow
@pytest.mark.case(
    "transport-gear-in-time", kind="cross-code",
    mutants=("carry-of-bdf2", "backward-euler", "storage-of-the-biomass-alone", "storage-diagonal"),
    references=("monod",))
@parametrize("order, peclet, density, ceiling", IN_TIME)
def test_gear_in_time(order, peclet, density, ceiling, record):
    """On a given mesh the modified Gear scheme's concentrations, linear and quadratic, are those of scipy's integrator
    with scikit-fem's mass matrix, with an error of second order in the step.

    Norm: largest over three times of the root mean square over the nodes, over the supply.
    """
    expected = _exact_in_time(COARSE, peclet, density, order)
    errors = refine(lambda steps: {"size": TIMES[0] / steps, **_over_the_supply(
        _computed(COARSE, 0, order, peclet, density, steps) - expected)}, STEPS)
    record(studies(errors, each(2, "BDF2 after a first step of backward Euler", ceiling)))


WELL_MIXED, RADIUS = 24.0, 8.0
SUPPLY, SEEDED = 1000.0, 300.0
#: Times (h) of the comparison. The transient scheme restarts at each.
HALF_DAYS = 12.0 * np.arange(1, 11)
MIXED_STEPS = (2.0, 1.0, 0.5, 0.25)
#: Last errors.
MIXED = {"C_A": 4e-5, "C_D": 1.5e-5, "X_A": 6e-5, "X_I": 1e-4}
#: Kinetics five times slower than the paper's, and half saturations of the supply's size: C falls for days.
SLOW_LAW = replace(SCENE.kinetics, maximum_utilization_rate=SCENE.kinetics.maximum_utilization_rate / 5)
EVEN = {"diffusivity": 1e8, "diffusivity_in_aggregate": 1e8, "supply": SUPPLY}
CLOSED = replace(substrates_with(acceptor={"half_saturation": 300.0, **EVEN}, donor={"half_saturation": 600.0, **EVEN}),
                 boundary="closed")


@cache
def box_around(order: int) -> Space:
    """A box with a seed on its lower wall."""
    seed = outline.half_disc(RADIUS, ACROSS_AGGREGATE * 0.5, order)
    return Space(meshes.around(seed, 0.3, (-WELL_MIXED, WELL_MIXED), WELL_MIXED)[0])


@cache
def _mixed(step: float) -> np.ndarray:
    """(times, 4, 2) mean and range of C_A and C_D over the nodes, and of X_A and X_I over the points of the reaction.

    step: h.
    """
    space = box_around(1)
    equations = transport.problem(space, None, CLOSED, SLOW_LAW, scheme_on(space))
    weight = equations.space.reaction.dx
    active = SEEDED * weight
    inert = 0 * active
    state = transport.supplied_everywhere(equations)
    rows = []
    for interval in np.diff([0.0, *HALF_DAYS]):
        advance = gear.advance(equations, active, inert, state, interval, fixed_step=step)
        active = advance.active
        inert = advance.inert
        state = advance.concentrations
        fields = (state.acceptor, state.donor, active / weight, inert / weight)
        rows.append([(field.mean(), np.ptp(field)) for field in fields])
    return np.array(rows)


def _mixed_reference() -> np.ndarray:
    """(times, 4) C_A, C_D, X_A and X_I by scipy."""
    space, law = box_around(1), rates(SLOW_LAW, CLOSED)
    share = space.reaction.dx.sum() / space.at.dx.sum()

    def right(_, y):
        consumed = share * np.array(uptake(y[0], y[1], law))
        return y[2] * np.append(-consumed, runs.growth_rates(SLOW_LAW, CLOSED, y[0], y[1]))

    return solve_ivp(right, (0, HALF_DAYS[-1]), [SUPPLY, SUPPLY, SEEDED, 0.0], t_eval=HALF_DAYS, rtol=1e-11, atol=1e-10,
                     method="DOP853").y.T


@pytest.mark.case(
    "transport-well-mixed", kind="cross-code",
    mutants=("inert-fraction", "yield-dropped", "remains-of-the-start", "growth-in-one-increment"),
    references=("monod",), runs_with="1", omitted="order 2: transport-gear-in-time")
def test_well_mixed(record):
    """In a closed, well-mixed pore C_A, C_D, X_A and X_I follow the four ordinary equations over days, with an error of
    second order in the step; at constant C the shape updates integrate X_A and X_I exactly.

    Norm: largest relative difference, twice a day for five days; X at constant C: relative, after five days.
    """
    expected = _mixed_reference()
    uneven = (_mixed(MIXED_STEPS[-1])[:, :, 1] / expected).max()
    record(at_most("unevenness in the box", uneven, 1e-6, "L^2 / D over the time in which the supply lasts"))
    errors = refine(lambda step: {"size": step, **dict(zip(
        MIXED, np.abs(_mixed(step)[:, :, 0] / expected - 1).max(axis=0)))}, MIXED_STEPS)
    record(studies(errors, {name: (2, "BDF2, restarted ten times", ceiling) for name, ceiling in MIXED.items()}))
    record(at_most("X at constant C, 12 min steps", _constant_supply(), 1e-9,
                   "(9)-(10) are integrated exactly: round-off of 600 steps"))


def _constant_supply() -> float:
    """Relative error of X_A and X_I of the quasi-steady scheme over five days of 12 min updates."""
    acceptor, donor = 400.0, 900.0
    law = kinetics.rate_law(CLOSED, SLOW_LAW)
    growth = law.growth_rate(acceptor, donor)
    remains = law.inert_rate(acceptor, donor)
    active, inert = 3e4, 0.0
    for _ in range(600):
        active, inert = kinetics.grow(active, inert, growth, remains, 0.2)
    growth_rate, inert_rate = runs.growth_rates(SLOW_LAW, CLOSED, acceptor, donor)
    risen = growth_rate * HALF_DAYS[-1]
    exact = 3e4 * np.array([np.exp(risen), inert_rate / growth_rate * np.expm1(risen)])
    return np.abs(np.array([active, inert]) / exact - 1).max()
