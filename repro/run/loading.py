"""The results of a run in its folder, as :func:`repro.solve` gives them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from repro.errors import OutputError
from repro.report import fields, reading
from repro.results import vtu
from repro.results.tables import Results, arrays


def load_run(folder: str | Path) -> Results:
    """What a run has written in its folder, over or not: rows now, fields when they are asked for.

    Raises OutputError where the folder holds no run that can be read.
    """
    try:
        run = reading.read(Path(folder))
    except reading.NoRun as error:
        raise OutputError(str(error)) from None
    rows = [dict(zip(run.series, map(_known, values)))
            for values in np.column_stack(list(run.series.values())).tolist()]
    files = _Files([path for _, path in fields.index(run.folder)])
    return Results(str(run.record.get("scene")), rows, files, str(run.record.get("status")))


def _known(value: float) -> float | None:
    """A value of a table; None where there is none."""
    return None if np.isnan(value) else value


class _Files(Sequence[dict[str, np.ndarray]]):
    """The arrays of the files of fields, each read when it is asked for."""

    def __init__(self, paths: list[Path]):
        self.paths = paths

    def __len__(self) -> int:
        return len(self.paths)

    def __getitem__(self, row):
        return arrays(vtu.read(self.paths[row]))

    def __iter__(self) -> Iterator[dict[str, np.ndarray]]:
        return (self[row] for row in range(len(self)))
