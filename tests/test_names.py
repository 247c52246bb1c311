"""Names of files with any bytes, in any encoding of the terminal, and file systems without flock."""

import errno
import io
import os
import re
import shlex
import shutil
import signal
import socket
import subprocess
import sys
import time
from functools import partial
from pathlib import Path

import pytest

import repro
from repro.cli import main
from repro.errors import OutputError
from repro.results.files import read_sealed
from repro.runs.folder import locked
from repro.scene import SceneError
from tests.shell import BRIEF, flags, rows, start, wait_for

#: A name that is no UTF-8, one of the control and quoting characters, one that looks like an option, and a long one.
NAMES = {"bytes": os.fsdecode(b"\xff\xfe x"), "newline": "a\nb\t'\x1b[2J$x_", "emoji": "\U0001f9eb \xb5",
         "dash": "-run", "markup": "<b>&amp;\"", "tilde": "~root", "scheme": "http::x", "long": "n" * 240}
TERMINALS = ("ascii", "latin-1", "utf-8")


def session(folder, monkeypatch, name, terminal, *more):
    """Run commands with a name as their scene, folder and file, on a terminal that refuses other characters."""
    monkeypatch.chdir(folder)
    shutil.copy(Path(repro.__file__).parent / "scene" / "packaged" / "flow_only.toml", f"{name}.toml")
    commands = [["run", f"--out={name}", "--", f"{name}.toml"],
                ["run", f"--out={name}2", "--", f"{name}.toml"], ["run", f"--resume={name}"],
                ["check", "--", f"{name}.toml"], ["check", "--", name], ["check", "--json", "--", name],
                ["scene", "--", f"{name}.toml"], ["compare", f"--out={name}.html", "--", name, f"{name}2"],
                ["docs", "quantities"], ["plot", f"--out={name}.png", "--", name, "velocity"], *more]
    for command in commands:
        for stream in ("stdout", "stderr"):
            errors = "strict" if stream == "stdout" else "backslashreplace"
            monkeypatch.setattr(sys, stream, io.TextIOWrapper(io.BytesIO(), terminal, errors))
        assert main(command) == 0, (command, sys.stderr.buffer.getvalue())
        assert b"\x1b" not in sys.stdout.buffer.getvalue() + sys.stderr.buffer.getvalue()
    assert Path(f"{name}.html").is_file()
    repro.load_run(name).to_netcdf(f"{name}.nc")
    assert Path(f"{name}.nc").is_file()
    return read_sealed(Path(name, "run.json"))


@pytest.mark.filterwarnings("ignore:Glyph")
def test_names_of_any_bytes_pass_through_commands(tmp_path, monkeypatch):
    """Pages, tables, pictures and NetCDF are written, and the file of the scene is still known by its bytes."""
    file = tmp_path / f"{NAMES['bytes']}.toml"
    file.write_text("[pore]")
    assert repro.load_scene(file).name == "\\udcff\\udcfe x"
    record = session(tmp_path, monkeypatch, NAMES["bytes"], "ascii")
    assert record["scene"] == "\\udcff\\udcfe x" and os.path.isfile(record["origin"]["file"])


@pytest.mark.filterwarnings("ignore:Glyph")
@pytest.mark.usefixtures("close_figures")
@pytest.mark.thorough
@pytest.mark.parametrize("terminal", TERMINALS)
@pytest.mark.parametrize("kind", NAMES)
def test_all_names_and_terminals(tmp_path, monkeypatch, kind, terminal):
    name = NAMES[kind]
    session(tmp_path, monkeypatch, name, terminal, ["sweep", f"--out={name}3", "--vary", "pore.width=50 um",
                                                    "--workers", "1", "--", f"{name}.toml"])
    assert Path(f"{name}3", "summary.html").is_file()


@pytest.mark.parametrize("argument, values", [
    ("workers", [-1, 0, True]), ("vary", [[]]), ("clogged", [float("nan"), 0.0, 1.0, 2.0, -1.0, True]),
    ("samples", [True, 0, -1]), ("seed", [-1, True]), ("folder", ["a\0b"])])
def test_wrong_values_of_a_sweep_are_refused(tmp_path, monkeypatch, argument, values):
    """The message names the argument, and nothing is written."""
    monkeypatch.chdir(tmp_path)
    for value in values:
        arguments = {"vary": ["pore.width=48:50 um:linear"], "folder": "out", "samples": 2, argument: value}
        with pytest.raises((TypeError, SceneError, OutputError), match=argument):
            repro.sweep("flow_only", **arguments)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("function, arguments", [
    (repro.run, ("flow_only", "a\0b")), (repro.resume, ("a\0b",)), (repro.load_run, ("a\0b",)),
    (repro.compare, (["a\0b", "c"], "c.html")), (repro.load_scene, ("a\0b",))])
def test_a_null_byte_in_a_path_is_refused(function, arguments):
    with pytest.raises((OutputError, SceneError), match="a.b: "):
        function(*arguments)


@pytest.mark.parametrize("tables", [{1: 2}, {"pore": {1: 2}}, {"substrates": {"donor": {None: 1}}}, {(1, 2): {}}])
def test_a_key_that_is_no_text_is_refused(tables):
    with pytest.raises(SceneError, match="the key .*: a text is needed"):
        repro.solve(tables)


@pytest.mark.parametrize("out", ["none/out{}", "folder{}", "null\0{}"])
@pytest.mark.parametrize("kind", ["png", "gif", "html"])
def test_a_file_that_cannot_be_written_is_refused_before_it_is_drawn(tmp_path, monkeypatch, capsys, out, kind):
    """A folder that does not exist, a folder in the place of the file, and a null byte."""
    monkeypatch.chdir(tmp_path)
    repro.run("flow_only", "run")
    file = out.format(f".{kind}")
    if "folder" in out:
        os.mkdir(file)
    command = ["compare", "run", "run"] if kind == "html" else ["plot", "run", "velocity"]
    monkeypatch.setattr("repro.report.comparison.build", lambda runs: pytest.fail("the page was built"))
    monkeypatch.setattr("repro.results.drawing.field", lambda *arguments: pytest.fail("a field was drawn"))
    assert main([*command, "--out", file]) == 2
    assert "a file that can be written is needed" in capsys.readouterr().err
    assert not [*tmp_path.rglob(".writing-*")]


@pytest.fixture(scope="module")
def without_flock(tmp_path_factory):
    """The environment of a process without flock."""
    compiler = shutil.which("cc") or shutil.which("gcc")
    if not sys.platform.startswith("linux") or not compiler:
        pytest.skip("Linux and a compiler of C are needed")
    folder = tmp_path_factory.mktemp("flock")
    (folder / "none.c").write_text("#include <errno.h>\nint flock(int file, int how) {errno = ENOSYS; return -1;}\n")
    subprocess.run([compiler, "-shared", "-fPIC", "-o", folder / "none.so", folder / "none.c"], check=True)
    return {**os.environ, "LD_PRELOAD": str(folder / "none.so")}


def killed(out, environment):
    """Start a run without flock; another process is refused while it runs, and it is then killed."""
    process = subprocess.Popen([sys.executable, "-m", "repro", "run", "base", *flags(*BRIEF), "--out", out,
                                "--checkpoint", "0"], env=environment, stderr=subprocess.DEVNULL)
    wait_for((out / "checkpoint.state").exists, process)
    process.send_signal(signal.SIGSTOP)
    refused = without("run", "--resume", out, env=environment)
    process.kill()
    process.wait()
    assert refused.returncode == 2 and "another process is writing there" in refused.stderr, refused.stderr
    assert process.returncode == -signal.SIGKILL and (out / ".lock").stat().st_size > 0


def without(*arguments, env):
    """The completed process of `repro ARGUMENTS` in an environment."""
    command = [sys.executable, "-m", "repro", *map(str, arguments)]
    return subprocess.run(command, env=env, capture_output=True, text=True, check=False)


@pytest.mark.thorough
@pytest.mark.parametrize("how", [["--resume", "{out}"], ["--resume", "{out}", "--set", "growth.end=3.1 h"],
                                 ["flow_only", "--out", "{out}", "--force"]])
def test_a_killed_run_without_flock_goes_on(tmp_path, without_flock, how):
    """The lock of a process that has ended does not count; no file of it and no warning remains."""
    out = tmp_path / "run"
    killed(out, without_flock)
    done = without("run", "--quiet", *(word.format(out=out) for word in how), env=without_flock)
    assert (done.returncode, done.stderr) == (0, "") and not (out / ".lock").exists()
    assert read_sealed(out / "run.json")["status"] == "completed"


def test_a_lock_of_an_ended_process_is_taken_over_where_files_cannot_be_exchanged(tmp_path, monkeypatch):
    """A file system without flock may lack the exchange of two files as well."""
    def flock(file, how):
        raise OSError(errno.ENOSYS, os.strerror(errno.ENOSYS))

    monkeypatch.setattr("fcntl.flock", flock)
    monkeypatch.setattr("filelock._soft.exchange_supported", lambda: False)
    ended = subprocess.run([sys.executable, "-c", "import os; print(os.getpid())"], capture_output=True, text=True,
                           check=True)
    (tmp_path / ".lock").write_text(f"{ended.stdout.strip()}\n{socket.gethostname()}\n")
    with locked(tmp_path):
        assert (tmp_path / ".lock").read_text().startswith(f"{os.getpid()}\n")


@pytest.mark.thorough
@pytest.mark.parametrize("content, advice", [("123\nelsewhere\n", True), ("", True), ("my notes", False)])
def test_a_folder_that_is_locked_elsewhere_is_refused(tmp_path, without_flock, content, advice):
    """The message says how to go on, and that helps; a file that is no lock is left alone."""
    lock = tmp_path / "run" / ".lock"
    lock.parent.mkdir()
    lock.write_text(content)
    refused = without("run", "flow_only", "--out", lock.parent, env=without_flock)
    assert refused.returncode == 2 and lock.read_text() == content
    assert (f"if no process writes there, remove {lock}" in refused.stderr) == advice
    lock.unlink()
    assert without("run", "flow_only", "--out", lock.parent, env=without_flock).returncode == 0


SIGNALS = [getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP", "SIGUSR1", "SIGUSR2")]


def is_newer(run, before):
    """Has a run written fields after a time?"""
    return any(path.stat().st_mtime > before for path in run.rglob("fields_*.vtu"))


@pytest.mark.parametrize("command", ["run", *(pytest.param(command, marks=pytest.mark.thorough)
                                             for command in ("resume", "sweep"))])
@pytest.mark.parametrize("number", [
    pytest.param(number, id=number.name, marks=() if number == signal.SIGTERM else pytest.mark.thorough)
    for number in SIGNALS])
def test_every_signal_stops_every_command_and_saves(tmp_path, command, number):
    """The run ends with 128 + the number of the signal, has a checkpoint, and its command continues it. The message has
    the time of the last step, and not that of the run's end."""
    out = tmp_path / "out"
    run = out if command != "sweep" else out / "runs"
    sweep = ["sweep", "base", "--vary", "pore.width=50 um", "--workers", "1", "--quiet", "--out", str(out)]
    arguments = sweep if command == "sweep" else ["run", "base", "--out", out]
    for _ in range(2 if command == "resume" else 1):
        before = time.time()
        process = start(*arguments, start_new_session=True)
        wait_for(partial(is_newer, run, before), process)
        os.killpg(process.pid, number)
        message = process.communicate(timeout=60)[1]
        assert process.returncode == 128 + number, message
        assert message.endswith(f"continues the {'sweep' if command == 'sweep' else 'run'}\n")
        assert "Traceback" not in message and (command != "sweep" or " ".join(map(shlex.quote, arguments)) in message)
        if command == "sweep":
            assert (out / "table.csv").exists() and (out / "summary.html").exists() and message.count("\n") == 1
        else:
            (stopped,) = re.findall(r" at t = (\S+) h; the results", message)
            assert float(rows(out / "timeseries.csv")[-1]["time_h"]) <= float(stopped) < 19.4
        records = [read_sealed(path) for path in run.rglob("run.json")]
        assert [record["status"] for record in records] == ["interrupted"]
        assert list(run.rglob("checkpoint.state"))
        arguments = ["run", "--resume", out]
    assert len(records[0]["resumes"]) == (command == "resume")
