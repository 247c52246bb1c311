"""One run of a sweep in its folder. An unfinished run is resumed; a damaged one is repeated.

A sweep treats the folder of each run as ``repro run`` does.
"""

from __future__ import annotations

import multiprocessing
import os
import sys
import threading
import traceback
from collections.abc import Callable
from importlib.metadata import version
from multiprocessing.connection import Connection
from pathlib import Path

from repro.errors import Interrupted, SimulationError
from repro.report.reading import read_record
from repro.results.files import is_file
from repro.runs.execution import OutputError, Watch, resume, run
from repro.runs.folder import PROVENANCE
from repro.runs.integrity import find_damage
from repro.runs.interrupts import catch_signals
from repro.runs.machine import source_hash
from repro.runs.status import INTERRUPTED, is_over
from repro.scene import Scene, SceneError


def code() -> str:
    """Version of this package and hash of its source, which determine the numbers of a run."""
    return f"{version('dupin2001-repro')}-{source_hash()}"


def make(scene: Scene, folder: Path, patience: float = 0.0,
         stop: Callable[[], int] = lambda: 0) -> str:
    """Run a scene in a folder, or resume its run there.

    patience: seconds to wait for another process that uses the folder; stop: returns the number of
    a signal that asks the run to stop, or 0. Returns how the run ended, in one line, also for
    errors.
    """
    watch = Watch(_ignore_event, stop=stop, stop_within=stop, patience=patience)
    try:
        return _run_or_resume(scene, folder, watch)
    except Interrupted:
        return INTERRUPTED
    except (SimulationError, OutputError, SceneError) as error:
        return f"failed: {error}"
    except Exception as error:  # a bug is the failure of one run
        last = traceback.extract_tb(error.__traceback__)[-1]
        location = f"{Path(last.filename).name}, line {last.lineno}"
        return f"failed: {type(error).__name__}: {' '.join(str(error).split())} ({location})"


def _ignore_event(event: dict) -> None:
    """Ignore the events of a run: its ``run.json`` has the warnings."""


def _run_or_resume(scene: Scene, folder: Path, watch: Watch) -> str:
    if not is_file(folder / PROVENANCE):
        return run(scene, folder, watch=watch)
    record = read_record(folder)
    if is_over(record["status"]) and find_damage(folder, record):
        return run(scene, folder, watch=watch, force=True)
    return resume(folder, watch=watch)


def send_status(connection: Connection, scene: Scene, folder: Path, patience: float) -> None:
    """Make a run in this process, which does nothing else, and send how the run ended.

    Output of libraries is discarded. A signal stops the run, which can then resume. The process
    ends with its parent, and imports nothing from the working folder.
    """
    with catch_signals() as stop:
        _isolate()
        connection.send(make(scene, folder, patience, stop))


def _isolate() -> None:
    threading.Thread(target=_end_with_parent, daemon=True).start()
    working_folder = os.getcwd()
    sys.path[:] = [entry for entry in sys.path if os.path.abspath(entry) != working_folder]
    null_device = os.open(os.devnull, os.O_RDWR)
    os.dup2(null_device, 1)
    os.dup2(null_device, 2)


def _end_with_parent() -> None:
    multiprocessing.parent_process().join()
    os._exit(1)
