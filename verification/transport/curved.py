"""Substrates on curved triangles (quadratic concentrations): closed form, scipy's boundary-value solver, far meshes.

The narrow channels with a slab from wall to wall of the linear cases, under plug flow: third order in L2, one more than
linear elements, and the effluent, which the conserving form makes a functional of the solution, of fourth.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache, partial

import numpy as np

from reference import channel_bvp, robin_channel
from repro.curved import fields, pore, transfer, transport
from repro.curved.mesh import curved
from repro.model.flow import Flow
from repro.model.transport import Concentrations
from repro.scene import load_scene, parse_scene
from verification import meshes, norms
from verification.case import Outcome, Profile, at_most, case
from verification.convergence import refine, study

SCENE = load_scene("base")
WIDTH, ENDS, SLAB = 10.0, (-40.0, 80.0), 40.0
#: Random meshes of each size over which errors are averaged: those of few triangles differ by a third.
MESHES = {3.2: 4, 1.6: 3, 0.8: 2, 0.4: 1}
SIZES = tuple(MESHES)
THIRD = "quadratic elements: third order in L2"


@cache
def _mesh(size: float, which: int):
    straight = meshes.channel(ENDS, WIDTH, size, lambda x, y: (x > 0) & (x < SLAB), across=(0.0, SLAB),
                              seed=int(1000 * size) + which)
    return curved(straight, None)


def plug_flow(grid, speed: float, order: int = 2) -> Flow:
    """The same velocity everywhere."""
    count = fields.space(grid, order).count
    return Flow(speed, np.column_stack([np.full(count, speed), np.zeros(count)]), np.zeros(grid.corners),
                np.zeros((0, 2)), 0.0, 0.0, 1.0)


def l2(here, values, exact) -> float:
    """Root mean square over the mesh of fields (n, m) of a space less exact(x), (k,) -> (m, k)."""
    x, weight = here.mesh.points[here.mesh.cells, 0] @ here.of.shape.T, here.at.dx.ravel()
    ours = np.stack([here.at_points(values[:, k], here.cells).ravel() for k in range(values.shape[1])])
    return float(np.sqrt(np.sum(weight * (ours - exact(x.ravel())) ** 2) / weight.sum()))


def settled(problem, active) -> Concentrations:
    """Steady concentrations, with a last step of Newton's method: it stops where no row errs by more than 1e-12 of its
    terms, which at Peclet 0.1 and little uptake may be 1e-7 of the supply, more than the mesh does."""
    state, count = transport.steady(problem, active), problem.space.count
    both = np.concatenate([state.acceptor, state.donor])
    weight = transport.sinks(problem, active)
    tangent, residual = transport.tangent(problem, weight, both), transport.balance(problem, weight, both)
    both = both + problem.system.solve(tangent, -residual)
    return Concentrations(both[:count], both[count:], state.iterations + 1)


def mean(measure, size: float, *given, meshes: dict[float, int] = MESHES) -> dict[str, float]:
    """Root mean squares of ``measure(mesh, *given)`` over the meshes of a size."""
    rows = [measure(_mesh(size, which), *given) for which in range(meshes[size])]
    return {name: float(np.sqrt(np.mean([row[name] ** 2 for row in rows]))) for name in rows[0]}


def _line(grid, field, x) -> np.ndarray:
    """A quadratic field along the middle of the channel."""
    return transfer.interpolate(grid.points, grid.cells, field[:, None],
                                np.column_stack([x, np.full(len(x), WIDTH / 2)]))[:, 0]


UPTAKE, LARGE = 2e4, 1e13


@case("transport-curved-robin", kind="exact", slow=True,
      norm="root mean square of C over the mesh, and C leaving, over the supply",
      claim="Quadratic concentrations follow the closed form of first-order uptake in a slab to third order, the "
            "inlet's (11) included, at Peclet 0.1, 1, 10",
      mutants=("curved-outlet-forgotten", "curved-fluid-diffusivity"))
def robin() -> Outcome:
    studies, checks = [], []
    for peclet in (0.1, 1.0, 10.0):
        errors = refine(partial(mean, robin_errors), SIZES, peclet)
        studies.append(study(f"C, Pe = {peclet:g}", errors["size"], errors["C"], 3, THIRD, ceiling=CEILINGS[peclet]))
        checks.append(at_most(f"C leaving, Pe = {peclet:g}", errors["out"][-1], 6e-9,
                              "twice the order of the gradient: fourth"))
    return Outcome(tuple(checks), tuple(studies))


CEILINGS = {0.1: 3e-9, 1.0: 1.5e-8, 10.0: 1e-7}


def robin_errors(grid, peclet: float, order: int = 2) -> dict[str, float]:
    """Half saturation far above the supply: q_D = C_D k / K_D; the acceptor never falls."""
    donor = replace(SCENE.substrates.donor, half_saturation=LARGE)
    acceptor = replace(SCENE.substrates.acceptor, half_saturation=1 / LARGE)
    law = replace(SCENE.kinetics, maximum_utilization_rate=LARGE, decay_coefficient=0.0, acceptor_to_donor_ratio=1e-12)
    speed = peclet * donor.diffusivity / SLAB
    problem = transport.problem(grid, plug_flow(grid, speed, order),
                                replace(SCENE.substrates, acceptor=acceptor, donor=donor), law, order=order)
    active = np.full(len(grid.points), UPTAKE)
    state = settled(problem, active)

    def exact(x):
        return robin_channel.strip(x, speed, donor.supply, donor.diffusivity, donor.diffusivity_in_aggregate, UPTAKE,
                                   SLAB)

    leaving = transport.fluxes(problem, active, state)[1].effluent
    return {"size": norms.mean_size(grid.straight), "C": l2(problem.space, state.donor[:, None], exact) / donor.supply,
            "out": abs(leaving - exact(SLAB)) / donor.supply}


PECLETS, DENSITIES = (0.5, 1.0, 5.0), (3e3, 3e4, 3e5)


def _rates(law) -> dict[str, float]:
    """The kinetics for the reference."""
    decay = law.decay_oxygen_demand * law.degradable_fraction * law.decay_coefficient
    return {"k": law.maximum_utilization_rate, "F": law.acceptor_to_donor_ratio, "decay": decay,
            "K_A": SCENE.substrates.acceptor.half_saturation, "K_D": SCENE.substrates.donor.half_saturation}


def _pair(name: str) -> tuple[float, float]:
    """A number of both substrates, acceptor first."""
    return getattr(SCENE.substrates.acceptor, name), getattr(SCENE.substrates.donor, name)


@case("transport-curved-monod", kind="cross-code", slow=True,
      norm="root mean square over the mesh of both substrates less solve_bvp, over the supply",
      claim="Dual Monod uptake under plug flow on quadratic triangles is solve_bvp's, to third order, at Peclet 0.5, "
            "1, 5 times Thiele numbers 0.6, 1.9, 6, from barely touched to starved",
      mutants=("paired-without-decay", "curved-fluid-diffusivity"))
def monod() -> Outcome:
    studies, profiles = [], []
    for peclet in PECLETS:
        for density in DENSITIES:
            errors = refine(partial(mean, monod_errors), SIZES, peclet, density)
            name = f"Pe = {peclet:g}, X = {density:g} mg/L"
            studies.append(study(name, errors["size"], errors["C"], 3, THIRD, ceiling=1e-7))
            profiles.append(_monod_profile(name, peclet, density))
    return Outcome((), tuple(studies), tuple(profiles))


def _monod(grid, peclet: float, density: float, order: int = 2):
    """The space, concentrations, and what solve_bvp is given."""
    speed = peclet * SCENE.substrates.acceptor.diffusivity / SLAB
    given = (speed, _pair("supply"), _pair("diffusivity"), _pair("diffusivity_in_aggregate"), density,
             _rates(SCENE.kinetics), SLAB)
    problem = transport.problem(grid, plug_flow(grid, speed, order), SCENE.substrates, SCENE.kinetics, order=order)
    return problem.space, settled(problem, np.full(len(grid.points), density)), given


#: Tolerances of solve_bvp, which takes no less at Peclet 5; cubic elements are judged at Peclet 1.
BVP = {2: 1e-10, 3: 1e-12}


def monod_errors(grid, peclet: float, density: float, order: int = 2) -> dict[str, float]:
    here, state, given = _monod(grid, peclet, density, order)
    apart = l2(here, np.column_stack([state.acceptor, state.donor]),
               lambda x: channel_bvp.strip(x, *given, tolerance=BVP[order]))
    return {"size": norms.mean_size(grid.straight), "C": apart / SCENE.substrates.acceptor.supply}


def _monod_profile(name: str, peclet: float, density: float) -> Profile:
    grid = _mesh(SIZES[1], 0)
    _, state, given = _monod(grid, peclet, density)
    x = np.linspace(*ENDS, 121)
    ours = [_line(grid, field, x) for field in (state.acceptor, state.donor)]
    exact = channel_bvp.strip(x, *given)
    curves = []
    for k, substrate in enumerate(("acceptor", "donor")):
        curves += [(substrate, "ours", x, ours[k]), (f"{substrate}, solve_bvp", "exact", x[::6], exact[k, ::6])]
    return Profile(name, "x (um)", "C (mg/L)", tuple(curves))


@case("transport-curved-front", kind="property", slow=True,
      norm="consumed acceptor over F times consumed donor, less one; difference of effluents over the larger supply, "
           "to a mesh of refinement 1.3",
      claim="Behind a front where the donor is used up, to half saturations of a millionth of the supply, both are "
            "taken up in their proportion, and what leaves is within the presets' accuracy",
      mutants=("curved-unpaired",))
def front() -> Outcome:
    checks = []
    for half in ("1e-2 mg/L", "1e-3 mg/L", "1e-5 mg/L"):
        far = _front(half, 1.3)
        for preset, refinement, bound in (("fast", 0.25, 1e-2), ("accurate", 0.45, 1e-3)):
            found = _front(half, refinement)
            ratio = found[0].consumed / found[1].consumed / SCENE.kinetics.acceptor_to_donor_ratio
            checks.append(at_most(f"proportion, {preset}, K_s = {half}", abs(ratio - 1), 1e-9,
                                  "one rate for both: exact but for where Newton's method stops"))
            apart = max(abs(a.effluent - b.effluent) for a, b in zip(found, far)) / _pair("supply")[0]
            checks.append(at_most(f"effluents, {preset}, K_s = {half}", apart, bound, "what the preset is for"))
    return Outcome(tuple(checks))


def _front(half: str, refinement: float):
    """Ledgers of a thick half-disc that the donor, 1 mg/L, does not pass; without decay."""
    both = {"acceptor": {"half_saturation": half}, "donor": {"supply": "1 mg/L", "half_saturation": half}}
    tables = {"pore": {"width": "100 um"}, "aggregate": {"radius": "60 um"}, "flow": {"mean_velocity": "0.29 m/day"},
              "substrates": both, "kinetics": {"decay_coefficient": "0 1/day"},
              "numerics": {"preset": "fast", "refinement": refinement}}
    scene = parse_scene(tables, "front", "front.toml")
    return pore.solve(scene, pore.seeded(scene)).fluxes


FAR, WITHIN = 2.5, "0.1 %, what preset accurate is for"


@case("transport-curved-peclet", kind="property", slow=True,
      norm="difference of effluents, over the supply, and of consumption, relative, to a mesh of refinement 2.5",
      claim="In fast water (u W / D to 3e4) the boundary layers that preset accurate makes its elements for are "
            "resolved to 0.1 %",
      mutants=("curved-layers-ignored",))
def peclet() -> Outcome:
    checks = []
    for speed in ("2.9 m/day", "29 m/day", "290 m/day"):
        for name, ours, far in zip(("acceptor", "donor"), *(_fluxes(speed, size) for size in (0.45, FAR))):
            supply = _pair("supply")[0]
            checks += [at_most(f"effluent {name}, {speed}", abs(ours.effluent - far.effluent) / supply, 1e-3, WITHIN),
                       at_most(f"consumed {name}, {speed}", abs(ours.consumed / far.consumed - 1), 1e-3, WITHIN)]
    return Outcome(tuple(checks))


def _fluxes(speed: str, refinement: float):
    """Ledgers of a thick half-disc in a pore of 100 um."""
    tables = {"pore": {"width": "100 um"}, "aggregate": {"radius": "60 um"}, "flow": {"mean_velocity": speed},
              "substrates": {}, "numerics": {"preset": "accurate", "refinement": refinement}}
    scene = parse_scene(tables, "fast water", "fast.toml")
    return pore.solve(scene, pore.seeded(scene)).fluxes
