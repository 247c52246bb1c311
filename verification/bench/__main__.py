"""``python -m verification.bench [PART ...]``: measure, record, draw and judge; all parts by default."""

import argparse
from collections.abc import Iterable
from importlib import import_module

from verification.bench import record, report
from verification.evidence.results import machine
from verification.evidence.writing import save

#: Modules of the parts, imported when a part runs.
PARTS = {"box": "users", "channel": "users", "base": "runs", "command": "commands", "size": "runs", "scenes": "runs",
         "memory": "runs", "wide": "after_contact"}


def main(arguments: list[str] | None = None) -> None:
    """Measure, record, draw and judge the named parts."""
    parser = argparse.ArgumentParser(prog="python -m verification.bench", description=__doc__)
    parser.add_argument("parts", nargs="*", metavar="PART", choices=[*PARTS, []], default=[],
                        help=f"of {', '.join(PARTS)}; all by default")
    measure(parser.parse_args(arguments).parts or PARTS)


def measure(names: Iterable[str]) -> None:
    """Run parts one after the other and save the record after each."""
    benchmark = {"machine": machine(), "parts": record.load()["parts"]}
    print(report.machine(benchmark["machine"]))
    for name in names:
        module = import_module(f"verification.bench.{PARTS[name]}")
        part = getattr(module, f"{name}_part")()
        benchmark["parts"][name] = part
        benchmark["verdicts"] = report.judged(benchmark)
        print(*report.blocks(name, part), sep="\n\n", flush=True)
        save(benchmark, record.FILE)
    report.draw(benchmark["parts"])
    print(report.verdicts(benchmark["verdicts"]))


if __name__ == "__main__":
    main()
