"""The best speed of a method: the lower envelope of its points, read between and beyond them on logarithmic axes."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from math import exp, log

import numpy as np


@dataclass(frozen=True)
class Reading:
    """Seconds and processor seconds that a method needs for an error; how: "measured", "between points" or
    "extrapolated"; slope: of log time by log error there, 0 where a point is taken as it is."""

    seconds: float
    cpu: float
    how: str
    slope: float


def envelope(points: Iterable[Mapping]) -> list[Mapping]:
    """The points that no other beats in both time and error, by falling error."""
    kept, best = [], np.inf
    for point in sorted(points, key=lambda p: (p["seconds"], p["error"])):
        if 0 < point["error"] < best:
            kept.append(point)
            best = point["error"]
    return kept


def slope(points: Iterable[Mapping], key: str = "seconds") -> float:
    """Least-squares slope of log time by log error over an envelope."""
    points = list(points)
    return exponent([p["error"] for p in points], [p[key] for p in points])


def exponent(sizes, values) -> float:
    """Least-squares p of values = c sizes^p; values that are zero are left out, not-a-number where under two remain."""
    pairs = [(log(s), log(v)) for s, v in zip(sizes, values) if s > 0 and v > 0]
    if len({x for x, _ in pairs}) < 2:
        return float("nan")
    x, y = np.array(pairs).T
    return float(np.polyfit(x, y, 1)[0])


def reading(points: Iterable[Mapping], error: float) -> Reading | None:
    """The least time for an error, by the envelope; None where nothing can be said.

    Between two points of the envelope: on the straight line between their logarithms. An error above the largest
    takes the fastest point. Below the least error: on from the last point with the fitted slope of the envelope, which
    needs two points and must fall. Where overheads make its coarse end flatter, that is too little time, not too much.
    """
    kept = envelope(points)
    if not kept:
        return None
    if error >= kept[0]["error"]:
        return Reading(kept[0]["seconds"], kept[0]["cpu"], "measured", 0.0)
    for coarse, fine in zip(kept, kept[1:]):
        if fine["error"] <= error:
            return _between(coarse, fine, error)
    slopes = [slope(kept, key) for key in ("seconds", "cpu")]
    if not all(s < 0 for s in slopes):
        return None
    last, ratio = kept[-1], log(error / kept[-1]["error"])
    return Reading(*(last[key] * exp(s * ratio) for key, s in zip(("seconds", "cpu"), slopes)), "extrapolated",
                   slopes[0])


def _between(coarse: Mapping, fine: Mapping, error: float) -> Reading:
    width = log(fine["error"] / coarse["error"])
    part = log(error / coarse["error"]) / width
    values = [exp((1 - part) * log(coarse[key]) + part * log(fine[key])) for key in ("seconds", "cpu")]
    return Reading(*values, "between points", log(fine["seconds"] / coarse["seconds"]) / width)
