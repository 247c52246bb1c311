"""Mutants made by machine: ``python -m verification.sampled``, see :mod:`verification.sampled`."""

from __future__ import annotations

import argparse
import importlib.util
import sys
import time

from verification.sampled import drawing, hunting, trying

#: Hours that the second round may take, at a release.
HOURS = 4.0


def main(arguments: list[str] | None = None) -> int:
    """Entry point; 0 if as many mutants are caught as are to be, of those not shown equivalent."""
    chosen = _parser().parse_args(arguments)
    if not importlib.util.find_spec("cosmic_ray"):
        print("sampled: cosmic-ray is needed, which `make mutants-sampled` installs from "
              "verification/sampled/requirements.lock", file=sys.stderr)
        return 2
    began = time.time()
    sample = drawing.sample(drawing.sources())
    known = trying.measured()
    hunting.hunt(hunting.due(sample, hunting.kept(), known, False), known, chosen.jobs, False, began + 3600 * HOURS)
    if chosen.whole:
        left = hunting.due(sample, hunting.kept(), known, True)
        hunting.hunt(left, known, chosen.jobs, True, time.time() + 3600 * HOURS)
    hunting.confirm(_of(sample))
    return hunting.record(_of(sample), len(sample))


def _of(sample: list[drawing.Mutant]) -> list[hunting.Row]:
    rows = hunting.kept()
    return [rows[mutant.name] for mutant in sample if mutant.name in rows]


def _parser() -> argparse.ArgumentParser:
    about = "Mutants made by machine, a sample of them from all of repro/, against the tests that reach them."
    parser = argparse.ArgumentParser(prog="python -m verification.sampled", description=about)
    parser.add_argument("--whole", action="store_true",
                        help=f"survivors against all tests that reach them too, for {HOURS:g} h at most")
    parser.add_argument("--jobs", type=int, default=1, help="processes; one by default")
    return parser


if __name__ == "__main__":
    sys.exit(main())
