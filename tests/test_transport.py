"""Substrates (7)-(13), quasi-steady, with elements of every order: closed forms, sharp fronts, scaling, the printed
inlet [E4], what is refused, and what Newton's method is told.

The balance, starved pores and the mean biomass of a step are the cases transport-balance, transport-starved and
transport-mean-biomass; that uptake is what the rates make of the concentrations is in `test_balances.py`.
"""
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from hypothesis import given
from skfem import MeshTri

from reference import robin_channel
from repro.errors import TransportError, Unresolved
from repro.fem.mesh import Mesh, triangle_areas
from repro.model import pore, remeshing, transport
from repro.model.flow import Flow
from repro.model.kinetics import Sink
from repro.model.transport import Balance, Concentrations
from tests.strategies import (
    ORDERS,
    between,
    fitted_order,
    meshed,
    plug,
    relabelled,
    scene,
    scenes,
    share,
    space_of,
)

VELOCITY = 2.9e6 / 24  # um/h
EVERY_ORDER = pytest.mark.parametrize("order", ORDERS)
@cache
def solved(radius="5 um", width="50 um", acceptor="10 mg/L", donor="10 mg/L", velocity="2.9 m/day", inlet="local",
           extent="central", order=1):
    """(scene, Pore, Solved) of a fixed shape."""
    made = scene(radius, width, acceptor, donor, velocity, numerics={
        "inlet": inlet, "extent": extent, "elements": ORDERS[order], "refinement": 1.0 if order == 1 else 0.5})
    now = pore.seeded(made)
    return made, now, pore.solve(made, now)


def sink_of(now):
    return Sink(now.active)


def everywhere(now, value):
    """Both concentrations, the same at all nodes."""
    same = np.full(now.space.count, value)
    return Concentrations(same, same)


def defects(now, found):
    """(supplied - out - consumed) / supplied of both substrates."""
    both = transport.fluxes(found.problem, sink_of(now), found.concentrations)
    return [(f.supplied - f.out - f.consumed) / f.supplied for f in both]


def plug_flow(space):
    """The same velocity everywhere."""
    still = np.zeros((len(space.mesh.triangles), 2)) if space.order == 1 else None
    along = np.column_stack([np.full(space.count, VELOCITY), np.zeros(space.count)])
    return Flow(VELOCITY, along, np.zeros(space.count), still, 0.0, 0.0, 0.0)


def linear_uptake(rate, space, velocity):
    """(acceptor's concentration, its substrate) with uptake ``rate`` C (1/h) of it: half-saturation 1e9 mg/L makes the
    decay's demand linear in C_A to 1e-8, no growth takes part."""
    made = scene(velocity=velocity, kinetics={"maximum_utilization_rate": "0 1/day"},
                 substrates={"acceptor": {"half_saturation": "1e9 mg/L"}, "donor": {"supply": "5 mg/L"}})
    k = made.kinetics
    density = rate * 1e9 / (k.decay_oxygen_demand * k.degradable_fraction * k.decay_coefficient)
    problem = transport.problem(space, plug_flow(space) if velocity else None, made.substrates, k)
    found = transport.steady(problem, Sink(density * space.reaction.dx))
    assert found.donor == pytest.approx(np.full(space.count, 5.0), rel=1e-11)
    return found.acceptor, made.substrates.acceptor


def strip_error(rate, refinement, order=1):
    """(h, largest error, range of C) with uptake in a strip from 0 to 40 um."""
    grid, _ = meshed(plug(50.0, 0.0, 40.0), refinement=refinement, ends=(-75.0, 115.0))
    space = space_of(grid, order)
    found, acceptor = linear_uptake(rate, space, "2.9 m/day")
    water, inside = acceptor.diffusivity, acceptor.diffusivity_in_aggregate
    exact = robin_channel.strip(space.points[:, 0], VELOCITY, 10.0, water, inside, rate, 40.0)
    return len(grid.points) ** -0.5, np.abs(found - exact).max(), np.ptp(exact)


@pytest.mark.parametrize("order, refinements, most, orders", [
    (1, (0.6, 1.0, 1.5), 8e-3, (1.6, 2.5)), (2, (0.3, 0.5, 0.8), 2e-3, (2.5, 3.6)),
    (3, (0.3, 0.5, 0.8), 1e-4, (3.5, 4.7))])
def test_first_order_uptake_in_a_strip_follows_the_closed_form(order, refinements, most, orders):
    """(7), (11), (12), (26), with D of water and of biomass: 10 mg/L down to 1.9, with the order of the elements
    (measured 2.0 for linear ones)."""
    size, error, fall = zip(*(strip_error(1e4, r, order) for r in refinements))
    assert min(fall) > 5.0, "else little is tested"
    assert error[1] < most and orders[0] < fitted_order(size, error) < orders[1]


@EVERY_ORDER
@pytest.mark.parametrize("inlet", ["local", "mean"])
def test_a_constant_supply_stays_constant_without_biomass(inlet, order):
    """Around an obstacle and for both forms of (11): to round-off with linear elements, whose w is divergence-free;
    with the others to what is left of div u within an element. Newton's method needs a step, from nothing at all."""
    _, now, found = solved("30 um", inlet=inlet, order=order)
    alone = transport.steady(found.problem, None, everywhere(now, 0.0))
    assert alone.iterations <= 2
    bound = 1e-10 if order == 1 else 3e-2
    assert alone.acceptor == pytest.approx(np.full(len(alone.acceptor), 10.0), abs=bound)
    assert alone.donor == pytest.approx(np.full(len(alone.donor), 10.0), abs=bound)


@EVERY_ORDER
def test_newton_does_not_fall_into_a_negative_root(order):
    """From less than nothing. Undamped, with C / (C + K) below zero too, Newton's method "converges" to -70 mg/L
    (measured): uptake is a function of max(C, 0)."""
    _, now, found = solved("42 um", acceptor="0.15 mg/L", donor="0.15 mg/L", velocity="0.35 m/day", order=order)
    again = transport.steady(found.problem, sink_of(now), everywhere(now, -10.0))
    assert again.acceptor == pytest.approx(found.concentrations.acceptor, rel=1e-7)
    assert again.donor == pytest.approx(found.concentrations.donor, rel=1e-7)
    assert again.acceptor.min() > 0


def test_the_printed_inlet_loses_as_much_with_every_order():
    """u_ave in (11) [E4]: a ten thousandth or so of each supply, to 5 % what it is with linear elements; in the biomass
    the acceptor is that of the local velocity to a thousandth."""
    lost = []
    for order in ORDERS:
        (_, now, mean), (_, _, local) = (solved("30 um", velocity="0.35 m/day", inlet=inlet, order=order)
                                         for inlet in ("mean", "local"))
        lost.append(defects(now, mean))
        one, two = (now.space.to_mesh(found.concentrations.acceptor)[now.mesh.body] for found in (mean, local))
        assert one == pytest.approx(two, rel=1e-3)
    assert (1e-6 < np.abs(lost)).all() and (np.abs(lost) < 1e-3).all()
    assert lost == pytest.approx(np.array([lost[0]] * 3), rel=0.05)


@EVERY_ORDER
def test_without_flow_the_supply_is_held_at_both_ends(order):
    """Pure diffusion: what is consumed comes in through the ends, supply exact there."""
    _, now, found = solved("20 um", velocity=None, order=order)
    field = found.concentrations.acceptor
    assert (field[transport.both_ends(now.space)] == 10.0).all() and field.min() < 9.9
    assert (found.concentrations.donor[transport.both_ends(now.space)] == 10.0).all()
    assert min(flux.consumed for flux in found.fluxes) > 0
    alone = transport.steady(found.problem, Sink(0 * now.active))
    assert alone.acceptor == pytest.approx(np.full(len(field), 10.0), rel=1e-12)


@pytest.mark.parametrize("order, bound", [(1, 8e-3), (2, 1e-3), (3, 1e-4)])
def test_pure_diffusion_to_a_strip_is_the_hyperbolic_cosine(order, bound):
    """Uptake kappa C over the whole meshed length, C_supply at both ends: C_s cosh(a x) / cosh(a L / 2), a^2 = kappa
    / D_B, within the error of the mesh (measured 3e-3 mg/L)."""
    grid, _ = meshed(plug(50.0, -60.0, 60.0), refinement=1.0 if order == 1 else 0.5, ends=(-75.0, 75.0))
    space = space_of(relabelled(grid, np.ones(len(grid.biomass), bool)), order)
    rate = 5e3
    found, acceptor = linear_uptake(rate, space, None)
    a = np.sqrt(rate / acceptor.diffusivity_in_aggregate)
    exact = 10 * np.cosh(a * space.points[:, 0]) / np.cosh(75 * a)
    assert exact.min() < 5
    assert np.abs(found - exact).max() < bound


def answer(made):
    """Concentrations of a scene at t = 0, None where its mesh is too coarse for it."""
    try:
        return pore.solve(made, pore.seeded(made)).concentrations
    except Unresolved:
        return None


@share(0.4)
@given(scenes(steps=1, elements=tuple(ORDERS.values())), between(1e-3, 1e3))
def test_only_the_ratios_to_half_saturation_matter(made, factor):
    """C27: supply, K_s and X_m of both scaled together scale every concentration."""
    s, k = made.substrates, made.kinetics
    both = [replace(one, supply=factor * one.supply, half_saturation=factor * one.half_saturation)
            for one in (s.acceptor, s.donor)]
    other = replace(made, substrates=replace(s, acceptor=both[0], donor=both[1]),
                    kinetics=replace(k, maximum_density=factor * k.maximum_density))
    one, two = (answer(each) for each in (made, other))
    assert (one is None) == (two is None)
    if one:
        assert two.acceptor / factor == pytest.approx(one.acceptor, rel=1e-7, abs=1e-11 * s.acceptor.supply)
        assert two.donor / factor == pytest.approx(one.donor, rel=1e-7, abs=1e-11 * s.donor.supply)


@EVERY_ORDER
def test_the_meshed_part_stands_for_the_whole_pore(order):
    """(26) upstream, (12) downstream (C19, C36): meshing all 600 um changes effluents and smallest acceptor by under
    0.1 % of the supply."""
    _, now, part = solved("30 um", velocity="1.4 m/day", order=order)
    _, all_now, whole = solved("30 um", velocity="1.4 m/day", extent="full", order=order)
    for one, two in zip(part.fluxes, whole.fluxes):
        assert one.effluent == pytest.approx(two.effluent, abs=1e-2)
        assert one.inlet < 9.5 and two.inlet > one.inlet
    assert part.concentrations.acceptor.min() == pytest.approx(whole.concentrations.acceptor.min(), abs=1e-2)


def right_triangles():
    """A structured mesh of 40 x 20 um, biomass from x = 10 to 20 um."""
    fem = MeshTri.init_tensor(np.linspace(0.0, 40.0, 9), np.linspace(0.0, 20.0, 5))
    points, triangles = fem.p.T.copy(), fem.t.T.copy()
    wrong = triangle_areas(points, triangles) < 0
    triangles[wrong] = triangles[wrong][:, ::-1]
    x = points[triangles, 0].mean(axis=1)
    return Mesh.of(points, triangles, (x > 10) & (x < 20), np.empty(0, int), 20.0, (0.0, 40.0))


@EVERY_ORDER
def test_couplings_that_are_exactly_zero_keep_their_place(order):
    """Between right triangles nothing diffuses along the hypotenuse: without flow those entries are zero. The steady
    state without biomass is the supply."""
    space = space_of(right_triangles(), order)
    problem = transport.problem(space, None, scene().substrates, scene().kinetics)
    found = transport.steady(problem, Sink(np.zeros_like(space.reaction.dx)))
    assert found.acceptor == pytest.approx(10.0, rel=1e-12)


FINE = {1: 1.0, 2: 0.45, 3: 0.3}


def thick(velocity, order=2, refinement=None, **more):
    """A half-disc of 60 um in a pore of 100 um."""
    numerics = {"elements": ORDERS[order], "refinement": refinement or FINE[order]}
    return scene("60 um", "100 um", velocity=velocity, numerics=numerics, **more)


def without_decay(made, part):
    """The scene with half saturations at a part of the supplies, and no decay."""
    both = {name: replace(s, half_saturation=part * s.supply)
            for name, s in (("acceptor", made.substrates.acceptor), ("donor", made.substrates.donor))}
    return replace(made, substrates=replace(made.substrates, **both),
                   kinetics=replace(made.kinetics, decay_coefficient=0.0))


def at_start(made):
    now = pore.seeded(made)
    return now, pore.solve(made, now)


def lack(made, fluxes):
    """(what each substrate's effluent lacks of its supply), mg/L."""
    both = (made.substrates.acceptor, made.substrates.donor)
    return np.array([s.supply - flux.effluent for s, flux in zip(both, fluxes)])


def resolved(made):
    """What is solved at t = 0, on elements as small as its front asks for; None where that is refused."""
    now = pore.seeded(made)
    while now:
        try:
            return pore.solve(made, now)
        except Unresolved:
            now = remeshing.graded(made, now)
    return None


FED_UNALIKE = ("0.29 m/day", "100 mg/L", "1 mg/L")
FED = [("0.29 m/day", "10 mg/L", "10 mg/L"), ("2.9 m/day", "10 mg/L", "10 mg/L"), FED_UNALIKE]


def sharpest(fed, part, order):
    """What may be refused, after seconds: beside it the same front with linear elements, and one 100 times as thick."""
    return [pytest.mark.thorough] if fed == FED_UNALIKE and part == 1e-6 and order > 1 else []


@pytest.mark.parametrize("velocity, acceptor, donor, part, order", [
    pytest.param(*fed, part, order, marks=sharpest(fed, part, order))
    for fed in FED for part in (1e-2, 1e-4, 1e-6) for order in ORDERS])
def test_what_is_taken_up_of_both_stays_in_proportion(velocity, acceptor, donor, part, order):
    """Without decay, F moles of acceptor go with each of donor, to round-off, however sharp the front where one of them
    ends; nothing is below zero by more than 5e-4 of its supply (measured 4.7e-4). Only the sharpest front, over which
    the acceptor is still 98 mg/L, may be refused, with curved triangles."""
    made = without_decay(thick(velocity, order, acceptor=acceptor, donor=donor), part)
    found = resolved(made)
    if found is None:
        assert sharpest((velocity, acceptor, donor), part, order)
        return
    a, d = lack(made, found.fluxes)
    assert a == pytest.approx(made.kinetics.acceptor_to_donor_ratio * d, abs=1e-10 * made.substrates.acceptor.supply)
    both = (made.substrates.acceptor, made.substrates.donor)
    for field, substrate in zip((found.concentrations.acceptor, found.concentrations.donor), both):
        assert field.min() >= -(1e-3 if substrate.supply == 1 else 5e-4) * substrate.supply


@EVERY_ORDER
def test_equal_diffusivities_keep_the_difference(order):
    """With one diffusivity, C_A - F C_D is carried and diffused but not taken up: it is, at every node, what the same
    equations say of a substrate that nothing takes up. That is the supply, but for what the water's div u of higher
    orders, zero against linear functions only, makes of it: under 3e-4 of it here."""
    made = without_decay(thick("0.29 m/day", order), 1e-3)
    donor = replace(made.substrates.donor, diffusivity=made.substrates.acceptor.diffusivity,
                    diffusivity_in_aggregate=made.substrates.acceptor.diffusivity_in_aggregate)
    made = replace(made, substrates=replace(made.substrates, donor=donor))
    now, found = at_start(made)
    free = transport.steady(transport.problem(now.space, found.flow, made.substrates, None), None).donor
    both, ratio = found.concentrations, made.kinetics.acceptor_to_donor_ratio
    assert np.ptp(both.acceptor) > 1.5
    assert np.allclose(both.acceptor - ratio * both.donor, (1 - ratio) * free, rtol=0, atol=1e-8)
    most, least = (1e-9, 0.0) if order == 1 else (3e-3, 1e-6 if order == 2 else 1e-9)
    assert least <= np.abs(free - 10).max() < most


@EVERY_ORDER
def test_starved_and_all_but_still(order):
    """A pore with slow water, u W / D = 0.1: what comes in is used up; the profile ends at a 1e4th of the supply."""
    made = thick("0.0029 m/day", order, 0.5 if order == 1 else 0.25)
    now, found = at_start(made)
    a, d = found.fluxes
    assert a.out < 2e-4 * a.supplied and 0.3 < d.out / d.supplied < 0.4
    assert found.concentrations.acceptor.max() < 0.01 * made.substrates.acceptor.supply


@EVERY_ORDER
def test_too_slow_a_flow_is_refused(order):
    """Under u W / D = 1e-9 the inlet's supply is lost in round-off."""
    with pytest.raises(TransportError, match=r"Peclet number u W / D is 1\.2e-09, under 1e-09|nothing is supplied"):
        at_start(thick("1e-10 m/day", order))
    if order > 1:
        assert np.isfinite(at_start(thick("1e-9 m/day", order))[1].fluxes[0].effluent)


@pytest.mark.parametrize("order", [2, 3])
def test_too_coarse_a_mesh_is_refused(monkeypatch, order):
    """Without elements for the boundary layer the concentration oscillates upstream: more than 2 % over the supply."""
    monkeypatch.setattr(pore, "BOUNDARY_LAYER", 0.0)
    with pytest.raises(Unresolved, match="outside of 0 to 10 mg/L; the mesh is too coarse there"):
        at_start(thick("290 m/day", order, 0.2))


@EVERY_ORDER
def test_negative_concentrations_are_refused(order):
    """A state below zero by more than 1e-3 of the supply is no solution."""
    now, found = at_start(thick("2.9 m/day", order))
    state = np.concatenate([found.concentrations.acceptor, found.concentrations.donor])
    state[3] = -0.009
    transport._checked(found.problem, state, 1)
    state[3] = -0.011
    with pytest.raises(Unresolved, match="the acceptor is -0.011 mg/L"):
        transport._checked(found.problem, state, 1)


@EVERY_ORDER
@pytest.mark.parametrize("held", [False, True])
@pytest.mark.parametrize("duration", [0.0, 2.0])
def test_the_tangent_is_the_derivative_of_the_balance(held, order, duration):
    """Taylor's theorem: halving a step quarters what is left, with flow and without, of biomass as it is and of its
    mean over a time."""
    now, found = at_start(thick(None if held else "2.9 m/day", order))
    balance, random = Balance(found.problem, Sink(now.active, duration)), np.random.default_rng(1)
    state = 1 + 8 * random.random(2 * now.space.count)
    move = random.standard_normal(len(state))
    start = balance.residual(state)
    linear = found.problem.system.product(balance.tangent(state), move)
    left = [np.abs(balance.residual(state + s * move) - start - s * linear).max() for s in (0.02, 0.01, 0.005)]
    assert all(3.6 < a / b < 4.4 for a, b in zip(left, left[1:]))


@EVERY_ORDER
def test_the_sizes_of_the_terms_bound_the_balance(order):
    """They do not cancel: no residual is larger, of either sign of the concentrations, and without biomass they are
    those of the linear parts."""
    now, found = at_start(thick("2.9 m/day", order))
    balance, random = Balance(found.problem, Sink(100 * now.active)), np.random.default_rng(2)
    state = random.uniform(-1, 1, 2 * now.space.count)
    assert (np.abs(balance.residual(state)) <= balance.sizes(state) * (1 + 1e-12)).all()
    alone, problem = Balance(found.problem, None), found.problem
    assert np.allclose(alone.sizes(state), abs(problem.operator) @ abs(state) + problem.source)


@EVERY_ORDER
def test_substrates_are_coupled_in_the_biomass_alone(order):
    """Acceptor and donor of a node of the water have no entry in common."""
    now, found = at_start(thick("2.9 m/day", order))
    system, count = found.problem.system, now.space.count
    tangent = Balance(found.problem, sink_of(now)).tangent(np.ones(2 * count))
    rows, columns = system.matrix(tangent).nonzero()
    rows, columns = system.order[rows], system.order[columns]
    pairs = (rows < count) != (columns < count)
    assert pairs.any() and np.isin(rows[pairs] % count, now.space.reaction.cells).all()


@pytest.mark.parametrize("order", [1, 2])
def test_all_orders_agree(order):
    """On effluents and uptake, to 1 % of what is taken up."""
    _, _, found = solved("30 um", velocity="0.35 m/day", order=order)
    wanted = solved("30 um", velocity="0.35 m/day", order=3)[2].fluxes
    for one, two in zip(found.fluxes, wanted):
        assert one.consumed == pytest.approx(two.consumed, rel=1e-2)
        assert one.effluent == pytest.approx(two.effluent, abs=1e-2 * two.consumed / two.supplied * 10)
