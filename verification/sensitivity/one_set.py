"""One set of inputs within the rounding of Table 1 for all printed numbers of base: a linear program, then real runs.

With relative changes x_i of the inputs, r_i their rounding and e_ni the elasticities, the program is

    minimise t    such that    |x_i| <= t r_i    and    low_n <= f_n (1 + sum_i e_ni x_i) <= high_n

so that t <= 1 is a set within the rounding. A run with it moves f_n by what is not linear, and the program is solved
again from there. Where t > 1 the misfit that is left at t = 1 is minimised instead.
"""

from __future__ import annotations

import numpy as np
from scipy.optimize import linprog

from verification.claims import interval
from verification.sensitivity.inputs import ROUNDED
from verification.sensitivity.numbers import Numbers, Runs, scene

#: What section 4 prints: C01-C04.
PRINTED = {"velocity_0": "2.9", "velocity": "1.5", "effluent_acceptor": "4.19", "effluent_donor": "6.13",
           "consumed": "~60"}
#: Of a printed interval the middle part that is aimed at: the rest is for the bars.
AIMED = 0.4
ROUNDS = 6


def targets() -> dict[str, tuple[float, float]]:
    """The intervals of the printed numbers."""
    return {name: interval(text) for name, text in PRINTED.items()}


def reached(numbers: Numbers, part: float = 1.0) -> bool:
    """Do all numbers lie in (the middle part of) their intervals?"""
    return all(abs(numbers[name] - 0.5 * (low + high)) <= 0.5 * part * (high - low)
               for name, (low, high) in targets().items())


def found(runs: Runs, elasticities: dict[str, dict[str, dict]]) -> dict:
    """The set, what a run with it gives, the share t of the rounding that it takes, and whether it is reached."""
    plain = runs.numbers(scene("base", {}))
    slopes = np.array([[plain[name] * elasticities[name][each.name]["elasticity"] for each in ROUNDED]
                       for name in PRINTED])
    start, x, t = np.array([plain[name] for name in PRINTED]), np.zeros(len(ROUNDED)), 0.0
    for _ in range(ROUNDS):
        x, t = program(start, slopes)
        numbers = runs.numbers(scene("base", {each.name: 1 + value for each, value in zip(ROUNDED, x)}))
        if reached(numbers, 0.5):
            break
        start = np.array([numbers[name] for name in PRINTED]) - slopes @ x
    inside = bool(t <= 1 + 1e-9 and reached(numbers))
    middle = {name: 0.5 * sum(pair) for name, pair in targets().items()}
    misfit = max(abs(numbers[name] - middle[name]) / (pair[1] - middle[name]) for name, pair in targets().items())
    return {"reached": inside, "share_of_the_rounding": t, "misfit_in_half_intervals": misfit,
            "inputs": {each.name: each.value * (1 + value) for each, value in zip(ROUNDED, x)},
            "numbers": {name: numbers[name] for name in PRINTED}}


def program(start: np.ndarray, slopes: np.ndarray) -> tuple[np.ndarray, float]:
    """Relative changes and the share of the rounding that they take; within it, with the least misfit, where the
    intervals are out of reach."""
    middle, half = (np.array([weight @ pair for pair in targets().values()])
                    for weight in (np.array([0.5, 0.5]), AIMED * np.array([-0.5, 0.5])))
    rounding = np.array([each.rounding for each in ROUNDED])
    A, column = slopes * rounding, np.ones((len(start), 1))
    box, ones = np.vstack([np.eye(len(rounding)), -np.eye(len(rounding))]), np.ones((2 * len(rounding), 1))
    inside = np.concatenate([middle + half - start, start - middle + half])
    tight = np.hstack([np.vstack([np.vstack([A, -A]), box]), np.vstack([0 * column, 0 * column, -ones])])
    best = _solved(tight, np.concatenate([inside, np.zeros(2 * len(rounding))]), None)
    if best is not None and best[-1] <= 1:
        return best[:-1] * rounding, float(best[-1])
    loose = np.hstack([np.vstack([A, -A]), -np.vstack([half[:, None], half[:, None]]) / AIMED])
    least = _solved(loose, np.concatenate([middle - start, start - middle]), 1.0)
    return least[:-1] * rounding, float(best[-1]) if best is not None else float("inf")


def _solved(A: np.ndarray, b: np.ndarray, box: float | None) -> np.ndarray | None:
    """Minimise the last unknown; the others within +-box."""
    bounds = [(None if box is None else -box, box)] * (A.shape[1] - 1) + [(0, None)]
    answer = linprog(np.append(np.zeros(A.shape[1] - 1), 1.0), A, b, bounds=bounds)
    return answer.x if answer.success else None
