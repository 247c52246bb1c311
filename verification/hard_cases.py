"""Twenty-two hard cases with every preset: ``python -m verification.hard_cases [--case N ...] [--preset P ...]``.

Each case is a few parts; a part runs scenes or stages and checks numbers. A cell of the matrix, a case with a preset, is

    right     all its checks hold, and so does what must hold in every run (balances, bounds, finite numbers);
    refused   a part has stopped with an error of ``repro``, which says what bound was met or what to change;
    wrong     a check fails, another exception is raised, or a part takes longer than LIMIT.

Refusing is accepted in the parts that a case names and with ``paper``; wrong is never. The matrix is printed, and
written to ``verification/report/hard_cases.json``.
"""

from __future__ import annotations

import argparse
import json
import platform
import re
import signal
import sys
from collections.abc import Iterable
from contextlib import contextmanager
from dataclasses import dataclass
from math import isfinite
from pathlib import Path
from time import process_time

import numpy as np

from repro.errors import SimulationError, StageError
from repro.units import SceneError
from verification.case import Check
from verification.hard import CASES
from verification.hard.common import PRESETS, HardCase, Run, sound

RECORD = Path(__file__).parent / "report" / "hard_cases.json"
#: CPU seconds that a part may take: twenty times what the longest does.
LIMIT = 300.0
RIGHT, REFUSED, WRONG = "right", "refused", "wrong"
#: A refusal must say one of these: what to try, or which bound was met.
REASON = re.compile(r"\b(try|leave|needed|under|above|more than|accepted|outside of)\b")


class TooLong(Exception):
    """A part has taken more than LIMIT."""


@dataclass(frozen=True, eq=False)
class Part:
    """What came of one part: its verdict, why, its own checks, and those of every run in it."""

    name: str
    verdict: str
    message: str
    checks: tuple[Check, ...] = ()
    always: tuple[Check, ...] = ()


@dataclass(frozen=True, eq=False)
class Cell:
    """A case with a preset; accepted: is its verdict one that it may have?"""

    case: HardCase
    preset: str
    parts: tuple[Part, ...]
    seconds: float

    @property
    def verdict(self) -> str:
        """The worst of the parts'."""
        return max((part.verdict for part in self.parts), key=(RIGHT, REFUSED, WRONG).index, default=WRONG)

    @property
    def message(self) -> str:
        """Why it is not right, part by part."""
        return "; ".join(f"{part.name}: {part.message}" for part in self.parts if part.verdict != RIGHT)

    @property
    def unaccepted(self) -> tuple[Part, ...]:
        """Parts whose verdict is not one that they may have."""
        return tuple(part for part in self.parts if not accepted(self.case, self.preset, part))


def accepted(case: HardCase, preset: str, part: Part) -> bool:
    """Right always is; refused where the case says so, and with the paper's scheme; wrong where that scheme's error is
    explained."""
    if part.verdict == REFUSED:
        return preset == "paper" or part.name in case.refusable
    return part.verdict == RIGHT or (preset == "paper" and part.name in case.explained)


def run_cell(case: HardCase, preset: str) -> Cell:
    """Run every part of a case with a preset."""
    start = process_time()
    parts = tuple(run_part(name, function, preset) for name, function in case.parts.items())
    return Cell(case, preset, parts, process_time() - start)


def run_part(name: str, function, preset: str, limit: float = LIMIT) -> Part:
    """Run one part and judge it."""
    try:
        with np.errstate(all="raise", under="ignore"), _limited(limit):
            items = function(preset)
            checks = tuple(item for item in items if isinstance(item, Check))
            always = tuple(check for item in items if isinstance(item, Run) for check in sound(item))
    except (SimulationError, StageError, SceneError) as error:
        said = bool(REASON.search(str(error)))
        return Part(name, REFUSED if said else WRONG, f"{error}" if said else f"refused without a reason: {error}")
    except TooLong:
        return Part(name, WRONG, f"not done after {limit:g} s")
    except Exception as error:
        return Part(name, WRONG, f"{type(error).__name__}: {error}")
    return judged(name, checks, always)


def judged(name: str, checks: tuple[Check, ...], always: tuple[Check, ...]) -> Part:
    """Right if there are checks and all of them hold."""
    short = [check for check in (*checks, *always) if not check.holds]
    if short:
        told = "; ".join(f"{c.quantity} {c.measured} (expected {c.expected})" for c in short)
        return Part(name, WRONG, told, checks, always)
    if not checks and not always:
        return Part(name, WRONG, "nothing was measured")
    return Part(name, RIGHT, "", checks, always)


@contextmanager
def _limited(seconds: float):
    """Raises TooLong inside when the process has spent so many CPU seconds."""
    def stop(*_):
        raise TooLong

    before = signal.signal(signal.SIGPROF, stop)
    signal.setitimer(signal.ITIMER_PROF, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        signal.signal(signal.SIGPROF, before)


def used(check: Check) -> float:
    """How much of its tolerance a check uses: 0 to 1 where it holds."""
    if not check.holds:
        return 2.0
    if isfinite(check.low) and isfinite(check.high) and check.low != 0:
        half = (check.high - check.low) / 2
        return abs(check.value - check.low - half) / half
    if isfinite(check.high):
        return check.value / check.high if check.high else 0.0
    return max(0.0, check.value / check.low) if check.low < 0 else check.low / check.value if check.value else 0.0


def as_json(cells: Iterable[Cell]) -> dict:
    """What the report and the README draw the matrix from."""
    rows: dict[int, dict] = {}
    for cell in cells:
        case = cell.case
        row = rows.setdefault(case.number, {"number": case.number, "id": f"hard-{case.number:02d}-{case.id}",
                                            "title": case.title, "right_is": case.right_is,
                                            "failure_is": case.failure_is, "may_refuse": list(case.refusable),
                                            "explained": case.explained, "cells": {}})
        row["cells"][cell.preset] = {"verdict": cell.verdict, "message": cell.message,
                                     "accepted": not cell.unaccepted, "checks": _checks(cell),
                                     "seconds": round(cell.seconds, 2)}
    return {"cases": [rows[number] for number in sorted(rows)], "machine": machine()}


def _checks(cell: Cell) -> list[dict]:
    return [{"part": part.name, "quantity": check.quantity, "measured": check.measured, "expected": check.expected,
             "origin": check.origin, "holds": check.holds}
            for part in cell.parts for check in (*part.checks, *part.always)]


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
        RECORD.parent.mkdir(exist_ok=True)
        RECORD.write_text(json.dumps(as_json(cells), indent=1) + "\n", encoding="utf-8")
    return 1 if any(cell.unaccepted for cell in cells) else 0


if __name__ == "__main__":
    sys.exit(main())
