"""What a run has written so far: kept in its checkpoint, and checked when it is gone on with.

What grows with the run is arrays in the checkpoint, named ``record.*``; the rest is plain data.
"""

from __future__ import annotations

import hashlib
import math
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from repro import results
from repro.errors import CheckpointError
from repro.march.loop import State
from repro.model.transport import OVERSHOOT
from repro.results.files import is_file
from repro.results.quantities import Quantity
from repro.run.checkpoint import Arrays
from repro.run.stored import LARGEST, counted, counts, in_range
from repro.scene import Scene

#: How the arrays of a record are called in a checkpoint.
PREFIX = "record."
PLAIN = {"remeshes", "iterations", "seconds", "stages", "resumes", "warnings", "missed",
         "worst"}
#: {array: (kind of its numbers, shape)}; a letter is the same number wherever it stands.
ARRAYS = {"rows": ("f", "R", len(results.COLUMNS)), "whole": ("b", "R", len(results.COLUMNS)),
          "ledgers": ("f", "L", len(results.LEDGER_COLUMNS)), "before_h": ("f", "B"),
          "sizes": ("i", "F"), "hashes": ("u", "F", hashlib.sha256().digest_size)}
#: A pore a metre wide and long holds 3e16 pg/m of biomass: no number of a table is as large.
MOST = 1e18
#: How columns of places and of defects end, which may be negative.
SIGNED = ("stream_um", "_x_um", "_balance")
#: Rows of a table, each a list of numbers, None where there is none.
Table = list[list]


@dataclass(frozen=True)
class Mark:
    """What tells that a file is as it was written: its size in bytes, its SHA-256."""

    size: int
    digest: bytes

    def line(self, name: str) -> str:
        """The line of a file with this mark in what ``sha256sum --check`` takes."""
        return f"{self.digest.hex()}  {name}\n"


def mark(path: Path) -> Mark:
    """The mark of a file as it is now. Raises OSError where it cannot be read."""
    content = path.read_bytes()
    return Mark(len(content), hashlib.sha256(content).digest())


@dataclass
class Record:
    """Rows of the tables, ``(time in h, file)`` of the fields, their marks, and counts.

    seconds: of wall time, all together; stages: by stage; resumes: when the run was gone on with;
    warnings: ``key`` of the scene and ``text`` of each simplification that does not hold; missed:
    steps that do not meet the tolerance, the largest of their estimates is ``worst``.
    """

    rows: Table = field(default_factory=list)
    ledgers: Table = field(default_factory=list)
    index: list[tuple[float, str]] = field(default_factory=list)
    before: list[tuple[float, str]] = field(default_factory=list)
    marks: dict[str, Mark] = field(default_factory=dict)
    remeshes: int = 0
    iterations: dict[str, int] = field(default_factory=dict)
    seconds: float = 0.0
    stages: dict[str, float] = field(default_factory=dict)
    resumes: list[dict] = field(default_factory=list)
    warnings: list[dict[str, str]] = field(default_factory=list)
    missed: int = 0
    worst: float = 0.0

    @property
    def fields(self) -> list[str]:
        """The names of all files of fields."""
        return [name for _, name in (*self.index, *self.before)]


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
    """A record as what JSON can say, and arrays."""
    marks = [record.marks[name] for name in record.fields]
    digests = b"".join(one.digest for one in marks)
    arrays = {"rows": _numbers(record.rows, results.COLUMNS),
              "whole": _integers(record.rows, results.COLUMNS),
              "ledgers": _numbers(record.ledgers, results.LEDGER_COLUMNS),
              "before_h": np.array([time for time, _ in record.before], dtype=float),
              "sizes": np.array([one.size for one in marks], dtype=np.int64),
              "hashes": np.frombuffer(digests, np.uint8).reshape(len(marks), -1 if marks else 32)}
    plain = {name: getattr(record, name) for name in PLAIN}
    return plain, {PREFIX + name: array for name, array in arrays.items()}


def _numbers(rows: Table, columns: list[str]) -> np.ndarray:
    """(R, C) the numbers of a table, not-a-number where there is none."""
    flat = [math.nan if value is None else value for row in rows for value in row]
    return np.array(flat, dtype=float).reshape(len(rows), len(columns))


def _integers(rows: Table, columns: list[str]) -> np.ndarray:
    """(R, C) which of the numbers are integers, and are written without a point."""
    flat = [isinstance(value, int) for row in rows for value in row]
    return np.array(flat, dtype=bool).reshape(len(rows), len(columns))


def unpacked(scene: Scene, plain, arrays: Arrays) -> Record:
    """What :func:`packed` was given. Raises CheckpointError where it makes no sense."""
    right = isinstance(plain, dict) and set(plain) == PLAIN and _shaped(arrays)
    right = right and _is_plain(plain) and _is_numbers(arrays) and _is_possible(scene, arrays)
    if not right:
        raise CheckpointError("its rows or fields are not those of a run")
    rows = _table(arrays["rows"], arrays["whole"])
    ledgers = _table(arrays["ledgers"], np.zeros_like(arrays["ledgers"], dtype=bool))
    index = [(row[0], fields_name("fields", k)) for k, row in enumerate(rows)]
    before = [(time, fields_name("before_expansion", k))
              for k, time in enumerate(arrays["before_h"].tolist())]
    record = Record(rows, ledgers, index, before, **plain)
    record.marks.update(zip(record.fields, _marks(arrays)))
    return record


def _marks(arrays: Arrays) -> list[Mark]:
    return [Mark(size, digest.tobytes())
            for size, digest in zip(arrays["sizes"].tolist(), arrays["hashes"])]


def _shaped(arrays: Arrays) -> bool:
    """Are these the arrays of a record, by their names, kinds and shapes?"""
    if arrays.keys() != ARRAYS.keys():
        return False
    sizes: dict[Any, int] = {}
    for name, (kind, *shape) in ARRAYS.items():
        array = arrays[name]
        if array.dtype.kind != kind or array.ndim != len(shape):
            return False
        for wanted, count in zip(shape, array.shape):
            known = sizes.setdefault(wanted, count) if isinstance(wanted, str) else wanted
            if known != count:
                return False
    return sizes["F"] == sizes["R"] + sizes["B"]


def _is_plain(plain: dict) -> bool:
    """Do the counts and times make sense?"""
    stages = plain["stages"]
    return (counted(plain["remeshes"]) and counts(plain["iterations"])
            and counted(plain["missed"]) and in_range(plain["worst"], 0.0, LARGEST)
            and in_range(plain["seconds"], 0.0, LARGEST) and isinstance(plain["resumes"], list)
            and all(isinstance(resume, dict) for resume in plain["resumes"])
            and isinstance(plain["warnings"], list) and all(map(_is_warning, plain["warnings"]))
            and isinstance(stages, dict)
            and all(in_range(value, 0.0, LARGEST) for value in stages.values()))


def _is_warning(value) -> bool:
    return (isinstance(value, dict) and value.keys() == {"key", "text"}
            and all(isinstance(part, str) for part in value.values()))


def _is_numbers(arrays: Arrays) -> bool:
    """Are all numbers finite, but for columns that all rows leave out, and the integers counts?"""
    rows, whole = arrays["rows"], arrays["whole"]
    counted_ones = rows[whole]
    finite = (arrays["ledgers"], arrays["before_h"], counted_ones, rows[:, :1])
    empty = np.isnan(rows)
    return (not np.isinf(rows).any() and bool((empty.any(axis=0) == empty.all(axis=0)).all())
            and all(bool(np.isfinite(one).all()) for one in finite)
            and bool(((counted_ones >= 0) & (counted_ones < 2**53)).all())
            and bool((counted_ones == np.floor(counted_ones)).all()))


def _is_possible(scene: Scene, arrays: Arrays) -> bool:
    """Are no numbers of the tables beyond MOST, and no rows under what is possible?"""
    rows = np.nan_to_num(arrays["rows"])
    least = [_least(scene, name) for name in results.COLUMNS]
    beyond = any(bool((np.abs(one) > MOST).any()) for one in (rows, arrays["ledgers"]))
    return not beyond and bool((rows >= least).all())


def _least(scene: Scene, column: str) -> float:
    """The least that a column may hold; of concentrations what is refused of nodes, and more
    between them."""
    if column.endswith("_mg_per_L") and scene.largest.substrates:
        both = scene.largest.substrates
        return -OVERSHOOT * max(both.acceptor.supply, both.donor.supply)
    return -MOST if column.endswith(SIGNED) else 0.0


def _table(numbers: np.ndarray, whole: np.ndarray) -> Table:
    """The rows of a table from its numbers and which of them are integers."""
    return [list(map(_value, *row)) for row in zip(numbers.tolist(), whole.tolist())]


def _value(number: float, whole: bool):
    if math.isnan(number):
        return None
    return int(number) if whole else number


def check(folder: Path, state: State, record: Record) -> None:
    """Raises CheckpointError where rows or files are not those of a run that came to the state."""
    spans = [row[:2] for row in record.ledgers]
    spans += [[ledger.start, ledger.end] for ledger in state.ledgers]
    ends = [0.0, *(end for _, end in spans)]
    starts = [*(start for start, _ in spans), state.pore.time]
    apart = any(abs(end - start) > 1e-6 for end, start in zip(ends, starts))
    last = record.rows[-1][0] if record.rows else math.inf
    if apart or abs(last - state.row) > 1e-6 or last < ends[len(record.ledgers)] - 1e-6:
        raise CheckpointError("its rows do not end where its state is")
    steps = len(spans)
    if max(record.remeshes + state.remeshes, record.missed) > steps:
        raise CheckpointError("it counts more steps than it made")
    for name, written in record.marks.items():
        if not _is_as_written(folder / name, written):
            raise CheckpointError(f"{name} is not as it was written: missing, cut short or altered")


def _is_as_written(path: Path, written: Mark) -> bool:
    return is_file(path) and path.stat().st_size == written.size and mark(path) == written
