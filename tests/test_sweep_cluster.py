"""A sweep on a Dask cluster: a real scheduler and workers in processes on the loopback, or a stand-in for their
answers."""

import json
import os
import signal
import socket
import subprocess
import sys
import time
from unittest.mock import AsyncMock, MagicMock, Mock

import pytest

from repro.cli import main
from repro.sweeps import cluster, single_run
from tests.shell import rows, until
from tests.shell import start as start_command

VARY = ["--vary", "pore.width=48:52 um:linear:6", "--set", "numerics.preset=fast"]


def command(out, *arguments):
    return ["sweep", "base", *VARY, "--out", str(out), *arguments]


def refused(out, address, capsys):
    """The one-line message, with status 2, about the scheduler at an address."""
    assert main(command(out, "--scheduler", address)) == 2
    message = capsys.readouterr().err
    assert message.startswith(f"repro: --scheduler {address}: ") and message.count("\n") == 1
    return message


@pytest.mark.parametrize("package", ["distributed", "dask"])
def test_a_sweep_without_dask_is_refused_with_the_extra_to_install(tmp_path, capsys, monkeypatch, package):
    monkeypatch.delitem(sys.modules, "distributed", raising=False)
    monkeypatch.setitem(sys.modules, package, None)
    assert "pip install distributed" in refused(tmp_path / "sweep", "tcp://127.0.0.1:1", capsys)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("address", [
    "nonsense", "tcp://[::1", "tcp://127.0.0.1:{closed}", "127.0.0.1:{silent}", "ucx://127.0.0.1:{closed}",
    *(pytest.param(address, marks=pytest.mark.thorough) for address in (
        "tcp://", "tcp://127.0.0.1:99999", "tcp://host.invalid:8786", "tls://127.0.0.1:{silent}"))])
def test_a_bad_address_is_refused_within_five_seconds_and_nothing_is_written(tmp_path, capfd, address):
    """The port is closed or its server is silent, the host does not exist, or the text is no address. The message is
    one line without a traceback."""
    pytest.importorskip("distributed")
    with socket.create_server(("127.0.0.1", 0)) as server:
        scheduler = address.format(closed=free_port(), silent=server.getsockname()[1])
        start = time.monotonic()
        assert "no Dask scheduler answers there" in refused(tmp_path / "sweep", scheduler, capfd)
        assert time.monotonic() - start < 5 and list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("trouble, answer, expected", [
    (TimeoutError(), None, "it has no workers"),
    (None, ImportError("no module repro"), "a worker lacks this package (no module repro)"),
    (None, ("0.0.1-abc", True), "the worker tcp://b:1 has version 0.0.1-abc of this package, this is "),
    (None, (None, False), "the worker tcp://b:1 does not see "),
])
def test_unusable_workers_are_reported(tmp_path, capsys, monkeypatch, trouble, answer, expected):
    """The message names the scheduler: no worker in time, no package, another version, another file system."""
    def run(function, path):
        if isinstance(answer, ImportError):
            raise answer
        version, shared = answer
        return {"tcp://a:1": function(path), "tcp://b:1": (version or single_run.code(), shared)}

    client = MagicMock(wait_for_workers=Mock(side_effect=trouble), run=run)
    client.__enter__.return_value = client
    monkeypatch.setattr(cluster, "package", lambda name: Mock(Client=lambda *at, **options: client))
    monkeypatch.setattr(cluster, "_ask", AsyncMock())
    assert expected in refused(tmp_path / "sweep", "tcp://host:8786", capsys)


def test_a_worker_with_other_code_makes_no_run():
    """A worker that joins a running sweep has not been checked before."""
    assert "failed: a worker that joined has version" in cluster.run_on_worker("0.0.1-abc", None, None)


def free_port():
    with socket.socket() as server:
        server.bind(("127.0.0.1", 0))
        return server.getsockname()[1]


@pytest.fixture
def workers(tmp_path):
    """A scheduler's address, and a function that starts a worker."""
    address, processes = f"tcp://127.0.0.1:{free_port()}", []

    def begin(name, ready, *arguments):
        with (tmp_path / f"{name}.log").open("w") as log:
            started = [sys.executable, "-m", *arguments, "--no-dashboard"]
            processes.append(subprocess.Popen(started, cwd=tmp_path, stdout=log, stderr=log))
        until(lambda: ready in (tmp_path / f"{name}.log").read_text())
        return processes[-1]

    def start(name):
        return begin(name, "Registered to", "distributed.cli.dask_worker", address, "--no-nanny", "--nthreads", "1",
                     "--name", name)

    begin("scheduler", "Scheduler at", "distributed.cli.dask_scheduler", "--host", address, "--no-show")
    yield address, start
    for process in reversed(processes):
        process.terminate()
        process.wait(30)


@pytest.mark.thorough
def test_no_run_is_lost_or_repeated_after_a_worker_is_killed(workers, tmp_path):
    """Of two workers with six runs one is killed during a run. The results equal those without a cluster."""
    address, start = workers
    first, _ = start("one"), start("two")
    out, reference = tmp_path / "sweep", tmp_path / "here"
    process = start_command(*command(out, "--scheduler", address))
    until(lambda: list(out.glob("runs/0*")) and len(list(out.glob("runs/*/.lock"))) == 2)
    first.send_signal(signal.SIGKILL)
    outputs = process.communicate(timeout=120)
    assert process.returncode == 0 and "6 of 6 runs done, 0 failed" in outputs[0], outputs
    point_records = json.loads((out / "sweep.json").read_text())["points"]
    assert sorted(os.listdir(out / "runs")) == sorted(point["folder"].removeprefix("runs/") for point in point_records)
    assert main(command(reference, "--quiet")) == 0
    assert (out / "table.csv").read_bytes() == (reference / "table.csv").read_bytes()
    assert [row["status"] for row in rows(out / "runs.csv")] == ["completed"] * 6
