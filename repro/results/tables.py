"""Results of a run as NumPy arrays with names and units: ``solve`` for scripts and notebooks."""

from __future__ import annotations

import difflib
from collections.abc import Iterator, Mapping
from html import escape

import meshio
import numpy as np

from repro import results
from repro.march.loop import SAME_TIME, PoreEnd
from repro.march.simulation import simulate
from repro.results.quantities import plain as unit
from repro.scene import Scene

#: Times of a notebook's table at either end.
SHOWN = 5


class Results(Mapping[str, np.ndarray]):
    """Columns of a run by name, (rows,) each, a row at each reported time: those of
    ``timeseries.csv`` that the scene models; ``status`` says how the run ended. ``dict(results)``
    makes a data frame."""

    def __init__(self, name: str, rows: list[dict[str, float | None]],
                 fields: list[dict[str, np.ndarray]], status: str):
        self.columns: dict[str, np.ndarray] = {}
        for key in results.COLUMNS:
            values = [row[key] for row in rows]
            if values.count(None) < len(values):
                self.columns[key] = np.array([np.nan if value is None else value
                                              for value in values])
        self.name = name
        self.status = status
        self._fields = fields

    def __getitem__(self, name: str) -> np.ndarray:
        if name not in self.columns:
            near = difflib.get_close_matches(name, self.columns, n=1, cutoff=0.5)
            meant = f"; did you mean {near[0]}?" if near else ""
            raise KeyError(f"{name}: this scene has no such column{meant}")
        return self.columns[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self.columns)

    def __len__(self) -> int:
        return len(self.columns)

    @property
    def units(self) -> dict[str, str]:
        """The unit of each column and field; "1" for a plain number."""
        return {name: unit(name) for name in (*self.columns, *self._fields[0])}

    @property
    def time(self) -> np.ndarray:
        """Reported times, h."""
        return self.columns["time_h"]

    def fields(self, time: float) -> dict[str, np.ndarray]:
        """What is known all over the pore at a reported time (h): places_um (N, 2), triangles
        (T, 3), or (T, 6) of quadratic ones, and values (N,), (N, 3) for vectors, or (T,) by name.
        Raises KeyError for any other time."""
        row = int(np.argmin(np.abs(self.time - time)))
        if abs(self.time[row] - time) > SAME_TIME:
            raise KeyError(f"{time} h: not a reported time; the nearest is {self.time[row]} h")
        return self._fields[row]

    def __repr__(self) -> str:
        size = f"{len(self.time)} rows, {len(self)} columns"
        return f"<Results of {self.name}: {size}, {self.status}>"

    def _repr_html_(self) -> str:
        """A table for notebooks: a line a column, the first and the last times side by side."""
        shown = list(range(len(self.time)))
        shown = shown if len(shown) <= 2 * SHOWN else [*shown[:SHOWN], *shown[-SHOWN:]]
        lines = [_html_row(f"{name} ({unit(name)})", column[shown])
                 for name, column in self.items()]
        caption = escape(f"{self.name}: {len(self.time)} rows, {len(shown)} shown; {self.status}")
        return f"<table><caption>{caption}</caption>{''.join(lines)}</table>"


def _html_row(head: str, values: np.ndarray) -> str:
    cells = "".join(f"<td>{value:.4g}</td>" for value in values)
    return f"<tr><th>{escape(head)}</th>{cells}</tr>"


def solve(scene: Scene) -> Results:
    """Run a scene and keep its rows and fields, at ``output.times`` or after every step.

    Raises SimulationError where a stage fails. Memory grows with the reported times.
    """
    rows = []
    fields = []
    status = "completed"
    try:
        for instant in simulate(scene):
            rows.append(results.row(scene, instant))
            fields.append(_arrays(results.fields(scene, instant.pore, instant.solved)))
    except PoreEnd as end:
        status = str(end)
    return Results(scene.name, rows, fields, status)


def _arrays(content: meshio.Mesh) -> dict[str, np.ndarray]:
    """The arrays of a meshio mesh."""
    (cells,) = content.cells
    by_cell = {name: values for name, (values,) in content.cell_data.items()}
    return {"places_um": content.points[:, :2], "triangles": cells.data, **content.point_data,
            **by_cell}
