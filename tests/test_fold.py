"""A surface that growth compresses too far ends a run, as the pore's end does; above that a failure stays an error.

The scene is a plug between the walls that grows alike everywhere: its free surfaces keep their length, so that their
elastic stretch is theta^(-1/2)."""
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

import repro
from repro.cli import main
from repro.errors import GrowthError, LinearError, MeshError, SimulationError
from repro.march import loop
from repro.march.loop import Ledger, Moment, Scheme, State, Step
from repro.march.pace import Pace
from repro.model import contact, pore
from repro.model.surface import BIOT, CREASE, surface
from repro.preflight.numbers import judged
from repro.preflight.simplifications import warnings
from repro.results import read_table
from repro.runs.running import run
from repro.runs.status import done
from repro.scene import load_scene
from tests.shell import files, lasting, state, told
from tests.test_resume import in_parts

SETS = ('numerics.preset="fast"', "numerics.refinement=0.3", 'pore.width="20 um"', 'growth.end="6 h"',
        'aggregate.outline=[["-10 um", "0 um"], ["-10 um", "20 um"], ["10 um", "20 um"], ["10 um", "0 um"]]',
        'substrates.acceptor.supply="1e6 mg/L"', 'substrates.donor.supply="1e6 mg/L"',
        'output.times=["1 h", "4.6 h", "6 h"]')


@cache
def plug(*changes):
    return load_scene("base", [*SETS, *changes], ["aggregate.radius"])


def warned(folder):
    """What run.json says of creases."""
    return [each["text"] for each in told(folder)["warnings"] if each["key"] == "growth.new_biomass"]


def test_a_run_ends_as_a_fold_and_is_over(tmp_path, capsys):
    """The last state is written, above Biot's limit and within the shortest step of it; the exit status is 0; the
    warning comes once, when creases begin; the same command and --resume leave the run alone."""
    words = [part for each in SETS for part in ("--set", each)]
    command = ["run", "base", "--unset", "aggregate.radius", *words, "--out", str(tmp_path / "run")]
    assert main(command) == 0
    folder = tmp_path / "run"
    said = [line for line in capsys.readouterr().err.splitlines() if "growth.new_biomass: " in line]
    table = read_table(folder / "timeseries.csv")
    last = table["surface_stretch_min"][-1]
    assert BIOT <= last < BIOT * (1 + 1e-3) and table["time_h"].tolist()[:3] == [0.0, 1.0, 4.6]
    status = told(folder)["status"]
    assert status.startswith(f"the aggregate's surface folds in the step from t = {table['time_h'][-1]:g} h: near x = ")
    assert "a finer mesh does not help" in status and 'growth.new_biomass = "stress_free" does' in status
    (text,) = warned(folder)
    assert [line.partition("growth.new_biomass: ")[2] for line in said] == [text]
    begun = float(text.split()[3])
    assert table["surface_stretch_min"][1] > CREASE > table["surface_stretch_min"][2]
    assert 1 < begun < table["time_h"][-1], "at the end of the first step that comes below"
    before = state(folder)
    assert main(command) == 0 and main(["run", "--resume", str(folder)]) == 0 and state(folder) == before


@pytest.mark.parametrize("rheology", [pytest.param("stressed", marks=pytest.mark.thorough), "stress_free"])
def test_a_run_stopped_after_every_step_is_the_whole_run(tmp_path, rheology):
    """Also the last shape, from which strain counts without stress at birth, and the warning, are in a checkpoint; and
    such a run has come to its end, its least stretch that of the last step."""
    scene = plug(f"growth.new_biomass={rheology}", 'growth.end="5.3 h"', 'output.times=["1 h", "4.6 h", "5.3 h"]')
    run(scene, tmp_path / "whole")
    assert in_parts(scene, tmp_path / "parts", 2) >= 2
    assert files(tmp_path / "parts") == files(tmp_path / "whole")
    assert lasting(tmp_path / "parts") == lasting(tmp_path / "whole")
    if rheology == "stress_free":
        stretches = read_table(tmp_path / "whole" / "timeseries.csv")["surface_stretch_min"]
        assert told(tmp_path / "whole")["status"] == "completed"
        assert stretches[0] == 1 and (stretches[1:] > BIOT).all() and (stretches[1:] < 1 - 1e-6).all()


def test_a_script_is_told_too():
    """`solve` keeps the rows to the fold, and its status."""
    found = repro.solve(plug())
    assert done(found.status) and "folds" in found.status and found.time[-1] < 6
    assert found["surface_stretch_min"][-1] == pytest.approx(BIOT, rel=1e-3)


@cache
def compressed(theta):
    """The plug after uniform growth by theta, and what is solved there."""
    scene = plug()
    now = contact.expand(scene, pore.seeded(scene), np.full_like(pore.seeded(scene).theta, theta)).pore
    now = replace(now, active=theta * now.active, inert=theta * now.inert, time=1.0)
    return replace(now, concentrations=pore.solve(scene, now).concentrations)


def ends(theta, advance):
    """How a run ends that goes on from the compressed plug with steps made by ``advance``; and its rows."""
    found = []
    with pytest.raises((repro.Fold, SimulationError)) as how:
        found.extend(instant for _, instant in loop.steps(plug(), Scheme(advance), State(compressed(theta), Pace(1.0)))
                     if instant)
    return how.value, found


@pytest.mark.parametrize("error, theta, kind", [
    (GrowthError, 3.0, repro.Fold), (MeshError, 3.0, repro.Fold), (LinearError, 3.0, SimulationError),
    (GrowthError, 1.5, SimulationError), (MeshError, 1.5, SimulationError)])
def test_a_step_that_cannot_be_made_is_a_fold_where_the_surface_creases_alone(error, theta, kind):
    def advance(scene, now, solved, pace):
        raise error("no")

    how, rows = ends(theta, advance)
    assert type(how) is kind and not rows and ("folds in the step from t = 1 h: " in str(how)) == (kind is repro.Fold)


def many_times(factor, now, within):
    """A step to the run's end with so many times the biomass in the same shape, which no balance sees."""
    after = replace(now, time=6.0, active=factor * now.active, inert=factor * now.inert)
    none = (0.0, 0.0)
    ledger = Ledger(1.0, 6.0, none, none, none, none, after.mass, 0.0, after.mass)
    return Step(after, None, ledger, False, 0, within)


@pytest.mark.parametrize("theta, kind", [(3.0, repro.Fold), (1.5, SimulationError)])
@pytest.mark.parametrize("factor", [0.4, 2.5])
def test_no_row_has_a_density_that_is_out_of_bounds(theta, kind, factor):
    """At the end of a step, nor within one."""
    def too_dense(scene, now, solved, pace):
        return many_times(factor, now, lambda time: Moment(replace(now, time=time), solved)), solved, pace

    def too_dense_within(scene, now, solved, pace):
        there = many_times(factor, now, None).pore
        return many_times(1.0, now, lambda time: Moment(replace(there, time=time), solved)), solved, pace

    for advance in (too_dense, too_dense_within):
        how, rows = ends(theta, advance)
        assert type(how) is kind and not rows
        assert kind is repro.Fold or f"{factor:.2g} X_m, out of 0.5 to 2" in str(how)


@pytest.mark.parametrize("status, over", [
    ("the aggregate's surface folds in the step from t = 5.24 h: near x = 1, y = 2 um", True),
    ("the aggregate's surface folds in the step from t = 5.24 h", False),
    ("the aggregate's surface folds in the step from t = five h: near x = 1", False),
    ("the aggregate's surface folds", False)])
def test_the_whole_sentence_is_needed(status, over):
    assert done(status) == over


@pytest.mark.parametrize("theta", [1.5, 3.0])
def test_stretches_count_from_line_to_line(theta):
    """The plug has two free surfaces; each edge's distance is from the nearer end of its own, over its length."""
    found = surface(compressed(theta))
    upstream = found.middles[:, 0] < 0
    for side in (upstream, ~upstream):
        y = found.middles[side, 1] / 20.0
        assert found.distance[side] == pytest.approx(np.minimum(y, 1 - y), abs=1e-12)
    assert upstream.any() and (~upstream).any() and found.place[1] in found.middles[:, 1]


#: A wide, slow pore that is run past its fold, at 77 h in fast.
STARVED = ('numerics.preset="fast"', 'pore.length="2.4 mm"', 'aggregate.radius="10 um"',
           'flow.mean_velocity="0.3 m/day"', 'growth.end="90 h"')


@pytest.mark.parametrize("changes, expected", [
    ((), True), (("growth.new_biomass=stress_free",), False), (('pore.width="79 um"',), False),
    (('growth.end="32 h"',), False), (('substrates.acceptor.supply="20 mg/L"',
                                       'substrates.donor.supply="20 mg/L"'), False)])
def test_check_expects_a_fold_where_the_rule_says_so(changes, expected):
    """Not in narrow pores, in short runs, nor where the supply reaches through the aggregate."""
    scene = load_scene("wide", [*STARVED, *changes])
    told = [each.text for each in warnings(*judged(scene, 12500.0)) if "as a fold" in each.text]
    assert len(told) == expected and all("76.2 um into" in text for text in told)
