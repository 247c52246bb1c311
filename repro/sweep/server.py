"""A process that makes runs, one after the other: ``python -m repro.sweep.server``.

It has imported everything and forks a process for each run, so that what kills that is the run's
failure alone; where processes cannot be forked it makes them itself. A line of its input asks for a
run, a line of its output says how it ended, both JSON; when the input ends, so does the run at
work. Inside them the linear algebra has one thread.
"""

from __future__ import annotations

import gc
import json
import os
import select
import signal
import subprocess
import sys
import threading
from contextlib import suppress
from dataclasses import asdict, fields
from pathlib import Path
from typing import Any

from repro import results
from repro.run.machine import conditions
from repro.scene import Scene, load_scene
from repro.scene.course import Course
from repro.sweep import task

#: For these processes: one thread each; and glibc keeps the memory that a run frees for its next
#: step, where asking the system for it again and again, a page at a time, takes a short run 5 % of
#: its time.
ENVIRONMENT = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "MKL_NUM_THREADS": "1",
               "MALLOC_MMAP_THRESHOLD_": "1073741824", "MALLOC_TRIM_THRESHOLD_": "1073741824",
               "MALLOC_TOP_PAD_": "67108864"}
PATIENCE = 10  # s that a run may take to stop


class Server:
    """Such a process as seen from outside: started at once, and anew where it has died."""

    def __init__(self):
        self.closed = self.asked = False
        self.process: Any = _process()

    def make(self, asked: str) -> str:
        """Have a run made that :func:`ask` describes; how it ended."""
        if self.closed:
            return "interrupted"
        self.process = self.process or _process()
        self.asked = True
        answer = ""
        with suppress(BrokenPipeError):
            self.process.stdin.write(asked + "\n")
            self.process.stdin.flush()
            answer = self.process.stdout.readline()
        return json.loads(answer) if answer else _died(self._end())

    def close(self) -> None:
        """End the process, and the run at work in it."""
        self.closed = True
        if self.process and not self.asked:
            self.process.kill()
        if self.process:
            self._end()

    def _end(self) -> int:
        """End the process; its exit status."""
        process, self.process = self.process, None
        with suppress(BrokenPipeError):
            process.stdin.close()
        try:
            process.wait(2 * PATIENCE)
        except subprocess.TimeoutExpired:
            process.kill()
        code = process.wait()
        process.stdout.close()
        return code


def _process() -> subprocess.Popen:
    return subprocess.Popen([sys.executable, "-m", __name__], stdin=subprocess.PIPE,
                            stdout=subprocess.PIPE, text=True, env=os.environ | ENVIRONMENT,
                            start_new_session=True)  # Ctrl-C is for whoever asks


def ask(scene: Scene, folder: Path, beside: Path) -> str:
    """The line that asks for a run of a scene, made in `beside` and moved to `folder`."""
    return json.dumps({"scene": asdict(scene), "folder": str(folder), "beside": str(beside)})


def _asked(line: str) -> tuple[Scene, Path, Path]:
    told = json.loads(line)
    return _built(Scene, told["scene"]), Path(told["folder"]), Path(told["beside"])


def _built(kind: Any, values: dict):
    """The dataclass that `asdict` has taken apart; a part that is no section is a table."""
    parts = {entry.name: entry.metadata.get("section", Course) for entry in fields(kind)}
    return kind(**{name: _built(parts[name], value) if isinstance(value, dict) else _frozen(value)
                   for name, value in values.items()})


def _frozen(value: Any) -> Any:
    """A value with tuples for lists, within it too."""
    return tuple(map(_frozen, value)) if isinstance(value, list) else value


def _died(code: int) -> str:
    """What to say of a process that has not told how its run ended."""
    try:
        cause = f"was killed by {signal.Signals(-code).name}"
    except ValueError:
        cause = f"ended with status {code}"
    return f"failed: the process of the run {cause}"


def main() -> None:
    """Make the runs that the input asks for."""
    answers = os.dup(1)
    os.dup2(2, 1)  # whatever prints does not answer
    results.provenance(load_scene("flow_only"))  # what every run looks for on the disk
    conditions()
    gc.freeze()  # what is imported is not looked through again, and so not copied
    made = _forked if hasattr(os, "fork") else task.make
    with suppress(BrokenPipeError):  # nobody is there to be answered
        for line in iter(sys.stdin.readline, ""):
            os.write(answers, json.dumps(made(*_asked(line))).encode() + b"\n")


def _forked(*asked) -> str:
    """Make a run in a process forked from this one; how it ended, or what ended it."""
    answer, end = os.pipe()
    alive, held = os.pipe()
    child = os.fork()
    if not child:
        os.close(held)
        _work(asked, alive, end)
    os.close(end)
    if answer not in select.select([answer, sys.stdin], [], [])[0]:
        _stop(child, answer)  # the input has ended: nothing is asked for while a run is at work
    with open(answer) as told:
        ended = told.read()
    code = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
    os.close(alive)
    os.close(held)
    return ended or _died(code)


def _work(asked, alive: int, end: int) -> None:
    """What the forked process does; it ends with the one that it is forked from."""
    threading.Thread(target=lambda: (os.read(alive, 1), os._exit(1)), daemon=True).start()
    try:
        os.write(end, task.make(*asked).encode())
    finally:
        sys.stderr.flush()
        os._exit(1)  # whatever has been told, or not, is all


def _stop(child: int, answer: int) -> None:
    """End a run: by a signal that it may take its time for, then by force."""
    os.kill(child, signal.SIGTERM)
    if not select.select([answer], [], [], PATIENCE)[0]:
        os.kill(child, signal.SIGKILL)


if __name__ == "__main__":
    main()
