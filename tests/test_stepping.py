"""Steps of the midpoint rule: where they end, which are taken, and what depends on rows and ends.

That they are of second order is the case coupling-midpoint-order; that their ledgers close is in `test_balances.py`,
how long they are in `test_pace.py`, and that contact ends one the case hard-07-contact.
"""
import json
from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from repro.errors import GrowthError, SimulationError, Unresolved
from repro.fem.sizing import ACROSS_PORE
from repro.march import midpoint, pace, simulation, stepping
from repro.march.loop import PoreEnd
from repro.march.midpoint import Attempt
from repro.model import pore
from repro.scene import load_scene
from tests.strategies import ORDERS, scene
from tests.test_state import alike

FAST = 'numerics.preset="fast"'
THOROUGH = partial(pytest.param, marks=pytest.mark.thorough)


def base(*changes):
    return load_scene("base", (FAST, 'aggregate.radius="25 um"', *changes))


def sets(order):
    """Elements of an order, of the size of preset fast."""
    return (f"numerics.elements={ORDERS[order]}", f"numerics.refinement={0.4 if order == 1 else 0.2}")


@pytest.mark.parametrize("end, apart", [
    (0.001, 0.2 / 2**13), (0.01, 0.2 / 2**9), (1.0, 0.025), (4.79, 0.1), (4.8, 0.2), (19.4, 0.8), (45.0, 1.6)])
def test_without_times_there_are_25_rows_at_round_times_in_a_run_of_any_length(end, apart):
    """And the last one is at the end."""
    rows = stepping.rows(base(f'growth.end="{end} h"'))
    assert 24 <= len(rows) <= 49 and rows[-1] == end and rows[0] == pytest.approx(apart, abs=1e-9)
    assert np.diff(rows[:-1]) == pytest.approx(apart, abs=2e-9) and 0 < rows[-1] - rows[-2] <= apart * 1.0001


#: A run through contact and new meshes, and rows on both sides of them.
CONTACT = ('aggregate.radius="17.8 um"', 'pore.width="20 um"', 'flow.head="1 mm"', "numerics.tolerance=0.001")
SCENES = {"fast": (FAST, 'growth.end="9.7 h"'), "contact": (FAST, 'growth.end="0.6 h"', *CONTACT),
          "paper": ('growth.end="0.8 h"', *CONTACT), "gear": ('growth.end="0.7 h"', 'numerics.transport="gear"'),
          "stress-free": (FAST, 'growth.end="0.6 h"', 'growth.new_biomass="stress_free"', *CONTACT)}


def steps_of(name, *changes):
    """The last state, the instants, and the ledgers of all steps of a scene, reported or not."""
    made = load_scene("base", (*SCENES[name], *changes))
    found = list(simulation.steps(made))
    rows = [instant for _, instant in found if instant]
    last = found[-1][0]
    return last, rows, [*(row for instant in rows for row in instant.ledgers), *last.ledgers]


def same(one, other):
    """Are two states the same to the last bit, rows aside?"""
    return alike(one.pore, other.pore) and one.pace == other.pace


@pytest.mark.parametrize("name", ["fast", "paper", *map(THOROUGH, ("contact", "gear", "stress-free"))])
def test_steps_depend_on_no_row(name):
    """The last state and the ledger of every step, to the last bit, with 1 and 7 rows, and without times, where the end
    of every step is a row."""
    last, rows, ledgers = steps_of(name)
    for count in (1, 7):
        times = np.linspace(0, last.pore.time, count + 1)[1:].tolist()
        other, found, its = steps_of(name, f"output.times={json.dumps([f'{time!r} h' for time in times])}")
        assert len(found) == count + 1 and its == ledgers
        assert same(other, last)
    assert len(ledgers) > 1 and {row.end for row in ledgers} <= {instant.pore.time for instant in rows}
    if CONTACT[0] in SCENES[name]:
        assert not rows[0].pore.contact and rows[-1].pore.contact and sum(instant.remeshes for instant in rows) > 1


@pytest.mark.parametrize("part", [0.55, THOROUGH(0.97)])
@pytest.mark.parametrize("name", ["fast", "gear", *map(THOROUGH, ("contact", "paper", "stress-free"))])
def test_steps_and_rows_before_the_end_do_not_depend_on_it(name, part):
    """All states and rows of a run that ends earlier are those of the longer run, to the last bit, but for the last
    state and the row that it ends with, whose step ends there."""
    whole = load_scene("base", SCENES[name]).growth.end
    end = part * whole
    times = [0.0, *(np.linspace(0.1, 0.98, 9) * end).tolist()]
    (states, rows), (longer, more) = (until(name, last, times) for last in (end, whole))
    assert [one.pore.time for one in rows[:-1]] == [one.pore.time for one in more[:-1]] == times
    for one, other in zip(rows[:-1], more[:-1]):
        assert alike(one.pore, other.pore)
        assert one.solved.flow.conductivity == other.solved.flow.conductivity
        assert [(row.end, row.out) for row in one.ledgers] == [(row.end, row.out) for row in other.ledgers]
    assert states[-1].pore.time == end and len(states) > 1
    assert all(map(same, states[:-1], longer))


def until(name, end, times):
    """States at the ends of steps, and the instants, of a scene that ends at ``end`` with rows there and at times."""
    asked = json.dumps([f"{time!r} h" for time in (*times[1:], end)])
    made = load_scene("base", (*SCENES[name], f'growth.end="{end!r} h"', f"output.times={asked}"))
    found = list(simulation.steps(made))
    states = {state.pore.time: state for state, _ in found}
    return list(states.values()), [instant for _, instant in found if instant]


def test_rows_within_steps_are_of_second_order():
    """0.37 of the way through a step biomass, area, tip and effluent are those of a step that ends there but for a part
    that goes as the cube of the step, the local error of both."""
    made = base()
    now = pore.seeded(made)
    solved = pore.solve(made, now)
    now = replace(now, concentrations=solved.concentrations)
    apart = []
    for hours in (1.0, 0.5, 0.25):
        row = midpoint.attempt(made, now, solved, hours).step.within(0.37 * hours)
        there = midpoint.attempt(made, now, solved, 0.37 * hours).step.pore
        apart.append(numbers(row.pore, row.solved) - numbers(there, pore.solve(made, there)))
    assert np.abs(np.log2(np.divide(apart[:-1], apart[1:])) - 3).max() < 0.35


def numbers(now, solved):
    """Biomass, area, upstream tip, effluent of the acceptor."""
    return np.array([now.mass, now.outline.area, now.outline.upstream, solved.fluxes[0].effluent])


def test_a_step_that_fails_is_halved_until_it_is_done(monkeypatch):
    """0.2 h fails down to 0.02 h: 0.1, 0.05, 0.025 h are tried in turn."""
    made, tried = base(), []
    now = pore.seeded(made)

    def attempt(_, __, ___, duration, *____):
        tried.append(duration)
        if duration > 0.02:
            raise GrowthError("too long")
        return Attempt(stepping.Step(now, None, None, False, 0), 1e-9, None)

    monkeypatch.setattr(midpoint, "attempt", attempt)
    taken, _, after = stepping._advance(made, now, None, pace.Pace(0.2))
    assert tried == [0.2, 0.1, 0.05, 0.025, 0.0125]
    assert taken.pore.time == 0.0125 and after.length == pytest.approx(pace.FASTER * 0.0125)


def test_contact_is_met_within_a_thousandth_of_the_film(monkeypatch):
    """2 um: an even thinning from 4 to 1 um is met in between, and a step is told to end there."""
    assert 1.998 < 4 - 3 * stepping._to_contact(4.0, 1.0, 2.0) < 2
    searches, attempt = [], midpoint.attempt

    def seen(*arguments):
        searches.extend(arguments[5:])
        return attempt(*arguments)

    monkeypatch.setattr(midpoint, "attempt", seen)
    made = base('growth.end="1 h"')
    for _ in simulation.simulate(made):
        pass
    assert {search.landing for search in searches} == {0.999}


@pytest.mark.parametrize("error, told", [(GrowthError("no way"), "in growth: no way"),
                                         (FloatingPointError("overflow"), "floating-point error .overflow.")])
def test_what_fails_at_the_shortest_step_stops_the_run(monkeypatch, error, told):
    """With the time of the step; not before growth.time_step / 1000 has failed."""
    tried, attempt = [], midpoint.attempt

    def fails_later(made, now, solved, duration, *others):
        if now.time == 0:
            return attempt(made, now, solved, duration, *others)
        tried.append(duration)
        raise error

    monkeypatch.setattr(midpoint, "attempt", fails_later)
    with pytest.raises(SimulationError, match=rf"stopped in the step from t = 0.4 h.*{told}"):
        list(simulation.simulate(base('growth.end="1 h"', 'growth.time_step="0.05 h"')))
    assert 2.5e-5 < tried[-1] <= 5e-5 and len(tried) < 20  # to the end, then 2 h 2^-16


@pytest.mark.parametrize("order", [1, 2, THOROUGH(3)])
def test_a_run_ends_where_the_aggregate_reaches_an_end_of_the_pore(order):
    """The last instant is reported, then PoreEnd."""
    made = base('pore.length="90 um"', 'growth.end="19 h"', *sets(order))
    found = []
    with pytest.raises(PoreEnd, match="reaches the pore's upstream end"):
        for instant in simulation.simulate(made):
            found += [instant] if instant.ledgers else []
    near = made.pore.width / ACROSS_PORE
    assert 0.1 * near - 45 <= found[-1].pore.outline.upstream < near - 45 <= found[-2].pore.outline.upstream


@pytest.mark.parametrize("order", [1, 2, THOROUGH(3)])
def test_a_film_too_thin_from_the_start_closes(order):
    """Though nothing grows: without a supply the aggregate neither grows nor decays."""
    numerics = {"preset": "fast", "elements": ORDERS[order], "refinement": 0.6 if order == 1 else 0.2}
    first, *_, last = simulation.simulate(scene("18.5 um", "20 um", "0 mg/L", "0 mg/L", velocity="2.9 m/day",
                                                growth={"end": "0.1 h"}, numerics=numerics))
    assert last.pore.contact and last.pore.mass == pytest.approx(first.pore.mass, rel=1e-9)


@pytest.mark.parametrize("end, step", [("0 h", "12 min"), ("1e-9 h", "12 min"), ("1e-8 h", "100 h"), ("1 h", "1000 h"),
                                       ("3e-7 h", "1e-6 h")])
def test_rows_of_runs_shorter_than_times_are_told_apart_do_not_coincide(end, step):
    made = base(f'growth.end="{end}"', f'growth.time_step="{step}"')
    rows = stepping.rows(made)
    assert bool(rows) == (made.growth.end > 1e-9) and all(np.diff((0.0, *rows)) >= 0.99e-9)


@pytest.mark.parametrize("needed, told", [(2.0, ""), (np.inf, "numerics.refinement")])
def test_the_step_to_the_end_is_made_on_finer_elements_where_a_front_needs_them(needed, told, monkeypatch):
    """Half way in the step that growth.end cuts, as in any other; where no elements do, the refusal has advice."""
    attempt = midpoint.attempt

    def cut(scene, now, solved, duration, *most):
        if duration == 0.3 and now.front < needed:
            raise Unresolved("the mesh is too coarse")
        return attempt(scene, now, solved, duration, *most)

    monkeypatch.setattr(midpoint, "attempt", cut)
    made = simulation.simulate(base('growth.end="0.3 h"'))
    if told:
        with pytest.raises(SimulationError, match=told):
            list(made)
    else:
        assert [instant.pore.front for instant in made][-1] == needed
