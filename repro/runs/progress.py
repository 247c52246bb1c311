"""What a run says while it runs.

A bar on a terminal, lines elsewhere, JSON for machines, or nothing.
Each is a context that yields what :class:`repro.runs.running.Watch` calls ``tell``.
Warnings go to standard error always.
"""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext
from functools import partial
from threading import Event, Thread
from time import monotonic
from typing import TextIO

from repro.errors import OutputError

Tell = Callable[[dict], None]
#: Seconds between signs of life on a terminal, and without a word elsewhere: at first, and at most.
TICK = 0.5
SILENCE = 1.0
LONGEST = 1.5
#: The bar, and what takes its place on a terminal with fewer columns.
WIDE = ("{desc} {percentage:3.0f}%|{bar}| {n:.1f} of {total:.1f} h "
        "[{elapsed} < {remaining}{postfix}]")
NARROW, NARROWEST = "{desc:.12s} {n:.1f}/{total:.1f} h {elapsed}<{remaining}{postfix}", 80


def told(quiet: bool, machine: bool):
    """The context that suits: for a person, unless asked for quiet or JSON."""
    if machine:
        return nullcontext(in_json)
    if quiet:
        return nullcontext(only_warnings)
    return on_a_terminal() if sys.stderr.isatty() else in_lines()


def printable(text: str) -> str:
    """The text on one line, without what would command a terminal."""
    return "".join(letter if letter.isprintable() else " " for letter in text)


def say(text: str, *, aside: bool = False) -> None:
    """A line on standard output, or aside on standard error, while anybody reads that.

    When the other end of a pipe is closed, what follows goes nowhere, at the end of the process
    too. Raises OutputError where standard output takes nothing more, as on a full disk; what is
    said aside is then lost.
    """
    stream = sys.stderr if aside else sys.stdout
    try:
        print(text, file=stream, flush=True)
    except OSError as error:
        _lead_nowhere(stream)
        if not aside and not isinstance(error, BrokenPipeError):
            raise OutputError(f"standard output: {error.strerror or error}") from error


def _lead_nowhere(stream: TextIO) -> None:
    """Have what is written to a stream from now on, and what waits to be, thrown away."""
    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, stream.fileno())
    os.close(nowhere)


def in_json(event: dict) -> None:
    """A line of JSON on standard output; warnings on standard error too."""
    say(json.dumps(event))
    only_warnings(event)


def only_warnings(event: dict) -> None:
    """Nothing but warnings."""
    if event["event"] == "warning":
        say(_warning(event), aside=True)


def _warning(event: dict) -> str:
    return f"repro: warning: {printable(event['message'])}"


@contextmanager
def in_lines() -> Iterator[Tell]:
    """A line each tenth of the simulated time, where SILENCE s have passed without one, and at the
    end; up to LONGEST s may pass, a fiftieth of the time since the start, so that a log is short.
    """
    begun = said = monotonic()
    reached = 0
    now: dict = {}

    def line(more: str = "") -> None:
        nonlocal said
        said = monotonic()
        say(f"{now['time_h']:g} of {now['end_h']:g} h simulated{more}", aside=True)

    def tell(event: dict) -> None:
        nonlocal reached, now
        only_warnings(event)
        _begin_and_end(event, partial(say, aside=True))
        if event["event"] == "step":
            now = event
            tenth = int(10 * event["time_h"] / event["end_h"] + 1e-9) if event["end_h"] else 0
            if tenth > reached:
                reached = tenth
                line()

    def tick() -> None:
        if now and monotonic() - said > min(LONGEST, max(SILENCE, (monotonic() - begun) / 50)):
            contact = ", contact" if now["contact"] else ""
            line(f", step {now['step']}{contact}, {monotonic() - begun:.0f} s")

    with _ticking(tick):
        yield tell


@contextmanager
def _ticking(tick: Callable[[], None]) -> Iterator[None]:
    """Within, have something done every TICK s, in the midst of a step too."""
    over = Event()

    def run() -> None:
        while not over.wait(TICK):
            tick()

    thread = Thread(target=run, daemon=True)
    thread.start()
    try:
        yield
    finally:
        over.set()
        thread.join()


def _begin_and_end(event: dict, aside: Callable[[str], None]) -> None:
    """What a person is told when a run goes on, and when it is over."""
    if event["event"] == "start" and event["from_h"] > 0:
        aside(f"{printable(event['scene'])}: goes on from t = {event['from_h']:g} h, "
              f"step {event['step']}")
    if event["event"] == "end" and not event["status"].startswith(("failed", "interrupted")):
        before = "" if event["changed"] else ", before this: nothing to do"
        say(f"{printable(event['scene'])}: {event['status']}{before}; results in {event['folder']}")


@contextmanager
def on_a_terminal() -> Iterator[Tell]:
    """A bar with simulated time, steps, remeshes, contact, and the time that is left."""
    from tqdm import tqdm

    # miniters: else the bar waits for as much simulated time as the first steps have made
    with tqdm(total=1.0, bar_format=WIDE, dynamic_ncols=True, delay=1e-3, miniters=0) as bar:
        def tell(event: dict) -> None:
            if event["event"] == "start":
                bar.set_description_str(printable(event["scene"]), refresh=False)
                bar.total = event["end_h"] or 1.0
                bar.n = bar.initial = event["from_h"]
            elif event["event"] == "step":
                _fit(bar, event)
                bar.update(event["time_h"] - bar.n)
            elif event["event"] == "warning":
                bar.write(_warning(event), file=sys.stderr)
            elif event["event"] == "end":
                bar.close()
            _begin_and_end(event, lambda line: bar.write(line, file=sys.stderr))

        with _ticking(bar.refresh):
            yield tell


def _fit(bar, event: dict) -> None:
    """Have steps, remeshes and contact told in as many words as the terminal has room for."""
    narrow = os.get_terminal_size(sys.stderr.fileno()).columns < NARROWEST
    bar.bar_format = NARROW if narrow else WIDE
    words = "mesh" if narrow else "remeshes"
    remeshes = f", {words} {event['remeshes']}" if event["remeshes"] else ""
    contact = ", contact" if event["contact"] else ""
    bar.set_postfix_str(f"step {event['step']}{remeshes}{contact}", refresh=False)
