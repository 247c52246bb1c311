"""The tables of a sweep.

``table.csv`` has a row for each run and time, ``runs.csv`` a row for each run.
"""

import csv
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

import numpy as np

from repro import results
from repro.errors import OutputError
from repro.results.files import is_file
from repro.results.quantities import Quantity, none_if_nan
from repro.runs import status
from repro.runs.integrity import read_scene_run
from repro.sweeps.design import Factor, Point
from repro.sweeps.folder import Sweep

#: Lines of a printed list of runs.
SHOWN = 10


@dataclass(frozen=True, eq=False)
class SweepRun:
    """The results of one run of a sweep.

    clogged: the relative conductivity of a clogged pore; series: the columns of its rows, empty
    without a run; wall: wall time (s).
    """

    point: Point
    status: str
    clogged: float
    series: dict[str, np.ndarray] = field(default_factory=dict)
    wall: float = math.nan

    def column(self, name: str) -> np.ndarray:
        """(T,) a column; empty without a run."""
        return self.series.get(name, np.zeros(0))

    @property
    def times(self) -> np.ndarray:
        """(T,) h."""
        return self.column("time_h")

    @cached_property
    def relative(self) -> np.ndarray:
        """(T,) conductivity over its first value."""
        conductivity = self.column("conductivity_m_per_d")
        return conductivity / conductivity[:1]

    @cached_property
    def biomass(self) -> np.ndarray:
        """(T,) area of the aggregate over that of the pore."""
        pore = self.point.scene.pore
        return self.column("aggregate_area_um2") / (pore.width * pore.length)

    @cached_property
    def numbers(self) -> dict[str, float | None]:
        """Values of COLUMNS, None if undefined."""
        return {number.name: none_if_nan(number.reported(self)) if len(self.times) else None
                for number in NUMBERS}

    @property
    def final(self) -> dict[str, float | None]:
        """The last values of :func:`final_columns`, None if undefined."""
        return {name: none_if_nan(values[-1]) for name, values in self.series.items()}

    @property
    def is_over(self) -> bool:
        """Is the run finished?"""
        return status.is_over(self.status)

    def falls_to(self, part: float) -> tuple[float, float]:
        """Time (h) and biomass of :func:`clogging`, NaN if the conductivity stays above a part."""
        return clogging(self.times, self.relative, self.biomass, part)

    def at_contact(self, values: np.ndarray) -> float:
        """The value in the first row with contact, NaN without contact. From that row on the
        aggregate is a plug through which the fluid seeps."""
        first = np.flatnonzero(self.column("contact") > 0)[:1]
        return float(values[first[0]]) if len(first) else np.nan

    def __repr__(self) -> str:
        values = ", ".join(map(str, self.point.values))
        end = self.numbers["end_h"]
        reached = "" if end is None else f", to {end:.4g} h"
        return f"<run {self.point.index} ({values}): {self.status}{reached}>"


#: The columns of ``runs.csv`` after the factors; ``value`` takes a SweepRun.
NUMBERS = (
    Quantity("end_h", "last time of the run", "time_h of the last row",
             lambda run: run.times[-1], "end"),
    Quantity("wall_time_s", "wall time", "that of run.json", lambda run: run.wall, "wall time"),
    Quantity("clogging_time_h", "time of clogging",
             "when conductivity_m_per_d over its first value has first fallen to --clogged; its "
             "logarithm is linear between rows", lambda run: run.falls_to(run.clogged)[0],
             "clogged"),
    Quantity("clogging_biomass", "biomass at clogging",
             "aggregate_area_um2 / (W L) then, linear between rows",
             lambda run: run.falls_to(run.clogged)[1], "biomass then"),
    Quantity("contact_time_h", "time of contact", "time_h of the first row with contact",
             lambda run: run.at_contact(run.times), "contact"),
    Quantity("contact_biomass", "biomass at contact", "aggregate_area_um2 / (W L) in that row",
             lambda run: run.at_contact(run.biomass), "biomass then"),
    Quantity("contact_relative_conductivity", "relative conductivity at contact",
             "conductivity_m_per_d in that row over its first value",
             lambda run: run.at_contact(run.relative), "conductivity then"),
    Quantity("half_conductivity_time_h", "time of half conductivity",
             "when conductivity_m_per_d over its first value has first fallen to 0.5; its "
             "logarithm is linear between rows",
             lambda run: run.falls_to(0.5)[0], "half conductivity"),
    Quantity("fold_time_h", "time of the fold",
             "time_h of the last row of a run that ends as a fold",
             lambda run: run.times[-1] if status.is_fold(run.status) else np.nan, "fold"),
)
COLUMNS = [number.name for number in NUMBERS]


def series_columns(points: Sequence[Point]) -> list[str]:
    """The columns of ``timeseries.csv`` in any of the runs."""
    return list(dict.fromkeys([*results.COLUMNS, *(name for point in points for name
                                                   in results.column_names(point.scene))]))


def final_columns(points: Sequence[Point]) -> list[str]:
    """The columns of a row of a run whose last values are in ``runs.csv``; ``end_h`` is their time.
    """
    return [name for name in series_columns(points) if name != "time_h"]


class Runs(list[SweepRun]):
    """The runs of a sweep; ``print`` shows at most ten lines."""

    def __repr__(self) -> str:
        shown = self if len(self) <= SHOWN else self[:SHOWN - 1]
        lines = list(map(repr, shown))
        if len(shown) < len(self):
            lines.append(f"... and {len(self) - len(shown)} more")
        return "\n".join(lines)


def read_runs(sweep: Sweep, statuses: dict[int, str], clogged: float) -> Runs:
    """Read every run of a sweep; statuses: of runs that cannot be read, by their number."""
    return Runs(_read_run(point, sweep.runs / point.name, statuses.get(point.index,
                                                                          status.NOT_RUN), clogged)
                for point in sweep.points)


def run_folders(folder: Path) -> list[Path]:
    """The folders of the runs with rows of a sweep, by its ``runs.csv``; else the folder itself."""
    file = folder / "runs.csv"
    if not is_file(file):
        return [folder]
    with file.open(encoding="utf-8", newline="") as lines:
        return [folder / row["folder"] for row in csv.DictReader(lines) if row["end_h"]]


def _read_run(point: Point, folder: Path, missing_status: str, clogged: float) -> SweepRun:
    try:
        run = read_scene_run(folder, point.scene)
    except OutputError:
        return SweepRun(point, missing_status, clogged)
    run_status = run.record["status"]
    if run_status == status.RUNNING:  # it was killed, and its table may be cut short
        return SweepRun(point, missing_status, clogged)
    series = run.series if len(run.times) else {}
    return SweepRun(point, run_status, clogged, series, run.record["wall_time_s"])


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
    results.write_table(sweep.folder / "table.csv",
                        ["run", *varied, *series_columns(sweep.points)], _rows(sweep, runs))
    columns = run_columns(sweep.factors, runs)
    results.write_table(sweep.folder / "runs.csv", list(columns), zip(*columns.values()))


def run_columns(factors: Sequence[Factor], runs: Sequence[SweepRun]) -> dict[str, list]:
    """The columns of ``runs.csv``, with a value for each run."""
    columns: dict[str, list] = {"run": [run.point.index for run in runs]}
    columns |= {factor.column: [run.point.values[k] for run in runs]
                for k, factor in enumerate(factors)}
    columns["status"] = [run.status for run in runs]
    columns |= {name: [run.numbers[name] for run in runs] for name in COLUMNS}
    columns |= {name: [run.final.get(name) for run in runs]
                for name in final_columns([run.point for run in runs])}
    columns["folder"] = [f"runs/{run.point.name}" for run in runs]
    return columns


def _rows(sweep: Sweep, runs: list[SweepRun]) -> Iterator[list]:
    """The rows of each run's own table, preceded by its number and the values of its factors."""
    columns = series_columns(sweep.points)
    for run in runs:
        if len(run.times):
            path = sweep.runs / run.point.name / "timeseries.csv"
            with path.open(encoding="utf-8", newline="") as lines:
                for row in csv.DictReader(lines):
                    values = [row.get(name, "") for name in columns]
                    yield [run.point.index, *run.point.values, *values]
