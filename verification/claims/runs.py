"""The runs that the claims read: packaged scenes with changes, computed once, kept beside those of the figures."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import meshio
import numpy as np

from paper_figures import runs as figures
from repro.cache import cached_runs
from repro.results import read_table
from repro.scene import Scene, load_scene

#: Runs of figures and claims, by scene and source.
CACHE = figures.CACHE

#: Section 4 and Figure 6, a row a shape update.
BASE, WIDE = ("base",), ("wide",)
#: The figures' run of section 4, with the fields before the expansion that Plate 1 shows.
PLATES = (figures.BASE.scene, *figures.BASE.overrides)
#: Rows of t = 0 and of the last two shapes alone, for runs of which no more is asked.
LAST = 'output.times=["19.2 h", "19.4 h"]'


def scene(name: str, *changes: str) -> Scene:
    """A packaged scene with the KEY=VALUE of --set."""
    return load_scene(name, changes)


def compute(chosen) -> list[Path]:
    """Folders of runs given as ("base", "KEY=VALUE", ...), the missing ones computed side by side."""
    return cached_runs([scene(*run) for run in chosen], CACHE)


@cache
def folder(*run: str) -> Path:
    """Folder of one run, computed if it is not there."""
    return compute([run])[0]


@cache
def series(*run: str) -> dict[str, np.ndarray]:
    """Columns of a run's ``timeseries.csv``."""
    return read_table(folder(*run) / "timeseries.csv")


def row_number(run: tuple[str, ...], time: float) -> int:
    """Number of a run's row at a time (h). Raises KeyError where there is none."""
    found = np.flatnonzero(np.abs(series(*run)["time_h"] - time) < 1e-6)
    if len(found) != 1:
        raise KeyError(f"{run}: {len(found)} rows at t = {time} h")
    return int(found[0])


def at(run: tuple[str, ...], time: float) -> dict[str, float]:
    """The row of a run at a time (h). Raises KeyError where there is none."""
    number = row_number(run, time)
    return {name: float(column[number]) for name, column in series(*run).items()}


def fields(run: tuple[str, ...], number: int, kind: str = "fields") -> meshio.Mesh:
    """Fields of a run: ``number`` counts its rows from 0 (-1: the last); kind "before_expansion" counts from the first
    row after t = 0, and is there only with output.times."""
    files = sorted((folder(*run) / "fields").glob(f"{kind}_*.vtu"))
    return meshio.read(files[number])


def fields_at(run: tuple[str, ...], time: float) -> meshio.Mesh:
    """Fields of a run in its row at a time (h)."""
    return fields(run, row_number(run, time))


def before_expansion(run: tuple[str, ...], time: float) -> meshio.Mesh:
    """Fields of a run with output.times at a time (h), grown and not yet expanded."""
    return fields(run, row_number(run, time) - 1, "before_expansion")
