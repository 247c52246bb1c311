"""What is verified by what: cases by the elements and presets that they run with."""

from __future__ import annotations

from verification.kernel.case import CASES, STAGES, WAYS, Case
from verification.kernel.writing import Block, table

#: Why a case does not run with any preset.
ALONE = "a stage alone: presets choose among its elements"


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
    return case.because if {*WAYS} - {*case.ways} else ""
