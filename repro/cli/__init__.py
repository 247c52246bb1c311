"""Command line: ``repro COMMAND ...``; each command is a module of :mod:`repro.cli`.

Exit status: 0 on success; 1 if a stage failed; 2 if the input is wrong, or if a folder, a file or
standard output cannot be used; 3 if some runs of a sweep have failed; 130 if interrupted, 143 if
terminated. A closed pipe, as after ``| head -1``, is not a failure.
"""

import argparse
import shlex
import sys
from contextlib import suppress

from repro.cli import check, compare, docs, network, permeability, plot, run, scene, sweep
from repro.errors import Interrupted, OutputError, Refusal, SimulationError, printable
from repro.runs.progress import in_json, say
from repro.scene import SceneError

#: The modules of the commands. Each has ``add(commands)``, which adds its parser with
#: ``set_defaults(call=...)``; ``call`` takes the parsed arguments and returns the exit status.
COMMANDS = (run, scene, check, plot, compare, sweep, permeability, network, docs)


def main(arguments: list[str] | None = None) -> int:
    """Run the command line; returns the exit status."""
    words = sys.argv[1:] if arguments is None else arguments
    parser = _parser()
    options = parser.parse_args(words)
    if options.command is None:
        say(parser.format_help().removesuffix("\n"))
        return 0
    options.command_line = shlex.join(["repro", *words])
    try:
        return options.call(options)
    except (SceneError, OutputError, OSError) as error:
        return _fail(options, error, 2)
    except SimulationError as error:
        return _fail(options, error, 1)
    except Interrupted as error:
        return _fail(options, error, 128 + error.signal)
    except KeyboardInterrupt:
        return _fail(options, "interrupted; the results so far are written", 130)


def _fail(options, message, status: int) -> int:
    """Print an error, with --json also as an object; return the exit status."""
    text = message.args[0] if isinstance(message, Refusal) else str(message)
    if getattr(options, "json", False):
        with suppress(OutputError):  # standard error still has the message
            in_json({"event": "error", "exit_status": status, "message": text})
    say(f"repro: {printable(text)}", to_stderr=True)
    return status


class _Version(argparse.Action):
    """Print the version, which is looked up only here, and exit."""

    def __call__(self, parser, *_):
        from importlib.metadata import version

        say(f"repro {version('dupin2001-repro')}")
        parser.exit()


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="repro", description="Biological clogging of one pore by the growth of an aggregate "
        "(Dupin, Kitanidis & McCarty 2001).")
    parser.add_argument("--version", action=_Version, nargs=0, help="print the version and exit")
    commands = parser.add_subparsers(dest="command")
    for command in COMMANDS:
        command.add(commands)
    return parser


if __name__ == "__main__":
    sys.exit(main())
