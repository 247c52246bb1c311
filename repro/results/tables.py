"""Results of a run as NumPy arrays with names and units: ``solve`` for scripts and notebooks."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import lru_cache
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from repro import results
from repro.errors import RunEnd, printable, shortened
from repro.march.simulation import report_at, reports, steps
from repro.march.state import SAME_TIME, Report, RestartState
from repro.results import drawing, names, outlines, sampling
from repro.results.drawing import Photograph, Style
from repro.results.files import output_path
from repro.results.outlines import Outline
from repro.results.quantities import plain as unit
from repro.scene import Scene, Source, bodies, load_scene, scene_tables
from repro.scene.arguments import Overrides, typed
from repro.scene.needed import package
from repro.scene.units import nearest, to_internal
from repro.schemes import Scheme
from repro.timing import progress_bar

if TYPE_CHECKING:
    from repro.results.permeability import Permeability

TIME = "time_h"
#: The name of the picture of all outlines.
OUTLINES = "outlines"
#: Number of outlines that a picture shows, if no times are given.
MOST_OUTLINES = 10
#: Number of first and of last times in the table of a notebook.
END_TIMES = 5


class Results(Mapping[str, np.ndarray]):
    """Rows and fields of a run: a mapping from column names to arrays, a value per reported time.

    Parameters
    ----------
    name : str
        Name of the scene.
    rows : list of dict
        Rows of ``timeseries.csv``; None where the scene does not model a column.
    fields : sequence of mappings
        Fields of each row, as :meth:`fields` returns them.
    status : str
        How the run ended.
    folder : Path, optional
        Folder of the run; None if it is not on the disk.
    tables : mapping, optional
        Tables of the scene, with units; curves jump where its tables over time do.
    provenance : mapping, optional
        ``hash`` of the scene and ``versions`` of the packages, for :meth:`to_netcdf`.
    rerun : callable, optional
        Computes the fields at a time (h) between rows.

    Notes
    -----
    Names end in their units. Columns that the scene does not model are left out.

    Examples
    --------
    >>> from repro import Results
    >>> results = Results("empty", [], [], "completed")
    >>> list(results), results.units["time_h"]
    (['time_h'], 'h')
    """

    def __init__(self, name: str, rows: list[dict[str, float | None]],
                 fields: Sequence[Mapping[str, np.ndarray]], status: str,
                 folder: Path | None = None, tables: Mapping[str, dict] | None = None,
                 provenance: Mapping[str, Any] | None = None,
                 rerun: Callable[[float], dict[str, np.ndarray]] | None = None):
        self.columns: dict[str, np.ndarray] = {}
        for key in dict.fromkeys([*results.COLUMNS, *(rows[0] if rows else ())]):
            values = [row[key] for row in rows]
            if key == TIME or values.count(None) < len(values):
                self.columns[key] = np.array([np.nan if value is None else value
                                              for value in values])
        self.name = name
        self.status = status
        self.folder = folder
        self.tables = tables or {}
        self.provenance = provenance or {}
        self._fields = fields
        self._rerun = lru_cache(maxsize=8)(rerun) if rerun else None

    def __getitem__(self, name: str) -> np.ndarray:
        if name not in self.columns:
            raise _unknown(name, "this scene has no such column", self.columns)
        return self.columns[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self.columns)

    def __len__(self) -> int:
        return len(self.columns)

    @property
    def units(self) -> dict[str, str]:
        """Unit of each column and field; "1" for a pure number."""
        fields = next(iter(self._fields), {})
        return {name: unit(name) for name in (*self.columns, *fields)}

    @property
    def time(self) -> np.ndarray:
        """Reported times, h."""
        return self.columns[TIME]

    def _ipython_key_completions_(self) -> list[str]:
        """Names of columns that IPython offers."""
        return list(self.columns)

    @typed
    def fields(self, time: float | str, method: str | None = None) -> Mapping[str, np.ndarray]:
        """Return the fields at a time within the run.

        Those between rows are computed again from the nearest earlier state: that of a row of a run
        in memory, or the last saved state of a run in a folder, which has none before its end. They
        equal those of a row at this time to the last bit, unless versions have changed since, which
        issues a warning. The folder stays as it is.

        Parameters
        ----------
        time : float or str
            Hours, or a text with a unit such as "90 min".
        method : str, optional
            "nearest" takes the nearest row, without a computation.

        Returns
        -------
        mapping of str to array
            ``places_um`` (N, 2), ``triangles`` (T, 3), or (T, 6) if they are quadratic, and the
            fields by name: (N,) at nodes, (N, 3) for vectors, (T,) in triangles. Names end in their
            units.

        Raises
        ------
        KeyError
            If the time is outside the run: names its times.
        ValueError
            If the method is another one, or a text is not a time.

        Notes
        -----
        A time costs as much as the run from the row before it, for results in memory. For a run in
        a folder it costs as much as the run from t = 0, or from the state saved near its end, which
        is also its only one. The last eight times are kept.

        Examples
        --------
        >>> import repro
        >>> fields = repro.solve("flow_only").fields(0.0)
        >>> fields["places_um"].shape[1], fields["triangles"].shape[1]
        (2, 3)
        """
        hours = _hours(time)
        row = self._row(hours, method)
        if row is not None:
            return self._fields[row]
        times = self.time
        if not len(times):
            raise KeyError(f"{hours} h: not a reported time; there is no row")
        if self._rerun:
            if 0 <= hours <= self._end:
                return self._rerun(hours)
            raise KeyError(f"{hours} h: outside the run, from 0 to {self._end:g} h")
        after = int(np.searchsorted(times, hours))
        near = " and ".join(f"{beside:.6g}" for beside in times[max(after - 1, 0):after + 1])
        raise KeyError(f"{hours} h: not a reported time; the nearest rows are at {near} h, of "
                       f"{len(times)} from {times[0]:.6g} to {times[-1]:.6g} h")

    @property
    def _end(self) -> float:
        """Time (h) that the run has reached; a run that ends otherwise has a row then."""
        growth = self.tables.get("growth", {})
        completed = self.status == "completed" and "end" in growth
        return to_internal(growth["end"], "h") if completed else float(self.time[-1])

    def _row(self, time: float, method: str | None = None) -> int | None:
        """Find the row at, or nearest to, a time (h)."""
        if method not in (None, "nearest"):
            raise ValueError(f'method: None or "nearest" is needed, not {method!r}')
        distance = np.abs(self.time - time)
        if len(distance) and (distance.min() <= SAME_TIME or method and np.isfinite(time)):
            return int(distance.argmin())
        return None

    @typed
    def probe(self, name: str, x: float | str, y: float | str) -> np.ndarray:
        """Return a field at a place at all reported times.

        Parameters
        ----------
        name : str
            A field, with its unit or without.
        x, y : float or str
            Coordinates, um, or texts with a unit: x from the middle of the pore, y from its lower
            wall.

        Returns
        -------
        (rows,) or (rows, 3) array
            Values in the unit of the field's name. NaN where the field has none, as of the
            aggregate in the fluid, and where the place is beside the meshed part.

        Raises
        ------
        KeyError
            If the run has no field of this name.
        ValueError
            If the place is outside the pore.

        Examples
        --------
        >>> import repro
        >>> results = repro.solve("base", {"growth.end": "0.4 h"})
        >>> results.probe("acceptor", x=0, y="20 um").round(1).tolist()
        [9.9, 9.9, 9.9]
        """
        place = np.array([[self._coordinate("x", x), self._coordinate("y", y)]])
        values = [sampling.sample(fields, self._field(name, fields), place)[0]
                  for fields in map(self.fields, self.time)]
        return np.array(values)

    @typed
    def profile(self, name: str, *, time: float | str, x: float | str | None = None,
                y: float | str | None = None, points: int = 201) -> tuple[np.ndarray, np.ndarray]:
        """Return a field along a line across the pore, or along it, at a time.

        Parameters
        ----------
        name : str
            A field, with its unit or without.
        time : float or str
            Hours, or a text with a unit, as for :meth:`fields`.
        x, y : float or str, optional
            One of them, um or a text with a unit: the place of a line from wall to wall, or the
            height of one over the meshed part.
        points : int, optional
            Number of points.

        Returns
        -------
        coordinate : (points,) array
            The other coordinate, um.
        values : (points,) or (points, 3) array
            Values in the unit of the field's name; NaN where the field has none.

        Raises
        ------
        KeyError
            If the run has no field of this name, or no state at this time.
        ValueError
            If not one of x and y is given, or if it is outside the pore.

        Examples
        --------
        >>> import repro
        >>> results = repro.solve("base", {"growth.end": "0.4 h"})
        >>> x, acceptor = results.profile("acceptor", y="20 um", time=0.4)
        >>> len(x), bool(acceptor[0] > acceptor[-1])
        (201, True)
        """
        if (x is None) == (y is None) or points < 2:
            raise ValueError("profile: one of x and y, and two points or more, are needed")
        fields = self.fields(time)
        axis, other, value = ("x", 1, x) if x is not None else ("y", 0, y)
        places = np.full((points, 2), self._coordinate(axis, value))
        low, high = drawing.corners(fields)[:, other]
        places[:, other] = np.linspace(low, high, points)
        values = sampling.sample(fields, self._field(name, fields), places)
        return places[:, other].copy(), values

    def _coordinate(self, axis: str, value: float | str) -> float:
        """Return a coordinate, um. Raises ValueError if it is outside the pore."""
        place = _parsed(axis, value, "um", "um", "20 um")
        pore = self.tables.get("pore", {})
        length, width = (to_internal(pore[key], "um") if key in pore else np.inf
                         for key in ("length", "width"))
        low, high = (-length / 2, length / 2) if axis == "x" else (0.0, width)
        if not low <= place <= high:
            raise ValueError(f"{axis}: {place:g} um is outside the pore, from {low:g} to {high:g} "
                             "um")
        return place

    @typed
    def outline(self, time: float | str, body: str | int | None = None) -> Outline:
        """Return the boundary of an aggregate at a time, as :meth:`fields` takes it.

        Parameters
        ----------
        time : float or str
            Hours, or a text with a unit.
        body : str or int, optional
            Name of the aggregate, or its number from 1; needed if there are several.

        Returns
        -------
        Outline
            NumPy reads it as an (n, 2) array in um, from the upstream end on the wall of the
            aggregate to the downstream one. ``to_shapely`` returns the area inside.

        Raises
        ------
        KeyError
            If the aggregate is not in the pore at this time, or as for :meth:`fields`.
        ValueError
            If there are several aggregates and none of them is named.

        Examples
        --------
        >>> import numpy as np, repro
        >>> outline = repro.solve("base", {"growth.end": "0.4 h"}).outline("24 min")
        >>> round(float(np.asarray(outline)[:, 1].max()), 2)
        5.19
        """
        numbers = self._bodies
        chosen = next(iter(numbers), "1") if body is None and len(numbers) < 2 else str(body)
        if chosen not in (*numbers, *map(str, range(1, len(numbers) + 1)), "1"):
            raise ValueError(f"body: one of {', '.join(numbers)} is needed, not {body!r}")
        number = list(numbers).index(chosen) + 1 if chosen in numbers else int(chosen)
        upper = "upper" in list(numbers.values())[number - 1:number]
        return outlines.outline(self.fields(time), number, upper, _hours(time))

    @property
    def _bodies(self) -> dict[str, str]:
        """The wall of each aggregate of the scene by its name, or by its number from 1."""
        part: Any = self.tables.get(bodies.SECTION, [])
        seeds = [part] if isinstance(part, dict) else part
        labels = bodies.labels([seed.get("name") for seed in seeds])
        return {label: seed.get("wall", "lower") for label, seed in zip(labels, seeds)}

    @typed
    def plot(self, name: str | None = None, *, time: float | str | Sequence | None = None,
             ax: Any = None, log: bool | None = None, unit: str | None = None,
             title: str | None = None, cmap: str | None = None, image: Any = None,
             um_per_pixel: float | None = None, corner: Sequence | None = None) -> Any:
        r"""Draw the run with matplotlib: curves over time, one column, a field, or outlines.

        Parameters
        ----------
        name : str, optional
            A column or a field, with its unit or without, or "outlines". By default, the curves of
            conductivity, thickness and effluents are drawn that the scene has.
        time : float, str or list of these, optional
            Time of the field, or times of the outlines: hours, or texts with a unit. By default it
            is the last row, and for outlines ten rows or fewer at equal intervals.
        ax : matplotlib.axes.Axes or list of these, optional
            Axes to draw in, by default those of a new figure. Curves need as many as they have
            panels.
        log : bool, optional
            Show the quantity on a logarithmic scale. By default, a curve has one if it is positive
            and spans two decades.
        unit : str, optional
            The unit of the quantity, such as "cm/s", or of the places of outlines.
        title, cmap : str, optional
            The title of the picture, and the name of matplotlib's map of colours.
        image : str, Path or array, optional
            A microscope image under outlines: its file, or its pixels (rows, columns), whose unit
            of length is ``um_per_pixel``.
        um_per_pixel : float, optional
            Scale of the image, um; needed with it.
        corner : (x, y), optional
            Place of the image's lower left corner, um. By default, the middle of its lower edge is
            at x = y = 0, the middle of the lower wall.

        Returns
        -------
        matplotlib.axes.Axes or list of these
            The axes; a list of panels if there is no name.

        Raises
        ------
        ImportError
            If matplotlib is not installed; names the extra to install.
        KeyError
            If the run has no column and no field of this name, or no state at this time.
        ValueError
            If a time is given without a field, a text is not a time, a unit is not one of the
            quantity, or ``ax`` has another number of axes.

        Examples
        --------
        >>> import repro
        >>> results = repro.solve("base", {"growth.end": "1 h"})
        >>> [panel.get_ylabel() for panel in results.plot()]
        ['conductivity\n(m/day)', 'thickness\n(um)', 'effluent\n(mg/L)']
        >>> results.plot("acceptor", time=0.6).get_title(loc="left")
        'base, t = 0.6 h: acceptor (mg/L)'
        >>> results.plot("conductivity", unit="cm/s", log=True).get_ylabel()
        'conductivity\n(cm/s)'
        >>> len(results.plot("outlines", time=[0, "24 min", 1]).collections[-1].get_segments())
        3
        """
        style = Style(log, unit, title, cmap)
        column = drawing.full_name(name or "", list(self.columns))
        if name != OUTLINES and (image is not None or um_per_pixel or corner):
            raise ValueError(f'image, um_per_pixel, corner: "{OUTLINES}" are drawn over an image')
        if name is None or column:
            if time is not None:
                raise ValueError(f"time: {column or 'a plot without a name'} is drawn over all "
                                 "times; the name of a field is needed")
            if unit is not None and not column:
                raise ValueError("unit: the name of a column is needed with it")
            panels = [(column,)] if column else \
                [panel for panel in drawing.PANELS if set(panel) <= set(self.columns)]
            if not panels:
                raise KeyError("this scene has no curves of flow, growth or uptake; name a column")
            axes = drawing.curves(self, panels, ax, style)
            return axes[0] if column else axes
        if name == OUTLINES:
            photograph = Photograph(image, um_per_pixel, corner)
            photograph.check()
            if time is None and len(self.time):  # the rows nearest to equal intervals
                even = np.linspace(self.time[0], self.time[-1], MOST_OUTLINES)
                rows = np.unique(np.abs(self.time - even[:, None]).argmin(axis=1))
                time = self.time[rows].tolist()
            lines = []
            for each in np.atleast_1d(np.array([] if time is None else time, dtype=object)):
                fields = self.fields(each)
                present = np.unique(fields["region"].round()).astype(int)
                lines += [self.outline(each, int(number)) for number in present if number]
            if not lines:
                raise KeyError(f"{OUTLINES}: this run has no aggregate at these times")
            heading, box = title or shortened(self.name), drawing.corners(fields)
            return drawing.drawn_outlines(lines, heading, box, ax, photograph=photograph,
                                          style=style)
        if isinstance(time, Sequence) and not isinstance(time, str):
            raise TypeError("plot: time: one time of a field is needed, not a list")
        hours = (self.time[-1] if len(self.time) else 0.0) if time is None else _hours(time)
        fields = self.fields(hours) if len(self.time) else {}
        full_name = self._field(name, fields)
        heading = title or drawing.heading(self, hours)
        return drawing.field(fields, full_name, heading, ax, style=style)

    def drawable(self) -> dict[str, str]:
        """Return what :meth:`plot` draws.

        Returns
        -------
        dict of str
            Words and unit of each column and field of the last row by name, and of "outlines".

        Examples
        --------
        >>> import repro
        >>> repro.solve("flow_only").drawable()["head_loss_cm"]
        'head loss over the whole pore (cm)'
        """
        fields = self._fields[-1] if len(self._fields) else {}
        known = [name for name in (*self.columns, *fields)
                 if name not in (TIME, "places_um", "triangles")]
        outlined = {OUTLINES: "outlines of the aggregates over time"} if self._bodies else {}
        return {name: names.with_unit(name) for name in known} | outlined

    def _field(self, name: str, fields: Mapping[str, np.ndarray]) -> str:
        """Full name of a field. Raises KeyError, with the nearest name, if there is none."""
        drawn = [key for key in fields if key not in ("places_um", "triangles")]
        field = drawing.full_name(name, drawn)
        if not field:
            raise _unknown(name, "this run has no such column or field", [*self.columns, *drawn])
        return field

    @typed
    def animate(self, name: str, file: str | Path, *, ax: Any = None, log: bool | None = None,
                unit: str | None = None, title: str | None = None, cmap: str | None = None) -> Any:
        """Write a field at all reported times as a film, with one scale of colours.

        Parameters
        ----------
        name : str
            A field, with its unit or without.
        file : str or Path
            File to write; it ends in .gif, or in .mp4 where the program ffmpeg is installed.
        ax : matplotlib.axes.Axes, optional
            Axes to draw in, by default those of a new figure.
        log, unit, title, cmap : optional
            As for :meth:`plot`.

        Returns
        -------
        matplotlib.axes.Axes
            The axes with the last time.

        Raises
        ------
        ImportError
            If matplotlib, or ffmpeg for .mp4, is not installed; names what to install.
        KeyError
            If the run has no field of this name.
        ValueError
            If the name of the file ends otherwise.

        Examples
        --------
        >>> import tempfile
        >>> import repro
        >>> results = repro.solve("base", ['growth.end="0.4 h"'])
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     axes = results.animate("acceptor", f"{folder}/film.gif")
        >>> axes.get_title(loc="left")
        'base, t = 0.4 h: acceptor (mg/L)'
        """
        if Path(file).suffix not in (".gif", ".mp4"):
            raise ValueError(f"file: {file}: a file name that ends in .gif or .mp4 is needed")
        fields = self._fields[-1] if len(self.time) else {}
        style = Style(log, unit, title, cmap)
        return drawing.film(self, self._field(name, fields), Path(file), ax, style)

    def permeability(self) -> Permeability:
        """Fit the usual laws for models on the Darcy scale to K / K0 of the rows.

        K0 is the conductivity of the clean pore, and the biomass per pore volume is the area of the
        aggregates over that of the pore.

        Returns
        -------
        repro.results.permeability.Permeability
            ``columns`` by name and ``fits`` by law; ``to_csv`` writes the columns, and ``print``
            shows the constants with their errors.

        Raises
        ------
        KeyError
            If the scene has no flow or no aggregate.
        ValueError
            If the rows have less than three amounts of biomass.

        Examples
        --------
        >>> import repro
        >>> permeability = repro.solve("base", {"growth.end": "1 h"}).permeability()
        >>> permeability.columns["relative_permeability"][0].round(3).item()
        0.989
        """
        from repro.results.permeability import of_runs  # runs do not load it

        return of_runs([self])

    def to_pandas(self):
        """Return the columns as a ``pandas.DataFrame``.

        Returns
        -------
        pandas.DataFrame
            A row per reported time, indexed by ``time_h``. ``attrs["units"]`` has the unit of each
            column.

        Raises
        ------
        ImportError
            If pandas is not installed.

        Examples
        --------
        >>> import repro
        >>> repro.solve("flow_only").to_pandas()["mean_velocity_m_per_d"].round(3).tolist()
        [2.9]
        """
        frame = package("pandas").DataFrame(self.columns).set_index(TIME)
        frame.attrs.update(scene=self.name, status=self.status,
                           units={name: unit(name) for name in self.columns})
        return frame

    @typed
    def to_xarray(self, fields: Sequence[str] = (), *, across: int = 51):
        """Return the columns, and fields on a regular grid, as an ``xarray.Dataset``.

        Parameters
        ----------
        fields : sequence of str, optional
            Fields, with their units or without.
        across : int, optional
            Number of points over the width of the pore; the grid is equally fine along it.

        Returns
        -------
        xarray.Dataset
            Variables over ``time_h``, and fields over ``time_h``, ``y_um`` and ``x_um``, vectors
            over ``axis``, too. Each has its ``units`` and its ``long_name``. Fields are NaN where
            they have no value, and beside the meshed part of a time.

        Raises
        ------
        ImportError
            If xarray is not installed.
        KeyError
            If the run has no field of a name.

        Examples
        --------
        >>> import repro
        >>> repro.solve("flow_only").to_xarray()["head_loss_cm"].attrs["units"]
        'cm'
        >>> repro.solve("flow_only").to_xarray(["velocity"])["velocity_m_per_d"].dims
        ('time_h', 'y_um', 'x_um', 'axis')
        """
        columns = {name: (TIME, values, names.attributes(name))
                   for name, values in self.columns.items()}
        times = {TIME: columns.pop(TIME)}
        about = {"scene": self.name, "status": self.status}
        dataset = package("xarray").Dataset(columns, times, about)
        rows = list(map(self.fields, self.time)) if len(fields) else []
        full_names = [self._field(name, rows[0] if rows else {}) for name in fields]
        if not rows:
            return dataset
        x, y = sampling.grid(drawing.corners(*rows), across)
        places = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
        coordinates = {"y_um": y, "x_um": x, "axis": ["x", "y", "z"]}
        for name in full_names:
            values = np.array([sampling.sample(each, name, places) for each in rows])
            values = values.reshape(len(rows), len(y), len(x), *values.shape[2:])
            dims = [*coordinates][:values.ndim - 1]
            dataset = dataset.assign_coords({dim: coordinates[dim] for dim in dims})
            dataset[name] = ([TIME, *dims], values, names.attributes(name))
        return dataset

    @typed
    def to_netcdf(self, file: str | Path) -> None:
        """Write the columns as NetCDF with CF conventions.

        The file has the variables of :meth:`to_xarray` to the last bit, the scene and its hash, and
        the versions of the packages. Its time axis lacks the "since ..." of CF, because simulated
        time has no date.

        Parameters
        ----------
        file : str or Path
            File to write; an existing one is replaced.

        Raises
        ------
        ImportError
            If xarray is not installed.
        OutputError
            If the file cannot be written.

        Examples
        --------
        >>> import tempfile
        >>> import repro, xarray
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     _ = repro.run("flow_only", f"{folder}/run")
        ...     repro.load_run(f"{folder}/run").to_netcdf(f"{folder}/run.nc")
        ...     xarray.load_dataset(f"{folder}/run.nc").mean_velocity_m_per_d.item()
        2.9
        """
        about = {"Conventions": "CF-1.11", "title": f"Clogging of one pore: {self.name}",
                 "status": printable(self.status), "scene_tables": json.dumps(self.tables)}
        if self.provenance:
            versions = self.provenance["versions"]
            about |= {"source": f"dupin2001-repro {versions['dupin2001-repro']}",
                      "scene_hash": self.provenance["hash"], "versions": json.dumps(versions)}
        dataset = self.to_xarray().astype(float).assign_attrs(about)
        encoding = {name: {"_FillValue": None if name == TIME else np.nan}
                    for name in dataset.variables}
        with output_path(Path(file)) as beside:
            dataset.to_netcdf(beside.absolute(), engine="scipy", format="NETCDF3_64BIT",
                              encoding=encoding)

    def __repr__(self) -> str:
        size = f"{len(self.time)} rows, {len(self)} columns"
        return f"<Results of {self.name}: {size}, {self.status}>"

    def _repr_html_(self) -> str:
        """Return HTML for notebooks: key figures, a picture of the last state, and a table.

        The table has a row per column, with its values at the first and the last times.
        """
        rows = list(range(len(self.time)))
        rows = rows if len(rows) <= 2 * END_TIMES else [*rows[:END_TIMES], *rows[-END_TIMES:]]
        lines = ""
        for name, column in self.items():
            cells = "".join(f"<td>{value:.4g}</td>" for value in column[rows])
            lines += f"<tr><th>{escape(f'{name} ({unit(name)})')}</th>{cells}</tr>"
        caption = escape(f"{self.name}: {len(self.time)} rows, {len(rows)} shown; {self.status}")
        summary = image = ""
        if rows and len(self._fields) == len(rows):
            time = self.time[-1]
            image = drawing.figure(self._fields[-1], drawing.heading(self, time), time)
        if rows:
            summary = f"<p>{escape(self.name)}, {escape(drawing.key_figures(self))}</p>{image}"
        return (f"{summary}<details><summary>{caption}</summary><table><caption>{caption}</caption>"
                f"{lines}</table></details>")

def _parsed(name: str, value: float | str, unit: str, noun: str, example: str) -> float:
    """Return an argument in a unit. Raises ValueError if a text is not a number with a unit."""
    if not isinstance(value, str):
        return value
    try:
        return to_internal(value, unit)
    except (ValueError, OverflowError):
        raise ValueError(f'{name}: {value!r}: a number of {noun} or a text such as "{example}" is '
                         "needed") from None


def _hours(time: float | str) -> float:
    return _parsed("time", time, "h", "hours", "90 min")


def _unknown(name: str, message: str, known: Iterable[str]) -> KeyError:
    """Return the error of a name that is not known, with the nearest one."""
    near = nearest(name, known, cutoff=0.5)
    return KeyError(f"{name}: {message}{f'; did you mean {near}?' if near else ''}")


@typed
def solve(scene: Source, overrides: Overrides = (), *, unset: Sequence[str] = (),
          scheme: Scheme | None = None, progress: bool = False) -> Results:
    """Run a scene and keep its rows and fields in memory.

    Parameters
    ----------
    scene : Scene, str, path or dict
        A loaded scene, a packaged name, a file, or a dict of tables.
    overrides : sequence of str or dict, optional
        Changes of the scene, as for :func:`repro.load_scene`.
    unset : sequence of str
        Keys to leave out.
    scheme : repro.schemes.Scheme, optional
        Another scheme than that of the preset, such as ``replace(PAPER, carrier="u")``.
    progress : bool, optional
        Show a bar of the simulated time (h), by ``tqdm.auto``.

    Returns
    -------
    Results
        Rows and fields at ``output.times``, or after every step. Memory grows with their number.

    Raises
    ------
    SceneError
        If the scene is not accepted.
    SimulationError
        If a stage fails.
    TypeError
        If an argument has a wrong type: names the argument.

    Examples
    --------
    >>> import repro
    >>> results = repro.solve("base", ['growth.end="0 h"'])
    >>> results.units["conductivity_m_per_d"]
    'm/d'
    """
    scene = load_scene(scene, overrides, unset=unset, scheme=scheme)
    duration = scene.growth.end if scene.growth else 0.0
    rows = []
    fields = []
    states = []
    status = "completed"

    def reported() -> Iterator[tuple[RestartState, Report | None]]:
        for state, report in steps(scene):
            if report:
                states.append(state)
            yield state, report

    def rerun(time: float) -> dict[str, np.ndarray]:
        earlier = [state for state in states if state.time <= time]
        return fields_at(scene, earlier[-1] if earlier else None, time)

    with progress_bar(progress, "h") as show:
        try:
            for instant in reports(reported()):
                rows.append(results.row(scene, instant))
                fields.append(_arrays(scene, instant))
                show(instant.pore.time, duration)
        except RunEnd as end:
            status = str(end)
    return Results(scene.name, rows, fields, status, tables=scene_tables(scene),
                   provenance=results.provenance(scene), rerun=rerun)


def fields_at(scene: Scene, state: RestartState | None, time: float) -> dict[str, np.ndarray]:
    """Return the fields of a row at a time (h), computed from an earlier state of the run."""
    return _arrays(scene, report_at(scene, state, time))


def _arrays(scene: Scene, report: Report) -> dict[str, np.ndarray]:
    return results.fields(scene, report.pore, report.solved).arrays
