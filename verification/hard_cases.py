"""The matrix of the twenty-three hard cases with every preset, which ``python -m verification`` runs: `... hard` for
all of them, `... --case hard-04-fast-flow` for one.

"cubic" is the preset fast with cubic elements. Each cell of the matrix, a case with a preset, is right, refused or
wrong, see :mod:`verification.hard.common`. Refusing is accepted in the parts that a case names, and with ``paper``;
wrong is never. A whole run writes it to ``verification/report/hard_cases.json``, with messages to ``live/`` beside it;
every number is on the page of the stage.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path

from verification.hard.common import Cell
from verification.kernel.writing import Block, save, table

RECORD = Path(__file__).parent / "report" / "hard_cases.json"


def as_json(cells: Iterable[Cell], live: bool = False) -> dict:
    """What the report and docs/performance.md draw the matrix from: verdicts; live: with messages, which have this
    machine's numbers."""
    rows: dict[int, dict] = {}
    for cell in cells:
        case = cell.case
        row = rows.setdefault(case.number, {"number": case.number, "id": case.full_id,
                                            "title": case.title, "right_is": case.right_is,
                                            "failure_is": case.failure_is, "may_refuse": list(case.refusable),
                                            "cells": {}})
        row["cells"][cell.preset] = {"verdict": cell.verdict, "accepted": not cell.unaccepted,
                                     **({"message": cell.message} if live else {})}
    return {"cases": [*rows.values()]}


def record(results: Iterable) -> None:
    """Write the verdicts for the report and the README from the results of a whole verification run, and, not
    committed, why cells are not right."""
    cells = [cell for result in results for cell in result.outcome.notes if isinstance(cell, Cell)]
    save(as_json(cells), RECORD)
    save(as_json(cells, live=True), RECORD.parent / "live" / RECORD.name)


def blocks(record: dict) -> Iterator[Block]:
    """The matrix."""
    presets = tuple(record["cases"][0]["cells"])
    yield Block("heading", "Hard cases")
    yield Block("text", "Right: the exact value, bound or conserved quantity of the case is met, and so are the "
                        "balances; refused: an error says which bound was met; wrong: anything else. `make verify` "
                        "runs them all, and leaves every number in `verification/report/live`; "
                        "`python -m verification hard` runs them alone.")
    yield table(("", "case", "right is", *presets), (
        (str(case["number"]), case["title"], case["right_is"], *map(_shown, map(case["cells"].get, presets)))
        for case in record["cases"]))


def _shown(cell: dict | None) -> str:
    """The verdict, with a mark where it is none that it may be."""
    return "" if cell is None else cell["verdict"] + "!" * (not cell.get("accepted", True))
