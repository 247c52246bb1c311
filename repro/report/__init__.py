"""Pages of runs: ``report.html`` of each run, and comparisons (``repro compare``).

    reading       a run's folder: run.json and its tables
    quantities    the charts over time
    charts        line charts as SVG
    fields        the fields of the .vtu files, packed for the page's script
    run_page, comparison   the two kinds of pages
    page          a page in one file that needs no network and escapes all text
    *.css, *.js   its style and scripts
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from repro.report import comparison, run_page
from repro.report.reading import read
from repro.results import write_text
from repro.results.files import atomic_path

__all__ = ["compare", "write"]


def write(folder: Path) -> Path:
    """Write ``report.html`` of the run in a folder; returns its path.

    Raises OutputError if the folder holds no run, or its fields cannot be read.
    """
    target = folder / "report.html"
    _write(target, run_page.build(read(folder)))
    return target


def compare(folders: Sequence[Path], target: Path) -> Path:
    """Write a page that compares two or more runs; returns its path.

    Raises OutputError if a folder holds no run.
    """
    _write(target, comparison.build([read(folder) for folder in folders]))
    return target


def _write(target: Path, text: str) -> None:
    with atomic_path(target) as beside:
        write_text(beside, text)
