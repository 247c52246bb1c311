"""Steps of the midpoint rule: how long they are, where they end, which are accepted, and what depends on rows and ends.

The case coupling-midpoint-order tests their order, the case coupling-ledger their ledgers, and the case hard-07-contact
that contact ends a step.
"""
import json
from dataclasses import replace
from functools import partial
from itertools import product

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from repro.errors import GrowthError, SimulationError, Unresolved
from repro.fem.walls import FREE, TOP
from repro.march import midpoint, simulation, step_control, stepping, updates
from repro.march.ends import PoreEnd
from repro.march.midpoint import Attempt
from repro.march.step_control import EXCESS, FASTER, SAFETY, STRETCH, StepControl, fit_to_interval, next_step_size
from repro.model import grading, remeshing, solving
from repro.model.biomass import Rates, change
from repro.model.contact_lines import PATIENT
from repro.model.meshing import seeded
from repro.model.solving import solve
from repro.model.stages import Stages
from repro.scene import load_scene
from tests.strategies import EVERY_ORDER, coarse_base
from tests.test_state import alike
from verification.problems.schemes import exchange

FAST = 'numerics.preset="fast"'
THOROUGH = partial(pytest.param, marks=pytest.mark.thorough)


def base(*changes):
    return load_scene("base", (FAST, 'aggregate.radius="25 um"', *changes))


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


def same(one, other):
    """Return whether two states, without their rows, agree to the last bit."""
    return alike(one.pore, other.pore) and one.step_control == other.step_control


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
    state = seeded(scene)
    solved = solving.solve(scene, state)
    state = replace(state, concentrations=solved.concentrations)
    differences = []
    for hours in (1.0, 0.5, 0.25):
        row = midpoint.attempt(Stages.of(scene), state, solved, hours).step.within(0.37 * hours)
        shorter = midpoint.attempt(Stages.of(scene), state, solved, 0.37 * hours).step.pore
        differences.append(numbers(row.pore, row.solved) - numbers(shorter, solving.solve(scene, shorter)))
    assert np.abs(np.log2(np.divide(differences[:-1], differences[1:])) - 3).max() < 0.35


@pytest.fixture
def long_step():
    """Base in `fast` and its step from 1.6 to 9.6 h, which generates meshes half way and at its end."""
    scene = load_scene("base", (FAST,))
    state = next(state for state, _ in simulation.steps(scene) if state.pore.time > 1)
    pore, solved = grading.solve_graded(scene, state.pore)
    return midpoint.attempt(Stages.of(scene), replace(pore, concentrations=solved.concentrations), solved, 8.0).step


def test_a_row_uses_the_meshes_of_its_step(long_step, monkeypatch):
    """No mesh is generated for a row. Biomass and shape are those of a row on a mesh of its own to round-off, and the
    velocity to 1e-3, which is a tenth of the preset's accuracy (2.5e-4 is measured)."""
    times, made, remesh = (5.0, 6.5, 9.0), [], remeshing.remesh
    with monkeypatch.context() as patch:
        patch.setattr(remeshing, "remesh", lambda *arguments: made.append(1) or remesh(*arguments))
        rows = [long_step.within(time) for time in times]
    assert made == []
    monkeypatch.setattr(remeshing, "_on_generated", lambda *_: None)
    for row, time in zip(rows, times):
        own = long_step.within(time)
        meshes = [one.pore.mesh for one in (row, own)]
        assert len(meshes[0].points) != len(meshes[1].points) and meshes[0].acceptable()
        one, other = numbers(row.pore, row.solved), numbers(own.pore, own.solved)
        assert one[:3] == pytest.approx(other[:3], rel=1e-10)
        assert row.solved.flow.mean_velocity == pytest.approx(own.solved.flow.mean_velocity, rel=1e-3)
        assert abs(row.pore.composition(3e4)[0] / own.pore.composition(3e4)[0] - 1) < 1e-10


def test_a_mesh_generated_for_another_contact_is_not_used(long_step):
    """The contact of a mesh's own shape decides."""
    stages, previous, _, half = long_step.within.args
    generated = half.generated[0]
    wall = generated.shape.body.wall
    touching = generated.shape.with_body(wall=np.where(wall == FREE, TOP, wall))
    other = replace(generated, shape=touching)
    on_mesh = [remeshing._on_generated(stages.remeshing, each, generated.shape) for each in (generated, other)]
    assert on_mesh[0] is not None and on_mesh[1] is None


def test_the_guess_of_a_shape_is_exact_where_it_is_known(long_step):
    """At the start, half way and at the end of a step."""
    _, previous, _, half = long_step.within.args
    body = previous.mesh.body
    for part, known in ((0.0, previous.mesh.points), (0.5, half.expansion.position), (1.0, half.end.position)):
        guess = midpoint._guess_shape(previous, midpoint._known_shapes(half, part))
        assert guess.mesh.points[body] == pytest.approx(known[body], abs=1e-10)


def numbers(state, solved):
    """Biomass, area, upstream tip, effluent of the acceptor."""
    return np.array([state.mass, state.outline.area, state.outline.upstream, solved.fluxes[0].effluent])


@pytest.mark.parametrize("error, lengths", [(GrowthError, [0.2, 0.1, 0.025, 0.0015625]),
                                            (PoreEnd, [0.2, 0.1, 0.05, 0.025, 0.0125])])
def test_each_failure_shortens_a_step_by_the_square_of_the_last_factor(error, lengths, monkeypatch):
    """Steps above 0.02 h fail: 0.2, 0.2 / 2, 0.1 / 4 and 0.025 / 16 h are tried. A step past an end is halved."""
    scene, tried = base(), []
    state = seeded(scene)

    def attempt(_, __, ___, duration, *____):
        tried.append(duration)
        if duration > 0.02:
            raise error("too long")
        return Attempt(stepping.StepResult(state, None, None, False, 0, None), 1e-9, None)

    monkeypatch.setattr(midpoint, "attempt", attempt)
    result, _, after = stepping._advance(Stages.of(scene), state, None, step_control.StepControl(0.2))
    assert tried == lengths
    assert result.pore.time == lengths[-1] and after.length == pytest.approx(step_control.FASTER * lengths[-1])


def test_a_step_ends_at_contact_within_a_thousandth_of_the_film(monkeypatch):
    """In a step in which the film thins evenly from 4 to 1 um, the step is cut where the film is just under 2 um."""
    assert 1.998 < 4 - 3 * stepping._part_to_contact(4.0, 1.0, 2.0) < 2
    searches, attempt = [], midpoint.attempt

    def record_search(*arguments, **named):
        searches.extend(each for each in arguments[5:6] if each is not PATIENT)  # a cut searches patiently
        return attempt(*arguments, **named)

    monkeypatch.setattr(midpoint, "attempt", record_search)
    scene = base('growth.end="1 h"', 'output.times=["1 h"]')
    for _ in simulation.simulate(scene):
        pass
    assert {search.landing for search in searches} == {0.999}


@pytest.mark.parametrize("error, message", [(GrowthError("no way"), "in growth: no way"),
                                         (FloatingPointError("overflow"), "floating-point error .overflow.")])
def test_a_failure_of_the_shortest_step_stops_the_run(monkeypatch, error, message):
    """The message has the time of the step. growth.time_step / 1000 has failed before."""
    tried, attempt = [], midpoint.attempt

    def fails_later(scene, state, solved, duration, *options, **named):
        if state.time == 0:
            return attempt(scene, state, solved, duration, *options, **named)
        tried.append(duration)
        raise error

    monkeypatch.setattr(midpoint, "attempt", fails_later)
    with pytest.raises(SimulationError, match=rf"stopped in the step from t = 0.4 h.*{message}"):
        list(simulation.simulate(base('growth.end="1 h"', 'growth.time_step="0.05 h"', 'output.times=["1 h"]')))
    assert 2.5e-5 < tried[-1] <= 5e-5 and len(tried) <= 6  # 5e-5 h is growth.time_step / 1000


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

    def cut(scene, state, solved, duration, *most, **named):
        if duration <= 0.3 and state.front < needed:
            raise Unresolved("the mesh is too coarse")
        return attempt(scene, state, solved, duration, *most, **named)

    monkeypatch.setattr(midpoint, "attempt", cut)
    scene = simulation.simulate(base('growth.end="0.3 h"', 'output.times=["0.3 h"]'))
    if message:
        with pytest.raises(SimulationError, match=message):
            list(scene)
    else:
        assert [instant.pore.front for instant in scene][-1] == needed


def test_shorter_steps_lead_to_an_end_that_one_step_does_not_reach(monkeypatch):
    """A step past the end is accepted, and the step to the end fails."""
    attempt, tried = midpoint.attempt, []

    def fails_to_the_end(scene, state, solved, duration, *most, **named):
        tried.append(duration)
        if duration == 0.3:
            raise GrowthError("no rest")
        return attempt(scene, state, solved, duration, *most, **named)

    monkeypatch.setattr(midpoint, "attempt", fails_to_the_end)
    *_, last = simulation.simulate(base('growth.end="0.3 h"', 'output.times=["0.3 h"]'))
    assert tried[0] > 0.3 and tried.count(0.3) == 1 and last.pore.time == 0.3


@pytest.mark.parametrize("error", [Unresolved("the mesh is too coarse"), GrowthError("no rest")])
def test_steps_to_a_row_are_graded_and_shortened_like_every_step(error, monkeypatch):
    """The row cannot be interpolated. Steps of its length fail, on elements of the first size or always."""
    attempt, tried = midpoint.attempt, []

    def fail(*_):
        raise error

    def to_the_row(scene, state, solved, duration, *most, **named):
        tried.append((duration, state.front))
        if duration == 0.15 and (isinstance(error, GrowthError) or state.front < 2):
            raise error
        return attempt(scene, state, solved, duration, *most, **named)

    monkeypatch.setattr(midpoint, "interpolate", fail)
    monkeypatch.setattr(midpoint, "attempt", to_the_row)
    changes = ('growth.end="0.3 h"', 'output.times=["0.15 h", "0.3 h"]')
    _, row, end = simulation.simulate(base(*changes))
    assert row.pore.time == 0.15 and end.pore.time == 0.3 and end.pore.front == 1
    assert row.pore.front == (2 if isinstance(error, Unresolved) else 1) and (0.15, 1.0) in tried


def test_a_step_ends_at_a_jump_to_the_last_bit():
    """For any start the new value applies after the step. A step shorter by a microhour ends earlier."""
    _, pore = coarse_base(1)
    for start, k, factor in product((0.1, 0.7, 2.3, 19.1), range(1, 50), (1 - 4e-16, 1.0, 1 + 4e-16)):
        length, shorter = k / 7 * factor, k / 7 * factor - 1e-6
        assert stepping._end_of(replace(pore, time=start), length, start + k / 7) == start + k / 7
        assert stepping._end_of(replace(pore, time=start), shorter, start + k / 7) == start + shorter


@pytest.mark.parametrize("time", ["updates", "midpoint"])
def test_a_shape_leans_as_the_flow_at_the_end_of_its_step_pushes(time):
    """The lean is the difference between the ends' motion. It is the same under a rising head as under its last value.
    After a jump at the end of the step it is that under the new head, for which the aggregate takes its new shape at
    once."""
    leans = []
    for first, last, kind in ((4, 4, "linear"), (1, 4, "linear"), (1, 4, "steps")):
        table = f'[["0 h", "{first}e-3 cm"], ["0.2 h", "{last}e-3 cm"]]'
        scene, _ = coarse_base(2, f'flow.head={{table={table}, between="{kind}"}}',
                               "growth.fluid_forces=included", exchange(steps=time),
                               'growth.end="0.2 h"', 'growth.shear_modulus="1e-4 MPa"', 'output.times=["0.2 h"]')
        _, end = simulation.simulate(scene)
        leans.append(end.pore.outline.upstream + end.pore.outline.downstream)
    assert leans == pytest.approx([leans[0]] * 3, rel=1e-2) and leans[0] > 1e-4


@pytest.mark.parametrize("scheme", [stepping.STEPPING, updates.STEPPING], ids=["midpoint", "updates"])
def test_the_solution_after_a_step_to_a_jump_is_that_before_it(scheme):
    """The ends of the model are judged with it and with the shape under its forces, and then with those after the
    jump."""
    scene, pore = coarse_base(2, 'flow.head=[["0 h", "4e-3 cm"], ["0.2 h", "1e-3 cm"]]',
                              "growth.fluid_forces=included", 'growth.shear_modulus="1e-4 MPa"')
    stages, solved = Stages.of(scene), solve(scene, pore)
    step, after = scheme.cut(stages, pore, solved, 0.2)
    assert step.pore.time == 0.2
    assert after.mean_velocity == pytest.approx(solved.mean_velocity, rel=0.05)
    assert solve(scene, step.pore).mean_velocity == pytest.approx(after.mean_velocity / 4)
    earlier, _ = scheme.cut(stages, pore, solved, 0.199)
    leans = [each.pore.outline.upstream + each.pore.outline.downstream for each in (step, earlier)]
    assert leans[0] == pytest.approx(leans[1], rel=0.02) and leans[1] > 1e-4


def test_a_step_grows_as_much_on_a_new_mesh_half_way():
    """In 4 h a seed grows by half and the supply falls to a tenth. The mesh half way is new, since edges are three
    times too long, or the old one."""
    supply = '{table=[["0 h", "4 mg/L"], ["4 h", "0.4 mg/L"]], between="linear"}'
    scene, pore = coarse_base(2, f"substrates.donor.supply={supply}")
    solved = solve(scene, pore)
    first = Stages.of(scene).rates(pore, solved)
    numerics = [replace(scene.numerics, refinement=part) for part in (0.3, 0.9)]
    same_mesh, new_mesh = (midpoint.solve_halfway(Stages.of(replace(scene, numerics=each)), pore, solved, first, 4.0,
                                                  PATIENT) for each in numerics)
    assert new_mesh.produced[0] == pytest.approx(same_mesh.produced[0], rel=1e-2)
    assert len(new_mesh.solved.flow.velocity) > 2 * len(same_mesh.solved.flow.velocity)


@EVERY_ORDER
def test_an_update_under_a_table_starts_from_gears_concentrations(order):
    """It uses the supply half way, and not the steady profiles of that supply."""
    supply = '{table=[["0 h", "9 mg/L"], ["1 h", "29 mg/L"]], between="linear"}'
    scene, pore = coarse_base(order, "numerics.transport=gear", f"substrates.acceptor.supply={supply}")
    solved = solve(scene, pore)
    half_way = updates._solve_midway(Stages.of(scene), pore, solved, 0.2)
    assert half_way.concentrations is solved.concentrations and half_way.problem.kinds[0].supply == pytest.approx(11.0)
    stored = updates.step(Stages.of(scene), pore, solved, 0.2).ledger.stored[0]
    risen = stored / (scene.pore.width * np.ptp(pore.mesh.ends))
    assert risen == pytest.approx(2.0, rel=0.05)


# ---------------------------------------------------------------- lengths


LENGTHS = st.floats(1e-3, 1e3)


def test_the_change_that_bounds_a_step_is_a_mean_over_the_area():
    """The mean is that of the absolute change: by 1, -1, 0.5 and 0 1/h in points of 1, 1, 6 and 2 um2."""
    first, second = (Rates(np.array(growth), np.full((2, 2), 0.25))
                     for growth in ([[0.0, 1.0], [0.5, 2.0]], [[1.0, 0.0], [1.0, 2.0]]))
    assert change(first, second, np.array([[1.0, 1.0], [6.0, 2.0]])) == pytest.approx(0.5, rel=1e-15)


@given(LENGTHS, st.floats(1e-6, 1e3), st.sampled_from([1.0, STRETCH]))
def test_a_step_leaves_no_tiny_rest(length, remaining, stretch):
    """The remaining time is zero, or at least half a step."""
    step = fit_to_interval(length, remaining, stretch)
    assert 0 < step <= remaining and step <= stretch * length * (1 + 2e-9)
    assert step == remaining or remaining - step >= step * (1 - 1e-9)


@given(st.floats(1e-6, 1e-3), st.floats(0.3, 3.0), st.floats(1.0, 3.0))
def test_steps_under_a_steady_rise_meet_the_tolerance(start, step, rise):
    """The estimate is c h^2, and c rises by the same factor in each step. From the third step on, the estimate is
    SAFETY^2 tolerances and the steps are accepted."""
    control, c = StepControl(step), start
    estimates = []
    for _ in range(8):
        duration = control.length
        estimates.append(c * duration**2)
        control = next_step_size(control, duration, estimates[-1], 0.01)
        c *= rise
    later = [a for a, b in zip(estimates[3:], estimates[2:]) if b > 0.01 / FASTER]
    assert later and all(0.3 * 0.01 < estimate <= EXCESS * 0.01 for estimate in later)
    assert estimates[-1] == pytest.approx(SAFETY**2 * 0.01)


def test_a_step_cut_short_at_a_reported_time_does_not_shorten_the_next():
    """The control proposes 2 h. A step of 0.01 h without error follows, and the next proposal is 2 h again."""
    assert next_step_size(StepControl(2.0), 0.01, 1e-9, 0.01).length == 2.0
