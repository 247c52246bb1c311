"""What a scene does not need costs nothing: its own stages, and no more, take time.

Base with a seed of 20 um as it is, and without growth (its shape is frozen), without flow, and without substrates: the
time of a first solution, mesh included, of each, and of a step of the whole.
"""

from __future__ import annotations

from functools import partial
from itertools import islice
from statistics import median
from time import perf_counter

from repro import timing
from repro.march.simulation import simulate
from repro.scene import parse_scene
from verification.bench.clock import measured
from verification.bench.size import STAGES

REPEATS = 31
SUBSTRATES = {"substrates": {}}
GROWTH = {"growth": {"end": "2.4 h"}}
FLOW = {"flow": {"head": "1e-3 cm"}}
#: Sections of each scene; the stages that it needs, of those that are timed.
SCENES = {"whole": ({**FLOW, **SUBSTRATES, **GROWTH}, {"flow", "transport"}),
          "frozen shape": ({**FLOW, **SUBSTRATES}, {"flow", "transport"}),
          "flow only": (FLOW, {"flow"}), "transport only": (SUBSTRATES, {"transport"})}
PRESETS = ("paper", "fast", "accurate")
STEPS = 3


def run(quick: bool) -> dict:
    """The part."""
    repeats = 3 if quick else REPEATS
    jobs = {(preset, name): partial(first, preset, name) for preset in PRESETS for name in SCENES}
    rows = [{"scene": point["label"], "method": f"preset {line['method']}", **point}
            for line in measured(jobs, repeats) for point in line["points"]]
    steps = [step(preset) for preset in PRESETS]
    return {"title": "What a scene does not need: seconds of a first solution, mesh included, and of a growth step",
            "rows": rows, "steps": steps, "repeats": repeats}


def scene(preset: str, name: str):
    """One of SCENES."""
    tables = {"pore": {"width": "50 um"}, "aggregate": {"radius": "20 um"}, "numerics": {"preset": preset}}
    return parse_scene({**tables, **SCENES[name][0]}, name, f"{name}.toml")


def first(preset: str, name: str) -> dict:
    """The first instant of a run: mesh and solution."""
    timing.reset()
    start = perf_counter()
    instant = next(iter(simulate(scene(preset, name))))
    took = perf_counter() - start
    stages = {stage: timing.seconds[stage] for stage in STAGES if timing.seconds.get(stage, 0.0) > 0}
    return {"stages": stages, "took": took, "nodes": len(instant.pore.mesh.points),
            "unneeded": sorted(set(stages) - SCENES[name][1] - {"meshing"})}


def step(preset: str) -> dict:
    """Median seconds of a step of the whole, as long as the preset makes it."""
    marks, times = [], []
    for instant in islice(simulate(scene(preset, "whole")), STEPS + 1):
        marks.append(perf_counter())
        times.append(instant.pore.time)
    lengths = [b - a for a, b in zip(times, times[1:])]
    return {"method": f"preset {preset}", "seconds": median(b - a for a, b in zip(marks, marks[1:])),
            "hours": median(lengths)}
