"""Measure all choices, print the table, write ``verification/report/audit.json``."""

from __future__ import annotations

import sys
from pathlib import Path

from verification.audit import choices, measure
from verification.audit.choices import CHOICES, Choice
from verification.bench.record import machine, save

RECORD = Path(__file__).parents[1] / "report" / "audit.json"
METHOD = (f"base, preset paper, to {measure.END:g} h in steps of {60 * measure.STEP:g} min (steps in time: 12 min); "
          "effect: difference of two whole runs, relative, effluents over the supply, flow and substrates of both last "
          "shapes on the default's mesh (extent: each on its own); one_state: both choices in the default's last "
          "state, with the shape of one step more; resolved: changes by more than twice what meshes of the same "
          f"fineness do; cost_ratio: processor time, median of {measure.REPEATS} runs in turn (mesh, theta after a "
          "remesh, symmetry: one run each)")


def main() -> int:
    """Entry point."""
    noise = choices.meshes()
    rows = [noise, *map(named, CHOICES), choices.midpoint(), choices.drift(), *choices.symmetry()]
    rows = [{**row, "resolved": resolved(row["effect"], noise[row.pop("noise", "effect")])} for row in rows]
    save({"machine": machine(), "method": METHOD, "rows": rows}, RECORD)
    print("\n".join(table(rows)))
    return 0


def named(choice: Choice) -> dict:
    """The row of a choice that a scene can name."""
    said, other = measure.scene(), measure.scene(*choice.changes)
    default, found, ratio = measure.in_turn((lambda: measure.run(said), lambda: measure.run(other)))
    compare = measure.whole_run if choice.meshes else measure.two_meshes
    effects = compare(other, default, found)
    state = measure.one_state(said, other, default) if choice.state else {}
    print(f"{choice.choice}: {choice.alternative}", file=sys.stderr, flush=True)
    row = choices.row(choice.choice, choice.default, choice.alternative, ratio, effects, choice.note)
    return {**row, "one_state": state, "noise": "effect" if choice.meshes else "two_meshes"}


def resolved(effects: dict[str, float], noise: dict[str, float]) -> list[str]:
    """Names of the quantities that change by more than twice what meshes of the same fineness make of them."""
    return [name for name, value in effects.items() if abs(value) > 2 * abs(noise[name])]


def table(rows: list[dict]) -> list[str]:
    """Lines: a choice each, its cost, its largest effects over the runs and in one state, and that on the velocity."""
    lines = [f"{'choice':<26} {'default':<22} {'alternative':<26} {'cost':>5}  {'velocity':>9} {'area':>9}  "
             f"{'largest':<28} {'in one state':<28}"]
    for row in rows:
        lines.append(f"{row['choice']:<26} {row['default']:<22} {row['alternative']:<26} {row['cost_ratio']:5.2f}  "
                     f"{row['effect']['velocity']:+9.1e} {row['effect']['area']:+9.1e}  {_told(row['effect']):<28} "
                     f"{_told(row['one_state']):<28}".rstrip())
    return lines


def _told(effects: dict[str, float]) -> str:
    name = measure.largest(effects)
    return f"{effects[name]:+.1e} {name}" if name else "-"


if __name__ == "__main__":
    sys.exit(main())
