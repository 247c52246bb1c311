"""What the inputs of Table 1 allow: `make sensitivity`, or `python -m verification.sensitivity`.

Table 1 prints rounded numbers: an input may be anywhere within half a unit of its last digit. The record
`sensitivity.json` holds the elasticities of every number that the paper prints of base, and of contact and conductivity
of wide, with respect to each input, by central differences of the converged solution; and the set of inputs within the
rounding that comes nearest to all printed numbers of base at once. The claims read it from here.
"""

from __future__ import annotations

from functools import cache
from pathlib import Path

from verification.kernel.writing import load

RECORD = Path(__file__).parent / "sensitivity.json"


@cache
def record() -> dict:
    """The committed record; empty where there is none."""
    return load(RECORD, {})


def interval(quantity: str, value: float) -> tuple[float, float] | None:
    """Where a value goes as the rounded inputs move within their rounding, all at once, to first order; None where the
    record does not tell."""
    known = record().get("elasticities", {}).get(quantity)
    if known is None:
        return None
    rounding = record()["rounding"]
    reach = abs(value) * sum(abs(known[name]["elasticity"]) * half for name, half in rounding.items())
    return value - reach, value + reach


def verified_set() -> str:
    """The set of inputs that gives all printed numbers of base at once, in words; empty where none was found."""
    found = record().get("one_set", {})
    if not found.get("reached"):
        return ""
    inputs = ", ".join(f"{name} {value:.4g}" for name, value in found["inputs"].items())
    numbers = ", ".join(f"{name.replace('_', ' ')} {value:.4g}" for name, value in found["numbers"].items())
    return f"with {inputs} a run gives {numbers}"
