"""What a sweep leaves for others to read.

``table.csv`` has a row a run and time, ``runs.csv`` a row a run.
"""

from __future__ import annotations

import csv
import json
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from repro import results
from repro.results.files import whole
from repro.run import status
from repro.sweep import task
from repro.sweep.design import Point
from repro.sweep.state import Sweep

COLUMNS = """end_h wall_time_s clogging_time_h clogging_biomass contact_time_h contact_biomass
contact_relative_conductivity""".split()


@dataclass(frozen=True)
class Told:
    """A run as a sweep tells it.

    times (h), relative: conductivity over the first one; biomass: area of the aggregate over that
    of the pore; all of them (T,), empty where there is no run. `numbers`: those of COLUMNS, None
    where there is none.
    """

    point: Point
    status: str
    times: np.ndarray
    relative: np.ndarray
    biomass: np.ndarray
    numbers: dict[str, float | None]

    @property
    def done(self) -> bool:
        """Has it come to its end?"""
        return status.done(self.status)


def tell(sweep: Sweep, ended: dict[int, str], clogged: float) -> list[Told]:
    """Every run of a sweep; `ended` says how those ended that left no run.json, by number."""
    return [_told(point, sweep.runs / point.name, ended.get(point.index, "not run"), clogged)
            for point in sweep.points]


def _told(point: Point, folder: Path, otherwise: str, clogged: float) -> Told:
    ended, found = task.status(folder), _series(folder)
    if ended is None or found is None:
        empty = np.zeros(0)
        return Told(point, ended or otherwise, empty, empty, empty, dict.fromkeys(COLUMNS))
    pore, times = point.scene.pore, found["time_h"]
    relative = found["conductivity_m_per_d"] / found["conductivity_m_per_d"][0]
    biomass = found["aggregate_area_um2"] / (pore.width * pore.length)
    wall = json.loads((folder / "run.json").read_text(encoding="utf-8"))["wall_time_s"]
    known = {"end_h": times[-1], "wall_time_s": wall,
             **clogging(times, relative, biomass, clogged),
             **_contact(times, relative, biomass, found["contact"] > 0)}
    numbers = {name: _or_none(known.get(name)) for name in COLUMNS}
    return Told(point, ended, times, relative, biomass, numbers)


def _series(folder: Path) -> dict[str, np.ndarray] | None:
    """The time series of a run, None where it has no row."""
    path = folder / "timeseries.csv"
    if not path.exists() or path.read_text(encoding="utf-8").count("\n") < 2:
        return None
    return results.read_table(path)


def _or_none(value: float | None) -> float | None:
    return None if value is None or np.isnan(value) else float(value)


def clogging(times: np.ndarray, relative: np.ndarray, biomass: np.ndarray,
             part: float) -> dict[str, float]:
    """When the relative conductivity has first fallen to `part`, and the biomass then.

    Between two rows the logarithm of the conductivity is linear in time. Nothing where it has not
    fallen so far.
    """
    low = np.flatnonzero(relative <= part)
    if not len(low):
        return {}
    i = low[0]
    along = np.log(relative[i - 1] / part) / np.log(relative[i - 1] / relative[i])
    between = [values[i - 1] + along * (values[i] - values[i - 1]) for values in (times, biomass)]
    return dict(zip(("clogging_time_h", "clogging_biomass"), between))


def _contact(times: np.ndarray, relative: np.ndarray, biomass: np.ndarray,
             touches: np.ndarray) -> dict[str, float]:
    """The first row in which the aggregate touches the opposite wall.

    It is a plug then, through which the fluid seeps.
    """
    found = np.flatnonzero(touches)
    if not len(found):
        return {}
    first = found[0]
    return {"contact_time_h": times[first], "contact_biomass": biomass[first],
            "contact_relative_conductivity": relative[first]}


def write(sweep: Sweep, told: list[Told]) -> None:
    """Write ``table.csv`` and ``runs.csv``."""
    varied = [factor.column for factor in sweep.factors]
    with whole(sweep.folder / "table.csv") as beside:
        results.write_table(beside, ["run", *varied, *results.COLUMNS], list(_rows(sweep, told)))
    runs = [[one.point.index, *one.point.values, one.status, *one.numbers.values(),
             f"runs/{one.point.name}"] for one in told]
    with whole(sweep.folder / "runs.csv") as beside:
        results.write_table(beside, ["run", *varied, "status", *COLUMNS, "folder"], runs)


def _rows(sweep: Sweep, told: list[Told]) -> Iterator[list]:
    """The rows of every run as its own table has them, behind its number and what was varied."""
    for one in told:
        if len(one.times):
            path = sweep.runs / one.point.name / "timeseries.csv"
            with path.open(encoding="utf-8", newline="") as lines:
                for row in csv.DictReader(lines):
                    values = [row[name] for name in results.COLUMNS]
                    yield [one.point.index, *one.point.values, *values]
