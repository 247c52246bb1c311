"""``repro compare RUN RUN ... --out FILE.html``: lay runs over each other in one page."""

from __future__ import annotations

from pathlib import Path

from repro.cli.arguments import path
from repro.errors import OutputError
from repro.runs.progress import say


def add(commands) -> None:
    """The parser of this command."""
    command = commands.add_parser(
        "compare", help="lay runs over each other in one page",
        description="Make a page with the charts of several runs, what differs in their scenes, "
        "and last values.")
    command.add_argument("runs", metavar="RUN", type=path, nargs="+",
                         help="folder of a run; the first is what the others are compared with")
    command.add_argument("--out", metavar="FILE.html", type=path, required=True,
                         help="the page to write")
    command.set_defaults(call=call)


def call(chosen) -> int:
    """Write the page of the runs that were chosen."""
    from repro import report

    if len(chosen.runs) < 2:
        raise OutputError(f"compare {chosen.runs[0]}: two runs or more are needed")
    _check(chosen.out)
    try:
        report.compare(chosen.runs, chosen.out)
    except report.NoRun as error:
        raise OutputError(str(error)) from error
    except OSError as error:
        raise OutputError(f"--out {chosen.out}: {error.strerror or error}; a file that can be "
                          "written is needed") from error
    say(f"{len(chosen.runs)} runs compared in {chosen.out}")
    return 0


def _check(out: Path) -> None:
    """Refuse what would harm a run or another file."""
    if out.suffix != ".html":
        raise OutputError(f"--out {out}: a file name that ends in .html is needed")
    if (out.parent / "run.json").exists():
        raise OutputError(f"--out {out}: {out.parent} is the folder of a run; a file elsewhere is "
                          "needed")
