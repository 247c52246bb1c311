"""The progress of a run: on a terminal, without one, as JSON, and with --quiet."""

import fcntl
import json
import os
import pty
import re
import signal
import struct
import subprocess
import sys
import termios
import time
from contextlib import nullcontext, suppress

import pytest
import tqdm
from tqdm import tqdm as Bar

from repro.cli import main
from repro.model import growth
from repro.preflight import resolved
from repro.runs import progress
from repro.runs.interrupts import catch_signals
from repro.scene import load_scene
from tests.pages import run
from tests.shell import flags, read_record, start_run

CONTACT = ('numerics.preset="fast"', 'aggregate.radius="17.98 um"', 'pore.width="20 um"', 'growth.end="0.6 h"',
           "numerics.tolerance=0.0001")


def test_json_output_is_one_object_a_line(tmp_path, capsys):
    """Events are start, steps, remeshes, contact, checkpoints and end; steps between rows have theirs, too.
    tests/test_warned.py tests warnings."""
    folder = run(tmp_path, "base", *CONTACT, 'output.times=["0.6 h"]', options=["--json", "--checkpoint", "0"])
    events = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    names = [event["event"] for event in events]
    assert names[0] == "start" and names[-1] == "end" and names.count("contact") == 1
    steps = [event for event in events if event["event"] == "step"]
    assert [event["step"] for event in steps] == list(range(len(steps))) and steps[-1]["time_h"] == 0.6
    made = [event["remeshes"] for event in events if event["event"] == "remesh"]
    assert made == [*range(1, read_record(folder)["remeshes"] + 1)] and steps[-1]["remeshes"] == made[-1]
    assert steps[-2]["remeshes"] > 0 and names.count("checkpoint") >= len(steps) > events[-1]["rows"] == 2
    assert read_record(folder)["rows"] == 2
    assert steps[-1]["contact"] and not steps[0]["contact"]
    assert events[-1]["status"] == "completed" and events[-1]["folder"] == str(folder)


@pytest.mark.parametrize("sets, status", [(["pore.width=5 s"], 2), ([], 1)])
def test_errors_are_json_objects(tmp_path, capsys, monkeypatch, sets, status):
    """The object has the exit status and the message of the standard error."""
    monkeypatch.setattr(growth, "MOST_ITERATIONS", 1)
    run(tmp_path, "base", *sets, status=status, options=["--json"])
    out, err = capsys.readouterr()
    last = json.loads(out.splitlines()[-1])
    assert last["event"] == "error" and last["exit_status"] == status and err == f"repro: {last['message']}\n"


def test_lines_without_a_terminal_report_each_tenth_and_quiet_only_errors(tmp_path, capsys, monkeypatch):
    """The last line goes to standard output. The lines do not depend on the speed of the machine."""
    monkeypatch.setattr(progress, "SILENCE", 1000.0)
    folder = run(tmp_path, "base", 'growth.end="0.6 h"')
    expected = "".join(f"{time} of 0.6 h simulated\n" for time in ("0.2", "0.4", "0.6"))
    assert capsys.readouterr() == (f"base: completed; results in {folder}\n", expected)
    run(tmp_path / "quiet", "flow_only", options=["--quiet"])
    assert capsys.readouterr() == ("", "")
    run(tmp_path, "nowhere", status=2, options=["--quiet"])
    assert "nowhere" in capsys.readouterr().err


STEP = {"event": "step", "time_h": 3.5, "end_h": 45.0, "step": 17, "remeshes": 2, "contact": True}


def test_a_long_step_is_not_silent(capsys, monkeypatch):
    """Without a terminal, lines during a long step are at most two seconds apart."""
    assert progress.SILENCE + progress.TICK <= 2.0
    monkeypatch.setattr(progress, "TICK", 0.01)
    monkeypatch.setattr(progress, "SILENCE", 0.02)
    with progress.in_lines() as tell:
        tell(STEP)
        lines, deadline = "", time.monotonic() + 20
        while lines.count("\n") < 3 and time.monotonic() < deadline:
            lines += capsys.readouterr().err
            time.sleep(0.01)
    capsys.readouterr()
    assert re.fullmatch(r"(3\.5 of 45 h simulated, step 17, contact, \d+ s\n){3,}", lines)
    time.sleep(0.1)
    assert capsys.readouterr() == ("", "")


@pytest.mark.thorough
@pytest.mark.parametrize("columns, pattern", [
    (60, r"base 0\.6/0\.6 h \d\d:\d\d<\d\d:\d\d, step \d+, mesh \d, contact *"),
    (120, r".*base 100%\|.*\| 0\.6 of 0\.6 h \[\d\d:\d\d < \d\d:\d\d, step \d+, remeshes \d, contact\].*"),
])
def test_a_terminal_shows_a_bar(tmp_path, columns, pattern):
    """The bar has simulated time, steps, remeshes, contact and the remaining time, and fits in sixty columns."""
    master, terminal = pty.openpty()
    fcntl.ioctl(terminal, termios.TIOCSWINSZ, struct.pack("HHHH", 40, columns, 0, 0))
    arguments = ("base", *flags(*CONTACT), "--out", tmp_path / "run")
    process = start_run(*arguments, stdout=terminal, stderr=terminal, text=False)
    os.close(terminal)
    output = b""
    with suppress(OSError):  # the other end is closed
        while chunk := os.read(master, 4096):
            output += chunk
    os.close(master)
    process.wait()
    last = [bar for bar in re.split(r"[\r\n]+", output.decode()) if " h " in bar and "contact" in bar][-1]
    assert re.fullmatch(pattern, last) and len(last) <= columns and b"simulated" not in output


@pytest.mark.parametrize("arguments", [[], ["base"], ["--out", "x"], ["base", "--resume", "x"], ["--checkpoint", "-1"],
                                       ["--resume", "x", "--set", "a=1"],
                                       ["--resume", "x", "--force"], ["--resume", "x", "--unset", "growth"],
                                       ["base", "--out", "x", "--checkpoint", "?"]])
def test_conflicting_arguments_are_refused(capsys, arguments):
    with pytest.raises(SystemExit) as refused:
        main(["run", *arguments])
    assert refused.value.code == 2 and "usage: repro run" in capsys.readouterr().err


@pytest.mark.parametrize("arguments", [["run", "base", "--out", ""], ["run", "--resume", ""],
                                       ["sweep", "base", "--vary", "pore.width=40 um, 50 um", "--out", ""],
                                       ["compare", "a", "", "--out", "b.html"], ["compare", "a", "b", "--out", ""]])
def test_an_empty_path_is_not_the_present_folder(tmp_path, monkeypatch, capsys, arguments):
    """An unset variable of the shell makes an empty path; results must not go into the present folder."""
    monkeypatch.chdir(tmp_path)
    with pytest.raises(SystemExit) as refused:
        main(arguments)
    assert refused.value.code == 2 and "a path is needed, this one is empty" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


def test_signals_are_caught_and_handlers_are_restored():
    """A signal that is ignored, as under nohup, stays ignored."""
    handler, before = signal.signal(signal.SIGINT, signal.SIG_IGN), signal.getsignal(signal.SIGTERM)
    with catch_signals() as received:
        os.kill(os.getpid(), signal.SIGINT)
        time.sleep(0.05)
        assert received() == 0
        for _ in range(2):  # the second one at once: the same request
            os.kill(os.getpid(), signal.SIGTERM)
            deadline = time.monotonic() + 10
            while not received() and time.monotonic() < deadline:
                time.sleep(0.001)
        assert received() == signal.SIGTERM
    assert (signal.signal(signal.SIGINT, handler), signal.getsignal(signal.SIGTERM)) == (signal.SIG_IGN, before)
    assert not signal.pthread_sigmask(signal.SIG_BLOCK, ())


@pytest.mark.thorough
@pytest.mark.parametrize("closed, options", [("stdout", ["--json"]), ("stdout", []), ("stderr", [])])
def test_a_run_goes_on_after_its_reader_closes(tmp_path, closed, options):
    """The reader of standard output or standard error closes its pipe; the run goes on to its end."""
    process = start_run("base", "--set", 'numerics.preset="fast"', "--out", tmp_path / "run", *options)
    getattr(process, closed).close()
    stream = process.stderr if closed == "stdout" else process.stdout
    message = stream.read()
    stream.close()
    assert process.wait(60) == 0 and "Traceback" not in message and "BrokenPipe" not in message
    assert closed == "stdout" or "completed" in message
    assert read_record(tmp_path / "run")["status"] == "completed"


def test_the_help_lists_the_exit_statuses(capsys):
    signals = ["130", "143", "129", "138", "140"]
    for command, statuses in (("run", ["0", "1", "2", *signals]), ("sweep", ["0", "3", "2", *signals])):
        with pytest.raises(SystemExit):
            main([command, "--help"])
        section = capsys.readouterr().out.casefold().partition("exit status:")[2]
        assert re.findall(r"\b\d+\b", section) == statuses


def test_the_remaining_time_follows_from_the_speed_since_a_resume(monkeypatch):
    """After a resume at 18 of 20 h, 1 h in 10 s leaves 10 s."""
    monkeypatch.setattr(progress, "_fit", lambda bar, event: None)
    bars = []
    monkeypatch.setattr(tqdm, "tqdm", lambda **options: bars.append(Bar(**options)) or bars[0])
    with progress.on_a_terminal() as tell:
        tell({"event": "start", "scene": "base", "from_h": 18.0, "end_h": 20.0, "step": 90})
        tell({"event": "step", "time_h": 19.0})
        assert Bar.format_meter(**bars[0].format_dict | {"elapsed": 10.0, "rate": None}).endswith("[00:10 < 00:10]")


def test_a_second_signal_ends_the_process_with_the_signal_s_status():
    """The status is 128 plus the number of the signal, as in shells."""
    code = ("import os, signal, time\nfrom repro.runs.interrupts import DUPLICATE, catch_signals\n"
            "with catch_signals():\n    for _ in range(2):\n        os.kill(os.getpid(), signal.SIGTERM)\n"
            "        time.sleep(DUPLICATE + 0.2)")
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 128 + signal.SIGTERM


OUTLINE = {"pore": {"width": "50 um"}, "flow": {"head": "1e-3 cm"}, "substrates": {}, "growth": {"end": "1 h"},
           "aggregate": {"outline": [["-6 um", "0 um"], ["-5 um", "6 um"], ["4 um", "7 um"], ["6 um", "0 um"]]}}


def test_a_check_reports_between_its_stages_without_its_thread(tmp_path, capsys, monkeypatch):
    """A mesh and a head loss take 1.5 s on a fake clock, and the thread never has its turn. The lines are less than
    two seconds apart: after each of the first mesh and the meshes of the flow there is one."""
    clock = [0.0]
    meshes = []

    def slow(computing):
        def call(*arguments, **keys):
            result = computing(*arguments, **keys)
            clock[0] += 1.5
            meshes.append(clock[0])
            return result
        return call

    monkeypatch.setattr(progress, "monotonic", lambda: clock[0])
    monkeypatch.setattr(progress, "_call_regularly", lambda tick: nullcontext())
    monkeypatch.setattr(resolved, "seeded", slow(resolved.seeded))
    monkeypatch.setattr(resolved.solving.Solver, "solve_flow", slow(resolved.solving.Solver.solve_flow))
    scene = tmp_path / "scene.toml"
    scene.write_text(str(load_scene(OUTLINE)))
    main(["check", "--no-run", str(scene)])
    lines = [int(seconds) for seconds in re.findall(r", (\d+) s", capsys.readouterr().err)]
    times = [0, *lines, int(clock[0])]
    assert len(meshes) >= 5
    assert max(later - earlier for earlier, later in zip(times, times[1:])) <= 2, times
