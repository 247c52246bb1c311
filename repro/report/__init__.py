"""Pages of runs: ``report.html`` of each run, and comparisons (``repro compare``).

    reading       a run's folder: run.json and its tables
    quantities    the charts over time
    charts        line charts as SVG
    colours       viridis
    fields        the fields of the .vtu files, packed for the page's script
    answer        the beginning of a run's page: its answer, a table and a picture
    run_page, comparison   the two kinds of pages
    page          a page in one file that needs no network and escapes all text
    *.css, *.js   its style and scripts, which draw fields as SVG
"""

from collections.abc import Sequence
from pathlib import Path

from repro.errors import OutputError
from repro.report import comparison, run_page
from repro.report.reading import read
from repro.results import write_text
from repro.results.files import output_path
from repro.scene.arguments import typed


def write(folder: Path) -> Path:
    """Write ``report.html`` of the run in a folder; returns its path.

    Raises OutputError if the folder holds no run, or its fields cannot be read.
    """
    target = folder / "report.html"
    write_text(target, run_page.build(read(folder)))
    return target


@typed
def compare(folders: Sequence[str | Path], file: str | Path) -> Path:
    """Write a page that compares two or more runs.

    Parameters
    ----------
    folders : sequence of str or Path
        Folders of the runs; the others are compared with the first.
    file : str or Path
        The page to write; its name ends in .html.

    Returns
    -------
    Path
        The path of the page.

    Raises
    ------
    OutputError
        If there are fewer than two folders, a folder has no run, or the page cannot be written.
    TypeError
        If an argument has a wrong type: names the argument.

    Examples
    --------
    >>> import tempfile
    >>> import repro
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     runs = [repro.run("flow_only", f"{folder}/{width}", [f'pore.width="{width} um"']).folder
    ...             for width in (40, 50)]
    ...     print(repro.compare(runs, f"{folder}/both.html").name)
    both.html
    """
    target = Path(file)
    if len(folders) < 2:
        raise OutputError("compare: two runs or more are needed")
    if target.suffix != ".html":
        raise OutputError(f"{target}: a file name that ends in .html is needed")
    if (target.parent / "run.json").exists():
        raise OutputError(f"{target}: {target.parent} is the folder of a run; a file elsewhere is "
                          "needed")
    with output_path(target) as beside:
        write_text(beside, comparison.build([read(Path(folder)) for folder in folders]))
    return target
