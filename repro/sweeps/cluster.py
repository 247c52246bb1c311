"""Runs on a Dask cluster, in a folder that all workers share.

A worker makes its runs in processes of its own. If a worker dies, another one resumes its run; the
lock of the folder admits one process at a time.
"""

import asyncio
import os
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from functools import partial
from pathlib import Path

from repro.errors import OutputError
from repro.runs.status import FAILED
from repro.scene.needed import package
from repro.sweeps import pool, single_run
from repro.sweeps.design import Point
from repro.sweeps.pool import EndedRuns, RunPoints

#: Seconds to wait for the answer of a scheduler.
ANSWER = 2
#: Seconds to wait for the workers of a scheduler.
PATIENCE = 10
#: Seconds to wait until the process of a dead worker releases its folder.
LEAVING = 30
#: On a worker: the processes that make its runs. They end with the worker.
_processes = pool.Processes()


@contextmanager
def ready(address: str) -> Iterator[RunPoints]:
    """Connect to the scheduler at an address like tcp://host:8786; yields a function that makes
    runs on its workers.

    Raises OutputError within seconds, before anything is written, if no scheduler answers or the
    package ``distributed`` is not installed.
    """
    try:
        distributed = package("distributed")
    except ImportError as error:
        raise OutputError(f"--scheduler {address}: {error}") from None
    try:
        with ThreadPoolExecutor(1) as thread:  # a notebook has its own event loop in this one
            thread.submit(lambda: asyncio.run(_ask(distributed, address))).result()
    except Exception as error:  # another kind of server may cause any error
        raise OutputError(f"--scheduler {address}: no Dask scheduler answers there; an address "
                          "such as tcp://host:8786 is needed") from error
    with distributed.Client(address, timeout=PATIENCE, set_as_default=False) as client:
        yield partial(run_points, client=client, address=address)


async def _ask(distributed, address: str) -> None:
    """Ask a scheduler for its identity. Raises an error if none answers in time."""
    security = distributed.Security().get_connection_args("client")
    async with distributed.rpc(address, timeout=ANSWER, connection_args=security) as scheduler:
        await asyncio.wait_for(scheduler.identity(), ANSWER)


def run_points(points: Sequence[Point], folder: Path, client, address: str) -> EndedRuns:
    """Make the runs in `folder`.

    Raises OutputError if the cluster has no workers, or if they have another version of this
    package or do not share the folder.
    """
    folder = folder.resolve()
    _check_workers(client, folder, address)
    executor = client.get_executor(pure=False)  # two sweeps may have the same run
    yield from pool.submit(executor, partial(run_on_worker, single_run.code()), points, folder)


def _check_workers(client, folder: Path, address: str) -> None:
    """Raise OutputError unless workers with this version of the package see the folder."""
    try:
        client.wait_for_workers(1, timeout=PATIENCE)
    except TimeoutError:
        raise OutputError(f"--scheduler {address}: it has no workers") from None
    try:
        answers = client.run(inspect_worker, str(folder.parent / "sweep.json"))
    except ImportError as error:
        raise OutputError(f"--scheduler {address}: a worker lacks this package ({error})") from None
    for worker, (worker_code, shared) in answers.items():
        if worker_code != single_run.code():
            raise OutputError(f"--scheduler {address}: the worker {worker} has version "
                              f"{worker_code} of this package, this is {single_run.code()}; the "
                              "same is needed")
        if not shared:
            raise OutputError(f"--scheduler {address}: the worker {worker} does not see {folder}; "
                              "a folder on a file system that all share is needed")


def inspect_worker(path: str) -> tuple[str, bool]:
    """On a worker: return its code version, and whether it sees a file."""
    return single_run.code(), os.path.exists(path)


def run_on_worker(expected: str, point: Point, folder: Path) -> str:
    """On a worker with the expected code: make a run in a process; return how the run ended."""
    if single_run.code() != expected:
        return (f"{FAILED}a worker that joined has version {single_run.code()} of this package, "
                f"{expected} is needed")
    return _processes.make(point, folder, LEAVING)
