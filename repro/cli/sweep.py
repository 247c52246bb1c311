"""``repro sweep SCENE --vary KEY=... --out DIR``: many runs of a scene with keys varied.

Their table and their page are written beside them.
"""

from __future__ import annotations

import argparse
import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from repro.cli.arguments import add_scene, path
from repro.errors import Interrupted
from repro.runs.interrupts import ASKED
from repro.runs.progress import say

if TYPE_CHECKING:
    from repro.sweeps.making import Swept, Tell

#: Exit status where some runs have failed.
SOME_FAILED = 3
EPILOG = """\
Two forms of --vary: a range KEY=a:b UNIT:linear|log:N, and a list KEY=VALUE, VALUE, ...;
several make a grid. With --samples a range is KEY=a:b UNIT:linear|log, and a Latin hypercube is
drawn. Varying flow.head replaces flow.mean_velocity, and the other way round. The same command
goes on with a sweep that was cut off: it makes what is missing, and what has failed, again. On a
cluster DIR must be on a file system that all workers share. Exit status: 0 every run has come to
its end, 3 some have failed, 2 wrong input, 130 interrupted, 143 terminated."""


def add(commands) -> None:
    """The parser of this command."""
    command = commands.add_parser(
        "sweep", help="run a scene many times with keys varied", epilog=EPILOG,
        description="Run a scene many times with keys varied, on all cores.")
    add_scene(command)
    command.add_argument("--vary", metavar="KEY=...", action="append", required=True,
                         help='"flow.mean_velocity=0.3:30 m/day:log:8" or '
                         '"pore.width=50 um, 60 um"; may be repeated')
    command.add_argument("--samples", metavar="N", type=int,
                         help="a Latin hypercube of N runs instead of a grid")
    command.add_argument("--seed", metavar="S", type=_whole, default=0,
                         help="of the Latin hypercube (0)")
    command.add_argument("--out", metavar="DIR", type=path, required=True,
                         help="folder for runs, table and page")
    command.add_argument("--workers", metavar="N", type=_count, help="runs at a time (all cores)")
    command.add_argument("--scheduler", metavar="tcp://HOST:PORT",
                         help="a Dask scheduler, for its workers to run them")
    command.add_argument("--clogged", metavar="PART", type=_part, default=0.1,
                         help="of the first conductivity at which a pore counts as clogged (0.1)")
    command.add_argument("--quiet", action="store_true", help="no progress")
    command.set_defaults(call=call)


def _whole(text: str) -> int:
    if int(text) < 0:
        raise argparse.ArgumentTypeError("zero or more is needed")
    return int(text)


def _count(text: str) -> int:
    if int(text) < 1:
        raise argparse.ArgumentTypeError("one or more is needed")
    return int(text)


def _part(text: str) -> float:
    if not 0 < float(text) < 1:
        raise argparse.ArgumentTypeError("between 0 and 1 is needed")
    return float(text)


def call(chosen) -> int:
    """Make the sweep that was chosen."""
    from repro.sweeps.making import sweep

    with _ended_by_signals(chosen.command_line), _telling(chosen.quiet) as tell:
        swept = sweep(chosen.scene, chosen.vary, chosen.out, chosen.set, chosen.unset,
                      samples=chosen.samples, seed=chosen.seed, workers=chosen.workers,
                      scheduler=chosen.scheduler, clogged=chosen.clogged, tell=tell)
    return _report(swept)


@contextmanager
def _ended_by_signals(command: str) -> Iterator[None]:
    """Within, Ctrl-C and SIGTERM end the sweep, and the message gives the command that continues
    it; a second one ends the process at once."""
    def end(number: int, frame) -> None:
        signal.signal(number, signal.SIG_DFL)
        how = "interrupted" if number == signal.SIGINT else "terminated"
        raise Interrupted(f"{how}; what was computed is written, and {command} goes on with it",
                          number)

    kept = {number: signal.getsignal(number) for number in ASKED}
    for number in kept:
        if kept[number] != signal.SIG_IGN:
            signal.signal(number, end)
    try:
        yield
    finally:
        for number, handler in kept.items():
            signal.signal(number, handler)


@contextmanager
def _telling(quiet: bool) -> Iterator[Tell]:
    """What tells a person how far a sweep is: nothing, a bar on a terminal, a line a run."""
    if quiet or not sys.stderr.isatty():
        yield _untold if quiet else _in_lines
        return
    from tqdm import tqdm

    with tqdm(unit="run", delay=1e-3) as bar:
        def tell(event: dict) -> None:
            if event["event"] == "start":
                bar.set_description_str(event["scene"], refresh=False)
                bar.total = event["total"]
                bar.initial = event["done"]
            bar.n = event["done"]
            bar.refresh()
        yield tell


def _untold(event: dict) -> None:
    """Nothing is told of a quiet sweep."""


def _in_lines(event: dict) -> None:
    if event["event"] == "run":
        say(f"{event['done']} of {event['total']}: run {event['run']}, {event['values']}: "
            f"{event['status']}", aside=True)


def _report(swept: Swept) -> int:
    """Say what there is now; the exit status."""
    for one in swept.failed:
        say(f"repro: run {one.point.index} ({swept.label(one)}): {one.status}", aside=True)
    done = len(swept.runs) - len(swept.failed)
    say(f"{swept.source}: {done} of {len(swept.runs)} runs done, {len(swept.failed)} "
        f"failed; results in {swept.folder}")
    return SOME_FAILED if swept.failed else 0
