"""Signals that ask a run to stop.

The first one is noted, one that comes later ends the process at once.
"""

from __future__ import annotations

import os
import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from time import monotonic

ASKED = (signal.SIGINT, signal.SIGTERM)
#: Seconds in which a signal is the first one come twice: timeout(1) and shells send it to the
#: process and to its group.
SAME = 1.0


@contextmanager
def noted() -> Iterator[Callable[[], int]]:
    """Within, SIGINT and SIGTERM are noted; yields what says which came first, zero while none has.

    A thread waits for them, so that neither a long call into compiled code nor a library that takes
    signals for itself (Mmg) keeps them from being seen. Signals that are ignored stay so. For the
    main thread alone.
    """
    came: list[int] = []
    when = [0.0]

    def note(number: int, frame=None) -> None:
        if came and monotonic() > when[0] + SAME:
            os._exit(128 + number)
        if not came:
            when[0] = monotonic()
            came.append(number)

    kept = {number: signal.getsignal(number) or signal.SIG_DFL for number in ASKED}
    wanted = [number for number in ASKED if kept[number] != signal.SIG_IGN]
    for number in wanted:
        signal.signal(number, note)
    try:
        with _waited_for(wanted, note):
            yield lambda: came[0] if came else 0
    finally:
        for number, handler in kept.items():
            signal.signal(number, handler)


@contextmanager
def _waited_for(wanted: list[signal.Signals], note: Callable[[int], None]) -> Iterator[None]:
    """Block the signals and wait for them in a thread, where the system can."""
    if not wanted or not hasattr(signal, "sigwait"):
        yield
        return
    awaited = [*wanted, signal.SIGUSR1]  # the last one ends the thread
    before = signal.pthread_sigmask(signal.SIG_BLOCK, awaited)

    def wait() -> None:
        while (number := signal.sigwait(awaited)) != signal.SIGUSR1:
            note(number)

    thread = threading.Thread(target=wait, daemon=True)
    thread.start()
    assert thread.ident
    try:
        yield
    finally:
        signal.pthread_kill(thread.ident, signal.SIGUSR1)
        thread.join()
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
