"""Claims computed at all levels: each level in a process of its own, whose runs it keeps while it computes."""

from __future__ import annotations

import importlib
import os
import pkgutil
from collections.abc import Callable, Iterable
from concurrent.futures import ProcessPoolExecutor

import numpy as np

import verification.claims as package
from verification.claims import CLAIMS, Finding
from verification.claims.bars import Numbers, numbers
from verification.claims.levels import COMPARED, CONVERGED, PAIRED, Level, at_level, forget

#: Of a claim at one level: its numbers, with its finding where the level is the judged one, or the error in words.
Found = tuple[Numbers, Finding | None] | str

#: How many runs more than the others the levels of claims have that compare several.
RUNS_OF_PAIRED = 10.0


def register_all() -> None:
    """Import every module of this package: each registers its claims."""
    for module in pkgutil.iter_modules(package.__path__):
        if module.name != "__main__":
            importlib.import_module(f"{package.__name__}.{module.name}")


def everywhere(ids: Iterable[str]) -> dict[str, dict[Level, Found]]:
    """What claims come to at all of their levels, the dearest levels first."""
    ids = list(ids)
    levels = sorted({level for id in ids for level in CLAIMS[id].levels}, key=effort, reverse=True)
    wanted = [[id for id in ids if level in CLAIMS[id].levels] for level in levels]
    found = dict(zip(levels, side_by_side(found_at, levels, wanted)))
    return {id: {level: rows[id] for level, rows in found.items() if id in rows} for id in ids}


def effort(level: Level) -> float:
    """About how long a level takes, in any unit."""
    several = RUNS_OF_PAIRED if level.kind == CONVERGED and level.size in (*PAIRED, *COMPARED) else 1.0
    return several * (4.0 if level.kind == CONVERGED else 2.0) / (level.size**3 * level.step)


def side_by_side(function: Callable, *given: list) -> list:
    """map, in a process a core, each call in its turn."""
    if not given[0]:
        return []
    with ProcessPoolExecutor(max_workers=os.cpu_count()) as pool:
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
