"""Signals that ask a run to stop.

The first signal is recorded; a later one ends the process at once.
"""

from __future__ import annotations

import os
import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from time import monotonic

STOP_SIGNALS = (signal.SIGINT, signal.SIGTERM)
#: A second signal within this time (s) is a duplicate of the first: timeout(1) and shells send one
#: to the process and one to its group.
DUPLICATE = 1.0


@contextmanager
def catch_signals() -> Iterator[Callable[[], int]]:
    """Record SIGINT and SIGTERM; yields a function that returns the first signal's number, or 0.

    A thread waits for the signals. Long calls into compiled code, or a library that installs its
    own handlers (Mmg), therefore cannot delay them. Ignored signals stay ignored. Works only in the
    main thread.
    """
    received: list[int] = []
    received_at = [0.0]

    def handle(number: int, frame=None) -> None:
        if received and monotonic() > received_at[0] + DUPLICATE:
            os._exit(128 + number)
        if not received:
            received_at[0] = monotonic()
            received.append(number)

    handlers = {number: signal.getsignal(number) or signal.SIG_DFL for number in STOP_SIGNALS}
    signals = [number for number in STOP_SIGNALS if handlers[number] != signal.SIG_IGN]
    for number in signals:
        signal.signal(number, handle)
    try:
        with _wait_in_thread(signals, handle):
            yield lambda: received[0] if received else 0
    finally:
        for number, handler in handlers.items():
            signal.signal(number, handler)


@contextmanager
def _wait_in_thread(signals: list[signal.Signals], handle: Callable[[int], None]) -> Iterator[None]:
    """Block the signals and wait for them in a thread, if the system supports this."""
    if not signals or not hasattr(signal, "sigwait"):
        yield
        return
    blocked = [*signals, signal.SIGUSR1]  # the last one ends the thread
    previous_mask = signal.pthread_sigmask(signal.SIG_BLOCK, blocked)

    def wait() -> None:
        while (number := signal.sigwait(blocked)) != signal.SIGUSR1:
            handle(number)

    thread = threading.Thread(target=wait, daemon=True)
    thread.start()
    assert thread.ident
    try:
        yield
    finally:
        signal.pthread_kill(thread.ident, signal.SIGUSR1)
        thread.join()
        signal.pthread_sigmask(signal.SIG_SETMASK, previous_mask)
