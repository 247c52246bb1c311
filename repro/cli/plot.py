"""``repro plot FOLDER [FIELD] [--time TIME] --out FILE``: draw a run in a file."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path

from repro.cli.arguments import path
from repro.errors import OutputError, printable
from repro.runs.progress import say


def add(commands) -> None:
    """Add the parser of this command."""
    command = commands.add_parser(
        "plot", help="draw curves, a field or a film of a run",
        description="Without FIELD, draw the curves of a run over time. If FIELD is a column, draw "
        "its curve. If FIELD is a field, such as acceptor, draw it at one time, or at all times as "
        "a film if FILE ends in .gif. Drawing needs matplotlib.")
    command.add_argument("folder", metavar="FOLDER", type=path, help="folder of a run")
    command.add_argument("field", metavar="FIELD", nargs="?",
                         help="a field or a column, with or without its unit")
    command.add_argument("--time", metavar="TIME", type=_time,
                         help='reported time of the field, such as "90 min"; a number without '
                         "unit is in hours (default: the last)")
    command.add_argument("--out", metavar="FILE", type=path, required=True,
                         help="file to write: .png, .pdf, .svg, or .gif for a film")
    command.set_defaults(call=call)


def _time(text: str) -> float | str:
    """Parse a number of hours; a text with a unit is left to the results."""
    try:
        return float(text)
    except ValueError:
        return text


def call(options) -> int:
    """Write the picture or the film."""
    from repro.runs.scripts import load_run

    results = load_run(options.folder)
    try:
        if options.out.suffix == ".gif":
            if options.field is None or options.time is not None:
                raise OutputError(f"{options.out}: a film needs FIELD and accepts no --time")
            results.animate(options.field, options.out)
        else:
            _save(partial(results.plot, options.field, time=options.time), options.out)
    except (ImportError, KeyError, ValueError) as error:
        raise OutputError(str(error.args[0])) from error
    say(printable(f"{options.folder}: drawn in {options.out}"))
    return 0


def _save(draw: Callable, out: Path) -> None:
    """Draw one or several axes, and save their figure."""
    from repro.results.files import output_path

    with output_path(out) as beside:
        axes = draw()
        figure = (axes[0] if isinstance(axes, list) else axes).figure
        figure.savefig(beside, dpi=150)
