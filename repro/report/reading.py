"""Read the tables of a run from its folder, for a page."""

from __future__ import annotations

import csv
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np

from repro.results import COLUMNS, LEDGER_COLUMNS, parse_table
from repro.results.files import MOST_TABLE, read_sealed, sha256
from repro.results.files import read as read_file


class NoRun(ValueError):
    """A folder holds no readable run."""


@dataclass(frozen=True, eq=False)
class Run:
    """A run: ``run.json``, and the columns of its tables (an empty field is NaN)."""

    folder: Path
    record: dict
    series: dict[str, np.ndarray]
    ledger: dict[str, np.ndarray]

    @property
    def times(self) -> np.ndarray:
        """(n,) times of the rows, h."""
        return self.series["time_h"]


def read(folder: Path) -> Run:
    """Read the run in a folder.

    The ``run.json`` of a run that is not running has the SHA-256 of its tables. Raises NoRun if the
    folder holds no run, or its files have changed since they were written.
    """
    record = _read(folder, "run.json", read_sealed)
    series = _read(folder, "timeseries.csv", lambda path: _series(_table(path, record), record))
    ledger = {}
    if "ledger.csv" in hashes(record) or (folder / "ledger.csv").exists():
        ledger = _read(folder, "ledger.csv", lambda path: _ledger(_table(path, record)))
    return Run(folder, record, series, ledger)


def hashes(record: dict) -> dict[str, str]:
    """The SHA-256 of each file in a record, by name; empty while the run is running."""
    digests = record.get("sha256")
    return digests if isinstance(digests, dict) else {}


def require_unchanged(name: str, content: bytes, record: dict) -> None:
    """Raise ValueError if the record has another SHA-256 for the content of a file."""
    if name in hashes(record) and hashes(record)[name] != sha256(content):
        raise ValueError("it is not as it was written: cut short or altered")


def require_columns(run: Run) -> None:
    """Raise NoRun if the time series lacks a column of this version."""
    if absent := set(COLUMNS) - run.series.keys():
        raise NoRun(f"{run.folder}: timeseries.csv has no column {min(absent)}; a run of this "
                    "version is needed")


def require_lists(run: Run) -> None:
    """Raise NoRun if a list of fields has changed since it was written."""
    names = {"fields.pvd", "fields.sha256"} & hashes(run.record).keys()
    for name in (name for name in names if (run.folder / name).exists()):
        _read(run.folder, name, partial(_require_file, record=run.record))


def _require_file(path: Path, record: dict) -> None:
    require_unchanged(path.name, read_file(path, MOST_TABLE), record)


def _read(folder: Path, name: str, parse):
    """Read one file of a run. Raises NoRun if it is missing or cannot be read."""
    try:
        return parse(folder / name)
    except FileNotFoundError:
        raise NoRun(f"{folder}: it holds no run: {name} is missing; a folder that `repro run` "
                    "wrote is needed") from None
    except (OSError, ValueError, csv.Error) as error:
        reason = getattr(error, "strerror", None) or error
        raise NoRun(f"{folder}: {name} cannot be read: {reason}; a folder that `repro run` wrote "
                    "is needed") from error


def _table(path: Path, record: dict) -> dict[str, np.ndarray]:
    """The columns of a table of the run with this record."""
    content = read_file(path, MOST_TABLE)
    require_unchanged(path.name, content, record)
    return parse_table(content)


def _series(series: dict[str, np.ndarray], record: dict) -> dict[str, np.ndarray]:
    """The time series. Raises ValueError if its times do not ascend, or if it has fewer rows than
    ``run.json``, which is written later."""
    _require_finite(series, ["time_h"])
    count = len(series["time_h"])
    rows = record.get("rows")
    if not isinstance(rows, int) or count < rows:
        raise ValueError(f"it has {count} rows, and run.json tells of {rows}")
    if (np.diff(series["time_h"]) <= 0).any():
        raise ValueError("its times do not ascend")
    return series


def _ledger(ledger: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    _require_finite(ledger, LEDGER_COLUMNS)
    return ledger


def _require_finite(table: dict[str, np.ndarray], names: list[str]) -> None:
    """Raise ValueError if a table lacks one of these columns, or its numbers are not finite."""
    for name in names:
        if name not in table or not np.isfinite(table[name]).all():
            raise ValueError(f"a column {name} of finite numbers is needed")
