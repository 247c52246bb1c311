"""``repro check SCENE [--set KEY=VALUE] [--unset KEY] [--json]``: say what a run will be.

``repro check FOLDER`` says whether the run in a folder is complete and unchanged.
"""

from __future__ import annotations

import json
from pathlib import Path

from repro.cli.arguments import add_scene
from repro.errors import OutputError
from repro.runs.progress import say
from repro.scene import load_scene, packaged_scenes


def add(commands) -> None:
    """The parser of this command."""
    command = commands.add_parser(
        "check", help="validate a scene and say what a run of it will be, or check a run's files",
        description="Validate a scene; say what it models, its mesh, its dimensionless numbers, "
        "where a simplification does not hold, and what a run costs. Exit status: 0 where it can "
        "be run, with warnings or without, 2 where not. Of the folder of a run: are its files as "
        "they were written, by their SHA-256? Exit status: 0 where they are, 2 where not.")
    add_scene(command)
    command.add_argument("--json", action="store_true", help="for machines")
    command.set_defaults(call=call, refuse=command.error)


def call(chosen) -> int:
    """Check the scene, or the run, that was chosen."""
    folder = Path(chosen.scene)
    if chosen.scene not in packaged_scenes() and folder.is_dir():
        return _check_run(chosen, folder)
    scene = load_scene(chosen.scene, chosen.set, chosen.unset)
    from repro.preflight.checked import check, report

    found = check(scene, chosen.scene)
    say(json.dumps(found.tables(), indent=2) if chosen.json else report(found))
    return 0


def _check_run(chosen, folder: Path) -> int:
    """Say whether the files of a run are as they were written. Raises OutputError where not."""
    from repro.report.reading import NoRun
    from repro.runs.status import done
    from repro.runs.whole import state_of

    if chosen.set or chosen.unset:
        chosen.refuse("no --set or --unset is accepted with the folder of a run")
    try:
        status = state_of(folder)
    except NoRun as error:
        raise OutputError(str(error)) from error
    files = "its files are as they were written"
    if not done(status):
        files += f", and repro run --resume {folder} goes on with it"
    found = {"folder": str(folder), "status": status, "unchanged": True}
    say(json.dumps(found, indent=2) if chosen.json else f"{folder}: {status}; {files}")
    return 0
