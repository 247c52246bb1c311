"""`python -m verification.sensitivity [--only PART] [--sobol N]`: what the inputs allow, with its pictures.

Its parts are base and wide, their elasticities and the one set of inputs; after_contact, how well wide is known after
contact; and supplies, which of the claims about wide hold with other supplies.

Every run is kept in `out/runs.json` as it is computed, and a second call goes on from there. `--sobol N` computes Sobol
indices of base too, N a power of two.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable

from repro.results import write_json, write_text
from verification import sensitivity
from verification.sensitivity import after_contact, elasticity, one_set, picture, sobol, supplies
from verification.sensitivity.inputs import ROUNDED
from verification.sensitivity.numbers import Runs, scene


def main(arguments: list[str] | None = None) -> int:
    """Entry point; returns the exit status."""
    parser = argparse.ArgumentParser(prog="python -m verification.sensitivity", description=__doc__.split("\n")[0])
    parser.add_argument("--sobol", type=int, metavar="N", default=0, help="samples of the indices, a power of two")
    parser.add_argument("--only", choices=tuple(PARTS), help="one part alone; the record of the others stays")
    chosen = parser.parse_args(arguments)
    if chosen.sobol < 0 or chosen.sobol & (chosen.sobol - 1):
        print(f"sensitivity: --sobol {chosen.sobol}: a power of two is accepted, or 0 for none", file=sys.stderr)
        return 2
    made = computed(Runs(), chosen.only, chosen.sobol)
    write_json(sensitivity.RECORD, made)
    sensitivity.record.cache_clear()
    picture.write(made)
    write_text(sensitivity.RECORD.with_suffix(".md"), picture.page(made))
    print(f"{sensitivity.RECORD.name}, its page, tornado.svg and supplies.svg: written")
    return 0


def computed(runs: Runs, only: str | None, samples: int) -> dict:
    """The record, what is not asked for as it is when that is there."""
    asked = PARTS if only is None else (only,)
    new = [PARTS[part](runs) for part in asked]
    sensitivity.record.cache_clear()
    made = {"values": {}, "elasticities": {}, **sensitivity.record()}
    made["rounding"] = {each.name: each.rounding for each in ROUNDED}
    for part in new:
        joined = {key: made[key] | part[key] for key in ("values", "elasticities") if key in part}
        made |= {**part, **joined}
    if samples:
        made["sobol"] = sobol.indices(runs, made["elasticities"], samples)
    return made


def _of_scene(runs: Runs, name: str) -> dict:
    return {"values": runs.numbers(scene(name, {})), "elasticities": elasticity.elasticities(runs, name)}


def _of_base(runs: Runs) -> dict:
    found = _of_scene(runs, "base")
    return {**found, "one_set": one_set.found(runs, found["elasticities"])}


PARTS: dict[str, Callable[[Runs], dict]] = {
    "base": _of_base, "wide": lambda runs: _of_scene(runs, "wide"),
    "after_contact": lambda runs: {"after_contact": after_contact.known(runs)},
    "supplies": lambda runs: {"supplies": supplies.contacts(runs)}}


if __name__ == "__main__":
    sys.exit(main())
