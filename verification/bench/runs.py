"""Complete runs and single steps: error against time of base, cost of unneeded stages, live memory over many
steps, and cost against size."""

import gc
import tracemalloc
from dataclasses import replace
from functools import partial
from time import perf_counter

import numpy as np
from scipy.stats import theilslopes

from reference import whole_run
from repro import timing
from repro.march.simulation import simulate
from repro.model import solving
from repro.model.meshing import seeded
from repro.model.pore import Pore
from repro.model.solving import Solved
from repro.scene import Scene
from verification.bench.record import clock, measured, reference_of
from verification.claims.runs import until
from verification.problems import runs as problems
from verification.problems.schemes import exchange, load_scene

BASE_REPEATS = 3
TIMES = (19.2, 19.4)
#: Rings and steps of the extrapolated reference, and of a check that is finer in space and has other steps.
REFERENCE, CHECK = ((8, 12), (8, 16)), ((10, 15), (10, 16))
FAST, ACCURATE = "preset fast", "preset accurate"
EXACT = "preset exact"
PRESETS = (FAST, ACCURATE, EXACT)
PRESET_PAPER = "preset paper: linear elements, updates"
#: Refinement and time step (min) of the paper's scheme; refinement and tolerance of the midpoint rule.
PAPER = ((0.25, 60), (0.35, 48), (0.5, 48), (0.7, 96), (0.7, 48), (0.7, 24), (1.0, 120), (1.0, 96), (1.0, 48),
         (1.0, 12), (1.4, 96), (1.4, 48), (1.4, 24), (1.4, 12), (1.4, 6), (2.0, 6), (2.8, 12), (2.8, 6))
MIDPOINT = ((0.35, 0.03), (0.5, 0.03), (0.7, 0.01), (1.0, 0.01), (1.4, 0.003), (2.0, 0.002))
QUADRATIC = ((0.15, 0.02), (0.15, 0.01), (0.2, 0.01), (0.3, 0.005), (0.45, 0.002), (0.45, 0.001), (0.6, 0.0005),
             (0.8, 0.0002))
#: Refinements of order 2 in the paper's updates of 12 min.
UPDATES = ((0.15,), (0.3,), (0.45,))
#: Labels of sizes, and the keys of the scene that they set.
BY_MINUTES = ("refinement {:g}, {} min", "numerics.refinement={}", "growth.time_step={} min")
BY_TOLERANCE = ("refinement {:g}, tolerance {:g}", "numerics.refinement={}", "numerics.tolerance={}")
OF_PAPER, OF_ACCURATE = ("numerics.preset=paper",), ("numerics.preset=accurate",)
MIDPOINT_RULE = exchange(steps="midpoint")
#: (method, label and keys, sizes, other changes of the scene).
METHODS_OF_BASE = (
    (PRESET_PAPER, BY_MINUTES, PAPER, OF_PAPER),
    ("midpoint alone", BY_TOLERANCE, MIDPOINT, (*OF_PAPER, MIDPOINT_RULE)),
    ("order 2, midpoint", BY_TOLERANCE, QUADRATIC, OF_ACCURATE),
    ("order 2, midpoint, fresh derivatives", BY_TOLERANCE, QUADRATIC[1:6:2],
     (*OF_ACCURATE, exchange(modified_newton=False))),
    ("order 2, midpoint, one element size everywhere", BY_TOLERANCE, QUADRATIC[1:4],
     (*OF_ACCURATE, "numerics.gradation=0")),
    ("order 2 in updates of 12 min", ("refinement {:g}", "numerics.refinement={}"), UPDATES,
     (*OF_ACCURATE, exchange(steps="updates"))))
#: Rings and steps to 19.2 h of scikit-fem's run.
SKFEM = ((3, 4), (4, 4), (4, 8), (6, 8))


def base_part() -> dict:
    """The whole base run to 19.4 h: the largest error of eight numbers at 19.2 and 19.4 h; and how long ``wide``
    takes."""
    about = reference_of("base", "reference_times", list(TIMES)) or reference()
    lines = measured(jobs(np.array(about["reference_values"])), BASE_REPEATS)
    return {"title": f"Base to {TIMES[1]:g} h, nothing written", "repeats": BASE_REPEATS, "lines": lines,
            "error": f"largest of eight numbers at {TIMES[0]:g} and {TIMES[1]:g} h: velocity, conductivity, area, "
                     "thickness, upstream, downstream relative, effluents over the supply", **about, "wide": wide()}


def jobs(truth: np.ndarray) -> dict:
    """{(method, label): job}."""
    jobs_by_label = {}
    for method, (label, *keys), sizes, changes in METHODS_OF_BASE:
        for size in sizes:
            sized = map(str.format, keys, size)
            jobs_by_label[method, label.format(*size)] = partial(_judged, truth, problems.values, TIMES, *changes,
                                                                 *sized)
    for preset in PRESETS:
        jobs_by_label[preset, "as it is"] = partial(_judged, truth, problems.values, TIMES,
                                                    f"numerics.preset={preset.split()[1]}")
    for rings, steps in SKFEM:
        jobs_by_label["scikit-fem: quadratic elements, Runge-Kutta", f"{rings} rings, {steps} steps"] = partial(
            _judged, truth, whole_run.numbers, whole_run.Pore(), rings, steps, TIMES)
    return jobs_by_label


def _judged(truth: np.ndarray, function, *arguments) -> dict:
    """The errors of the rows of ``function(*arguments)``: the largest, and that of each number."""
    each = problems.errors(function(*arguments), truth).max(axis=0).tolist()
    return {"error": max(each), "errors": each}


def reference() -> dict:
    """Values of the independent run at TIMES and its description."""
    computed, check = (whole_run.converged(whole_run.Pore(), TIMES, *size).values for size in (REFERENCE, CHECK))
    return {
        "reference": f"scikit-fem's quadratic elements in moving coordinates, Runge-Kutta in time, extrapolated from "
                     f"{CHECK[0]} rings and {CHECK[1]} steps; from {REFERENCE[0]} and {REFERENCE[1]} they differ by "
                     f"{problems.errors(computed, check).max():.1e}",
        "reference_times": list(TIMES), "reference_values": check.tolist()}


def wide() -> list[dict]:
    """Seconds of wide in preset fast, to 45 h, one run."""
    start = clock()
    times = [instant.pore.time for instant in simulate(load_scene("wide", ["numerics.preset=fast"]))]
    seconds, cpu = clock() - start
    return [{"preset": "fast", "seconds": seconds, "cpu": cpu, "steps": len(times) - 1, "end": times[-1]}]


SCENES_REPEATS = 31
FLOW, SUBSTRATES = {"flow": {"head": "1e-3 cm"}}, {"substrates": {}}
GROWTH, CLEAN = {"growth": {"end": "2.4 h"}}, {"aggregate": None}
DONOR = {"substrates": {"donor": {}}}
#: Sections of each scene, None for an absent one; the timed stages that the scene needs.
SCENES = {"whole": ({**FLOW, **SUBSTRATES, **GROWTH}, {"flow", "transport"}),
          "frozen shape": ({**FLOW, **SUBSTRATES}, {"flow", "transport"}),
          "flow only": (FLOW, {"flow"}), "transport only": (SUBSTRATES, {"transport"}),
          "growth without flow": ({**SUBSTRATES, **GROWTH}, {"transport"}),
          "one substrate": ({**FLOW, **DONOR, **GROWTH}, {"flow", "transport"}),
          "one substrate at rest": (DONOR, {"transport"}),
          "clean channel": ({**CLEAN, **FLOW}, {"flow"}),
          "clean channel with substrates": ({**CLEAN, **FLOW, **SUBSTRATES}, {"flow", "transport"}),
          "mesh only": ({}, set())}


def scenes_part() -> dict:
    """Time of a first solution, in which only the stages of the scene may run.

    Base with a seed of 20 um, unchanged, without growth (frozen shape), and without other parts. The time includes the
    mesh.
    """
    jobs = {(f"preset {preset}", name): partial(measure_first_solution, preset, name)
            for preset in problems.PRESETS for name in SCENES}
    rows = [{"scene": point["label"], "method": line["method"], **point}
            for line in measured(jobs, SCENES_REPEATS) for point in line["points"]]
    return {"title": "What a scene does not need: seconds of a first solution, mesh included", "rows": rows,
            "repeats": SCENES_REPEATS}


def scene_of(preset: str, sections: dict) -> dict:
    """Tables of a scene of SCENES in a preset."""
    tables = {"pore": {"width": "50 um"}, "aggregate": {"radius": "20 um"}, "numerics": {"preset": preset}, **sections}
    return {name: table for name, table in tables.items() if table is not None}


def measure_first_solution(preset: str, name: str) -> dict:
    """Measure the first report of a run of one of SCENES: mesh and solution."""
    sections, needed = SCENES[name]
    tables = scene_of(preset, sections)
    timing.reset()
    start = perf_counter()
    next(simulate(tables))
    took = perf_counter() - start
    stages = {stage: timing.seconds[stage] for stage in STAGES if timing.seconds.get(stage, 0.0) > 0}
    return {"stages": stages, "took": took, "unneeded": sorted(set(stages) - needed - {"meshing"})}


#: Number of steps.
MANY_STEPS = 180
#: Length of a step (h), and the part of the steps that is ignored.
LENGTH, WARM = 0.001, 0.25
#: Largest slope over the size of one nodal field.
PART = 0.1
MEMORY_PRESETS = {"paper": 0.4, "accurate": 0.25}


def memory_part() -> dict:
    """Live memory of a long run of an aggregate that hardly grows. It must not grow with the number of steps.

    The slope of the allocated memory (tracemalloc, numpy's arrays included) against the step, after the first ones: the
    median of the slopes between all pairs (Theil and Sen), which is robust to single jumps. Storing one nodal field per
    step would take 8 bytes per node and step; the bound is a tenth of that.
    """
    rows = [memory_slope(preset, refinement) for preset, refinement in MEMORY_PRESETS.items()]
    return {"title": "Live memory against the number of steps, after the first quarter", "rows": rows, "repeats": 1}


def memory_slope(preset: str, refinement: float) -> dict:
    """Slope (bytes per step) of a run of MANY_STEPS steps."""
    scene = load_scene("base", [f"numerics.preset={preset}", f"numerics.refinement={refinement}",
                                "aggregate.radius=20 um", f"growth.time_step={LENGTH} h",
                                *until(*(LENGTH * np.arange(1, MANY_STEPS + 1)))])
    live = np.zeros(MANY_STEPS + 1)
    tracemalloc.start()
    try:
        for count, instant in enumerate(simulate(scene)):
            nodes = len(instant.pore.mesh.points)
            del instant
            gc.collect()
            live[count] = tracemalloc.get_traced_memory()[0]
    finally:
        tracemalloc.stop()
    return {"method": f"preset {preset}", "steps": count, "slope": theilslopes(live[round(WARM * MANY_STEPS):]).slope,
            "bound": PART * 8 * nodes}


#: {target number of nodes: timed steps after the first}. With 0 the first step is timed, which orders the nodes.
SIZES = {600: 5, 2500: 3, 10_000: 2, 40_000: 1, 160_000: 0}
#: Preset and derivative of Newton's methods: a reused derivative makes the floor and the step cheaper.
METHODS = {"preset paper": "paper fresh", "order 2, midpoint (accurate)": "accurate reused",
           "order 2, midpoint, fresh derivatives": "accurate fresh"}
STAGES = ("flow", "transport", "growth", "mesh motion", "meshing", "transfer")
FLOOR = "factorise and solve"
RADIUS, STEP = 20.0, 0.2
#: Refinement for a number of nodes: c nodes^p, fitted to a few of them.
REFINED = {"paper": (0.0265, 0.526), "accurate": (0.0109, 0.544)}


def size_part() -> dict:
    """Cost against size: one growth step of 12 min of an aggregate of 20 um, by stage.

    The first step, which orders the nodes, is omitted unless it is the only one. The floor of a step is the time that
    factorising and solving its linear systems takes.
    """
    lines = []
    for method, kind in METHODS.items():
        points = [measure(kind, nodes, steps) for nodes, steps in SIZES.items()]
        lines.append({"method": method, "points": points, "failed": []})
    return {"title": f"Cost of a growth step of 12 min, aggregate of {RADIUS:g} um in a pore of 50 um", "lines": lines,
            "repeats": "median of 5 steps (600 nodes) to 1; 160 000 nodes: the first step"}


def measure(kind: str, nodes: int, steps: int) -> dict:
    """Seconds of a step of base with a larger seed on about ``nodes`` nodes, of its stages, and of their floor."""
    preset, derivative = kind.split()
    factor, power = REFINED[preset]
    scene = load_scene("base", [f"numerics.preset={preset}", f"numerics.refinement={factor * nodes**power}",
                                f"aggregate.radius={RADIUS} um", exchange(modified_newton=derivative == "reused")])
    state, solved = _solved(scene, seeded(scene))
    rows = []
    for _ in range(steps + 1):
        timing.reset()
        start = clock()
        advanced = problems.step(scene, state, solved, STEP)
        state, solved = _solved(scene, replace(advanced.pore, time=state.time + STEP))
        rows.append((advanced.remeshed, [*(clock() - start), *map(timing.seconds.__getitem__, (*STAGES, FLOOR))]))
    rows = rows[1:] or rows
    usual = [row for remeshed, row in rows if not remeshed] or [row for _, row in rows]
    seconds, cpu, *stages = np.median(usual, axis=0)
    return {"label": f"{nodes} nodes", "seconds": seconds, "cpu": cpu, "nodes": len(state.mesh.points),
            "stages": dict(zip((*STAGES, FLOOR), stages)), "ratio": seconds / stages[-1], "repeats": len(usual)}


def _solved(scene: Scene, state: Pore) -> tuple[Pore, Solved]:
    """The pore with its concentrations, and its solution."""
    solution = solving.solve(scene, state)
    return replace(state, concentrations=solution.concentrations), solution
