"""`python -m verification.network`: make the law's table and judge it with shapes that it has not seen; a few minutes.

Writes the table `repro/results/network.csv`; the page `docs/network.md`; and `verification/network/shapes.csv`, the
shapes of the fit at one lambda and the test shapes, from which `make figures` draws its picture. The exit status is 1
if a test shape lies outside the law's bounds.
"""

import sys
from pathlib import Path

from repro.results import write_table, write_text
from repro.results.network import TABLE
from verification.network import law

PAGE = Path(__file__).parents[2] / "docs" / "network.md"


def main() -> int:
    """Entry point; returns the exit status."""
    discs, other_shapes = law.half_discs(), list(law.other_shapes())
    write_table(TABLE, law.TABLE_COLUMNS, law.table_rows(discs, other_shapes))
    print(f"{TABLE.name}: made of {len(discs)} half-discs and {len(other_shapes)} other shapes", flush=True)
    fitted = [law.shape_row(one, 0) for one in discs + other_shapes]
    new = [law.shape_row(one, 1) for one in law.new_shapes()]
    write_table(law.SHAPES, law.COLUMNS, fitted + new)
    verdict = law.judged(law.read(unseen=True))
    write_text(PAGE, law.page(law.read(unseen=False), verdict))
    print(f"{verdict.inside} of {verdict.count} shapes that the fit has not seen are within the law's bounds")
    return int(verdict.inside < verdict.count)


if __name__ == "__main__":
    sys.exit(main())
