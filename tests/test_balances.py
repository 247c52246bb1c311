"""What holds for a run of any scene: balances of substrates and biomass (2.2), kept in loops that know nothing but the
paper; and when its steps end."""
import math
import re
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import event, example, given
from hypothesis import strategies as st

from repro.errors import SimulationError, TransportError, Unresolved
from repro.march import balance, midpoint, updates
from repro.march.loop import Ledger
from repro.march.simulation import simulate
from repro.model import pore, transport
from repro.model.kinetics import Sink
from repro.results import read_table, row
from repro.scene import load_scene
from tests import oracles, pages, shell
from tests.strategies import ORDERS, between, scene, scenes, share
from tests.test_derived import over_end, taken_up

ANY_ORDER = tuple(ORDERS.values())
EVERY_ORDER = pytest.mark.parametrize("order", ORDERS)


def instants(made):
    """Of a run; those up to where its mesh is too coarse, which higher orders say."""
    try:
        yield from simulate(made)
    except SimulationError as error:
        if not isinstance(error.__cause__, Unresolved):
            raise
        event("unresolved")


def substrate_fields(state):
    return state.acceptor, state.donor


def supplies(made):
    return made.substrates.acceptor.supply, made.substrates.donor.supply


def round_off(problem, field, k):
    """What the rows' defects may add up to (um2 mg/L/h): each is solved to 1e-13 of its own terms, or to 1e-12 where
    round-off allows no less."""
    n = problem.space.count
    own = slice(k * n, k * n + n)
    part = transport.NEWTON if problem.space.order == 1 else transport.ROUND_OFF
    return part * np.sum(2 * problem.magnitude[own, own] @ np.abs(field) + np.abs(problem.source[own]))


@given(scenes(steps=1, elements=ANY_ORDER), between(1e-2, 1e3))
def test_the_quasi_steady_answer_lies_between_nothing_and_the_supply(made, richness):
    """Fed, starved or with nothing, driven or not, and the same from any first iterate."""
    now = pore.seeded(made)
    try:
        solved = pore.solve(made, now)
    except Unresolved:
        assert made.numerics.order > 1
        event("unresolved")
        return
    ones = richness * np.ones(now.space.count)
    guess = transport.Concentrations(*(supply * ones for supply in supplies(made)))
    again = transport.steady(solved.problem, Sink(now.active), guess)
    low, high = (-1e-30, 1e-12) if made.numerics.order == 1 else (-transport.UNRESOLVED, transport.OVERSHOOT)
    for field, other, supply in zip(*map(substrate_fields, (solved.concentrations, again)), supplies(made)):
        assert field.min() >= low * supply and field.max() <= supply * (1 + high)
        assert other == pytest.approx(field, rel=1e-6, abs=1e-12 * supply)


@given(scenes(drives=("head", "mean_velocity"), peclet=1000.0, steps=1))
def test_no_negative_answer_is_returned_where_the_mesh_is_too_coarse(made):
    """Up to u h / D = 300 an element, where linear elements oscillate: refused by name, or above less than nothing by a
    thousandth of the supply at most."""
    now = pore.seeded(made)
    try:
        found = pore.solve(made, now).concentrations
    except TransportError as error:
        event("refused")
        assert "the mesh is too coarse" in str(error) or "try a larger numerics.refinement" in str(error)
    else:
        for field, supply in zip(substrate_fields(found), supplies(made)):
            assert field.min() >= -transport.UNRESOLVED * supply


@given(scenes(elements=ANY_ORDER))
def test_every_instant_and_step_balances(made):
    """Of one run: what is supplied, the ledgers, the demand for oxygen."""
    found = list(instants(made))
    assert_supplied_leaves_or_is_taken_up(made, found)
    assert_ledgers_close(made, found)
    assert_demand_is_spent_or_kept(made, found)


def assert_supplied_leaves_or_is_taken_up(made, found):
    """In every instant, with uptake and outflow counted anew."""
    for instant in found:
        now, solved = instant.pore, instant.solved
        both = transport.fluxes(solved.problem, Sink(now.active), solved.concentrations)
        taken = taken_up(made, now, solved.concentrations)
        for k, (flux, field, supply) in enumerate(zip(both, substrate_fields(solved.concentrations), supplies(made))):
            bound = round_off(solved.problem, field, k)
            out = over_end(now.space, now.mesh.ends[1], solved.flow.velocity[:, 0], field) if solved.flow else 0.0
            assert flux.consumed == pytest.approx(taken[k], rel=1e-11, abs=1e-300)
            assert flux.out == pytest.approx(out, rel=1e-12, abs=1e-300)
            assert abs(flux.supplied - out - taken[k]) <= bound
            if solved.flow:
                assert flux.supplied == pytest.approx(solved.flow.mean_velocity * made.pore.width * supply, rel=1e-12)


def assert_ledgers_close(made, found):
    """Substrates to round-off; biomass to 1e-12, but where the paper's linear transfer meets a new mesh [E8]; each step
    starts from what the last one left."""
    for last, instant in pairwise(found):
        (ledger,) = instant.ledgers
        for k, sums in enumerate(zip(ledger.supplied, ledger.out, ledger.consumed, ledger.stored)):
            bound = sum(round_off(solved.problem, substrate_fields(solved.concentrations)[k], k)
                        for solved in (last.solved, instant.before[1]))
            assert abs(sums[0] - sums[1] - sums[2] - sums[3]) <= (ledger.end - ledger.start) * bound
        assert ledger.biomass_before == pytest.approx(mass(last.pore), rel=1e-13)
        assert ledger.biomass_made == pytest.approx(mass(instant.before[0]) - ledger.biomass_before,
                                                 abs=1e-13 * ledger.biomass_before)
        if made.numerics.transfer == "conserving" or not instant.remeshes:
            assert ledger.biomass_after == pytest.approx(ledger.biomass_before + ledger.biomass_made, rel=1e-12)
        assert ledger.biomass_after == pytest.approx(mass(instant.pore), rel=1e-13)


def mass(now):
    """X_A + X_I over the aggregate (um2 mg/L): of linear densities triangle by triangle, else point by point."""
    if now.space.order > 1:
        return float(np.sum(now.active + now.inert))
    nodes, density = now.mesh.topology.body_corners, np.zeros(len(now.mesh.points))
    density[nodes] = ((now.active + now.inert) / now.space.reaction.dx)[:, 0]
    return oracles.mass(now.mesh.points, now.mesh.triangles[now.mesh.biomass], density)


def assert_demand_is_spent_or_kept(made, found):
    """A step of the paper's updates keeps it to the error of the trapezoidal rule on what grows and decays at rates up
    to k Y and b: (k Y + b)^2 dt^2 / 12 of it, here with a factor of 3 for the rates' own change (measured: 1.5)."""
    fastest = made.kinetics.maximum_utilization_rate * made.kinetics.yield_coefficient + made.kinetics.decay_coefficient
    for instant in found:
        for each in instant.ledgers:
            assert_demand(made.kinetics, each, (fastest * (each.end - each.start)) ** 2 / 4, 1e-13)


def assert_demand(kinetics, ledger, part, round_off):
    """Of (7)-(10), with COD = F + Y d_c: |F1| + d_c (F3 + F4) = COD |F2| at all concentrations, to a part of the sum of
    its terms, and to what round-off leaves of the difference of two masses."""
    demand = kinetics.acceptor_to_donor_ratio + kinetics.yield_coefficient * kinetics.decay_oxygen_demand
    kept = kinetics.decay_oxygen_demand * ledger.biomass_made
    spent, asked = ledger.consumed[0] + kept, demand * ledger.consumed[1]
    size = ledger.consumed[0] + abs(kept) + asked
    assert abs(spent - asked) <= part * size + round_off * ledger.biomass_before


@share(0.25)
@given(scenes(elements=ANY_ORDER))
def test_of_the_midpoint_rule_it_closes_to_round_off(made):
    """Uptake and growth are one integral over the mean biomass of the step: in each step, whatever the scene."""
    numerics = replace(made.numerics, time="midpoint", transfer="conserving", tolerance=0.05)
    for instant in instants(replace(made, numerics=numerics)):
        for ledger in instant.ledgers:
            assert_demand(made.kinetics, ledger, 2e-10, 4e-16)
            assert ledger.biomass_after == pytest.approx(ledger.biomass_before + ledger.biomass_made, rel=1e-9)


@pytest.mark.parametrize("born", ["stressed", "stress_free"])
def test_area_and_mass_do_not_drift_apart(born):
    """Biomass after a step is that before and what was made, to round-off, through new meshes to a closing film,
    wherever strain counts from: the constraint works off what it has left of J - theta."""
    made = load_scene("wide", ('numerics.preset="fast"', f'growth.new_biomass="{born}"', 'growth.end="33 h"',
                                'output.times=["33 h"]'))
    ledgers = [ledger for instant in simulate(made) for ledger in instant.ledgers]
    apart = [(step.biomass_after - step.biomass_before - step.biomass_made) / step.biomass_after for step in ledgers]
    assert len(apart) > 8 and np.abs(apart).max() < 1e-9


LEAKS = {"acceptor": lambda ledger: {"supplied": (1.01 * ledger.supplied[0], ledger.supplied[1])},
         "donor": lambda ledger: {"out": (ledger.out[0], ledger.out[1] - 0.01 * ledger.supplied[1])},
         "biomass": lambda ledger: {"biomass_after": 1.01 * ledger.biomass_after},
         "oxygen demand": lambda ledger: {"biomass_made": 1.01 * ledger.biomass_made}}


@pytest.mark.parametrize("what", LEAKS)
def test_a_step_that_does_not_balance_ends_the_run_and_keeps_its_files(what, monkeypatch, tmp_path, capsys):
    """Exit status 1, one line that says what, how much, where, when and what to try; rows, fields and the checkpoint of
    what was good stay."""
    made = []

    def leaking(*parts):
        ledger = Ledger(*parts)
        made.append(ledger)
        return replace(ledger, **LEAKS[what](ledger)) if len(made) > 1 else ledger

    monkeypatch.setattr(midpoint, "Ledger", leaking)
    out = pages.run(tmp_path, "base", pages.FAST, "growth.end=3 h", status=1)
    (line,) = [line for line in capsys.readouterr().err.splitlines() if "balance" in line]
    table = read_table(out / "timeseries.csv")
    assert len(table["time_h"]) == len(list((out / "fields").iterdir())) > 1
    assert f"stopped in the step from t = {table['time_h'][-1]:g} h, in its balance: " in line
    assert re.search(rf"x = -\S+ and \S+ um: it lacks (.*, )?-?0\.0\d+ of the {what}.*; try a shorter", line)
    assert shell.told(out)["status"].startswith("failed: ")
    assert "last good state" in line and (out / "checkpoint.state").exists()


@pytest.mark.parametrize("sets, column", [
    (["numerics.inlet=mean"], "acceptor_balance"),
    (["growth.time_step=12 min"], "oxygen_demand_balance"),
    (["numerics.transport=gear"], "oxygen_demand_balance")])
def test_stated_defects_are_shown_and_stop_nothing(sets, column, tmp_path):
    """E4, the paper's updates and Gear's method (E8: tests/test_derived.py): more than what stops a run, told as it is.
    """
    found = list(simulate(load_scene("base", ["numerics.refinement=0.5", 'growth.end="0.4 h"', *sets])))
    told = [abs(row(load_scene("base", sets), instant)[column]) for instant in found[1:]]
    assert max(told) > 1e-6 and (column != "oxygen_demand_balance" or max(told) < 1e-3)


def test_a_slow_flow_is_no_leak():
    """At a Peclet number of 2e-8, just over what is refused, diffusion moves so much more than the flow that round-off
    is more than a millionth of what is supplied."""
    made = load_scene("wide", ["numerics.preset=fast", "numerics.elements=cubic", "numerics.refinement=0.25",
                               "flow.mean_velocity=1e-3 um/h", 'growth.time_step="0.1 h"', 'growth.end="1 h"'])
    found = list(simulate(made))
    assert found[-1].pore.time == 1.0 and 0 < found[-1].ledgers[0].supplied[0] < 1


@example(0.2, 0.0, [])
@example(0.2, 0.5, [])
@example(0.2, 2.5, [0.5, 0.8])
@example(0.2, 97.0, [19.2 / 19.4])
@given(between(1e-3, 1e3), between(0.01, 300.0), st.lists(st.floats(0.0, 1.0), max_size=5))
def test_updates_are_at_multiples_of_the_time_step_and_at_the_end(step, count, parts):
    """Rows are t = 0 and the times asked for, which cut no step; without them every step."""
    end = step * count
    wanted = sorted({part * end for part in parts})
    more = {"output": {"times": [f"{time!r} h" for time in wanted]}} if wanted else {}
    made = scene(velocity="1 m/day", growth={"end": f"{end!r} h", "time_step": f"{step!r} h"}, **more)
    times, reported = updates.schedule(made)
    whole = [round(k * step, 9) for k in range(round(count) + 2)]
    inner = [time for time in whole if time < end - 1e-9 * max(1.0, step)]
    assert times == pytest.approx([*inner, end] if end else [0.0], rel=1e-12, abs=1e-12)
    assert reported == ({0.0, *wanted} if wanted else set(times))


@EVERY_ORDER
@pytest.mark.parametrize("name, k", [("acceptor", 0), ("donor", 1)])
def test_a_balance_of_round_off_is_not_a_defect(order, name, k):
    """Without flow, decay and the other substrate, this one rests at its supply: what seems supplied is round-off,
    within eps of the sum of the sizes of the terms at the supply. The floor is the amount of which that is 1e-6, and
    defects are relative to no less."""
    other = ("acceptor", "donor")[1 - k]
    elements = f"numerics.elements={ORDERS[order]}", f"numerics.refinement={0.5 / order}"
    made = load_scene("base", [*elements, 'pore.length="200 um"', 'growth.end="12 min"',
                               'kinetics.decay_coefficient="0 1/d"', f'substrates.{other}.supply="0 mg/L"'], ["flow"])
    first, last = simulate(made)
    problem, flux = first.solved.problem, first.solved.fluxes[k]
    own = slice(k * problem.space.count, (k + 1) * problem.space.count)
    round_off = np.finfo(float).eps * 10 * np.abs(problem.operator.toarray()[own, own]).sum()
    assert abs(flux.supplied) <= round_off and flux.consumed == 0
    assert balance.floor(problem, k, 10.0) == pytest.approx(round_off / 1e-6, rel=1e-12)
    for instant in (first, last):
        assert abs(row(made, instant)[f"{name}_balance"]) < 1e-6
    leak = replace(flux, supplied=0.5 * round_off / 1e-6, out=0.0)
    fluxes = tuple(leak if j == k else both for j, both in enumerate(first.solved.fluxes))
    leaking = replace(first, solved=replace(first.solved, fluxes=fluxes))
    assert row(made, leaking)[f"{name}_balance"] == pytest.approx(0.5, rel=1e-9)


def test_a_demand_of_round_off_is_not_a_defect():
    """In a closed pore that is exhausted, biomass made is zero or the round-off of the difference of two sums, which
    exact sums bound; 1e-6 of the floor."""
    made = load_scene("base", ["numerics.preset=paper", "numerics.refinement=0.5", "numerics.transport=gear",
                               'pore.length="100 um"', "substrates.boundary=closed", "aggregate.radius=15 um",
                               'growth.end="16 h"', 'growth.time_step="2 h"'], ["flow"])
    found = list(simulate(made))
    (ledger,) = found[-1].ledgers
    assert ledger.consumed[0] < 1e-12 * ledger.biomass_before
    assert abs(row(made, found[-1])["oxygen_demand_balance"]) < 1e-6
    for old, new in pairwise(found):
        before, after = old.pore, new.before[0]
        parts = [*after.active.ravel(), *after.inert.ravel(), *-before.active.ravel(), *-before.inert.ravel()]
        assert abs(after.mass - before.mass - math.fsum(parts)) <= balance.ROUND_OFF * before.mass
    k, floor = made.kinetics, 1e-7 * ledger.biomass_before
    for part in (0.1, 10.0):  # acceptor alone, taken up as by decay, of which nothing comes
        leak = replace(ledger, consumed=(part * floor * k.decay_oxygen_demand, 0.0), biomass_made=0.0)
        assert balance.oxygen_demand(k, leak) == pytest.approx(min(part, 1.0), rel=1e-9)
