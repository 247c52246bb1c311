"""Load the results of a run from its folder, as :func:`repro.solve` returns them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from repro.errors import OutputError
from repro.report import fields, reading
from repro.results import field_files
from repro.results.files import sha256_of
from repro.results.tables import Results, arrays
from repro.runs.folder import read_sums


def load_run(folder: str | Path) -> Results:
    """Load the results of a run, finished or not, from its folder.

    Rows are read at once, the fields of a time when they are accessed.

    Parameters
    ----------
    folder : str or Path
        Folder of the run.

    Returns
    -------
    Results
        The rows, fields and status of the run, in the units of their names.

    Raises
    ------
    OutputError
        If the folder holds no run, or its files have changed since they were written. Accessing the
        fields of a time raises it if their file is missing or cannot be read.

    Examples
    --------
    >>> import tempfile
    >>> import repro
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     _ = repro.run("flow_only", folder)
    ...     results = repro.load_run(folder)
    >>> results.status
    'completed'
    """
    run = reading.read(Path(folder))
    reading.require_columns(run)
    reading.require_lists(run)
    listed_fields = dict(fields.listed_files(run.folder))
    rows = [dict(zip(run.series, map(_none_if_nan, values)))
            for values in np.column_stack(list(run.series.values())).tolist()]
    files = _Files(run.folder, run.times, listed_fields)
    return Results(run.record["scene"], rows, files, run.record["status"])


def _none_if_nan(value: float) -> float | None:
    """Replace NaN in a table by None."""
    return None if np.isnan(value) else value


class _Files(Sequence[dict[str, np.ndarray]]):
    """The arrays of the fields of each row, read from the file of its time when accessed.

    The length is the number of existing files, and iteration covers only these.
    """

    def __init__(self, folder: Path, times: np.ndarray, files: dict[float, Path]):
        self.folder = folder
        self.times = times
        self.files = files
        self.sums = read_sums(folder)

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
        """Read the arrays of a file. Raises OutputError if it has changed or cannot be read."""
        if sha256_of(path) != self.sums.get(f"fields/{path.name}"):
            raise OutputError(f"{path}: the fields are not as they were written: cut short or "
                              "altered")
        return arrays(field_files.read(path))
