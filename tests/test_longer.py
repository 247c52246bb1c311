"""A run that is made longer: `repro run --resume DIR --set growth.end=LATER`."""

from shutil import copytree

import pytest

from repro.cli import main
from repro.errors import Interrupted
from repro.march.simulation import ends_soon, steps
from repro.results import read_table
from repro.runs.checkpoint import LAST, NEWEST, PREVIOUS
from repro.runs.running import Watch, resume, run
from repro.scene import SceneError, load_scene
from tests.pages import whole_of
from tests.shell import every, files, lasting, state, stopped, told

#: Ends of shorter runs (h): within the longer one's first step, within a later one, and near its own last; and scenes.
SCENES = {
    "paper": ((0.1, 1.4, 2.1), ["growth.end=2.2 h"]),
    "paper, an end within a step": ((1.0,), ["growth.end=2.2 h", "growth.time_step=21 min"]),
    "fast": ((0.3, 2.0, 2.9), ["numerics.preset=fast", "numerics.tolerance=0.001", "growth.end=3 h"]),
    "fast, rows at times": ((4.0,), ["numerics.preset=fast", "growth.end=9 h", 'output.times=["0 h", "2 h", "3 h"]']),
    "fast, contact": ((0.5,), ["numerics.preset=fast", "growth.end=0.6 h", "aggregate.radius=17.8 um",
                               "pore.width=20 um", "flow.head=1 mm", "numerics.tolerance=0.001",
                               "growth.new_biomass=stress_free"]),
    "gear": ((0.5,), ["growth.end=0.7 h", "numerics.transport=gear"]),
    "to the pore's end": ((8.0,), ["aggregate.radius=40 um", "pore.length=90 um", "growth.time_step=2 h",
                                   "growth.end=9 h", "numerics.refinement=0.5"]),
    "fast, rows closer than those of the longer run": ((4.75,), [
        "numerics.preset=fast", "numerics.tolerance=0.001", "growth.time_step=6 min", "growth.end=10 h"]),
}


def scene(name, end=None):
    return load_scene("base", SCENES[name][1] + ([f"growth.end={end} h"] if end else []))


def same(one, other):
    """Have two runs the same tables, fields and indices, and the same to say of themselves?"""
    left, right = (lasting(folder) | {"origin": None, "files": None, "sha256": None} for folder in (one, other))
    return files(one) == files(other) and left == right


#: Of the paper's scheme, of the midpoint rule and of Gear's scheme; the rest is for make test-thorough.
QUICK = {("paper", 1.4), ("fast", 2.0), ("gear", 0.5), ("to the pore's end", 8.0)}


@pytest.mark.parametrize("name, end", [
    pytest.param(name, end, marks=[] if (name, end) in QUICK else pytest.mark.thorough)
    for name, (ends, _) in SCENES.items() for end in ends])
def test_a_longer_run_is_as_if_that_had_been_asked_for_at_first(tmp_path, name, end):
    """Bit for bit, twice in a row."""
    whole = scene(name)
    copytree(whole_of(scene(name, end)), tmp_path / "parts")
    for later in (0.5 * (end + whole.growth.end), whole.growth.end):
        resume(tmp_path / "parts", overrides=[f"growth.end={later} h"])
    assert same(tmp_path / "parts", whole_of(whole))
    resumes = told(tmp_path / "parts")["resumes"]
    assert name != "paper" or resumes[0]["time_h"] >= end - 0.4 - 1e-9, "but two steps are not computed again"
    before = [end, 0.5 * (end + whole.growth.end)]
    assert [one["changed"]["growth.end"][0] for one in resumes] == [f"{time:g} h" for time in before]


@pytest.mark.parametrize("after", [1, 3])
def test_a_run_that_is_not_over_is_made_longer(tmp_path, after):
    """Stopped before its end was near and when it was; and a longer one that is stopped goes on."""
    whole, short = (scene("paper, an end within a step", end) for end in (None, 1.2))
    assert [ends_soon(short, state) for state, _ in steps(short)][1:4:2] == [False, True]
    stopped(short, tmp_path, after)
    with pytest.raises(Interrupted):
        resume(tmp_path, overrides=["growth.end=2.2 h"], watch=Watch(stop=every(1)))
    assert told(tmp_path)["tables"]["growth"]["end"] == "2.2 h"
    assert resume(tmp_path) == "completed" and same(tmp_path, whole_of(whole))


def test_a_run_that_is_over_keeps_one_checkpoint(tmp_path):
    """And lists it. Without it a longer one starts again, and says so."""
    grown, still = copytree(whole_of(scene("fast", 2.0)), tmp_path / "run"), whole_of(load_scene("flow_only"))
    assert (grown / LAST).exists() and LAST in told(grown)["files"]
    assert not any((grown / name).exists() for name in (NEWEST, PREVIOUS))
    assert not (still / LAST).exists() and LAST not in told(still)["files"]
    (grown / LAST).unlink()
    with pytest.warns(UserWarning, match="no checkpoint to go on from; it starts again from t = 0"):
        resume(grown, overrides=["growth.end=3 h"])
    assert told(grown)["origin"].get("set") == ["growth.end=3 h"]
    assert same(grown, whole_of(scene("fast")))


@pytest.mark.parametrize("entry, wanted", [
    ("growth.end=1 h", "growth.end = 1 h: 2 h were asked for before; a later time is needed"),
    ("growth.end=2 um", "growth.end = \"2 um\": a time"),
    ("growth.end=1e9 h", "growth.end = \"1e9 h\": at most 100000 times growth.time_step"),
    ("pore.width=3 um", "growth.end alone can be changed of a run that has begun"),
])
def test_what_is_no_later_end_is_refused(entry, wanted):
    """And nothing is changed."""
    shorter = whole_of(scene("fast", 2.0))
    before = state(shorter)
    with pytest.raises(SceneError) as refused:
        resume(shorter, overrides=[entry])
    assert wanted in str(refused.value) and state(shorter) == before


def test_the_command(tmp_path, capsys):
    """The scene of the run says what was set last; the same end again changes nothing; a run without growth has no end,
    and a shorter run that is there is not another one without a word on --resume."""
    out = str(tmp_path / "run")
    asked = ["run", "base", "--set", "numerics.preset=fast", "--set"]
    assert main([*asked, "growth.end=5 h", "--out", out]) == 0
    assert main([*asked, "growth.end=6 h", "--out", out]) == 2
    assert "growth.end (5.0 h there, now 6.0 h); a new folder is needed (--resume makes a run longer)" in (
        capsys.readouterr().err)
    assert main(["run", "--resume", out, "--set", "growth.end=6 h"]) == 0
    assert told(tmp_path / "run")["origin"]["set"] == ["numerics.preset=fast", "growth.end=6 h"]
    capsys.readouterr()
    assert main(["run", "--resume", out, "--set", "growth.end=360 min"]) == 0
    assert "before this: nothing to do" in capsys.readouterr().out
    assert main([*asked, "growth.end=6 h", "--out", out]) == 0
    assert main(["run", "flow_only", "--out", str(tmp_path / "still")]) == 0
    assert main(["run", "--resume", str(tmp_path / "still"), "--set", "growth.end=5 h"]) == 2
    assert "its scene has no [growth]" in capsys.readouterr().err


@pytest.mark.parametrize("preset", ["fast", "paper"])
def test_the_ledger_has_every_step_though_the_rows_end_before(preset, tmp_path):
    """A table with jumps, rows to 1 h, a run to 1.2 h; and so again where the run is made longer."""
    jumps = 'substrates.donor.supply=[["0 h", "10 mg/L"], ["0.5 h", "8 mg/L"], ["0.8 h", "9 mg/L"]]'
    times = ('output.times=["0.5 h", "1 h"]', "growth.end=1.2 h")
    run(load_scene("base", [f"numerics.preset={preset}", jumps, *times]), tmp_path / "run")
    assert read_table(tmp_path / "run" / "ledger.csv")["end_h"][-1] == 1.2
    resume(tmp_path / "run", overrides=["growth.end=1.6 h"])
    spans = read_table(tmp_path / "run" / "ledger.csv")
    assert spans["end_h"][-1] == 1.6 and spans["start_h"][1:] == pytest.approx(spans["end_h"][:-1], abs=1e-9)
