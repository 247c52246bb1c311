"""Time jobs side by side: each round runs all of them once, so that whatever else the machine does hits all alike."""

from __future__ import annotations

import gc
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from math import isfinite
from statistics import median
from time import perf_counter, process_time

#: The first run of a job only warms up where it takes less than this (s); a job that takes longer than that is run a
#: third as often.
SHORT, LONG = 0.3, 4.0


@dataclass
class Timed:
    """What a job took, run by run, and what it returned last: a dictionary with its "error" and whatever else; took:
    the wall time of its last run, whatever is left out of it."""

    seconds: list[float] = field(default_factory=list)
    cpu: list[float] = field(default_factory=list)
    found: dict = field(default_factory=dict)
    reason: str = ""
    took: float = 0.0

    def run(self, job: Callable[[], dict]) -> None:
        """Once more; a job that fails says why, and is not run again."""
        gc.collect()
        wall, spent = perf_counter(), process_time()
        try:
            found = job()
        except Exception as error:
            self.reason = f"{type(error).__name__}: {error}"
            return
        wall, spent = perf_counter() - wall, process_time() - spent
        self.took = wall
        self.found = found() if callable(found) else found
        self.seconds.append(wall - self.found.get("apart_seconds", 0.0))
        self.cpu.append(spent - self.found.get("apart_cpu", 0.0))
        if not isfinite(self.found.get("error", 0.0)):
            self.reason = "its error is not a number"


Jobs = Mapping[tuple[str, str], Callable[[], dict]]


def measured(jobs: Jobs, repeats: int) -> list[dict]:
    """Lines of a part from jobs {(method, label): job}, in the order in which methods first come.

    A job returns {"error": ..., ...}, or a function that returns it and is not timed; "apart_seconds" and
    "apart_cpu" of it are taken off.
    """
    times = {key: Timed() for key in jobs}
    for key, job in jobs.items():
        times[key].run(job)
    wanted = {key: _often(timed, repeats) for key, timed in times.items()}
    for _ in range(repeats):
        for key, job in jobs.items():
            if not times[key].reason and len(times[key].seconds) < wanted[key]:
                times[key].run(job)
    return _lines(times)


def _often(timed: Timed, repeats: int) -> int:
    """How many runs are to be counted; that of a short job is forgotten."""
    if timed.reason:
        return 0
    if timed.took < SHORT:
        timed.seconds.clear()
        timed.cpu.clear()
    return repeats if timed.took < LONG else -(-repeats // 3)


def _lines(times: Mapping[tuple[str, str], Timed]) -> list[dict]:
    lines: dict[str, dict] = {}
    for (method, label), timed in times.items():
        line = lines.setdefault(method, {"method": method, "points": [], "failed": []})
        if timed.reason:
            line["failed"].append({"label": label, "reason": timed.reason})
        else:
            line["points"].append({"label": label, "seconds": median(timed.seconds), "cpu": median(timed.cpu),
                                   "repeats": len(timed.seconds), **timed.found})
    return list(lines.values())
