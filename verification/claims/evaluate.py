"""Compute claims at all levels. Each level has one process, which keeps its runs.

The error bars of a claim's numbers follow from the values at its levels.

Formal orders: every stage of the scheme has second order in the mesh, except the head loss and the stresses, which have
first order; the loop has first order in the step. `make verify` measures all of them. The converged solution has at
least second order where it is smooth, and at least first order where biomass, water and wall meet.

The bar of an error, or of a difference between two runs that should agree, may exceed the number.
"""

import importlib
import pkgutil
import re
from collections.abc import Iterable
from dataclasses import replace
from math import inf
from types import ModuleType

import numpy as np

import verification.claims as package
from verification.claims import CLAIMS, MODEL, Claim, ClaimError, Finding, PaperCheck
from verification.claims.levels import Level, at_level, forget
from verification.store import map_in_parallel
from verification.uncertainty import Bar, Estimate, combined, estimate, spread

MESH_ORDERS, STEP_ORDERS = (1.0, 2.0), (1.0, 1.0)

#: Name and value of each check of a claim, and whether it holds.
Numbers = tuple[tuple[str, float, bool], ...]


def numbers(finding: Finding) -> Numbers:
    """The numbers of a finding at one level."""
    return tuple((check.quantity, check.value, check.holds) for check in finding.checks)


def with_bars(claim: Claim, finding: Finding, by_level: dict[Level, Numbers]) -> Finding:
    """The finding with a bar on each check, from its numbers at all levels. Raises ClaimError if the levels have
    different quantities."""
    distinct = {quantities(row) for row in by_level.values()}
    if len(distinct) != 1:
        raise ClaimError(f"the levels have different quantities: {sorted(distinct)}")
    columns = zip(*by_level.values())
    return replace(finding, checks=tuple(_judgeable(claim, check, dict(zip(by_level, column)))
                                         for check, column in zip(finding.checks, columns)))


def quantities(row: Numbers) -> tuple[str, ...]:
    """The quantities of a finding at one level, without the instants in their names."""
    return tuple(unnumbered(quantity) for quantity, *_ in row)


def unnumbered(quantity: str) -> str:
    """The name of a quantity without its numbers, because the instant of an event differs between levels."""
    return re.sub(r"\d+(\.\d+)?", "#", quantity)


def _judgeable(claim: Claim, check: PaperCheck, by_level: dict[Level, tuple[str, float, bool]]) -> PaperCheck:
    """The check with its bar, from its value and outcome at each level. The bar is added to the check's own width, the
    uncertainty of a position on its mesh."""
    values = {level: value for level, (_, value, _) in by_level.items()}
    on_sizes = [values[level] for level in claim.judging_levels]
    beside = [value for level, value in values.items() if level not in claim.judging_levels]
    bar = spread(on_sizes) if not check.converges else combined(
        check.value, _estimate(claim.meshes, values, MESH_ORDERS), _estimate(claim.stepped, values, STEP_ORDERS))
    width = check.bar or Bar(check.value, check.value)
    bar = replace(bar, low=bar.low - check.value + width.low, high=bar.high - check.value + width.high)
    return replace(check, bar=bar, holds_at=tuple(by_level[level][-1] for level in claim.judging_levels),
                   date=check.date or claim.date,
                   scheme=(min(beside), max(beside)) if beside and bar.high < inf else None,
                   on_sizes=tuple(on_sizes) if claim.about == MODEL else ())


def _estimate(varied: dict[float, Level], values: dict[Level, float], formal: tuple[float, float]) -> Estimate | None:
    """Estimate a number from its values on several sizes; None if the size is not varied."""
    return estimate([*varied], [values[level] for level in varied.values()], formal) if len(varied) > 1 else None


#: Outcome of a claim at one level: its numbers, with its finding if the level is the judged one; or the message of an
#: error.
Outcome = tuple[Numbers, Finding | None] | str

#: Number of additional runs of a claim at each of its levels, in units of the run wide; C32 reads those of C41.
RUNS = {"C41": 5.5, "C42": 1, "C43": 1.5, "C53": 4}
#: Cost of base over that of wide, and the constant part of the cost of a run.
OF_BASE, LEAST = 0.1, 0.15


def register_all() -> None:
    """Import every module of this package: each registers its claims."""
    import_all(package)


def import_all(package: ModuleType) -> None:
    """Import every module of a package but its program."""
    for module in pkgutil.iter_modules(package.__path__):
        if module.name != "__main__":
            importlib.import_module(f"{package.__name__}.{module.name}")


def everywhere(ids: Iterable[str]) -> dict[str, dict[Level, Outcome]]:
    """Outcomes of claims at all of their levels; the most expensive levels run first."""
    ids_at: dict[Level, list[str]] = {}
    by_claim: dict[str, dict[Level, Outcome]] = {}
    for id in ids:
        by_claim[id] = {}
        for level in CLAIMS[id].levels:
            ids_at.setdefault(level, []).append(id)
    levels = sorted(ids_at, key=lambda level: effort(level, ids_at[level]), reverse=True)
    for level, outcomes in zip(levels, map_in_parallel(outcomes_at, levels, [ids_at[level] for level in levels])):
        for id in outcomes:
            by_claim[id][level] = outcomes[id]
    return by_claim


def effort(level: Level, ids: list[str]) -> float:
    """Estimate the cost of claims at a level, in runs of wide at size 1. A run costs in proportion to its number of
    elements, plus a constant."""
    runs = OF_BASE + any(CLAIMS[id].of_wide for id in ids) + sum(RUNS.get(id, 0) for id in ids)
    return runs * (LEAST + level.size**-2) / level.step


def outcomes_at(level: Level, ids: list[str]) -> dict[str, Outcome]:
    """Outcomes of some claims at one level. The runs of the level are dropped afterwards."""
    register_all()
    with at_level(level), np.errstate(all="raise", under="ignore"):
        outcomes = {id: _attempt(id, level) for id in ids}
    forget(level)
    return outcomes


def _attempt(id: str, level: Level) -> Outcome:
    """A claim's numbers at the present level, or the message of its error."""
    try:
        finding = CLAIMS[id].function()
        judged_finding = finding.with_note() if level == CLAIMS[id].judged else None
        return numbers(finding), judged_finding
    except Exception as error:
        return f"at {level}: {type(error).__name__}: {error}"
