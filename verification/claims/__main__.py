"""`python -m verification.claims [--record | --again] [C07 C09 ...]`: judge the paper's claims, all by default.

The program compares the claims with the committed `claims.json`: every number must lie in its recorded interval, and
every verdict must be the same. `--record` rewrites the file, or the named claims in it. `--again` judges the recorded
numbers by the present meanings of the words, without a run, and rewrites the file. The exit status is 0 if
every claim has a verdict and agrees with the record, 1 if not, and 2 for an unknown claim.
"""

import argparse
import sys
from datetime import UTC, datetime

from repro.results import write_json
from verification.claims import CLAIMS, EXPECTED, ClaimError, base_run, evaluate, report
from verification.claims.evaluate import Outcome, with_bars
from verification.claims.levels import Level
from verification.claims.report import Row

NO_VERDICT = "no verdict"


def main(arguments: list[str] | None = None) -> int:
    """Entry point; returns the exit status."""
    evaluate.register_all()
    parser = argparse.ArgumentParser(prog="python -m verification.claims", description="Judge the paper's claims.")
    parser.add_argument("--record", action="store_true", help="rewrite the committed claims.json")
    parser.add_argument("--again", action="store_true", help="judge the recorded numbers by the present meanings")
    parser.add_argument("ids", nargs="*", metavar="ID", help="claims to judge, such as C07; all of them by default")
    chosen = parser.parse_args(arguments)
    unknown = sorted(set(chosen.ids) - set(EXPECTED))
    if unknown:
        accepted = f"{EXPECTED[0]} to {EXPECTED[-1]} are accepted"
        print(f"claims: there is no {', '.join(unknown)}; {accepted}", file=sys.stderr)
        return 2
    if chosen.again:
        record([report.judged_again(entry, CLAIMS[entry["id"]]) for entry in report.read()
                if entry["id"] in (chosen.ids or EXPECTED)])
        return 0
    rows = judge(tuple(chosen.ids) or EXPECTED)
    print("\n".join([report.LEGEND, *map(report.terminal, rows)]))
    is_judged = all(row.verdict != NO_VERDICT for row in rows)
    if not chosen.ids:
        checks = base_run.independence()
        print(report.terminal_independence(checks))
        is_judged = is_judged and all(check.holds for check in checks)
    print(report.summary(rows))
    return 0 if agree_with_record(rows, chosen.record) and is_judged else 1


def agree_with_record(rows: list[Row], rewrite: bool) -> bool:
    """Whether the rows agree with the committed record; prints the differences."""
    entries = [report.entry(row) for row in rows if row.verdict != NO_VERDICT]
    if rewrite:
        record(entries)
        return True
    differences = report.differences(entries, report.read())
    unchanged = f"{len(entries)} claims as recorded in {report.COMMITTED.name}, which stays"
    print("\n".join(differences) or unchanged)
    return not differences


def record(entries: list[dict]) -> None:
    """Rewrite some entries of the record, with the time of their first values and all former verdicts."""
    recorded_entries = {entry["id"]: entry for entry in report.read()}
    now = f"{datetime.now(UTC):%Y-%m-%d %H:%M}"
    entries = [report.stamped(entry, recorded_entries.get(entry["id"]), now) for entry in entries]
    write_json(report.COMMITTED, report.replaced(entries))
    print(f"{report.COMMITTED.name}: written")


def judge(ids: tuple[str, ...]) -> list[Row]:
    """The rows of claims; an error becomes part of its row."""
    outcomes = evaluate.everywhere(id for id in ids if id in CLAIMS)
    return [_row(id, outcomes.get(id, {})) for id in ids]


def _row(id: str, outcomes: dict[Level, Outcome]) -> Row:
    if id not in CLAIMS:
        return Row(id, None, None, NO_VERDICT, "no module computes it")
    claim, finding = CLAIMS[id], None
    try:
        if errors := [outcome for outcome in outcomes.values() if isinstance(outcome, str)]:
            raise ClaimError("; ".join(errors))
        finding = outcomes[claim.judged][1]
        finding = with_bars(claim, finding, {level: outcome[0] for level, outcome in outcomes.items()})
        return Row(id, claim, finding, claim.verdict(finding))
    except ClaimError as error:
        return Row(id, claim, finding, NO_VERDICT, str(error))


if __name__ == "__main__":
    sys.exit(main())
