"""Plug flow through a strip of biomass with dual Monod uptake, one-dimensional: error of the effluents.

Other codes solve it in one dimension; here it is a ribbon of one cell across, which costs twice the unknowns and more.
"""

from __future__ import annotations

from functools import cache, partial

import numpy as np

from reference import channel_bvp
from verification.bench import pores, users
from verification.bench.box import compile_times
from verification.bench.clock import measured

REPEATS = 3
#: um; um/h.
ENDS, STRIP, SPEED = (-40.0, 80.0), 40.0, 1e5
#: Cells along the channel, multiples of three: faces lie on both ends of the strip.
LINEAR, QUADRATIC, CELLS, STEPPED = (15, 30, 60, 120, 240, 480), (6, 12, 24, 48, 96), (30, 60, 120, 240, 480), (60,)


def run(quick: bool) -> dict:
    """The part."""
    linear, quadratic, cells, stepped = ((15, 30), (6, 12), (30,), ()) if quick else (LINEAR, QUADRATIC, CELLS, STEPPED)
    given, repeats = users.scene(), 1 if quick else REPEATS
    coarse, truth = reference(1e-7), reference(1e-9)
    jobs = {(pores.PAPER, f"{n} cells"): partial(_ours, truth, given, n, 1) for n in linear}
    jobs |= {("order 2 (fast, accurate)", f"{n} cells"): partial(_ours, truth, given, n, 2) for n in quadratic}
    jobs |= {("order 3", f"{n} cells"): partial(_ours, truth, given, n, 3) for n in quadratic}
    jobs |= {("fipy", f"{n} cells"): partial(_fipy, truth, n) for n in cells}
    lines = measured(jobs, repeats)
    lines += measured({("py-pde, compiled", f"{n} cells"): partial(_stepped, truth, n) for n in stepped}, 1)
    change = pores.largest(coarse, truth, _supply())
    return {"title": "Uptake in plug flow through a strip, one-dimensional; grid, assembly and solution",
            "error": "effluents over the supply, the larger error", "repeats": repeats, "lines": lines,
            "apart": compile_times(lines), "reference_change": change,
            "reference": f"scipy's solve_bvp, tolerance 1e-9: {truth[0]:.9f} and {truth[1]:.9f} mg/L; from 1e-7 on "
                         f"they change by {change:.1e} of the supply"}


@cache
def reference(tolerance: float) -> np.ndarray:
    """(2,) effluents, mg/L."""
    given = problem()
    found = channel_bvp.solution(SPEED, given.supply, given.diffusivity, given.diffusivity, given.density, given.rates,
                                 STRIP, tolerance)
    return found(np.array([STRIP]))[:, 0]


def problem() -> users.Problem:
    """The channel, as other codes take it."""
    given = pores.constants()
    return users.Problem(ENDS, None, lambda x: (x > 0) & (x < STRIP), users.DENSITY, given.supply,
                         users.DIFFUSIVITY, given.rates, SPEED)


def _supply() -> np.ndarray:
    return np.array(pores.constants().supply)


def _ours(truth, given, cells: int, order: int) -> dict:
    size = (ENDS[1] - ENDS[0]) / cells
    grid = users.straight(ENDS, size, (cells, 1), lambda x, y: (x > 0) & (x < STRIP))
    found = users.solved(given, grid, order, SPEED)
    return {"error": pores.largest([flux.effluent for flux in found], truth, _supply())}


def _fipy(truth, cells: int) -> dict:
    return {"error": pores.largest(users.fipy(problem(), cells)[1], truth, _supply())}


def _stepped(truth, cells: int) -> dict:
    _, found, compiled = users.py_pde(problem(), cells)
    return {"error": pores.largest(found, truth, _supply()), **compiled}
