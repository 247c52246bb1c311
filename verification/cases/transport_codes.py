"""Substrates against other codes: steady and in time, in slabs, around biomass, and in a well-mixed box.

Dual Monod uptake in a slab under plug flow, steady: against scipy's collocation, and against FiPy's finite volumes.
Peclet numbers u l / D_A are 0.1, 1 and 5. Thiele's modulus l sqrt(k F X / (K_A D_A)) is 0.6, 1.9 and 6; the last slab,
at Peclet number 0.1, is starved: 3e-4 of the acceptor's supply leaves it.

Diffusion into biomass in two dimensions, without flow, against py-pde's finite differences. The box has the supply at
its ends and one D in fluid and biomass, as py-pde's Laplacian requires. Both codes are refined together, with elements
as long as cells: around a block along the cells, and around a half-disc, which cuts them. Thiele's
modulus is SIDE sqrt(k F X / (K_A D_A)). At 7 the donor is used up, and at 4.3 a few percent of it are left.

The modified Gear scheme (3.3): from the supply everywhere towards the steady profiles of the slab. X_A does not change
(no yield, and less than 1e-5 of it decays). In time the scheme is compared with an integrator that makes no error of
its own, on the same mesh; in space with FiPy, whose cells are integrated without an error in time; and in time with
FiPy's own scheme, which is of first order.

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

from reference import channel_bvp, channel_fipy
from reference import diffusion_reaction_pypde as pypde
from reference.monod import sink, sink_derivative, uptake
from repro.fem import outline
from repro.fem.elements import ELEMENTS
from repro.fem.sizing import ACROSS_AGGREGATE
from repro.fem.space import Space
from repro.model import gear, kinetics, transport
from repro.model.kinetics import Sink
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
    at_heights,
    both,
    length,
    mesh_with_sides,
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
#: Peclet number and density of the starved slab, and of the slab that FiPy and quadratic elements share.
STARVED, SHARED = (0.1, 3e5), (1.0, 3e4)
ITSELF_STARVED = "C_A in the starved slab over itself"
LAW = replace(SCENE.kinetics, yield_coefficient=1e-12)
#: h: 0.07, 0.2 and 0.7 s. Water diffuses across the slab in 0.6 s, and crosses it in 0.1 to 6 s.
TIMES = (2e-5, 6e-5, 2e-4)
#: Last errors: of linear elements by the density X, and of quadratic elements.
CEILINGS = {3e3: 1e-6, 3e4: 3e-5, 3e5: 4e-4}
QUADRATIC_CEILING = 1e-7


def reference_arguments(peclet: float, density: float):
    """Arguments of the references."""
    return (speed_of(peclet), pair("supply"), pair("diffusivity"), pair("diffusivity_in_aggregate"), density,
            rates(SCENE.kinetics), SLAB)


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
    return channel_bvp.solve(*reference_arguments(peclet, density), tolerance=tolerance)


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


BOX, SIDE = 16.0, 8.0
SUBSTRATES = substrates_with(acceptor={"diffusivity": 8e6, "diffusivity_in_aggregate": 8e6},
                     donor={"diffusivity": 4e6, "diffusivity_in_aggregate": 4e6})
ITSELF = "donor in the biomass, over itself"
#: Cells (um) with the number of meshes of equally long elements around the block.
BLOCK = {2.0: 6, 1.0: 4, 0.5: 2, 0.25: 1}
#: Quadratic elements (um) by shape. Their error is less than a tenth of that of the finest cells.
FINE_AROUND = {"block": 0.5, "half-disc": 1 / 3}
#: Cells (um), and the refinement that makes elements twice as long on average around the half-disc.
DISC = {4 / 3: 0.35, 2 / 3: 0.77, 1 / 3: 1.55, 1 / 6: 3.1}
CUT = ("second order: the uptake of py-pde's cut cells is right, and its position errs to either side (with entire "
       "cells in or out the order is 0.8 to 1.9)")
#: Shape, order, density (mg/L), and the last errors of both substrates, and of the donor in the biomass.
BLOCKS = {"X = 1e+05 mg/L, linear": ("block", 1, 1e5, 2e-5, 2e-5, 3e-5),
          "X = 1e+06 mg/L, linear": ("block", 1, 1e6, 1e-4, 1e-4, 3e-4),
          "X = 4e+06 mg/L, linear": ("block", 1, 4e6, 2e-4, 2e-4, 1e-3),
          "X = 1e+06 mg/L, quadratic": ("block", 2, 1e6, 1e-4, 1e-4, 3e-4)}
HALF_DISCS = {"X = 1e+05 mg/L, linear": ("half-disc", 1, 1e5, 2e-5, 2e-5, 3e-5),
              "X = 1e+06 mg/L, linear": ("half-disc", 1, 1e6, 1e-4, 1e-4, 4e-4),
              "X = 1e+07 mg/L, linear": ("half-disc", 1, 1e7, 3e-4, 3e-4, 1e-2),
              "X = 1e+06 mg/L, quadratic": ("half-disc", 2, 1e6, 1e-5, 1.5e-5, 4e-5)}


def finite_differences(shape: str, order: int, density: float, *ceilings: float):
    """Checks and studies against py-pde.

    Around the half-disc only the finest cells are compared with quadratic elements, because the error of py-pde changes
    sign from size to size.
    """
    names, suffix = (*NAMES, ITSELF), ", of py-pde less ours"
    if order > 1 and shape == "half-disc":
        errors = _differences(min(DISC), 0, density, shape, order)
        return [at_most(name + suffix, errors[name], ceiling, "py-pde's error")
                for name, ceiling in zip(names, ceilings)]
    samples, why = (BLOCK, "both of second order") if shape == "block" else (dict.fromkeys(DISC, 1), CUT)
    if order > 1:
        samples, why = dict.fromkeys(BLOCK, 1), "py-pde's second order"
    rows = {name: (2, why, ceiling) for name, ceiling in zip(names, ceilings)}
    return studies(refine(_differences, samples, density, shape, order), rows, suffix if order > 1 else "")


@pytest.mark.slow
@pytest.mark.case(
    "transport-block", kind="cross-code", mutants=("one-supply-held", "reaction-in-the-fluid"),
    references=("diffusion_reaction_pypde",))
@parametrize("*setup", BLOCKS)
def test_block(setup, record):
    """Diffusion into a block of biomass on a wall is py-pde's, both codes refined together, at Thiele numbers 0.7, 2.2
    and 4.3; with quadratic elements the rest state of the transient scheme is the limit of py-pde's cells.

    Norm: root mean square over py-pde's cells over the supply; that of C_D in the biomass over itself; several meshes a
    size.
    """
    record(finite_differences(*setup))


@pytest.mark.slow
@pytest.mark.case(
    "transport-half-disc", kind="cross-code", mutants=("ratio-on-the-donor-only",),
    references=("diffusion_reaction_pypde",))
@parametrize("*setup", HALF_DISCS)
def test_half_disc(setup, record):
    """Diffusion into a half-disc is py-pde's, both codes refined together, at Thiele numbers 0.7, 2.2 and 7; with
    quadratic elements the rest state of the transient scheme is the limit of py-pde's cells.

    Norm: root mean square over py-pde's cells over the supply; that of C_D in the biomass over itself.
    """
    record(finite_differences(*setup))


@cache
def _pypde(cell: float, density: float, shape: str):
    """(centres (n, 2), C (2, n), part (n,) of each cell that is biomass)."""
    part = pypde.block(SIDE, SIDE) if shape == "block" else pypde.half_disc(SIDE)
    box = pypde.Box(round(BOX / cell), BOX, BOX, part)
    concentrations = box.steady(pair("diffusivity", SUBSTRATES), pair("supply"), density, rates(SCENE.kinetics))
    return box.points, concentrations, box.part


@cache
def _rest_state(cell: float, number: int, density: float, shape: str, order: int) -> tuple[Space, np.ndarray]:
    """Steady C (2, n) of linear elements as long as py-pde's cells, or the rest state of the transient scheme."""
    if shape == "block":
        straight = mesh_with_sides(2 * SIDE**2, cell, number, (-BOX, BOX), BOX,
                                   lambda x, y: (np.abs(x) < SIDE) & (y < SIDE),
                                   across=(-SIDE, SIDE), along=(SIDE,))
        space = meshes.space_on(straight, order)
    else:
        space = meshes.half_disc_space(SIDE, DISC[cell], (-BOX, BOX), BOX, order)
    problem = transport.problem(space, None, SUBSTRATES, SCENE.kinetics, scheme_on(space))
    arguments = problem, Sink(uniform_masses(space, density))
    return space, both(transport.steady(*arguments) if order == 1 else gear.settle(*arguments, None))


def _differences(cell: float, number: int, density: float, shape: str, order: int) -> dict[str, float]:
    """Differences of both substrates over their supply, and of the scarce donor in the biomass over itself."""
    points, expected, part = _pypde(cell, density, shape)
    elements = cell if order == 1 else FINE_AROUND[shape]
    space, fields = _rest_state(elements, number, density, shape, order)
    computed = meshes.field_at(space, fields.T, points).T
    ratio = (computed / expected)[1, part == 1] - 1
    return {**_over_the_supply((computed - expected)[None]), ITSELF: np.sqrt(np.mean(ratio**2))}


#: Steps of each of the three intervals.
STEPS = (16, 32, 64, 128)
#: Twice FiPy's cells (um), and the quadratic elements (um), whose error is less than a tenth of FiPy's.
CELLS, FINE = (4.0, 2.5, 5 / 3, 1.0), 1.0
#: Steady and in time: elements (um) with the number of meshes of each, origin of the second order, last error of linear
#: elements by density, and that against quadratic elements.
AGAINST_FIPY = {
    False: (SAMPLES, "both codes are of second order", {3e3: 1e-6, 3e4: 6e-6, 3e5: 5e-5}, 6e-6),
    True: (dict(zip(CELLS, (4, 3, 2, 1))), "both codes are of second order; the error in time is a tenth",
           {3e3: 3e-6, 3e4: 3e-5, 3e5: 3e-4}, 1e-5)}


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


#: Studies in time: order, Peclet number, density, elements (um), and last error.
IN_TIME = {f"Pe = {peclet:g}, X = {density:g} mg/L, {word}": (ORDERS[word], peclet, density, size, ceiling)
           for word, size, peclet, density, ceiling in (
               ("linear", CELLS[0], 0.1, 3e5, 2e-5), ("linear", CELLS[0], 1.0, 3e4, 3e-6),
               ("linear", CELLS[0], 5.0, 3e5, 1e-5), ("quadratic", CELLS[0], 1.0, 3e4, 3e-6),
               ("quadratic", CELLS[0], 5.0, 3e5, 1e-5))}


@pytest.mark.slow
@pytest.mark.case(
    "transport-gear-in-time", kind="cross-code",
    mutants=("carry-of-bdf2", "backward-euler", "storage-of-the-biomass-alone", "storage-diagonal"),
    references=("monod",))
@parametrize("order, peclet, density, size, ceiling", IN_TIME)
def test_gear_in_time(order, peclet, density, size, ceiling, record):
    """On a given mesh the modified Gear scheme's concentrations, linear and quadratic, are those of scipy's integrator
    with scikit-fem's mass matrix, with an error of second order in the step.

    Norm: largest over three times of the root mean square over the nodes, over the supply.
    """
    expected = _exact_in_time(size, peclet, density, order)
    errors = refine(lambda steps: {"size": TIMES[0] / steps, **_over_the_supply(
        _computed(size, 0, order, peclet, density, steps) - expected)}, STEPS)
    record(studies(errors, each(2, "BDF2 after a first step of backward Euler", ceiling)))


def _channel(size: float, peclet: float, density: float) -> channel_fipy.Channel:
    """FiPy's channel. Its cells are half as long as the edges of the package."""
    cells = round(2 * (CROSSED[1] - CROSSED[0]) / size)
    return channel_fipy.Channel(cells, CROSSED, *reference_arguments(peclet, density))


@cache
def _fipy(size: float, peclet: float, density: float, timed: bool) -> tuple[np.ndarray, np.ndarray]:
    """Centres (n,) of FiPy's cells, and C (times, 2, n) at them."""
    channel = _channel(size, peclet, density)
    return channel.x, channel.transient(TIMES) if timed else channel.steady()[None]


def _at_cells(x, size: float, number: int, order: int, *arguments) -> np.ndarray:
    """(times, 2, 5, n) C of the package at x and five heights."""
    return at_heights(slab_space(size, number, order), _computed(size, number, order, *arguments), x)


def _rows(timed: bool) -> dict[str, tuple]:
    rows = {**combined(LINEAR, PECLETS, DENSITIES), **combined(QUADRATIC, {"Pe = 1": 1.0}, {"X = 30000 mg/L": 3e4})}
    return {label: (timed, *row) for label, row in rows.items()}


def finite_volumes(timed: bool, order: int, peclet: float, density: float):
    samples, why, ceilings, higher_ceiling = AGAINST_FIPY[timed]
    if order > 1:
        errors = refine(_from_fipy, dict.fromkeys(CELLS, 1), order, peclet, density, timed)
        yield studies(errors, each(2, "FiPy's second order", higher_ceiling), " of FiPy less ours")
        return
    errors = refine(_from_fipy, samples, order, peclet, density, timed)
    yield studies(errors, each(2, why, ceilings[density]))
    if not timed and (peclet, density) == STARVED:
        yield studies(errors, {ITSELF_STARVED: (2, why, 6e-4)})
    if timed and (peclet, density) == SHARED:
        errors = refine(_from_backward_euler, STEPS, peclet, density)
        yield studies(errors, each(1, "the lower of the two: FiPy's TransientTerm is backward Euler", 3e-4),
                      " less FiPy's in as many steps")


@pytest.mark.slow
@pytest.mark.case(
    "transport-monod-fipy", kind="cross-code", mutants=("decay-demand", "no-inlet-flux"), references=("channel_fipy",))
@parametrize("*setup", _rows(False))
def test_monod_fipy(setup, record):
    """Dual Monod uptake under plug flow is FiPy's, both codes refined together, at Peclet 0.1, 1, 5 times Thiele
    numbers 0.6, 1.9, 6, from low uptake to starved; that of quadratic elements, on one mesh, is the limit of
    FiPy's cells.

    Norm: root mean square over FiPy's cells, at five heights, of each substrate over its supply, and in the starved
    slab over its own value; several meshes a size.
    """
    record(finite_volumes(*setup))


@pytest.mark.slow
@pytest.mark.case(
    "transport-gear-fipy", kind="cross-code", mutants=("storage-of-the-biomass-alone", "storage-diagonal"),
    references=("channel_fipy",))
@parametrize("*setup", _rows(True))
def test_gear_fipy(setup, record):
    """Transient profiles of both substrates are FiPy's, both codes refined together in space, at Peclet 0.1, 1, 5 times
    Thiele numbers 0.6, 1.9, 6; and refined in time, where FiPy's own scheme is of first order; those of quadratic
    elements, on one mesh, are the limit of FiPy's cells.

    Norm: largest over three times of the root mean square over FiPy's cells, at five heights, over the supply; several
    meshes a size.
    """
    record(finite_volumes(*setup))


def _from_fipy(size: float, number: int, order: int, peclet: float, density: float, timed: bool) -> dict[str, float]:
    """Differences from FiPy, over the supply, and of C_A in the slab over itself.

    Both codes are refined together, or FiPy's cells are compared with one mesh of quadratic elements.
    """
    x, expected = _fipy(size, peclet, density, timed)
    elements, steps = (size, STEPS[-1] / size) if order == 1 else (FINE, STEPS[-1])
    computed = _at_cells(x, elements, number, order, peclet, density, round(timed * steps))
    inside = (x > 0) & (x < SLAB)
    ratio = computed[-1, 0][:, inside] / expected[-1, 0, inside]
    return {**_over_the_supply(computed - expected[:, :, None]), ITSELF_STARVED: np.sqrt(np.mean((ratio - 1) ** 2))}


def _from_backward_euler(steps: int, peclet: float, density: float) -> dict[str, float]:
    size = CELLS[-1]
    channel = _channel(size, peclet, density)
    computed = _at_cells(channel.x, size, 0, 1, peclet, density, steps)
    return {"size": TIMES[0] / steps, **_over_the_supply(computed - channel.backward_euler(TIMES, steps)[:, :, None])}


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
MIXED_NORM = "largest relative difference, twice a day for five days"


@cache
def box_around(order: int) -> Space:
    """A box with a seed on its lower wall."""
    seed = outline.half_disc(RADIUS, ACROSS_AGGREGATE * 0.5, order)
    return Space(meshes.around(seed, 0.3, (-WELL_MIXED, WELL_MIXED), WELL_MIXED)[0])


@cache
def _mixed(step: float, order: int) -> np.ndarray:
    """(times, 4, 2) mean and range of C_A and C_D over the nodes, and of X_A and X_I over the points of the reaction.

    step: h.
    """
    space = box_around(order)
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


def _mixed_reference(order: int) -> np.ndarray:
    """(times, 4) C_A, C_D, X_A and X_I by scipy."""
    space, law = box_around(order), rates(SLOW_LAW, CLOSED)
    share = space.reaction.dx.sum() / space.at.dx.sum()

    def right(_, y):
        consumed = share * np.array(uptake(y[0], y[1], law))
        return y[2] * np.append(-consumed, runs.growth_rates(SLOW_LAW, CLOSED, y[0], y[1]))

    return solve_ivp(right, (0, HALF_DAYS[-1]), [SUPPLY, SUPPLY, SEEDED, 0.0], t_eval=HALF_DAYS, rtol=1e-11, atol=1e-10,
                     method="DOP853").y.T


def well_mixed(order: int):
    """A check that the box is uniform, and studies of C_A, C_D, X_A and X_I."""
    expected = _mixed_reference(order)
    uneven = (_mixed(MIXED_STEPS[-1], order)[:, :, 1] / expected).max()
    yield at_most("unevenness in the box", uneven, 1e-6, "L^2 / D over the time in which the supply lasts")
    errors = refine(lambda step: {"size": step, **dict(zip(
        MIXED, np.abs(_mixed(step, order)[:, :, 0] / expected - 1).max(axis=0)))}, MIXED_STEPS)
    yield studies(errors, {name: (2, "BDF2, restarted ten times", ceiling) for name, ceiling in MIXED.items()})
    if order == 1:
        yield at_most("X at constant C, 12 min steps", _constant_supply(), 1e-9,
                      "(9)-(10) are integrated exactly: round-off of 600 steps")


@pytest.mark.case(
    "transport-well-mixed", kind="cross-code", norm=f"{MIXED_NORM}; X at constant C: relative, after five days",
    mutants=("inert-fraction", "yield-dropped", "remains-of-the-start", "growth-in-one-increment"),
    references=("monod",), omitted="order 2: transport-well-mixed-higher")
@parametrize("order", combined(LINEAR))
def test_well_mixed(order, record):
    """In a closed, well-mixed pore C_A, C_D, X_A and X_I follow the four ordinary equations over days, with an error of
    second order in the step; at constant C the shape updates integrate X_A and X_I exactly.
    """
    record(well_mixed(order))


@pytest.mark.slow
@pytest.mark.case(
    "transport-well-mixed-higher", kind="cross-code", norm=MIXED_NORM,
    mutants=("storage-diagonal", "inert-fraction", "remains-of-the-start"), references=("monod",),
    omitted="order 1: transport-well-mixed")
@parametrize("order", combined(QUADRATIC))
def test_well_mixed_higher(order, record):
    """With quadratic concentrations C_A, C_D, X_A and X_I of the well-mixed pore follow the four ordinary
    equations, too.
    """
    record(well_mixed(order))


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
