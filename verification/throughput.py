"""Rate of a sweep against that of single runs: ``python -m verification.throughput [--runs N] [--repeats N]``.

A single run's rate is that of the same runs, one after the other in one process that has imported everything (the
median of several); the sweep's is that of 50 short runs on all cores, from an empty folder to the page, starting of
processes included. Wanted: 0.9 times the number of cores. Control: a process a core, each with runs in a loop and
nothing between them, which is what this machine, its memory and its other users leave to be had. Exit status 1 where
the sweep falls short.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory
from time import perf_counter

from repro import load_scene, run
from repro.cli import main as repro
from repro.sweep.pool import cores

WANTED = 0.9
SETS = ("numerics.preset=fast",)
WIDTHS = "48:52 um"  # nearly the same run each time


def sets() -> list[str]:
    """The arguments that make the base scene short."""
    return [part for entry in SETS for part in ("--set", entry)]


def single(count: int, folder: Path) -> float:
    """Runs a second in this process, one after the other: of the median run."""
    seconds = []
    for k in range(count):
        scene = load_scene("base", [*SETS, f"pore.width={48 + 4 * k / max(count - 1, 1)!r} um"])
        start = perf_counter()
        run(scene, folder / f"{k}")
        seconds.append(perf_counter() - start)
    return 1 / median(seconds)


def bare(count: int) -> float:
    """Runs a second of a process a core, each of which has runs of its own in a loop: the sum of their rates."""
    command = [sys.executable, "-m", "verification.throughput", "--loop", str(count)]
    processes = [subprocess.Popen(command, stdout=subprocess.PIPE, text=True) for _ in range(cores())]
    return sum(json.loads(process.communicate()[0]) for process in processes)


def loop(count: int) -> None:
    """Print this process's rate, the mean of all its runs but the first, which loads what is loaded when used."""
    with TemporaryDirectory() as folder:
        single(1, Path(folder))
        start = perf_counter()
        single(count, Path(folder))
        print(count / (perf_counter() - start))


def swept(count: int, folder: Path) -> float:
    """Runs a second of a sweep."""
    start = perf_counter()
    status = repro(["sweep", "base", "--vary", f"pore.width={WIDTHS}:linear:{count}", *sets(), "--quiet",
                    "--out", str(folder / "sweep")])
    if status:
        raise RuntimeError(f"the sweep ended with status {status}")
    return count / (perf_counter() - start)


def measure(count: int) -> tuple[float, float]:
    """The sweep's rate and the control's, over cores times a single run's rate."""
    with TemporaryDirectory() as folder:
        single(1, Path(folder))
        before = single(5, Path(folder))
        rate = swept(count, Path(folder))
        after = single(5, Path(folder))
        control = bare(max(count // cores(), 1))
    one = (before + after) / 2
    print(f"{cores()} cores; single {before:.3f} and {after:.3f} runs/s (before, after); sweep of {count} {rate:.3f}; "
          f"bare processes {control:.3f}; sweep {rate / (cores() * one):.3f}, bare {control / (cores() * one):.3f} "
          f"times cores times single; sweep over bare {rate / control:.3f}", flush=True)
    return rate / (cores() * one), control / (cores() * one)


def main(arguments: list[str] | None = None) -> int:
    """Measure and judge the median of the repeats."""
    parser = argparse.ArgumentParser(prog="python -m verification.throughput", description=__doc__.partition(":")[0])
    parser.add_argument("--runs", type=int, default=50)
    parser.add_argument("--repeats", type=int, default=3)
    parser.add_argument("--loop", type=int, help=argparse.SUPPRESS)
    chosen = parser.parse_args(arguments)
    if chosen.loop:
        loop(chosen.loop)
        return 0
    found = median(measure(chosen.runs)[0] for _ in range(chosen.repeats))
    print(f"throughput of the sweep: {found:.3f} times cores times a single run's rate, {WANTED} wanted: "
          f"{'holds' if found >= WANTED else 'does not hold'}")
    return 0 if found >= WANTED else 1


if __name__ == "__main__":
    sys.exit(main())
