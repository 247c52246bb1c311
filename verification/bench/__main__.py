"""``python -m verification.bench [--quick] [PART ...]``: measure, record, draw and judge; all parts by default.

--quick runs small versions and writes nothing.
"""

import argparse
from importlib import import_module

from verification.bench import record, report
from verification.evidence.writing import save

#: Modules of the parts, imported when a part runs.
PARTS = {"box": "users", "channel": "users", "base": "runs", "command": "commands", "size": "runs", "scenes": "runs",
         "memory": "runs", "wide": "after_contact"}


def main(arguments: list[str] | None = None) -> dict:
    """Run the parts and return the record."""
    parser = argparse.ArgumentParser(prog="python -m verification.bench", description=__doc__.split("\n\n")[0])
    parser.add_argument("parts", nargs="*", metavar="PART", choices=[*PARTS, []], default=[],
                        help=f"of {', '.join(PARTS)}; all by default")
    parser.add_argument("--quick", action="store_true", help="small versions, nothing is written")
    options = parser.parse_args(arguments)
    return measure(options.parts or PARTS, options.quick)


def measure(names, quick: bool) -> dict:
    """Run parts one after the other and save the record after each."""
    benchmark = {"machine": record.machine(), "parts": {} if quick else record.load()["parts"]}
    print(report.machine(benchmark["machine"]))
    for name in names:
        part = getattr(import_module(f"verification.bench.{PARTS[name]}"), f"{name}_part")(quick)
        benchmark["parts"][name] = part
        benchmark["verdicts"] = report.judged(benchmark)
        print(*report.blocks(name, part), sep="\n\n", flush=True)
        if not quick:
            save(benchmark, record.FILE)
    if not quick:
        report.draw(benchmark["parts"], record.FOLDER)
    print(report.verdicts(benchmark["verdicts"]))
    return benchmark


if __name__ == "__main__":
    main()
