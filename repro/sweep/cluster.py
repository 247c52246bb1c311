"""Runs on a Dask cluster, into a folder that its workers share.

Each is made in a process of its own, beside its worker. A run whose worker dies goes to another
one. Each attempt writes into a folder of its own, and the first that ends moves it to its place, so
that no run is lost, and none is there twice.
"""

from __future__ import annotations

import json
import os
import re
import socket
import uuid
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import partial
from importlib import import_module
from pathlib import Path
from queue import Empty, SimpleQueue
from threading import Thread
from typing import Any

from repro.sweep import task
from repro.sweep.design import Point
from repro.sweep.pool import Each
from repro.sweep.server import Server, ask
from repro.sweep.state import SweepError

PACKAGE = "distributed"
#: Seconds that a scheduler may take to answer, and to have workers.
ANSWER, PATIENCE = 2, 10
LONGEST_GREETING = 2**20  # bytes
ADDRESS = re.compile(r"([a-z]+://)?(?:\[([^]]+)\]|([^][:/]+)):([0-9]{1,5})")
#: The servers of a worker that no run is at work in.
_idle: SimpleQueue[Server] = SimpleQueue()


@contextmanager
def ready(address: str) -> Iterator[Each]:
    """What makes runs on the cluster of the scheduler at an address, such as tcp://host:8786.

    Raises SweepError, in seconds and with nothing written, where no scheduler answers there, or
    the package is not installed that speaks to one.
    """
    distributed = _package(address)
    client = _is_open(address) and _within(ANSWER, lambda: distributed.Client(
        address, timeout=ANSWER, set_as_default=False))
    if not client:
        raise SweepError(f"--scheduler {address}: no Dask scheduler answers there; an address such "
                         "as tcp://host:8786 is needed")
    with client:
        yield partial(each, distributed=distributed, client=client, address=address)


def _package(address: str):
    try:
        return import_module(PACKAGE)
    except ImportError:
        raise SweepError(f"--scheduler {address}: the package {PACKAGE} is not installed; "
                         "pip install 'dupin2001-repro[dask]'") from None


def _is_open(address: str) -> bool:
    """Does a scheduler listen at an address, or something that may be one?"""
    match = ADDRESS.fullmatch(address)
    return bool(match and _within(1.5 * ANSWER, lambda: _greets(
        match[2] or match[3], int(match[4]), match[1] or "tcp://")))


def _greets(host: str, port: int, protocol: str) -> bool:
    """Does what listens there greet as Dask does over TCP: with the length of what follows?"""
    with socket.create_connection((host, port), timeout=ANSWER) as connection:
        if protocol != "tcp://":
            return True
        greeting = connection.recv(8, socket.MSG_WAITALL)
        return len(greeting) == 8 and int.from_bytes(greeting, "little") < LONGEST_GREETING


def _within(seconds: float, make: Callable[[], Any]) -> Any:
    """What is made, None where it fails or takes longer: a name or a greeting may never come."""
    made: list[Any] = []

    def attempt() -> None:
        with suppress(OSError, ValueError, TypeError, OverflowError):
            made.append(make())

    thread = Thread(target=attempt, daemon=True)
    thread.start()
    thread.join(seconds)
    return made[0] if made else None


def each(points: list[Point], folder: Path, distributed, client,
         address: str) -> Iterator[tuple[Point, str]]:
    """Make the runs into `folder`; yields each with how it ended, as they end.

    Raises SweepError where the cluster has no workers, or they have another version of this
    package or do not share the folder.
    """
    folder = folder.resolve()
    _check(client, folder, address)
    futures = {_submit(client, point, folder): point for point in points}
    try:
        for future in distributed.as_completed(futures, loop=client.loop):
            yield futures[future], _ended(future)
    finally:
        client.cancel(list(futures))


def _check(client, folder: Path, address: str) -> None:
    """Are there workers, with this version of the package, that see the folder?"""
    try:
        client.wait_for_workers(1, timeout=PATIENCE)
    except TimeoutError:
        raise SweepError(f"--scheduler {address}: it has no workers") from None
    try:
        found = client.run(look, str(folder.parent / "sweep.json"))
    except ImportError as error:
        raise SweepError(f"--scheduler {address}: a worker lacks this package ({error})") from None
    for worker, (theirs, shared) in found.items():
        if theirs != task.code():
            raise SweepError(f"--scheduler {address}: the worker {worker} has version {theirs} of "
                             f"this package, this is {task.code()}; the same is needed")
        if not shared:
            raise SweepError(f"--scheduler {address}: the worker {worker} does not see {folder}; a "
                             "folder on a file system that all share is needed")


def look(path: str) -> tuple[str, bool]:
    """On a worker: which code it has, and whether it sees a file."""
    return task.code(), os.path.exists(path)


def _submit(client, point: Point, folder: Path):
    token = uuid.uuid4().hex  # two sweeps may have the same run
    asked = ask(point.scene, folder / point.name, folder / f".part-{point.name}")
    key = f"repro-sweep-{point.name}-{token}"
    return client.submit(attempt, asked, task.code(), key=key, pure=False)


def attempt(asked: str, wanted: str) -> str:
    """On a worker: make a run in a process of its own; how it ended.

    It is made in a folder that no other attempt has.
    """
    if task.code() != wanted:
        return (f"failed: a worker that joined has version {task.code()} of this package, {wanted} "
                "is needed")
    told = json.loads(asked)
    told["beside"] += f"-{uuid.uuid4().hex}"
    try:
        server = _idle.get_nowait()
    except Empty:
        server = Server()
    try:
        return server.make(json.dumps(told))
    finally:
        _idle.put(server)


def _ended(future) -> str:
    """How a run ended, or what became of the attempts."""
    try:
        return future.result()
    except Exception as error:  # whatever happened on a worker is that run's failure
        return f"failed: {type(error).__name__}: {' '.join(str(error).split())}"
