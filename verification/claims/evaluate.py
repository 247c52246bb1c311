"""Claims computed at all levels: the runs side by side beforehand, then the numbers of each level in a process."""

from __future__ import annotations

import importlib
import os
import pkgutil
from collections.abc import Callable, Iterable
from concurrent.futures import ProcessPoolExecutor
from itertools import repeat

import numpy as np

import verification.claims as package
from repro.run.cache import cached_runs
from repro.scene import Scene
from verification.claims import CLAIMS, runs
from verification.claims.bars import Numbers, numbers
from verification.claims.levels import Level, at_level


def register_all() -> None:
    """Import every module of this package: each registers its claims."""
    for module in pkgutil.iter_modules(package.__path__):
        if module.name != "__main__":
            importlib.import_module(f"{package.__name__}.{module.name}")


def scenes(ids: Iterable[str]) -> list[Scene]:
    """What claims run, at every level; what only their words tell of, at the default."""
    found = []
    for claim in (CLAIMS[id] for id in ids):
        found += [runs.scene(*run) for run in (*claim.scenes, *claim.words)]
        for level in claim.levels:
            with at_level(level):
                found += [runs.scene(*run) for run in claim.scenes]
    return found


def compute(wanted: Iterable[Scene]) -> None:
    """Compute the runs that are not there, side by side, the longest first."""
    cached_runs(sorted(wanted, key=_effort, reverse=True), runs.CACHE)


def _effort(scene: Scene) -> float:
    """About how long a run takes, in any unit: triangles times steps."""
    steps = scene.growth.end / scene.growth.time_step if scene.growth else 1.0
    return steps * scene.numerics.refinement**2 * (5 if scene.numerics.transport == "gear" else 1)


def elsewhere(ids: Iterable[str]) -> dict[str, dict[Level, Numbers | str]]:
    """The numbers of claims at all levels but the default, or the error for which there are none."""
    levels = sorted({level for id in ids for level in CLAIMS[id].levels}, key=lambda level: level.size * level.step)
    wanted = [[id for id in ids if level in CLAIMS[id].levels] for level in levels]
    found = dict(zip(levels, side_by_side(numbers_at, levels, wanted)))
    return {id: {level: rows[id] for level, rows in found.items() if id in rows} for id in ids}


def side_by_side(function: Callable, *given: list) -> list:
    """map, in a process a core, each call in its turn."""
    if not given[0]:
        return []
    with ProcessPoolExecutor(max_workers=os.cpu_count()) as pool:
        return list(pool.map(function, *given))


def numbers_at(level: Level, ids: list[str]) -> dict[str, Numbers | str]:
    """The numbers of some claims at one level."""
    register_all()
    with at_level(level), np.errstate(all="raise", under="ignore"):
        return dict(zip(ids, map(_attempt, ids, repeat(level))))


def _attempt(id: str, level: Level) -> Numbers | str:
    """A claim's numbers at the present level, or the error in words."""
    try:
        return numbers(CLAIMS[id].function())
    except Exception as error:
        return f"at {level}: {type(error).__name__}: {error}"
