"""Runs on a Dask cluster, in a folder that all workers share.

Each run is a process of its own, which a worker starts. If a worker dies, another one resumes its
run; the lock of the folder admits one process at a time.
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

from repro.sweeps import pool, single_run
from repro.sweeps.design import Point
from repro.sweeps.folder import SweepError
from repro.sweeps.pool import RunPoints

PACKAGE = "distributed"
#: Seconds to wait for the answer of a scheduler.
ANSWER = 2
#: Seconds to wait for the workers of a scheduler.
PATIENCE = 10
#: Seconds to wait until the process of a dead worker releases its folder.
LEAVING = 30


@contextmanager
def ready(address: str) -> Iterator[RunPoints]:
    """Connect to the scheduler at an address like tcp://host:8786; yields a function that makes
    runs on its workers.

    Raises SweepError within seconds, before anything is written, if no scheduler answers or the
    package ``distributed`` is not installed.
    """
    distributed = _package(address)
    try:
        with ThreadPoolExecutor(1) as thread:  # a notebook has its own event loop in this one
            thread.submit(lambda: asyncio.run(_ask(distributed, address))).result()
    except Exception as error:  # another kind of server may cause any error
        raise SweepError(f"--scheduler {address}: no Dask scheduler answers there; an address such "
                         "as tcp://host:8786 is needed") from error
    with distributed.Client(address, timeout=PATIENCE, set_as_default=False) as client:
        yield partial(run_points, distributed=distributed, client=client, address=address)


def _package(address: str):
    try:
        return import_module(PACKAGE)
    except ImportError:
        raise SweepError(f"--scheduler {address}: the package {PACKAGE} is not installed; "
                         f"pip install {PACKAGE}") from None


async def _ask(distributed, address: str) -> None:
    """Ask a scheduler for its identity. Raises an error if none answers in time."""
    security = distributed.Security().get_connection_args("client")
    async with distributed.rpc(address, timeout=ANSWER, connection_args=security) as scheduler:
        await asyncio.wait_for(scheduler.identity(), ANSWER)


def run_points(points: Sequence[Point], folder: Path, distributed, client,
         address: str) -> Iterator[tuple[Point, str]]:
    """Make the runs in `folder`; yields each point with its status when its run ends.

    Raises SweepError if the cluster has no workers, or if they have another version of this package
    or do not share the folder.
    """
    folder = folder.resolve()
    _check_workers(client, folder, address)
    futures = {_submit(client, point, folder): point for point in points}
    try:
        for future in distributed.as_completed(futures, loop=client.loop):
            yield futures[future], _result_status(future)
    finally:
        client.cancel(list(futures))


def _check_workers(client, folder: Path, address: str) -> None:
    """Raise SweepError unless workers with this version of the package see the folder."""
    try:
        client.wait_for_workers(1, timeout=PATIENCE)
    except TimeoutError:
        raise SweepError(f"--scheduler {address}: it has no workers") from None
    try:
        answers = client.run(inspect_worker, str(folder.parent / "sweep.json"))
    except ImportError as error:
        raise SweepError(f"--scheduler {address}: a worker lacks this package ({error})") from None
    for worker, (worker_code, shared) in answers.items():
        if worker_code != single_run.code():
            raise SweepError(f"--scheduler {address}: the worker {worker} has version {worker_code}"
                             f" of this package, this is {single_run.code()}; the same is needed")
        if not shared:
            raise SweepError(f"--scheduler {address}: the worker {worker} does not see {folder}; a "
                             "folder on a file system that all share is needed")


def inspect_worker(path: str) -> tuple[str, bool]:
    """On a worker: return its code version, and whether it sees a file."""
    return single_run.code(), os.path.exists(path)


def _submit(client, point: Point, folder: Path):
    key = f"repro-sweep-{point.name}-{uuid.uuid4().hex}"  # two sweeps may have the same run
    return client.submit(run_on_worker, point, folder, single_run.code(), key=key, pure=False)


def run_on_worker(point: Point, folder: Path, expected: str) -> str:
    """On a worker: make a run in its own process; return how the run ended."""
    if single_run.code() != expected:
        return (f"failed: a worker that joined has version {single_run.code()} of this package, "
                f"{expected} is needed")
    multiprocessing.current_process().daemon = False  # a daemon, as under a nanny, has no children
    ((_, status),) = pool.run_points([point], folder, 1, patience=LEAVING)
    return status


def _result_status(future) -> str:
    """Return how a run ended, or the error of its worker."""
    try:
        return future.result()
    except Exception as error:  # any error on a worker is a failure of its run
        return f"failed: {type(error).__name__}: {' '.join(str(error).split())}"
