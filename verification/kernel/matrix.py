"""What is verified by what: cases by the elements and presets that they run with."""

from __future__ import annotations

from verification.kernel.case import CASES, STAGES, WAYS, Case
from verification.kernel.writing import Block, table

ORDERS, PRESETS = WAYS[:3], WAYS[3:]
#: Why a case does not run with presets, and with all of them.
ALONE = "presets: the stage alone, with the elements that they choose"
ONE_BY_ONE = "other presets: their elements, by themselves"


def blocks() -> list[Block]:
    """Every case with each of WAYS: run, run in the slow suite, or why not."""
    ordered = sorted(CASES.values(), key=lambda case: STAGES.index(case.stage))
    return [table(("case", *WAYS, "not applicable because"), map(row, ordered))]


def row(case: Case) -> tuple[str, ...]:
    """A line of the table."""
    run = "slow" if case.slow else "run"
    return (case.id, *(run if way in case.ways else "n/a" for way in WAYS), reasons(case))


def reasons(case: Case) -> str:
    """Why it does not run with the others; "" where it runs with all."""
    missing = [way for way in WAYS if way not in case.ways]
    default = ALONE if {*PRESETS} <= {*missing} else ONE_BY_ONE
    return "; ".join(filter(None, (case.because, default if {*PRESETS} & {*missing} else "")))


def unexplained() -> list[str]:
    """Cases that do not run with an order of elements, or with nothing at all, and do not say why."""
    return [case.id for case in CASES.values() if not case.ways or ({*ORDERS} - {*case.ways} and not case.because)]
