"""Wall time by stage, for ``run.json`` and the benchmarks; a bar of progress."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterator
from contextlib import contextmanager
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


@contextmanager
def progress_bar(shown: bool, unit: str) -> Iterator[Callable[[float, float], None]]:
    """Yield a function that shows (reached, total), by ``tqdm.auto`` in scripts and notebooks.

    Without a bar, tqdm is not imported.
    """
    if not shown:
        yield lambda reached, total: None
        return
    from tqdm.auto import tqdm

    form = "{percentage:3.0f}%|{bar}| {n:.4g} of {total:.4g} {unit} [{elapsed} < {remaining}]"
    with tqdm(total=1.0, unit=unit, bar_format=form, delay=1e-3) as bar:
        def show(reached: float, total: float) -> None:
            if total and total != bar.total:
                bar.reset(total)
                bar.initial = reached  # the rest gives the remaining time
            bar.n = reached if total else bar.total
            bar.refresh()

        yield show
