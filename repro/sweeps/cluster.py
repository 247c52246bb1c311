"""Runs on a Dask cluster, into a folder that its workers share.

Each is made in a process of its own, beside its worker. Another worker goes on with a run whose
worker dies: the lock of the run's folder leaves it to one process at a time.
"""

from __future__ import annotations

import asyncio
import multiprocessing
import os
import uuid
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from functools import partial
from importlib import import_module
from pathlib import Path

from repro.sweeps import pool, task
from repro.sweeps.design import Point
from repro.sweeps.pool import Each
from repro.sweeps.state import SweepError

PACKAGE = "distributed"
#: Seconds that a scheduler may take to answer, and to have workers; and that the process of a
#: worker which has died may keep its folder.
ANSWER, PATIENCE, LEAVING = 2, 10, 30


@contextmanager
def ready(address: str) -> Iterator[Each]:
    """What makes runs on the cluster of the scheduler at an address, such as tcp://host:8786.

    Raises SweepError, in seconds and with nothing written, where no scheduler answers there, or
    the package is not installed that speaks to one.
    """
    distributed = _package(address)
    try:
        with ThreadPoolExecutor(1) as thread:  # a notebook has a loop of its own in this one
            thread.submit(lambda: asyncio.run(_ask(distributed, address))).result()
    except Exception as error:  # whatever a server that is no scheduler may cause
        raise SweepError(f"--scheduler {address}: no Dask scheduler answers there; an address such "
                         "as tcp://host:8786 is needed") from error
    with distributed.Client(address, timeout=PATIENCE, set_as_default=False) as client:
        yield partial(each, distributed=distributed, client=client, address=address)


def _package(address: str):
    try:
        return import_module(PACKAGE)
    except ImportError:
        raise SweepError(f"--scheduler {address}: the package {PACKAGE} is not installed; "
                         "pip install 'dupin2001-repro[dask]'") from None


async def _ask(distributed, address: str) -> None:
    """Ask a scheduler who it is. Raises an error where none answers in time."""
    security = distributed.Security().get_connection_args("client")
    async with distributed.rpc(address, timeout=ANSWER, connection_args=security) as scheduler:
        await asyncio.wait_for(scheduler.identity(), ANSWER)


def each(points: Sequence[Point], folder: Path, distributed, client,
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
    key = f"repro-sweep-{point.name}-{uuid.uuid4().hex}"  # two sweeps may have the same run
    return client.submit(attempt, point, folder, task.code(), key=key, pure=False)


def attempt(point: Point, folder: Path, wanted: str) -> str:
    """On a worker: make a run in a process of its own; how it ended."""
    if task.code() != wanted:
        return (f"failed: a worker that joined has version {task.code()} of this package, {wanted} "
                "is needed")
    multiprocessing.current_process().daemon = False  # one under a nanny is, and may start none
    ((_, status),) = pool.each([point], folder, 1, patience=LEAVING)
    return status


def _ended(future) -> str:
    """How a run ended, or what became of the attempts."""
    try:
        return future.result()
    except Exception as error:  # whatever happened on a worker is that run's failure
        return f"failed: {type(error).__name__}: {' '.join(str(error).split())}"
