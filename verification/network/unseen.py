"""Fifty shapes that the fit of the law has not seen: half-discs, drawn bodies and plugs, and what growth makes, of
sizes, positions, pores, velocities and lambdas drawn at random."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from repro.results.network import known
from verification.network import law, shapes
from verification.network.shapes import Growth, Sample

SEED = 20261123
HALF_DISCS, BODIES, PLUGS = 10, 8, 8
#: Of half-discs, over W.
THICKNESSES = (law.THICKNESSES[0], law.THICKNESSES[-1])
#: Of plugs, areas over W^2; of half-discs and bodies, widths of the pore (um), on which nothing may depend.
SHARES, WIDTHS = (2.1, 4.2), (20.0, 300.0)
#: Runs, and shapes of each: no larger than this area over W^2, each larger than the one before by 5 % at least.
RUNS, OF_EACH, MOST, APART = 3, 8, 3.0, 1.05
#: Hours that a run may take to become so large.
END = 50


def every(seed: int = SEED) -> Iterator[Sample]:
    """All fifty, each at a lambda of its own, or of its run."""
    random = np.random.default_rng(seed)
    yield from drawn(random)
    for _ in range(RUNS):
        yield from grown(random)


def drawn(random: np.random.Generator) -> Iterator[Sample]:
    """Half-discs in other pores and places, and drawn bodies and plugs."""
    for _ in range(HALF_DISCS):
        width, ratio = _log(random, *WIDTHS), _ratio(random)
        thickness, position = random.uniform(*THICKNESSES), random.uniform(-1, 1) * width
        now = shapes.half_disc(thickness, width, position, shapes.QUICK)
        yield shapes.sample(now, (ratio,))
    for _ in range(BODIES):
        thicker, leaning = random.uniform(*shapes.THICKER), random.uniform(-1, 1) * shapes.LEANING
        radius = random.uniform(THICKNESSES[0], THICKNESSES[1] / max(thicker, 1))
        yield _outlined(shapes.body(0.5 * np.pi * radius**2, thicker, leaning), random)
    for _ in range(PLUGS):
        share, ends = random.uniform(*SHARES), random.uniform(*shapes.ENDS)
        yield _outlined(shapes.plug(share, ends, random.uniform(1 - shapes.UPSTREAM, shapes.UPSTREAM)), random)


def _outlined(points: np.ndarray, random: np.random.Generator) -> Sample:
    now, ratio = shapes.drawn(points, _log(random, *WIDTHS)), _ratio(random)
    return shapes.sample(now, (ratio,))


def grown(random: np.random.Generator) -> Iterator[Sample]:
    """Shapes of a run that are in the law's range, their areas evenly from the first to the last."""
    width, velocity = random.uniform(40, 150), _log(random, 0.5, 6)
    supply = _log(random, max(shapes.LEAST_SUPPLY * width**2, 4), 20)
    run = Growth(width, velocity, supply, random.uniform(0.05, 0.15) * width, random.uniform(-0.5, 0.5) * width, END)
    ratio = _ratio(random)
    found = [one for one in shapes.grown(run, MOST, APART, (ratio,)) if _known(one)]
    shares = np.array([one.share for one in found])
    for share in np.linspace(shares[0], shares[-1], OF_EACH):
        yield found[int(np.abs(shares - share).argmin())]


def _known(one: Sample) -> bool:
    low, high = known(one.spanned)
    return low <= one.share <= high


def _log(random: np.random.Generator, low: float, high: float) -> float:
    """Between two values, evenly in the logarithm."""
    return float(np.exp(random.uniform(np.log(low), np.log(high))))


def _ratio(random: np.random.Generator) -> float:
    return _log(random, shapes.RATIOS[0], shapes.RATIOS[-1])
