"""`python -m verification.claims [C07 C09 ...]`: judge the paper's claims, all of them by default.

All of them are also written to `verification/claims/out/`, with the mesh and time-step independence of base. The exit
status is 0 when every claim has a verdict, whatever it is, and base is independent; 1 when not; 2 for an unknown claim.
"""

from __future__ import annotations

import argparse
import importlib
import pkgutil
import sys
import traceback
from pathlib import Path

import numpy as np

import verification.claims as package
from repro.results import write_json, write_text
from verification.claims import CLAIMS, EXPECTED, independence, report, runs
from verification.claims.report import Independence, Row

OUT = Path(__file__).parent / "out"
NO_VERDICT = "no verdict"


def main(arguments: list[str] | None = None) -> int:
    """Entry point; returns the exit status."""
    register_all()
    parser = argparse.ArgumentParser(prog="python -m verification.claims", description="Judge the paper's claims.")
    parser.add_argument("ids", nargs="*", metavar="ID", help="claims to judge, such as C07; all of them by default")
    chosen = parser.parse_args(arguments).ids
    unknown = sorted(set(chosen) - set(EXPECTED))
    if unknown:
        known = f"{EXPECTED[0]} to {EXPECTED[-1]} are accepted"
        print(f"claims: there is no {', '.join(unknown)}; {known}", file=sys.stderr)
        return 2
    return judge(tuple(chosen) or EXPECTED, whole=not chosen)


def register_all() -> None:
    """Import every module of this package: each registers its claims."""
    for module in pkgutil.iter_modules(package.__path__):
        if module.name != "__main__":
            importlib.import_module(f"{package.__name__}.{module.name}")


def judge(ids: tuple[str, ...], whole: bool) -> int:
    """Judge claims and print them; with ``whole`` the independence of base too, and write the report."""
    np.seterr(all="raise", under="ignore")
    prepare(ids, whole)
    rows = []
    for id in ids:
        rows.append(judged(id))
        print(report.terminal(rows[-1]), flush=True)
    section = independent() if whole else None
    if section:
        print(report.terminal_independence(section))
    print(report.summary(rows))
    if whole:
        OUT.mkdir(exist_ok=True)
        write_text(OUT / "claims.md", report.markdown(rows, section))
        write_json(OUT / "claims.json", report.as_json(rows, section))
        print(f"written: {OUT / 'claims.md'} and claims.json")
    return status(rows, section, whole)


def status(rows: list[Row], section: Independence | None, whole: bool) -> int:
    """0 when every row has a verdict and, with ``whole``, base is independent of mesh and time step."""
    settled = all(row.verdict != NO_VERDICT for row in rows)
    independent_ = not whole or (section is not None and all(check.holds for check in section.checks))
    return 0 if settled and independent_ else 1


def prepare(ids: tuple[str, ...], whole: bool) -> None:
    """Compute the runs that the claims ask for, side by side, the longest first."""
    wanted = [run for id in ids if id in CLAIMS for run in CLAIMS[id].scenes] + list(independence.RUNS if whole else ())
    distinct = sorted(dict.fromkeys(wanted), key=lambda run: (run[0] != "wide", run != independence.STRICT))
    print(f"claims: {len(distinct)} runs are computed, or taken from {runs.CACHE.name}/", file=sys.stderr, flush=True)
    try:
        runs.compute(distinct)
    except Exception as error:
        print(f"claims: a run failed, what needs it will say so: {type(error).__name__}: {error}", file=sys.stderr)


def judged(id: str) -> Row:
    """The row of one claim; whatever goes wrong is in it, and on the screen."""
    if id not in CLAIMS:
        return Row(id, None, None, NO_VERDICT, "no module computes it")
    claim, finding = CLAIMS[id], None
    try:
        finding = claim.function()
        return Row(id, claim, finding, finding.verdict)
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
