"""Accuracy of the claims' numbers of base, and of wide after contact:
`python -m verification.claims.after_contact`.

For every recorded number about wide after contact with the opposite wall, the module lists half the width of the bar
over the value, the widest bar first. The limits are 1 % for conductivities and tips and 2 % for lengths of contact;
`verification.sensitivity.wide` measures them. Two kinds of numbers are less accurate. The first shape in contact closes
by entire edges of the outline, which limits the accuracy of its conductivity and of the numbers derived from it. Peaks
of stress lie beside the ends of the contact surface, where stresses have no limit, so their ratios vary. The bar of a
tiny change is larger than the change.

A second list has the numbers of base whose bars exceed 0.2 %, the limit that its velocities, effluents, uptake and
concentrations meet. The register of the claims prints both lists, the second with the reason for each kind.

The program runs wide with the preset `exact` and prints its distance from the finest recorded size. It says whether
conductivities and tips are within 0.5 %, distance and bar together, in 60 s of processor time.
"""

import re
import time
from collections.abc import Callable
from dataclasses import dataclass
from math import inf

from verification import sensitivity
from verification.claims import CLAIMS, MODEL, evaluate
from verification.claims.runs import ending
from verification.sensitivity import wide
from verification.sensitivity.rounding import load_varied

#: Names of numbers in claims about wide that concern other scenes or earlier times.
EXCLUDED = re.compile(r"^base|before contact|a film left|^K / K_clean =|^the part filled|^layer|^wide, 30 h|"
                   r"^uniform|^theta\(R\)")
#: Percent above which a bar is listed, after contact and for base.
WIDE_BAR, BASE_BAR = 2.0, 0.2
#: Claims about the model that concern neither wide nor base: half-discs in truncated pores, and variants of wide.
NOT_OF_BASE = ("C19", "C41")
#: Why a bar of base exceeds BASE_BAR, by the kind of number. A kind is the beginning of a claim's id or of a number's
#: name.
KINDS = {
    "a position, which is known to the size of an element": r"C10",
    "a small difference of two halves, runs or solutions, which is not much larger than their errors":
        r"C11|C36|C42|C53|C63|C64|.*(born stress-free|deviation|law's r|changed by the fluid)",
    "a Sherwood number, whose drop of concentration is small against the supply, or a ratio of two, less one":
        r"C39|C47",
    "a peak of stress or strain, beside a corner or in one element, or a ratio of two peaks":
        r".*(stress|strain)",
    "a share of less than 1 %, the small effect of the fluid on a body 2000 times as viscous": r"C35",
    "a body that is bonded to its wall, with stress that is singular at the corners": r"C50|C52",
    "a rim of few elements just before it folds": r"C48|C49",
    "after base's own contact, at which whole edges of the outline join the wall": r"C43"}
#: Limits for conductivities and tips in the preset `exact`: percent, and seconds of processor time.
EXACT, SECONDS = 0.5, 60.0


@dataclass(frozen=True)
class RecordedBar:
    """id: of the claim; quantity: of the check; percent: half the width of its bar over its value."""

    id: str
    quantity: str
    percent: float


def bars_after_contact(entries: list[dict]) -> list[RecordedBar]:
    """The numbers after contact of a record, the one with the widest bar first."""
    evaluate.register_all()
    return _recorded_bars(entries, lambda entry, quantity: (CLAIMS[entry["id"]].of_wide or quantity.startswith("wide"))
                  and not EXCLUDED.search(quantity))


def bars_of_base(entries: list[dict]) -> list[RecordedBar]:
    """The numbers of base in a record, from claims about the model, the one with the widest bar first."""
    evaluate.register_all()
    return _recorded_bars(entries, lambda entry, quantity: entry["about"] == MODEL and (
        quantity.startswith("base") or not (
            CLAIMS[entry["id"]].of_wide or entry["id"] in NOT_OF_BASE or quantity.startswith("wide"))))


def _recorded_bars(entries: list[dict], is_chosen: Callable[[dict, str], bool]) -> list[RecordedBar]:
    bars = [RecordedBar(entry["id"], check["quantity"], percent(check))
             for entry in entries for check in entry["checks"] if is_chosen(entry, check["quantity"])]
    return sorted(bars, key=lambda bar: -bar.percent)


def wide_bars_of_base(entries: list[dict]) -> dict[str, list[RecordedBar]]:
    """Numbers of base whose bars exceed BASE_BAR, by reason; "" if there is none."""
    by_reason: dict[str, list[RecordedBar]] = {}
    for bar in bars_of_base(entries):
        if bar.percent > BASE_BAR:
            reasons = [why for why, names in KINDS.items() if re.match(names, f"{bar.id}, {bar.quantity}")]
            by_reason.setdefault(next(iter(reasons), ""), []).append(bar)
    return by_reason


def percent(check: dict) -> float:
    """Half the width of a recorded bar in percent of the value; infinite if the value is zero or the bar is open."""
    if check["low"] == check["high"]:
        return 0.0
    if None in (check["low"], check["high"]) or check["value"] == 0:
        return inf
    return 50 * (check["high"] - check["low"]) / abs(check["value"])


def run_exact() -> tuple[dict[str, float], float]:
    """The numbers of `verification.sensitivity.wide` with the preset `exact`, and the seconds that it takes."""
    scene = ending(load_varied("wide", {}, 'numerics.preset="exact"'), *wide.HOURS)
    before = time.process_time()
    numbers = wide.of_after(scene)
    return numbers, time.process_time() - before


def distance(row: dict, value: float) -> str:
    """Describe a recorded number on all sizes with its bar, and the distance of a value from that on the finest
    size."""
    deviation = 100 * (value / row["values"][0] - 1)
    sizes = ", ".join(f"{value_on_size:.5g}" for value_on_size in row["values"])
    verdict = "shown" if abs(deviation) + row["bar_percent"] <= EXACT else "not shown"
    suffix = "" if row["asked_percent"] != 1.0 else f"; {EXACT:g} % {verdict}"
    return f"{row['quantity']}: {sizes}, bar {row['bar_percent']:.2g} %; exact {value:.5g}, {deviation:+.2g} %{suffix}"


def main() -> None:
    """Print the distance of `exact`."""
    sizes = ", ".join(f"{size:.3g}" for size in wide.SIZES)
    print(f"wide at {wide.HOURS[0]:g} to {wide.HOURS[-1]:g} h on sizes {sizes}:")
    numbers, seconds = run_exact()
    for row in sensitivity.record()["after_contact"]:
        print("  " + distance(row, numbers[row["quantity"]]))
    print(f"exact took {seconds:.0f} s of processor time; {SECONDS:g} s are accepted")


if __name__ == "__main__":
    main()
