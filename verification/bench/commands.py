"""A user's own runs of base: the command as it is typed, and the solver with all of a run's default rows."""

import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory
from time import perf_counter

import numpy as np

from repro.march.simulation import simulate
from repro.scene import load_scene
from verification.bench.record import clock

PACKAGES = "numpy, scipy.sparse.linalg, skfem, mmgpy, shapely, meshio"
PRESETS = ("paper", "fast", "accurate", "exact")
#: The short list of rows; the other points of base have the same.
FEW = 'output.times=["19.2 h", "19.4 h"]'
PAIRS = 5


def command_part() -> dict:
    """Base to 19.4 h: seconds of the command, of its imports, and of the solver with all and with few rows."""
    return {"title": f"repro run base, as typed, over python -c 'import {PACKAGES}'; the solver with all default rows "
                     "over that with two", "repeats": PAIRS, "rows": [*map(_measured, PRESETS)]}


def _measured(preset: str) -> dict:
    """Medians over PAIRS; the ratios are of processor times, each within a pair."""
    set_preset = f"numerics.preset={preset}"
    with TemporaryDirectory() as folder:
        command = ["-m", "repro", "run", "base", "--set", set_preset, "--quiet", "--force", "--out",
                   str(Path(folder, "run"))]
        typed, imports = _pairs(lambda: time_process(*command), lambda: time_process("-c", f"import {PACKAGES}"))
    every, few = _pairs(lambda: _time_solver(set_preset), lambda: _time_solver(set_preset, FEW))
    seconds, cpu = np.median(typed, axis=0)
    return {"method": preset, "seconds": seconds, "cpu": cpu, "imports": median(imports[:, 1]),
            "over_imports": median(typed[:, 1] / imports[:, 1]), "over_few_rows": median(every[:, 1] / few[:, 1])}


def _pairs(first: Callable[[], np.ndarray], second: Callable[[], np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """(PAIRS, 2) wall and processor time (s) of two jobs in turn, after a first run of each that does not count."""
    samples = np.array([(first(), second()) for _ in range(PAIRS + 1)])[1:]
    return samples[:, 0], samples[:, 1]


def time_process(*arguments: str) -> np.ndarray:
    """Wall and processor time (s) of a new Python process with these arguments. It keeps compiled modules."""
    environment = {**os.environ, "PYTHONDONTWRITEBYTECODE": ""}
    before, start = os.times(), perf_counter()
    subprocess.run([sys.executable, *arguments], stdout=subprocess.DEVNULL, check=True, env=environment)
    seconds, after = perf_counter() - start, os.times()
    cpu = after.children_user + after.children_system - before.children_user - before.children_system
    return np.array([seconds, cpu])


def _time_solver(*changes: str) -> np.ndarray:
    """Wall and processor time (s) of base in this process; nothing is written."""
    start = clock()
    for _ in simulate(load_scene("base", changes)):
        pass
    return clock() - start
