"""The expected time and disk space of a sweep, for ``repro sweep --dry-run``."""

from pathlib import Path
from tempfile import TemporaryDirectory

from repro import results
from repro.march.simulation import row_times
from repro.preflight.checked import duration
from repro.preflight.cost import estimate_cost, run_trial
from repro.preflight.memory import MB, first_nodes
from repro.preflight.outlook import LIMIT, CoarseRun
from repro.results import field_files
from repro.scene import Scene
from repro.sweeps.folder import Sweep

#: Runs of a sweep that are tried; each takes up to LIMIT s and its first steps.
TRIED = 3


def describe(sweep: Sweep, workers: int) -> str:
    """State the number of points, and roughly the time and disk space of their runs."""
    step = -(-len(sweep.points) // TRIED)
    costs = [_expect(point.scene) for point in sweep.points[::step]]
    seconds, size = (len(sweep.points) * sum(each) / len(costs) for each in zip(*costs))
    return (f"{sweep.source}: {len(sweep.points)} points; roughly {duration(seconds / workers)} "
            f"with {workers} runs at a time, {size / MB:.2g} MB of fields; estimated from "
            f"{len(costs)} of them; nothing is written")


def _expect(scene: Scene) -> tuple[float, float]:
    """Expected wall time (s) and bytes of the fields of a run."""
    nodes = round(first_nodes(scene))
    trial = run_trial(scene, nodes)
    coarse = CoarseRun(scene) if scene.growth else None
    if coarse:
        coarse.run(lambda time: None, LIMIT)
    cost = estimate_cost(scene, trial, nodes, coarse)
    with TemporaryDirectory() as folder:
        file = Path(folder) / "first.vtu"
        field_files.write(file, results.fields(scene, trial.first.pore, trial.first.solved))
        first = file.stat().st_size * nodes / trial.nodes
    rows = max(1, len(row_times(scene)))
    if scene.growth and scene.output.requested(scene.growth.end) is None:
        rows += cost.steps or 0
    growth = (1 + coarse.node_growth) / 2 if coarse else 1.0
    return cost.seconds or 0.0, first * rows * growth
