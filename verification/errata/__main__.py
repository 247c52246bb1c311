"""Rewrite ``reference/ERRATA.md``: `python -m verification.errata`, or print some entries: `... E5 E11`."""

import sys
from pathlib import Path

import numpy as np

import verification.errata as package
from repro.results import write_text
from verification.claims.evaluate import import_all
from verification.errata import ERRATA, filled
from verification.store import map_in_parallel

REPORT = Path(__file__).parents[2] / "reference" / "ERRATA.md"

INTRODUCTION = """\
# Errata: the paper's ambiguities and misprints, and their consequences

Dupin, Kitanidis & McCarty (2001), paper 2001WR000306; numbers in brackets are its equations. Each entry gives the
printed text, our reading with its reason, and the measured consequence. `python -m verification.errata` computes every
number of a consequence, and writes this file.

"base" is the run of section 4, "wide" that of Figure 6, both with the default settings. Deviations are from these runs.
"At 19.2 h" means in the geometry of that time (E12). Concentrations are in K_s = 1 mg/L. The mesh error of base is
about half a percent (E13). A smaller difference between two runs may be an effect of the mesh."""


def load() -> list[str]:
    """Import every module of this package, which registers its errata; their ids in order."""
    import_all(package)
    return sorted(ERRATA, key=lambda id: int(id[1:]))


def entry(id: str) -> str:
    """One entry; floating-point errors raise."""
    load()
    with np.errstate(all="raise", under="ignore"):
        return ERRATA[id].markdown()


def main(arguments: list[str]) -> int:
    """Entry point; returns the exit status."""
    ids = load()
    unknown = [id for id in arguments if id not in ids]
    if unknown:
        print(f"errata: there is no {', '.join(unknown)}; {', '.join(ids)} are accepted", file=sys.stderr)
        return 2
    text = "\n".join(map_in_parallel(entry, arguments or ids))
    if arguments:
        print(text)
    else:
        write_text(REPORT, filled(INTRODUCTION) + "\n" + text)
        print(f"{len(ids)} entries written to {REPORT.parent.name}/{REPORT.name}")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
