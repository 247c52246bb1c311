"""Losses of aggregates in a pore by another code, NGSolve, with the bars of its own refinement.

``reference/gold/flow.py`` computed them: velocities of fourth order, pressures of third order that jump across the
interface, elements that shrink towards the contact lines. ``reference/gold/`` has the outlines and the numbers.
"""

import json
from functools import cache
from pathlib import Path
from typing import NamedTuple

FOLDER = Path(__file__).parent / "gold"


class Added(NamedTuple):
    """The length of clean pore (um) that has the loss that an aggregate adds, and the bar of this length (um)."""

    length: float
    bar: float


@cache
def outlines() -> dict[str, dict]:
    """Outlines by name: ``width`` of the pore (um), ``points`` (M, 2) um, start and middle of each arc in turn, and
    the number of each point's ``wall``, 0 in the fluid, 1 on the lower wall, 2 on the upper one."""
    return json.loads((FOLDER / "outlines.json").read_text(encoding="utf-8"))


@cache
def added(name: str, interface: str) -> Added:
    """The added length of an outline; interface: "laplacian" or "traction", the form of the viscous term (E2)."""
    number = json.loads((FOLDER / "flow.json").read_text(encoding="utf-8"))[f"{name}, {interface}"]
    return Added(number["added_um"], number["bar_um"])


def traction_effect(name: str, pore: float = 600.0) -> float:
    """Conductivity of a pore of a length (um) with an outline in the traction form, over that in the Laplacian form."""
    laplacian, traction = (pore + added(name, form).length for form in ("laplacian", "traction"))
    return laplacian / traction
