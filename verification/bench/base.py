"""The whole base run to 19.4 h: the largest error of eight numbers at 19.2 and 19.4 h; and how long ``wide`` takes."""

from __future__ import annotations

from functools import partial
from time import perf_counter, process_time

import numpy as np

from reference import whole_run
from repro import timing
from repro.march.simulation import simulate
from repro.results import row
from repro.scene import load_scene
from verification.bench import record
from verification.bench.clock import measured

REPEATS = 3
TIMES = (19.2, 19.4)
COLUMNS = """mean_velocity_m_per_d conductivity_m_per_d aggregate_area_um2 thickness_um upstream_um downstream_um
effluent_acceptor_mg_per_L effluent_donor_mg_per_L""".split()
#: Rings and steps of the reference, extrapolated; those of a check, finer in space and with other steps.
REFERENCE, CHECK = ((8, 12), (8, 16)), ((10, 15), (10, 16))
FAST, ACCURATE, EXACT = "preset fast", "preset accurate", "preset exact"
PRESET_PAPER = "preset paper: linear elements, updates"
#: Refinement and time step (min) of the paper's scheme; those of them at which it is changed in one thing; refinement
#: and tolerance of the midpoint rule's.
PAPER = ((0.25, 60), (0.35, 48), (0.5, 48), (0.7, 96), (0.7, 48), (0.7, 24), (1.0, 120), (1.0, 96), (1.0, 48),
         (1.0, 12), (1.4, 96), (1.4, 48), (1.4, 24), (1.4, 12), (1.4, 6), (2.0, 6), (2.8, 12), (2.8, 6))
CHANGED = ((0.7, 24), (1.0, 48), (1.0, 12))
MIDPOINT = ((0.35, 0.03), (0.5, 0.03), (0.7, 0.01), (1.0, 0.01), (1.4, 0.003), (2.0, 0.002))
QUADRATIC = ((0.15, 0.02), (0.15, 0.01), (0.2, 0.01), (0.3, 0.005), (0.45, 0.002), (0.45, 0.001), (0.6, 0.0005),
             (0.8, 0.0002))
CUBIC = ((0.1, 0.01), (0.2, 0.0075), (0.3, 0.005), (0.45, 0.001))
#: Refinements of order 2 in the paper's updates of 12 min.
UPDATES = (0.15, 0.3, 0.45)
#: Rings and steps to 19.2 h of scikit-fem's run.
SKFEM = ((3, 4), (4, 4), (4, 8), (6, 8))


def run(quick: bool) -> dict:
    """The part; ``quick``: to 2 h, against the finest of its own runs."""
    times = (1.8, 2.0) if quick else TIMES
    truth, about = _short(times) if quick else reference(times)
    repeats = 1 if quick else REPEATS
    lines = measured(jobs(np.array(truth), times, quick), repeats)
    found = {"title": f"Base to {times[1]:g} h, nothing written", "repeats": repeats, "lines": lines,
             "error": f"largest of eight numbers at {times[0]:g} and {times[1]:g} h: velocity, conductivity, area, "
                      "thickness, upstream, downstream relative, effluents over the supply", **about}
    return found if quick else {**found, "wide": wide()}


def jobs(truth: np.ndarray, times, quick: bool) -> dict:
    """{(method, label): job}."""
    cut = 2 if quick else None
    found = {(PRESET_PAPER, f"refinement {r:g}, {m} min"): partial(
        simulated, truth, times, "numerics.preset=paper", f"numerics.refinement={r}", f"growth.time_step={m} min")
        for r, m in PAPER[:cut]}
    found |= {("bubble alone", f"refinement {r:g}, {m} min"): partial(
        simulated, truth, times, "numerics.preset=paper", f"numerics.refinement={r}", f"growth.time_step={m} min",
        "numerics.flow_element=bubble") for r, m in CHANGED[:cut]}
    alone = {"midpoint alone": (), "midpoint and bubble": ("numerics.flow_element=bubble",)}
    for name, more in alone.items():
        found |= {(name, f"refinement {r:g}, tolerance {t:g}"): partial(
            simulated, truth, times, "numerics.preset=paper", "numerics.time=midpoint", f"numerics.refinement={r}",
            f"numerics.tolerance={t}", *more) for r, t in (MIDPOINT[2:5] if more else MIDPOINT)[:cut]}
    found |= {("bounded transfer alone", f"refinement {r:g}, {m} min"): partial(
        simulated, truth, times, "numerics.preset=paper", f"numerics.refinement={r}", f"growth.time_step={m} min",
        "numerics.transfer=bounded") for r, m in CHANGED[::2][:cut]}
    found |= {("order 2, midpoint", f"refinement {r:g}, tolerance {t:g}"): partial(
        simulated, truth, times, "numerics.preset=accurate", f"numerics.refinement={r}", f"numerics.tolerance={t}")
        for r, t in QUADRATIC[:cut]}
    found |= {("order 2, midpoint, fresh derivatives", f"refinement {r:g}, tolerance {t:g}"): partial(
        simulated, truth, times, "numerics.preset=accurate", f"numerics.refinement={r}", f"numerics.tolerance={t}",
        "numerics.jacobian=fresh") for r, t in QUADRATIC[1:6:2][:cut]}
    found |= {("order 3, midpoint", f"refinement {r:g}, tolerance {t:g}"): partial(
        simulated, truth, times, "numerics.preset=accurate", f"numerics.refinement={r}", f"numerics.tolerance={t}",
        "numerics.elements=cubic") for r, t in CUBIC[:cut]}
    found |= {("order 2, midpoint, one element size everywhere", f"refinement {r:g}, tolerance {t:g}"): partial(
        simulated, truth, times, "numerics.preset=accurate", f"numerics.refinement={r}", f"numerics.tolerance={t}",
        "numerics.gradation=0")
        for r, t in QUADRATIC[1:4][:cut]}
    found |= {("order 2 in updates of 12 min", f"refinement {r:g}"): partial(
        simulated, truth, times, "numerics.preset=accurate", "numerics.time=updates", f"numerics.refinement={r}")
        for r in UPDATES[:cut]}
    found |= {(name, "as it is"): partial(simulated, truth, times, f"numerics.preset={name.split()[1]}")
              for name in (FAST, ACCURATE, EXACT)}
    if not quick:
        found |= {("scikit-fem: quadratic elements, Runge-Kutta", f"{n} rings, {s} steps"): partial(
            _skfem, truth, times, n, s) for n, s in SKFEM}
    return found


def simulated(truth, times, *overrides: str):
    """Run base; the error of the last rows."""
    shown = ", ".join(f'"{time} h"' for time in times)
    timing.reset()
    rows = rows_of(load_scene("base", [*overrides, f'growth.end="{times[-1]} h"', f"output.times=[{shown}]"]))
    return {"error": error(values(rows), truth), "nodes": rows[-1]["nodes"], "stages": dict(timing.seconds),
            "errors": [float(e) for e in apart(values(rows), truth).max(axis=0)]}


def rows_of(scene) -> list[dict]:
    """Rows of the table that a run writes."""
    return [row(scene, instant) for instant in simulate(scene)][-len(scene.output.times):]


def values(rows: list[dict]) -> np.ndarray:
    """(times, 8) of COLUMNS."""
    return np.array([[line[name] for name in COLUMNS] for line in rows])


def apart(found, truth) -> np.ndarray:
    """(times, 8) errors: relative, effluents over the supply."""
    scale = np.abs(truth).copy()
    scale[:, 6:] = whole_run.Pore().supply
    return np.abs(found - truth) / scale


def error(found, truth) -> float:
    """The largest."""
    return float(apart(found, truth).max())


def reference(times) -> tuple[list, dict]:
    """Values of the independent run and what is told of it; worked out once and kept in the record."""
    kept = record.load()["parts"].get("base", {})
    if kept.get("reference_times") == list(times):
        return kept["reference_values"], {key: value for key, value in kept.items() if key.startswith("reference")}
    start = process_time()
    found, check = (whole_run.converged(whole_run.Pore(), times, *size).values for size in (REFERENCE, CHECK))
    change = error(found, check)
    return check.tolist(), {
        "reference": f"scikit-fem's quadratic elements in moving coordinates, Runge-Kutta in time, extrapolated from "
                     f"{CHECK[0]} rings and {CHECK[1]} steps; from {REFERENCE[0]} and {REFERENCE[1]} they differ by "
                     f"{change:.1e}",
        "reference_change": change, "reference_times": list(times), "reference_values": check.tolist(),
        "reference_seconds": process_time() - start}


def _short(times) -> tuple[list, dict]:
    shown = ", ".join(f'"{time} h"' for time in times)
    scene = load_scene("base", ["numerics.preset=accurate", f'growth.end="{times[-1]} h"', f"output.times=[{shown}]"])
    return values(rows_of(scene)).tolist(), {"reference": "preset accurate: a quick look, no reference"}


def _skfem(truth, times, rings: int, steps: int):
    return {"error": error(whole_run.numbers(whole_run.Pore(), rings, steps, times), truth)}


def wide() -> list[dict]:
    """Seconds of wide in preset fast, to 45 h, one run."""
    wall, spent = perf_counter(), process_time()
    try:
        instants = [(instant.pore.time, len(instant.pore.mesh.points)) for instant in simulate(
            load_scene("wide", ["numerics.preset=fast"]))]
    except Exception as failure:
        return [{"preset": "fast", "failed": f"{type(failure).__name__}: {failure}"}]
    return [{"preset": "fast", "seconds": perf_counter() - wall, "cpu": process_time() - spent,
             "steps": len(instants) - 1, "end": instants[-1][0], "nodes": instants[-1][1]}]
