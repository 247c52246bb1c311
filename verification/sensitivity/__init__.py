"""What the inputs of Table 1 allow: `make sensitivity`, or `python -m verification.sensitivity`.

Table 1 prints rounded numbers: an input may be anywhere within half a unit of its last digit. The record
`sensitivity.json` holds the elasticities of every number that the paper prints of base, and of contact and conductivity
of wide, with respect to each input, by central differences of the converged solution; and the set of inputs within the
rounding that comes nearest to all printed numbers of base at once. The claims read it from here.

Runs are made in this process and not by `repro sweep`: a number needs a state that no row of a run holds (grown and not
yet expanded [E12]) or another run from contact on, and elasticities and the set choose the next run by the last. They
write no fields, no rows and no folders: what stays of a run are its numbers, 0.4 kB in `out/runs.jsonl`, of which the
whole study makes 2 MB. A run is not made again while it stands there under its scene and the source that made it.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from itertools import product
from pathlib import Path

from verification.evidence.writing import load

RECORD = Path(__file__).parent / "sensitivity.json"


@cache
def record() -> dict:
    """The committed record; empty where there is none."""
    return load(RECORD, {})


def interval(quantity: str, value: float) -> tuple[float, float] | None:
    """Where a value goes as the rounded inputs move within their rounding, all at once, to first order; None where the
    record does not tell."""
    part = reach(quantity)
    return None if part is None else (value - abs(value) * part, value + abs(value) * part)


def reach(quantity: str) -> float | None:
    """How far a number goes so, over it."""
    known = record().get("elasticities", {}).get(quantity)
    if known is None:
        return None
    return sum(abs(known[name]["elasticity"]) * half for name, half in record()["rounding"].items())


def in_closed_form(form: Callable[..., float], *inputs: tuple[float, float]) -> tuple[float, float]:
    """Least and largest value of a form that is monotone in each input, as these move within their rounding: over the
    corners. inputs: (value, half a unit of its last digit) of each."""
    ends = [(value - half, value + half) for value, half in inputs]
    values = [form(*corner) for corner in product(*ends)]
    return min(values), max(values)


def verified_set() -> str:
    """The set of inputs that gives all printed numbers of base at once, in words; empty where none was found."""
    found = record().get("one_set", {})
    if not found.get("reached"):
        return ""
    inputs = ", ".join(f"{name} {value:.4g}" for name, value in found["inputs"].items())
    numbers = ", ".join(f"{name.replace('_', ' ')} {value:.4f} ± {found['bars'][name]:.1g}"
                        for name, value in found["numbers"].items())
    return f"with {inputs} a run gives {numbers}"
