"""The arguments that choose a scene and change its keys."""

import argparse
import math
from pathlib import Path

from repro.scene import packaged_scenes


def add_scene(command, nargs: str | None = None) -> None:
    """Add SCENE, --set and --unset, read as ``scene``, ``set`` and ``unset``."""
    command.add_argument("scene", metavar="SCENE", nargs=nargs,
                         help=f"a TOML file, or a packaged scene: {', '.join(packaged_scenes())}")
    add_changes(command)


def path(text: str) -> Path:
    """Parse a path. An empty text, for example an unset variable of the shell, is refused."""
    if not text:
        raise argparse.ArgumentTypeError("a path is needed, this one is empty")
    return Path(text)


def seconds(text: str) -> float:
    """Parse a number of seconds, zero or more."""
    value = float(text)
    if not 0 <= value < math.inf:
        raise argparse.ArgumentTypeError(f"{text}: a number of seconds, zero or more, is needed")
    return value


def add_changes(command) -> None:
    """Add --set and --unset, for ``load_scene(scene, set, unset)``."""
    command.add_argument("--set", metavar="KEY=VALUE", action="append", default=[],
                         help='change a key of the scene, such as growth.end="5 h"; may be '
                         "repeated")
    command.add_argument("--unset", metavar="KEY", action="append", default=[],
                         help="leave out a key or a section of the scene, such as flow.head, "
                         "before --set is read; may be repeated")
