"""``repro compare RUN RUN ... --out FILE.html``: compare runs in one page."""

from repro.cli.arguments import path
from repro.errors import printable
from repro.runs.progress import say


def add(commands) -> None:
    """Add the parser of this command."""
    command = commands.add_parser(
        "compare", help="compare runs in one page",
        description="Write a page with the charts of several runs, the differences of their "
        "scenes, and their last values.")
    command.add_argument("runs", metavar="RUN", type=path, nargs="+",
                         help="folder of a run; the others are compared with the first")
    command.add_argument("--out", metavar="FILE.html", type=path, required=True,
                         help="the page to write")
    command.set_defaults(call=call)


def call(options) -> int:
    """Write the page of the runs."""
    from repro import report

    report.compare(options.runs, options.out)
    say(printable(f"{len(options.runs)} runs compared in {options.out}"))
    return 0
