"""``repro scene [SCENE] [--set KEY=VALUE] [--unset KEY]``: print a scene with every key.

Without a scene, list the packaged ones.
"""

from __future__ import annotations

from repro.cli.arguments import add_changes
from repro.runs.progress import say
from repro.scene.text import scene_text, titles


def add(commands) -> None:
    """Add the parser of this command."""
    command = commands.add_parser(
        "scene", help="write a scene out with every key, commented",
        description="Write a scene to the standard output, with every key it could have: "
        "repro scene base > mine.toml. Without SCENE, list the packaged ones.")
    command.add_argument("scene", metavar="SCENE", nargs="?",
                         help="a packaged scene, or a TOML file (do not write onto the file)")
    add_changes(command)
    command.set_defaults(call=call)


def call(options) -> int:
    """Print the scene, or list the packaged scenes."""
    if options.scene is None:
        for name, title in titles().items():
            say(f"{name:14}{title}")
    else:
        say(scene_text(options.scene, options.set, options.unset).removesuffix("\n"))
    return 0
