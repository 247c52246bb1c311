"""Cost against size: one growth step of 12 min of an aggregate of 20 um, by stage, and the memory that it takes.

Each size runs in a process of its own, with a limit of time; the first step, which orders the nodes, is left out unless
it is the only one. The floor of a step is what factorising and solving its linear systems takes.
"""

from __future__ import annotations

import json
import resource
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from statistics import median
from time import perf_counter, process_time

from repro import timing
from repro.march import midpoint, updates
from repro.model import pore
from repro.scene import load_scene
from verification.bench.envelope import exponent

#: Nodes wanted, and how many steps are timed after the first; none: the first is, with its orderings.
SIZES = {600: 5, 2500: 3, 10_000: 2, 40_000: 1, 160_000: 0}
QUICK = {300: 1, 600: 1}
#: Preset, and derivatives of Newton's methods: those used again make the floor lower, and the step.
METHODS = {"preset paper": "paper fresh", "order 2, midpoint (accurate)": "accurate reused",
           "order 2, midpoint, fresh derivatives": "accurate fresh"}
STAGES = ("flow", "transport", "growth", "mesh motion", "meshing", "transfer")
FLOOR = "factorise and solve"
RADIUS, STEP, LIMIT = 20.0, 0.2, 240.0
#: The first guess of the refinement for so many nodes: c nodes^p, fitted to a few of them.
FIRST = {"paper": (0.0265, 0.526), "accurate": (0.0109, 0.544)}


def run(quick: bool) -> dict:
    """The part."""
    lines, fits = [], {}
    for method, kind in METHODS.items():
        points, failed = [], []
        for nodes, steps in (QUICK if quick else SIZES).items():
            found = apart(kind, nodes, steps)
            (failed if "reason" in found else points).append(found)
        lines.append({"method": method, "points": points, "failed": failed})
        fits[method] = exponents(points)
    return {"title": f"Cost of a growth step of 12 min, aggregate of {RADIUS:g} um in a pore of 50 um", "lines": lines,
            "fits": fits, "repeats": "median of 5 steps (600 nodes) to 1; 160 000 nodes: the first step"}


def exponents(points: list[dict]) -> dict[str, float | None]:
    """Exponents in the number of nodes of the whole, of each stage, and of the memory above that of the start."""
    sizes = [point["nodes"] for point in points]
    rows = {"step": [point["seconds"] for point in points], "memory": [point["memory_MB"] for point in points],
            **{stage: [point["stages"].get(stage, 0.0) for point in points] for stage in (*STAGES, FLOOR)}}
    found = {name: exponent(sizes, values) for name, values in rows.items()}
    return {name: None if value != value else value for name, value in found.items()}


def apart(kind: str, nodes: int, steps: int) -> dict:
    """:func:`measure` in a process of its own."""
    label = f"{nodes} nodes"
    try:
        done = subprocess.run([sys.executable, "-m", __name__, kind, str(nodes), str(steps)], capture_output=True,
                              text=True, timeout=LIMIT)
    except subprocess.TimeoutExpired:
        return {"label": label, "reason": f"more than {LIMIT:g} s"}
    if done.returncode:
        return {"label": label, "reason": (done.stderr.strip().splitlines() or ["no message"])[-1]}
    return {"label": label, **json.loads(done.stdout)}


def scene(kind: str, refinement: float):
    """Base with a larger seed."""
    preset, jacobian = kind.split()
    return load_scene("base", [f"numerics.preset={preset}", f"numerics.refinement={refinement}",
                               f"numerics.jacobian={jacobian}", f"aggregate.radius={RADIUS} um"])


def sized(kind: str, nodes: int):
    """(scene, pore) of about so many nodes."""
    factor, power = FIRST[kind.split()[0]]
    refinement = factor * nodes**power
    for _ in range(3):
        given = scene(kind, refinement)
        now = pore.seeded(given)
        count = len(now.mesh.points)
        if abs(count / nodes - 1) < 0.1:
            break
        refinement *= (nodes / count) ** 0.5
    return given, now


#: A step of a length (h), by the scene's ``numerics.time``.
STEPS = {"updates": updates.step, "midpoint": lambda *given: midpoint.attempt(*given).step}


def measure(kind: str, nodes: int, steps: int) -> dict:
    """Seconds of a step and of its stages, their floor, and memory."""
    before = _resident()
    given, now = sized(kind, nodes)
    solved = pore.solve(given, now)
    now = replace(now, concentrations=solved.concentrations)
    rows = []
    for _ in range(steps + 1):
        timing.reset()
        wall, spent = perf_counter(), process_time()
        taken = STEPS[given.numerics.time](given, now, solved, STEP)
        after = replace(taken.pore, time=now.time + STEP)
        solved = pore.solve(given, after)
        now = replace(after, concentrations=solved.concentrations)
        rows.append((perf_counter() - wall, process_time() - spent, dict(timing.seconds), taken.remeshed))
    rows = rows[1:] or rows
    usual = [row for row in rows if not row[3]] or rows
    stages = {name: median(row[2].get(name, 0.0) for row in usual) for name in (*STAGES, FLOOR)}
    seconds = median(row[0] for row in usual)
    return {"seconds": seconds, "cpu": median(row[1] for row in usual), "nodes": len(now.mesh.points),
            "stages": stages, "ratio": seconds / stages[FLOOR], "memory_MB": _peak() - before, "peak_MB": _peak(),
            "repeats": len(usual), "remeshed": sum(row[3] for row in rows)}


def _peak() -> float:
    """Peak of the resident memory of this process so far, MB, as Linux tells it; elsewhere as getrusage does, which
    on Linux counts what the process was forked from."""
    try:
        lines = Path("/proc/self/status").read_text(encoding="ascii").splitlines()
        return int(next(line for line in lines if line.startswith("VmHWM")).split()[1]) / 1024
    except (OSError, StopIteration):
        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def _resident() -> float:
    """Resident memory now, MB, as Linux tells it; else its peak so far."""
    try:
        return int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1]) * resource.getpagesize() / 2**20
    except OSError:
        return _peak()


if __name__ == "__main__":
    print(json.dumps(measure(sys.argv[1], int(sys.argv[2]), int(sys.argv[3]))))
