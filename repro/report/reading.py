"""Read the tables of a run from its folder, for a page."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

import numpy as np

from repro.errors import OutputError
from repro.results import COLUMNS, parse_table
from repro.results.files import MOST_TABLE, read_sealed, sha256
from repro.results.files import read as read_file
from repro.scene import Scene, parse_scene, without_former

Content = TypeVar("Content")
NEEDED = "the folder of a run is needed or, for a new run, another folder"


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

    @property
    def scene(self) -> Scene:
        """Its scene. Raises SceneError if this version does not accept it."""
        return parse_scene(self.record["tables"], self.record["scene"],
                           str(self.folder / "run.json"))


def read(folder: Path) -> Run:
    """Read the run in a folder.

    The ``run.json`` of a run that is not running has the SHA-256 of its tables. Raises OutputError
    if the folder holds no run, or its files have changed since they were written.
    """
    record = read_record(folder)
    ledger = {}
    if "ledger.csv" in record["sha256"] or (folder / "ledger.csv").exists():
        ledger = _table(folder, "ledger.csv", record)
    return Run(folder, record, _table(folder, "timeseries.csv", record), ledger)


def read_record(folder: Path, parse: Callable[[Path], dict] = read_sealed) -> dict:
    """Read ``run.json``, of this version or an earlier one.

    Raises OutputError if it is missing or has changed since it was written.
    """
    record = _read(folder, "run.json", parse)
    return record | {"tables": without_former(record.get("tables"))}


def _table(folder: Path, name: str, record: dict) -> dict[str, np.ndarray]:
    """The columns of a table of the run with this record."""
    return _read(folder, name, lambda path: parse_table(_unchanged(path, record)))


def _unchanged(path: Path, record: dict) -> bytes:
    """The content of a file. Raises ValueError if the record has another SHA-256 for it."""
    content = read_file(path, MOST_TABLE)
    if record["sha256"].get(path.name, sha256(content)) != sha256(content):
        raise ValueError("it is not as it was written: cut short or altered")
    return content


def require_columns(run: Run) -> None:
    """Raise OutputError if the time series lacks a column of this version."""
    if absent := set(COLUMNS) - run.series.keys():
        raise OutputError(f"{run.folder}: timeseries.csv has no column {min(absent)}; a run of "
                          "this version is needed")


def require_lists(run: Run) -> None:
    """Raise OutputError if a list of fields has changed since it was written."""
    for name in ("fields.pvd", "fields.sha256"):
        if (run.folder / name).exists():
            _read(run.folder, name, lambda path: _unchanged(path, run.record))


def _read(folder: Path, name: str, parse: Callable[[Path], Content]) -> Content:
    """Read one file of a run. Raises OutputError if it is missing or cannot be read."""
    try:
        return parse(folder / name)
    except FileNotFoundError:
        raise OutputError(f"{folder}: it holds no run: {name} is missing; {NEEDED}") from None
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise OutputError(f"{folder}: {name} cannot be read: {reason}; {NEEDED}") from error
