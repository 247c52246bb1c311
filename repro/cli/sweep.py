"""``repro sweep SCENE --vary KEY=... --out DIR``: many runs of a scene with keys varied.

Their table and their page are written beside them.
"""

from __future__ import annotations

import argparse
import signal
import sys
from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path

from tqdm import tqdm

from repro.cli.arguments import add_scene
from repro.errors import Interrupted
from repro.run.machine import require_packages
from repro.run.progress import say
from repro.sweep import cluster, design, page, pool, table
from repro.sweep.state import Sweep, opened, usable

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
    command.add_argument("--out", metavar="DIR", type=Path, required=True,
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
    ended: dict[int, str] = {}
    with _ended_by_sigterm(), _ready(chosen) as each:
        sweep = _wanted(chosen)
        with opened(sweep):
            try:
                _make(sweep, chosen.quiet, each, ended)
            finally:
                told = _told(sweep, ended, chosen.clogged)
    return _report(sweep, told)


@contextmanager
def _ended_by_sigterm() -> Iterator[None]:
    """Within, SIGTERM ends the sweep as Ctrl-C does; a second one ends the process at once."""
    def end(number: int, frame) -> None:
        signal.signal(number, signal.SIG_DFL)
        raise Interrupted("terminated; what was computed is written, and the same command goes on "
                          "with it", number)

    kept = signal.getsignal(signal.SIGTERM)
    if kept != signal.SIG_IGN:
        signal.signal(signal.SIGTERM, end)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, kept)


def _ready(chosen) -> AbstractContextManager[pool.Each]:
    """What makes the runs: processes here, which load what they need meanwhile, or a cluster."""
    if chosen.scheduler:
        return cluster.ready(chosen.scheduler)
    return pool.ready(chosen.workers or pool.cores())


def _told(sweep: Sweep, ended: dict[int, str], clogged: float) -> list[table.Told]:
    """What there is now, which is written as tables and page too."""
    told = table.tell(sweep, ended, clogged)
    with usable(sweep.folder):
        table.write(sweep, told)
        page.write(sweep, told, clogged)
    return told


def _wanted(chosen) -> Sweep:
    """The sweep that the arguments describe, every run of it checked."""
    factors = [design.parse(text) for text in chosen.vary]
    if chosen.samples is None:
        found = design.grid(factors)
    else:
        found = design.latin(factors, chosen.samples, chosen.seed)
    points = design.points(chosen.scene, chosen.set, factors, found, chosen.unset)
    for point in points if chosen.scheduler is None else ():
        require_packages(point.scene)
    return Sweep(chosen.out, chosen.scene, factors, points)


def _make(sweep: Sweep, quiet: bool, each: pool.Each, ended: dict[int, str]) -> None:
    """Make what is missing; `ended` gets how each run ended, by number."""
    missing, total = sweep.missing(), len(sweep.points)
    silent = quiet or not sys.stderr.isatty()
    with tqdm(total=total, initial=total - len(missing), desc=sweep.source, unit="run",
              disable=silent) as bar:
        for point, status in each(missing, sweep.runs) if missing else ():
            ended[point.index] = status
            bar.update()
            if not quiet and silent:
                say(f"{total - len(missing) + len(ended)} of {total}: run {point.index}, "
                    f"{design.label(sweep.factors, point.values)}: {status}", aside=True)


def _report(sweep: Sweep, told: list[table.Told]) -> int:
    """Say what there is now; the exit status."""
    failed = [one for one in told if not one.done]
    for one in failed:
        say(f"repro: run {one.point.index} ({design.label(sweep.factors, one.point.values)}): "
            f"{one.status}", aside=True)
    say(f"{sweep.source}: {len(told) - len(failed)} of {len(told)} runs done, {len(failed)} "
        f"failed; results in {sweep.folder}")
    return SOME_FAILED if failed else 0
