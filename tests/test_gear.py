"""The paper's transient scheme (3.3): its order in the step, where it rests, pores without flow, and what it refuses.
Its values and its balances are cases of the stage transport."""
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from repro.errors import TransportError
from repro.march.simulation import simulate
from repro.model import gear, pore, transport
from repro.model.kinetics import Sink
from repro.model.transport import Concentrations
from repro.scene import load_scene
from tests.strategies import ORDERS, scene

SECOND = 1 / 3600

EVERY_ORDER = pytest.mark.parametrize("order", ORDERS)


def coarse(order):
    """The numerics of a coarse mesh."""
    return {"refinement": 0.5 if order == 1 else 0.25, "transport": "gear", "elements": ORDERS[order]}


@cache
def case(radius="20 um", velocity="2.9 m/day", boundary="open", order=1, **sections):
    """(Pore, Problem) on a coarse mesh."""
    substrates = {"boundary": boundary, **sections.get("substrates", {})}
    made = scene(radius, velocity=velocity, numerics=coarse(order),
                 **{**sections, "substrates": {"acceptor": {}, "donor": {}, **substrates}})
    now = pore.seeded(made)
    carried = pore.solve_flow(made, now.space) if made.flow else None
    return now, transport.problem(now.space, carried, made.substrates, made.kinetics)


def storage(problem):
    """(n,) um2 that add up to what is stored: the lumped mass, or the integrals of higher orders' functions."""
    space = problem.space
    if space.order == 1:
        return space.lumped()
    return np.bincount(space.cells.ravel(), space.load(space.at.dx).ravel(), space.count)


@EVERY_ORDER
@pytest.mark.parametrize("before, after", [(10.0, 20.0), (10.0, 5.0), (10.0, 12.0), (10.0, 0.0), (0.0, 10.0)])
def test_profiles_settle_after_a_jump_of_the_supply_at_constrained_ends(before, after, order):
    """The acceptor's, small, large, to nothing and from nothing, while the donor's stays: to Newton's profiles, as
    above."""
    now, problem = case("20 um", None, order=order)
    sink, earlier, later = Sink(now.active), *(supplied(problem, supply) for supply in (before, after))
    start = gear.settle(earlier, sink, None)
    found, steady = gear.settle(later, sink, start), transport.steady(later, sink, start)
    assert found.acceptor == pytest.approx(steady.acceptor, abs=1e-6)
    assert found.donor == pytest.approx(steady.donor, abs=1e-6)


def supplied(problem, acceptor):
    """The same problem with another supply of the acceptor, mg/L."""
    both = problem.substrates
    other = replace(both, acceptor=replace(both.acceptor, supply=acceptor))
    return transport.problem(problem.space, None, other, problem.law.constants)


@EVERY_ORDER
def test_nothing_settles_where_nothing_enters(order):
    now, problem = case(velocity=None, boundary="closed", order=order)
    guess = Concentrations(np.full(problem.space.count, 3.0), np.full(problem.space.count, 4.0))
    assert gear.settle(problem, Sink(now.active), guess) is guess
    assert (gear.settle(problem, Sink(now.active), None).acceptor == 10.0).all()


@pytest.mark.parametrize("fixed_step", [None, 0.05])
def test_a_starved_pore_stays_positive(fixed_step):
    """K_s 1e-4 of the supply: C_A down to 1e-15 mg/L in the aggregate, from C_supply in controlled and in wild steps
    (there BDF2 goes negative).
    """
    now, problem = case.__wrapped__("40 um", "0.1 m/day", substrates={"acceptor": {"half_saturation": "1e-3 mg/L"}})
    done = gear.advance(problem, now.active, now.inert, transport.supplied_everywhere(problem), 0.2,
                        fixed_step=fixed_step)
    assert 0 <= done.concentrations.acceptor.min() < 1e-6 and done.concentrations.donor.min() > 0


@pytest.mark.parametrize("acceptor, donor", [("1000 mg/L", "1 mg/L"), ("1 mg/L", "1000 mg/L")])
def test_each_substrate_is_followed_to_a_thousandth_of_its_own_supply(acceptor, donor):
    """However much there is of the other: against steps controlled ten times as well."""
    now, problem = case.__wrapped__(velocity=None, boundary="closed", substrates={
        "acceptor": {"supply": acceptor}, "donor": {"supply": donor}})
    start = transport.supplied_everywhere(problem)
    found, wanted = (gear.advance(problem, now.active, now.inert, start, 0.005, tolerance=part * gear.TOLERANCE)
                     .concentrations for part in (1.0, 0.1))
    for name in ("acceptor", "donor"):
        supply = getattr(problem.substrates, name).supply
        assert getattr(found, name) == pytest.approx(getattr(wanted, name), abs=1e-3 * supply)


def test_a_row_within_an_update_is_what_an_update_to_there_ends_with():
    """Of still water, whose substrates go on from what is there."""
    still = scene(velocity="0 m/day", growth={"end": "0.3 h"}, numerics=coarse(1), output={"times": ["0.3 h"]})
    within, end = ([*simulate(replace(still, growth=replace(still.growth, end=last)))][1].solved.concentrations
                   for last in (0.4, 0.3))
    assert np.array_equal([within.acceptor, within.donor], [end.acceptor, end.donor])


def test_what_cannot_be_followed_is_said_with_its_place():
    now, problem = case()
    said = r"(acceptor|donor) does not follow .* at x = \S+, y = \S+ um .* after the start.*try"
    with pytest.raises(TransportError, match=said):
        gear.advance(problem, now.active, now.inert, transport.supplied_everywhere(problem), 0.2, tolerance=1e-30)


def test_a_time_shorter_than_the_shortest_step_is_one_step():
    now, problem = case()
    settled = gear.settle(problem, Sink(now.active), None)
    assert len(gear.advance(problem, now.active, now.inert, settled, 0.1 * gear.SHORTEST).steps) == 1


def test_what_becomes_negative_is_said():
    """A drain that takes the acceptor whatever is left of it: 3e-4 of the supply too much, less than TOLERANCE, is
    refused.
    """
    now, problem = case(velocity=None, boundary="closed")
    drained = replace(problem, source=np.concatenate([-1e6 * storage(problem), np.zeros(problem.space.count)]))
    start, nothing = transport.supplied_everywhere(problem), np.zeros_like(now.active)
    nearly = gear.advance(drained, nothing, nothing, start, 9.9e-6)
    assert nearly.concentrations.acceptor == pytest.approx(np.full(problem.space.count, 0.1))
    with pytest.raises(TransportError, match=r"the acceptor becomes negative at x = .* after the start"):
        gear.advance(drained, nothing, nothing, start, 10.003e-6)


@EVERY_ORDER
def test_only_the_aggregate_controls_the_step(order):
    """3.3.2: what happens 75 um upstream within 0.01 s, exp(-75 / 5) of it in the aggregate, needs no shorter step."""
    now, problem = case(order=order)
    settled = gear.settle(problem, Sink(now.active), None)
    settled.acceptor[now.space.end_nodes(now.space.dofs.inlet)] = 0.0
    assert len(gear.advance(problem, now.active, now.inert, settled, 0.01 * SECOND).steps) == 1


@pytest.mark.parametrize("preset", ["fast", "accurate", "paper"])
@pytest.mark.parametrize("method", ["quasi_steady", "gear"])
def test_without_flow_the_ends_of_the_pore_hold_the_supply(preset, method):
    """Beside the aggregate diffusion is one-dimensional: C falls evenly from the end of the pore, 300 um away, where
    half of what is taken up comes in. 1.5 W away the profile across has faded to exp(-1.5 pi) of a drop of 1 mg/L."""
    said = load_scene("base", ["aggregate.radius=20 um", "growth.end=0.2 h", f"numerics.preset={preset}",
                               "numerics.time=updates", f"numerics.transport={method}"], ["flow"])
    first = next(simulate(said))
    state, space = first.solved.concentrations, first.pore.space
    x = np.abs(space.points[:, 0])
    far = x >= 95
    assert first.pore.mesh.ends == (-300, 300) and far.sum() > 20
    for field, flux, kind in zip((state.acceptor, state.donor), first.solved.fluxes, first.solved.problem.both):
        fall = flux.consumed / 2 / (kind.diffusivity * said.pore.width)
        assert field[far] == pytest.approx(kind.supply - fall * (300 - x[far]), abs=np.exp(-1.5 * np.pi))
        assert fall * 200 > 1


@pytest.mark.parametrize("step", ["10 min", "2.5 min"])
def test_what_biomass_lacks_where_a_substrate_runs_out_is_accepted(step):
    """The scheme follows the donor to a thousandth of its supply, which is three times its half saturation: near
    nothing, m errs by three thousandths. No shorter step changes that."""
    changes = ["pore.width=80 um", "pore.length=730 um", "aggregate.radius=8.1 um", "substrates.boundary=closed",
               "substrates.acceptor.supply=1.753 mg/L", "substrates.acceptor.half_saturation=0.494 mg/L",
               "substrates.donor.supply=0.3695 mg/L", "substrates.donor.half_saturation=0.121 mg/L",
               "kinetics.maximum_utilization_rate=12 1/day", "kinetics.maximum_density=1.009e4 mg/L",
               "numerics.preset=fast", "numerics.time=updates", "numerics.transport=gear",
               f"growth.time_step={step}", 'growth.end="0.34 h"']
    *_, last = simulate(load_scene("base", changes, ["flow"]))
    assert last.pore.time == 0.34 and last.solved.concentrations.donor.max() < 0.01


@pytest.mark.parametrize("changes, unset", [
    (['substrates.acceptor.supply=[["0 h", "10 mg/L"], ["0.4 h", "0 mg/L"]]', 'growth.end="1.4 h"'], ()),
    (["aggregate.radius=20 um", "substrates.boundary=closed", "pore.length=200 um", "numerics.extent=full",
      'growth.end="9.2 h"'], ["flow"])])
def test_a_substrate_may_be_used_up_to_nothing(changes, unset):
    """Supplied no more, or shut in with an aggregate that takes it, the acceptor falls until it underflows, and the run
    goes on: no biomass is made any more, and the donor is left."""
    starved = load_scene("base", ["numerics.preset=paper", "numerics.transport=gear", "numerics.refinement=0.4",
                                  *changes], unset)
    *_, before, last = simulate(starved)
    left = last.solved.concentrations
    assert 0 <= left.acceptor.min() and left.acceptor.max() < np.finfo(float).tiny and left.donor.min() > 1
    assert last.pore.time == starved.growth.end and last.pore.mass == pytest.approx(before.pore.mass, rel=1e-13)
