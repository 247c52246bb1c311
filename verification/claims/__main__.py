"""`python -m verification.claims [C07 C09 ...]`: judge the paper's claims, all of them by default.

All of them are also written to `verification/claims/out/`, with the mesh and time-step independence of base. The exit
status is 0 when every claim has a verdict, whatever it is, and base is independent; 1 when not; 2 for an unknown claim.
"""

from __future__ import annotations

import argparse
import sys
import traceback
from pathlib import Path

import numpy as np

from repro.results import write_json, write_text
from verification.claims import CLAIMS, EXPECTED, ClaimError, evaluate, independence, report, runs, written
from verification.claims.bars import Numbers, barred
from verification.claims.levels import Level
from verification.claims.report import Independence, Row

OUT = Path(__file__).parent / "out"
NO_VERDICT = "no verdict"


def main(arguments: list[str] | None = None) -> int:
    """Entry point; returns the exit status."""
    evaluate.register_all()
    parser = argparse.ArgumentParser(prog="python -m verification.claims", description="Judge the paper's claims.")
    parser.add_argument("ids", nargs="*", metavar="ID", help="claims to judge, such as C07; all of them by default")
    chosen = parser.parse_args(arguments).ids
    unknown = sorted(set(chosen) - set(EXPECTED))
    if unknown:
        known = f"{EXPECTED[0]} to {EXPECTED[-1]} are accepted"
        print(f"claims: there is no {', '.join(unknown)}; {known}", file=sys.stderr)
        return 2
    return judge(tuple(chosen) or EXPECTED, whole=not chosen)


def judge(ids: tuple[str, ...], whole: bool) -> int:
    """Judge claims and print them; with ``whole`` the independence of base too, and write the report."""
    np.seterr(all="raise", under="ignore")
    others = prepare([id for id in ids if id in CLAIMS], whole)
    rows = []
    print(report.legend())
    for id in ids:
        rows.append(judged(id, others.get(id, {})))
        print(report.terminal(rows[-1]), flush=True)
    section = independent() if whole else None
    if section:
        print(report.terminal_independence(section))
    print(report.summary(rows))
    if whole:
        OUT.mkdir(exist_ok=True)
        write_text(OUT / "claims.md", written.markdown(rows, section))
        write_json(OUT / "claims.json", written.as_json(rows, section))
        print(f"written: {OUT / 'claims.md'} and claims.json")
    return status(rows, section, whole)


def status(rows: list[Row], section: Independence | None, whole: bool) -> int:
    """0 when every row has a verdict and, with ``whole``, base is independent of mesh and time step."""
    settled = all(row.verdict != NO_VERDICT for row in rows)
    independent_ = not whole or (section is not None and all(check.holds for check in section.checks))
    return 0 if settled and independent_ else 1


def prepare(ids: list[str], whole: bool) -> dict[str, dict[Level, Numbers | str]]:
    """Compute the runs that the claims ask for, then the claims' numbers at all levels but the default."""
    wanted = evaluate.scenes(ids) + [runs.scene(*run) for run in (independence.RUNS if whole else ())]
    told(f"{len(set(map(runs.target, wanted)))} runs are computed, or taken from {runs.CACHE.name}/")
    try:
        evaluate.compute(wanted)
    except Exception as error:
        told(f"a run failed, what needs it will say so: {type(error).__name__}: {error}")
    told("the claims' numbers are computed with other meshes and time steps")
    return evaluate.elsewhere(ids)


def told(text: str) -> None:
    """Say how far it is."""
    print(f"claims: {text}", file=sys.stderr, flush=True)


def judged(id: str, others: dict[Level, Numbers | str]) -> Row:
    """The row of one claim; whatever goes wrong is in it, and on the screen."""
    if id not in CLAIMS:
        return Row(id, None, None, NO_VERDICT, "no module computes it")
    claim, finding = CLAIMS[id], None
    try:
        finding = claim.function().told()
        if errors := [found for found in others.values() if isinstance(found, str)]:
            raise ClaimError("; ".join(errors))
        finding = barred(claim, finding, others)
        return Row(id, claim, finding, finding.verdict, others=others)
    except Exception as error:
        traceback.print_exc()
        return Row(id, claim, finding, NO_VERDICT, f"{type(error).__name__}: {error}")


def independent() -> Independence | None:
    """The independence of base; None, and told why, where it cannot be computed."""
    try:
        return Independence(independence.comparisons(), independence.checks())
    except Exception:
        traceback.print_exc()
        return None


if __name__ == "__main__":
    sys.exit(main())
