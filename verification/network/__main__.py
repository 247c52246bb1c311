"""`python -m verification.network`: make the law's table and judge it with shapes that it has not seen; a few minutes.

Writes `repro/results/network.csv`, the table; `verification/network/shapes.csv`, what it was made of at one lambda and
what it was judged by, from which `make figures` draws its picture; and `docs/network.md`. Exit status 1 where a shape
that the fit has not seen lies outside the law's bounds.
"""

from __future__ import annotations

import sys
from pathlib import Path

from repro.results import write_table, write_text
from repro.results.network import TABLE
from verification.network import law

PAGE = Path(__file__).parents[2] / "docs" / "network.md"


def main() -> int:
    """Entry point; returns the exit status."""
    discs, others = law.half_discs(), list(law.others())
    write_table(TABLE, law.TABLE_COLUMNS, law.table_rows(discs, others))
    print(f"{TABLE.name}: made of {len(discs)} half-discs and {len(others)} other shapes", flush=True)
    seen = [law.shape_row(one, 0) for one in discs + others]
    new = [law.shape_row(one, 1) for one in law.new_shapes()]
    write_table(law.SHAPES, law.COLUMNS, seen + new)
    found = law.judged(law.read(unseen=True))
    write_text(PAGE, law.page(law.read(unseen=False), found))
    print(f"{found.inside} of {found.count} shapes that the fit has not seen are within the law's bounds")
    return int(found.inside < found.count)


if __name__ == "__main__":
    sys.exit(main())
