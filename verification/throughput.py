"""Rate of a sweep against that of single runs: ``python -m verification.throughput [--repeats N]``.

A single run's rate is that of the same runs, one after the other in one process that has imported everything (the
median of several, before and after the sweep); the sweep's is that of 200 short runs on all cores, from an empty folder
to the page, starting of processes included. Wanted: 0.95 times the number of cores, judged with base in `fast`, less
than half a second a run. Exit status 1 where the sweep falls short, or a command costs more than it may: `repro --help`
twice the import of NumPy, and a run of base 1.3 times the import of the packages that it needs and the same run in a
process that has imported them, each the best of five. Under four minutes on two free cores.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory
from time import perf_counter
from timeit import repeat

from repro import load_scene, run, sweep
from repro.sweeps.pool import cores

WANTED = 0.95
#: Presets: of the sweep, and of the commands.
JUDGED, TOLD = "fast", "accurate"
RUNS = 200  # of the sweep
SINGLE = 10  # runs before the sweep, and after it
PACKAGES = "numpy, scipy.sparse.linalg, skfem, mmgpy, shapely, meshio"  # that a run needs
WIDTHS = "48:52 um"  # nearly the same run each time


def runs(preset: str, count: int, folder: Path) -> list[float]:
    """Seconds of every run in this process, one after the other, into a folder that is not there."""
    found = []
    for k in range(count):
        scene = load_scene("base", [f"numerics.preset={preset}", f"pore.width={48 + 4 * k / count!r} um"])
        start = perf_counter()
        run(scene, folder / f"{k}")
        found.append(perf_counter() - start)
    return found


def swept(folder: Path) -> float:
    """Runs a second of a sweep."""
    start = perf_counter()
    made = sweep("base", [f"pore.width={WIDTHS}:linear:{RUNS}"], folder / "sweep", [f"numerics.preset={JUDGED}"])
    if made.failed:
        raise RuntimeError(f"{len(made.failed)} runs of the sweep failed")
    return RUNS / (perf_counter() - start)


def measure() -> float:
    """The sweep's rate over cores times a single run's rate."""
    with TemporaryDirectory() as folder:
        runs(JUDGED, 1, Path(folder, "first"))
        before = runs(JUDGED, SINGLE, Path(folder, "before"))
        rate = swept(Path(folder))
        single = 1 / median(before + runs(JUDGED, SINGLE, Path(folder, "after")))
    print(f"{JUDGED}, {cores()} cores: single {single:.3f} runs/s, sweep of {RUNS} {rate:.3f}", flush=True)
    return rate / single / cores()


def fresh(*arguments: str) -> float:
    """Seconds that Python takes with these arguments in a process of its own: the best of five."""
    return min(repeat(lambda: subprocess.run([sys.executable, *arguments], stdout=subprocess.DEVNULL, check=True),
                      number=1))


def warm(preset: str, folder: Path) -> float:
    """Seconds of a run of base in this process, files and page included: the best of five."""
    return min(runs(preset, 5, folder))


def commands() -> dict[str, tuple[float, float]]:
    """{command: its time over what it cannot do without, and the most that is accepted}."""
    found = {"repro --help": (fresh("-m", "repro", "--help") / fresh("-c", "import numpy"), 2.0)}
    packages = fresh("-c", f"import {PACKAGES}")
    for preset in (TOLD, JUDGED):
        with TemporaryDirectory() as folder:
            asked = ["base", "--set", f"numerics.preset={preset}", "--force", "--quiet", "--out", f"{folder}/run"]
            taken = fresh("-m", "repro", "run", *asked)
            found[f"repro run base in {preset}"] = (taken / (packages + warm(preset, Path(folder))), 1.3)
    return found


def main(arguments: list[str] | None = None) -> int:
    """Measure and judge the median of the repeats."""
    parser = argparse.ArgumentParser(prog="python -m verification.throughput", description=__doc__.partition(":")[0])
    parser.add_argument("--repeats", type=int, default=1)
    chosen = parser.parse_args(arguments)
    rate = median(measure() for _ in range(chosen.repeats))
    told = {f"throughput of the sweep over cores times a single run's rate: {rate:.3f} in {JUDGED}, {WANTED} wanted":
            rate >= WANTED}
    for command, (ratio, most) in commands().items():
        told[f"{command}: {ratio:.2f} times what it cannot do without, {most} accepted"] = ratio <= most
    for words, holds in told.items():
        print(f"{words}: {'holds' if holds else 'does not hold'}")
    return int(not all(told.values()))


if __name__ == "__main__":
    sys.exit(main())
