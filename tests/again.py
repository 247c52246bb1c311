"""Claims about base as another machine computes them: `python -m tests.again [FACTOR]`.

Prints {claim: [[quantity, value, whether it holds], ...], "kernel": that of OpenBLAS} as JSON, of the converged
solution, the seed's radius, and with it every coordinate, times a factor. It needs what `repro` needs, and no test
package.
"""

from __future__ import annotations

import ctypes
import json
import sys
from dataclasses import replace
from operator import attrgetter
from pathlib import Path

import numpy as np

from repro.scene import Scene, load_scene
from verification.claims import CLAIMS, evaluate, levels, runs
from verification.claims.levels import CONVERGED, Level, at_level

#: Claims whose numbers are there in seconds, and the level that judges them.
QUICK, JUDGED = ("C01", "C02", "C03", "C04", "C05", "C06", "C09", "C15", "C34"), Level(CONVERGED, 0.5)

#: What is told of a number.
NUMBER = attrgetter("quantity", "value", "holds")
Numbers = dict[str, list[tuple[str, float, bool]]]


def computed(ids: tuple[str, ...] = QUICK, factor: float = 1.0) -> Numbers:
    """What claims come to, coordinates times a factor."""
    evaluate.register_all()
    plain, runs.load_scene = runs.load_scene, lambda name, changes=(): moved(name, changes, factor)
    try:
        with at_level(JUDGED), np.errstate(all="raise", under="ignore"):
            return {id: [*map(NUMBER, CLAIMS[id].function().checks)] for id in ids}
    finally:
        runs.load_scene = plain
        levels.forget(JUDGED)


def moved(name: str, changes: tuple[str, ...], factor: float) -> Scene:
    """A packaged scene whose seed is larger by a factor."""
    said = load_scene(name, changes)
    return replace(said, aggregate=replace(said.aggregate, radius=said.aggregate.radius * factor))


def kernel() -> str:
    """The kernel that NumPy's own OpenBLAS has chosen; empty where there is none to ask."""
    libraries = sorted((Path(np.__file__).parents[1] / "numpy.libs").glob("libscipy_openblas64_*"))
    if not libraries:
        return ""
    name = ctypes.CDLL(str(libraries[0])).scipy_openblas_get_corename64_
    name.restype = ctypes.c_char_p
    return name().decode()


if __name__ == "__main__":
    found = computed(factor=float(sys.argv[1]) if len(sys.argv) > 1 else 1.0)
    print(json.dumps({**found, "kernel": kernel()}))
