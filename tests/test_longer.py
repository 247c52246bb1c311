"""A run that is made longer: `repro run --resume DIR --set growth.end=LATER`."""

from shutil import copytree

import pytest

from repro import results
from repro.cli import main
from repro.errors import Interrupted
from repro.march.simulation import ends_soon, steps
from repro.preflight.simplifications import Caveat
from repro.results import read_table
from repro.runs import execution, recorder
from repro.runs.checkpoint import LAST, NEWEST, PREVIOUS
from repro.runs.execution import Watch, resume, run
from repro.scene import SceneError, load_scene
from tests.pages import cached_run
from tests.shell import files, interrupt_run, lasting_record, read_record, state, stop_every

#: Ends of the shorter runs (h): in the longer run's first step, in a later step, and near its end; and the scene.
SCENES = {
    "paper": ((0.1, 1.4, 2.1), ["growth.end=2.2 h"]),
    "paper, an end within a step": ((1.0,), ["growth.end=2.2 h", "growth.time_step=21 min"]),
    "fast": ((0.3, 2.0, 2.9), ["numerics.preset=fast", "numerics.tolerance=0.001", "growth.end=3 h"]),
    "fast, rows at times": ((4.0,), ["numerics.preset=fast", "growth.end=9 h", 'output.times=["0 h", "2 h", "3 h"]']),
    "fast, contact": ((0.5,), ["numerics.preset=fast", "growth.end=0.6 h", "aggregate.radius=17.8 um",
                               "pore.width=20 um", "flow.head=1 mm", "numerics.tolerance=0.001",
                               "growth.new_biomass=stress_free"]),
    "gear": ((0.5,), ["growth.end=0.7 h", "numerics.transport=gear"]),
    "fast, bonded": ((3.0,), ["growth.end=5.6 h", "numerics.preset=fast", "growth.wall=bonded"]),
    "fast, weld": ((0.28,), ["numerics.preset=fast", "growth.time_step=3 min", "growth.end=0.34 h",
                            "pore.length=200 um", "pore.width=30 um", "growth.meeting=weld",
                            'aggregate=[{radius="13.98 um"}, {radius="13.98 um", wall="upper"}]']),
    "fast, landing": ((0.4,), ["numerics.preset=fast", "growth.end=0.5 h", "pore.length=200 um", "pore.width=14 um",
                               'aggregate=[{radius="11.7 um", position="-12.8 um"}, '
                               '{radius="8 um", position="9 um"}]']),
    "donor alone": ((0.4,), ["growth.end=1 h", "numerics.refinement=0.5", "substrates={donor={}}"]),
    "to the pore's end": ((8.0,), ["aggregate.radius=40 um", "pore.length=90 um", "growth.time_step=2 h",
                                   "growth.end=9 h", "numerics.refinement=0.5"]),
    "fast, rows closer than those of the longer run": ((4.75,), [
        "numerics.preset=fast", "numerics.tolerance=0.001", "growth.time_step=6 min", "growth.end=10 h"]),
}


def scene(name, end=None):
    return load_scene("base", SCENES[name][1] + ([f"growth.end={end} h"] if end else []))


def same(one, other):
    """Return whether two runs have the same tables, fields, indices and record."""
    left, right = (lasting_record(folder) | {"origin": None, "files": None, "sha256": None} for folder in (one, other))
    return files(one) == files(other) and left == right


#: The paper's scheme, Gear's scheme and one substrate; make test-thorough runs the
#: rest.
QUICK = {("paper", 1.4), ("gear", 0.5), ("donor alone", 0.4), ("to the pore's end", 8.0)}


@pytest.mark.parametrize("name, end", [
    pytest.param(name, end, marks=[] if (name, end) in QUICK else pytest.mark.thorough)
    for name, (ends, _) in SCENES.items() for end in ends])
def test_a_longer_run_equals_an_uninterrupted_one(tmp_path, name, end):
    """A run made longer twice equals the uninterrupted run bit for bit."""
    complete = scene(name)
    copytree(cached_run(scene(name, end)), tmp_path / "parts")
    for later in (0.5 * (end + complete.growth.end), complete.growth.end):
        resume(tmp_path / "parts", overrides=[f"growth.end={later} h"])
    assert same(tmp_path / "parts", cached_run(complete))
    resumes = read_record(tmp_path / "parts")["resumes"]
    assert name != "paper" or resumes[0]["time_h"] >= end - 0.4 - 1e-9, "at most two steps are computed again"
    before = [end, 0.5 * (end + complete.growth.end)]
    assert [one["changed"]["growth.end"][0] for one in resumes] == [f"{time:g} h" for time in before]


def test_a_longer_run_keeps_the_warning_about_its_surface(tmp_path, monkeypatch):
    """The warning has the time at which the crease began."""
    monkeypatch.setattr(recorder, "warn_surface", lambda pore: [Caveat("crease", f"from t = {pore.time:g} h on")])
    run(scene("paper", 1.4), tmp_path)
    resume(tmp_path, overrides=["growth.end=1.8 h"])
    record = read_record(tmp_path)
    assert record["resumes"][0]["time_h"] > 0
    assert [entry["text"] for entry in record["warnings"] if entry["key"] == "crease"] == ["from t = 0 h on"]


@pytest.mark.parametrize("after", [pytest.param(1, marks=pytest.mark.thorough), 3])
def test_an_unfinished_run_is_made_longer(tmp_path, after):
    """The run stops before its last step or in it. A longer run that stops resumes as well."""
    complete, short = (scene("paper, an end within a step", end) for end in (None, 1.2))
    assert [ends_soon(short, state) for state, _ in steps(short)][1:4:2] == [False, True]
    interrupt_run(short, tmp_path, after)
    with pytest.raises(Interrupted):
        resume(tmp_path, overrides=["growth.end=2.2 h"], watch=Watch(stop=stop_every(1)))
    assert read_record(tmp_path)["tables"]["growth"]["end"] == "2.2 h"
    assert resume(tmp_path) == "completed" and same(tmp_path, cached_run(complete))


def test_a_finished_run_keeps_one_checkpoint(tmp_path):
    """The record lists it. Without it a longer run starts again with a warning."""
    with_growth = copytree(cached_run(scene("donor alone", 0.4)), tmp_path / "run")
    without_growth = cached_run(load_scene("flow_only"))
    assert (with_growth / LAST).exists() and LAST in read_record(with_growth)["files"]
    assert not any((with_growth / name).exists() for name in (NEWEST, PREVIOUS))
    assert not (without_growth / LAST).exists() and LAST not in read_record(without_growth)["files"]
    (with_growth / LAST).unlink()
    with pytest.warns(UserWarning, match="no checkpoint to resume from; the run starts again from t = 0"):
        resume(with_growth, overrides=["growth.end=1 h"])
    assert read_record(with_growth)["origin"].get("set") == ["growth.end=1 h"]
    assert same(with_growth, cached_run(scene("donor alone")))


@pytest.mark.parametrize("entry, expected", [
    ("growth.end=12 min", "growth.end = 0.2 h: the run already has the end 0.4 h; give a later one"),
    ("growth.end=2 um", "growth.end = \"2 um\": a time"),
    ("growth.end=1e9 h", "growth.end = \"1e9 h\": at most 100000 times growth.time_step"),
    ("pore.width=3 um", "a run can change growth.end only"),
])
def test_an_entry_without_a_later_end_is_refused(entry, expected):
    """The folder does not change."""
    shorter = cached_run(scene("donor alone", 0.4))
    before = state(shorter)
    with pytest.raises(SceneError) as refused:
        resume(shorter, overrides=[entry])
    assert expected in str(refused.value) and state(shorter) == before


@pytest.mark.thorough
def test_the_command_makes_a_run_longer(tmp_path, capsys):
    """The record has the last setting. The same end changes nothing. A run without growth has no end to change. A
    longer run in the folder of a shorter one is refused with a hint at --resume."""
    out = str(tmp_path / "run")
    command = ["run", "base", "--set", "numerics.preset=fast", "--set"]
    assert main([*command, "growth.end=5 h", "--out", out]) == 0
    assert main([*command, "growth.end=6 h", "--out", out]) == 2
    assert "growth.end (5 h there, now 6 h); give a new folder (--resume makes a run longer)" in (
        capsys.readouterr().err)
    assert main(["run", "--resume", out, "--set", "growth.end=6 h"]) == 0
    assert read_record(tmp_path / "run")["origin"]["set"] == ["numerics.preset=fast", "growth.end=6 h"]
    capsys.readouterr()
    assert main(["run", "--resume", out, "--set", "growth.end=360 min"]) == 0
    assert "already finished" in capsys.readouterr().out
    assert main([*command, "growth.end=6 h", "--out", out]) == 0
    assert main(["run", "flow_only", "--out", str(tmp_path / "still")]) == 0
    assert main(["run", "--resume", str(tmp_path / "still"), "--set", "growth.end=5 h"]) == 2
    assert "its scene has no [growth]" in capsys.readouterr().err


@pytest.mark.parametrize("preset", ["fast", "paper"])
def test_the_ledger_has_every_step_though_the_rows_end_before(preset, tmp_path):
    """The supply jumps, the rows end at 1 h and the run at 1.2 h. The same holds once the run is made longer."""
    jumps = 'substrates.donor.supply=[["0 h", "10 mg/L"], ["0.5 h", "8 mg/L"], ["0.8 h", "9 mg/L"]]'
    times = ('output.times=["0.5 h", "1 h"]', "growth.end=1.2 h")
    run(load_scene("base", [f"numerics.preset={preset}", jumps, *times]), tmp_path / "run")
    assert read_table(tmp_path / "run" / "ledger.csv")["end_h"][-1] == 1.2
    resume(tmp_path / "run", overrides=["growth.end=1.6 h"])
    spans = read_table(tmp_path / "run" / "ledger.csv")
    assert spans["end_h"][-1] == 1.6 and spans["start_h"][1:] == pytest.approx(spans["end_h"][:-1], abs=1e-9)


def test_a_longer_run_is_judged_by_its_first_velocity(tmp_path):
    recorder = execution.Recorder(load_scene("base"), tmp_path)
    column = results.COLUMNS.index("mean_velocity_m_per_d")
    recorder.history.rows = [[None] * column + [speed] for speed in (24.0, 0.024)]
    assert recorder.first_velocity == pytest.approx(1e6, rel=1e-12)
