"""How well the claims' numbers after contact are known: `python -m verification.claims.after_contact`.

Lists every number of the committed record about wide after its contact with the opposite wall, with half the width of
its bar over its value, the widest first. Asked are 1 % of conductivities and tips and 2 % of lengths of contact, which
`verification.sensitivity.wide` measures. Ratios of peaks are known less well: a peak sits beside the ends of
the contact surface, where stresses have no limit. A change of nearly nothing has a bar larger than itself.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from math import inf

from verification.claims import record

#: The claims about wide, and what their numbers about other things or earlier instants are called.
OF_WIDE = ("C12", "C16", "C25", "C26", "C29", "C30", "C31", "C32", "C35", "C38", "C40", "C44", "C45", "C46")
OTHER = re.compile(r"^base|before contact|a film left|^K / K_clean =|^the part filled|^layer|^wide, 30 h|"
                   r"in the 5 h before$|^uniform|^theta\(R\)")
#: Percent above which a bar is told.
WIDE_BAR = 2.0


@dataclass(frozen=True)
class Known:
    """id: of the claim; quantity: of the check; percent: half the width of its bar over its value."""

    id: str
    quantity: str
    percent: float


def known(entries: list[dict]) -> list[Known]:
    """The numbers after contact of a record, the one with the widest bar first."""
    found = [Known(entry["id"], check["quantity"], percent(check)) for entry in entries if entry["id"] in OF_WIDE
             for check in entry["checks"] if not OTHER.search(check["quantity"])]
    return sorted(found, key=lambda each: -each.percent)


def percent(check: dict) -> float:
    """Half the width of a recorded bar in percent of the value; infinite where that is zero or the bar open."""
    if check["low"] == check["high"]:
        return 0.0
    if None in (check["low"], check["high"]) or check["value"] == 0:
        return inf
    return 50 * (check["high"] - check["low"]) / abs(check["value"])


def main() -> None:
    """Print the list."""
    found = known(record.read())
    for each in found:
        print(f"{each.percent:8.2g} %  {each.id}  {each.quantity}")
    over = sum(each.percent > WIDE_BAR for each in found)
    print(f"{over} of {len(found)} bars exceed {WIDE_BAR:g} %")


if __name__ == "__main__":
    main()
