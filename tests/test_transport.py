"""Substrates (7)-(13), quasi-steady: closed forms, the balance, starved pores, scaling, and the printed inlet [E4]."""
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from hypothesis import given

from reference import robin_channel
from repro.model import kinetics, pore, transport
from repro.model.flow import Flow
from tests.strategies import between, fitted_order, meshed, plug, scene, scenes, share
from verification.bench import ribbons

VELOCITY = 2.9e6 / 24  # um/h


@cache
def solved(radius="5 um", width="50 um", acceptor="10 mg/L", donor="10 mg/L", velocity="2.9 m/day", inlet="local",
           extent="central"):
    """(scene, Pore, Solved) of a fixed shape."""
    made = scene(radius, width, acceptor, donor, velocity, numerics={"inlet": inlet, "extent": extent})
    now = pore.seeded(made)
    return made, now, pore.solve(made, now)


def defects(now, found):
    """(supplied - out - consumed) / supplied of both substrates."""
    both = transport.fluxes(found.problem, now.active, found.concentrations)
    return [(f.supplied - f.out - f.consumed) / f.supplied for f in both]


def plug_flow(grid):
    """The same velocity everywhere."""
    count = len(grid.points)
    return Flow(VELOCITY, np.column_stack([np.full(count, VELOCITY), np.zeros(count)]), np.zeros(count),
                np.zeros((len(grid.triangles), 2)), 0.0, 0.0, 0.0)


def strip_error(rate, refinement):
    """(h, largest error, C) with uptake ``rate`` C (1/h) of the acceptor in a strip from 0 to 40 um: half-saturation
    1e9 mg/L makes the decay's demand linear in C_A to 1e-8, no growth takes part."""
    grid, _ = meshed(plug(50.0, 0.0, 40.0), refinement=refinement, ends=(-75.0, 115.0))
    made = scene(velocity="2.9 m/day", kinetics={"maximum_utilization_rate": "0 1/day"},
                 substrates={"acceptor": {"half_saturation": "1e9 mg/L"}, "donor": {"supply": "5 mg/L"}})
    k, acceptor = made.kinetics, made.substrates.acceptor
    problem = transport.problem(grid, plug_flow(grid), made.substrates, k)
    density = rate * 1e9 / (k.decay_oxygen_demand * k.degradable_fraction * k.decay_coefficient)
    found = transport.steady(problem, np.where(problem.body > 0, density, 0.0))
    water, biomass = acceptor.diffusivity, acceptor.diffusivity_in_aggregate
    exact = robin_channel.strip(grid.points[:, 0], VELOCITY, 10.0, water, biomass, rate, 40.0)
    assert found.donor == pytest.approx(np.full(len(grid.points), 5.0), rel=1e-11)
    return len(grid.points) ** -0.5, np.abs(found.acceptor - exact).max(), exact


def test_first_order_uptake_in_a_strip_follows_the_closed_form():
    """(7), (11), (12), (26), with D of water and of biomass: 10 mg/L down to 1.9; second order (measured 2.0), 6e-3
    mg/L at the default size. Mutant: the diffusivities exchanged, the Robin term's sign, C_supply held at the inlet,
    uptake also weighed with fluid triangles at the interface."""
    size, error, exact = zip(*(strip_error(1e4, r) for r in (0.6, 1.0, 1.5)))
    assert exact[1].min() < 2.0 and exact[1].max() > 7.0
    assert error[1] < 8e-3 and 1.6 < fitted_order(size, error) < 2.5
    assert strip_error(1e3, 1.0)[1] < 2e-3


@pytest.mark.parametrize("inlet", ["local", "mean"])
def test_a_constant_supply_stays_constant_without_biomass(inlet):
    """To round-off, around an obstacle and for both forms of (11): w is divergence-free. Mutant: u carries the
    substrates."""
    _, _, found = solved("30 um", inlet=inlet)
    guess = transport.Concentrations(*np.full((2, len(found.problem.total)), 3.0))
    alone = transport.steady(found.problem, None, guess)
    assert alone.acceptor == pytest.approx(np.full(len(alone.acceptor), 10.0), rel=1e-11)
    assert alone.donor == pytest.approx(np.full(len(alone.donor), 10.0), rel=1e-11)


STARVED = [("27 um", "0.15 mg/L", "0.15 mg/L"), ("42 um", "0.15 mg/L", "0.15 mg/L"), ("42 um", "0.15 mg/L", "10 mg/L"),
           ("42 um", "10 mg/L", "0.15 mg/L"), ("42 um", "10 mg/L", "10 mg/L")]


@pytest.mark.parametrize("radius, acceptor, donor", STARVED)
def test_the_balance_closes_and_nothing_is_negative_in_starved_pores(radius, acceptor, donor):
    """0.35 m/d, aggregates of 27 and 42 um in 50 um. The rows are solved to 1e-13 of their terms, some 1e3 times the
    supply: 1e-9 at the worst, 1.1e-10 measured. Mutant: fluxes taken from interpolated gradients, biomass weighed by
    another rule."""
    _, now, found = solved(radius, acceptor=acceptor, donor=donor, velocity="0.35 m/day")
    assert np.abs(defects(now, found)).max() < 1e-9
    for field, substrate in ((found.concentrations.acceptor, acceptor), (found.concentrations.donor, donor)):
        assert 0 < field.min() and field.max() <= float(substrate.split()[0]) * (1 + 1e-12)


@pytest.mark.parametrize("radius", ["27 um", "42 um"])
def test_newton_does_not_fall_into_a_negative_root(radius, monkeypatch):
    """From a first iterate of 10 mg/L over a supply of 0.15. Undamped, with C / (C + K) below zero too, Newton's
    method "converges" to -31 and -70 mg/L (measured), which here must not even be possible to return. Mutant: the
    guards of _advance and monod."""
    made, now, found = solved(radius, acceptor="0.15 mg/L", donor="0.15 mg/L", velocity="0.35 m/day")
    rich = transport.Concentrations(*np.full((2, len(now.mesh.points)), 10.0))
    again = transport.steady(found.problem, now.active, rich)
    assert again.acceptor == pytest.approx(found.concentrations.acceptor, rel=1e-7)
    assert again.donor == pytest.approx(found.concentrations.donor, rel=1e-7)
    monkeypatch.setattr(kinetics, "monod", lambda c, half: (c / (c + half), half / (c + half) ** 2))
    guarded = transport.steady(found.problem, now.active, rich)
    assert guarded.acceptor.min() > 0


def test_the_answer_does_not_depend_on_the_first_iterate():
    """Random first iterates: one steady state. Mutant: Newton stopped by the size of its step."""
    _, now, found = solved("42 um", velocity="0.35 m/day")
    rng = np.random.default_rng(1)
    for scale in (0.1, 30.0):
        guess = transport.Concentrations(*rng.uniform(0.0, scale, (2, len(now.mesh.points))))
        again = transport.steady(found.problem, now.active, guess)
        assert again.acceptor == pytest.approx(found.concentrations.acceptor, rel=1e-7)


def test_the_printed_inlet_condition_loses_what_E4_says():
    """u_ave in (11): defect exactly sum of (u_ave - u_x) C over the inlet, and nothing but inlet rows changes.
    Mutant: u_ave also in the outlet's flux or in the advection."""
    _, now, local = solved("30 um", velocity="0.35 m/day")
    _, _, mean = solved("30 um", velocity="0.35 m/day", inlet="mean")
    assert np.abs(defects(now, local)).max() < 1e-9
    for key in ("acceptor", "donor"):
        one, two = getattr(local.problem, key), getattr(mean.problem, key)
        change = (two.matrix - one.matrix).tocoo()
        assert set(change.row[np.abs(change.data) > 0]) <= set(now.mesh.inlet)
        robin = two.source / two.supply
        assert robin.sum() == pytest.approx(one.inflow.sum(), rel=1e-13)
        lost = (robin - two.inflow) @ getattr(mean.concentrations, key) / two.supplied
        assert dict(zip(("acceptor", "donor"), defects(now, mean)))[key] == pytest.approx(lost, abs=1e-9)
        assert 1e-6 < abs(lost) < 1e-3
    body = now.mesh.body
    assert mean.concentrations.acceptor[body] == pytest.approx(local.concentrations.acceptor[body], rel=1e-3)


def test_without_flow_the_supply_is_held_at_both_ends():
    """Pure diffusion: what is consumed comes in through the ends, supply exact there. Mutant: one end held."""
    made = scene("20 um")
    now = pore.seeded(made)
    found = pore.solve(made, now)
    field = found.concentrations.acceptor
    ends = np.concatenate([now.mesh.inlet, now.mesh.outlet])
    assert (field[ends] == 10.0).all() and field.min() < 9.9
    assert np.abs(defects(now, found)).max() < 1e-9
    alone = transport.steady(found.problem, np.zeros(len(field)))
    assert alone.acceptor == pytest.approx(np.full(len(field), 10.0), rel=1e-12)


def test_pure_diffusion_to_a_strip_is_the_hyperbolic_cosine():
    """Uptake kappa C over the whole meshed length, C_supply at both ends: C_s cosh(a x) / cosh(a L / 2), a^2 = kappa
    / D_B, within the error of the mesh (measured 3e-3 mg/L). Mutant: D of water in the biomass."""
    grid, _ = meshed(plug(50.0, -60.0, 60.0), ends=(-75.0, 75.0))
    grid = replace(grid, biomass=np.ones(len(grid.biomass), bool), topology={})
    made = scene(kinetics={"maximum_utilization_rate": "0 1/day"},
                 substrates={"acceptor": {"half_saturation": "1e9 mg/L"}, "donor": {}})
    k = made.kinetics
    problem = transport.problem(grid, None, made.substrates, k)
    rate = 5e3
    density = rate * 1e9 / (k.decay_oxygen_demand * k.degradable_fraction * k.decay_coefficient)
    found = transport.steady(problem, np.full(len(grid.points), density))
    a = np.sqrt(rate / made.substrates.acceptor.diffusivity_in_aggregate)
    exact = 10 * np.cosh(a * grid.points[:, 0]) / np.cosh(75 * a)
    assert exact.min() < 5
    assert np.abs(found.acceptor - exact).max() < 8e-3


@share(0.4)
@given(scenes(steps=1), between(1e-3, 1e3))
def test_only_the_ratios_to_half_saturation_matter(made, factor):
    """C27: supply, K_s and X_m of both scaled together scale every concentration. Mutant: a K_s of 1 mg/L written
    into the code, a concentration taken for zero under an absolute bound."""
    s, k = made.substrates, made.kinetics
    both = [replace(one, supply=factor * one.supply, half_saturation=factor * one.half_saturation)
            for one in (s.acceptor, s.donor)]
    other = replace(made, substrates=replace(s, acceptor=both[0], donor=both[1]),
                    kinetics=replace(k, maximum_density=factor * k.maximum_density))
    one, two = (pore.solve(each, pore.seeded(each)).concentrations for each in (made, other))
    assert two.acceptor / factor == pytest.approx(one.acceptor, rel=1e-7, abs=1e-11 * s.acceptor.supply)
    assert two.donor / factor == pytest.approx(one.donor, rel=1e-7, abs=1e-11 * s.donor.supply)


def test_the_meshed_part_stands_for_the_whole_pore():
    """(26) upstream, (12) downstream (C19, C36): meshing all 600 um changes effluents and smallest acceptor by under
    0.1 % of the supply. Mutant: C_supply held at the meshed inlet, which lies 8 % under it here."""
    _, now, part = solved("30 um", velocity="1.4 m/day")
    _, all_now, whole = solved("30 um", velocity="1.4 m/day", extent="full")
    for one, two in zip(transport.fluxes(part.problem, now.active, part.concentrations),
                        transport.fluxes(whole.problem, all_now.active, whole.concentrations)):
        assert one.effluent == pytest.approx(two.effluent, abs=1e-2)
        assert one.inlet < 9.5 and two.inlet > one.inlet
    assert part.concentrations.acceptor.min() == pytest.approx(whole.concentrations.acceptor.min(), abs=1e-2)


def test_uptake_is_stoichiometric():
    """Acceptor taken up over donor taken up: F + d_c f_d b m_A X / (k m_A m_D X), between F and that at the smallest
    m_D. Mutant: the two substrates' sinks exchanged, biomass weighed differently for both."""
    made, now, found = solved("20 um")
    acceptor, donor = transport.fluxes(found.problem, now.active, found.concentrations)
    extra = 1.42 * 0.8 * 0.12 / 9.3
    donor_m = [c / (c + 1) for c in (found.concentrations.donor[now.mesh.body].min(), 10.0)]
    assert 1.52 + extra / donor_m[1] <= acceptor.consumed / donor.consumed <= 1.52 + extra / donor_m[0]
    assert found.problem.body.sum() == pytest.approx(now.outline.area, rel=1e-12)


def test_couplings_that_are_exactly_zero_keep_their_place():
    """Between right triangles nothing diffuses along the hypotenuse: without flow those entries are zero. The steady
    state without biomass is the supply. Mutant: matrices added so that such entries are dropped."""
    grid = ribbons.straight((0.0, 40.0), 20.0, (8, 4), lambda x, y: (x > 10) & (x < 20))
    problem = transport.problem(grid, None, scene().substrates, scene().kinetics)
    found = transport.steady(problem, np.zeros(len(grid.points)))
    assert found.acceptor == pytest.approx(10.0, rel=1e-12)
