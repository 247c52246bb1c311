"""The results of a run in its folder, as :func:`repro.solve` gives them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from repro.errors import OutputError
from repro.report import fields, reading
from repro.results import field_files
from repro.results.files import sha256_of
from repro.results.tables import Results, arrays
from repro.runs.folder import sums


def load_run(folder: str | Path) -> Results:
    """What a run has written in its folder, over or not: rows now, fields when they are asked for.

    Raises OutputError where the folder holds no run, or its files are not as they were written,
    and, when the fields of a time are asked for, where their file is missing or cannot be read.
    """
    try:
        run = reading.read(Path(folder))
        reading.require_columns(run)
        reading.require_lists(run)
        listed = dict(fields.listed(run.folder))
    except ValueError as error:
        raise OutputError(str(error)) from None
    rows = [dict(zip(run.series, map(_known, values)))
            for values in np.column_stack(list(run.series.values())).tolist()]
    files = _Files(run.folder, run.times, listed)
    return Results(str(run.record.get("scene")), rows, files, str(run.record.get("status")))


def _known(value: float) -> float | None:
    """A value of a table; None where there is none."""
    return None if np.isnan(value) else value


class _Files(Sequence[dict[str, np.ndarray]]):
    """The arrays of the fields of each row, read from its file when they are asked for; the file is
    the one of the row's time. As many as there are; iterated over are those alone."""

    def __init__(self, folder: Path, times: np.ndarray, files: dict[float, Path]):
        self.folder = folder
        self.times = times
        self.files = files
        self.sums = sums(folder)

    def __len__(self) -> int:
        return sum(path.is_file() for path in self.files.values())

    def __getitem__(self, row):
        time = float(self.times[row])
        path = self.files.get(time)
        if path is None:
            raise OutputError(f"{self.folder / 'fields.pvd'}: no fields of {time} h are listed")
        if not path.is_file():
            raise OutputError(f"{path}: the fields of {time} h are missing")
        return self._read(path)

    def __iter__(self) -> Iterator[dict[str, np.ndarray]]:
        return (self._read(path) for path in self.files.values() if path.is_file())

    def _read(self, path: Path) -> dict[str, np.ndarray]:
        """The arrays of a file, if it is as it was written."""
        try:
            if sha256_of(path) != self.sums.get(f"fields/{path.name}"):
                raise ValueError("the file is not as it was written: cut short or altered")
            return arrays(field_files.read(path))
        except (OSError, ValueError) as error:
            raise OutputError(f"{path}: the fields cannot be read: {error}") from error
