"""Polls within a step, so that a signal need not wait for its end.

Newton's method polls at each iteration. A check that is set may raise an exception, which ends the
step; the state before the step stays as it is.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager

_checks: list[Callable[[], None]] = []


def poll() -> None:
    """Make all checks that are set."""
    for check in _checks:
        check()


@contextmanager
def polling(check: Callable[[], None]) -> Iterator[None]:
    """Set a check within a context.

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
