"""``repro check SCENE [--set KEY=VALUE] [--no-run] [--json]``: describe a run before it starts.

``repro check --error SCENE`` compares its run with a finer one instead.
``repro check FOLDER`` checks whether the run in a folder is complete and unchanged.
"""

import json
from pathlib import Path

from repro.cli.arguments import add_scene, seconds
from repro.errors import printable, shell_word
from repro.preflight import COMPARISON_TIME
from repro.runs.progress import say, while_checking
from repro.scene import load_scene, packaged_scenes


def add(commands) -> None:
    """Add the parser of this command."""
    command = commands.add_parser(
        "check", help="validate a scene and describe its run, or check the files of a run",
        description="Validate a scene, run it coarsely for at most 5 s (preset sketch), and print "
        "its model, its first mesh, its dimensionless numbers, a warning for each simplification "
        "that does not hold, the cost of a run, and when and why the coarse run stopped. "
        "With --error, run the scene in its preset and in the next finer one instead (of sketch, "
        "fast, accurate, exact; exact and the paper's presets with smaller elements and steps), "
        "and print the largest difference of each column. "
        "Exit status: 0 if the scene can be run, with or without warnings; 2 if not. If SCENE is "
        "the folder of a run, compare the SHA-256 of its files with the recorded ones instead. "
        "Exit status: 0 if all files are unchanged; 2 if not.")
    add_scene(command)
    command.add_argument("--no-run", action="store_true", help="make no step of the scene")
    command.add_argument("--error", action="store_true",
                         help="compare the run with a finer one")
    command.add_argument("--limit", metavar="SECONDS", type=seconds, default=COMPARISON_TIME,
                         help="processor time of both runs of --error; they are compared as far as "
                         "they come (default: %(default)g)")
    command.add_argument("--json", action="store_true", help="print the result as JSON")
    command.set_defaults(call=call, refuse=command.error)


def call(options) -> int:
    """Check the scene or the folder of a run."""
    folder = Path(options.scene)
    if options.scene not in packaged_scenes() and folder.is_dir():
        return _check_run(options, folder)
    scene = load_scene(options.scene, options.set, unset=options.unset)  # before the slow import
    if options.error and options.no_run:
        options.refuse("--error runs the scene, so that --no-run is not accepted with it")
    with while_checking(options.scene) as reach:
        from repro.preflight import checked, refined

        result: checked.SceneCheck | refined.FinerComparison
        if options.error:
            result = refined.compare_with_finer(scene, options.scene, options.limit, reach)
        else:
            result = checked.examine(scene, options.scene, not options.no_run, reach)
    say(json.dumps(result.tables(), indent=2) if options.json else str(result))
    return 0


def _check_run(options, folder: Path) -> int:
    """Report that the files of a run are unchanged. Raises OutputError if they are not."""
    from repro.runs.integrity import read_status
    from repro.runs.status import is_over

    if options.set or options.unset or options.no_run or options.error:
        options.refuse("--set, --unset, --no-run and --error are for a scene, not for the folder "
                       "of a run")
    status = read_status(folder)
    files = "its files are unchanged"
    if not is_over(status):
        files += f"; repro run --resume {shell_word(folder)} continues the run"
    record = {"folder": str(folder), "status": status, "unchanged": True}
    say(json.dumps(record, indent=2) if options.json else printable(f"{folder}: {status}; {files}"))
    return 0
