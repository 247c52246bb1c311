"""`python -m verification.network`: make the table of the law, and judge it with shapes outside of the fit; minutes.

Writes the table `repro/network/resistance.csv`; the page `docs/network.md`; and `verification/network/shapes.csv`, the
shapes of the fit at one lambda and the test shapes, from which `make figures` draws its picture. The exit status is 1
if a test shape lies outside the law's bounds.

An argument selects another task:

    uptake     solves the states of the law of uptake, and fits and judges this law
    own        judges the laws of two scenes with other kinetics; the exit status is 1 if a state is outside the bounds
    histories  writes the histories of the throats in the example with OpenPNM, in the environment of `make network`
    expected   writes the law and its bounds for ten of the throats
    throats    runs the ten throats, and compares them with the law; the exit status is 1 if a bound does not hold
    sweep      times all throats as whole runs, on the process pool and on Dask: `sweep 12` to 12 h, by default to 48 h;
               some four minutes on two free cores
"""

import sys
from pathlib import Path

from repro.network.resistance import TABLE
from repro.network.uptakes import TRANSPORTS, UPTAKE_BOUND
from repro.results import write_table, write_text
from verification.network import histories, law, own, page, runs, throats, timed, uptakes

PAGE = Path(__file__).parents[2] / "docs" / "network.md"


def main() -> int:
    """Entry point; returns the exit status."""
    commands = {"uptake": uptake_law, "histories": write_histories, "expected": write_expected,
                "throats": run_throats, "sweep": time_sweep, "own": judge_own}
    return commands[sys.argv[1]]() if sys.argv[1:] else resistance()


def write_histories() -> int:
    """Run the example of a network, and write the histories of its throats."""
    histories.export()
    print(f"{histories.TABLE.name}: {len(histories.read())} throats")
    return 0


def uptake_law() -> int:
    """Solve states and fit the law of uptake to them. Then solve other states and judge the law."""
    names = list(uptakes.State._fields)
    rows = [list(one) for one in uptakes.states(uptakes.FIT)]
    write_table(uptakes.TABLE, names, rows)
    states = uptakes.read(uptakes.FIT)
    transports = uptakes.fitted(states)
    bound = uptakes.bound(states, TRANSPORTS)
    print(f"fit of {len(rows)} states:\n{transports[0]}\n{transports[1]}\nUPTAKE_BOUND = {bound}", flush=True)
    if bound != UPTAKE_BOUND or not uptakes.is_fit(states, TRANSPORTS):
        print(f"{TABLE.parent}/uptakes.py has other constants: copy these and start again")
        return 1
    write_table(uptakes.TABLE, names, rows + [list(one) for one in uptakes.states(uptakes.NEW)])
    write_text(PAGE, page.text())
    apart, bounds = uptakes.judged()
    print(f"{(apart <= bounds).sum()} of {len(bounds)} states that the fit has not seen are within its bound")
    return int((apart > bounds).any())


def judge_own() -> int:
    """Judge the laws of two scenes with other kinetics."""
    record = own.write()
    write_text(PAGE, page.text())
    return int(any(scene["own"]["within"] < scene["own"]["states"] for scene in record.values()))


def write_expected() -> int:
    """Compute the law and its bounds for ten throats."""
    rows = throats.expected(throats.chosen(histories.read()))
    write_table(throats.EXPECTED, throats.EXPECTED_COLUMNS, rows)
    print(f"{throats.EXPECTED.name}: {len(rows)} states")
    return 0


def run_throats() -> int:
    """Run ten throats with their histories, and compare them with the law."""
    rows = [row for one in throats.chosen(histories.read()) for row in runs.run(one)]
    write_table(runs.TABLE, runs.COLUMNS, rows)
    write_table(runs.CONTROLS, runs.CONTROL_COLUMNS, list(runs.controls(histories.read())))
    write_text(PAGE, page.text())
    compared = runs.compared()
    for number, error, holds in zip(compared.number, compared.error, compared.holds):
        for time, errors, inside in zip(throats.TIMES, error, holds):
            print(f"throat {number}, {time:g} h, errors of the law: " + ", ".join(
                f"{name} {100 * value:.2f} %{'' if within else ' (does not hold)'}"
                for name, value, within in zip(throats.QUANTITIES, errors, inside)))
    print(f"{compared.holds.sum()} of {compared.holds.size} values are within the bounds")
    return int(not compared.holds.all())


def time_sweep() -> int:
    """Time a sweep of all throats, and write the record and the page."""
    hours = float(sys.argv[2]) if sys.argv[2:] else throats.TIMES[-1]
    record = timed.write(histories.read(), hours)
    write_text(PAGE, page.text())
    return int(not record["equal"] or any(way["unfinished"] for way in record["ways"]))


def resistance() -> int:
    """Make the law of resistance, and judge it."""
    discs, other_shapes = law.half_discs(), list(law.other_shapes())
    write_table(TABLE, law.TABLE_COLUMNS, law.table_rows(discs, other_shapes))
    print(f"{TABLE.name}: made of {len(discs)} half-discs and {len(other_shapes)} other shapes", flush=True)
    fitted = [law.shape_row(one, 0) for one in discs + other_shapes]
    new = [law.shape_row(one, 1) for one in law.new_shapes()]
    write_table(law.SHAPES, law.COLUMNS, fitted + new)
    verdict = law.judged(law.read(unseen=True))
    write_text(PAGE, page.text())
    print(f"{verdict.inside} of {verdict.count} shapes that the fit has not seen are within the law's bounds")
    return int(verdict.inside < verdict.count)


if __name__ == "__main__":
    sys.exit(main())
