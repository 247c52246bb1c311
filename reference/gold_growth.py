"""Uniform growth into a wall, on a bonded wall, and of two aggregates that weld, by another code, NGSolve, with bars.

``reference/gold/growth.py`` computed the numbers: positions of fourth order, pressures of third order, elements that
shrink towards contact lines, and the contact line as an unknown. ``reference/gold/growth.json`` has them.
"""

import json
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import NamedTuple

FILE = Path(__file__).parent / "gold" / "growth.json"


class Number(NamedTuple):
    """A number and its bar."""

    value: float
    bar: float


class Grown(NamedTuple):
    """A half-disc after uniform growth in a pore 50 um wide.

    radius: of the half-disc at t = 0, um; theta: its expansion; numbers: by name, lengths in um and stresses over mu_L:
    ``length`` of contact with the upper wall, ``tip``, ``wall_traction``, ``tensile_stress``.
    """

    radius: float
    theta: float
    numbers: Mapping[str, Number]


@cache
def states(kind: str) -> tuple[Grown, ...]:
    """States of a kind, in the order of the file: "touching" the upper wall, "bonded" to the lower one, or "welded":
    two that face each other in a pore of twice the width."""
    rows = json.loads(FILE.read_text(encoding="utf-8"))[kind]
    return tuple(Grown(row["radius_um"], row["theta"],
                       {name.removesuffix("_um"): Number(**number) for name, number in row.items()
                        if isinstance(number, dict)}) for row in rows)
