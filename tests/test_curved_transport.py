"""Quadratic concentrations on curved triangles: balance, stoichiometry, fast and slow water, starved aggregates."""
from dataclasses import replace

import numpy as np
import pytest

from repro.curved import pore, transport
from repro.errors import TransportError
from tests.strategies import scene

FINE = {"preset": "accurate", "refinement": 0.45}


def thick(velocity, numerics=None, **more):
    """A half-disc of 60 um in a pore of 100 um."""
    return scene("60 um", "100 um", velocity=velocity, numerics=numerics or FINE, **more)


def without_decay(made, share):
    """The scene with half saturations at a share of the supplies, and no decay."""
    both = {name: replace(s, half_saturation=share * s.supply)
            for name, s in (("acceptor", made.substrates.acceptor), ("donor", made.substrates.donor))}
    return replace(made, substrates=replace(made.substrates, **both),
                   kinetics=replace(made.kinetics, decay_coefficient=0.0))


def solved(made):
    now = pore.seeded(made)
    return now, pore.solve(made, now)


def lack(made, fluxes):
    """(what each substrate's effluent lacks of its supply), mg/L."""
    both = (made.substrates.acceptor, made.substrates.donor)
    return np.array([s.supply - flux.effluent for s, flux in zip(both, fluxes)])


@pytest.mark.parametrize("velocity", ["0.29 m/day", "2.9 m/day", "29 m/day"])
def test_supply_is_effluent_and_uptake(velocity):
    """The sum of all equations is the balance: to Newton's 1e-12, of terms that diffusion makes larger than the supply.
    Mutant: the outlet's matrix left out, consumption without the quadrature's weights."""
    made = thick(velocity)
    for flux in solved(made)[1].fluxes:
        assert abs(flux.supplied - flux.out - flux.consumed) < 1e-11 * flux.supplied
        assert flux.consumed > 1e-3 * flux.supplied


def test_the_demand_of_decay_is_that_of_its_rate():
    """consumed_A = F consumed_D + d_c f_d b (X_A m_A integrated). Mutant: decay left out of paired_uptake, or F for
    both terms."""
    made = thick("2.9 m/day")
    now, found = solved(made)
    law, cells = made.kinetics, now.mesh.cells[now.mesh.biomass]
    acceptor = found.concentrations.acceptor[cells].mean(axis=1)
    assert np.ptp(found.concentrations.acceptor[now.mesh.body]) > 2.5, "else nothing is tested"
    decay = law.decay_oxygen_demand * law.degradable_fraction * law.decay_coefficient * law.maximum_density
    share = acceptor / (acceptor + made.substrates.acceptor.half_saturation)
    by_decay = decay * now.mesh.places.dx[now.mesh.biomass].sum(axis=1) @ share
    left = found.fluxes[0].consumed - law.acceptor_to_donor_ratio * found.fluxes[1].consumed
    assert left == pytest.approx(by_decay, rel=5e-3)


@pytest.mark.parametrize("share", [1e-2, 1e-4, 1e-6])
@pytest.mark.parametrize("velocity, acceptor, donor", [("0.29 m/day", "10 mg/L", "10 mg/L"),
                                                       ("2.9 m/day", "10 mg/L", "10 mg/L"),
                                                       ("0.29 m/day", "100 mg/L", "1 mg/L")])
def test_what_is_taken_up_of_both_stays_in_proportion(share, velocity, acceptor, donor):
    """Without decay, F moles of acceptor go with each of donor, to round-off, however sharp the front where one of them
    ends; nothing is below zero by more than 1e-4 of the supply. Mutants: uptake for paired_uptake, a sweep that is
    taken for the solution, UNRESOLVED = 1."""
    made = without_decay(thick(velocity, acceptor=acceptor, donor=donor), share)
    _, found = solved(made)
    a, d = lack(made, found.fluxes)
    assert a == pytest.approx(made.kinetics.acceptor_to_donor_ratio * d, abs=1e-10 * made.substrates.acceptor.supply)
    largest = max(made.substrates.acceptor.supply, made.substrates.donor.supply)
    for field in (found.concentrations.acceptor, found.concentrations.donor):
        assert field.min() >= -1e-4 * largest


def test_equal_diffusivities_keep_the_difference():
    """With one diffusivity, C_A - F C_D is carried and diffused but not taken up: it is, at every node, what the same
    equations say of a substrate that nothing takes up. That is the supply but for what the water's div u, zero against
    linear functions only, makes of it: under 1e-4 of it here. Mutants: uptake for paired_uptake, slopes of one
    substrate's rate in the other's rows exchanged (Newton's method stops short)."""
    made = without_decay(thick("0.29 m/day"), 1e-3)
    donor = replace(made.substrates.donor, diffusivity=made.substrates.acceptor.diffusivity,
                    diffusivity_in_aggregate=made.substrates.acceptor.diffusivity_in_aggregate)
    made = replace(made, substrates=replace(made.substrates, donor=donor))
    now, found = solved(made)
    free = transport.steady(transport.problem(now.mesh, found.flow, made.substrates, None), None).donor
    both, ratio = found.concentrations, made.kinetics.acceptor_to_donor_ratio
    assert np.ptp(both.acceptor) > 1.5
    assert np.allclose(both.acceptor - ratio * both.donor, (1 - ratio) * free, rtol=0, atol=1e-8)
    assert 1e-6 < np.abs(free - 10).max() < 3e-3


def test_starved_and_all_but_still():
    """A pore with slow water, u W / D = 0.1: what comes in is used up; the profile ends at a 1e4th of the supply.
    Mutant: diffusion out through the inlet's end left in, (11) as C = C_s."""
    made = thick("0.0029 m/day", {"preset": "accurate", "refinement": 0.25})
    now, found = solved(made)
    a, d = found.fluxes
    assert a.out < 2e-4 * a.supplied and 0.3 < d.out / d.supplied < 0.4
    assert found.concentrations.acceptor.max() < 0.01 * made.substrates.acceptor.supply


def test_too_slow_a_flow_is_refused():
    """Under u W / D = 1e-9 the inlet's supply is lost in round-off. Mutant: SLOWEST = 0."""
    made = thick("1e-9 m/day")
    with pytest.raises(TransportError, match=r"Peclet number u W / D is 1\.2e-09, under 1e-09|nothing is supplied"):
        solved(thick("1e-10 m/day"))
    assert np.isfinite(solved(made)[1].fluxes[0].effluent)


def test_too_coarse_a_mesh_is_refused(monkeypatch):
    """Without elements for the boundary layer the concentration oscillates upstream: more than 2 % over the supply.
    Mutant: OVERSHOOT = 1, or the check of the largest value left out."""
    monkeypatch.setattr(pore, "BOUNDARY_LAYER", 0.0)
    with pytest.raises(TransportError, match="outside of 0 to 10; the mesh is too coarse"):
        solved(thick("290 m/day", {"preset": "fast"}))


def test_negative_concentrations_are_refused():
    """A state below zero by more than 1e-3 of the supply is no solution. Mutant: the check of the least value left
    out."""
    made = thick("2.9 m/day")
    now, found = solved(made)
    state = np.concatenate([found.concentrations.acceptor, found.concentrations.donor])
    state[3] = -0.009
    transport._checked(found.problem, state, 1)
    state[3] = -0.011
    with pytest.raises(TransportError, match="the acceptor is -0.011 mg/L"):
        transport._checked(found.problem, state, 1)


@pytest.mark.parametrize("held", [False, True])
def test_the_tangent_is_the_derivative_of_the_balance(held):
    """Taylor's theorem: halving a step quarters what is left, with flow and without. Mutants: a slope of paired_uptake
    that is not the derivative, slopes of the two substrates exchanged."""
    made = thick(None if held else "2.9 m/day")
    now, found = solved(made)
    weight, random = transport.sinks(found.problem, pore.active_biomass(made, now)), np.random.default_rng(1)
    state = 1 + 8 * random.random(2 * len(now.mesh.points))
    move = random.standard_normal(len(state))
    start = transport.balance(found.problem, weight, state)
    linear = found.problem.system.product(transport.tangent(found.problem, weight, state), move)
    left = [np.abs(transport.balance(found.problem, weight, state + s * move) - start - s * linear).max()
            for s in (0.02, 0.01, 0.005)]
    assert all(3.6 < a / b < 4.4 for a, b in zip(left, left[1:]))


def test_the_sizes_of_the_terms_bound_the_balance():
    """They do not cancel: no residual is larger, of either sign of the concentrations, and without biomass they are
    those of the linear parts. Mutants: the uptake's terms left out, a size of the state with its sign."""
    made = thick("2.9 m/day")
    now, found = solved(made)
    problem, random = found.problem, np.random.default_rng(2)
    weight = 100 * transport.sinks(problem, pore.active_biomass(made, now))
    state = random.uniform(-1, 1, 2 * len(now.mesh.points))
    sizes = transport.terms(problem, weight, state)
    assert (np.abs(transport.balance(problem, weight, state)) <= sizes * (1 + 1e-12)).all()
    assert np.allclose(transport.terms(problem, None, state), abs(problem.operator) @ abs(state) + problem.source)


def test_substrates_are_coupled_in_the_biomass_alone():
    """Acceptor and donor of a node of the water have no entry in common. Mutant: all triangles coupled."""
    made = thick("2.9 m/day")
    now, found = solved(made)
    system, count = found.problem.system, found.problem.space.count
    rows, columns = system.matrix(transport.tangent(
        found.problem, transport.sinks(found.problem, pore.active_biomass(made, now)),
        np.ones(2 * count))).nonzero()
    rows, columns = system.order[rows], system.order[columns]
    pairs = (rows < count) != (columns < count)
    assert pairs.any() and np.isin(rows[pairs] % count, now.mesh.body).all()


def test_a_sweep_without_biomass_is_the_linear_solution():
    """What Newton's method falls back to has nothing to freeze then. Mutant: the uptake asked for all the same."""
    made = thick("2.9 m/day")
    found = solved(made)[1].problem
    swept = transport._sweep(found, None, np.zeros(2 * found.space.count))
    for k, substrate in enumerate(found.both):
        assert np.allclose(np.split(swept, 2)[k], substrate.supply, rtol=0.01)


def test_without_flow_the_ends_hold_the_supply_and_feed_the_aggregate():
    """Pure diffusion: what comes in through the held ends is what is taken up. Mutant: the ends' flux of one end only,
    ends not held."""
    made = thick(None)
    now, found = solved(made)
    assert (found.concentrations.donor[np.concatenate([now.mesh.inlet, now.mesh.outlet])] == 10).all()
    for flux in found.fluxes:
        assert flux.supplied == pytest.approx(flux.consumed, rel=1e-9) and flux.consumed > 0


def test_the_first_guess_does_not_matter():
    """From the supply or from its own solution, one answer. Mutant: the guess taken as solved."""
    made = thick("2.9 m/day")
    now, found = solved(made)
    other = replace(found.concentrations, acceptor=0.3 + 0 * found.concentrations.acceptor)
    again = transport.steady(found.problem, pore.active_biomass(made, now), other)
    assert np.allclose(again.acceptor, found.concentrations.acceptor, atol=1e-9)
    assert np.allclose(again.donor, found.concentrations.donor, atol=1e-9)
