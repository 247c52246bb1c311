"""The paper's transient scheme (3.3): its steps, its steady states, pores without flow, and refusals. The cases of the
stage transport cover its values and balances."""
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from repro.errors import TransportError
from repro.march.simulation import simulate
from repro.model import gear, transport
from repro.model.kinetics import Sink
from repro.model.meshing import seeded
from repro.model.solving import Solver
from repro.model.transport import Concentrations
from tests import strategies
from tests.strategies import EVERY_ORDER
from verification.problems.schemes import exchange, load_scene

SECOND = 1 / 3600


def coarse(order):
    """Return the numerics of a coarse mesh."""
    return {"refinement": 0.5 if order == 1 else 0.25, "transport": "gear"}


@cache
def case(radius="20 um", velocity="2.9 m/day", boundary="open", order=1, **sections):
    """(Pore, Problem) on a coarse mesh."""
    substrates = {"boundary": boundary, **sections.get("substrates", {})}
    scene = strategies.scene(radius, velocity=velocity, numerics=coarse(order), order=order,
                             **{**sections, "substrates": {"acceptor": {}, "donor": {}, **substrates}})
    pore = seeded(scene)
    carried = Solver.of(scene).solve_flow(pore.space, scene.flow) if scene.flow else None
    return pore, transport.problem(pore.space, carried, scene.substrates, scene.kinetics, scene.numerics.scheme)


def storage(problem):
    """(n,) areas (um2) of the nodes: the lumped mass, or the integrals of quadratic functions."""
    space = problem.space
    if space.order == 1:
        return space.lumped()
    return space.at.assembled(space.at.dx)


@EVERY_ORDER
@pytest.mark.parametrize("before, after", [(10.0, 20.0), (10.0, 5.0), (10.0, 12.0), (10.0, 0.0), (0.0, 10.0)])
def test_profiles_settle_after_a_jump_of_the_supply_at_constrained_ends(before, after, order):
    """The acceptor's supply makes a small or large jump, to zero or from zero, and the donor's is constant. The
    profiles are those of Newton's method."""
    pore, problem = case("20 um", None, order=order)
    sink = Sink(pore.active)
    earlier, later = (supplied(problem, supply) for supply in (before, after))
    start = gear.settle(earlier, sink, None)
    computed, steady = gear.settle(later, sink, start), transport.steady(later, sink, start)
    assert computed.acceptor == pytest.approx(steady.acceptor, abs=1e-6)
    assert computed.donor == pytest.approx(steady.donor, abs=1e-6)


def supplied(problem, acceptor):
    """Return the same problem with another supply of the acceptor (mg/L)."""
    substrates = problem.substrates
    other = replace(substrates, acceptor=replace(substrates.acceptor, supply=acceptor))
    return transport.problem(problem.space, None, other, problem.law.constants, problem.scheme)


@EVERY_ORDER
def test_a_closed_pore_does_not_settle(order):
    pore, problem = case(velocity=None, boundary="closed", order=order)
    guess = Concentrations(np.full(problem.space.count, 3.0), np.full(problem.space.count, 4.0))
    assert gear.settle(problem, Sink(pore.active), guess) is guess
    assert (gear.settle(problem, Sink(pore.active), None).acceptor == 10.0).all()


@pytest.mark.parametrize("acceptor, donor", [
    ("1000 mg/L", "1 mg/L"), pytest.param("1 mg/L", "1000 mg/L", marks=pytest.mark.thorough)])
def test_each_substrate_is_accurate_to_a_thousandth_of_its_own_supply(acceptor, donor):
    """This holds for any ratio of the supplies. The reference has a tolerance ten times smaller."""
    pore, problem = case.__wrapped__(velocity=None, boundary="closed", substrates={
        "acceptor": {"supply": acceptor}, "donor": {"supply": donor}})
    start = transport.supplied_everywhere(problem)
    computed, reference = (gear.advance(problem, pore.active, pore.inert, start, 0.005, tolerance=part * gear.TOLERANCE)
                     .concentrations for part in (1.0, 0.1))
    for name in ("acceptor", "donor"):
        supply = getattr(problem.substrates, name).supply
        assert getattr(computed, name) == pytest.approx(getattr(reference, name), abs=1e-3 * supply)


def test_a_row_within_an_update_equals_the_end_of_a_shorter_update():
    """The water is still, so the substrates continue from the previous state."""
    still = strategies.scene(velocity="0 m/day", growth={"end": "0.3 h"}, numerics=coarse(1),
                             output={"times": ["0.3 h"]})
    within, end = ([*simulate(replace(still, growth=replace(still.growth, end=last)))][1].solved.concentrations
                   for last in (0.4, 0.3))
    assert np.array_equal([within.acceptor, within.donor], [end.acceptor, end.donor])


def test_an_unreachable_tolerance_is_refused_with_its_position():
    pore, problem = case()
    pattern = r"(acceptor|donor) does not follow .* at x = \S+, y = \S+ um .* after the start.*try"
    with pytest.raises(TransportError, match=pattern):
        gear.advance(problem, pore.active, pore.inert, transport.supplied_everywhere(problem), 0.2, tolerance=1e-30)


def test_a_time_shorter_than_the_shortest_step_is_one_step():
    pore, problem = case()
    steady = gear.settle(problem, Sink(pore.active), None)
    assert len(gear.advance(problem, pore.active, pore.inert, steady, 0.1 * gear.SHORTEST).steps) == 1


@EVERY_ORDER
def test_only_the_aggregate_controls_the_step(order):
    """3.3.2: a change 75 um upstream within 0.01 s, of which exp(-75 / 5) reaches the aggregate, needs no shorter step.
    """
    pore, problem = case(order=order)
    steady = gear.settle(problem, Sink(pore.active), None)
    steady.acceptor[pore.space.inlet.nodes] = 0.0
    assert len(gear.advance(problem, pore.active, pore.inert, steady, 0.01 * SECOND).steps) == 1


@pytest.mark.parametrize("preset", ["fast", "accurate", "paper"])
@pytest.mark.parametrize("method", ["quasi_steady", "gear"])
def test_without_flow_the_ends_of_the_pore_hold_the_supply(preset, method):
    """Far from the aggregate diffusion is one-dimensional: C falls linearly from the end of the pore, at 300 um, where
    half of the uptake enters. At 1.5 W the transverse profile has decayed to exp(-1.5 pi) of a drop of 1 mg/L."""
    scene = load_scene("base", ["aggregate.radius=20 um", "growth.end=0.2 h", f"numerics.preset={preset}",
                               exchange(steps="updates"), f"numerics.transport={method}"], unset=["flow"])
    first = next(simulate(scene))
    state, space = first.solved.concentrations, first.pore.space
    x = np.abs(space.points[:, 0])
    far = x >= 95
    assert first.pore.mesh.ends == pytest.approx((-300, 300)) and far.sum() > 20
    for field, flux, kind in zip((state.acceptor, state.donor), first.solved.fluxes, first.solved.problem.kinds):
        fall = flux.consumed / 2 / (kind.diffusivity * scene.pore.width)
        assert field[far] == pytest.approx(kind.supply - fall * (300 - x[far]), abs=np.exp(-1.5 * np.pi))
        assert fall * 200 > 1


@pytest.mark.parametrize("step", ["10 min", pytest.param("2.5 min", marks=pytest.mark.thorough)])
def test_the_defect_of_biomass_at_an_exhausted_substrate_is_accepted(step):
    """The scheme follows the donor to a thousandth of its supply, which is three times its half saturation. Near zero
    the error of m is therefore three thousandths, with any step."""
    changes = ["pore.width=80 um", "pore.length=730 um", "aggregate.radius=8.1 um", "substrates.boundary=closed",
               "substrates.acceptor.supply=1.753 mg/L", "substrates.acceptor.half_saturation=0.494 mg/L",
               "substrates.donor.supply=0.3695 mg/L", "substrates.donor.half_saturation=0.121 mg/L",
               "kinetics.maximum_utilization_rate=12 1/day", "kinetics.maximum_density=1.009e4 mg/L",
               "numerics.preset=fast", exchange(steps="updates"), "numerics.transport=gear",
               f"growth.time_step={step}", 'growth.end="0.34 h"']
    *_, last = simulate(load_scene("base", changes, unset=["flow"]))
    assert last.pore.time == 0.34 and last.solved.concentrations.donor.max() < 0.01


@pytest.mark.parametrize("changes, unset", [
    (['substrates.acceptor.supply=[["0 h", "10 mg/L"], ["0.4 h", "0 mg/L"]]', 'growth.end="1.4 h"'], ()),
    pytest.param(["aggregate.radius=20 um", "substrates.boundary=closed", "pore.length=200 um", "numerics.extent=full",
                  'growth.end="9.2 h"'], ["flow"], marks=pytest.mark.thorough)])
def test_a_substrate_may_be_used_up_to_nothing(changes, unset):
    """Without supply, or in a closed pore with an aggregate, the acceptor falls until it underflows. The run continues,
    biomass no longer grows, and the donor remains."""
    starved = load_scene("base", ["numerics.preset=paper", "numerics.transport=gear", "numerics.refinement=0.4",
                                  *changes], unset=unset)
    *_, before, last = simulate(starved)
    left = last.solved.concentrations
    assert 0 <= left.acceptor.min() and left.acceptor.max() < np.finfo(float).tiny and left.donor.min() > 1
    assert last.pore.time == starved.growth.end and last.pore.mass == pytest.approx(before.pore.mass, rel=1e-13)


@EVERY_ORDER
@pytest.mark.parametrize("species", [0, 1])
def test_uptake_where_a_substrate_is_negative_has_the_slope_of_its_law(species, order):
    """The secant, uptake over concentration, is that of positive concentrations alone, and overflows elsewhere."""
    pore, problem = case.__wrapped__(order=order, kinetics={"maximum_utilization_rate": "500 1/day"})
    system = gear.System(problem, pore.active, None, None, living=False)
    fields = np.full((2, pore.space.count), 10.0)
    fields[species] = -10.0
    try:
        with np.errstate(all="raise"):
            secant, slope = (gear._sink(system, pore.active, fields, species, positive)[0]
                             for positive in (True, False))
    except FloatingPointError as error:
        pytest.fail(str(error))
    assert np.array_equal(secant, slope) and secant.max() > 0


@pytest.mark.parametrize("order, accepted, least, refused", [
    (1, 9.9e-6, 0.1, 10.003e-6), (2, 10.005e-6, -5e-3, 10.05e-6)], ids="12")
def test_gears_method_bounds_undershoots_by_each_substrates_supply(order, accepted, least, refused):
    """A drain consumes 1e6 mg/L/h of the acceptor, of which there are 10 mg/L. Linear elements refuse an excess of 3e-4
    of this supply, below TOLERANCE; quadratic ones accept 5e-4 and refuse 5e-3. The donor has 1000 mg/L."""
    pore, problem = case.__wrapped__(velocity=None, boundary="closed", order=order,
                                    substrates={"donor": {"supply": "1000 mg/L"}})
    drained = replace(problem, source=np.concatenate([-1e6 * storage(problem), np.zeros(problem.space.count)]))
    nothing = np.zeros_like(pore.active)
    start = transport.supplied_everywhere(problem)
    consumed = gear.advance(drained, nothing, nothing, start, accepted).concentrations.acceptor
    assert [consumed.min(), consumed.max()] == pytest.approx([least, least], rel=1e-6)
    with pytest.raises(TransportError, match=r"the acceptor becomes negative at x = .* after the start"):
        gear.advance(drained, nothing, nothing, start, refused)
