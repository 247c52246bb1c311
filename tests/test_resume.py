"""Runs that are interrupted, killed or have failed go on as if nothing had happened, to the last bit."""

import random
import signal
from contextlib import suppress
from dataclasses import replace
from subprocess import TimeoutExpired

import pytest

from repro import results
from repro.cli import main
from repro.errors import Interrupted, SimulationError
from repro.march import loop
from repro.march.loop import PoreEnd
from repro.march.simulation import simulate, steps
from repro.model import growth
from repro.run.checkpoint import NEWEST, PREVIOUS
from repro.run.running import Watch, resume, run
from repro.scene import load_scene
from repro.sweep import task
from tests import faults
from tests.shell import LONG, SHORT, as_whole, every, files, lasting, shell, started, stopped, told, wait_for

CONTACT = ('aggregate.radius="17.98 um"', 'pore.width="20 um"', 'growth.end="0.6 h"')
SCENES = {
    "paper, unreported steps": ('growth.end="1 h"', 'output.times=["0.3 h", "1 h"]'),
    "fast": ('numerics.preset="fast"', "numerics.tolerance=0.0005", 'aggregate.radius="25 um"', 'growth.end="3 h"'),
    "fast, rows within steps": ('numerics.preset="fast"', 'growth.end="9.7 h"'),
    "fast, jumps": ('numerics.preset="fast"', 'growth.end="0.8 h"', 'substrates.donor.supply='
                    '[["0 h", "10 mg/L"], ["0.3 h", "0 mg/L"], ["0.5 h", "20 mg/L"]]'),
    "paper, rows within steps": ('growth.end="0.7 h"', 'output.times=["0.05 h", "0.1 h", "0.4 h", "0.47 h"]'),
    "fast, unreported steps, contact": ('numerics.preset="fast"', "numerics.tolerance=0.0001", *CONTACT,
                                        'output.times=["0.6 h"]'),
    "gear": ('numerics.transport="gear"', 'growth.end="0.4 h"'),
    "cubic, contact": ('numerics.preset="fast"', 'numerics.elements="cubic"', "numerics.tolerance=0.0005", *CONTACT),
}
MORE = {
    "paper": ('growth.end="6 h"',),
    "accurate": ('numerics.preset="accurate"', 'growth.end="4 h"'),
    "cubic": ('numerics.preset="fast"', 'numerics.elements="cubic"', "numerics.tolerance=0.0005", 'growth.end="4 h"'),
    "contact": CONTACT,
    "stress-free": ('growth.new_biomass="stress_free"', *CONTACT),
    "linear midpoint": ('numerics.time="midpoint"', "numerics.tolerance=0.0001", 'numerics.transfer="linear"',
                        *CONTACT),
    "forces": ('growth.fluid_forces="included"', 'growth.end="0.6 h"'),
    "rechosen": ('numerics.fixed_point="rechosen"', *CONTACT),
    "quadratic updates": ('numerics.elements="quadratic"', "numerics.refinement=0.4", *CONTACT),
    "quadratic gear": ('numerics.elements="quadratic"', "numerics.refinement=0.3", 'numerics.transport="gear"',
                       'growth.end="0.6 h"'),
    "cubic, stress-free": ('numerics.elements="cubic"', "numerics.refinement=0.3",
                           'growth.new_biomass="stress_free"', *CONTACT),
    "quadratic forces": ('numerics.elements="quadratic"', "numerics.refinement=0.3",
                         'growth.fluid_forces="included"', 'growth.end="0.6 h"'),
}


THREE_HOURS = load_scene("base", ('numerics.preset="fast"', 'growth.end="3 h"'))


def in_parts(scene, folder, count):
    """Run a scene with a stop at each so-manieth step; how often it was gone on with."""
    watch, resumes = Watch(stop=every(count)), 0
    try:
        run(scene, folder, watch=watch)
    except Interrupted:
        while True:
            resumes += 1
            try:
                resume(folder, watch=watch)
                break
            except Interrupted:
                pass
    return resumes


@pytest.mark.parametrize("name", [*SCENES, *(pytest.param(name, marks=pytest.mark.thorough) for name in MORE)])
def test_a_run_stopped_after_every_step_is_the_whole_run(tmp_path, name):
    """Tables, fields, indices, status and counts, and no warning."""
    scene = load_scene("base", {**SCENES, **MORE}[name])
    run(scene, tmp_path / "whole")
    resumes = in_parts(scene, tmp_path / "parts", 1)
    assert resumes == len(told(tmp_path / "parts")["resumes"]) >= 3
    assert files(tmp_path / "parts") == files(tmp_path / "whole")
    assert lasting(tmp_path / "parts") == lasting(tmp_path / "whole")
    assert not {NEWEST, PREVIOUS, ".lock"} & files(tmp_path / "parts").keys()


def test_simulate_goes_on_from_any_state():
    """The same instants as those of the whole run after it."""
    scene = load_scene("base", SCENES["fast"])
    whole = list(steps(scene))
    for k in (0, 2, len(whole) - 1):
        found, expected = list(simulate(scene, state=whole[k][0])), [instant for _, instant in whole[k + 1:] if instant]
        assert [i.pore.time for i in found] == [i.pore.time for i in expected]
        assert [results.row(scene, i) for i in found] == [results.row(scene, i) for i in expected]


@pytest.mark.parametrize("elements", ["linear", "quadratic", "cubic"])
def test_states_have_no_strided_arrays(elements):
    """Sums over strided views may differ in the last bit from those over what a checkpoint gives back."""
    sets = (f"numerics.elements={elements}", "numerics.refinement=0.4", *CONTACT)
    for state, _ in steps(load_scene("base", sets)):
        for data in (state.pore, state.pore.mesh, state.pore.body, state.pore.concentrations):
            arrays = [value for value in vars(data or object).values() if hasattr(value, "flags")]
            assert all(array.flags.forc for array in arrays)


def test_strided_arrays_are_copied():
    """Of the pore, its mesh and its body at t = 0; what has none is left as it is."""
    scene = load_scene("base", ('growth.end="0 h"',))
    ((_, instant),) = steps(scene)
    now = instant.pore
    assert loop.laid_out(now).mesh is now.mesh and loop.laid_out(now).body is now.body

    def strided(array):
        return array.repeat(2, axis=-1)[..., ::2]

    mesh = replace(now.mesh, points=strided(now.mesh.points))
    body = replace(now.body, reference=strided(now.body.reference))
    found = loop.laid_out(replace(now, active=strided(now.active), space=replace(now.space, mesh=mesh), body=body))
    for one, other in ((found.active, now.active), (found.mesh.points, now.mesh.points),
                       (found.body.reference, now.body.reference), (found.origin, now.origin)):
        assert one.flags.c_contiguous and (one == other).all()


def test_the_end_of_the_pore_is_an_end_after_a_resume_too(tmp_path):
    """A run stopped just when it was over does not grow on."""
    scene = load_scene("wide", ('numerics.preset="fast"', 'aggregate.radius="40 um"', 'pore.length="100 um"',
                                'growth.end="9 h"'))
    with pytest.raises(PoreEnd):
        found = []
        for state, _ in steps(scene):
            found.append(state)
    with pytest.raises(PoreEnd):
        next(steps(scene, found[-1]))
    assert "reaches the pore's" in run(scene, tmp_path / "whole")
    in_parts(scene, tmp_path / "parts", len(found))
    assert lasting(tmp_path / "parts") == lasting(tmp_path / "whole")


@pytest.mark.parametrize("content", [None, "{", "[]", "null", '{"scene": "x"}', "[" * 100_000,
                                     '{"scene": "x", "hash": "0", "tables": {}, "status": "running"}',
                                     '{"scene": "x", "hash": "0", "tables": {}, "status": "sunning"}',
                                     '{"scene": "x", "hash": "0", "tables": {"pore": 3}, "status": "running"}'])
def test_a_folder_without_a_run_is_refused(tmp_path, capsys, content):
    """With status 2 and one line, and nothing is written."""
    folder = tmp_path / "nowhere" if content is None else tmp_path
    if content is not None:
        (tmp_path / "run.json").write_text(content)
    assert main(["run", "--resume", str(folder)]) == 2
    message = capsys.readouterr().err
    assert ("there is no run.json" if content is None else "run.json") in message and message.count("\n") == 1
    assert files(tmp_path) == {} and not (tmp_path / "nowhere").exists()


@pytest.mark.parametrize("status", ["sunning", "", "Completed", "completed ", "failed", "runningly", "interrupted?"])
def test_a_status_that_no_run_writes_is_none(tmp_path, capsys, status):
    """Neither finished nor to be gone on with."""
    run(load_scene("flow_only"), tmp_path / "run")
    record = told(tmp_path / "run")
    results.write_json(tmp_path / "run" / "run.json", record | {"status": status})
    before = files(tmp_path / "run")
    assert main(["run", "--resume", str(tmp_path / "run")]) == 2
    assert f"its status {status!r} is none that a run writes" in (message := capsys.readouterr().err)
    assert message.count("\n") == 1 and files(tmp_path / "run") == before and not task.finished(tmp_path / "run")


def test_an_altered_checkpoint_is_refused_and_the_one_before_is_used(tmp_path, capsys):
    """And the result is the same."""
    stopped(THREE_HOURS, tmp_path / "run")
    newest = tmp_path / "run" / NEWEST
    good = newest.read_bytes()
    newest.write_bytes(good[:-1] + bytes([good[-1] ^ 1]))
    assert main(["run", "--resume", str(tmp_path / "run"), "--quiet"]) == 0
    message = capsys.readouterr().err
    assert f"{NEWEST}: refused: its checksum is wrong" in message and "t = 0" not in message
    assert as_whole(THREE_HOURS, tmp_path / "run")
    assert told(tmp_path / "run")["resumes"][0]["time_h"] > 0


def test_without_a_good_checkpoint_a_run_starts_again_and_says_so(tmp_path, capsys):
    stopped(THREE_HOURS, tmp_path / "run")
    for name in (NEWEST, PREVIOUS):
        path = tmp_path / "run" / name
        path.write_bytes(path.read_bytes()[:1000])
    assert main(["run", "--resume", str(tmp_path / "run"), "--quiet"]) == 0
    message = capsys.readouterr().err
    assert message.count("refused: its checksum is wrong") == 2 and "starts again from t = 0" in message
    assert as_whole(THREE_HOURS, tmp_path / "run")


def test_a_checkpoint_without_its_fields_is_refused(tmp_path):
    stopped(THREE_HOURS, tmp_path / "run")
    (tmp_path / "run" / "fields" / "fields_0001.vtu").unlink()
    with pytest.warns(UserWarning) as warned:
        resume(tmp_path / "run")
    assert ["fields_0001.vtu is not as it was written" in str(w.message) for w in warned] == [True, True, False]


def test_a_change_of_versions_is_told_and_recorded(tmp_path, monkeypatch):
    stopped(THREE_HOURS, tmp_path / "run")
    faults.another_version(monkeypatch, "scipy")
    with pytest.warns(UserWarning, match="versions.scipy .* now 0.0.; .* to the last bit"):
        resume(tmp_path / "run")
    (once,) = told(tmp_path / "run")["resumes"]
    assert once["changed"]["versions.scipy"][1] == "0.0" and len(once["changed"]) == 1


def test_the_machine_is_recorded_and_threads_are_no_change(tmp_path, monkeypatch, recwarn):
    stopped(THREE_HOURS, tmp_path / "run")
    found = told(tmp_path / "run")["conditions"]
    assert found["machine"] and found["blas"] and len(found["source"]) == 8
    assert found["threads"].get("OMP_NUM_THREADS") != "7"
    monkeypatch.setenv("OMP_NUM_THREADS", "7")
    resume(tmp_path / "run")
    assert told(tmp_path / "run")["conditions"]["threads"]["OMP_NUM_THREADS"] == "7" and not recwarn.list


def test_a_failure_says_where_the_last_good_state_is(tmp_path, monkeypatch):
    """Time, stage, why, what to change, and a state from which the run goes on when the cause is gone."""
    scene, most = load_scene("base", ('growth.end="0.8 h"',)), growth.MOST_ITERATIONS

    def fail_late(event):
        if event["event"] == "step" and event["time_h"] >= 0.4:
            monkeypatch.setattr(growth, "MOST_ITERATIONS", 1)

    with pytest.raises(SimulationError) as failed:
        run(scene, tmp_path / "run", watch=Watch(tell=fail_late))
    message = str(failed.value)
    for part in ("step from t = 0.4 h", "in growth", "try ", f"the last good state, t = 0.4 h, is in {tmp_path}",
                 "fields/fields_0002.vtu"):
        assert part in message
    assert told(tmp_path / "run")["status"] == f"failed: {message}"
    monkeypatch.setattr(growth, "MOST_ITERATIONS", most)
    assert resume(tmp_path / "run") == "completed"
    assert as_whole(scene, tmp_path / "run")


def test_results_reach_the_disk_while_a_run_goes_on(tmp_path):
    """Tables and run.json at every checkpoint."""
    seen = []

    def look(event):
        if event["event"] == "checkpoint":
            rows = (tmp_path / "run" / "timeseries.csv").read_text().count("\n") - 1
            seen.append((told(tmp_path / "run")["status"], rows, len(list((tmp_path / "run" / "fields").iterdir()))))

    scene = load_scene("base", SCENES["fast"])
    run(scene, tmp_path / "run", watch=Watch(tell=look, interval=0.0))
    assert seen == [("running", count, count) for count in range(1, len(seen) + 1)] and len(seen) > 4


@pytest.mark.parametrize("number", [signal.SIGTERM, pytest.param(signal.SIGINT, marks=pytest.mark.thorough)])
def test_signals_end_a_run_that_goes_on_later(tmp_path, number):
    """Status 128 + number, one line, results so far; then to the end with the bits of the whole run."""
    process = started("base", "--set", 'growth.end="1.6 h"', "--out", tmp_path / "run")
    wait_for((tmp_path / "run" / "fields" / "fields_0002.vtu").exists, process)
    process.send_signal(number)
    message = process.communicate(timeout=60)[1]
    assert process.returncode == 128 + number and message.endswith("goes on from there\n")
    assert "Traceback" not in message and told(tmp_path / "run")["status"] == "interrupted"
    assert len((tmp_path / "run" / "timeseries.csv").read_text().splitlines()) > 3
    assert resume(tmp_path / "run") == "completed"
    assert as_whole(load_scene("base", ('growth.end="1.6 h"',)), tmp_path / "run")


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """The results of LONG, uninterrupted."""
    folder = tmp_path_factory.mktemp("whole") / "run"
    assert shell(*LONG, "--out", folder)[0] == 0
    return folder


@pytest.mark.thorough
def test_killed_at_twenty_moments(tmp_path, whole):
    """SIGKILL at seeded random moments of a run with checkpoints every 0.2 s, from its start to its end, then resumed:
    the bits of the whole run, each time."""
    seconds, gone_on = told(whole)["wall_time_s"], 0
    draw = random.Random(5)
    for k in range(20):
        out = tmp_path / str(k)
        process = started(*LONG, "--out", out, "--checkpoint", "0.2")
        wait_for((out / "run.json").exists, process)
        with suppress(TimeoutExpired):
            process.wait(draw.uniform(0, seconds))
        process.kill()
        process.communicate()
        gone_on += (out / NEWEST).exists()
        status, _, message = shell("--resume", out)
        assert status == 0, message
        assert files(out) == files(whole) and lasting(out) == lasting(whole)
    assert gone_on >= 10, "else little is tested"


def written(path):
    """When a file was written, in ns; zero where there is none."""
    with suppress(FileNotFoundError):
        return path.stat().st_mtime_ns
    return 0


def test_a_run_killed_at_its_very_end_is_tidied(tmp_path):
    """Its status told, its page and its checkpoints not seen to."""
    run(load_scene("flow_only"), tmp_path)
    page = (tmp_path / "report.html").read_bytes()
    (tmp_path / "report.html").unlink()
    (tmp_path / PREVIOUS).write_bytes(b"whatever")
    assert resume(tmp_path) == "completed"
    assert (tmp_path / "report.html").read_bytes() == page and not (tmp_path / PREVIOUS).exists()


@pytest.mark.thorough
def test_killed_again_and_again(tmp_path, whole):
    """Each time a little further, until it is done."""
    out, draw = tmp_path / "run", random.Random(7)
    status, last = None, 0
    arguments = [*LONG, "--out", out]
    for _ in range(40):
        process = started(*arguments, "--checkpoint", "0.1")
        wait_for(lambda last=last: written(out / NEWEST) > last, process)
        with suppress(TimeoutExpired):
            status = process.wait(draw.uniform(0, 0.5))
        last = written(out / NEWEST)
        process.kill()
        process.communicate()
        if status is not None:
            break
        arguments = ["--resume", out]
    assert status == 0 and len(told(out)["resumes"]) > 1
    assert files(out) == files(whole) and lasting(out) == lasting(whole)


@pytest.mark.thorough
@pytest.mark.parametrize("scene", [SHORT, LONG])
def test_one_thread_or_two(tmp_path, scene):
    """The same bits."""
    for threads in ("1", "2"):
        assert shell(*scene, "--out", tmp_path / threads, threads=threads)[0] == 0
    assert files(tmp_path / "1") == files(tmp_path / "2")
    assert told(tmp_path / "2")["conditions"]["threads"]["OMP_NUM_THREADS"] == "2"
