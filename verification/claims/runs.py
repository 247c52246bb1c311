"""The runs that the claims read: packaged scenes with changes, computed once, kept beside those of the figures.

All of them are those of the level at which numbers are computed now (`levels`).
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import meshio
import numpy as np

from paper_figures import runs as figures
from repro.results import read_table
from repro.run.cache import cached_runs, run_folder
from repro.scene import Scene, load_scene
from verification.claims.levels import cached, current

#: Runs of figures and claims, by scene and source.
CACHE = figures.CACHE

#: Section 4 and Figure 6, a row a shape update.
BASE, WIDE = ("base",), ("wide",)
#: Rows of t = 0 and of the last two shapes alone, for runs of which no more is asked.
LAST = 'output.times=["19.2 h", "19.4 h"]'
#: Section 4 with the fields before the expansion that Plate 1 shows.
PLATES = (*BASE, LAST)


def scene(name: str, *changes: str) -> Scene:
    """A packaged scene with the KEY=VALUE of --set, in the elements and steps of the present level."""
    said, level = load_scene(name, changes), current()
    numerics = replace(said.numerics, refinement=said.numerics.refinement / level.size)
    growth = said.growth and replace(said.growth, time_step=round(said.growth.time_step * level.step, 12))
    return replace(said, numerics=numerics, growth=growth)


def target(said: Scene) -> Path:
    """The folder of a scene's run, computed or not."""
    return run_folder(said, CACHE)


def compute(chosen) -> list[Path]:
    """Folders of runs given as ("base", "KEY=VALUE", ...), the missing ones computed side by side."""
    return cached_runs([scene(*run) for run in chosen], CACHE)


@cached
def folder(*run: str) -> Path:
    """Folder of one run, computed if it is not there."""
    return compute([run])[0]


@cached
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


def nearest(run: tuple[str, ...], time: float) -> float:
    """The time (h) of a run's row that is the nearest to a time (h): longer steps need not land on it."""
    hours = series(*run)["time_h"]
    return float(hours[np.abs(hours - time).argmin()])


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
