"""What a run has written so far: kept in its checkpoint."""

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

#: Rows of a table, each a list of numbers, None where there is none.
Table = list[list]
#: The columns of each table of a record.
TABLES = {"rows": results.COLUMNS, "ledgers": results.LEDGER_COLUMNS}


@dataclass
class Record:
    """Rows of the tables, ``(time in h, file)`` of the fields, their SHA-256, and counts.

    seconds: of wall time, all together; stages: by stage; resumes: when the run was gone on with;
    warnings: ``key`` of the scene and ``text`` of each simplification that does not hold; missed:
    steps that do not meet the tolerance, the largest of their estimates is ``worst``.
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


#: What ``run.json`` tells of a record: value takes it.
COUNTS = (
    Quantity("rows", "rows of the time series", "those of timeseries.csv",
             lambda now: len(now.rows)),
    Quantity("wall_time_s", "wall time", "of the process that runs, and of those before a resume",
             lambda now: now.seconds),
    Quantity("wall_time_by_stage_s", "wall time by stage",
             "within each stage; what a stage calls is counted in both", lambda now: now.stages),
    Quantity("newton_iterations", "Newton's iterations, for growth and for transport",
             "of the solutions that steps begin and end with: neither those of half a step nor "
             "attempts that were given up", lambda now: now.iterations),
    Quantity("remeshes", "meshes made anew", "steps that end on a new mesh",
             lambda now: now.remeshes),
)


def fields_name(kind: str, number: int) -> str:
    """The file of fields of that kind ("fields", "before_expansion") and number."""
    return f"fields/{kind}_{number:04d}.vtu"


def packed(record: Record) -> tuple[dict, Arrays]:
    """A record as what JSON can say, and the numbers of its tables as arrays."""
    parts = vars(record)
    plain = {name: value for name, value in parts.items() if name not in TABLES}
    arrays = {name: _numbers(parts[name], columns) for name, columns in TABLES.items()}
    return plain, arrays | {"integers": _integers(record.rows)}


def _numbers(rows: Table, columns: list[str]) -> np.ndarray:
    """(R, C) the numbers of a table, not-a-number where there is none."""
    flat = [math.nan if value is None else value for row in rows for value in row]
    return np.array(flat, dtype=float).reshape(len(rows), len(columns))


def _integers(rows: Table) -> np.ndarray:
    """(R, C) which of the numbers are integers, and are written without a point."""
    return np.array([[isinstance(value, int) for value in row] for row in rows], dtype=bool)


def unpacked(plain: dict, arrays: Arrays) -> Record:
    """The record that :func:`packed` was given."""
    ledgers = arrays["ledgers"]
    pairs = {name: [tuple(entry) for entry in plain[name]] for name in ("index", "before")}
    return Record(rows=_table(arrays["rows"], arrays["integers"]),
                  ledgers=_table(ledgers, np.zeros_like(ledgers, dtype=bool)), **plain | pairs)


def _table(numbers: np.ndarray, integers: np.ndarray) -> Table:
    """The rows of a table from its numbers and which of them are integers."""
    return [list(map(_value, *row)) for row in zip(numbers.tolist(), integers.tolist())]


def _value(number: float, is_integer: bool):
    if math.isnan(number):
        return None
    return int(number) if is_integer else number


def require_fields(folder: Path, record: Record) -> None:
    """Raise CheckpointError where a file of fields is not as the record has it."""
    for name, expected in record.hashes.items():
        if not is_file(folder / name) or sha256_of(folder / name) != expected:
            raise CheckpointError(f"{name} is not as it was written: missing, cut short or altered")
