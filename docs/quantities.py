"""The table of all that a run reports, made of the definitions: python docs/quantities.py > docs/quantities.md"""
from repro.report.quantities import DERIVED
from repro.results.arrays import ARRAYS
from repro.results.columns import LEDGER, SERIES
from repro.runs.record import COUNTS
from repro.sweeps.table import NUMBERS

TABLES = {
    "Columns of `timeseries.csv`, `timeseries.nc` and `table.csv`": SERIES,
    "Columns of `ledger.csv`, a row a step": LEDGER,
    "Arrays of the `.vtu` files": ARRAYS,
    "Drawn in pages besides": DERIVED,
    "Counts and times in `run.json`": COUNTS,
    "Columns of a sweep's `runs.csv`": NUMBERS,
}
INTRODUCTION = """# What is reported

Made by `python docs/quantities.py > docs/quantities.md` from the definitions in `repro/results/columns.py`,
`repro/results/arrays.py`, `repro/report/quantities.py`, `repro/runs/record.py` and `repro/sweeps/table.py`. Symbols are
the paper's. A column is empty where its part is not modelled. An array is given at nodes or in triangles, in the whole
pore or in the aggregate alone, with NaN in the fluid; nodes of the interface have the aggregate's value. The time (h)
is `TimeValue` in the field data of a `.vtu` file."""


def text() -> str:
    """The whole document."""
    return "\n\n".join([INTRODUCTION, *(f"## {title}\n\n{table(each)}" for title, each in TABLES.items())]) + "\n"


def table(quantities) -> str:
    """A table in Markdown, a line a quantity."""
    return "\n".join(["| name | unit | what it is | formula | range | given with |", "|---|---|---|---|---|---|",
                      *map(line, quantities)])


def line(one) -> str:
    """One quantity."""
    cells = (f"`{one.name}`", one.unit.shown or "1", one.words, one.formula, range_of(one), given(one))
    return f"| {' | '.join(cell.replace('|', chr(92) + '|') for cell in cells)} |"


def range_of(one) -> str:
    """The values that it may have."""
    return "0 or 1" if one.yes_no else "any" if one.signed else "0 or more"


def given(one) -> str:
    """What must be modelled, and where an array is."""
    places = []
    if hasattr(one, "cells"):
        places = ["triangles" if one.cells else "nodes", *["aggregate alone"] * one.body]
    return ", ".join([one.needs, *places] if one.needs else places)


if __name__ == "__main__":
    print(text(), end="")
