"""Quasi-steady substrates (7)-(13) with elements of every order: solutions without biomass, starts of Newton's method,
refusals, and elements that are halved to resolve a front. Cases of the stage transport test closed forms, other codes,
the balance, starved pores, scaling and the mean biomass of a step. `test_derived.py` tests that uptake follows from
rates and concentrations, `test_balances.py` that two quadratures of the uptake agree."""
import re
from contextlib import nullcontext
from dataclasses import replace
from itertools import product

import numpy as np
import pytest

from repro import load_scene
from repro.errors import TransportError, Unresolved
from repro.model import grading, solving, transport
from repro.model.meshing import seeded
from repro.model.solving import Solved, solve
from repro.model.transport import Concentrations
from repro.preflight import simplifications
from repro.preflight.numbers import Sizes
from repro.schemes import PAPER
from tests.strategies import EVERY_ORDER, coarse_base, scene
from tests.test_derived import integrate_over_end, node_coordinates
from verification.problems.schemes import exchange, exchanged

FINE = {1: 1.0, 2: 0.45}


def solved(radius, supply, velocity, order, inlet="local"):
    """(Pore, Solved) of a fixed shape."""
    numerics = {"refinement": 1.0 if order == 1 else 0.5}
    plain = scene(radius, "50 um", supply, supply, velocity, numerics=numerics, order=order)
    return at_start(exchanged(plain, exchange(inlet=inlet)))


def at_start(scene):
    """(Pore, Solved) of a scene."""
    start = seeded(scene)
    return start, solving.solve(scene, start)


def everywhere(start, value):
    """Both concentrations, the same at all nodes."""
    same = np.full(start.space.count, value)
    return Concentrations(same, same)


@EVERY_ORDER
@pytest.mark.parametrize("inlet", ["local", "mean"])
def test_a_constant_supply_stays_constant_without_biomass(inlet, order):
    """This holds around an obstacle and for both forms of (11), to round-off, since w is free of divergence for every
    order. Newton's method needs one step from zero concentrations."""
    start, solution = solved("30 um", "10 mg/L", "2.9 m/day", order, inlet)
    alone = transport.steady(solution.problem, None, everywhere(start, 0.0))
    assert alone.iterations <= 2
    assert alone.acceptor == pytest.approx(np.full(len(alone.acceptor), 10.0), abs=1e-10)
    assert alone.donor == pytest.approx(np.full(len(alone.donor), 10.0), abs=1e-10)


def thick(velocity, order=2, refinement=None):
    """A half-disc of 60 um in a pore of 100 um."""
    numerics = {"refinement": refinement or FINE[order]}
    return scene("60 um", "100 um", velocity=velocity, numerics=numerics, order=order)


@EVERY_ORDER
def test_too_slow_a_flow_is_refused(order):
    """Below u W / D = 1e-8 the supply at the inlet is lost in round-off."""
    with pytest.raises(TransportError, match=r"Peclet number u W / D is 1\.2e-09, under 1e-08: nothing is supplied"):
        at_start(thick("1e-9 m/day", order))
    assert np.isfinite(at_start(thick(None, order))[1].fluxes[0].consumed), "pure diffusion, as advised"
    if order > 1:
        assert np.isfinite(at_start(thick("1e-8 m/day", order))[1].fluxes[0].effluent)


def starved(half, order):
    """A seed that the acceptor reaches in part only, with a half saturation that no mesh resolves."""
    model = scene("30 um", "100 um", "1 mg/L", "10 mg/L", "0.5 m/day", numerics={
        "refinement": 0.4 / order}, order=order)
    acceptor = replace(model.substrates.acceptor, half_saturation=half)
    return replace(model, substrates=replace(model.substrates, acceptor=acceptor))


def outcome(scene):
    """The solution at t = 0, or the error."""
    try:
        with np.errstate(all="raise", under="ignore"):
            return at_start(scene)[1]
    except (Unresolved, FloatingPointError) as error:
        return error


@EVERY_ORDER
@pytest.mark.parametrize("half", [1e-17, 1e-300])
def test_a_half_saturation_below_round_off_is_solved_or_refused_as_a_front(order, half):
    """C / (C + K) is one to the last bit, and the substrate runs out, without a floating-point error. The solution
    differs by about 1e-15 from that with a half saturation of 1e-15."""
    solution = outcome(starved(half, order))
    if order == 1 and half == 1e-17:
        assert isinstance(solution, Solved), solution
        other = outcome(starved(1e-15, order))
        assert solution.concentrations.acceptor == pytest.approx(other.concentrations.acceptor, abs=1e-10)
        assert solution.concentrations.acceptor.min() < 1e-10 < solution.fluxes[0].consumed
    else:
        assert isinstance(solution, Unresolved), solution
        assert "the mesh is too coarse for the front in the aggregate" in str(solution)


@EVERY_ORDER
def test_without_flow_the_ends_are_means_over_their_height(order):
    """The fields are not linear, and differ at inlet and outlet. Gauss's rule integrates along each end."""
    scene, pore = coarse_base(order, "numerics.transport=gear", "substrates.boundary=closed", unset=["flow"])
    x, y = node_coordinates(pore.space).T
    fields = [2 + np.sin(y / 7) + 0.01 * x, 5 + np.cos(y / 9) - 0.02 * x]
    problem = transport.problem(pore.space, None, scene.substrates, scene.kinetics)
    all_fluxes = transport.fluxes(problem, None, transport.Concentrations(*fields))
    for flux, field in zip(all_fluxes, fields):
        means = [integrate_over_end(pore.space, end, field) / scene.pore.width for end in pore.mesh.ends]
        assert [flux.inlet, flux.effluent] == pytest.approx(means, rel=1e-9) and abs(means[0] - means[1]) > 0.5


@EVERY_ORDER
def test_the_inlet_is_weighted_with_the_flow_for_any_inlet_condition(order):
    scene, pore = coarse_base(order)
    flow = solve(scene, pore).flow
    schemes = (replace(PAPER, inlet=inlet) for inlet in ("local", "mean"))
    local, mean = (transport.problem(pore.space, flow, scene.substrates, scene.kinetics, scheme).inflow
                   for scheme in schemes)
    assert np.array_equal(mean, local) and mean.sum() == pytest.approx(flow.mean_velocity * scene.pore.width)


@EVERY_ORDER
def test_a_concentration_may_leave_its_bounds_by_the_documented_part(order):
    """It may fall below zero by a thousandth of its supply and, with curved elements, exceed it by a fiftieth."""
    scene, pore = coarse_base(order)
    problem = transport.problem(pore.space, None, scene.substrates, scene.kinetics, scene.numerics.scheme)
    for k, (part, accepted) in product((0, 1), ((-9e-4, True), (-1.1e-3, False), (1.019, True), (1.021, order == 1))):
        state = problem.supply
        state[k * problem.space.count + 7] *= part
        with nullcontext() if accepted else pytest.raises(Unresolved, match=("acceptor", "donor")[k]):
            transport._checked(problem, state, 1)


# ---------------------------------------------------------------- fronts


#: A dense aggregate of 20 um that exhausts its supply in a front as thin as the root of the half saturation.
DENSE = ["numerics.preset=fast", "aggregate.radius=20 um", "kinetics.maximum_density=400 g/L"]
#: Half saturations (mg/L), factors by which their front may refine the elements at the aggregate, and times (h).
#: The last bit of the mesh decides whether factor 2 or 4 resolves the thinnest front.
LEVELS = [(0.1, (1,), 0.0), (0.0175, (2,), 0.0), pytest.param(0.01, (2, 4), 0.0, marks=pytest.mark.thorough),
          (0.01, (2, 4), 0.5)]


def fronted(half, *changes):
    """Return a scene with a front."""
    halves = [f"substrates.{name}.half_saturation={half} mg/L" for name in ("acceptor", "donor")]
    return load_scene("base", [*DENSE, *halves, *changes])


def at_rim(graded):
    """Return the longest edge (um) between aggregate and fluid."""
    outline = graded.boundary.corners
    return outline.edge_lengths()[outline.interface_edges()].max()


def within_bounds(graded, solved):
    """Return whether concentrations lie between zero and the supply, to the stated accuracy."""
    state = solved.concentrations
    fields = np.stack([state.acceptor, state.donor])
    return fields.min() >= -0.01 and fields.max() <= 10.2


@pytest.mark.parametrize("half, levels, time", LEVELS)
def test_elements_are_halved_as_often_as_a_front_needs(half, levels, time):
    """At t = 0 the mesh is that of the seed, later it is a new one. Elements twice as large do not resolve the front.
    Effluents agree with those of elements as small everywhere."""
    scene = fronted(half)
    first = replace(seeded(scene), time=time)
    graded, solved = grading.solve_graded(scene, first)
    level = 2 ** round(np.log2(at_rim(first) / at_rim(graded)))
    assert level in levels
    assert within_bounds(graded, solved) and graded.mass == pytest.approx(first.mass, rel=1e-3)
    if level > 1 and time == 0:
        with pytest.raises(Unresolved):
            solving.solve(scene, seeded(scene, level / 2))
    if half == 0.01 and time == 0:
        fine = fronted(half, "numerics.refinement=0.8")
        expected = [flux.effluent for flux in solving.solve(fine, seeded(fine)).fluxes]
        assert [flux.effluent for flux in solved.fluxes] == pytest.approx(expected, rel=5e-3)


def test_fronts_of_zero_order_lose_less_than_a_per_cent_with_the_advised_refinement():
    """`check` states the loss. The cases transport-laws-zero-order and hard-03-zero-order solve these fronts."""
    scene = load_scene({
        "pore": {"width": "70.34 um", "length": "1688 um"}, "aggregate": {"radius": "21.23 um"},
        "flow": {"mean_velocity": "0.072 m/day"}, "growth": {"end": "3 h", "new_biomass": "stress_free"},
        "substrates": {"acceptor": {"supply": "0.758 mg/L"}, "donor": {"supply": "3.77 mg/L"}},
        "kinetics": {"law": "zero order"}, "numerics": {"preset": "fast"}})
    grown = Sizes(3.0, 32 * np.pi, 25.0, 25.0, False, 50.0)
    (warned,) = widened_fronts(scene, grown)
    pattern = r"acceptor .* ([\d.]+) % too small; numerics\.refinement = ([\d.]+) would"
    lost, advised = re.search(pattern, warned.text).groups()
    assert float(lost) > 1 and widened_fronts(load_scene(scene, [f"numerics.refinement={advised}"]), grown) == []


def widened_fronts(scene, sizes=None):
    """The warnings of fronts of zero order."""
    found = simplifications.find_warnings(scene, scene.flow.mean_velocity, sizes)
    return [caveat for caveat in found if "widen the front" in caveat.text]
