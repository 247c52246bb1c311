"""The history of a run: its rows, fields and counts so far. A checkpoint stores it."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from repro import results
from repro.errors import CheckpointError
from repro.results.files import is_file, sha256_of
from repro.results.quantities import Quantity
from repro.runs.checkpoint import Arrays

#: Rows of a table, each a list of numbers or None.
Table = list[list]
#: The columns of each table of a history.
TABLES = {"rows": results.COLUMNS, "ledgers": results.LEDGER_COLUMNS}


@dataclass
class History:
    """Rows of the tables, ``(time in h, file)`` of the fields, their SHA-256, and counts.

    seconds: total wall time; stages: wall time by stage; resumes: when the run was resumed;
    warnings: ``key`` of the scene and ``text`` of each simplification that does not hold; missed:
    number of steps that do not meet the tolerance; worst: the largest of their error estimates.
    """

    rows: Table = field(default_factory=list)
    ledgers: Table = field(default_factory=list)
    index: list[tuple[float, str]] = field(default_factory=list)
    before: list[tuple[float, str]] = field(default_factory=list)
    hashes: dict[str, str] = field(default_factory=dict)
    remeshes: int = 0
    iterations: dict[str, int] = field(default_factory=dict)
    seconds: float = 0.0
    stages: dict[str, float] = field(default_factory=dict)
    resumes: list[dict] = field(default_factory=list)
    warnings: list[dict[str, str]] = field(default_factory=list)
    missed: int = 0
    worst: float = 0.0


#: The counts and times in ``run.json``; ``value`` takes a History.
COUNTS = (
    Quantity("rows", "rows of the time series", "those of timeseries.csv",
             lambda history: len(history.rows)),
    Quantity("wall_time_s", "wall time", "of the process that runs, and of those before a resume",
             lambda history: history.seconds),
    Quantity("wall_time_by_stage_s", "wall time by stage",
             "within each stage; what a stage calls is counted in both",
             lambda history: history.stages),
    Quantity("newton_iterations", "Newton's iterations, for growth and for transport",
             "of the solutions that steps begin and end with: neither those of half a step nor "
             "attempts that were given up", lambda history: history.iterations),
    Quantity("remeshes", "meshes made anew", "steps that end on a new mesh",
             lambda history: history.remeshes),
)


def fields_name(kind: str, number: int) -> str:
    """Name of the fields file of a kind ("fields", "before_expansion") and number."""
    return f"fields/{kind}_{number:04d}.vtu"


def pack_history(history: History) -> tuple[dict, Arrays]:
    """Convert a history to values for JSON, and the numbers of its tables as arrays."""
    values = vars(history)
    plain = {name: value for name, value in values.items() if name not in TABLES}
    arrays = {name: _numbers(values[name], columns) for name, columns in TABLES.items()}
    return plain, arrays | {"integers": _integers(history.rows)}


def _numbers(rows: Table, columns: list[str]) -> np.ndarray:
    """(R, C) the numbers of a table, NaN for None."""
    flat = [math.nan if value is None else value for row in rows for value in row]
    return np.array(flat, dtype=float).reshape(len(rows), len(columns))


def _integers(rows: Table) -> np.ndarray:
    """(R, C) True for integers, which are written without a decimal point."""
    return np.array([[isinstance(value, int) for value in row] for row in rows], dtype=bool)


def unpack_history(plain: dict, arrays: Arrays) -> History:
    """Invert :func:`pack_history`."""
    ledgers = arrays["ledgers"]
    pairs = {name: list(map(tuple, plain[name])) for name in ("index", "before")}
    return History(rows=_table(arrays["rows"], arrays["integers"]),
                  ledgers=_table(ledgers, np.zeros_like(ledgers, dtype=bool)), **plain | pairs)


def _table(numbers: np.ndarray, integers: np.ndarray) -> Table:
    """The rows of a table from its numbers and a mask of its integers."""
    return [list(map(_value, *row)) for row in zip(numbers.tolist(), integers.tolist())]


def _value(number: float, is_integer: bool):
    if math.isnan(number):
        return None
    return int(number) if is_integer else number


def require_fields(folder: Path, history: History) -> None:
    """Raise CheckpointError if the SHA-256 of a fields file is not the one in the history."""
    for name, expected in history.hashes.items():
        if not is_file(folder / name) or sha256_of(folder / name) != expected:
            raise CheckpointError(f"{name} is not as it was written: missing, cut short or altered")
