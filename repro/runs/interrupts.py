"""Signals that ask a run or a sweep to stop: Ctrl-C, SIGTERM, and the notices of batch systems.

The first signal asks for the stop; a later one ends the process at once.
"""

import os
import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from time import monotonic

#: Slurm and Grid Engine send SIGUSR1 or SIGUSR2 before they end a job; a closed terminal sends
#: SIGHUP. Windows has only the first two.
STOP_SIGNALS = tuple(getattr(signal, name)
                     for name in ("SIGINT", "SIGTERM", "SIGHUP", "SIGUSR1", "SIGUSR2")
                     if hasattr(signal, name))
#: A second signal within this time (s) is a duplicate of the first: timeout(1) and shells send one
#: to the process and one to its group.
DUPLICATE = 1.0
#: Seconds between two looks at the blocked signals.
TICK = 0.05

#: Takes the number of a signal, and the frame that it interrupts.
Handler = Callable[..., None]


@contextmanager
def catch_signals() -> Iterator[Callable[[], int]]:
    """Record STOP_SIGNALS; yields a function that returns the first signal's number, or 0.

    A thread receives the signals, which are blocked in this thread and in all threads that start
    within the context. Long calls into compiled code, or a library that installs its own handlers
    (Mmg), therefore cannot delay them. Ignored signals stay ignored. Works only in the main thread.
    """
    received: list[int] = []
    with on_first_signal(received.append) as handle, _receive_in_thread(handle):
        yield lambda: received[0] if received else 0


@contextmanager
def on_first_signal(react: Callable[[int], None]) -> Iterator[Handler]:
    """Call a function with the number of the first of STOP_SIGNALS; yields the handler.

    A later signal that is no duplicate ends the process. Ignored signals stay ignored.
    """
    received_at: list[float] = []

    def handle(number: int, frame=None) -> None:
        if received_at and monotonic() > received_at[0] + DUPLICATE:
            os._exit(128 + number)
        if not received_at:
            received_at.append(monotonic())
            react(number)

    handlers = {number: signal.getsignal(number) or signal.SIG_DFL for number in _not_ignored()}
    for number in handlers:
        signal.signal(number, handle)
    try:
        yield handle
    finally:
        for number, handler in handlers.items():
            signal.signal(number, handler)


def _not_ignored() -> set[signal.Signals]:
    """The signals of STOP_SIGNALS that this process does not ignore."""
    return {number for number in STOP_SIGNALS if signal.getsignal(number) != signal.SIG_IGN}


@contextmanager
def _receive_in_thread(handle: Handler) -> Iterator[None]:
    """Block the signals and handle them in a thread, if the system supports this."""
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    blocked = _not_ignored()  # an ignored signal that is blocked would be pending
    previous_mask = signal.pthread_sigmask(signal.SIG_BLOCK, blocked)
    finished = threading.Event()

    def receive() -> None:
        while not finished.wait(TICK):
            if pending := signal.sigpending() & blocked:
                handle(signal.sigwait(pending))

    thread = threading.Thread(target=receive, daemon=True)
    thread.start()
    try:
        yield
    finally:
        finished.set()
        thread.join()
        signal.pthread_sigmask(signal.SIG_SETMASK, previous_mask)
