"""The tables of a sweep.

``table.csv`` has a row for each run and time, ``runs.csv`` a row for each run.
"""

from __future__ import annotations

import csv
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np

from repro import results
from repro.errors import OutputError
from repro.results.files import atomic_path
from repro.results.quantities import Quantity
from repro.runs import status
from repro.runs.integrity import read_scene_run
from repro.sweeps.design import Point
from repro.sweeps.folder import Sweep


@dataclass(frozen=True, eq=False)
class RunSeries:
    """The rows of a run.

    times (h), relative: conductivity over its first value, biomass, touches: does the aggregate
    touch the opposite wall; all (T,). wall: wall time (s); clogged: see :func:`clogging`.
    """

    times: np.ndarray
    relative: np.ndarray
    biomass: np.ndarray
    touches: np.ndarray
    wall: float
    clogged: float

    @cached_property
    def clogging(self) -> tuple[float, float]:
        """Time (h) and biomass of :func:`clogging`, NaN if the pore has not clogged."""
        return clogging(self.times, self.relative, self.biomass, self.clogged)

    def at_contact(self, values: np.ndarray) -> float:
        """The value in the first row with contact, NaN without contact. From that row on the
        aggregate is a plug through which the fluid seeps."""
        first = np.flatnonzero(self.touches)[:1]
        return float(values[first[0]]) if len(first) else np.nan


#: The columns of ``runs.csv`` after the factors; ``value`` takes a RunSeries.
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
COLUMNS = [number.name for number in NUMBERS]


@dataclass(frozen=True, eq=False)
class SweepRun:
    """The results of one run of a sweep.

    times (h); relative: conductivity over its first value; biomass: area of the aggregate over that
    of the pore; all (T,), empty without a run. numbers: values of COLUMNS, None if undefined.
    """

    point: Point
    status: str
    times: np.ndarray
    relative: np.ndarray
    biomass: np.ndarray
    numbers: dict[str, float | None]

    @property
    def is_over(self) -> bool:
        """Is the run finished?"""
        return status.is_over(self.status)


def read_runs(sweep: Sweep, statuses: dict[int, str], clogged: float) -> list[SweepRun]:
    """Read every run of a sweep; statuses: of runs that cannot be read, by their number."""
    return [_read_run(point, sweep.runs / point.name, statuses.get(point.index, "not run"), clogged)
            for point in sweep.points]


def _read_run(point: Point, folder: Path, missing_status: str, clogged: float) -> SweepRun:
    try:
        run = read_scene_run(folder, point.scene)
    except OutputError:
        return _empty_run(point, missing_status)
    if run.record["status"] == status.RUNNING:  # it was killed, and its table may be cut short
        return _empty_run(point, missing_status)
    series = run.series
    pore = point.scene.pore
    times = run.times
    run_status = run.record["status"]
    if not len(times):
        return _empty_run(point, run_status)
    relative = series["conductivity_m_per_d"] / series["conductivity_m_per_d"][0]
    biomass = series["aggregate_area_um2"] / (pore.width * pore.length)
    wall = run.record["wall_time_s"]
    course = RunSeries(times, relative, biomass, series["contact"] > 0, wall, clogged)
    numbers = {number.name: _none_if_nan(number.reported(course)) for number in NUMBERS}
    return SweepRun(point, run_status, times, relative, biomass, numbers)


def _empty_run(point: Point, run_status: str) -> SweepRun:
    none = np.zeros(0)
    return SweepRun(point, run_status, none, none, none, dict.fromkeys(COLUMNS))


def _none_if_nan(value: float) -> float | None:
    return None if np.isnan(value) else float(value)


def clogging(times: np.ndarray, relative: np.ndarray, biomass: np.ndarray,
             threshold: float) -> tuple[float, float]:
    """The time (h) at which the relative conductivity first falls to `threshold`, and the biomass
    at that time.

    Between two rows the logarithm of the conductivity is linear in time. Both are NaN if the
    conductivity stays above the threshold.
    """
    low = np.flatnonzero(relative <= threshold)
    if not len(low):
        return np.nan, np.nan
    i = low[0]
    fraction = np.log(relative[i - 1] / threshold) / np.log(relative[i - 1] / relative[i])
    time, mass = (float(values[i - 1] + fraction * (values[i] - values[i - 1]))
                  for values in (times, biomass))
    return time, mass


def write(sweep: Sweep, runs: list[SweepRun]) -> None:
    """Write ``table.csv`` and ``runs.csv``."""
    varied = [factor.column for factor in sweep.factors]
    with atomic_path(sweep.folder / "table.csv") as beside:
        results.write_table(beside, ["run", *varied, *results.COLUMNS], list(_rows(sweep, runs)))
    rows = [[run.point.index, *run.point.values, run.status, *run.numbers.values(),
             f"runs/{run.point.name}"] for run in runs]
    with atomic_path(sweep.folder / "runs.csv") as beside:
        results.write_table(beside, ["run", *varied, "status", *COLUMNS, "folder"], rows)


def _rows(sweep: Sweep, runs: list[SweepRun]) -> Iterator[list]:
    """The rows of each run's own table, preceded by its number and the values of its factors."""
    for run in runs:
        if len(run.times):
            path = sweep.runs / run.point.name / "timeseries.csv"
            with path.open(encoding="utf-8", newline="") as lines:
                for row in csv.DictReader(lines):
                    values = [row[name] for name in results.COLUMNS]
                    yield [run.point.index, *run.point.values, *values]
