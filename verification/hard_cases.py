"""Twenty-two hard cases with every preset: ``python -m verification.hard_cases [--case N ...] [--preset P ...]``.

"cubic" is the preset fast with cubic elements. Each cell of the matrix, a case with a preset, is right, refused or
wrong, see :mod:`verification.hard.common`. Refusing is accepted in the parts that a case names, and with ``paper``;
wrong is never. The matrix is printed; a whole one is written to ``verification/report/hard_cases.json`` too, its
numbers and seconds to ``live/`` beside it. Exit status 1 if a cell is what it may not be.
"""

from __future__ import annotations

import argparse
import platform
import sys
from collections.abc import Iterable
from pathlib import Path

from verification.bench.record import save
from verification.hard import CASES
from verification.hard.common import PRESETS, Cell, run_cell

RECORD = Path(__file__).parent / "report" / "hard_cases.json"


def as_json(cells: Iterable[Cell], live: bool = False) -> dict:
    """What the report and docs/performance.md draw the matrix from: verdicts; live: with messages, numbers and
    seconds, which are this machine's."""
    rows: dict[int, dict] = {}
    for cell in cells:
        case = cell.case
        row = rows.setdefault(case.number, {"number": case.number, "id": case.full_id,
                                            "title": case.title, "right_is": case.right_is,
                                            "failure_is": case.failure_is, "may_refuse": list(case.refusable),
                                            "cells": {}})
        row["cells"][cell.preset] = {"verdict": cell.verdict, "accepted": not cell.unaccepted,
                                     **(_digits(cell) if live else {})}
    return {"cases": [rows[number] for number in sorted(rows)], **({"machine": machine()} if live else {})}


def _digits(cell: Cell) -> dict:
    return {"message": cell.message, "checks": _checks(cell), "seconds": round(cell.seconds, 2)}


def _checks(cell: Cell) -> list[dict]:
    return [{"part": part.name, "quantity": check.quantity, "measured": check.measured, "expected": check.expected,
             "origin": check.origin, "holds": check.holds}
            for part in cell.parts for check in (*part.checks, *part.always)]


def record(results: Iterable) -> None:
    """Write the matrix from the results of a whole verification run, which has run every cell already."""
    write(cell for result in results for cell in result.outcome.notes if isinstance(cell, Cell))


def write(cells: Iterable[Cell]) -> None:
    """Write the verdicts for the report and the README, and, not committed, all that this machine has measured."""
    found = list(cells)
    save(as_json(found), RECORD)
    save(as_json(found, live=True), RECORD.parent / "live" / RECORD.name)


def machine() -> str:
    """What the seconds were measured on."""
    return f"{platform.machine()}, {platform.system()}, Python {platform.python_version()}, one core"


def matrix(cells: Iterable[Cell]) -> str:
    """The matrix in plain text, and why cells are not right."""
    cells = list(cells)
    lines, notes = [f"{'':48}" + "".join(f"{preset:>16}" for preset in PRESETS)], []
    for number in sorted({cell.case.number for cell in cells}):
        row = {cell.preset: cell for cell in cells if cell.case.number == number}
        title = next(iter(row.values())).case.title
        lines.append(f"{number:2d} {title[:44]:45}" + "".join(_shown(row.get(preset)) for preset in PRESETS))
        notes += [f"{number:2d} {preset}: {cell.message}" for preset, cell in row.items() if cell.message]
    return "\n".join(lines + notes)


def _shown(cell: Cell | None) -> str:
    if cell is None:
        return f"{'':16}"
    mark = "" if not cell.unaccepted else "!"
    return f"{cell.verdict + mark:>9}{cell.seconds:5.1f} s"


def main(arguments: list[str] | None = None) -> int:
    """Entry point; 1 if a cell has a verdict that it may not have."""
    parser = argparse.ArgumentParser(prog="python -m verification.hard_cases", description=__doc__.splitlines()[0])
    parser.add_argument("--case", type=int, action="append", choices=sorted(case.number for case in CASES))
    parser.add_argument("--preset", action="append", choices=PRESETS)
    chosen = parser.parse_args(arguments)
    cells = []
    for case in sorted(CASES, key=lambda case: case.number):
        for preset in chosen.preset or PRESETS:
            if not chosen.case or case.number in chosen.case:
                cells.append(run_cell(case, preset))
                print(f"{case.number:2d} {preset:9} {_shown(cells[-1])}", file=sys.stderr, flush=True)
    print(matrix(cells))
    if not (chosen.case or chosen.preset):
        write(cells)
    return 1 if any(cell.unaccepted for cell in cells) else 0


if __name__ == "__main__":
    sys.exit(main())
