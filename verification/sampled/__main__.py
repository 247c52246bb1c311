"""Mutants made by machine: ``python -m verification.sampled``, see :mod:`verification.sampled`."""

from __future__ import annotations

import argparse
import importlib.util
import sys

from verification.sampled import drawing, hunting, reach


def main(arguments: list[str] | None = None) -> int:
    """Entry point; 0 if as many mutants are caught as are to be, of those not shown equivalent."""
    about = "Mutants made by machine, a sample of them from all of repro/, against the tests that reach them."
    parser = argparse.ArgumentParser(prog="python -m verification.sampled", description=about)
    parser.add_argument("--whole", action="store_true",
                        help=f"survivors against all tests that reach them too, for {hunting.HOURS:g} h at most")
    parser.add_argument("--jobs", type=int, default=1, help="processes; one by default")
    chosen = parser.parse_args(arguments)
    if not importlib.util.find_spec("cosmic_ray"):
        parser.error("cosmic-ray is needed, which `make mutants-sampled` installs from "
                     "verification/sampled/requirements.lock")
    sample = drawing.sample()
    known = reach.measured()
    hunting.hunt(sample, known, chosen.jobs)
    if chosen.whole:
        hunting.hunt(sample, known, chosen.jobs, whole=True)
    hunting.confirm(hunting.rows_of(sample))
    return hunting.record(hunting.rows_of(sample), len(sample))


if __name__ == "__main__":
    sys.exit(main())
