"""When a cell of the matrix, a hard case with a preset, is right, refused or wrong.

right     all checks of its parts hold, and so does what must hold in every run (balances, bounds, finite numbers);
refused   a part has stopped with an error of ``repro``, which says what bound was met or what to change;
wrong     a check fails, another exception is raised, nothing is measured, or a part takes longer than LIMIT.

Every hard case as a verification case, with all presets.
"""

from __future__ import annotations

import re
import signal
from collections.abc import Iterable
from contextlib import contextmanager
from dataclasses import dataclass
from math import inf, isfinite
from time import process_time

import numpy as np

from repro.errors import SimulationError, StageError
from repro.scene.units import SceneError
from verification.hard.common import LENIENT, PRESETS, HardCase, Run, sound
from verification.kernel.case import Check, Outcome, at_most, case

#: CPU seconds that a part may take: ten times what the longest does.
LIMIT = 200.0
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
        return preset in LENIENT or part.name in case.refusable
    return part.verdict == RIGHT or (preset in LENIENT and part.name in case.explained)


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
        return inf
    if isfinite(check.low) and isfinite(check.high) and check.low != 0:
        half = (check.high - check.low) / 2
        return abs(check.value - check.low - half) / half
    if isfinite(check.high):
        return check.value / check.high if check.high else 0.0
    return max(0.0, check.value / check.low) if check.low < 0 else check.low / check.value if check.value else 0.0


@dataclass(frozen=True, eq=False)
class Verdicts(Outcome):
    """What a verification case of this stage has measured, with the cells that it comes from."""

    cells: tuple[Cell, ...] = ()

    def lines(self) -> list[tuple[str, str, str, bool]]:
        """Verdicts of the parts by preset; then what the right parts were judged by, by preset where bounds differ."""
        presets = ", ".join(cell.preset for cell in self.cells)
        found = [(f"verdict of {parts[0].name}", ", ".join(part.verdict for part in parts), presets,
                  not any(part in cell.unaccepted for cell, part in zip(self.cells, parts)))
                 for parts in zip(*(cell.parts for cell in self.cells))]
        bounds: dict[tuple[str, str], dict[str, dict[str, str]]] = {}
        for cell in self.cells:
            for part in cell.parts:
                for check in part.checks if part.verdict == RIGHT else ():
                    of = bounds.setdefault((check.quantity, part.name), {})
                    of[cell.preset] = {"expected": check.accepted, "origin": check.origin}
        return found + [(f"{name}, {quantity}", *_said(of), True) for (quantity, name), of in bounds.items()]


def _said(of: dict[str, dict[str, str]]) -> tuple[str, str]:
    """Bound and origin, once if all presets have the same."""
    both = []
    for key in ("expected", "origin"):
        words = [one[key] for one in of.values()]
        both.append(words[0] if len({*words}) == 1 else "; ".join(dict.fromkeys(words)))
    return both[0], both[1]


def outcome(cells: Iterable[Cell]) -> Verdicts:
    """All own checks of the parts that are right; what must hold in every run, folded into one number a preset; and how
    many parts have a verdict that they may not have."""
    cells, checks = tuple(cells), []
    for cell in cells:
        right = [part for part in cell.parts if part.verdict == RIGHT]
        checks += [Check(f"{cell.preset}, {part.name}: {c.quantity}", c.value, c.low, c.high, c.origin)
                   for part in right for c in part.checks]
        always = [used(check) for part in right for check in part.always]
        checks.append(at_most(f"{cell.preset}: of what must hold in every run, largest part of a tolerance",
                              max(always, default=0.0), 1.0, "balances, bounds of C, density, area, finite numbers"))
        told = f": {cell.message[:300]}" if cell.unaccepted else ""
        checks.append(at_most(f"{cell.preset}: parts that are wrong, or refused where they may not be{told}",
                              len(cell.unaccepted), 0, "the verdict of the matrix"))
    return Verdicts(tuple(checks), cells=cells)


def run_case(case: HardCase) -> Verdicts:
    """A case with every preset."""
    return outcome(run_cell(case, preset) for preset in PRESETS)


def register(cases: Iterable[HardCase]) -> None:
    """Make them known to ``python -m verification``."""
    for one in cases:
        _register(one)


def _register(one: HardCase) -> None:
    @case(one.full_id, kind="property", claim=f"{one.title}: {_sentence(one.right_is)}", norm=NORM, mutants=one.mutants,
          slow=one.slow, ways="1 2 3 paper fast accurate")
    def run() -> Verdicts:
        return run_case(one)


NORM = "numbers of each part with all presets, and with fast on cubic elements; refused parts are left out"


def _sentence(text: str) -> str:
    return text[0].lower() + text[1:]
