"""The error bars of a claim's numbers, from what its function finds at other levels.

Formal orders: every stage is of second order in the mesh but for the head loss and the stresses, which are of first;
the loop is of first order in the step between shape updates. `make verify` measures all of them.

A number that is itself an error, or a difference of two runs that should be none, may have a bar larger than itself.
"""

from __future__ import annotations

import re
from dataclasses import replace

from verification.claims import Check, Claim, ClaimError, Finding
from verification.claims.levels import DEFAULT, Level
from verification.uncertainty import Estimate, combined, estimate, spread

MESH_ORDERS, STEP_ORDERS = (1.0, 2.0), (1.0, 1.0)

#: Name and value of each check of a claim, and whether it holds.
Numbers = tuple[tuple[str, float, bool], ...]


def numbers(finding: Finding) -> Numbers:
    """What a finding says at one level."""
    return tuple((check.quantity, check.ours, check.holds) for check in finding.checks)


def barred(claim: Claim, finding: Finding, others: dict[Level, Numbers]) -> Finding:
    """The finding with a bar on each check. Raises ClaimError where the levels do not speak of the same quantities."""
    found = {DEFAULT: numbers(finding), **others}
    said = {tuple(_name(quantity) for quantity, *_ in row) for row in found.values()}
    if len(said) != 1:
        raise ClaimError(f"the levels tell of different quantities: {sorted(said)}")
    checks = [_judgeable(claim, check, {level: row[k][1] for level, row in found.items()},
                         tuple(row[k][2] for row in found.values())) for k, check in enumerate(finding.checks)]
    return replace(finding, checks=tuple(checks))


def _name(quantity: str) -> str:
    """A quantity without the numbers in it: the instant at which something happens differs between levels."""
    return re.sub(r"\d+(\.\d+)?", "#", quantity)


def _judgeable(claim: Claim, check: Check, values: dict[Level, float], held: tuple[bool, ...]) -> Check:
    """The check with its bar, from its value and whether it holds at each level."""
    if not check.converges:
        return replace(check, bar=spread(values.values()), held=held)
    mesh = _estimate(claim.sizes, [values[Level(size=size)] for size in claim.sizes], MESH_ORDERS)
    step = _estimate(claim.steps, [values[Level(step=step)] for step in claim.steps], STEP_ORDERS)
    return replace(check, bar=combined(check.ours, mesh, step))


def _estimate(sizes: tuple[float, ...], values: list[float], formal: tuple[float, float]) -> Estimate | None:
    """None where the size is not varied."""
    return estimate(sizes, values, formal) if len(sizes) > 1 else None
