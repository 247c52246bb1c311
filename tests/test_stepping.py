"""Steps of the midpoint rule: where they end, which are accepted, and what depends on rows and ends.

The case coupling-midpoint-order tests their order, `test_balances.py` their ledgers, `test_pace.py` their length, and
the case hard-07-contact that contact ends a step.
"""
import json
from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from repro.errors import GrowthError, SimulationError, Unresolved
from repro.fem.sizing import ACROSS_PORE
from repro.march import midpoint, simulation, step_control, stepping
from repro.march.loop import PoreEnd
from repro.march.midpoint import Attempt
from repro.model import pore
from repro.model.stages import Stages
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


@pytest.mark.parametrize("end, spacing", [
    (0.001, 0.2 / 2**13), (0.01, 0.2 / 2**9), (1.0, 0.025), (4.79, 0.1), (4.8, 0.2), (19.4, 0.8), (45.0, 1.6)])
def test_a_run_without_times_has_about_25_rows_at_round_times(end, spacing):
    """The last row is at the end of the run."""
    rows = stepping.rows(base(f'growth.end="{end} h"').growth)
    assert 24 <= len(rows) <= 49 and rows[-1] == end and rows[0] == pytest.approx(spacing, abs=1e-9)
    assert np.diff(rows[:-1]) == pytest.approx(spacing, abs=2e-9) and 0 < rows[-1] - rows[-2] <= spacing * 1.0001


#: A run with contact and new meshes, and with rows before and after them.
CONTACT = ('aggregate.radius="17.8 um"', 'pore.width="20 um"', 'flow.head="1 mm"', "numerics.tolerance=0.001")
SCENES = {"fast": (FAST, 'growth.end="9.7 h"'), "contact": (FAST, 'growth.end="0.6 h"', *CONTACT),
          "paper": ('growth.end="0.8 h"', *CONTACT), "gear": ('growth.end="0.7 h"', 'numerics.transport="gear"'),
          "stress-free": (FAST, 'growth.end="0.6 h"', 'growth.new_biomass="stress_free"', *CONTACT)}


def steps_of(name, *changes):
    """The last state, the reports, and the ledgers of all steps of a scene, reported or not."""
    scene = load_scene("base", (*SCENES[name], *changes))
    results = list(simulation.steps(scene))
    rows = [instant for _, instant in results if instant]
    last = results[-1][0]
    return last, rows, [*(row for instant in rows for row in instant.ledgers), *last.ledgers]


def same(one, other):
    """Are two states, without their rows, the same to the last bit?"""
    return alike(one.pore, other.pore) and one.step_control == other.step_control


@pytest.mark.parametrize("name", ["fast", "paper", *map(THOROUGH, ("contact", "gear", "stress-free"))])
def test_steps_do_not_depend_on_rows(name):
    """The last state and the ledger of every step agree to the last bit with 1 row, 7 rows, and a row at the end of
    every step."""
    last, rows, ledgers = steps_of(name)
    for count in (1, 7):
        times = np.linspace(0, last.pore.time, count + 1)[1:].tolist()
        output_times = json.dumps([f"{time!r} h" for time in times])
        other, reports, all_ledgers = steps_of(name, f"output.times={output_times}")
        assert len(reports) == count + 1 and all_ledgers == ledgers
        assert same(other, last)
    assert len(ledgers) > 1 and {row.end for row in ledgers} <= {instant.pore.time for instant in rows}
    if CONTACT[0] in SCENES[name]:
        assert not rows[0].pore.contact and rows[-1].pore.contact and sum(instant.remeshes for instant in rows) > 1


@pytest.mark.parametrize("part", [0.55, THOROUGH(0.97)])
@pytest.mark.parametrize("name", ["fast", "gear", *map(THOROUGH, ("contact", "paper", "stress-free"))])
def test_steps_and_rows_before_the_end_do_not_depend_on_it(name, part):
    """All states and rows of a shorter run are those of the longer run, to the last bit. The last state and row differ,
    since a step ends there."""
    full_end = load_scene("base", SCENES[name]).growth.end
    end = part * full_end
    times = [0.0, *(np.linspace(0.1, 0.98, 9) * end).tolist()]
    (states, rows), (longer_states, longer_rows) = (run_until(name, last, times) for last in (end, full_end))
    assert [one.pore.time for one in rows[:-1]] == [one.pore.time for one in longer_rows[:-1]] == times
    for one, other in zip(rows[:-1], longer_rows[:-1]):
        assert alike(one.pore, other.pore)
        assert one.solved.flow.conductivity == other.solved.flow.conductivity
        assert [(row.end, row.out) for row in one.ledgers] == [(row.end, row.out) for row in other.ledgers]
    assert states[-1].pore.time == end and len(states) > 1
    assert all(map(same, states[:-1], longer_states))


def run_until(name, end, times):
    """States at the ends of steps, and the reports, of a scene with rows at ``times`` and at its ``end``."""
    output_times = json.dumps([f"{time!r} h" for time in (*times[1:], end)])
    scene = load_scene("base", (*SCENES[name], f'growth.end="{end!r} h"', f"output.times={output_times}"))
    results = list(simulation.steps(scene))
    states = {state.pore.time: state for state, _ in results}
    return list(states.values()), [instant for _, instant in results if instant]


def test_rows_within_steps_are_of_second_order():
    """At 0.37 of a step, biomass, area, tip and effluent differ from those of a step that ends there by a local error,
    which is proportional to the cube of the step."""
    scene = base()
    state = pore.seeded(scene)
    solved = pore.solve(scene, state)
    state = replace(state, concentrations=solved.concentrations)
    differences = []
    for hours in (1.0, 0.5, 0.25):
        row = midpoint.attempt(Stages.of(scene), state, solved, hours).step.within(0.37 * hours)
        shorter = midpoint.attempt(Stages.of(scene), state, solved, 0.37 * hours).step.pore
        differences.append(numbers(row.pore, row.solved) - numbers(shorter, pore.solve(scene, shorter)))
    assert np.abs(np.log2(np.divide(differences[:-1], differences[1:])) - 3).max() < 0.35


def numbers(state, solved):
    """Biomass, area, upstream tip, effluent of the acceptor."""
    return np.array([state.mass, state.outline.area, state.outline.upstream, solved.fluxes[0].effluent])


def test_a_failing_step_is_halved_until_it_succeeds(monkeypatch):
    """Steps above 0.02 h fail: 0.2, 0.1, 0.05 and 0.025 h are tried in turn."""
    scene, tried = base(), []
    state = pore.seeded(scene)

    def attempt(_, __, ___, duration, *____):
        tried.append(duration)
        if duration > 0.02:
            raise GrowthError("too long")
        return Attempt(stepping.StepResult(state, None, None, False, 0, None), 1e-9, None)

    monkeypatch.setattr(midpoint, "attempt", attempt)
    result, _, after = stepping._advance(Stages.of(scene), state, None, step_control.StepControl(0.2))
    assert tried == [0.2, 0.1, 0.05, 0.025, 0.0125]
    assert result.pore.time == 0.0125 and after.length == pytest.approx(step_control.FASTER * 0.0125)


def test_a_step_ends_at_contact_within_a_thousandth_of_the_film(monkeypatch):
    """The film of 2 um lies within an even thinning from 4 to 1 um, and the step is made to end there."""
    assert 1.998 < 4 - 3 * stepping._part_to_contact(4.0, 1.0, 2.0) < 2
    searches, attempt = [], midpoint.attempt

    def record_search(*arguments):
        searches.extend(arguments[5:])
        return attempt(*arguments)

    monkeypatch.setattr(midpoint, "attempt", record_search)
    scene = base('growth.end="1 h"')
    for _ in simulation.simulate(scene):
        pass
    assert {search.landing for search in searches} == {0.999}


@pytest.mark.parametrize("error, message", [(GrowthError("no way"), "in growth: no way"),
                                         (FloatingPointError("overflow"), "floating-point error .overflow.")])
def test_a_failure_of_the_shortest_step_stops_the_run(monkeypatch, error, message):
    """The message has the time of the step. growth.time_step / 1000 has failed before."""
    tried, attempt = [], midpoint.attempt

    def fails_later(scene, state, solved, duration, *options):
        if state.time == 0:
            return attempt(scene, state, solved, duration, *options)
        tried.append(duration)
        raise error

    monkeypatch.setattr(midpoint, "attempt", fails_later)
    with pytest.raises(SimulationError, match=rf"stopped in the step from t = 0.4 h.*{message}"):
        list(simulation.simulate(base('growth.end="1 h"', 'growth.time_step="0.05 h"')))
    assert 2.5e-5 < tried[-1] <= 5e-5 and len(tried) < 20  # to the end, then 2 h 2^-16


@pytest.mark.parametrize("order", [1, 2, THOROUGH(3)])
def test_a_run_ends_where_the_aggregate_reaches_an_end_of_the_pore(order):
    """The last instant is reported, then PoreEnd."""
    scene = base('pore.length="90 um"', 'growth.end="19 h"', *sets(order))
    reports = []
    with pytest.raises(PoreEnd, match="reaches the pore's upstream end"):
        for instant in simulation.simulate(scene):
            reports += [instant] if instant.ledgers else []
    near = scene.pore.width / ACROSS_PORE
    assert 0.1 * near - 45 <= reports[-1].pore.outline.upstream < near - 45 <= reports[-2].pore.outline.upstream


@pytest.mark.parametrize("order", [1, 2, THOROUGH(3)])
def test_a_film_too_thin_from_the_start_closes(order):
    """It closes without growth: without a supply the aggregate neither grows nor decays."""
    numerics = {"preset": "fast", "elements": ORDERS[order], "refinement": 0.6 if order == 1 else 0.2}
    first, *_, last = simulation.simulate(scene("18.5 um", "20 um", "0 mg/L", "0 mg/L", velocity="2.9 m/day",
                                                growth={"end": "0.1 h"}, numerics=numerics))
    assert last.pore.contact and last.pore.mass == pytest.approx(first.pore.mass, rel=1e-9)


@pytest.mark.parametrize("end, step", [("0 h", "12 min"), ("1e-9 h", "12 min"), ("1e-8 h", "100 h"), ("1 h", "1000 h"),
                                       ("3e-7 h", "1e-6 h")])
def test_rows_of_very_short_runs_do_not_coincide(end, step):
    scene = base(f'growth.end="{end}"', f'growth.time_step="{step}"')
    rows = stepping.rows(scene.growth)
    assert bool(rows) == (scene.growth.end > 1e-9) and all(np.diff((0.0, *rows)) >= 0.99e-9)


@pytest.mark.parametrize("needed, message", [(2.0, ""), (np.inf, "numerics.refinement")])
def test_the_last_step_uses_finer_elements_if_a_front_needs_them(needed, message, monkeypatch):
    """This also holds half way in the step that growth.end cuts. If no elements suffice, the error has advice."""
    attempt = midpoint.attempt

    def cut(scene, state, solved, duration, *most):
        if duration == 0.3 and state.front < needed:
            raise Unresolved("the mesh is too coarse")
        return attempt(scene, state, solved, duration, *most)

    monkeypatch.setattr(midpoint, "attempt", cut)
    scene = simulation.simulate(base('growth.end="0.3 h"'))
    if message:
        with pytest.raises(SimulationError, match=message):
            list(scene)
    else:
        assert [instant.pore.front for instant in scene][-1] == needed
