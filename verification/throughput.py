"""Rate of a sweep against that of single runs: ``python -m verification.throughput [--repeats N]``.

Single runs are made one after the other, before and after the sweep, in a process that has imported all packages. Their
rate is that of the median. The sweep makes 200 short runs on all cores. Its time includes the start of the processes,
the files and the page. The required ratio of both rates is 0.95 times the number of cores, with base in `fast`, which
takes less than half a second per run.

`repro --help` is timed too, the best of five: it may take twice the import of NumPy. `make bench` times runs of base as
they are typed. The exit status is 1 if a ratio is missed. All takes less than four minutes on two free cores.
"""

import argparse
import sys
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory
from time import perf_counter

from repro import load_scene, run, sweep
from repro.sweeps.pool import cores
from verification.bench.commands import time_process

REQUIRED = 0.95
#: Largest accepted time of `repro --help` over the import of NumPy.
LARGEST = 2.0
#: Preset of the sweep.
JUDGED = "fast"
RUNS = 200  # of the sweep
SINGLE = 10  # runs before the sweep, and after it
WIDTHS = "48:52 um"  # nearly the same run each time


def runs(preset: str, count: int, folder: Path) -> list[float]:
    """Seconds of each run in this process, one after the other, into a new folder."""
    seconds = []
    for k in range(count):
        scene = load_scene("base", [f"numerics.preset={preset}", f"pore.width={48 + 4 * k / count!r} um"])
        start = perf_counter()
        run(scene, folder / f"{k}")
        seconds.append(perf_counter() - start)
    return seconds


def swept(folder: Path) -> float:
    """Runs per second of a sweep."""
    start = perf_counter()
    varied = [f"pore.width={WIDTHS}:linear:{RUNS}"]
    sweep_result = sweep("base", varied, folder / "sweep", [f"numerics.preset={JUDGED}"])
    if sweep_result.failed:
        raise RuntimeError(f"{len(sweep_result.failed)} runs of the sweep failed")
    return RUNS / (perf_counter() - start)


def measure() -> float:
    """Rate of the sweep over the number of cores times the rate of single runs."""
    with TemporaryDirectory() as folder:
        runs(JUDGED, 1, Path(folder, "first"))
        before = runs(JUDGED, SINGLE, Path(folder, "before"))
        rate = swept(Path(folder))
        single = 1 / median(before + runs(JUDGED, SINGLE, Path(folder, "after")))
    print(f"{JUDGED}, {cores()} cores: single {single:.3f} runs/s, sweep of {RUNS} {rate:.3f}", flush=True)
    return rate / single / cores()


def seconds_of_process(*arguments: str) -> float:
    """Seconds of a new Python process with these arguments, the least of five measurements."""
    return min(time_process(*arguments)[0] for _ in range(5))


def time_of_help() -> float:
    """Time of `repro --help` over that of the import of NumPy."""
    return seconds_of_process("-m", "repro", "--help") / seconds_of_process("-c", "import numpy")


def main(arguments: list[str] | None = None) -> int:
    """Measure and judge the median of the repeats."""
    parser = argparse.ArgumentParser(prog="python -m verification.throughput", description=__doc__.partition(":")[0])
    parser.add_argument("--repeats", type=int, default=1)
    chosen = parser.parse_args(arguments)
    rate = median(measure() for _ in range(chosen.repeats))
    throughput = f"throughput of the sweep over cores times a single run's rate: {rate:.3f} in {JUDGED}"
    verdicts = {f"{throughput}, {REQUIRED} required": rate >= REQUIRED}
    over = time_of_help()
    verdicts[f"repro --help: {over:.2f} times the import of NumPy, {LARGEST:g} accepted"] = over <= LARGEST
    for words, holds in verdicts.items():
        print(f"{words}: {'holds' if holds else 'does not hold'}")
    return int(not all(verdicts.values()))


if __name__ == "__main__":
    sys.exit(main())
