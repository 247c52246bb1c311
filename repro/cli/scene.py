"""``repro scene [SCENE] [--set KEY=VALUE] [--unset KEY]``: print a scene with every key.

Without a scene, list the packaged ones.
"""

from repro.cli.arguments import add_changes
from repro.runs.progress import say
from repro.scene.text import scene_text, titles


def add(commands) -> None:
    """Add the parser of this command."""
    command = commands.add_parser(
        "scene", help="print a scene with every key and its explanation",
        description="Print a scene with every key that a scene can have, for example: "
        "repro scene base > mine.toml. Without SCENE, list the packaged scenes.")
    command.add_argument("scene", metavar="SCENE", nargs="?",
                         help="a packaged scene, or a TOML file (do not redirect the output to it)")
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
