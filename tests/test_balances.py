"""Round-off in balances is no defect, and biomass and area do not drift apart.

Every run refuses a step that does not balance (`test_guards.py`). The cases coupling-ledger and hard-family sum the
balances independently, and `test_derived.py` the uptake of a state.
"""
import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from repro.march import balance
from repro.march.simulation import simulate
from repro.results import row
from tests.strategies import EVERY_ORDER, ORDERS
from verification.problems.schemes import exchange, load_scene


@pytest.mark.parametrize("born", ["stressed", "stress_free"])
def test_area_and_mass_do_not_drift_apart(born):
    """Biomass after a step equals biomass before it plus production, to round-off, because each step's constraint
    corrects the remaining J - theta. This holds through new meshes up to a closing film, for both references of
    strain."""
    scene = load_scene("wide", ('numerics.preset="fast"', f'growth.new_biomass="{born}"', 'growth.end="33 h"',
                                'output.times=["33 h"]'))
    ledgers = [ledger for instant in simulate(scene) for ledger in instant.ledgers]
    apart = [(step.biomass_after - step.biomass_before - step.biomass_made) / step.biomass_after for step in ledgers]
    assert len(apart) > 8 and np.abs(apart).max() < 1e-9


def test_a_slow_flow_is_no_leak():
    """At a Peclet number of 2e-8, just above the accepted minimum, diffusion moves so much more than the flow that
    round-off exceeds a millionth of the supply."""
    scene = load_scene("wide", ["numerics.preset=fast", "numerics.refinement=0.25",
                               "flow.mean_velocity=1e-3 um/h", 'growth.time_step="0.1 h"', 'growth.end="1 h"',
                               'output.times=["1 h"]'])
    instants = list(simulate(scene))
    assert instants[-1].pore.time == 1.0 and 0 < instants[-1].ledgers[0].supplied[0] < 1


@EVERY_ORDER
@pytest.mark.parametrize("name, k", [("acceptor", 0), ("donor", 1)])
def test_a_balance_of_round_off_is_not_a_defect(order, name, k):
    """Without flow, decay and the other substrate, this one rests at its supply. The computed supply is round-off, less
    than eps times the sum of the magnitudes of the terms. Defects are relative to at least the floor, of which this
    round-off is 1e-6."""
    other = ("acceptor", "donor")[1 - k]
    elements = exchange(elements=ORDERS[order]), f"numerics.refinement={0.5 / order}"
    scene = load_scene("base", [*elements, 'pore.length="200 um"', 'growth.end="12 min"',
                               'kinetics.decay_coefficient="0 1/d"', f'substrates.{other}.supply="0 mg/L"'],
                       unset=["flow"])
    first, last = simulate(scene)
    problem, flux = first.solved.problem, first.solved.fluxes[k]
    block = slice(k * problem.space.count, (k + 1) * problem.space.count)
    round_off = np.finfo(float).eps * 10 * np.abs(problem.operator.toarray()[block, block]).sum()
    assert abs(flux.supplied) <= round_off and flux.consumed == 0
    assert balance.floor(problem, k, 10.0) == pytest.approx(round_off / 1e-6, rel=1e-12)
    for instant in (first, last):
        assert abs(row(scene, instant)[f"{name}_balance"]) < 1e-6
    leak = replace(flux, supplied=0.5 * round_off / 1e-6, out=0.0)
    fluxes = list(first.solved.fluxes)
    fluxes[k] = leak
    leaking = replace(first, solved=replace(first.solved, fluxes=tuple(fluxes)))
    assert row(scene, leaking)[f"{name}_balance"] == pytest.approx(0.5, rel=1e-9)


def test_a_demand_of_round_off_is_not_a_defect():
    """In an exhausted closed pore the production of biomass is zero or the round-off of a difference of two sums. Exact
    sums bound it by 1e-6 of the floor."""
    scene = load_scene("base", ["numerics.preset=paper", "numerics.refinement=0.5", "numerics.transport=gear",
                               'pore.length="100 um"', "substrates.boundary=closed", "aggregate.radius=15 um",
                               'growth.end="16 h"', 'growth.time_step="2 h"'], unset=["flow"])
    instants = list(simulate(scene))
    (ledger,) = instants[-1].ledgers
    assert ledger.consumed[0] < 1e-12 * ledger.biomass_before
    assert abs(row(scene, instants[-1])["oxygen_demand_balance"]) < 1e-6
    for old, new in pairwise(instants):
        before, after = old.pore, new.before[0]
        parts = [*after.active.ravel(), *after.inert.ravel(), *-before.active.ravel(), *-before.inert.ravel()]
        assert abs(after.mass - before.mass - math.fsum(parts)) <= balance.ROUND_OFF * before.mass
    k, floor = scene.kinetics, 1e-7 * ledger.biomass_before
    for part in (0.1, 10.0):  # uptake of the acceptor as if by decay, with no biomass lost
        leak = replace(ledger, consumed=(part * floor * k.decay_oxygen_demand, 0.0), biomass_made=0.0)
        assert balance.oxygen_demand(k, leak) == pytest.approx(min(part, 1.0), rel=1e-9)
