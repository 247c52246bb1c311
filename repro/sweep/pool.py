"""Runs side by side on this machine, each in a process of its own: what kills one is that run's failure, and no other's.

Processes are forked from a server that has imported everything, where there is such a thing; elsewhere they are started
anew. Inside them the linear algebra has one thread.
"""

from __future__ import annotations

import gc
import os
import signal
from collections import deque
from collections.abc import Iterator
from contextlib import contextmanager
from multiprocessing import connection, get_all_start_methods, get_context, parent_process
from pathlib import Path
from typing import Any

from repro.sweep import task
from repro.sweep.design import Point

ONE_THREAD = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "MKL_NUM_THREADS": "1"}
PATIENCE = 10  # s that a run may take to stop


def cores() -> int:
    """The cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def each(points: list[Point], folder: Path, workers: int) -> Iterator[tuple[Point, str]]:
    """Make the runs into `folder`, `workers` at a time; yields each with how it ended, as they end."""
    waiting, running = deque(points), {}
    context = _context()
    try:
        while waiting or running:
            while waiting and len(running) < workers:
                process, answer = _start(context, waiting[0], folder)
                running[process.sentinel] = waiting.popleft(), process, answer
            for sentinel in connection.wait(list(running)):
                point, process, answer = running.pop(sentinel)
                yield point, _ended(process, answer)
    finally:
        _stop([process for _, process, _ in running.values()])


def _context() -> Any:
    """How processes are started here."""
    if "forkserver" not in get_all_start_methods():
        return get_context("spawn")
    context = get_context("forkserver")
    context.set_forkserver_preload([__name__])
    return context


def _start(context, point: Point, folder: Path):
    """A process that makes a run, and the pipe on which it says how it ended."""
    answer, end = context.Pipe(duplex=False)
    place = folder / point.name, folder / f".part-{point.name}"
    process = context.Process(target=_work, args=(point.scene, *place, end), daemon=True)
    with _environment(ONE_THREAD):
        process.start()
    end.close()
    return process, answer


@contextmanager
def _environment(wanted: dict[str, str]):
    """These variables for processes that are started within."""
    before = {name: os.environ.get(name) for name in wanted}
    os.environ.update(wanted)
    try:
        yield
    finally:
        for name, value in before.items():
            os.environ.pop(name) if value is None else os.environ.update({name: value})


def _work(scene, folder: Path, beside: Path, end) -> None:
    """What a process does."""
    gc.freeze()  # what was inherited is not looked through again, and so not copied
    task.end_after(parent_process().join)
    try:
        ended = task.make(scene, folder, beside)
    except KeyboardInterrupt:
        ended = "interrupted"
    end.send_bytes(ended.encode())


def _ended(process, answer) -> str:
    """How a run ended whose process has: in its own words, or by what ended the process."""
    process.join()
    with answer:
        try:
            return answer.recv_bytes().decode()
        except (EOFError, OSError):
            return f"failed: its process {_cause(process.exitcode)}"


def _cause(code: int) -> str:
    try:
        return f"was killed by {signal.Signals(-code).name}"
    except ValueError:
        return f"ended with status {code}"


def _stop(processes: list) -> None:
    """End what still runs."""
    for process in processes:
        process.terminate()
    for process in processes:
        process.join(PATIENCE)
        if process.is_alive():
            process.kill()
            process.join()
