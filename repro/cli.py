"""Command line: ``repro COMMAND ...``; each command is a module of :mod:`repro.commands`.

Exit status: 0 when the command has done what it is for, 1 when a stage failed, 2 when something in the input is wrong,
130 when interrupted.
"""

from __future__ import annotations

import argparse
import sys

from repro.commands import COMMANDS
from repro.errors import SimulationError
from repro.running import OutputError
from repro.scene import SceneError


def main(arguments: list[str] | None = None) -> int:
    """Entry point; returns the exit status."""
    chosen = _parser().parse_args(arguments)
    try:
        return chosen.call(chosen)
    except (SceneError, OutputError) as error:
        return _fail(error, 2)
    except SimulationError as error:
        return _fail(error, 1)
    except KeyboardInterrupt:
        return _fail("interrupted; what was computed is written", 130)


def _fail(message, status: int) -> int:
    print(f"repro: {message}", file=sys.stderr)
    return status


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="repro", description="Biological clogging of one pore by the growth of an "
                                     "aggregate (Dupin, Kitanidis & McCarty 2001).")
    commands = parser.add_subparsers(dest="command", required=True)
    for command in COMMANDS:
        command.add(commands)
    return parser


if __name__ == "__main__":
    sys.exit(main())
