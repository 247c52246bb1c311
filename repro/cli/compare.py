"""``repro compare RUN RUN ... --out FILE.html``: compare runs in one page."""

from __future__ import annotations

from pathlib import Path

from repro.cli.arguments import path
from repro.errors import OutputError
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

    if len(options.runs) < 2:
        raise OutputError(f"compare {options.runs[0]}: two runs or more are needed")
    _check(options.out)
    try:
        report.compare(options.runs, options.out)
    except OSError as error:
        raise OutputError(f"--out {options.out}: {error.strerror or error}; a file that can be "
                          "written is needed") from error
    say(f"{len(options.runs)} runs compared in {options.out}")
    return 0


def _check(out: Path) -> None:
    """Refuse a target that could overwrite a file of a run."""
    if out.suffix != ".html":
        raise OutputError(f"--out {out}: a file name that ends in .html is needed")
    if (out.parent / "run.json").exists():
        raise OutputError(f"--out {out}: {out.parent} is the folder of a run; a file elsewhere is "
                          "needed")
