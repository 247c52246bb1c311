"""Run the verification: ``python -m verification [STAGE ...]``. Exit status 1 if any case falls short.

A whole run writes ``verification/report``; a run of some stages, or a fast one, prints its table only.
"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Callable, Iterable
from concurrent.futures import ProcessPoolExecutor, as_completed

from verification.kernel import case, report
from verification.kernel.case import load


def main(arguments: list[str] | None = None, writers: Iterable[Callable] = ()) -> int:
    """Entry point; returns the exit status. writers: what else writes of the results of a whole run, in turn."""
    load()
    chosen = _parser().parse_args(arguments)
    results = run_all(selected(chosen.stages, chosen.case, chosen.fast), chosen.jobs)
    print(report.terminal(results))
    if not (chosen.stages or chosen.case or chosen.fast):
        for write in writers:
            write(results)
        print(f"report: {report.write(results)}")
    return 0 if results and all(result.holds for result in results) else 1


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="python -m verification", description=__doc__.splitlines()[0])
    parser.add_argument("stages", nargs="*", metavar="STAGE", choices=[*case.STAGES, []], default=[],
                        help=f"{', '.join(case.STAGES)}; all by default")
    parser.add_argument("--case", action="append", default=[], metavar="ID", choices=case.CASES,
                        help="this case alone; may be repeated")
    parser.add_argument("--fast", action="store_true", help="without the cases that are marked as slow")
    parser.add_argument("--jobs", type=int, default=os.cpu_count(), help="processes; one a core by default")
    return parser


def selected(stages, ids, fast: bool = False) -> list[str]:
    """Ids of the cases of some stages, or of some ids, in the order of the stages; all where both are empty."""
    wanted = stages or (case.STAGES if not ids else ())
    ordered = sorted(case.CASES.values(), key=lambda c: case.STAGES.index(c.stage))
    return [c.id for c in ordered if (c.stage in wanted and not (fast and c.slow)) or c.id in ids]


def run_all(ids: list[str], jobs: int) -> list[case.Result]:
    """Results in the order of ``ids``, several cases side by side, those of whole runs, which are the last and take
    longest, first; a line each as it ends."""
    results = {}
    with ProcessPoolExecutor(max_workers=jobs) as pool:
        for future in as_completed([pool.submit(_run_one, i) for i in reversed(ids)]):
            result = future.result()
            results[result.id] = result
            print(f"{result.verdict:12} {result.id:28} {result.seconds:6.1f} s", file=sys.stderr, flush=True)
    return [results[i] for i in ids]


def _run_one(id: str) -> case.Result:
    load()
    return case.run(case.CASES[id])

