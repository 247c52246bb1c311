"""Results of a run as NumPy arrays with names and units: ``solve`` for scripts and notebooks."""

from __future__ import annotations

import difflib
from collections.abc import Iterator, Mapping, Sequence
from html import escape
from importlib import import_module

import numpy as np

from repro import results
from repro.errors import RunEnd
from repro.march.loop import SAME_TIME
from repro.march.simulation import simulate
from repro.results import names, picture
from repro.results.field_files import Grid
from repro.results.netcdf import TIME
from repro.results.quantities import plain as unit
from repro.scene import Source, load_scene

#: Times of a notebook's table at either end.
SHOWN = 5


class Results(Mapping[str, np.ndarray]):
    """Columns of a run by name, (rows,) each, a row at each reported time: those of
    ``timeseries.csv`` that the scene models; ``status`` says how the run ended. ``to_pandas``
    makes a data frame, ``to_xarray`` a dataset."""

    def __init__(self, name: str, rows: list[dict[str, float | None]],
                 fields: Sequence[Mapping[str, np.ndarray]], status: str):
        self.columns: dict[str, np.ndarray] = {}
        for key in results.COLUMNS:
            values = [row[key] for row in rows]
            if key == TIME or values.count(None) < len(values):
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
        fields = next(iter(self._fields), {})
        return {name: unit(name) for name in (*self.columns, *fields)}

    @property
    def time(self) -> np.ndarray:
        """Reported times, h."""
        return self.columns[TIME]

    def fields(self, time: float) -> Mapping[str, np.ndarray]:
        """What is known all over the pore at a reported time (h): places_um (N, 2), triangles
        (T, 3), or (T, 6) of quadratic ones, and values (N,), (N, 3) for vectors, or (T,) by name.
        Raises KeyError for any other time."""
        apart = np.abs(self.time - time)
        if not (apart <= SAME_TIME).any():
            near = f"the nearest is {self.time[apart.argmin()]} h" if len(apart) else "none is"
            raise KeyError(f"{time} h: not a reported time; {near}")
        return self._fields[int(apart.argmin())]

    def to_pandas(self):
        """A ``pandas.DataFrame`` of the columns by ``time_h``; ``attrs["units"]`` has their units.
        Raises ImportError where pandas is not installed."""
        frame = _package("pandas").DataFrame(self.columns).set_index(TIME)
        frame.attrs.update(scene=self.name, status=self.status,
                           units={name: unit(name) for name in self.columns})
        return frame

    def to_xarray(self):
        """An ``xarray.Dataset`` of the columns over ``time_h``, each with its ``units`` and
        ``long_name``. Raises ImportError where xarray is not installed."""
        told = {name: {"units": names.udunits(name), "long_name": names.words(name)}
                for name in self.columns}
        columns = {name: (TIME, values, told[name]) for name, values in self.columns.items()}
        times = {TIME: columns.pop(TIME)}
        about = {"scene": self.name, "status": self.status}
        return _package("xarray").Dataset(columns, times, about)

    def __repr__(self) -> str:
        size = f"{len(self.time)} rows, {len(self)} columns"
        return f"<Results of {self.name}: {size}, {self.status}>"

    def _repr_html_(self) -> str:
        """For notebooks: key figures, a picture of the last state, and a table with a line a
        column, the first and the last times side by side."""
        shown = list(range(len(self.time)))
        shown = shown if len(shown) <= 2 * SHOWN else [*shown[:SHOWN], *shown[-SHOWN:]]
        lines = [_html_row(f"{name} ({unit(name)})", column[shown])
                 for name, column in self.items()]
        caption = escape(f"{self.name}: {len(self.time)} rows, {len(shown)} shown; {self.status}")
        table = f"<table><caption>{caption}</caption>{''.join(lines)}</table>"
        return f"{self._shown()}<details><summary>{caption}</summary>{table}</details>"

    def _shown(self) -> str:
        """Key figures and the picture of the last state; nothing of a run without rows."""
        if not len(self.time):
            return ""
        known = len(self._fields) == len(self.time)
        shown = picture.figure(self._fields[-1], self.time[-1]) if known else ""
        return f"<p>{escape(self.name)}, {escape(picture.key_figures(self))}</p>{shown}"


def _html_row(head: str, values: np.ndarray) -> str:
    cells = "".join(f"<td>{value:.4g}</td>" for value in values)
    return f"<tr><th>{escape(head)}</th>{cells}</tr>"


def _package(name: str):
    """An optional package. Raises ImportError, in one line, where it is not installed."""
    try:
        return import_module(name)
    except ImportError:
        raise ImportError(f"the package {name} is not installed; pip install {name}") from None


def solve(scene: Source, overrides: Sequence[str] = (), unset: Sequence[str] = ()) -> Results:
    """Run a scene, one that was loaded, or a file, a packaged name, a dict of tables, with the keys
    of ``overrides`` ("KEY=VALUE") set and those of ``unset`` left out; keep its rows and fields, at
    ``output.times`` or after every step.

    Raises SceneError where it is not accepted, SimulationError where a stage fails. Memory grows
    with the reported times.
    """
    scene = load_scene(scene, overrides, unset)
    rows = []
    fields = []
    status = "completed"
    try:
        for instant in simulate(scene):
            rows.append(results.row(scene, instant))
            fields.append(arrays(results.fields(scene, instant.pore, instant.solved)))
    except RunEnd as end:
        status = str(end)
    return Results(scene.name, rows, fields, status)


def arrays(content: Grid) -> dict[str, np.ndarray]:
    """The arrays of a grid."""
    return {"places_um": content.points[:, :2], "triangles": content.cells, **content.point_data,
            **content.cell_data}
