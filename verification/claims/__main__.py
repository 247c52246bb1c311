"""`python -m verification.claims [--record] [C07 C09 ...]`: judge the paper's claims, all of them by default.

They are compared with the committed `claims.json`: where every number lies in its recorded interval and every verdict
is the same, that file stays as it is. `--record` writes it anew, or of it the claims that are named.
The exit status is 0 when every claim has a verdict, whatever it is, and agrees with the record; 1 when not; 2 for an
unknown claim.
"""

from __future__ import annotations

import argparse
import sys

from repro.results import write_json
from verification.claims import CLAIMS, EXPECTED, ClaimError, base_run, evaluate, report
from verification.claims.evaluate import Found, barred
from verification.claims.levels import Level
from verification.claims.report import Row

NO_VERDICT = "no verdict"


def main(arguments: list[str] | None = None) -> int:
    """Entry point; returns the exit status."""
    evaluate.register_all()
    parser = argparse.ArgumentParser(prog="python -m verification.claims", description="Judge the paper's claims.")
    parser.add_argument("--record", action="store_true", help="write the committed claims.json anew")
    parser.add_argument("ids", nargs="*", metavar="ID", help="claims to judge, such as C07; all of them by default")
    chosen = parser.parse_args(arguments)
    unknown = sorted(set(chosen.ids) - set(EXPECTED))
    if unknown:
        known = f"{EXPECTED[0]} to {EXPECTED[-1]} are accepted"
        print(f"claims: there is no {', '.join(unknown)}; {known}", file=sys.stderr)
        return 2
    rows = judged(tuple(chosen.ids) or EXPECTED)
    print("\n".join([report.LEGEND, *map(report.terminal, rows)]))
    settled = all(row.verdict != NO_VERDICT for row in rows)
    if not chosen.ids:
        checks = base_run.independence()
        print(report.terminal_independence(checks))
        settled = settled and all(check.holds for check in checks)
    print(report.summary(rows))
    return 0 if recorded(rows, chosen.record) and settled else 1


def recorded(rows: list[Row], anew: bool) -> bool:
    """Do the rows agree with the committed record? Differences are told."""
    ours = [report.entry(row) for row in rows if row.verdict != NO_VERDICT]
    if anew:
        write_json(report.COMMITTED, report.replaced(ours))
        print(f"{report.COMMITTED.name}: written")
        return True
    told = report.differences(ours, report.read())
    print("\n".join(told) if told else f"{len(ours)} claims as recorded in {report.COMMITTED.name}, which stays")
    return not told


def judged(ids: tuple[str, ...]) -> list[Row]:
    """The rows of claims, whatever goes wrong is in them."""
    found = evaluate.everywhere(id for id in ids if id in CLAIMS)
    return [_row(id, found.get(id, {})) for id in ids]


def _row(id: str, found: dict[Level, Found]) -> Row:
    if id not in CLAIMS:
        return Row(id, None, None, NO_VERDICT, "no module computes it")
    claim, finding = CLAIMS[id], None
    try:
        if errors := [each for each in found.values() if isinstance(each, str)]:
            raise ClaimError("; ".join(errors))
        finding = found[claim.judged][1]
        finding = barred(claim, finding, {level: each[0] for level, each in found.items()})
        return Row(id, claim, finding, finding.verdict)
    except ClaimError as error:
        return Row(id, claim, finding, NO_VERDICT, str(error))


if __name__ == "__main__":
    sys.exit(main())
