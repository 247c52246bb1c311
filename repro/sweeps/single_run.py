"""One run of a sweep in its folder. An unfinished run is resumed; a damaged one is repeated.

A sweep treats the folder of each run as ``repro run`` does.
"""

import json
import os
import signal
import threading
import traceback
from collections.abc import Callable
from importlib.metadata import version
from pathlib import Path
from queue import SimpleQueue

from repro.errors import Interrupted, SimulationError
from repro.report.reading import read_record
from repro.results.files import is_file
from repro.runs.execution import OutputError, Watch, resume, run
from repro.runs.folder import PROVENANCE
from repro.runs.integrity import find_damage
from repro.runs.interrupts import catch_signals
from repro.runs.machine import source_hash
from repro.runs.status import FAILED, INTERRUPTED, is_over
from repro.scene import Scene, SceneError, parse_scene

#: The line that asks a process to stop its run and to end.
STOP = "\n"


def code() -> str:
    """Version of this package and hash of its source, which determine the numbers of a run."""
    return f"{version('dupin2001-repro')}-{source_hash()}"


def make(scene: Scene, folder: Path, patience: float = 0.0,
         stop: Callable[[], int] = lambda: 0) -> str:
    """Run a scene in a folder, or resume its run there.

    patience: seconds to wait for another process that uses the folder; stop: returns the number of
    a signal that asks the run to stop, or 0. Returns how the run ended, in one line, also for
    errors. The events of a run are ignored: its ``run.json`` has the warnings.
    """
    watch = Watch(lambda event: None, stop=stop, stop_within=stop, patience=patience)
    try:
        return _run_or_resume(scene, folder, watch)
    except Interrupted:
        return INTERRUPTED
    except (SimulationError, OutputError, SceneError) as error:
        return f"{FAILED}{error}"
    except Exception as error:  # a bug is the failure of one run
        last = traceback.extract_tb(error.__traceback__)[-1]
        location = f"{Path(last.filename).name}, line {last.lineno}"
        return f"{FAILED}{type(error).__name__}: {' '.join(str(error).split())} ({location})"


def _run_or_resume(scene: Scene, folder: Path, watch: Watch) -> str:
    if not is_file(folder / PROVENANCE):
        return run(scene, folder, watch=watch)
    record = read_record(folder)
    if is_over(record["status"]) and find_damage(folder, record):
        return run(scene, folder, watch=watch, force=True)
    return resume(folder, watch=watch)


def serve() -> None:
    """Make the runs that standard input lists, one after the other, and answer how each ended.

    A request is a line of JSON, and so is its answer. Other output goes to standard error. A signal
    or STOP stops a run, which can then resume; STOP also ends the process. The end of the input, as
    by the end of the parent, ends the process at once.
    """
    answers = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)
    requests: SimpleQueue[str] = SimpleQueue()
    stopping = threading.Event()
    threading.Thread(target=_read_requests, args=(requests, stopping), daemon=True).start()
    for line in iter(requests.get, STOP):
        request = json.loads(line)
        scene = parse_scene(request["tables"], request["scene"], request["scene"])
        with catch_signals() as received:
            ended = make(scene, Path(request["folder"]), request["patience"],
                         lambda: received() or signal.SIGTERM * stopping.is_set())
        print(json.dumps(ended), file=answers, flush=True)


def _read_requests(requests: SimpleQueue[str], stopping: threading.Event) -> None:
    with open(0, closefd=False) as lines:
        for line in lines:
            if line == STOP:
                stopping.set()
            requests.put(line)
    os._exit(1)
