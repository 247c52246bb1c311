"""``bench.json``: what the last benchmark has measured, for tables, pictures and pages.

    {"machine": {"platform", "processor", "cores", "python", "versions": {package: version}, "threads", "date"},
     "parts": {name: {"title": what is measured, in words,
                      "error": what the error is,
                      "reference": where the reference comes from, and how converged it is,
                      "lines": [{"method": name,
                                 "points": [{"label": sizes and steps, "seconds": median wall time, "cpu": median
                                             processor time, "error": relative, "repeats": number, ...}],
                                 "failed": [{"label": ..., "reason": ...}]}],
                      ...}},                                           what is a part's own
     "verdicts": [{"claim": ..., "measured": ..., "wanted": ..., "holds": true, false or null (not measured)}]}

What a part has of its own: points of base "errors" (of the eight numbers, the larger of both times); base "wide"
[{"preset", "seconds", "cpu", "steps", "end"}] and, kept from one benchmark to the next, "reference_values"
[time][number]; size, whose points have no error, "nodes", "stages" {stage: s} and "ratio" (to the floor); scenes "rows"
[{"scene", "method", "seconds", "cpu", "stages", "took", "unneeded"}]; memory "rows" [{"method", "steps", "slope",
"bound"}]. A part that was not run again keeps what it had. Not-a-number is never written.

How it is measured: jobs are timed side by side, each round runs all of them once, so that whatever else the machine
does hits all alike. How it is read: the best speed of a method is the lower envelope of its points, between and beyond
them on logarithmic axes.
"""

from __future__ import annotations

import gc
import os
import platform
import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from datetime import date
from importlib.metadata import version
from math import isfinite
from operator import itemgetter
from pathlib import Path
from time import perf_counter, process_time

import numpy as np

from verification.evidence import writing

FOLDER = Path(__file__).parents[1] / "report"
FILE = FOLDER / "bench.json"
CPUS = Path("/proc/cpuinfo")
PACKAGES = ("numpy", "scipy", "scikit-fem", "shapely", "mmgpy", "fipy", "py-pde", "numba")


def load() -> dict:
    """The record of the last benchmark, one without parts where there is none."""
    return writing.load(FILE, {"parts": {}})


def machine() -> dict:
    """What the times are of."""
    return {"platform": platform.platform(), "processor": processor(), "cores": os.cpu_count(),
            "python": platform.python_version(), "versions": {name: version(name) for name in PACKAGES},
            "threads": os.environ.get("OMP_NUM_THREADS", "not set"), "date": date.today().isoformat()}


def processor() -> str:
    """The processor's model, as Linux names it or else as Python does."""
    text = CPUS.read_text(encoding="utf-8") if CPUS.exists() else ""
    found = re.search("^model name\\s*: (.*)", text, re.MULTILINE)
    return found[1].strip() if found else platform.processor() or "unknown"


def points(part: dict, method: str) -> list[dict]:
    """The points of a method in a part. Raises LookupError where there is no such line."""
    return {line["method"]: line["points"] for line in part["lines"]}[method]


#: The first run of a job only warms up where it takes less than this (s); a job that takes longer than that is run a
#: third as often.
SHORT, LONG = 0.3, 4.0


Jobs = Mapping[tuple[str, str], Callable[[], dict]]


def measured(jobs: Jobs, repeats: int) -> list[dict]:
    """Lines of a part from jobs {(method, label): job}, in the order in which methods first come.

    A job returns {"error": ..., ...}, of which "apart_seconds" and "apart_cpu" are taken off its times. One that fails
    says why, and is not run again.
    """
    samples: dict[tuple[str, str], list] = {key: [] for key in jobs}
    wanted = dict.fromkeys(jobs, repeats)
    failed = {}
    for turn in range(repeats + 1):
        for key, job in jobs.items():
            if key in failed or len(samples[key]) >= wanted[key]:
                continue
            try:
                took, *sample = timed(job)
            except Exception as error:
                failed[key] = f"{type(error).__name__}: {error}"
                continue
            if took >= LONG:
                wanted[key] = -(-repeats // 3)
            if turn or took >= SHORT:
                samples[key].append(sample)
    lines: dict[str, dict] = {}
    for key in jobs:
        method, label = key
        line = lines.setdefault(method, {"method": method, "points": [], "failed": []})
        if key in failed:
            line["failed"].append({"label": label, "reason": failed[key]})
        else:
            times, found = zip(*samples[key])
            seconds, cpu = np.median(times, axis=0)
            line["points"].append({"label": label, "seconds": seconds, "cpu": cpu, "repeats": len(times), **found[-1]})
    return list(lines.values())


def clock() -> np.ndarray:
    """Wall and processor time, s."""
    return np.array([perf_counter(), process_time()])


def timed(job: Callable[[], dict]) -> tuple[float, np.ndarray, dict]:
    """The wall time of a run; wall and processor time without what is apart; and what the job returns."""
    gc.collect()
    start = clock()
    found = job()
    took = clock() - start
    if not isfinite(found.get("error", 0.0)):
        raise ValueError("its error is not a number")
    return took[0], took - [found.get("apart_seconds", 0.0), found.get("apart_cpu", 0.0)], found


@dataclass(frozen=True)
class Reading:
    """Seconds and processor seconds that a method needs for an error; how: "measured", "between points" or
    "extrapolated with slope p", of log time by log error."""

    seconds: float
    cpu: float
    how: str


def envelope(points: Iterable[Mapping]) -> list[Mapping]:
    """The points that no other beats in both time and error, by falling error."""
    kept, best = [], np.inf
    for point in sorted(points, key=lambda p: (p["seconds"], p["error"])):
        if 0 < point["error"] < best:
            kept.append(point)
            best = point["error"]
    return kept


def reading(points: Iterable[Mapping], error: float) -> Reading:
    """The least time for an error, by the envelope. Raises LookupError where nothing can be said.

    Between two points of the envelope: on the straight line between their logarithms. An error above the largest
    takes the fastest point. Below the least error: on from the last point with the fitted slope of the envelope, which
    needs two points and must fall. Where overheads make its coarse end flatter, that is too little time, not too much.
    """
    kept = np.array([itemgetter("error", "seconds", "cpu")(point) for point in envelope(points)])
    if not (len(kept) and error > 0):
        raise LookupError(error)
    errors, times = kept[:, 0], kept[:, 1:]
    if error >= errors[0]:
        return Reading(*times[0], "measured")
    if error >= errors[-1]:
        logs = [np.interp(-np.log(error), -np.log(errors), each) for each in np.log(times.T)]
        return Reading(*np.exp(logs), "between points")
    slopes = np.polyfit(np.log(errors), np.log(times), 1)[0] if len(kept) > 1 else np.zeros(2)
    if slopes.max() >= 0:
        raise LookupError(error)
    return Reading(*times[-1] * (error / errors[-1]) ** slopes, f"extrapolated with slope {slopes[0]:.2f}")
