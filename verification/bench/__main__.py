"""``python -m verification.bench [--quick] [PART ...]``: measure, record, draw and judge; all parts by default.

--quick runs small versions and writes nothing.
"""

from __future__ import annotations

import argparse
from importlib import import_module

from verification.bench import record, told
from verification.evidence.writing import plain, save

#: Modules of the parts; that of other codes is imported for its own alone.
PARTS = {"box": "users", "channel": "users", "base": "runs", "size": "runs", "scenes": "runs", "memory": "runs"}


def main(arguments: list[str] | None = None) -> dict:
    """Run the parts; the record as it is then."""
    parser = argparse.ArgumentParser(prog="python -m verification.bench", description=__doc__.split("\n\n")[0])
    parser.add_argument("parts", nargs="*", metavar="PART", choices=[*PARTS, []], default=[],
                        help=f"of {', '.join(PARTS)}; all by default")
    parser.add_argument("--quick", action="store_true", help="small versions, nothing is written")
    given = parser.parse_args(arguments)
    return measure(given.parts or PARTS, given.quick)


def measure(names, quick: bool) -> dict:
    """Run parts one after the other; each is recorded as soon as it is there."""
    found = {"machine": record.machine(), "parts": {} if quick else record.load()["parts"]}
    print(plain([told.machine(found["machine"])]))
    for name in names:
        part = getattr(import_module(f"verification.bench.{PARTS[name]}"), f"{name}_part")(quick)
        found["parts"][name] = part
        found["verdicts"] = told.judged(found)
        print(plain(told.blocks(name, part)), flush=True)
        if not quick:
            save(found, record.FILE)
    if not quick:
        told.draw(found["parts"], record.FOLDER)
    print(plain([told.verdicts(found["verdicts"])]))
    return found


if __name__ == "__main__":
    main()
