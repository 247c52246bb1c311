"""``repro scene [SCENE] [--set KEY=VALUE] [--unset KEY]``: a scene written out with every key.

Without a scene, the list of packaged ones.
"""

from __future__ import annotations

from repro.cli.arguments import add_changes
from repro.runs.progress import say
from repro.scene.text import scene_text, titles


def add(commands) -> None:
    """The parser of this command."""
    command = commands.add_parser(
        "scene", help="write a scene out with every key, commented",
        description="Write a scene to the standard output, with every key it could have: "
        "repro scene base > mine.toml. Without SCENE, list the packaged ones.")
    command.add_argument("scene", metavar="SCENE", nargs="?",
                         help="a packaged scene, or a TOML file (do not write onto the file)")
    add_changes(command)
    command.set_defaults(call=call)


def call(chosen) -> int:
    """Print the scene that was chosen, or what there is to choose from."""
    if chosen.scene is None:
        for name, title in titles().items():
            say(f"{name:14}{title}")
    else:
        say(scene_text(chosen.scene, chosen.set, chosen.unset).removesuffix("\n"))
    return 0
