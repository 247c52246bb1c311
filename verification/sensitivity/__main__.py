"""`python -m verification.sensitivity [--only PART] [--sobol N]`: what the inputs allow, with its pictures.

Its parts are base and wide, their elasticities and the one set of inputs; after_contact, how well wide is known after
contact; and supplies, which of the claims about wide hold with other supplies.

Every run is kept in `out/runs.json` as it is computed, and a second call goes on from there. `--sobol N` computes Sobol
indices of base too, N a power of two.
"""

from __future__ import annotations

import argparse
import sys

from repro.results import write_json, write_text
from verification import sensitivity
from verification.sensitivity import after_contact, elasticity, one_set, picture, sobol, supplies
from verification.sensitivity.inputs import ROUNDED
from verification.sensitivity.numbers import Runs, scene

PARTS = ("base", "wide", "after_contact", "supplies")


def main(arguments: list[str] | None = None) -> int:
    """Entry point; returns the exit status."""
    parser = argparse.ArgumentParser(prog="python -m verification.sensitivity", description=__doc__.split("\n")[0])
    parser.add_argument("--sobol", type=int, metavar="N", default=0, help="samples of the indices, a power of two")
    parser.add_argument("--only", choices=PARTS, help="one part alone; the record of the others stays")
    chosen = parser.parse_args(arguments)
    if chosen.sobol < 0 or chosen.sobol & (chosen.sobol - 1):
        print(f"sensitivity: --sobol {chosen.sobol}: a power of two is accepted, or 0 for none", file=sys.stderr)
        return 2
    made = computed(Runs(), chosen.only, chosen.sobol)
    write_json(sensitivity.RECORD, made)
    sensitivity.record.cache_clear()
    picture.write(made)
    write_text(sensitivity.RECORD.with_suffix(".md"), picture.page(made))
    print(f"{sensitivity.RECORD.name}, its page and tornado.svg: written")
    return 0


def computed(runs: Runs, only: str | None, samples: int) -> dict:
    """The record, what is not asked for as it was."""
    known, asked = dict(sensitivity.record()), PARTS if only is None else (only,)
    made = {"rounding": {each.name: each.rounding for each in ROUNDED},
            "values": dict(known.get("values", {})), "elasticities": dict(known.get("elasticities", {}))}
    for name in [part for part in asked if part in ("base", "wide")]:
        made["values"] |= runs.numbers(scene(name, {}))
        made["elasticities"] |= elasticity.elasticities(runs, name)
    made["one_set"] = one_set.found(runs, made["elasticities"]) if "base" in asked else known.get("one_set", {})
    made["after_contact"] = after_contact.known(runs) if "after_contact" in asked else known.get("after_contact", [])
    made["supplies"] = supplies.contacts(runs) if "supplies" in asked else known.get("supplies", {})
    made["sobol"] = sobol.indices(runs, made["elasticities"], samples) if samples else known.get("sobol", {})
    return made


if __name__ == "__main__":
    sys.exit(main())
