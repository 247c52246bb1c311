"""``repro sweep SCENE --vary KEY=... --out DIR``: run a scene many times with varied keys.

The tables and a page of all runs are written to the same folder.
"""

from __future__ import annotations

import signal
import sys
from typing import TYPE_CHECKING

from repro.cli.arguments import add_scene, path
from repro.errors import Interrupted, printable
from repro.runs.interrupts import on_first_signal
from repro.runs.progress import say
from repro.sweeps import CLOGGED

if TYPE_CHECKING:
    from repro.sweeps.driver import Swept

#: Exit status if some runs have failed.
SOME_FAILED = 3
EPILOG = """\
--vary takes a range KEY=a:b UNIT:linear|log:N or a list KEY=VALUE, VALUE, ... Several --vary make a
grid. --points takes a CSV file instead, with a run in each row. With --samples a range has no N:
KEY=a:b UNIT:linear|log. Varying flow.head replaces flow.mean_velocity, and vice versa. The same
command continues an interrupted sweep: it makes the missing runs and repeats the failed ones. On a
cluster, DIR must be on a file system that all workers share. Exit status: 0 if every run has
finished, 3 if some have failed, 2 if the input is wrong, 130 if interrupted (Ctrl-C), 143 if
terminated (SIGTERM), 129, 138 or 140 if noticed (SIGHUP, SIGUSR1, SIGUSR2). A second signal, after
a second or more, ends the sweep at once."""


def add(commands) -> None:
    """Add the parser of this command."""
    command = commands.add_parser(
        "sweep", help="run a scene many times with varied keys", epilog=EPILOG,
        description="Run a scene many times with varied keys, on all cores.")
    add_scene(command)
    command.add_argument("--vary", metavar="KEY=...", action="append", default=[],
                         help='key and values: "flow.mean_velocity=0.3:30 m/day:log:8" or '
                         '"pore.width=50 um, 60 um"; may be repeated')
    command.add_argument("--points", metavar="FILE.csv", type=path,
                         help="run the rows of a table instead; its head has keys with units, such "
                         "as pore.width (um)")
    command.add_argument("--samples", metavar="N", type=int,
                         help="draw N runs from a Latin hypercube instead of a grid")
    command.add_argument("--seed", metavar="S", type=int, default=0,
                         help="seed of the Latin hypercube (default: 0)")
    command.add_argument("--out", metavar="DIR", type=path,
                         help="folder for the runs, their tables and their page")
    command.add_argument("--workers", metavar="N", type=int,
                         help="number of parallel runs (default: one per core)")
    command.add_argument("--scheduler", metavar="tcp://HOST:PORT",
                         help="address of a Dask scheduler whose workers make the runs")
    command.add_argument("--clogged", metavar="PART", type=float, default=CLOGGED,
                         help="fraction of the first conductivity at which a pore counts as "
                         "clogged (default: %(default)g)")
    command.add_argument("--dry-run", action="store_true",
                         help="print the number of points, and roughly the time and disk space "
                         "that they need, from trials of at most three; write nothing")
    command.add_argument("--quiet", action="store_true", help="do not show progress")
    command.set_defaults(call=call)


def call(options) -> int:
    """Make the sweep, or print its expected cost; return the exit status."""
    from repro.sweeps import driver

    driver.refuse_values(options.workers, options.seed, options.clogged)
    design = {name: getattr(options, name) for name in ("points", "unset", "samples", "seed")}
    if options.dry_run:
        from repro.sweeps import expected, pool

        plan = driver.plan(options.scene, options.vary, options.out or "", options.set, **design)
        workers = min(options.workers or pool.cores(), len(plan.points))
        say(printable(expected.describe(plan, workers)))
        return 0

    def end(number: int) -> None:
        cause = "interrupted" if number == signal.SIGINT else "terminated"
        raise Interrupted(f"{cause}; the results so far are written, and {options.command_line} "
                          "continues the sweep", number)

    on_terminal = sys.stderr.isatty()
    with on_first_signal(end):
        swept = driver.sweep(options.scene, options.vary, options.out, options.set, **design,
                             workers=options.workers, scheduler=options.scheduler,
                             clogged=options.clogged, progress=on_terminal and not options.quiet,
                             tell=None if on_terminal or options.quiet else _print_run)
    return _report(swept)


def _print_run(event: dict) -> None:
    if event["event"] == "run":
        say(printable(f"{event['done']} of {event['total']}: run {event['run']}, "
                      f"{event['values']}: {event['status']}; about "
                      f"{event['left_s']:.0f} s left"), to_stderr=True)


def _report(swept: Swept) -> int:
    """Print the failures and the number of runs; return the exit status."""
    for run in swept.failed:
        say(printable(f"repro: run {run.point.index} ({swept.label(run)}): {run.status}"),
            to_stderr=True)
    finished = len(swept.runs) - len(swept.failed)
    say(printable(f"{swept.source}: {finished} of {len(swept.runs)} runs done, "
                  f"{len(swept.failed)} failed; results in {swept.folder}"))
    return SOME_FAILED if swept.failed else 0
