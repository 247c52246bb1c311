"""What a run says: to a person on a terminal, elsewhere, to machines, and when it is to be quiet."""

import fcntl
import json
import os
import pty
import re
import signal
import struct
import termios
import time
from contextlib import suppress

import pytest

from repro.cli import main
from repro.model import growth
from repro.runs import progress
from repro.runs.interrupts import noted
from tests.pages import run
from tests.shell import flags, started, told

CONTACT = ('numerics.preset="fast"', 'aggregate.radius="17.98 um"', 'pore.width="20 um"', 'growth.end="0.6 h"',
           "numerics.tolerance=0.0001")


def test_steps_between_rows_are_told_with_what_they_made(tmp_path, capsys):
    run(tmp_path, "base", *CONTACT, 'output.times=["0.6 h"]', options=["--json"])
    events = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    steps = [event["remeshes"] for event in events if event["event"] == "step"]
    assert [event["remeshes"] for event in events if event["event"] == "remesh"] == [*range(1, steps[-1] + 1)]
    assert steps[-2] > 0


def test_json_is_an_object_a_line_and_nothing_else(tmp_path, capsys):
    """Start, every step, remeshes, contact, checkpoints, end; warnings are in tests/test_warned.py."""
    folder = run(tmp_path, "base", *CONTACT, options=["--json", "--checkpoint", "0"])
    events = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    names = [event["event"] for event in events]
    assert names[0] == "start" and names[-1] == "end" and names.count("contact") == 1
    steps = [event for event in events if event["event"] == "step"]
    assert [event["step"] for event in steps] == list(range(len(steps))) and steps[-1]["time_h"] == 0.6
    assert names.count("remesh") == steps[-1]["remeshes"] == told(folder)["remeshes"] > 0
    assert names.count("checkpoint") == events[-1]["rows"] == told(folder)["rows"] > len(steps)
    assert steps[-1]["contact"] and not steps[0]["contact"]
    assert events[-1]["status"] == "completed" and events[-1]["folder"] == str(folder)


@pytest.mark.parametrize("sets, status", [(["pore.width=5 s"], 2), ([], 1)])
def test_errors_are_objects_too(tmp_path, capsys, monkeypatch, sets, status):
    """With the exit status and the message that people get."""
    monkeypatch.setattr(growth, "MOST_ITERATIONS", 1)
    run(tmp_path, "base", *sets, status=status, options=["--json"])
    out, err = capsys.readouterr()
    last = json.loads(out.splitlines()[-1])
    assert last["event"] == "error" and last["exit_status"] == status and err == f"repro: {last['message']}\n"


def test_without_a_terminal_a_line_each_tenth_and_quiet_says_nothing_but_errors(tmp_path, capsys, monkeypatch):
    """The end on standard output; however slow the machine is."""
    for name in ("SILENCE", "LONGEST"):
        monkeypatch.setattr(progress, name, 1000.0)
    folder = run(tmp_path, "base", 'growth.end="0.6 h"')
    said = "".join(f"{time} of 0.6 h simulated\n" for time in ("0.2", "0.4", "0.6"))
    assert capsys.readouterr() == (f"base: completed; results in {folder}\n", said)
    run(tmp_path / "quiet", "flow_only", options=["--quiet"])
    assert capsys.readouterr() == ("", "")
    run(tmp_path, "nowhere", status=2, options=["--quiet"])
    assert "nowhere" in capsys.readouterr().err


STEP = {"event": "step", "time_h": 3.5, "end_h": 45.0, "step": 17, "remeshes": 2, "contact": True}


def test_a_long_step_is_not_silent(capsys, monkeypatch):
    """Without a terminal lines go on coming while a step takes its time, never two seconds apart."""
    assert progress.LONGEST + progress.TICK <= 2.0
    monkeypatch.setattr(progress, "TICK", 0.01)
    monkeypatch.setattr(progress, "LONGEST", 0.02)
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


@pytest.mark.parametrize("columns, pattern", [
    pytest.param(60, r"base 0\.6/0\.6 h \d\d:\d\d<\d\d:\d\d, step \d+, mesh \d, contact *", marks=pytest.mark.thorough),
    (120, r".*base 100%\|.*\| 0\.6 of 0\.6 h \[\d\d:\d\d < \d\d:\d\d, step \d+, remeshes \d, contact\].*"),
])
def test_on_a_terminal_a_bar(tmp_path, columns, pattern):
    """Simulated time, steps, remeshes, contact and the time that is left; sixty columns are enough."""
    here, there = pty.openpty()
    fcntl.ioctl(there, termios.TIOCSWINSZ, struct.pack("HHHH", 40, columns, 0, 0))
    process = started("base", *flags(*CONTACT), "--out", tmp_path / "run", stdout=there, stderr=there, text=False)
    os.close(there)
    seen = b""
    with suppress(OSError):  # the other end is closed
        while some := os.read(here, 4096):
            seen += some
    os.close(here)
    process.wait()
    last = [bar for bar in re.split(r"[\r\n]+", seen.decode()) if " h " in bar and "contact" in bar][-1]
    assert re.fullmatch(pattern, last) and len(last) <= columns and b"simulated" not in seen


@pytest.mark.parametrize("arguments", [[], ["base"], ["--out", "x"], ["base", "--resume", "x"], ["--checkpoint", "-1"],
                                       ["--resume", "x", "--set", "a=1"],
                                       ["--resume", "x", "--force"], ["--resume", "x", "--unset", "growth"],
                                       ["base", "--out", "x", "--checkpoint", "?"]])
def test_arguments_that_do_not_go_together_are_refused(capsys, arguments):
    with pytest.raises(SystemExit) as refused:
        main(["run", *arguments])
    assert refused.value.code == 2 and "usage: repro run" in capsys.readouterr().err


@pytest.mark.parametrize("arguments", [["run", "base", "--out", ""], ["run", "--resume", ""],
                                       ["sweep", "base", "--vary", "pore.width=40 um, 50 um", "--out", ""],
                                       ["compare", "a", "", "--out", "b.html"], ["compare", "a", "b", "--out", ""]])
def test_an_empty_path_is_not_the_present_folder(tmp_path, monkeypatch, capsys, arguments):
    """As of a shell's variable that is not set: the results would lie among what is there."""
    monkeypatch.chdir(tmp_path)
    with pytest.raises(SystemExit) as refused:
        main(arguments)
    assert refused.value.code == 2 and "a path is needed, this one is empty" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


def test_signals_are_noted_and_everything_is_as_before():
    """One that is ignored, as under nohup, stays so."""
    kept, before = signal.signal(signal.SIGINT, signal.SIG_IGN), signal.getsignal(signal.SIGTERM)
    with noted() as came:
        os.kill(os.getpid(), signal.SIGINT)
        time.sleep(0.05)
        assert came() == 0
        for _ in range(2):  # the second one at once: the same request
            os.kill(os.getpid(), signal.SIGTERM)
            deadline = time.monotonic() + 10
            while not came() and time.monotonic() < deadline:
                time.sleep(0.001)
        assert came() == signal.SIGTERM
    assert (signal.signal(signal.SIGINT, kept), signal.getsignal(signal.SIGTERM)) == (signal.SIG_IGN, before)
    assert not signal.pthread_sigmask(signal.SIG_BLOCK, ())


@pytest.mark.parametrize("deaf, options", [("stdout", ["--json"]), ("stdout", []), ("stderr", [])])
def test_nobody_listens(tmp_path, deaf, options):
    """What reads the output, or what is said aside, goes away: the run goes on to its end."""
    process = started("base", "--set", 'numerics.preset="fast"', "--out", tmp_path / "run", *options)
    getattr(process, deaf).close()
    heard = process.stderr if deaf == "stdout" else process.stdout
    message = heard.read()
    heard.close()
    assert process.wait(60) == 0 and "Traceback" not in message and "BrokenPipe" not in message
    assert deaf == "stdout" or "completed" in message
    assert told(tmp_path / "run")["status"] == "completed"


def test_the_exit_statuses_are_told(capsys):
    for command, statuses in (("run", ["0", "1", "2", "130", "143"]), ("sweep", ["0", "3", "2", "130", "143"])):
        with pytest.raises(SystemExit):
            main([command, "--help"])
        said = capsys.readouterr().out.casefold().partition("exit status:")[2]
        assert re.findall(r"\b\d+\b", said) == statuses
