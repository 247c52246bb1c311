"""A sweep on a Dask cluster: a real scheduler and workers, in processes of their own on the loopback."""

import csv
import json
import os
import re
import shutil
import signal
import socket
import subprocess
import sys
import threading
import time

import pytest

from repro.cli import main
from repro.sweep import cluster, task
from repro.sweep.state import SweepError

VARY = ["--vary", "pore.width=48:52 um:linear:6", "--set", "numerics.preset=fast"]


@pytest.mark.parametrize("package", ["distributed", "dask"])
def test_without_the_package_the_message_says_what_to_install(tmp_path, capsys, monkeypatch, package):
    monkeypatch.delitem(sys.modules, "distributed", raising=False)
    monkeypatch.setitem(sys.modules, package, None)
    assert main(["sweep", "base", *VARY, "--out", str(tmp_path / "sweep"), "--scheduler", "tcp://127.0.0.1:1"]) == 2
    message = capsys.readouterr().err
    assert "pip install 'dupin2001-repro[dask]'" in message and message.count("\n") == 1
    assert list(tmp_path.iterdir()) == []


ADDRESSES = ["nonsense", "tcp://", "tcp://127.0.0.1:99999", "tcp://[::1", "tcp://127.0.0.1:{closed}",
             "127.0.0.1:{silent}", "tcp://host.invalid:8786"]


@pytest.mark.parametrize("address", ADDRESSES)
def test_a_bad_address_is_refused_within_five_seconds(address):
    """Where nobody listens, where nobody answers, where there is no such host, where it is no address."""
    with socket.create_server(("127.0.0.1", 0)) as server:
        where = address.format(closed=free_port(), silent=server.getsockname()[1])
        pytest.importorskip("distributed")
        start = time.monotonic()
        with pytest.raises(SweepError, match=f"--scheduler {re.escape(where)}: no Dask scheduler answers there"):
            with cluster.ready(where):
                pass
        assert time.monotonic() - start < 5


def test_what_greets_otherwise_is_no_scheduler():
    def greet():
        with server.accept()[0] as connection:
            connection.sendall(b"SSH-2.0-OpenSSH_9.9\r\n")

    with socket.create_server(("127.0.0.1", 0)) as server:
        thread = threading.Thread(target=greet)
        thread.start()
        assert not cluster._is_open(f"tcp://127.0.0.1:{server.getsockname()[1]}")
        thread.join()


def test_a_bad_address_writes_nothing(tmp_path):
    """In one line, with status 2."""
    process = on_cluster(f"tcp://127.0.0.1:{free_port()}", tmp_path / "sweep")
    message = process.communicate(timeout=60)[1]
    assert process.returncode == 2 and message.startswith("repro: --scheduler") and message.count("\n") == 1, message
    assert list(tmp_path.iterdir()) == []


def test_a_worker_with_other_code_makes_nothing(tmp_path):
    """One that joins a sweep at work is not asked before."""
    assert "failed: a worker that joined has version" in cluster.attempt("{}", "0.0.1-abc")


def free_port():
    with socket.socket() as found:
        found.bind(("127.0.0.1", 0))
        return found.getsockname()[1]


def begin(folder, name, *arguments):
    with (folder / f"{name}.log").open("w") as log:
        command = [sys.executable, "-m", *arguments, "--no-dashboard"]
        return subprocess.Popen(command, cwd=folder, stdout=log, stderr=log)


def until(told, seconds=60):
    deadline = time.monotonic() + seconds
    while not told():
        assert time.monotonic() < deadline, "it took too long"
        time.sleep(0.05)


@pytest.fixture
def workers(tmp_path):
    """A scheduler's address, and a function that starts a worker."""
    address, processes = f"tcp://127.0.0.1:{free_port()}", []

    def start(name):
        processes.append(begin(tmp_path, name, "distributed.cli.dask_worker", address, "--no-nanny", "--nthreads", "1",
                               "--name", name))
        until(lambda: "Registered to" in (tmp_path / f"{name}.log").read_text())
        return processes[-1]

    processes.append(begin(tmp_path, "scheduler", "distributed.cli.dask_scheduler", "--host", address, "--no-show"))
    until(lambda: "Scheduler at" in (tmp_path / "scheduler.log").read_text())
    yield address, start
    for process in reversed(processes):
        process.terminate()
        process.wait(30)


def on_cluster(address, out, *arguments):
    command = [sys.executable, "-m", "repro", "sweep", "base", *VARY, "--out", str(out), "--scheduler", address]
    return subprocess.Popen([*command, *arguments], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


@pytest.mark.thorough
def test_no_run_is_lost_or_there_twice_where_a_worker_is_killed(workers, tmp_path):
    """Six runs, two workers, one of them killed while it has a run at work; then as without a cluster."""
    address, start = workers
    first, _ = start("one"), start("two")
    out = tmp_path / "sweep"
    process = on_cluster(address, out)
    until(lambda: list(out.glob("runs/0*")) and len(list(out.glob("runs/.part-*"))) == 2)
    first.send_signal(signal.SIGKILL)
    said = process.communicate(timeout=120)
    assert process.returncode == 0 and "6 of 6 runs done, 0 failed" in said[0], said
    told = json.loads((out / "sweep.json").read_text())["points"]
    assert sorted(os.listdir(out / "runs")) == sorted(point["folder"].removeprefix("runs/") for point in told)
    here = tmp_path / "here"
    assert main(["sweep", "base", *VARY, "--out", str(here), "--quiet"]) == 0
    assert (out / "table.csv").read_bytes() == (here / "table.csv").read_bytes()
    with (out / "runs.csv").open() as lines:
        assert [row["status"] for row in csv.DictReader(lines)] == ["completed"] * 6


@pytest.mark.thorough
def test_a_sweep_that_lost_its_cluster_is_gone_on_with_here(workers, tmp_path):
    """Interrupted while a run is at work; the same command without a scheduler makes the rest."""
    address, start = workers
    start("one")
    out = tmp_path / "sweep"
    process = on_cluster(address, out)
    until(lambda: list(out.glob("runs/0*")) and list(out.glob("runs/.part-*")))
    process.send_signal(signal.SIGINT)
    said = process.communicate(timeout=60)[1]
    assert process.returncode == 130 and "Traceback" not in said, said
    kept = {path: (path / "run.json").stat().st_mtime_ns for path in out.glob("runs/0*")}
    assert main(["sweep", "base", *VARY, "--out", str(out), "--quiet"]) == 0
    assert len(list(out.glob("runs/0*"))) == 6
    assert kept and kept == {path: (path / "run.json").stat().st_mtime_ns for path in kept}


@pytest.mark.thorough
def test_a_cluster_that_cannot_be_used_is_refused(workers, tmp_path, capsys, monkeypatch):
    """No workers, workers with another version."""
    address, start = workers
    monkeypatch.setattr(cluster, "PATIENCE", 2)

    def refused(where):
        assert main(["sweep", "base", *VARY, "--out", str(tmp_path / "sweep"), "--scheduler", where]) == 2
        message = capsys.readouterr().err
        assert message.count("\n") == 1 and message.startswith(f"repro: --scheduler {where}: ")
        return message
    assert "has no workers" in refused(address)
    start("one")
    monkeypatch.setattr(task, "code", lambda: "0.0.1-abc")
    shutil.rmtree(tmp_path / "sweep")
    assert "has version" in refused(address)
