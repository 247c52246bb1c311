"""The arguments that say which scene a command takes, and what is changed of it."""

from __future__ import annotations

import argparse
from pathlib import Path

from repro.scene import packaged_scenes


def add_scene(command, nargs: str | None = None) -> None:
    """SCENE, --set and --unset: read as ``scene``, ``set`` and ``unset``."""
    command.add_argument("scene", metavar="SCENE", nargs=nargs,
                         help=f"a TOML file, or a packaged scene: {', '.join(packaged_scenes())}")
    add_changes(command)


def path(text: str) -> Path:
    """A path; an empty text, as of a shell's variable that is not set, is none."""
    if not text:
        raise argparse.ArgumentTypeError("a path is needed, this one is empty")
    return Path(text)


def add_changes(command) -> None:
    """--set and --unset, for ``load_scene(scene, set, unset)``."""
    command.add_argument("--set", metavar="KEY=VALUE", action="append", default=[],
                         help='change a key of the scene, such as growth.end="5 h"; may be '
                         "repeated")
    command.add_argument("--unset", metavar="KEY", action="append", default=[],
                         help="leave a key or a section of the scene out, such as flow.head, "
                         "before --set is read; may be repeated")
