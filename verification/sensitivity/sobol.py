"""Sobol indices of base: how much of the variance of each printed number an input's rounding accounts for.

Inputs are independent and uniform within their rounding; those whose elasticity moves no printed number by half a
percent a percent are left where they are. `scipy.stats.sobol_indices` (Saltelli 2010) with N (d + 2) runs in the preset
"fast", and its bootstrap's intervals.
"""

from __future__ import annotations

import numpy as np
from scipy.stats import sobol_indices, uniform

from verification.sensitivity.inputs import ROUNDED, Input
from verification.sensitivity.numbers import Runs, scene
from verification.sensitivity.one_set import PRINTED

LEAST, SEED, CONFIDENCE = 0.005, 2001, 0.95
FAST = ('numerics.preset="fast"',)


def moving(elasticities: dict[str, dict[str, dict]]) -> list[Input]:
    """Rounded inputs with an elasticity above LEAST of any printed number."""
    return [each for each in ROUNDED
            if max(abs(elasticities[name][each.name]["elasticity"]) for name in PRINTED) > LEAST]


def _moved(known: dict[str, dict]) -> bool:
    """Does any rounded input move a number?"""
    return max(abs(known[each.name]["elasticity"]) for each in ROUNDED) > LEAST


def indices(runs: Runs, elasticities: dict[str, dict[str, dict]], samples: int) -> dict:
    """First-order and total indices of each printed number, with their intervals."""
    chosen = moving(elasticities)
    names = [name for name in PRINTED if name != "consumed" and _moved(elasticities[name])]

    def numbers(x: np.ndarray) -> np.ndarray:
        rows = [runs.numbers(scene("base", dict(zip([each.name for each in chosen], column)), *FAST)) for column in x.T]
        return np.array([[row[name] for row in rows] for name in names])
    spread = [uniform(1 - each.rounding, 2 * each.rounding) for each in chosen]
    found = sobol_indices(func=numbers, n=samples, dists=spread, rng=np.random.default_rng(SEED))
    sure = found.bootstrap(confidence_level=CONFIDENCE, n_resamples=999)
    return {"samples": samples, "inputs": [each.name for each in chosen], "confidence": CONFIDENCE,
            "numbers": {name: {kind: _listed(getattr(found, kind)[row], getattr(sure, kind).confidence_interval, row)
                               for kind in ("first_order", "total_order")} for row, name in enumerate(names)}}


def _listed(values: np.ndarray, interval, row: int) -> list[list[float]]:
    """[index, low, high] of each input."""
    return [[float(value), float(low), float(high)]
            for value, low, high in zip(values, interval.low[row], interval.high[row])]
