"""``repro check SCENE [--set KEY=VALUE] [--unset KEY] [--json]``: describe a run before it starts.

``repro check FOLDER`` checks whether the run in a folder is complete and unchanged.
"""

from __future__ import annotations

import json
from pathlib import Path

from repro.cli.arguments import add_scene
from repro.runs.progress import say, while_checking
from repro.scene import load_scene, packaged_scenes


def add(commands) -> None:
    """Add the parser of this command."""
    command = commands.add_parser(
        "check", help="validate a scene and say what a run of it will be, or check a run's files",
        description="Validate a scene; say what it models, its mesh, its dimensionless numbers, "
        "where a simplification does not hold, and what a run costs. Exit status: 0 where it can "
        "be run, with warnings or without, 2 where not. Of the folder of a run: are its files as "
        "they were written, by their SHA-256? Exit status: 0 where they are, 2 where not.")
    add_scene(command)
    command.add_argument("--json", action="store_true", help="for machines")
    command.set_defaults(call=call, refuse=command.error)


def call(options) -> int:
    """Check the scene or the folder of a run."""
    folder = Path(options.scene)
    if options.scene not in packaged_scenes() and folder.is_dir():
        return _check_run(options, folder)
    load_scene(options.scene, options.set, unset=options.unset)  # before the slow import
    with while_checking(options.scene):
        from repro.preflight.checked import check, report

        checked = check(options.scene, options.set, unset=options.unset)
    say(json.dumps(checked.tables(), indent=2) if options.json else report(checked))
    return 0


def _check_run(options, folder: Path) -> int:
    """Report that the files of a run are unchanged. Raises OutputError if they are not."""
    from repro.runs.integrity import read_status
    from repro.runs.status import is_over

    if options.set or options.unset:
        options.refuse("no --set or --unset is accepted with the folder of a run")
    status = read_status(folder)
    files = "its files are as they were written"
    if not is_over(status):
        files += f", and repro run --resume {folder} goes on with it"
    record = {"folder": str(folder), "status": status, "unchanged": True}
    say(json.dumps(record, indent=2) if options.json else f"{folder}: {status}; {files}")
    return 0
