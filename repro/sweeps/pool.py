"""Runs in processes of this machine.

Each process makes one run at a time. If a process ends, only its run fails, and another process
makes the next one.
"""

import json
import os
import signal
import subprocess
import sys
import threading
from collections.abc import Callable, Generator, Sequence
from concurrent.futures import (
    CancelledError,
    Executor,
    ThreadPoolExecutor,
    as_completed,
)
from contextlib import closing, suppress
from pathlib import Path

from repro.runs.machine import THREADS
from repro.runs.status import FAILED
from repro.scene import scene_tables
from repro.sweeps import single_run
from repro.sweeps.design import Point

#: Each point with the status of its run, when the run ends.
EndedRuns = Generator[tuple[Point, str], None, None]
RunPoints = Callable[[Sequence[Point], Path], EndedRuns]
#: The option -P keeps the working folder out of sys.path.
COMMAND = ("-P", "-c", "from repro.sweeps import single_run; single_run.serve()")
PATIENCE = 10  # s that a process may take to end


def cores() -> int:
    """Number of cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def run_points(points: Sequence[Point], folder: Path, workers: int) -> EndedRuns:
    """Make the runs in `folder`, `workers` at a time."""
    with ThreadPoolExecutor(workers) as threads, closing(Processes()) as processes:
        yield from submit(threads, processes.make, points, folder)


def submit(executor: Executor, make: Callable[[Point, Path], str], points: Sequence[Point],
           folder: Path) -> EndedRuns:
    """Submit the runs to an executor; make: makes the run of a point in its folder."""
    futures = {executor.submit(make, point, folder / point.name): point for point in points}
    try:
        for future in as_completed(futures):
            try:
                status = future.result()
            except Exception as error:  # any error of an executor is a failure of its run
                status = f"{FAILED}{type(error).__name__}: {' '.join(str(error).split())}"
            yield futures[future], status
    finally:
        for future in futures:
            future.cancel()


class Processes:
    """Processes that make runs. One that has made a run waits for the next."""

    def __init__(self) -> None:
        self._started: list[subprocess.Popen] = []
        self._idle: list[subprocess.Popen] = []
        self._closed = False
        self._lock = threading.Lock()

    def make(self, point: Point, folder: Path, patience: float = 0.0) -> str:
        """Make a run in a process; return how the run or its process ended.

        patience: seconds to wait for another process that uses the folder. Raises CancelledError
        after :meth:`close`.
        """
        process = self._take()
        status = _ask(process, {"scene": point.scene.name, "tables": scene_tables(point.scene),
                                "folder": str(folder), "patience": patience})
        if status:
            self._idle.append(process)
            return status
        code = process.wait()
        cause = f"ended with status {code}"
        with suppress(ValueError):
            cause = f"was killed by {signal.Signals(-code).name}"
        return f"{FAILED}the process of the run {cause}"

    def _take(self) -> subprocess.Popen:
        """Take an idle process, or start one."""
        with self._lock:
            if self._closed:
                raise CancelledError
            while self._idle:
                process = self._idle.pop()
                if process.poll() is None:
                    return process
            self._started.append(_start())
            return self._started[-1]

    def close(self) -> None:
        """Stop all runs, and wait for the processes; kill those that do not end in time."""
        with self._lock:
            self._closed = True
        for process in self._started:
            with suppress(OSError):  # it has ended
                process.stdin.write(single_run.STOP)
                process.stdin.flush()
        for process in self._started:
            with suppress(OSError), process:
                try:
                    process.wait(PATIENCE)
                except subprocess.TimeoutExpired:
                    process.kill()


def _start() -> subprocess.Popen:
    """Start a process with one thread. It imports nothing from the working folder."""
    package = str(Path(__file__).parents[2])
    paths = [path for path in map(str, sys.path) if os.path.abspath(path) != os.getcwd()]
    environment = os.environ | dict.fromkeys(THREADS, "1")
    environment["PYTHONPATH"] = os.pathsep.join([*paths, package])
    return subprocess.Popen([sys.executable, *COMMAND], env=environment, text=True,
                            stdin=subprocess.PIPE, stdout=subprocess.PIPE,
                            stderr=subprocess.DEVNULL)


def _ask(process: subprocess.Popen, request: dict) -> str:
    """Let a process make a run; return its status, empty if the process ends before its run."""
    try:
        print(json.dumps(request), file=process.stdin, flush=True)
        return json.loads(process.stdout.readline() or '""')
    except BrokenPipeError:
        return ""
