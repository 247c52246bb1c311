"""Steps of the midpoint rule: where they end, which are taken, and what depends on rows and ends.

That they are of second order is the case coupling-midpoint-order; that their ledgers close is in `test_balances.py`,
that the end changes none of them in `test_longer.py`.
"""
import json
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from repro.errors import GrowthError, SimulationError
from repro.fem.sizing import ACROSS_PORE
from repro.march import midpoint, pace, simulation, stepping
from repro.march.loop import PoreEnd
from repro.march.midpoint import Attempt
from repro.march.updates import rates_of
from repro.model import pore, remeshing
from repro.scene import load_scene
from tests.strategies import ORDERS, scene
from tests.test_state import alike

FAST = 'numerics.preset="fast"'
EVERY_ORDER = pytest.mark.parametrize("order", ORDERS)


def base(*changes):
    return load_scene("base", (FAST, 'aggregate.radius="25 um"', *changes))


def run(made):
    """All instants of a scene."""
    return list(simulation.simulate(made))


def narrow(order, radius, end, **supplies):
    """An aggregate in a pore of 20 um: with a radius of 17.9 um it is 0.1 um short of the film that closes."""
    numerics = {"preset": "fast", "elements": ORDERS[order], "refinement": 0.6 if order == 1 else 0.2}
    return scene(radius, "20 um", velocity="2.9 m/day", growth={"end": end}, numerics=numerics, **supplies)


def sets(order):
    """Elements of an order, of the size of preset fast."""
    return (f"numerics.elements={ORDERS[order]}", f"numerics.refinement={0.4 if order == 1 else 0.2}")


@pytest.fixture
def attempts(monkeypatch):
    """(duration, Attempt) of everything that is tried."""
    tried, attempt = [], midpoint.attempt

    def told(made, now, solved, duration, most=np.inf):
        found = attempt(made, now, solved, duration, most)
        tried.append((duration, found))
        return found

    monkeypatch.setattr(midpoint, "attempt", told)
    return tried


@EVERY_ORDER
def test_rows_are_at_the_reported_times_to_the_last_bit(order):
    """Rows are t = 0 and the times asked for, and nothing else; the ledgers of all steps that ended are in them."""
    made = base('growth.end="0.9 h"', 'output.times=["0.37 h", "0.5 h", "0.8 h"]', *sets(order),
                "numerics.tolerance=0.0001", "numerics.refinement=0.3")
    found = run(made)
    assert [instant.pore.time for instant in found] == [0.0, 0.37, 0.5, 0.8]
    rows = [row for instant in found for row in instant.ledgers]
    assert len(rows) > 3 and rows[0].start == 0.0 and 0.5 < rows[-1].end <= 0.8
    for one, two in pairwise(rows):
        assert two.start == pytest.approx(one.end, abs=1e-12)
        assert two.biomass_before == pytest.approx(one.biomass_after, rel=1e-12)
    for instant in found:
        assert max((row.end for row in instant.ledgers), default=0.0) <= instant.pore.time


@pytest.mark.parametrize("end, apart", [
    (0.001, 0.2 / 2**13), (0.01, 0.2 / 2**9), (1.0, 0.025), (4.79, 0.1), (4.8, 0.2), (19.4, 0.8), (45.0, 1.6)])
def test_without_times_there_are_25_rows_at_round_times_in_a_run_of_any_length(end, apart):
    """And the last one is at the end."""
    rows = stepping.rows(base(f'growth.end="{end} h"'))
    assert 24 <= len(rows) <= 49 and rows[-1] == end and rows[0] == pytest.approx(apart, abs=1e-9)
    assert np.diff(rows[:-1]) == pytest.approx(apart, abs=2e-9) and 0 < rows[-1] - rows[-2] <= apart * 1.0001


@pytest.mark.parametrize("end, step", [("0 h", "12 min"), ("1e-9 h", "12 min"), ("1e-8 h", "100 h"), ("1 h", "1000 h"),
                                       ("3e-7 h", "1e-6 h")])
def test_rows_of_runs_shorter_than_times_are_told_apart_do_not_coincide(end, step):
    made = base(f'growth.end="{end}"', f'growth.time_step="{step}"')
    rows = stepping.rows(made)
    assert bool(rows) == (made.growth.end > 1e-9) and all(np.diff((0.0, *rows)) >= 0.99e-9)


def test_without_times_every_step_is_a_row():
    found = run(base('growth.end="0.5 h"', "numerics.tolerance=0.0001"))
    steps = [row.end for instant in found for row in instant.ledgers]
    times = [instant.pore.time for instant in found]
    assert times[-1] == steps[-1] == 0.5 and len(steps) > 2 and len(found) >= 25
    assert set(steps) | set(stepping.rows(base('growth.end="0.5 h"'))) == set(times[1:])
    assert all(len(instant.ledgers) == (instant.pore.time in steps) for instant in found)


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


@pytest.mark.parametrize("name", SCENES)
def test_steps_depend_on_no_row(name):
    """The last state and the ledger of every step, to the last bit, with 1 and 7 rows, and every step's."""
    last, rows, ledgers = steps_of(name)
    for count in (1, 7):
        times = np.linspace(0, last.pore.time, count + 1)[1:].tolist()
        other, found, its = steps_of(name, f"output.times={json.dumps([f'{time!r} h' for time in times])}")
        assert len(found) == count + 1 and its == ledgers
        assert same(other, last)
    assert len(ledgers) > 1
    if CONTACT[0] in SCENES[name]:
        assert not rows[0].pore.contact and rows[-1].pore.contact and sum(instant.remeshes for instant in rows) > 1


@pytest.mark.parametrize("part", [0.55, 0.97])
@pytest.mark.parametrize("name", SCENES)
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


@EVERY_ORDER
def test_a_step_ends_when_the_film_is_first_too_thin(attempts, order):
    """The film is within 2 % of what it may be, and no thicker, when contact is first made; a longer step was tried
    and not taken."""
    made = narrow(order, "17.9 um", "0.6 h")
    found = run(made)
    first = next(instant for instant in found if instant.pore.contact)
    (gaps,) = [a.gaps for _, a in attempts if a.gaps and a.step and a.step.pore.mesh is first.pore.mesh]
    film = made.growth.minimum_film
    assert 0.98 * film <= gaps[1] < film < gaps[0]
    assert any(a.gaps and a.gaps[1] < 0.98 * film for _, a in attempts), "else nothing is tested"


@pytest.mark.parametrize("tolerance", [0.002, 0.0005])
def test_the_change_of_the_rates_in_a_step_is_bounded(attempts, tolerance):
    """At most EXCESS tolerances in each step that is taken, at least half of one in the largest; what errs more has no
    step."""
    found = [instant for instant in run(base('growth.end="2 h"', f"numerics.tolerance={tolerance}"))
             if instant.ledgers or instant.pore.time == 0]
    taken = np.diff([instant.pore.time for instant in found])
    meshes = {id(instant.pore.mesh) for instant in found}
    most = pace.EXCESS * tolerance * (1 + 1e-9)
    estimates = [a.change * duration for duration, a in attempts if a.step and id(a.step.pore.mesh) in meshes]
    assert len(estimates) == len(taken) and tolerance / 2 < max(estimates) <= most
    assert all((a.change * duration > most) == (a.step is None) for duration, a in attempts)


def advanced(made, attempt, monkeypatch):
    """(what a step of 0.2 h comes to, durations that are tried) of a scene where ``attempt`` (duration, most) says
    whether a step is good (else it fails), and by how much its rates change."""
    now, tried = pore.seeded(made), []

    def told(_, __, ___, duration, most):
        tried.append(duration)
        good, change = attempt(duration, most)
        return Attempt(stepping.Step(now, None, None, False, 0) if good else None, change, None)

    monkeypatch.setattr(midpoint, "attempt", told)
    return stepping._advance(made, now, None, pace.Pace(0.2)), tried


def test_a_step_that_fails_is_halved_until_it_is_done(monkeypatch):
    """0.2 h fails down to 0.02 h: 0.1, 0.05, 0.025 h are tried in turn."""
    def attempt(duration, most):
        if duration > 0.02:
            raise GrowthError("too long")
        return True, 1e-9

    (taken, _, after), tried = advanced(base(), attempt, monkeypatch)
    assert tried == [0.2, 0.1, 0.05, 0.025, 0.0125]
    assert taken.pore.time == 0.0125 and after.length == pytest.approx(pace.FASTER * 0.0125)


def test_a_step_that_errs_too_much_is_not_taken(monkeypatch):
    """An estimate of 16 tolerances: the step is tried again at 0.9 / 4 of its length, where it is 16 times smaller."""
    def attempt(duration, most):
        change = 16 * 0.01 / 0.2**2 * duration
        return change <= most, change

    (_, _, after), tried = advanced(base("numerics.tolerance=0.01"), attempt, monkeypatch)
    assert tried == pytest.approx([0.2, 0.9 / 4 * 0.2])
    assert after.length == pytest.approx(0.9 / 0.9 * tried[-1])
    assert (after.duration, after.estimate) == pytest.approx((tried[-1], 16 * 0.01 / 0.2**2 * tried[-1] ** 2))


@pytest.mark.parametrize("error, told", [(GrowthError("no way"), "in growth: no way"),
                                         (FloatingPointError("overflow"), "floating-point error .overflow.")])
def test_what_fails_at_the_shortest_step_stops_the_run(monkeypatch, error, told):
    """With the time of the step; not before growth.time_step / 1000 has failed."""
    tried, attempt = [], midpoint.attempt

    def fails_later(made, now, solved, duration, most):
        if now.time == 0:
            return attempt(made, now, solved, duration, most)
        tried.append(duration)
        raise error

    monkeypatch.setattr(midpoint, "attempt", fails_later)
    with pytest.raises(SimulationError, match=rf"stopped in the step from t = 0.4 h.*{told}"):
        run(base('growth.end="1 h"', 'growth.time_step="0.05 h"'))
    assert 2.5e-5 < tried[-1] <= 5e-5 and len(tried) < 20  # to the end, then 2 h 2^-16


@EVERY_ORDER
def test_a_run_ends_where_the_aggregate_reaches_an_end_of_the_pore(order):
    """The last instant is reported, then PoreEnd."""
    made = base('pore.length="90 um"', 'growth.end="19 h"', *sets(order))
    found = []
    with pytest.raises(PoreEnd, match="reaches the pore's upstream end"):
        for instant in simulation.simulate(made):
            found += [instant] if instant.ledgers else []
    near = made.pore.width / ACROSS_PORE
    assert 0.1 * near - 45 <= found[-1].pore.outline.upstream < near - 45 <= found[-2].pore.outline.upstream


@pytest.mark.parametrize("before, after", [(1.0, 1.0), (1.0, 1.2), (1.0, 0.9), (3.0, 0.0), (2.01, 1.0)])
def test_the_part_of_a_step_to_contact_is_bounded(before, after):
    """Also where the film was too thin from the start and does not thin."""
    assert 0.02 <= stepping._to_contact((before, after, 2.0)) <= 0.95


@EVERY_ORDER
def test_a_film_too_thin_from_the_start_closes(order):
    """Though nothing grows: without a supply the aggregate neither grows nor decays."""
    found = run(narrow(order, "18.5 um", "0.1 h", acceptor="0 mg/L", donor="0 mg/L"))
    assert found[-1].pore.contact and found[-1].pore.mass == pytest.approx(found[0].pore.mass, rel=1e-9)


@EVERY_ORDER
@pytest.mark.parametrize("anew", [False, True])
def test_half_way_tables_say_what_holds_in_the_middle_of_a_step(monkeypatch, order, anew):
    """Both supplies and the drive, changing evenly at rates of their own, on the mesh that has moved and a new one."""
    tables = {"flow.head": ("10 um", "30 um"), "substrates.acceptor.supply": ("8 mg/L", "4 mg/L"),
              "substrates.donor.supply": ("2 mg/L", "7 mg/L")}
    said = [f"{key}={json.dumps([['0 h', first], ['2 h', last]])}" for key, (first, last) in tables.items()]
    made = load_scene("base", [FAST, *sets(order), *said, *(f"{key.rpartition('.')[0]}.interpolation=linear"
                                                            for key in tables)])
    now = replace(pore.seeded(made), time=1.0)
    solved = pore.solve(made, now)
    if anew:
        monkeypatch.setattr(remeshing, "followed", lambda *_: None)
    half = midpoint.halfway(made, now, solved, rates_of(made, now, solved.concentrations), 0.4)
    supplies = [kind.supply for kind in half.solved.problem.both]
    assert [half.solved.flow.head_loss, *supplies] == pytest.approx([22, 5.6, 5], rel=1e-9)
