"""Tables of all reported quantities, from their definitions: python docs/quantities.py > docs/quantities.md"""
from repro.report.quantities import DERIVED
from repro.results.arrays import ARRAYS
from repro.results.columns import BODY, DETACHED, LEDGER, RATES, SERIES, TOTALS
from repro.runs.history import COUNTS
from repro.sweeps.table import NUMBERS

TABLES = {
    "Columns of `timeseries.csv` and `table.csv`": (*SERIES, *RATES),
    "Columns of these tables with `pore.depth`": TOTALS,
    "Columns of each aggregate in these tables if there are several": BODY,
    "Columns of `ledger.csv`, a row a step": (*LEDGER, DETACHED),
    "Arrays of the `.vtu` files": ARRAYS,
    "Further quantities on pages": DERIVED.values(),
    "Counts and times in `run.json`": COUNTS,
    "Columns of a sweep's `runs.csv`": NUMBERS,
}
INTRODUCTION = """# Reported quantities

Written by `python docs/quantities.py > docs/quantities.md` from the definitions in `repro/results/columns.py`,
`repro/results/arrays.py`, `repro/report/quantities.py`, `repro/runs/history.py` and `repro/sweeps/table.py`. Symbols
are the paper's. A column is empty if its part is not modelled. An array is defined at nodes or in triangles, in the
pore or in the aggregate only, with NaN in the fluid; nodes of the interface have the aggregate's value. The time (h)
is `TimeValue` in the field data of a `.vtu` file."""


def text() -> str:
    """The document."""
    sections = [f"## {title}\n\n{table(quantities)}" for title, quantities in TABLES.items()]
    return "\n\n".join([INTRODUCTION, *sections]) + "\n"


def table(quantities) -> str:
    """A table in Markdown with a line for each quantity."""
    return "\n".join(["| name | unit | meaning | formula | range | requires |", "|---|---|---|---|---|---|",
                      *map(line, quantities)])


def line(quantity) -> str:
    """The line of one quantity."""
    cells = (f"`{quantity.name}`", quantity.unit.symbol or "1", quantity.words, quantity.formula, range_of(quantity),
             requirements(quantity))
    return f"| {' | '.join(cell.replace('|', chr(92) + '|') for cell in cells)} |"


def range_of(quantity) -> str:
    """The range of its values."""
    return "0 or 1" if quantity.yes_no else "any" if quantity.signed else "0 or more"


def requirements(quantity) -> str:
    """The required parts of the model, and the location of an array."""
    places = []
    if hasattr(quantity, "cells"):
        places = ["triangles" if quantity.cells else "nodes", *["aggregate alone"] * quantity.body]
    return ", ".join([quantity.needs, *places] if quantity.needs else places)


if __name__ == "__main__":
    print(text(), end="")
