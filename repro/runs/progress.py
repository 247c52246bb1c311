"""Messages of a run in progress: a bar on a terminal, lines elsewhere, JSON, or nothing.

Each is a context that yields the function ``tell`` of :class:`repro.runs.execution.Watch`. Warnings
always go to standard error.
"""

import json
import os
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext
from functools import partial
from threading import Event, Thread
from time import monotonic

from repro.errors import OutputError, printable
from repro.polling import polling
from repro.runs.status import is_over

Tell = Callable[[dict], None]
#: Seconds between updates of the bar, and without a line.
TICK = 0.5
SILENCE = 1.5
#: The bar, and its replacement on a terminal with fewer columns.
WIDE = ("{desc} {percentage:3.0f}%|{bar}| {n:.1f} of {total:.1f} h "
        "[{elapsed} < {remaining}{postfix}]")
NARROW, NARROWEST = "{desc:.12s} {n:.1f}/{total:.1f} h {elapsed}<{remaining}{postfix}", 80


def display_events(quiet: bool, machine: bool):
    """Choose the context: JSON if machine, only warnings if quiet, else a bar or lines."""
    if machine:
        return nullcontext(in_json)
    if quiet:
        return nullcontext(only_warnings)
    return on_a_terminal() if sys.stderr.isatty() else in_lines()


def say(text: str, *, to_stderr: bool = False) -> None:
    """Print a line to standard output, or to standard error.

    Characters that its encoding lacks are escaped. After the reader of a pipe has closed it,
    further output is discarded. Raises OutputError if standard output fails otherwise, as on a full
    disk; errors of standard error are ignored.
    """
    stream = sys.stderr if to_stderr else sys.stdout
    encoding = getattr(stream, "encoding", None) or "utf-8"
    try:
        print(text.encode(encoding, "backslashreplace").decode(encoding), file=stream, flush=True)
    except OSError as error:
        null_device = os.open(os.devnull, os.O_WRONLY)  # for buffered and further output
        os.dup2(null_device, stream.fileno())
        os.close(null_device)
        if not to_stderr and not isinstance(error, BrokenPipeError):
            raise OutputError(f"standard output: {error.strerror or error}") from error


def in_json(event: dict) -> None:
    """Print an event as a line of JSON to standard output; warnings also to standard error."""
    say(json.dumps(event))
    only_warnings(event)


def only_warnings(event: dict) -> None:
    """Print warnings, and ignore all other events."""
    if event["event"] == "warning":
        say(_warning(event), to_stderr=True)


def _warning(event: dict) -> str:
    return f"repro: warning: {printable(event['message'])}"


@contextmanager
def in_lines() -> Iterator[Tell]:
    """Print a line after each tenth of the simulated time, after a silence, and at the end."""
    begun = printed_at = monotonic()
    reached = 0
    last_step: dict = {}

    def line(more: str = "") -> None:
        nonlocal printed_at
        printed_at = monotonic()
        say(f"{last_step['time_h']:g} of {last_step['end_h']:g} h simulated{more}", to_stderr=True)

    def tell(event: dict) -> None:
        nonlocal reached, last_step
        only_warnings(event)
        _report_start_and_end(event, partial(say, to_stderr=True))
        if event["event"] == "step":
            last_step = event
            tenth = int(10 * event["time_h"] / event["end_h"] + 1e-9) if event["end_h"] else 0
            if tenth > reached:
                reached = tenth
                line()

    def tick() -> None:
        if last_step and monotonic() - printed_at > SILENCE:
            contact = ", contact" if last_step["contact"] else ""
            line(f", step {last_step['step']}{contact}, {monotonic() - begun:.0f} s")

    with _call_regularly(tick):
        yield tell


@contextmanager
def while_checking(scene: str) -> Iterator[Callable[[float], None]]:
    """Print a line after each second of a check, from a thread and at each poll.

    Yields a function that receives the time (h) to which the check has looked.

    A thread waits while compiled code, such as the mesher, has the interpreter. The check polls
    between its stages, so that one of them is the longest silence.
    """
    begun = printed_at = monotonic()
    work = "first state and steps are computed"

    def reach(time: float) -> None:
        nonlocal work
        work = f"looked to t = {time:.3g} h"

    def tick() -> None:
        nonlocal printed_at
        if monotonic() - printed_at > TICK:
            printed_at = monotonic()
            say(f"{printable(scene)}: {work}, {printed_at - begun:.0f} s", to_stderr=True)

    with _call_regularly(tick), polling(tick):
        yield reach


@contextmanager
def _call_regularly(tick: Callable[[], None]) -> Iterator[None]:
    """Call a function every TICK s, also during a step."""
    finished = Event()

    def tick_until_finished() -> None:
        while not finished.wait(TICK):
            tick()

    thread = Thread(target=tick_until_finished, daemon=True)
    thread.start()
    try:
        yield
    finally:
        finished.set()
        thread.join()


def _report_start_and_end(event: dict, say_aside: Callable[[str], None]) -> None:
    """Report that a run resumes, and how it ended."""
    if event["event"] == "start" and event["from_h"] > 0:
        say_aside(printable(f"{event['scene']}: resumes from t = {event['from_h']:g} h, "
                            f"step {event['step']}"))
    if event["event"] == "end" and is_over(event["status"]):
        suffix = "" if event["changed"] else ", already finished"
        say(printable(f"{event['scene']}: {event['status']}{suffix}; "
                      f"results in {event['folder']}"))


@contextmanager
def on_a_terminal() -> Iterator[Tell]:
    """Show a bar with simulated time, steps, remeshes, contact, and the remaining time."""
    from tqdm import tqdm

    # any other miniters delays the bar by as much simulated time as the first steps take
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
            _report_start_and_end(event, lambda line: bar.write(line, file=sys.stderr))

        with _call_regularly(bar.refresh):
            yield tell


def _fit(bar, event: dict) -> None:
    """Fit the numbers of steps and remeshes, and contact, to the width of the terminal."""
    narrow = os.get_terminal_size(sys.stderr.fileno()).columns < NARROWEST
    bar.bar_format = NARROW if narrow else WIDE
    words = "mesh" if narrow else "remeshes"
    remeshes = f", {words} {event['remeshes']}" if event["remeshes"] else ""
    contact = ", contact" if event["contact"] else ""
    bar.set_postfix_str(f"step {event['step']}{remeshes}{contact}", refresh=False)
