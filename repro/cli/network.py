"""``repro network-law SCENE``: the laws for networks with a scene's own kinetics, computed once."""

import sys

from repro.cli.arguments import add_scene
from repro.errors import printable
from repro.runs.progress import say


def add(commands) -> None:
    """Add the parser of this command."""
    command = commands.add_parser(
        "network-law", help="compute the laws for networks of a scene",
        description="Solve some hundred states with the kinetics of a scene, in half a minute to a "
        "few minutes, and keep the laws of repro.uptake and repro.added_resistance in the user's "
        "cache folder. A scene whose laws are there is not computed again.")
    add_scene(command)
    command.add_argument("--quiet", action="store_true", help="do not show progress")
    command.set_defaults(call=call)


def call(options) -> int:
    """Compute the laws, or read them, and say where they hold."""
    from repro.network.own import tabulated
    from repro.scene import load_scene

    scene = load_scene(options.scene, options.set, unset=options.unset)
    laws = tabulated(scene, progress=sys.stderr.isatty() and not options.quiet)
    law = laws.uptake
    (narrow, wide), (acceptor, donor) = law.widths, law.supplies
    say(f"area / width^2 to {law.share:.3g}, widths of {narrow:g} to {wide:g} um, up to "
        f"{acceptor:g} mg/L of acceptor and {donor:g} mg/L of donor")
    say(f"bound of the uptake: {100 * law.bound:.3g} %, more for thick bodies in fast flow")
    say(printable(f"file: {laws.file}"))
    return 0
