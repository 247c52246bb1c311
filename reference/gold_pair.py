"""Two aggregates in one pore by another code, NGSolve, with the bars of its own refinement.

``reference/gold/pair.py`` computed the numbers: velocities and concentrations of fourth order, pressures of third order
that jump across the interfaces, elements that shrink towards the contact lines, and the pore from end to end.
"""

import json
from functools import cache
from pathlib import Path
from typing import NamedTuple

FILE = Path(__file__).parent / "gold" / "pair.json"


class Number(NamedTuple):
    """A number and its bar, in the unit of its name."""

    value: float
    bar: float


class Pair(NamedTuple):
    """Two half-discs, (radius, x) in um and whether the lower wall has them, and their numbers by name.

    The length of clean pore that has the loss that both add (um), the effluents, and the uptake of acceptor and donor
    by the first and the second one.
    """

    half_discs: tuple[tuple[float, float, bool], ...]
    numbers: dict[str, Number]


@cache
def pairs() -> dict[str, Pair]:
    """All pairs by name."""
    return {name: Pair(tuple(tuple(disc.values()) for disc in pair["half_discs"]),
                       {key: Number(**number) for key, number in pair["numbers"].items()})
            for name, pair in json.loads(FILE.read_text(encoding="utf-8")).items()}
