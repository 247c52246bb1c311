"""What a sweep leaves for others to read.

``table.csv`` has a row a run and time, ``runs.csv`` a row a run.
"""

from __future__ import annotations

import csv
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np

from repro import results
from repro.report.reading import NoRun
from repro.results.files import whole
from repro.results.quantities import Quantity
from repro.runs import status
from repro.runs.whole import run_of
from repro.sweeps.design import Point
from repro.sweeps.state import Sweep


@dataclass(frozen=True, eq=False)
class Course:
    """A run's rows: times (h), conductivity over the first one, biomass, all (T,), and where the
    aggregate touches the opposite wall; wall: seconds; clogged: see :func:`clogging`."""

    times: np.ndarray
    relative: np.ndarray
    biomass: np.ndarray
    touches: np.ndarray
    wall: float
    clogged: float

    @cached_property
    def clogging(self) -> tuple[float, float]:
        """Time (h) and biomass of :func:`clogging`, NaN where there is none."""
        return clogging(self.times, self.relative, self.biomass, self.clogged)

    def at_contact(self, values: np.ndarray) -> float:
        """In the first row with contact, NaN without; it is a plug then, through which the fluid
        seeps."""
        first = np.flatnonzero(self.touches)[:1]
        return float(values[first[0]]) if len(first) else np.nan


#: What ``runs.csv`` tells of a run besides what was varied: value takes its Course.
NUMBERS = (
    Quantity("end_h", "last time of the run", "time_h of the last row",
             lambda run: run.times[-1], "end"),
    Quantity("wall_time_s", "wall time", "that of run.json", lambda run: run.wall, "wall time"),
    Quantity("clogging_time_h", "time of clogging",
             "when conductivity_m_per_d over its first value has first fallen to --clogged; its "
             "logarithm is linear between rows", lambda run: run.clogging[0], "clogged"),
    Quantity("clogging_biomass", "biomass at clogging",
             "aggregate_area_um2 / (W L) then, linear between rows", lambda run: run.clogging[1],
             "biomass then"),
    Quantity("contact_time_h", "time of contact", "time_h of the first row with contact",
             lambda run: run.at_contact(run.times), "contact"),
    Quantity("contact_biomass", "biomass at contact", "aggregate_area_um2 / (W L) in that row",
             lambda run: run.at_contact(run.biomass), "biomass then"),
    Quantity("contact_relative_conductivity", "relative conductivity at contact",
             "conductivity_m_per_d in that row over its first value",
             lambda run: run.at_contact(run.relative), "conductivity then"),
)
COLUMNS = [each.name for each in NUMBERS]


@dataclass(frozen=True, eq=False)
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
    """Every run of a sweep; `ended` says how those ended that left none to read, by number."""
    return [_told(point, sweep.runs / point.name, ended.get(point.index, "not run"), clogged)
            for point in sweep.points]


def _told(point: Point, folder: Path, otherwise: str, clogged: float) -> Told:
    try:
        run = run_of(folder, point.scene)
    except NoRun:
        return _empty(point, otherwise)
    if run.record["status"] == status.RUNNING:  # it was killed, and its table may be cut short
        return _empty(point, otherwise)
    found = run.series
    pore = point.scene.pore
    times = run.times
    ended = run.record["status"]
    if not len(times):
        return _empty(point, ended)
    relative = found["conductivity_m_per_d"] / found["conductivity_m_per_d"][0]
    biomass = found["aggregate_area_um2"] / (pore.width * pore.length)
    wall = run.record["wall_time_s"]
    course = Course(times, relative, biomass, found["contact"] > 0, wall, clogged)
    numbers = {each.name: _or_none(each.reported(course)) for each in NUMBERS}
    return Told(point, ended, times, relative, biomass, numbers)


def _empty(point: Point, ended: str) -> Told:
    none = np.zeros(0)
    return Told(point, ended, none, none, none, dict.fromkeys(COLUMNS))


def _or_none(value: float) -> float | None:
    return None if np.isnan(value) else float(value)


def clogging(times: np.ndarray, relative: np.ndarray, biomass: np.ndarray,
             part: float) -> tuple[float, float]:
    """When (h) the relative conductivity has first fallen to `part`, and the biomass then.

    Between two rows the logarithm of the conductivity is linear in time. NaN where it has not
    fallen so far.
    """
    low = np.flatnonzero(relative <= part)
    if not len(low):
        return np.nan, np.nan
    i = low[0]
    along = np.log(relative[i - 1] / part) / np.log(relative[i - 1] / relative[i])
    time, held = (float(values[i - 1] + along * (values[i] - values[i - 1]))
                  for values in (times, biomass))
    return time, held


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
