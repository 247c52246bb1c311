"""``repro permeability FOLDER [--out FILE]``: K / K0 of a run or a sweep for the Darcy scale."""

from repro.cli.arguments import path
from repro.errors import OutputError, printable
from repro.runs.progress import say


def add(commands) -> None:
    """Add the parser of this command."""
    command = commands.add_parser(
        "permeability", help="fit laws of K / K0 for models on the Darcy scale",
        description="Fit the usual laws of K / K0 against biomass per pore volume and porosity to "
        "the rows of a run, or of all runs of a sweep, and print their constants and errors.")
    command.add_argument("folder", metavar="FOLDER", type=path, help="folder of a run or a sweep")
    command.add_argument("--out", metavar="FILE.csv", type=path,
                         help="write the rows, and the laws in them, as a table")
    command.set_defaults(call=call)


def call(options) -> int:
    """Print the laws, and write the table."""
    from repro.results.permeability import of_runs
    from repro.runs.scripts import load_run
    from repro.sweeps.table import run_folders

    try:
        permeability = of_runs(list(map(load_run, run_folders(options.folder))))
    except (KeyError, ValueError) as error:
        raise OutputError(f"{options.folder}: {error.args[0]}") from error
    say(str(permeability))
    if options.out:
        permeability.to_csv(options.out)
        say(printable(f"table: {options.out}"))
    return 0
