"""Poll within a step, so that a signal does not have to wait for the end of the step.

Newton's method polls at each iteration. A check may raise an exception, which ends the step; the
state before the step stays unchanged.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager

_checks: list[Callable[[], None]] = []


def poll() -> None:
    """Call all active checks."""
    for check in _checks:
        check()


class OutOfTime(Exception):
    """The time of :func:`within` is over."""


@contextmanager
def within(seconds: float, clock: Callable[[], float]) -> Iterator[None]:
    """Raise OutOfTime at the first poll after some seconds of a clock."""
    deadline = clock() + seconds

    def check() -> None:
        if clock() > deadline:
            raise OutOfTime

    with polling(check):
        yield


@contextmanager
def polling(check: Callable[[], None]) -> Iterator[None]:
    """Make a check active within a context.

    Examples
    --------
    >>> from repro.polling import poll, polling
    >>> with polling(lambda: print("polled")):
    ...     poll()
    polled
    """
    _checks.append(check)
    try:
        yield
    finally:
        _checks.remove(check)
