"""Widths of the bars of the recorded numbers: those about wide after contact, and those about base.

For each number about wide after contact with the opposite wall, the first list has half the width of the bar over the
value. The widest bar comes first. The limits are 1 % for conductivities and tips and 2 % for lengths of contact;
`verification.sensitivity.wide` measures them. Two kinds of numbers are less accurate. The first shape in contact closes
by entire edges of the outline, which limits the accuracy of its conductivity and of the numbers derived from it. Peaks
of stress lie beside the ends of the contact surface, where stresses have no limit, so their ratios vary. The bar of a
tiny change is larger than the change.

The second list has the numbers of base whose bars exceed 0.2 %, with a reason for each kind. Velocities, effluents,
uptake and concentrations meet this limit. The register of the claims prints both lists.
"""

import re
from collections.abc import Callable
from dataclasses import dataclass
from math import inf

from verification.claims import CLAIMS, MODEL, evaluate

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
        r"C11|C26, forces included|C36|C42|C44|C53|C63|C64|.*(born stress-free|deviation|law's r|changed by the fluid)",
    "a Sherwood number, whose drop of concentration is small against the supply, or a ratio of two, less one":
        r"C39|C47",
    "a peak of stress or strain, beside a corner or in one element, or a ratio of two peaks":
        r"C40|.*(stress|strain)",
    "a share of less than 1 %, the small effect of the fluid on a body 2000 times as viscous": r"C35",
    "a body that is bonded to its wall, with stress that is singular at the corners": r"C50|C52",
    "a rim of few elements just before it folds": r"C48|C49",
    "after base's own contact, at which whole edges of the outline join the wall": r"C43|C54"}


@dataclass(frozen=True)
class RecordedBar:
    """The bar of a number in a record.

    id: of the claim; quantity: of the check; percent: half the width of the bar over the value.
    """

    id: str
    quantity: str
    percent: float


def bars_after_contact(entries: list[dict]) -> list[RecordedBar]:
    """The bars of the numbers after contact, the widest first."""
    evaluate.register_all()
    return _recorded_bars(entries, lambda entry, quantity: (CLAIMS[entry["id"]].of_wide or quantity.startswith("wide"))
                  and not EXCLUDED.search(quantity))


def bars_of_base(entries: list[dict]) -> list[RecordedBar]:
    """The bars of the numbers of base in claims about the model, the widest first."""
    evaluate.register_all()
    return _recorded_bars(entries, lambda entry, quantity: entry["about"] == MODEL and (
        quantity.startswith("base") or not (
            CLAIMS[entry["id"]].of_wide or entry["id"] in NOT_OF_BASE or quantity.startswith("wide"))))


def _recorded_bars(entries: list[dict], is_chosen: Callable[[dict, str], bool]) -> list[RecordedBar]:
    bars = [RecordedBar(entry["id"], check["quantity"], percent(check))
             for entry in entries for check in entry["checks"] if is_chosen(entry, check["quantity"])]
    return sorted(bars, key=lambda bar: -bar.percent)


def wide_bars_of_base(entries: list[dict]) -> dict[str, list[RecordedBar]]:
    """The bars of base that exceed BASE_BAR, by reason; the reason is "" for kinds that KINDS lacks."""
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
