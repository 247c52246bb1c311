"""Substrates (2.2, 3.3) against closed forms, FiPy, scipy's boundary-value solver and py-pde.

The pores of the one-dimensional cases are narrow channels whose aggregate fills a slab from wall to wall, meshed at
random, under plug flow; their references know nothing of y.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
from scipy.integrate import solve_ivp

from reference import channel_bvp, channel_fipy, diffusion_reaction_pypde, robin_channel
from repro import flow, gear, geometry, kinetics, mesh, pore, transport
from repro.scene import load_scene
from verification import meshes, norms
from verification.case import Outcome, Profile, at_most, between, case
from verification.convergence import refine, study

SCENE = load_scene("base")
WIDTH, ENDS, SLAB = 10.0, (-40.0, 80.0), 40.0
SIZES = (2.0, 1.25, 0.8, 0.5)
SECOND = "linear elements, lumped reaction: second order"


@cache
def _slab_mesh(size: float):
    return meshes.channel(ENDS, WIDTH, size, lambda x, y: (x > 0) & (x < SLAB), across=(0.0, SLAB),
                          seed=int(1000 * size))


def _plug_flow(grid, speed: float) -> flow.Flow:
    """The same velocity everywhere."""
    count = len(grid.points)
    return flow.Flow(speed, np.column_stack([np.full(count, speed), np.zeros(count)]), np.zeros(count),
                     np.zeros((len(grid.triangles), 2)), 0.0, 0.0, 1.0)


def _rates(law) -> dict[str, float]:
    """The kinetics for the references."""
    decay = law.decay_oxygen_demand * law.degradable_fraction * law.decay_coefficient
    return {"k": law.maximum_utilization_rate, "F": law.acceptor_to_donor_ratio, "decay": decay,
            "K_A": SCENE.substrates.acceptor.half_saturation, "K_D": SCENE.substrates.donor.half_saturation}


def _pair(name: str) -> tuple[float, float]:
    """A number of both substrates, acceptor first."""
    return getattr(SCENE.substrates.acceptor, name), getattr(SCENE.substrates.donor, name)


@case("transport-robin-channel", kind="exact", norm="L2 of C over the mesh; relative error of C at the outlet",
      claim="First-order uptake in a slab under plug flow follows its closed form, (26) upstream included, at Peclet "
            "0.1, 1, 10",
      mutants=("fluid-diffusivity", "no-advection"))
def robin() -> Outcome:
    studies, checks, profiles = [], [], []
    for peclet in (0.1, 1.0, 10.0):
        errors = refine(_robin_errors, SIZES, peclet)
        studies.append(study(f"C, Pe = {peclet:g}", SIZES, errors["C"], 2, SECOND, ceiling=2e-4))
        checks.append(at_most(f"C leaving, Pe = {peclet:g}", errors["out"][-1], 2e-4, "that of C in L2"))
        profiles.append(_robin_profile(peclet))
    return Outcome(tuple(checks), tuple(studies), tuple(profiles))


UPTAKE, LARGE = 2e4, 1e9


def _robin_problem(size: float, peclet: float):
    """Half saturation far above the supply: q_D = C_D k / K_D; the acceptor never falls."""
    donor = replace(SCENE.substrates.donor, half_saturation=LARGE)
    acceptor = replace(SCENE.substrates.acceptor, half_saturation=1 / LARGE)
    law = replace(SCENE.kinetics, maximum_utilization_rate=LARGE, decay_coefficient=0.0, acceptor_to_donor_ratio=1e-12)
    grid, speed = _slab_mesh(size), peclet * donor.diffusivity / SLAB
    problem = transport.problem(grid, _plug_flow(grid, speed),
                                replace(SCENE.substrates, acceptor=acceptor, donor=donor), law)
    active = np.full(len(grid.points), UPTAKE)

    def exact(x, y=0):
        return robin_channel.strip(x, speed, donor.supply, donor.diffusivity, donor.diffusivity_in_aggregate, UPTAKE,
                                   SLAB)

    return problem, active, exact


def _robin_errors(size: float, peclet: float) -> dict[str, float]:
    problem, active, exact = _robin_problem(size, peclet)
    grid, state = problem.mesh, transport.steady(problem, active)
    leaving = transport.fluxes(problem, active, state)[1]
    return {"C": norms.l2_error(grid.points, grid.triangles, state.donor, exact),
            "out": abs(leaving.effluent / exact(SLAB) - 1)}


def _robin_profile(peclet: float) -> Profile:
    problem, active, exact = _robin_problem(SIZES[-1], peclet)
    x = np.linspace(*ENDS, 121)
    ours = _along(problem.mesh, transport.steady(problem, active).donor, x)
    return Profile(f"Pe = {peclet:g}", "x (um)", "C (mg/L)",
                   (("ours", "ours", x, ours), ("closed form", "exact", x, exact(x))))


def _along(grid, field, x) -> np.ndarray:
    """A nodal field along the middle of the channel."""
    return norms.sample(grid.points, grid.triangles, field, np.column_stack([x, np.full(len(x), WIDTH / 2)]))


PECLETS, DENSITIES = (0.1, 1.0, 5.0), (3e3, 3e4, 3e5)


@case("transport-monod-channel", kind="cross-code",
      norm="root mean square over the whole profile of both substrates, over the "
      "supply: ours at FiPy's cell centres less FiPy, and less solve_bvp",
      claim="Dual Monod uptake under plug flow is FiPy's and solve_bvp's at Peclet 0.1, 1, 5 times Thiele numbers "
            "0.6, 1.9, 6, "
            "from barely touched to starved",
      mutants=("decay-demand", "ratio-on-the-donor-only", "reaction-in-the-fluid"))
def monod() -> Outcome:
    studies, checks, profiles = [], [], []
    for peclet in PECLETS:
        for density in DENSITIES:
            found = [_monod_both(size, peclet, density) for size in SIZES]
            name = f"Pe = {peclet:g}, X = {density:g} mg/L"
            studies.append(study(f"less FiPy, {name}", SIZES, [_apart(ours, fipy) for _, ours, fipy, _ in found], 2,
                                 "both of second order, refined together", ceiling=1e-3))
            checks.append(at_most(f"less solve_bvp, {name}", _apart(found[-1][1], found[-1][3]), 1e-3,
                                  "0.1 % (issue 3)"))
            profiles.append(_monod_profile(name, *found[-1]))
    x, ours, _, exact = _monod_both(SIZES[-1], PECLETS[0], DENSITIES[-1])
    checks.append(at_most("acceptor leaving the starved slab, relative to itself",
                          abs(ours[0, -1] / exact[0, -1] - 1), 0.02,
                          "0.026 % of the supply is left: an error of 5e-6 of the supply"))
    return Outcome(tuple(checks), tuple(studies), tuple(profiles))


@cache
def _monod_both(size: float, peclet: float, density: float):
    """x, and C (2, n) there: ours, FiPy's, solve_bvp's."""
    speed, rates = peclet * SCENE.substrates.acceptor.diffusivity / SLAB, _rates(SCENE.kinetics)
    given = (speed, _pair("supply"), _pair("diffusivity"), _pair("diffusivity_in_aggregate"), density, rates, SLAB)
    fipy = channel_fipy.Channel(round((ENDS[1] - ENDS[0]) / size), ENDS, *given)
    grid = _slab_mesh(size)
    problem = transport.problem(grid, _plug_flow(grid, speed), SCENE.substrates, SCENE.kinetics)
    state = transport.steady(problem, np.full(len(grid.points), density))
    ours = np.stack([_along(grid, field, fipy.x) for field in (state.acceptor, state.donor)])
    return fipy.x, ours, fipy.steady(), channel_bvp.strip(fipy.x, *given)


def _apart(ours, theirs) -> float:
    return float(np.sqrt(np.mean((ours - theirs) ** 2))) / SCENE.substrates.acceptor.supply


def _monod_profile(name, x, ours, fipy, exact) -> Profile:
    curves = []
    for k, substrate in enumerate(("acceptor", "donor")):
        curves += [(substrate, "ours", x, ours[k]), (f"{substrate}, FiPy", "reference", x, fipy[k]),
                   (f"{substrate}, solve_bvp", "exact", x[::6], exact[k, ::6])]
    return Profile(name, "x (um)", "C (mg/L)", tuple(curves))


@case("transport-transient", kind="cross-code", norm="root mean square over the profile, over the supply",
      claim="The modified Gear scheme is of second order in time, and its transient is FiPy's",
      mutants=("carry-of-bdf2", "backward-euler"))
def transient() -> Outcome:
    end, size, density, speed = 2e-4, 1.25, 3e5, SCENE.substrates.acceptor.diffusivity / SLAB
    law = replace(SCENE.kinetics, yield_coefficient=1e-12, decay_coefficient=0.0)
    grid, given = _slab_mesh(size), (speed, _pair("supply"), _pair("diffusivity"), _pair("diffusivity_in_aggregate"),
                                     density,
                                     _rates(law), SLAB)
    problem = transport.problem(grid, _plug_flow(grid, speed), SCENE.substrates, law)
    active = np.full(len(grid.points), density)

    def ours(steps):
        start = transport.supplied_everywhere(problem)
        done = gear.advance(problem, active, 0 * active, start, end, fixed_step=end / steps).concentrations
        return np.stack([done.acceptor, done.donor])

    steps, fine = np.array([16, 32, 64, 128]), ours(640)
    fipy = channel_fipy.Channel(round((ENDS[1] - ENDS[0]) / size), ENDS, *given)
    theirs = fipy.transient(end)
    along = np.stack([_along(grid, field, fipy.x) for field in fine])
    return Outcome((at_most("less FiPy", _apart(along, theirs), 1e-3, "0.1 % (issue 3)"),),
                   (study("time step", end / steps, [_apart(ours(n), fine) for n in steps], 2, "BDF2", ceiling=1e-3),),
                   (_monod_profile(f"t = {3600 * end:g} s", fipy.x, along, theirs, theirs),))


BOX, RADIUS, DENSITY, DAYS = 24.0, 8.0, 1e6, 120.0


@case("transport-half-disc", kind="cross-code", norm="largest difference over the field, over the supply",
      claim="Diffusion into a half-disc without flow is py-pde's",
      mutants=("reaction-in-the-fluid",))
def half_disc() -> Outcome:
    spread = (8e6, 4e6)
    substrates = replace(SCENE.substrates,
                         **{name: replace(getattr(SCENE.substrates, name), diffusivity=d, diffusivity_in_aggregate=d)
                                              for name, d in zip(("acceptor", "donor"), spread)})
    points, trusted = diffusion_reaction_pypde.half_disc(42, BOX, BOX, RADIUS, spread, _pair("supply"), DENSITY,
                                                         _rates(SCENE.kinetics))

    def measure(refinement):
        grid, _ = mesh.generate(geometry.seed(RADIUS, refinement), (-BOX, BOX), BOX, refinement, 2.0)
        problem = transport.problem(grid, None, substrates, SCENE.kinetics)
        state = transport.steady(problem, np.full(len(grid.points), DENSITY))
        ours = norms.sample(grid.points, grid.triangles, np.column_stack([state.acceptor, state.donor]), points).T
        return {"size": norms.mean_size(grid), "field": np.abs(ours - trusted).max() / 10.0}

    errors = refine(measure, (0.3, 0.5, 0.8, 1.25, 2.0))
    return Outcome((at_most("finest mesh", errors["field"][-1], 1e-2,
                            "1 % where the boundary cuts py-pde's cells (issue 3)"),
                    at_most("against the coarsest", errors["field"][-1] / errors["field"][0], 0.2,
                            "it falls with refinement")))


@case("transport-balance", kind="property", norm="supplied - out - consumed over supplied",
      claim="Supply in = out + consumed to round-off, flow or none, local or mean inlet",
      mutants=("carried-by-u",))
def balance() -> Outcome:
    checks = []
    for name, changes in (("base", ()), ("R = 40 um", ('aggregate.radius="40 um"',)),
                          ("mean inlet", ('numerics.inlet="mean"',))):
        scene = load_scene("base", changes)
        now = pore.seeded(scene)
        solved = pore.solve(scene, now)
        for which, flux in zip(("acceptor", "donor"),
                               transport.fluxes(solved.problem, now.active, solved.concentrations)):
            if scene.numerics.inlet == "local":
                checks.append(at_most(f"{which}, {name}",
                                      abs(flux.supplied - flux.out - flux.consumed) / flux.supplied, 1e-9,
                                      "sum of the weak form over its test functions, round-off"))
        least = min(solved.concentrations.acceptor.min(), solved.concentrations.donor.min())
        checks.append(between(f"least concentration, {name} (mg/L)", least, 1e-9, 10.0, "0 < C < supply (trap 1)"))
    return Outcome(tuple(checks))


@case("transport-well-mixed", kind="cross-code",
      norm="largest relative difference of C_A, C_D, X_A, X_I after five days",
      claim="In a closed, well-mixed pore (7)-(10) are four ordinary equations: the same as solve_ivp's; so is X at "
            "constant C",
      mutants=("inert-fraction", "yield-dropped"))
def well_mixed() -> Outcome:
    steps = np.array([2.0, 1.0, 0.5, 0.25])
    return Outcome((at_most("X at constant C, 12 min steps", _constant_supply(), 1e-8,
                            "(9)-(10) are integrated exactly"),),
                   (study("closed pore, time step", steps, [_closed_pore(step) for step in steps], 2, "BDF2",
                          ceiling=1e-4),))


def _constant_supply() -> float:
    acceptor, donor, law = 0.7, 2.0, SCENE.kinetics
    growth = kinetics.growth_rate(acceptor, donor, SCENE.substrates, law)
    remains = kinetics.inert_rate(acceptor, SCENE.substrates, law)
    active, inert = 3e4, 0.0
    for _ in range(600):
        active, inert = kinetics.grow(active, inert, growth, remains, 0.2)
    m_a, m_d = acceptor / (acceptor + 1), donor / (donor + 1)
    right = _biomass_equations(law)
    found = solve_ivp(lambda t, y: right(m_a, m_d, y[0]), (0, 120.0), [3e4, 0.0], rtol=1e-11, atol=1e-8,
                      method="DOP853").y[:, -1]
    return float(np.abs(np.array([active, inert]) / found - 1).max())


def _biomass_equations(law):
    """(9)-(10), written down anew."""
    k, Y, b, f_d = law.maximum_utilization_rate, law.yield_coefficient, law.decay_coefficient, law.degradable_fraction
    return lambda m_a, m_d, X: (X * m_a * (k * Y * m_d - b), X * m_a * b * (1 - f_d))


def _slow():
    """Kinetics ten times slower: the supply lasts for days."""
    return replace(SCENE.kinetics, maximum_utilization_rate=SCENE.kinetics.maximum_utilization_rate / 10)


def _closed_pore(step: float) -> float:
    """A seed in a closed box, with diffusion so fast that every C is uniform."""
    quick = {name: replace(getattr(SCENE.substrates, name), diffusivity=1e9, diffusivity_in_aggregate=1e9,
                           supply=1000.0)
             for name in ("acceptor", "donor")}
    law, substrates = _slow(), replace(SCENE.substrates, boundary="closed", **quick)
    grid, _ = mesh.generate(geometry.seed(RADIUS, 0.5), (-BOX, BOX), BOX, 0.3, 2.0)
    problem = transport.problem(grid, None, substrates, law)
    start = np.where(problem.body > 0, 300.0, 0.0)
    done = gear.advance(problem, start, 0 * start, transport.supplied_everywhere(problem), DAYS, fixed_step=step)
    ours = [done.concentrations.acceptor.mean(), done.concentrations.donor.mean(), done.active[grid.body].mean(),
            done.inert[grid.body].mean()]
    theirs = _box_equations(law, problem.body.sum() / problem.total.sum())
    return float(np.abs(np.array(ours) / theirs - 1).max())


def _box_equations(law, share: float) -> np.ndarray:
    """C_A, C_D, X_A, X_I after DAYS by solve_ivp; ``share`` of the box is biomass."""
    biomass, rates = _biomass_equations(law), _rates(law)

    def right(_, y):
        m_a, m_d = y[0] / (y[0] + rates["K_A"]), y[1] / (y[1] + rates["K_D"])
        demand = m_a * (rates["k"] * rates["F"] * m_d + rates["decay"])
        return [-share * y[2] * demand, -share * y[2] * rates["k"] * m_a * m_d, *biomass(m_a, m_d, y[2])]

    return solve_ivp(right, (0, DAYS), [1000.0, 1000.0, 300.0, 0.0], rtol=1e-10, atol=1e-8, method="LSODA").y[:, -1]
