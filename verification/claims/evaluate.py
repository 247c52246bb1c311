"""Claims computed at all levels: each level in a process of its own, whose runs it keeps while it computes.

The error bars of a claim's numbers, from what its function finds at other levels.

Formal orders: every stage of the scheme is of second order in the mesh but for the head loss and the stresses, which
are of first; its loop is of first order in the step. `make verify` measures all of them. The converged solution is of
second order or more where nothing is singular, and of first at the least where biomass, water and wall meet.

A number that is itself an error, or a difference of two runs that should be none, may have a bar larger than itself.
"""

from __future__ import annotations

import importlib
import pkgutil
import re
from collections.abc import Callable, Iterable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from types import ModuleType

import numpy as np

import verification.claims as package
from verification.claims import CLAIMS, MODEL, Claim, ClaimError, Finding, PaperCheck
from verification.claims.levels import Level, at_level, forget
from verification.uncertainty import Bar, Estimate, combined, estimate, spread

MESH_ORDERS, STEP_ORDERS = (1.0, 2.0), (1.0, 1.0)

#: Name and value of each check of a claim, and whether it holds.
Numbers = tuple[tuple[str, float, bool], ...]


def numbers(finding: Finding) -> Numbers:
    """What a finding says at one level."""
    return tuple((check.quantity, check.value, check.holds) for check in finding.checks)


def barred(claim: Claim, finding: Finding, found: dict[Level, Numbers]) -> Finding:
    """The finding with a bar on each check, from its numbers at all levels. Raises ClaimError where these do not speak
    of the same quantities."""
    said = {quantities(row) for row in found.values()}
    if len(said) != 1:
        raise ClaimError(f"the levels tell of different quantities: {sorted(said)}")
    columns = zip(*found.values())
    return replace(finding, checks=tuple(_judgeable(claim, check, dict(zip(found, column)))
                                         for check, column in zip(finding.checks, columns)))


def quantities(row: Numbers) -> tuple[str, ...]:
    """What a finding speaks of at one level, whatever the instants are."""
    return tuple(unnumbered(quantity) for quantity, *_ in row)


def unnumbered(quantity: str) -> str:
    """A quantity without the numbers in it: the instant at which something happens differs between levels."""
    return re.sub(r"\d+(\.\d+)?", "#", quantity)


def _judgeable(claim: Claim, check: PaperCheck, found: dict[Level, tuple[str, float, bool]]) -> PaperCheck:
    """The check with its bar, from its value and whether it holds at each level, which is added to a width of its own,
    that of the mesh around a place."""
    values = {level: value for level, (_, value, _) in found.items()}
    own = [values[level] for level in claim.own]
    beside = [value for level, value in values.items() if level not in claim.own]
    bar = spread(own) if not check.converges else combined(
        check.value, _estimate(claim.meshes, values, MESH_ORDERS), _estimate(claim.stepped, values, STEP_ORDERS))
    width = check.bar or Bar(check.value, check.value)
    bar = replace(bar, low=bar.low - check.value + width.low, high=bar.high - check.value + width.high)
    return replace(check, bar=bar, held=tuple(found[level][-1] for level in claim.own), date=check.date or claim.date,
                   scheme=(min(beside), max(beside)) if beside else None,
                   on_sizes=tuple(own) if claim.about == MODEL else ())


def _estimate(varied: dict[float, Level], values: dict[Level, float], formal: tuple[float, float]) -> Estimate | None:
    """From the levels of some sizes; None where the size is not varied."""
    return estimate([*varied], [values[level] for level in varied.values()], formal) if len(varied) > 1 else None


#: Of a claim at one level: its numbers, with its finding where the level is the judged one, or the error in words.
Found = tuple[Numbers, Finding | None] | str

#: Runs as long as that of wide which a claim makes of its own at each of its levels; C32 reads those of C41.
RUNS = {"C41": 5.5, "C42": 1, "C43": 1.5}
#: The run of base over that of wide, and what a run takes on the largest elements.
OF_BASE, LEAST = 0.1, 0.15


def register_all() -> None:
    """Import every module of this package: each registers its claims."""
    import_all(package)


def import_all(package: ModuleType) -> None:
    """Import every module of a package but its program."""
    for module in pkgutil.iter_modules(package.__path__):
        if module.name != "__main__":
            importlib.import_module(f"{package.__name__}.{module.name}")


def everywhere(ids: Iterable[str]) -> dict[str, dict[Level, Found]]:
    """What claims come to at all of their levels, the dearest levels first."""
    wanted: dict[Level, list[str]] = {}
    by_claim: dict[str, dict[Level, Found]] = {}
    for id in ids:
        by_claim[id] = {}
        for level in CLAIMS[id].levels:
            wanted.setdefault(level, []).append(id)
    levels = sorted(wanted, key=lambda level: effort(level, wanted[level]), reverse=True)
    for level, found in zip(levels, side_by_side(found_at, levels, [wanted[level] for level in levels])):
        for id in found:
            by_claim[id][level] = found[id]
    return by_claim


def effort(level: Level, ids: list[str]) -> float:
    """About how long claims take at a level, in runs of wide at size 1: a run takes as long as elements go in a size,
    and something whatever the size is."""
    runs = OF_BASE + any(CLAIMS[id].of_wide for id in ids) + sum(RUNS.get(id, 0) for id in ids)
    return runs * (LEAST + level.size**-2) / level.step


def side_by_side(function: Callable, *given: Iterable) -> list:
    """map, in a process a core, each call in its turn."""
    with ProcessPoolExecutor() as pool:
        return list(pool.map(function, *given))


def found_at(level: Level, ids: list[str]) -> dict[str, Found]:
    """What some claims come to at one level; its runs are forgotten afterwards."""
    register_all()
    with at_level(level), np.errstate(all="raise", under="ignore"):
        found = {id: _attempt(id, level) for id in ids}
    forget(level)
    return found


def _attempt(id: str, level: Level) -> Found:
    """A claim's numbers at the present level, or the error in words."""
    try:
        finding = CLAIMS[id].function()
        judged = finding.told() if level == CLAIMS[id].judged else None
        return numbers(finding), judged
    except Exception as error:
        return f"at {level}: {type(error).__name__}: {error}"
