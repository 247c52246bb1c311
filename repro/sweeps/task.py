"""One run of a sweep, in its place: gone on with where it is begun, made again where it is damaged.

A sweep treats the folder of each of its runs as ``repro run`` does.
"""

from __future__ import annotations

import multiprocessing
import os
import signal
import sys
import threading
import traceback
from importlib.metadata import version
from multiprocessing.connection import Connection
from pathlib import Path

from repro.errors import SimulationError
from repro.report.reading import NoRun
from repro.results.files import is_file
from repro.runs.folder import PROVENANCE
from repro.runs.machine import source_hash
from repro.runs.running import OutputError, Watch, resume, run
from repro.runs.status import done
from repro.runs.whole import damage, record_of
from repro.scene import Scene, SceneError


def code() -> str:
    """What the numbers of a run come from: this package's version and source."""
    return f"{version('dupin2001-repro')}-{source_hash()}"


def make(scene: Scene, place: Path, patience: float = 0.0) -> str:
    """Run a scene in a folder, or go on with its run there.

    patience: seconds to wait for another process to leave the folder. Returns how the run ended,
    in one line, whatever the trouble is.
    """
    try:
        return _made(scene, place, Watch(tell=_ignore, patience=patience))
    except (SimulationError, OutputError, SceneError, NoRun) as error:
        return f"failed: {error}"
    except Exception as error:  # a bug is the failure of one run
        last = traceback.extract_tb(error.__traceback__)[-1]
        where = f"{Path(last.filename).name}, line {last.lineno}"
        return f"failed: {type(error).__name__}: {' '.join(str(error).split())} ({where})"


def _ignore(event: dict) -> None:
    """Events and warnings of a run are in its ``run.json``."""


def _made(scene: Scene, place: Path, watch: Watch) -> str:
    if not is_file(place / PROVENANCE):
        return run(scene, place, watch=watch)
    record = record_of(place)
    if done(record["status"]) and damage(place, record):
        return run(scene, place, watch=watch, force=True)
    return resume(place, watch=watch)


def answer(end: Connection, scene: Scene, place: Path, patience: float) -> None:
    """Make a run in this process, which is there for it alone, and send how it ended.

    Whatever libraries print is dropped. The process ends when the one that asked for it does, and
    imports nothing from the working folder.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the process that asked
    threading.Thread(target=_end_with_parent, daemon=True).start()
    here = os.getcwd()
    sys.path[:] = [entry for entry in sys.path if os.path.abspath(entry) != here]
    nowhere = os.open(os.devnull, os.O_RDWR)
    os.dup2(nowhere, 1)
    os.dup2(nowhere, 2)
    end.send(make(scene, place, patience))


def _end_with_parent() -> None:
    multiprocessing.parent_process().join()
    os._exit(1)
