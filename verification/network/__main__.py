"""`python -m verification.network`: make the law's table and judge it with shapes that it has not seen; a few minutes.

Writes the table `repro/results/network.csv`; the page `docs/network.md`; and `verification/network/shapes.csv`, the
shapes of the fit at one lambda and the test shapes, from which `make figures` draws its picture. The exit status is 1
if a test shape lies outside the law's bounds.

With an argument it makes another record instead: `uptake` the states of the law of uptake, `histories` the network with
OpenPNM, `throats` whole runs of ten of its throats.
"""

import sys
from pathlib import Path

from repro.results import write_table, write_text
from repro.results.network import TABLE
from verification.network import lattice, law, throats, uptakes

PAGE = Path(__file__).parents[2] / "docs" / "network.md"


def main() -> int:
    """Entry point; returns the exit status."""
    others = {"uptake": uptake_states, "histories": network, "throats": runs}
    if sys.argv[1:]:
        return others[sys.argv[1]]()
    return resistance()


def uptake_states() -> int:
    """Make the states of the law of uptake, and judge it."""
    parts = (uptakes.FIT, uptakes.FIRST_TEST, uptakes.SECOND_TEST)
    rows = [list(one) for part in parts for one in uptakes.states(part)]
    write_table(uptakes.TABLE, list(uptakes.State._fields), rows)
    inside, count = uptakes.judged(uptakes.SECOND_TEST)
    print(f"{inside} of {count} states that the law of uptake has not seen are within its bound")
    return int(inside < count)


def network() -> int:
    """Advance the network."""
    mesh = lattice.Lattice()
    write_table(throats.HISTORIES, throats.HISTORY_COLUMNS, list(throats.history_rows(mesh, lattice.advance(mesh))))
    return 0


def runs() -> int:
    """Run ten throats."""
    rows = [row for throat, history in throats.histories().items() for row in throats.run_rows(throat, history)]
    write_table(throats.RUNS, throats.RUN_COLUMNS, rows)
    return 0


def resistance() -> int:
    """Make the law of resistance, and judge it."""
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
