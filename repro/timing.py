"""Wall time by stage, for ``run.json`` and the benchmarks: seconds spent in each timed function."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable
from functools import wraps
from time import perf_counter
from typing import ParamSpec, TypeVar

Arguments = ParamSpec("Arguments")
Result = TypeVar("Result")
Function = Callable[Arguments, Result]

#: Seconds by stage since the last :func:`reset`, calls within calls counted in both.
seconds: defaultdict[str, float] = defaultdict(float)


def reset() -> None:
    """Start counting anew."""
    seconds.clear()


def timed(stage: str) -> Callable[[Function[Arguments, Result]], Function[Arguments, Result]]:
    """Add the time that each call of the decorated function takes to a stage."""
    def decorate(function: Function[Arguments, Result]) -> Function[Arguments, Result]:
        @wraps(function)
        def wrapper(*args: Arguments.args, **kwargs: Arguments.kwargs) -> Result:
            start = perf_counter()
            try:
                return function(*args, **kwargs)
            finally:
                seconds[stage] += perf_counter() - start
        return wrapper
    return decorate
