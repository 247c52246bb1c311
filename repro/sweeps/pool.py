"""Runs side by side on this machine, each in a process of its own.

What kills one is the failure of no other. A server that has imported everything forks them.
"""

from __future__ import annotations

import multiprocessing
import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from itertools import islice
from multiprocessing.connection import wait
from pathlib import Path
from types import ModuleType
from typing import Any

from repro.sweeps import task
from repro.sweeps.design import Point

Each = Callable[[Sequence[Point], Path], Iterator[tuple[Point, str]]]
_METHODS = multiprocessing.get_all_start_methods()
CONTEXT: Any = multiprocessing.get_context("forkserver" if "forkserver" in _METHODS else "spawn")
#: Of these processes: one thread each, and no module from the working folder; glibc keeps the
#: memory that a run frees for its next step, which otherwise takes a short run 5 % of its time.
ENVIRONMENT = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "MKL_NUM_THREADS": "1",
               "PYTHONSAFEPATH": "1", "MALLOC_MMAP_THRESHOLD_": "1073741824",
               "MALLOC_TRIM_THRESHOLD_": "1073741824", "MALLOC_TOP_PAD_": "67108864"}
PATIENCE = 10  # s that a process may take to end
_starting = threading.Lock()


def cores() -> int:
    """The cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


@contextmanager
def ready(workers: int) -> Iterator[Each]:
    """What makes runs, `workers` at a time; the server starts at once."""
    _serve()
    yield partial(each, workers=workers)


def _serve() -> None:
    """Start the server, if it does not run. Ctrl-C reaches neither it nor what it forks."""
    if CONTEXT.get_start_method() != "forkserver":
        return
    from multiprocessing import forkserver, resource_tracker

    with _apart():
        CONTEXT.set_forkserver_preload(["repro.sweeps.preload"])
        resource_tracker.ensure_running()  # which unblocks the signal
        kept = signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGINT])
        try:
            forkserver.ensure_running()
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, kept)


@contextmanager
def _apart() -> Iterator[None]:
    """Within, a process that is started has ENVIRONMENT, and does not run the user's script again.
    """
    with _starting:
        main = sys.modules["__main__"]
        before = {name: os.environ.get(name) for name in ENVIRONMENT}
        try:
            os.environ.update(ENVIRONMENT)
            sys.modules["__main__"] = ModuleType("__main__")
            yield
        finally:
            sys.modules["__main__"] = main
            for name, value in before.items():
                os.environ.pop(name) if value is None else os.environ.update({name: value})


def each(points: Sequence[Point], folder: Path, workers: int,
         patience: float = 0.0) -> Iterator[tuple[Point, str]]:
    """Make the runs into `folder`; yields each with how it ended, as they end.

    patience: seconds that a run waits for another process to leave its folder.
    """
    waiting = iter(points)
    at_work: dict[Any, tuple[Point, Any]] = {}
    try:
        while True:
            for point in islice(waiting, workers - len(at_work)):
                answer, process = _started(point, folder, patience)
                at_work[answer] = point, process
            if not at_work:
                return
            for answer in wait(list(at_work)):
                point, process = at_work[answer]
                status = _ended(answer, process)
                del at_work[answer]
                yield point, status
    finally:
        _stop([process for _, process in at_work.values()])


def _started(point: Point, folder: Path, patience: float) -> tuple[Any, Any]:
    """The process that makes a run, and the connection to which it sends how that ended."""
    answer, end = CONTEXT.Pipe(duplex=False)
    process = CONTEXT.Process(target=task.answer, daemon=True,
                              args=(end, point.scene, folder / point.name, patience))
    _serve()
    with _apart():
        process.start()
    end.close()
    return answer, process


def _ended(answer: Any, process: Any) -> str:
    """How a run ended, or what ended its process."""
    try:
        status = answer.recv()
    except EOFError:
        status = ""
    answer.close()
    process.join()
    return status or _died(process.exitcode)


def _died(code: int) -> str:
    try:
        cause = f"was killed by {signal.Signals(-code).name}"
    except ValueError:
        cause = f"ended with status {code}"
    return f"failed: the process of the run {cause}"


def _stop(processes: Sequence[Any]) -> None:
    """End processes, by force where they do not end in time."""
    for process in processes:
        process.terminate()
    for process in processes:
        process.join(PATIENCE)
        process.kill()
