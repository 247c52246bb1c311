"""``make bench``: where the time of a run goes, and what accuracy it buys.

Times are this machine's, of this moment: quote the ratios, which hold within one run of the benchmark. Importing the
packages is not counted.
"""

from __future__ import annotations

from dataclasses import dataclass
from statistics import median
from time import perf_counter

import numpy as np

from repro import coupling, timing
from repro.scene import load_scene

STAGES = ("flow", "transport", "growth", "mesh motion", "meshing", "transfer")
FLOOR = "factorise and solve"
#: Refinement and time step of the runs of base whose error is measured; the last one is the reference.
RUNS = ((0.5, "24 min"), (0.7, "24 min"), (0.7, "12 min"), (1.0, "12 min"), (1.4, "12 min"), (1.4, "6 min"),
        (2.0, "3 min"))
END = "10 h"


@dataclass(frozen=True)
class Timed:
    """A run: seconds in all, a step's median, seconds by stage, and velocity (um/h), effluents (mg/L), area (um2)."""

    seconds: float
    step: float
    by_stage: dict[str, float]
    steps: int
    nodes: int
    values: np.ndarray


def timed_run(scene) -> Timed:
    """Simulate a scene without writing anything."""
    timing.reset()
    marks = [perf_counter()]
    for instant in coupling.simulate(scene):  # noqa: B007
        marks.append(perf_counter())
    steps = np.diff(marks)[1:]
    return Timed(marks[-1] - marks[0], median(steps), dict(timing.seconds), len(steps), len(instant.pore.mesh.points),
                 _values(instant))


def _values(instant) -> np.ndarray:
    state = instant.solved.concentrations
    out = instant.solved.problem.acceptor.outflow
    effluents = [out @ field / out.sum() for field in (state.acceptor, state.donor)]
    return np.array([instant.solved.flow.mean_velocity, *effluents, instant.pore.outline.area])


def shares(name: str, run: Timed) -> None:
    """Print the share of each stage and the ratio of a growth step to its factorise-and-solve time."""
    print(f"\n{name}: {run.seconds:.1f} s, {run.steps} steps, {run.nodes} nodes at the end, "
          f"{1e3 * run.step:.0f} ms a step (median)")
    rest = run.seconds - sum(run.by_stage.get(stage, 0.0) for stage in STAGES)
    for stage, spent in [(stage, run.by_stage.get(stage, 0.0)) for stage in STAGES] + [("the rest", rest)]:
        print(f"  {stage:<12} {spent:7.2f} s  {100 * spent / run.seconds:5.1f} %")
    floor = run.by_stage[FLOOR]
    print(f"  a step takes {run.seconds / floor:.2f} times its factorise-and-solve time ({floor:.2f} s in all stages)")


def speed_against_error() -> None:
    """Print time and error of base, to END, for several mesh sizes and time steps, against the finest of them."""
    runs = [timed_run(load_scene("base", [f"growth.end={END}", f"numerics.refinement={refinement}",
                                          f"growth.time_step={step}"])) for refinement, step in RUNS]
    finest, unit = runs[-1], runs[RUNS.index((1.0, "12 min"))].seconds
    print(f"\nbase to {END}: time over that of the default, and relative deviation from the last line")
    print("  refinement  time step   nodes   time  velocity  acceptor     donor      area")
    for (refinement, step), run in zip(RUNS, runs):
        errors = "".join(f"{100 * (a / b - 1):9.3f}%" for a, b in zip(run.values, finest.values))
        print(f"  {refinement:10g} {step:>10} {run.nodes:7d} {run.seconds / unit:6.2f}{errors}")


def main() -> None:
    """Print everything."""
    for name in ("base", "wide"):
        shares(name, timed_run(load_scene(name)))
    speed_against_error()


if __name__ == "__main__":
    main()
