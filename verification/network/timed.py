"""Time of a sweep of all 100 throats of the example as whole runs of 48 h, on the process pool and on Dask.

`python -m verification.network sweep` measures it and writes the record. The time is that of the entire sweep, from an
empty folder to the page. The workers have made a run before. Dask runs a scheduler and workers on this machine.
"""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from time import perf_counter
from typing import Any

from repro.sweeps import driver
from repro.sweeps.design import Factor, Point
from repro.sweeps.folder import Sweep
from repro.sweeps.pool import RunPoints
from verification.evidence.results import machine
from verification.evidence.writing import load, save
from verification.network import runs
from verification.network.histories import History
from verification.network.throats import TIMES

RECORD = Path(__file__).with_name("sweep.json")
POOL, DASK = "process pool", "Dask"
#: Each way of making the runs, with its number of workers.
WAYS = ((POOL, 1), (POOL, 2), (DASK, 1), (DASK, 2))
#: Hours of the runs that are not timed.
WARM_UP = 2.0


def measure(all_throats: list[History], times: tuple[float, ...] = TIMES) -> dict[str, Any]:
    """Time each way. load: mean number of processes that used or awaited a core, in the last minute of its sweep."""
    rows, tables = [], []
    with TemporaryDirectory() as folder:
        for name, workers in WAYS:
            with ready(name, workers) as run_points:
                driver.run_plan(plan(all_throats[:workers], (WARM_UP,), Path(folder, f"warm {name} {workers}")),
                                run_points)
                seconds, unfinished, table = timed(plan(all_throats, times, Path(folder, f"{name} {workers}")),
                                                   run_points)
            rows.append({"way": name, "workers": workers, "seconds": seconds, "unfinished": unfinished,
                         "load": os.getloadavg()[0]})
            tables.append(table)
            print(f"{name}, {workers} workers: {seconds:.1f} s, {unfinished} runs not finished", flush=True)
    return {"machine": machine(), "runs": len(all_throats), "hours": times[-1],
            "equal": len(set(tables)) == 1, "ways": rows}


def timed(sweep: Sweep, run_points: RunPoints) -> tuple[float, int, bytes]:
    """Seconds of a sweep, how many of its runs are not finished, and its table."""
    start = perf_counter()
    swept = driver.run_plan(sweep, run_points)
    seconds = perf_counter() - start
    return seconds, len(swept.failed), (sweep.folder / "table.csv").read_bytes()


def plan(throats: list[History], times: tuple[float, ...], folder: Path) -> Sweep:
    """A sweep whose runs are throats, each with its own history."""
    factor = Factor("throat", "", tuple(float(one.number) for one in throats))
    points = [Point(index, (float(one.number),), runs.scene(one, times)) for index, one in enumerate(throats, 1)]
    return Sweep(folder, "throats", [factor], points)


@contextmanager
def ready(name: str, workers: int) -> Iterator[RunPoints]:
    """Start the workers of a way."""
    if name == POOL:
        with driver.ready(None, workers) as run_points:
            yield run_points
        return
    from distributed import LocalCluster

    with LocalCluster(n_workers=workers, threads_per_worker=1, dashboard_address=None) as cluster, \
            driver.ready(cluster.scheduler_address, workers) as run_points:
        yield run_points


def write(all_throats: list[History], hours: float) -> dict[str, Any]:
    """Measure runs to some hours, and write the record."""
    record = measure(all_throats, tuple(time for time in TIMES if time <= hours))
    save(record, RECORD)
    return record


def read() -> dict[str, Any]:
    """The record; empty if there is none."""
    return load(RECORD, {})
