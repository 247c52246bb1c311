"""Supplies, head and mean velocity as tables over time: reading, writing, and runs with them. `test_longer.py` makes a
run with a table longer."""
import json
import math
import tomllib
from dataclasses import replace
from math import inf
from operator import attrgetter

import numpy as np
import pytest

from repro import results
from repro.march import updates
from repro.march.simulation import simulate
from repro.march.state import Report
from repro.model import solving
from repro.model.meshing import seeded
from repro.preflight.checked import check
from repro.preflight.numbers import evaluate_at_largest
from repro.results.jumps import with_jumps
from repro.scene import Scene, load_scene, parse_scene, scene_tables
from repro.scene.text import scene_text
from repro.scene.time_table import TimeTable
from repro.scene.units import Timed
from tests.strategies import scene
from tests.test_scene_text import fields

DONOR = "substrates.donor.supply"
STARVED = [["0 h", "10 mg/L"], ["0.3 h", "0 mg/L"], ["0.5 h", "20 mg/L"]]
RISING = 'flow.head=[["0 h", "1e-3 cm"], ["0.4 h", "3e-3 cm"]]'
RISE = '{table=[["0 h", "1 m/day"], ["0.5 h", "3 m/day"]], between="linear"}'
TIMED = {key: kind for key, entry in fields(Scene) if isinstance(kind := entry.metadata.get("kind"), Timed)}
SHORT = ('growth.end="0.8 h"', 'numerics.preset="fast"', f"{DONOR}={json.dumps(STARVED)}")


def between(word, table):
    """A table with what is between its times."""
    return f'{{ table = {json.dumps(table)}, between = "{word}" }}'


@pytest.mark.parametrize("is_linear", [True, False])
def test_a_table_is_read_in_units_and_written_back(is_linear):
    entries = [["0 min", "10 mg/L"], ["300 min", "20 mg/L"]]
    table = between("linear", entries) if is_linear else json.dumps(entries)
    loaded = load_scene("base", [f"{DONOR}={table}"])
    assert loaded.substrates.donor.supply == TimeTable((0.0, 5.0), (10.0, 20.0), is_linear)
    assert parse_scene(json.loads(json.dumps(scene_tables(loaded))), "base", "file") == loaded
    assert replace(load_scene(tomllib.loads(str(loaded))), name="base") == loaded
    assert tomllib.loads(scene_text("base", [f"{DONOR}={table}"]))["substrates"]["donor"] == {
        "supply": tomllib.loads(f"value = {table}")["value"]}


def test_a_table_in_steps_may_say_so_and_keeps_its_unit():
    table = between("steps", [["0 h", "1 g/L"], ["2 h", "2 g/L"]])
    loaded = load_scene("base", [f"{DONOR}={table}"])
    assert scene_tables(loaded)["substrates"]["donor"]["supply"] == [["0.0 h", "1 g/L"], ["2.0 h", "2 g/L"]]
    linear = load_scene("base", [f"{DONOR}={table}", f"{DONOR}.between=linear"])
    assert scene_tables(linear)["substrates"]["donor"]["supply"]["table"][1][1] == "2 g/L"
    assert linear.substrates.donor.supply.at(1.0) == 1500.0


#: What a table of the drive leaves out of base, and what it needs beside it.
DRIVEN_BY = {"flow.mean_velocity": (["flow.head"], []), "flow.rate": (["flow.head"], ["pore.depth=10 um"])}


@pytest.mark.parametrize("key", TIMED)
def test_every_key_that_takes_a_table_has_steps_or_changes_linearly(key):
    table = [[time, TIMED[key].write(value)] for time, value in (("0 h", 2.0), ("1 h", 6.0), ("4 h", 3.0))]
    without, beside = DRIVEN_BY.get(key, ([], []))
    for word, expected in (("steps", [2, 2, 6, 6, 3]), ("linear", [2, 4, 6, 5, 3])):
        loaded = load_scene("base", [f"{key}={between(word, table)}", *beside], unset=without)
        assert [attrgetter(key)(loaded.at(time)) for time in (0, 0.5, 1, 2, 9)] == pytest.approx(expected, rel=1e-15)
        assert attrgetter(key)(loaded.largest) == 6
        assert [loaded.time_tables.corner(time) for time in (0, 1, 4)] == [1, 4, inf]


@pytest.mark.parametrize("key", TIMED)
@pytest.mark.parametrize("seeds", [
    'aggregate={radius="20 um"}', 'aggregate=[{radius="20 um"}, {radius="20 um", position="60 um", wall="upper"}]'],
    ids=["one", "two"])
def test_the_columns_that_a_table_changes_at_once_are_drawn_with_a_jump(seeds, key):
    """Two rows of one state, with the values before and after the jump, tell which columns jump. Bounds of substrates
    may be zero in both."""
    without, beside = DRIVEN_BY.get(key, ([], []))
    size = {"flow.mean_velocity": 1e5, "flow.rate": 5e7}.get(key, 5.0)
    table = json.dumps([[time, TIMED[key].write(value)] for time, value in (("0 h", size), ("2 h", 2 * size))])
    loaded = load_scene("base", [f"{key}={table}", "growth.tensile_strength=1 MPa", "numerics.refinement=0.3",
                                 seeds, *beside], unset=without)
    seed = seeded(loaded)
    rows = []
    for time in (0.0, 2.0):
        at = replace(seed, time=time)
        rows.append(results.row(loaded, Report(at, solving.solve(loaded, at), None, (), 0, {})))
    changed = {column for column, before in rows[0].items()
               if before is not None and not math.isclose(before, rows[1][column], rel_tol=1e-6, abs_tol=1e-9)}
    times, values = np.array([1.0, 3.0]), np.array([1.0, 2.0])
    drawn = {column for column in rows[0] if len(with_jumps(column, times, values, scene_tables(loaded))[0]) > 2}
    defects = {column for column in changed if column.endswith("_balance")}
    assert changed - {"time_h", *defects} - drawn == set(), "these jump"
    assert {column for column in drawn - changed if rows[0][column] or rows[1][column]} == set(), "these do not"


def test_the_times_of_all_tables_of_a_scene_are_its_corners():
    loaded = load_scene("base", [*SHORT, RISING])
    assert [loaded.time_tables.corner(time) for time in (0.0, 0.3, 0.35, 0.4, 0.5)] == [0.3, 0.4, 0.4, 0.5, inf]
    plain = load_scene("base")
    assert plain.at(3.0) is plain and plain.largest is plain and plain.time_tables.corner(0.0) == inf


def test_updates_end_at_every_multiple_and_at_all_times_of_all_tables():
    """Times shortly before, after and between the multiples of 0.2 h all end an update."""
    loaded = scene(acceptor=[["0 h", "1 mg/L"], ["0.07 h", "2 mg/L"], ["0.38 h", "1 mg/L"]],
                 donor=[["0 h", "1 mg/L"], ["0.13 h", "2 mg/L"], ["0.55 h", "1 mg/L"]],
                 growth={"end": "0.71 h", "time_step": "0.2 h"})
    assert updates.schedule(loaded)[0] == [0, 0.07, 0.13, 0.2, 0.38, 0.4, 0.55, 0.6, 0.71]


@pytest.mark.parametrize("step", ["400 s", "20 min", "200 s"])
def test_a_time_of_a_table_at_a_multiple_of_the_time_step_ends_one_update(step):
    """The multiple has more than nine digits. No tiny step remains between both times, and there is one row."""
    loaded = scene(acceptor=[["0 h", "1 mg/L"], [step, "2 mg/L"]], growth={"end": "40 min", "time_step": step})
    first, second = updates.schedule(loaded)[0][1:3]
    assert first == loaded.substrates.acceptor.supply.times[1] and second == pytest.approx(2 * first)


@pytest.mark.parametrize("preset", ["fast", "paper"])
def test_a_row_within_a_step_has_the_supply_of_its_time(preset):
    """The small seed takes up less than a hundredth of it."""
    table = [["0 h", "10 mg/L"], ["1 h", "2 mg/L"]]
    loaded = load_scene("base", [f"{DONOR}={between('linear', table)}",
                               f"numerics.preset={preset}", 'growth.end="0.5 h"', 'output.times=["0.3 h", "0.5 h"]'])
    _, row, _ = simulate(loaded)
    assert row.solved.fluxes[1].effluent == pytest.approx(7.6, rel=1e-2)


@pytest.mark.parametrize("way", ["preset=fast", "preset=paper", "transport=gear"])
def test_the_supply_of_a_rising_velocity_is_its_integral(way):
    """The mean is 2 m/day, to round-off, for steps of any length."""
    loaded = load_scene("base", [f"flow.mean_velocity={RISE}", 'growth.end="0.5 h"', f"numerics.{way}",
                                 'output.times=["0.5 h"]'], unset=["flow.head"])
    total_supply = np.sum([step.supplied for instant in simulate(loaded) for step in instant.ledgers], axis=0)
    assert total_supply == pytest.approx(np.full(2, 2e6 / 24 * 0.5 * 50 * 10), rel=1e-9)


def test_a_table_is_judged_by_its_extreme():
    """The judgement uses the largest supply and the fastest flow."""
    loaded = load_scene("base", [*SHORT, RISING])
    plain = load_scene("base", [*SHORT[:2], 'flow.head="3e-3 cm"', f"{DONOR}=20 mg/L"])
    seed = seeded(loaded)
    speeds = [solving.solve(scene, seed).flow.mean_velocity for scene in (loaded, plain)]
    judgement, expected = map(evaluate_at_largest, (loaded, plain), speeds)
    assert judgement[0] == plain and [number.start for number in judgement[1]] == pytest.approx(
        [number.start for number in expected[1]], rel=1e-12)
    report = check(loaded, run=False)
    assert "0 to 20 mg/L, in steps, the last from 0.5 h" in dict(report.modelled)["substrates"]
