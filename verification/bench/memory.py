"""No allocation that grows with the number of steps: live memory of a long run of an aggregate that hardly grows.

The slope of the memory that Python's allocator knows (tracemalloc, numpy's arrays included) against the step, after the
first ones. To keep one nodal field a step would be 8 bytes a node and step: the bound is a tenth of that.
"""

from __future__ import annotations

import gc
import tracemalloc

import numpy as np

from repro.march.simulation import simulate
from repro.scene import load_scene

#: Steps, the length of one (h), and the part of them that is not looked at.
STEPS, QUICK_STEPS, LENGTH, WARM = 180, 16, 0.001, 0.25
PART = 0.1
PRESETS = {"paper": 0.4, "accurate": 0.25}


def run(quick: bool) -> dict:
    """The part."""
    rows = [grown(preset, refinement, QUICK_STEPS if quick else STEPS) for preset, refinement in PRESETS.items()]
    return {"title": "Live memory against the number of steps, after the first quarter", "rows": rows, "repeats": 1}


def grown(preset: str, refinement: float, steps: int) -> dict:
    """The slope of a run of so many steps, bytes a step."""
    times = [round((k + 1) * LENGTH, 9) for k in range(steps)]
    shown = ", ".join(f'"{time} h"' for time in times)
    scene = load_scene("base", [f"numerics.preset={preset}", f"numerics.refinement={refinement}",
                                "aggregate.radius=20 um", f"growth.time_step={LENGTH} h",
                                f'growth.end="{times[-1]} h"', f"output.times=[{shown}]"])
    live, nodes = np.zeros(steps + 1), 0
    tracemalloc.start()
    try:
        for count, instant in enumerate(simulate(scene)):
            nodes = len(instant.pore.mesh.points)
            del instant
            gc.collect()
            live[count] = tracemalloc.get_traced_memory()[0]
    finally:
        tracemalloc.stop()
    return {"method": f"preset {preset}", "steps": count, "nodes": nodes, "live_MB": float(live[-1]) / 2**20,
            "slope": slope(live[round(WARM * steps):]), "bound": PART * 8 * nodes}


def slope(live) -> float:
    """Bytes a step: the median of the slopes between all pairs (Theil and Sen), which single jumps do not move."""
    k, values = np.arange(len(live)), np.asarray(live, float)
    i, j = np.triu_indices(len(live), 1)
    return float(np.median((values[j] - values[i]) / (k[j] - k[i])))
