"""What a run has left in its folder, read for a page."""

from __future__ import annotations

import csv
import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from repro.results import COLUMNS, LEDGER_COLUMNS, read_table


class NoRun(ValueError):
    """A folder holds no run that can be read; says which and why."""


@dataclass(frozen=True, eq=False)
class Run:
    """A run: ``run.json``, and the columns of its tables (an empty field is not-a-number)."""

    folder: Path
    record: dict
    series: dict[str, np.ndarray]
    ledger: dict[str, np.ndarray]

    @property
    def times(self) -> np.ndarray:
        """(n,) times of the rows, h."""
        return self.series["time_h"]


def read(folder: Path) -> Run:
    """The run in a folder.

    Raises NoRun where it holds none, or one whose files cannot be read.
    """
    record = _read(folder, "run.json", _record)
    series = _read(folder, "timeseries.csv", lambda path: _series(path, record.get("rows")))
    ledger = {}
    if (folder / "ledger.csv").exists():
        ledger = _read(folder, "ledger.csv", lambda path: _table(path, LEDGER_COLUMNS))
    return Run(folder, record, series, ledger)


def require_columns(run: Run) -> None:
    """Raise NoRun where the time series lacks a column that this version writes."""
    if absent := set(COLUMNS) - run.series.keys():
        raise NoRun(f"{run.folder}: timeseries.csv has no column {min(absent)}; a run of this "
                    "version is needed")


def _read(folder: Path, name: str, how):
    """One file of a run."""
    try:
        return how(folder / name)
    except FileNotFoundError:
        raise NoRun(f"{folder}: it holds no run: {name} is missing; a folder that `repro run` "
                    "wrote is needed") from None
    except (OSError, ValueError, RecursionError, csv.Error) as error:
        why = getattr(error, "strerror", None) or error
        raise NoRun(f"{folder}: {name} cannot be read: {why}; a folder that `repro run` wrote is "
                    "needed") from error


def _record(path: Path) -> dict:
    record = json.loads(path.read_text(encoding="utf-8"))
    if not isinstance(record, dict):
        raise ValueError("not a JSON object")
    return record


def _series(path: Path, told: object) -> dict[str, np.ndarray]:
    """The time series, with ascending times; of as many rows as ``run.json``, which is written
    after it, tells of, or more."""
    series = _table(path, ["time_h"])
    count = len(series["time_h"])
    if not isinstance(told, int) or count < told:
        raise ValueError(f"it has {count} rows, and run.json tells of {told}")
    if (np.diff(series["time_h"]) <= 0).any():
        raise ValueError("its times do not ascend")
    return series


def _table(path: Path, needed: list[str]) -> dict[str, np.ndarray]:
    """The columns of a table, among them the `needed` ones, which hold finite numbers alone."""
    table = read_table(path)
    for name in needed:
        if name not in table or not np.isfinite(table[name]).all():
            raise ValueError(f"a column {name} of finite numbers is needed")
    return table
