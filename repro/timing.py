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
    """Decorate a function: add the wall time (s) of each call to a stage.

    Parameters
    ----------
    stage : str
        Name of the stage in ``run.json`` and in :data:`seconds`.

    Returns
    -------
    callable
        The decorator. The decorated function has the same arguments, result and errors.

    Examples
    --------
    >>> from repro import timing
    >>> @timing.timed("flow")
    ... def solve_flow():
    ...     return 2.9
    >>> solve_flow(), timing.seconds["flow"] > 0
    (2.9, True)
    """
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
