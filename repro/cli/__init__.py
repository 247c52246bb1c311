"""Command line: ``repro COMMAND ...``; each command is a module of :mod:`repro.cli`.

Exit status: 0 when the command has done what it is for, 1 when a stage failed, 2 when something in
the input is wrong, or a folder, a file or standard output cannot be used, 3 when some runs of a
sweep have failed, 130 or 143 when interrupted or terminated. Output that nobody reads any more, as
under ``| head -1``, is no failure.
"""

from __future__ import annotations

import argparse
import shlex
import sys
from contextlib import suppress

from repro.cli import check, compare, run, scene, sweep
from repro.errors import Interrupted, OutputError, SimulationError
from repro.runs.progress import in_json, printable, say
from repro.scene import SceneError

#: The commands, one a module. Each has ``add(commands)``, which adds its parser with
#: ``set_defaults(call=...)``; what is called takes the parsed arguments, returns the exit status.
COMMANDS = (run, scene, check, compare, sweep)


def main(arguments: list[str] | None = None) -> int:
    """Entry point; returns the exit status."""
    words = sys.argv[1:] if arguments is None else arguments
    chosen = _parser().parse_args(words)
    chosen.command_line = shlex.join(["repro", *words])
    try:
        return chosen.call(chosen)
    except (SceneError, OutputError, OSError) as error:
        return _fail(chosen, error, 2)
    except SimulationError as error:
        return _fail(chosen, error, 1)
    except Interrupted as error:
        return _fail(chosen, error, 128 + error.signal)
    except KeyboardInterrupt:
        return _fail(chosen, "interrupted; what was computed is written", 130)


def _fail(chosen, message, status: int) -> int:
    """Tell what went wrong, as an object too where machines listen."""
    if getattr(chosen, "json", False):
        with suppress(OutputError):  # which standard error tells, or nothing can
            in_json({"event": "error", "exit_status": status, "message": str(message)})
    say(f"repro: {printable(str(message))}", aside=True)
    return status


class _Version(argparse.Action):
    """Tell the version, which is looked up when it is asked for, and end."""

    def __call__(self, parser, *_):
        from importlib.metadata import version

        say(f"repro {version('dupin2001-repro')}")
        parser.exit()


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="repro", description="Biological clogging of one pore by the growth of an aggregate "
        "(Dupin, Kitanidis & McCarty 2001).")
    parser.add_argument("--version", action=_Version, nargs=0, help="tell the version and exit")
    commands = parser.add_subparsers(dest="command", required=True)
    for command in COMMANDS:
        command.add(commands)
    return parser


if __name__ == "__main__":
    sys.exit(main())
