"""The matrix of the hard cases with every preset, ``verification/report/hard_cases.json``.

A cell is a case with a preset. It is right, refused or wrong; see :mod:`verification.problems.hard`. A case names the
parts that a preset may refuse; ``paper`` may refuse all parts.
"""

from collections.abc import Collection, Iterable, Iterator, Mapping

from verification.evidence.results import Result
from verification.evidence.writing import REPORT, load, save, table

RECORD = REPORT / "hard_cases.json"


def record(results: Iterable[Result]) -> None:
    """Replace the recorded rows of the hard cases that ran."""
    rows = {row["number"]: row for row in load(RECORD, {"cases": []})["cases"]}
    for cells in (result.cells for result in results if result.cells):
        case = next(iter(cells.values()))["case"]
        verdicts = {preset: {"verdict": cell["verdict"], "accepted": cell["accepted"]}
                    for preset, cell in cells.items()}
        rows[case["number"]] = {**case, "cells": verdicts}
    save({"cases": [rows[number] for number in sorted(rows)]}, RECORD)


def lines(cells: Collection[Mapping]) -> list[tuple[str, str, str, bool]]:
    """Rows of a table: the verdicts of each part, and the intervals of the right parts. Presets share equal intervals.
    Cells have the form of :meth:`verification.problems.hard.Cell.as_row`."""
    presets = ", ".join(cell["preset"] for cell in cells)
    rows = []
    for parts in zip(*(cell["parts"] for cell in cells)):
        verdicts = ", ".join(part["verdict"] for part in parts)
        rows.append((f"verdict of {parts[0]['name']}", verdicts, presets, all(part["accepted"] for part in parts)))
    bounds: dict[str, list[tuple[str, str]]] = {}
    for part in (part for cell in cells for part in cell["parts"]):
        for quantity, interval, origin in part["bounds"]:
            bounds.setdefault(f"{part['name']}, {quantity}", []).append((interval, origin))
    for name, pairs in bounds.items():
        intervals, origins = map(dict.fromkeys, zip(*pairs))
        rows.append((name, "; ".join(intervals), "; ".join(origins), True))
    return rows


def blocks(matrix: dict) -> Iterator[str]:
    """The matrix as blocks of a page."""
    presets = tuple(matrix["cases"][0]["cells"])
    yield "## Hard cases"
    yield ("Right: the exact value, bound or conserved quantity of the case is met, and so are the balances; refused: "
           "an error says which bound was met; wrong: anything else. `make verify` runs them all, and leaves every "
           "number in `verification/report/live`; `pytest verification -k hard` runs them alone.")
    yield table(("", "case", "right is", *presets), (
        (case["number"], case["title"], case["right_is"], *map(_verdict, map(case["cells"].get, presets)))
        for case in matrix["cases"]))


def _verdict(cell: dict | None) -> str:
    """The verdict, with a mark if the case does not accept it."""
    return "" if cell is None else cell["verdict"] + "!" * (not cell.get("accepted", True))
