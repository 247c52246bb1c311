"""Run a sweep and write its tables and page; for scripts and for ``repro sweep``."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager, closing, nullcontext
from dataclasses import dataclass
from functools import partial
from math import prod
from pathlib import Path
from time import monotonic
from typing import TYPE_CHECKING, Any

from repro.results import drawing
from repro.results.quantities import unit_of
from repro.runs.folder import folder_errors
from repro.runs.machine import refuse_exchanged, require_packages
from repro.runs.scripts import load_run
from repro.scene import SceneError, Source, label
from repro.scene.arguments import Overrides, typed
from repro.scene.needed import package
from repro.sweeps import CLOGGED, cluster, design, own_points, page, pool, table
from repro.sweeps.folder import Sweep, lock_folder
from repro.timing import progress_bar

if TYPE_CHECKING:
    from repro.results.permeability import Permeability

#: Receives the events {"event": "start" or "run", "done": runs, "total": runs, ...}.
Tell = Callable[[dict[str, Any]], None]


@dataclass(frozen=True, eq=False)
class Swept:
    """The results of a sweep.

    ``runs`` extends ``runs.csv``. :func:`repro.load_run` reads one of ``paths``.
    """

    source: str
    folder: Path
    factors: list[design.Factor]
    runs: table.Runs

    @property
    def paths(self) -> list[Path]:
        """The folder of each run."""
        return [self.folder / "runs" / run.point.name for run in self.runs]

    @property
    def failed(self) -> list[table.SweepRun]:
        """The runs that are not finished."""
        return [run for run in self.runs if not run.is_over]

    def label(self, run: table.SweepRun) -> str:
        """Write the value of each factor of a run."""
        return design.label(self.factors, run.point.values)

    @property
    def _numbers(self) -> list[str]:
        """The columns of ``runs.csv`` with numbers."""
        return [*table.COLUMNS, *table.final_columns([run.point for run in self.runs])]

    def to_pandas(self):
        """Return the columns of ``runs.csv`` as a ``pandas.DataFrame``.

        Returns
        -------
        pandas.DataFrame
            A row for each run, indexed by ``run``: the varied keys, the status, the events, and the
            last value of each column of the run.

        Raises
        ------
        ImportError
            If pandas is not installed.
        """
        columns = table.run_columns(self.factors, self.runs)
        kinds = dict.fromkeys(self._numbers, float)
        return package("pandas").DataFrame(columns).astype(kinds).set_index("run")

    def to_xarray(self):
        """Return the events and last values of the runs as an ``xarray.Dataset``.

        Returns
        -------
        xarray.Dataset
            The varied keys are the dimensions. Runs that are no grid, as of a Latin hypercube, have
            the dimension ``run``, with the varied keys as coordinates.

        Raises
        ------
        ImportError
            If xarray is not installed.
        """
        from_dataframe = package("xarray").Dataset.from_dataframe
        units = {factor.key: factor.unit for factor in self.factors}
        keys = list(units)
        frame = self.to_pandas().drop(columns="folder")
        frame = frame.rename(columns=dict(zip((each.column for each in self.factors), keys)))
        is_grid = len(frame) == prod(frame[keys].nunique()) and not frame.duplicated(keys).any()
        if is_grid:
            in_order = {key: frame[key].unique() for key in keys}  # pandas sorts the index
            dataset = from_dataframe(frame.set_index(keys)).reindex(in_order)
        else:
            dataset = from_dataframe(frame).set_coords(keys)
        for name, variable in dataset.variables.items():
            variable.attrs["units"] = units.get(name, unit_of(name).symbol)
        return dataset.assign_attrs(scene=self.source)

    def permeability(self) -> Permeability:
        """Fit the laws of :meth:`repro.Results.permeability` to the rows of all runs."""
        from repro.results.permeability import of_runs

        return of_runs([load_run(path) for path in self.paths])

    def plot(self, name: str = "conductivity_m_per_d", *, ax: Any = None) -> Any:
        """Draw an event or the last value of a column against the first varied key.

        Parameters
        ----------
        name : str
            A column of ``runs.csv``, with its unit or without.
        ax : matplotlib.axes.Axes, optional
            Axes to draw in, by default those of a new figure.

        Returns
        -------
        matplotlib.axes.Axes
            The axes, with a line for each combination of the other varied keys.

        Raises
        ------
        ImportError
            If matplotlib or pandas is not installed.
        KeyError
            If the runs have no column of this name.
        """
        column = drawing.full_name(name, self._numbers)
        if not column:
            raise KeyError(f"{name}: runs.csv has {', '.join(self._numbers)}")
        return drawing.against(self.to_pandas(), self.factors, column, self.source, ax)

    def __repr__(self) -> str:
        return (f"<Sweep of {self.source}: {len(self.runs) - len(self.failed)} of {len(self.runs)} "
                f"runs done, in {self.folder}>")


@typed
def sweep(scene: Source, vary: Sequence[str] = (), folder: str | Path | None = None,
          overrides: Overrides = (), *, points: Any = None, unset: Sequence[str] = (),
          samples: int | None = None, seed: int = 0, workers: int | None = None,
          scheduler: str | None = None, clogged: float = CLOGGED, progress: bool = False,
          tell: Tell | None = None) -> Swept:
    """Run a scene many times with varied keys, and write tables and a page.

    Finished runs in the folder are not repeated. A run that fails has a status that says so.

    Parameters
    ----------
    scene : Scene, str, Path or dict
        A loaded scene, a TOML file, the name of a packaged scene, or a dict of tables.
    vary : sequence of str, optional
        A range or a list for each varied key, such as ``"flow.mean_velocity=0.3:30 m/day:log:8"``
        or ``"pore.width=50 um, 60 um"``, as for ``repro sweep --vary``.
    folder : str or Path
        Folder for the runs, the tables and the page. It is needed.
    overrides : sequence of str or dict, optional
        Changes of the scene, such as ``{"growth.end": "5 h"}``.
    points : str, Path, mapping, DataFrame, array or engine, optional
        Own points. Points with names are a CSV file, a dict of columns, a ``pandas.DataFrame`` or a
        structured array; a name is a key with its unit, such as ``"pore.width (um)"``. Points
        without names lie in the unit cube and are scaled to the ranges of ``vary``: an array (n,
        number of ranges), or an engine of ``scipy.stats.qmc`` with ``samples``.
    unset : sequence of str, optional
        Keys or sections of the scene to leave out.
    samples : int, optional
        Number of runs of a Latin hypercube, or of an engine. By default all combinations of the
        values are run.
    seed : int, optional
        Seed of the Latin hypercube.
    workers : int, optional
        Number of parallel runs, by default one for each core.
    scheduler : str, optional
        Address of a Dask scheduler whose workers make the runs.
    clogged : float, optional
        The part of the first conductivity at which a pore counts as clogged, without unit.
    progress : bool, optional
        Show a bar of the finished runs, by ``tqdm.auto``.
    tell : callable, optional
        Receives each event as a dict.

    Returns
    -------
    Swept
        The runs with their values, statuses and folders. Times are in h.

    Raises
    ------
    SceneError
        If a scene, a point, or the value of an argument is not accepted.
    OutputError
        If the folder cannot be used, or the scheduler does not answer.
    TypeError
        If an argument has a wrong type: names the argument. Nothing is written.

    Examples
    --------
    >>> import tempfile
    >>> import repro
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     swept = repro.sweep("flow_only", ["pore.width=48 um, 50 um"], folder, workers=1)
    >>> [run.status for run in swept.runs]
    ['completed', 'completed']
    """
    if folder is None:
        raise SceneError("--out: a folder is needed")
    refuse_values(workers, seed, clogged)
    swept = plan(scene, vary, folder, overrides, points=points, unset=unset, samples=samples,
                 seed=seed)
    with ready(scheduler, min(workers or pool.cores(), len(swept.points))) as run_points:
        for point in swept.points if scheduler is None else ():
            require_packages(point.scene)
        return run_plan(swept, run_points, clogged, progress, tell)


def plan(scene: Source, vary: Sequence[str], folder: str | Path, overrides: Overrides, *,
         points: Any, unset: Sequence[str], samples: int | None, seed: int) -> Sweep:
    """Make and check the runs of :func:`sweep`, which has these arguments; writes nothing."""
    refuse_exchanged(scene)
    factors = [design.parse(text) for text in vary]
    if points is not None:
        factors, combinations = own_points.read(points, factors, samples)
    elif not vary:
        raise SceneError("--vary: a key with its values is needed, or points")
    else:
        combinations = (design.grid(factors) if samples is None
                        else design.latin(factors, samples, seed))
    named = "run" if points is None else f"{own_points.origin(points)}: row"
    runs = design.points(scene, list(overrides), factors, combinations, unset=unset, origin=named)
    return Sweep(Path(folder), label(scene), factors, runs)


def refuse_values(workers: int | None, seed: int, clogged: float) -> None:
    """Raise SceneError for a value of an argument of :func:`sweep` that is out of range."""
    accepted = {f"workers {workers}: an integer, one or more, is needed":
                workers is None or workers >= 1,
                f"--seed {seed}: an integer, zero or more, is needed": seed >= 0,
                f"clogged {clogged}: a number between 0 and 1 is needed": 0 < clogged < 1}
    for message, holds in accepted.items():
        if not holds:
            raise SceneError(message)


def run_plan(plan: Sweep, run_points: pool.RunPoints, clogged: float = CLOGGED,
             progress: bool = False, tell: Tell | None = None) -> Swept:
    """Make the missing runs of a plan, then write the results of all of them, also after an error.

    Raises OutputError if the folder cannot be used.
    """
    statuses: dict[int, str] = {}
    total = len(plan.points)

    def report(event: str, done: int, **parts: Any) -> None:
        show(done, total)
        if tell:
            tell({"event": event, "done": done, "total": total, **parts})

    with lock_folder(plan), progress_bar(progress, "runs") as show:
        try:
            missing = plan.missing()
            completed = total - len(missing)
            report("start", completed, scene=plan.source)
            begun = monotonic()
            with closing(run_points(missing, plan.runs)) as ended_runs:
                for point, status in ended_runs if missing else ():
                    statuses[point.index] = status
                    left = (monotonic() - begun) * (len(missing) / len(statuses) - 1)
                    report("run", completed + len(statuses), run=point.index, status=status,
                           values=design.label(plan.factors, point.values), left_s=left)
        finally:
            runs = table.read_runs(plan, statuses, clogged)
            with folder_errors(plan.folder):
                table.write(plan, runs)
                page.write(plan, runs, clogged)
    return Swept(plan.source, plan.folder, plan.factors, runs)


def ready(scheduler: str | None, workers: int) -> AbstractContextManager[pool.RunPoints]:
    """Make the context that makes runs: processes of this machine, or a cluster."""
    if scheduler:
        return cluster.ready(scheduler)
    return nullcontext(partial(pool.run_points, workers=workers))
