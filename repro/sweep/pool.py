"""Runs side by side on this machine, each in a process of its own.

What kills one is the failure of no other.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor, as_completed
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from queue import SimpleQueue

from repro.sweep.design import Point
from repro.sweep.server import Server, ask

Each = Callable[[list[Point], Path], Iterator[tuple[Point, str]]]


def cores() -> int:
    """The cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


@contextmanager
def ready(workers: int) -> Iterator[Each]:
    """What makes runs, `workers` at a time; its processes start at once, and end with the block."""
    servers = [Server() for _ in range(workers)]
    try:
        yield partial(each, servers=servers)
    finally:
        for server in servers:
            server.close()


def each(points: list[Point], folder: Path, servers: list[Server]) -> Iterator[tuple[Point, str]]:
    """Make the runs into `folder`, one at a time in each server.

    Yields each with how it ended, as they end.
    """
    idle: SimpleQueue[Server] = SimpleQueue()
    for server in servers:
        idle.put(server)
    threads = ThreadPoolExecutor(len(servers))
    try:
        futures = {threads.submit(_made, idle, point, folder): point for point in points}
        for future in as_completed(futures):
            yield futures[future], future.result()
    finally:
        threads.shutdown(wait=False, cancel_futures=True)
        for server in servers:
            server.close()
        threads.shutdown()


def _made(idle: SimpleQueue[Server], point: Point, folder: Path) -> str:
    """Have the run made by a server that is idle."""
    server = idle.get()
    try:
        return server.make(ask(point.scene, folder / point.name, folder / f".part-{point.name}"))
    finally:
        idle.put(server)
