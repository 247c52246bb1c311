"""Elasticities d ln(number) / d ln(input), by central differences.

Two runs on either side at two distances give two estimates; the nearer one counts, and their difference is its bar: it
holds what the larger distance adds to the error of the difference, and what two runs on unrelated meshes differ by. An
elasticity is resolved where its bar is at most a tenth of it.
"""

from __future__ import annotations

from verification.sensitivity.inputs import INPUTS, Input
from verification.sensitivity.numbers import Numbers, Runs, scene

#: Relative distances of an input from its printed value; the larger one of an input that is taken as exact.
NEAR, FAR, LARGE = 0.01, 0.02, 0.1
RESOLVED = 0.1


def elasticities(runs: Runs, name: str) -> dict[str, dict[str, dict]]:
    """{number: {input: elasticity, bar, resolved, and the changes (%) that +-10 % of an exact input make}}."""
    plain, found = runs.numbers(scene(name, {})), {}
    for each in INPUTS:
        if each.only not in ("", name):
            continue
        print(f"{name}: {each.name}", flush=True)
        for number, value in _of_input(runs, name, each, plain).items():
            found.setdefault(number, {})[each.name] = value
    return found


def _of_input(runs: Runs, name: str, each: Input, plain: Numbers) -> dict[str, dict]:
    pairs = {d: [runs.numbers(scene(name, {each.name: 1 + sign * d})) for sign in (1, -1)]
             for d in ((NEAR, FAR) if each.half else (NEAR, FAR, LARGE))}
    return {number: _told(number, value, pairs) for number, value in plain.items()}


def _told(number: str, value: float, pairs: dict[float, list[Numbers]]) -> dict:
    near, far = (difference(*(pair[number] for pair in pairs[d]), value, d) for d in (NEAR, FAR))
    bar = abs(far - near)
    told = {"elasticity": near, "bar": bar, "resolved": bar <= RESOLVED * abs(near)}
    if LARGE in pairs:
        told["by_10_percent"] = [100 * (found[number] / value - 1) for found in pairs[LARGE]]
    return told


def difference(above: float, below: float, value: float, distance: float) -> float:
    """The central difference of ln f over ln x."""
    return (above - below) / (2 * distance * value)
