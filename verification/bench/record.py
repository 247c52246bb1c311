"""``bench.json``: the measurements of the last benchmark, for tables, pictures and pages.

    {"machine": {"platform", "processor", "cores", "python", "versions": {package: version}, "threads", "date"},
     "parts": {name: {"title": what is measured, in words,
                      "error": what the error is,
                      "reference": where the reference comes from, and how converged it is,
                      "lines": [{"method": name,
                                 "points": [{"label": sizes and steps, "seconds": median wall time, "cpu": median
                                             processor time, "error": relative, "repeats": number, ...}],
                                 "failed": [{"label": ..., "reason": ...}]}],
                      ...}},                                           further keys of the part
     "verdicts": [{"claim": ..., "measured": ..., "wanted": ..., "holds": true, false or null (not measured)}]}

Further keys of the parts: points of base "errors" (of the eight numbers, the larger of both times); base "wide"
[{"preset", "seconds", "cpu", "steps", "end"}] and, kept from one benchmark to the next, "reference_values"
[time][number]; size, whose points have no error, "nodes", "stages" {stage: s} and "ratio" (to the floor); scenes "rows"
[{"scene", "method", "seconds", "cpu", "stages", "took", "unneeded"}]; command "rows" [{"method", "seconds", "cpu",
"imports", "over_imports", "over_few_rows"}]; memory "rows" [{"method", "steps", "slope",
"bound"}]; wide points "errors" [time][number], "reference_changes" [time][number] of the reference from a coarser one,
and "reference_source", the hash of the source that computed it, for which it is kept. A part that does not run again
keeps its entries. Not-a-number is never written.

Measurement: each round runs all jobs once, so that other loads of the machine affect all jobs alike. Reading: the best
speed of a method is the lower envelope of its points, interpolated and extrapolated on logarithmic axes.
"""

import gc
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from math import isfinite
from operator import itemgetter
from time import perf_counter, process_time

import numpy as np

from verification.evidence import writing

FILE = writing.REPORT / "bench.json"


def load() -> dict:
    """The record of the last benchmark; without parts if there is none."""
    return writing.load(FILE, {"parts": {}})


def reference_of(name: str, key: str, value: object) -> dict:
    """The recorded reference of a part, if it has an entry with this value; else nothing."""
    part = load()["parts"].get(name, {})
    return {key: entry for key, entry in part.items() if key.startswith("reference")} if part.get(key) == value else {}


def points(part: dict, method: str) -> list[dict]:
    """The points of a method in a part. Raises LookupError if the method has no line."""
    return {line["method"]: line["points"] for line in part["lines"]}[method]


#: The first run of a job shorter than SHORT (s) is a warm-up; a job longer than LONG (s) runs a third as often.
SHORT, LONG = 0.3, 4.0


Jobs = Mapping[tuple[str, str], Callable[[], dict]]


def measured(jobs: Jobs, repeats: int) -> list[dict]:
    """Measure jobs, and return the lines of a part, with the methods in the order of the jobs.

    A job returns {"error": ..., ...}; its "apart_seconds" and "apart_cpu" are subtracted from its times. A job that
    fails is recorded with the reason and does not run again.
    """
    samples: dict[tuple[str, str], list] = {key: [] for key in jobs}
    repeats_of = dict.fromkeys(jobs, repeats)
    failed = {}
    for turn in range(repeats + 1):
        for key, job in jobs.items():
            if key in failed or len(samples[key]) >= repeats_of[key]:
                continue
            try:
                took, *sample = timed(job)
            except Exception as error:
                failed[key] = f"{type(error).__name__}: {error}"
                continue
            if took >= LONG:
                repeats_of[key] = -(-repeats // 3)
            if turn or took >= SHORT:
                samples[key].append(sample)
    lines: dict[str, dict] = {}
    for key in jobs:
        method, label = key
        line = lines.setdefault(method, {"method": method, "points": [], "failed": []})
        if key in failed:
            line["failed"].append({"label": label, "reason": failed[key]})
        else:
            times, outputs = zip(*samples[key])
            seconds, cpu = np.median(times, axis=0)
            line["points"].append({"label": label, "seconds": seconds, "cpu": cpu, "repeats": len(times),
                                   **outputs[-1]})
    return list(lines.values())


def clock() -> np.ndarray:
    """Wall and processor time, s."""
    return np.array([perf_counter(), process_time()])


def timed(job: Callable[[], dict]) -> tuple[float, np.ndarray, dict]:
    """Wall time of a job; its wall and processor time less the seconds that its output reports separately; and the
    output."""
    gc.collect()
    start = clock()
    output = job()
    took = clock() - start
    if not isfinite(output.get("error", 0.0)):
        raise ValueError("its error is not a number")
    return took[0], took - [output.get("apart_seconds", 0.0), output.get("apart_cpu", 0.0)], output


@dataclass(frozen=True)
class Reading:
    """Wall and processor seconds that a method needs for an error.

    how: "measured", "between points", or "extrapolated with slope p" of log time against log error.
    """

    seconds: float
    cpu: float
    how: str


def envelope(points: Iterable[Mapping]) -> list[Mapping]:
    """The points for which no other point is both faster and more accurate, by falling error."""
    lowest, best = [], np.inf
    for point in sorted(points, key=lambda p: (p["seconds"], p["error"])):
        if 0 < point["error"] < best:
            lowest.append(point)
            best = point["error"]
    return lowest


def reading(points: Iterable[Mapping], error: float) -> Reading:
    """The least time for an error, by the envelope. Raises LookupError if the points do not determine it.

    Between two points of the envelope the logarithms are interpolated. Above the largest error the fastest point
    counts. Below the least error the fitted slope of the envelope extrapolates from the last point; it needs two points
    and must fall. If overheads flatten the coarse end, the extrapolated time is too short, not too long.
    """
    lowest = np.array([itemgetter("error", "seconds", "cpu")(point) for point in envelope(points)])
    if not (len(lowest) and error > 0):
        raise LookupError(error)
    errors, times = lowest[:, 0], lowest[:, 1:]
    if error >= errors[0]:
        return Reading(*times[0], "measured")
    if error >= errors[-1]:
        logs = [np.interp(-np.log(error), -np.log(errors), each) for each in np.log(times.T)]
        return Reading(*np.exp(logs), "between points")
    slopes = np.polyfit(np.log(errors), np.log(times), 1)[0] if len(lowest) > 1 else np.zeros(2)
    if slopes.max() >= 0:
        raise LookupError(error)
    return Reading(*times[-1] * (error / errors[-1]) ** slopes, f"extrapolated with slope {slopes[0]:.2f}")
