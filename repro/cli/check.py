"""``repro check SCENE [--set KEY=VALUE] [--unset KEY] [--json]``: say what a run will be."""

from __future__ import annotations

import json

from repro.cli.arguments import add_scene
from repro.run.progress import say
from repro.scene import load_scene


def add(commands) -> None:
    """The parser of this command."""
    command = commands.add_parser(
        "check", help="validate a scene and say what a run of it will be",
        description="Validate a scene; say what it models, its mesh, its dimensionless numbers, "
        "where a simplification does not hold, and what a run costs. Exit status: 0 where it can "
        "be run, with warnings or without, 2 where not.")
    add_scene(command)
    command.add_argument("--json", action="store_true", help="for machines")
    command.set_defaults(call=call)


def call(chosen) -> int:
    """Check the scene that was chosen."""
    scene = load_scene(chosen.scene, chosen.set, chosen.unset)
    from repro.check.checked import check, report

    found = check(scene, chosen.scene)
    say(json.dumps(found.tables(), indent=2) if chosen.json else report(found))
    return 0
