"""Balances of substrates and biomass on scenes of any kind (2.2), kept in loops that know nothing but the paper."""
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import event, given

from repro.errors import TransportError
from repro.march import coupling
from repro.model import pore, transport
from tests import oracles
from tests.strategies import between, constants, scenes


def substrate_fields(state):
    return state.acceptor, state.donor


def supplies(made):
    return made.substrates.acceptor.supply, made.substrates.donor.supply


def consumed(made, now, state):
    """[acceptor, donor] taken up in an instant (um2 mg/L/h): node by node, S_i X_i times -F1 and -F2 over X."""
    weight, sums = oracles.nodal_areas(now.mesh.points, now.mesh.triangles[now.mesh.biomass]), [0.0, 0.0]
    for S, X, acceptor, donor in zip(weight, now.active, *substrate_fields(state)):
        for substrate in (0, 1):
            sums[substrate] -= S * X * oracles.rates(acceptor, donor, **constants(made))[substrate]
    return sums


def carried_out(now, flow, field):
    """Flux of u_x C through the outlet (um2 mg/L/h), side by side, both linear: Simpson's rule is exact."""
    total = 0.0
    for i, j in pairwise(now.mesh.outlet):
        length = now.mesh.points[j, 1] - now.mesh.points[i, 1]
        u, c = flow.velocity[[i, j], 0], field[[i, j]]
        total += length / 6 * (u[0] * c[0] + (u[0] + u[1]) * (c[0] + c[1]) + u[1] * c[1])
    return total


def round_off(problem, field, k):
    """What the rows' defects may add up to (um2 mg/L/h): each is solved to 1e-13 of its own terms."""
    return 1e-13 * np.sum(2 * problem.both[k].magnitude @ field + problem.both[k].source)


@given(scenes(steps=1), between(1e-2, 1e3))
def test_the_quasi_steady_answer_lies_between_nothing_and_the_supply(made, richness):
    """Fed, starved or with nothing, driven or not, and the same from any first iterate. Mutant: C / (C + K) below zero
    too with Newton's step taken whatever it does (starved scenes then fall into their negative root), a supply of 10
    mg/L at the inlet whatever the scene says."""
    now = pore.seeded(made)
    solved = pore.solve(made, now)
    ones = richness * np.ones(len(now.active))
    guess = transport.Concentrations(*(supply * ones for supply in supplies(made)))
    again = transport.steady(solved.problem, now.active, guess)
    for field, other, supply in zip(*map(substrate_fields, (solved.concentrations, again)), supplies(made)):
        assert field.min() >= 0 and field.max() <= supply * (1 + 1e-12)
        assert other == pytest.approx(field, rel=1e-6, abs=1e-12 * supply)


@given(scenes(drives=("head", "mean_velocity"), peclet=1000.0, steps=1))
def test_no_negative_answer_is_returned_where_the_mesh_is_too_coarse(made):
    """Up to u h / D = 300 an element, where linear elements oscillate: refused by name or positive. Mutant: the check
    of the answer's sign left out."""
    now = pore.seeded(made)
    try:
        found = pore.solve(made, now).concentrations
    except TransportError as error:
        event("refused")
        assert "negative" in str(error) and "try a larger numerics.refinement" in str(error)
    else:
        assert min(field.min() for field in substrate_fields(found)) >= 0


@given(scenes())
def test_what_is_supplied_leaves_or_is_taken_up(made):
    """In every instant, with uptake and outflow counted anew. Mutant: decay's demand without m_A or counted twice, S_i
    over all triangles, u for w in the advection, the outflow by the trapezoidal rule, fluxes of an older state."""
    for instant in coupling.simulate(made):
        now, solved = instant.pore, instant.solved
        both = transport.fluxes(solved.problem, now.active, solved.concentrations)
        taken = consumed(made, now, solved.concentrations)
        for k, (flux, field, supply) in enumerate(zip(both, substrate_fields(solved.concentrations), supplies(made))):
            bound = round_off(solved.problem, field, k)
            out = carried_out(now, solved.flow, field) if solved.flow else 0.0
            assert flux.consumed == pytest.approx(taken[k], rel=1e-11, abs=1e-300)
            assert flux.out == pytest.approx(out, rel=1e-12, abs=1e-300)
            assert abs(flux.supplied - out - taken[k]) <= bound
            if solved.flow:
                assert flux.supplied == pytest.approx(solved.flow.mean_velocity * made.pore.width * supply, rel=1e-12)


@given(scenes())
def test_the_ledgers_of_every_step_close(made):
    """Substrates to round-off; biomass to 1e-12, but where the paper's linear transfer meets a new mesh [E8]; each step
    starts from what the last one left. Mutant: biomass made by X_A alone, (34) with all triangles, fluxes of the end
    for the mean of start and end, a lumped projection."""
    for last, instant in pairwise(coupling.simulate(made)):
        (row,) = instant.ledgers
        for k, sums in enumerate(zip(row.supplied, row.out, row.consumed, row.stored)):
            bound = sum(round_off(solved.problem, substrate_fields(solved.concentrations)[k], k)
                        for solved in (last.solved, instant.before[1]))
            assert abs(sums[0] - sums[1] - sums[2] - sums[3]) <= (row.end - row.start) * bound
        assert row.biomass_before == pytest.approx(mass(last.pore), rel=1e-13)
        assert row.biomass_made == pytest.approx(mass(instant.before[0]) - row.biomass_before,
                                                 abs=1e-13 * row.biomass_before)
        if made.numerics.transfer == "conserving" or not instant.remeshes:
            assert row.biomass_after == pytest.approx(row.biomass_before + row.biomass_made, rel=1e-12)
        assert row.biomass_after == pytest.approx(mass(instant.pore), rel=1e-13)


def mass(now):
    """X_A + X_I over the aggregate (um2 mg/L), triangle by triangle."""
    return oracles.mass(now.mesh.points, now.mesh.triangles[now.mesh.biomass], now.active + now.inert)


@given(scenes())
def test_the_oxygen_demand_of_the_donor_is_spent_or_kept_in_biomass(made):
    """Of (7)-(10), with COD = F + Y d_c: |F1| + d_c (F3 + F4) = COD |F2| at all concentrations. A step keeps it to the
    error of the trapezoidal rule on what grows and decays at rates up to k Y and b: (k Y + b)^2 dt^2 / 12 of it, here
    with a factor of 3 for the rates' own change (measured: 1.5).

    Mutant: X_I left out of the biomass made, f_d for 1 - f_d, biomass made at the rates of the step's start, d_f d_b
    for d_c f_d b [E3].
    """
    k = made.kinetics
    demand = k.acceptor_to_donor_ratio + k.yield_coefficient * k.decay_oxygen_demand
    fastest = k.maximum_utilization_rate * k.yield_coefficient + k.decay_coefficient
    for instant in coupling.simulate(made):
        for row in instant.ledgers:
            kept = k.decay_oxygen_demand * row.biomass_made
            size = row.consumed[0] + abs(kept) + demand * row.consumed[1]
            error = (fastest * (row.end - row.start)) ** 2 / 4
            assert abs(row.consumed[0] + kept - demand * row.consumed[1]) <= error * size + 1e-13 * row.biomass_before
