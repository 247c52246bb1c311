"""Wall time by stage, for ``run.json`` and the benchmarks: seconds spent in each timed function."""

from __future__ import annotations

from collections import defaultdict
from functools import wraps
from time import perf_counter

#: Seconds by stage since the last :func:`reset`, calls within calls counted in both.
seconds: defaultdict[str, float] = defaultdict(float)


def reset() -> None:
    """Start counting anew."""
    seconds.clear()


def timed(stage: str):
    """Add the time that each call of the decorated function takes to a stage."""
    def decorate(function):
        @wraps(function)
        def wrapper(*args, **kwargs):
            start = perf_counter()
            try:
                return function(*args, **kwargs)
            finally:
                seconds[stage] += perf_counter() - start
        return wrapper
    return decorate
