"""Wall time by stage, for ``run.json`` and the benchmarks."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable
from functools import wraps
from time import perf_counter
from typing import ParamSpec, TypeVar

Arguments = ParamSpec("Arguments")
Result = TypeVar("Result")
Function = Callable[Arguments, Result]

#: Seconds by stage since the last :func:`reset`; nested calls count in both stages.
seconds: defaultdict[str, float] = defaultdict(float)


def reset() -> None:
    """Reset all times to zero."""
    seconds.clear()


def timed(stage: str) -> Callable[[Function[Arguments, Result]], Function[Arguments, Result]]:
    """Decorator: add the time of each call of a function to ``stage``."""
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
