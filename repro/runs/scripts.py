"""Runs on the disk from scripts and notebooks: make, resume and load them."""

import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from repro.errors import CheckpointError, OutputError
from repro.march.state import RestartState
from repro.report import fields, reading
from repro.results import field_files, provenance
from repro.results.files import sha256_of
from repro.results.quantities import none_if_nan
from repro.results.tables import Results, fields_at
from repro.runs import checkpoint, execution
from repro.runs.execution import Watch, issue_warnings, origin_of
from repro.runs.folder import read_sums
from repro.runs.machine import conditions
from repro.runs.state_arrays import unpack_state
from repro.scene import Source, load_scene
from repro.scene.arguments import Overrides, typed
from repro.timing import progress_bar


@typed
def run(scene: Source, folder: str | Path, overrides: Overrides = (), *,
        unset: Sequence[str] = (), force: bool = False, progress: bool = False) -> Results:
    """Run a scene and write its results to a folder.

    If the folder already holds a run of the same scene, code and package versions, that run is
    resumed; a finished run is left unchanged.

    Parameters
    ----------
    scene : Scene, str, Path or dict
        A loaded scene, a TOML file, the name of a packaged scene, or a dict of tables.
    folder : str or Path
        Folder for the results. It is created if it does not exist.
    overrides : sequence of str or dict, optional
        Changes of the scene, such as ``{"growth.end": "5 h"}``.
    unset : sequence of str, optional
        Keys or sections of the scene to leave out.
    force : bool, optional
        Remove the files of any run in the folder first.
    progress : bool, optional
        Show a bar of the simulated time (h), by ``tqdm.auto``.

    Returns
    -------
    Results
        Rows and fields as :func:`repro.load_run` returns them. Its ``status`` says how the run
        ended: "completed", or where the model itself ended it. Its ``folder`` is the run's.

    Raises
    ------
    SceneError
        If the scene is not accepted, or the machine lacks a package or the memory that it needs.
    OutputError
        If the folder holds anything else, cannot be used, or is used by another run.
    SimulationError
        If a stage fails. All results so far are written, and :func:`resume` continues the run.
    TypeError
        If an argument has a wrong type: names the argument. Nothing is written.

    Examples
    --------
    >>> import tempfile
    >>> import repro
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     results = repro.run("flow_only", folder)
    >>> results.status, results["conductivity_m_per_d"].round(1).tolist()
    ('completed', [174.6])
    """
    loaded = load_scene(scene, overrides, unset=unset)
    origin = origin_of(scene, overrides, unset) if isinstance(scene, (str, Path)) else None
    with _watch(progress) as watch:
        execution.run(loaded, folder, watch=watch, force=force, origin=origin)
    return load_run(folder)


@typed
def resume(folder: str | Path, overrides: Overrides = (), *,
           progress: bool = False) -> Results:
    """Resume a run that was interrupted, was killed or has failed, or make a run longer.

    The results are equal, bit for bit, to those of an uninterrupted run. A warning is issued if
    package versions have changed or a checkpoint cannot be used.

    Parameters
    ----------
    folder : str or Path
        Folder of the run.
    overrides : sequence of str or dict, optional
        A later end, such as ``{"growth.end": "30 h"}``. No other key can be changed. The longer run
        equals a run that had this end from its start.
    progress : bool, optional
        Show a bar of the simulated time (h), by ``tqdm.auto``.

    Returns
    -------
    Results
        Rows, fields, status and folder of the run. A finished run is not computed again.

    Raises
    ------
    OutputError
        If the folder holds no run, cannot be used, or is used by another run.
    SceneError
        If the new end is not later, or the machine lacks a package or the memory needed.
    SimulationError
        If a stage fails.
    TypeError
        If an argument has a wrong type: names the argument.

    Examples
    --------
    >>> import tempfile
    >>> import repro
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     _ = repro.run("base", folder, ['growth.end="0.2 h"', 'numerics.preset="fast"'])
    ...     results = repro.resume(folder, ['growth.end="0.4 h"'])
    >>> float(results.time[-1])
    0.4
    """
    with _watch(progress) as watch:
        execution.resume(folder, overrides, watch=watch)
    return load_run(folder)


@contextmanager
def _watch(progress: bool) -> Iterator[Watch]:
    """Report warnings as Python warnings and, if requested, the simulated time by a bar."""
    with progress_bar(progress, "h") as show:
        def tell(event: dict[str, Any]) -> None:
            issue_warnings(event)
            if event["event"] in ("start", "step"):
                show(event.get("time_h", event.get("from_h")), event["end_h"])

        yield Watch(tell)


@typed
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
    TypeError
        If the folder has a wrong type.

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
    rows = [dict(zip(run.series, map(none_if_nan, values)))
            for values in np.column_stack(list(run.series.values())).tolist()]
    files = _Files(run.folder, run.times, listed_fields)
    return Results(run.record["scene"], rows, files, run.record["status"], Path(folder),
                   run.record["tables"], run.record, partial(_rerun, run))


def _rerun(run: reading.Run, time: float) -> dict[str, np.ndarray]:
    """Compute the fields at a time (h) from the last saved state before it, or from t = 0."""
    record, scene = run.record, run.scene
    current = provenance(scene)["versions"], conditions()["source"]
    if (record["versions"], record["conditions"]["source"]) != current:
        warnings.warn(f"{run.folder}: code or packages have changed since the run: the fields at "
                      f"{time:g} h may differ from those of its rows", stacklevel=4)
    states: list[RestartState] = []
    for name in (checkpoint.LAST, *checkpoint.STATES):
        with suppress(CheckpointError):  # it is absent, damaged, or of another version or scene
            plain, saved = checkpoint.read_checkpoint(run.folder / name)
            states.append(unpack_state(scene, plain["state"], saved))
    earlier = [state for state in states if state.time <= time]
    return fields_at(scene, max(earlier, key=lambda state: state.time, default=None), time)


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
            raise OutputError(f"{path}: the fields are cut short or altered since they were "
                              "written")
        return field_files.read(path).arrays
