"""Pages that show runs: ``report.html`` of each run, and comparisons (``repro compare``).

    reading       a run's folder: run.json and its tables
    quantities    what is drawn over time
    charts        line charts as SVG
    fields        the fields of the .vtu files, packed for the page's script
    run_page, comparison   the two kinds of pages
    page          a page that is one file, needs no network and escapes what it is told
    *.css, *.js   its style and scripts
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from repro.report import comparison, run_page
from repro.report.reading import NoRun, read
from repro.results import write_text
from repro.results.files import whole

__all__ = ["NoRun", "compare", "write"]


def write(folder: Path) -> Path:
    """Make ``report.html`` from what a run has written in its folder; returns its path.

    Raises NoRun where the folder holds no run, ValueError where its fields cannot be read.
    """
    target = folder / "report.html"
    _write(target, run_page.build(read(folder)))
    return target


def compare(folders: Sequence[Path], target: Path) -> Path:
    """Make a page of two runs or more at ``target``; returns it.

    Raises NoRun where a folder holds no run.
    """
    _write(target, comparison.build([read(folder) for folder in folders]))
    return target


def _write(target: Path, text: str) -> None:
    with whole(target) as beside:
        write_text(beside, text)
