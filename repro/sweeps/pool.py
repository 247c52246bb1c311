"""Parallel runs on this machine, each in its own process.

If a process is killed, only its run fails. A server that has imported the package forks the
processes.
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

from repro.runs.interrupts import STOP_SIGNALS
from repro.sweeps import single_run
from repro.sweeps.design import Point

RunPoints = Callable[[Sequence[Point], Path], Iterator[tuple[Point, str]]]
_METHODS = multiprocessing.get_all_start_methods()
CONTEXT: Any = multiprocessing.get_context("forkserver" if "forkserver" in _METHODS else "spawn")
#: Environment of these processes: one thread each, and no module from the working folder. glibc
#: keeps freed memory for the next step; returning it costs a short run 5 % of its time.
ENVIRONMENT = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "MKL_NUM_THREADS": "1",
               "PYTHONSAFEPATH": "1", "MALLOC_MMAP_THRESHOLD_": "1073741824",
               "MALLOC_TRIM_THRESHOLD_": "1073741824", "MALLOC_TOP_PAD_": "67108864"}
PATIENCE = 10  # s that a process may take to end
_starting = threading.Lock()


def cores() -> int:
    """Number of cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


@contextmanager
def ready(workers: int) -> Iterator[RunPoints]:
    """Start the server; yields a function that makes runs, `workers` at a time."""
    _start_server()
    yield partial(run_points, workers=workers)


def _start_server() -> None:
    """Start the server unless it is running. It blocks STOP_SIGNALS; the runs handle them."""
    if CONTEXT.get_start_method() != "forkserver":
        return
    from multiprocessing import forkserver, resource_tracker

    with _isolated():
        CONTEXT.set_forkserver_preload(["repro.sweeps.preload"])
        resource_tracker.ensure_running()  # it unblocks two of the signals
        previous_mask = signal.pthread_sigmask(signal.SIG_BLOCK, STOP_SIGNALS)
        try:
            forkserver.ensure_running()
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, previous_mask)


@contextmanager
def _isolated() -> Iterator[None]:
    """Give ENVIRONMENT to processes that start in this block; they do not run the user's script
    again."""
    with _starting:
        main = sys.modules["__main__"]
        previous = {name: os.environ.get(name) for name in ENVIRONMENT}
        try:
            os.environ.update(ENVIRONMENT)
            sys.modules["__main__"] = ModuleType("__main__")
            yield
        finally:
            sys.modules["__main__"] = main
            for name, value in previous.items():
                os.environ.pop(name) if value is None else os.environ.update({name: value})


def run_points(points: Sequence[Point], folder: Path, workers: int,
         patience: float = 0.0) -> Iterator[tuple[Point, str]]:
    """Make the runs in `folder`; yields each point with its status when its run ends.

    patience: seconds that a run waits for another process that uses its folder.
    """
    waiting = iter(points)
    running: dict[Any, tuple[Point, Any]] = {}
    try:
        while True:
            for point in islice(waiting, workers - len(running)):
                answer, process = _start(point, folder, patience)
                running[answer] = point, process
            if not running:
                return
            for answer in wait(list(running)):
                point, process = running[answer]
                status = _receive_status(answer, process)
                del running[answer]
                yield point, status
    finally:
        _stop([process for _, process in running.values()])


def _start(point: Point, folder: Path, patience: float) -> tuple[Any, Any]:
    """Start the process of a run; return the connection that receives its status, and the process.
    """
    answer, end = CONTEXT.Pipe(duplex=False)
    process = CONTEXT.Process(target=single_run.send_status, daemon=True,
                              args=(end, point.scene, folder / point.name, patience))
    _start_server()
    with _isolated():
        process.start()
    end.close()
    return answer, process


def _receive_status(answer: Any, process: Any) -> str:
    """Receive how a run ended, or describe how its process ended."""
    try:
        status = answer.recv()
    except EOFError:
        status = ""
    answer.close()
    process.join()
    return status or _describe_exit(process.exitcode)


def _describe_exit(code: int) -> str:
    try:
        cause = f"was killed by {signal.Signals(-code).name}"
    except ValueError:
        cause = f"ended with status {code}"
    return f"failed: the process of the run {cause}"


def _stop(processes: Sequence[Any]) -> None:
    """Terminate processes; kill those that do not end in time."""
    for process in processes:
        process.terminate()
    for process in processes:
        process.join(PATIENCE)
        process.kill()
