"""A field with a front, carried through twenty unrelated meshes of one rectangle: its error, and its total's drift.

Meshes and what is worked out once for them are made beforehand; a time is of all twenty transfers.
"""

from __future__ import annotations

from functools import cache, partial

import numpy as np

from repro.fem import transfer
from repro.fem.mesh import curved
from repro.fem.space import Space
from verification.bench import pores
from verification.bench.clock import measured
from verification.problems import meshes

REPEATS = 3
#: um; the front's place along x and its width.
ENDS, WIDTH, FRONT, STEEP = (0.0, 40.0), 25.0, 20.0, 3.0
REMESHES, SIZES, QUADRATIC = 20, (4.0, 2.8, 2.0, 1.4, 1.0), (8.0, 5.6, 4.0, 2.8, 2.0)


def run(quick: bool) -> dict:
    """The part."""
    count, sizes, quadratic = (3, (4.0, 2.8), (5.6,)) if quick else (REMESHES, SIZES, QUADRATIC)
    ways = {"conserving projection": transfer.project,
            "bounded conserving projection": transfer.project_bounded,
            f"linear interpolation, {pores.PAPER}": transfer.interpolated}
    jobs = {(name, f"{size:g} um"): partial(_linear, size, count, way) for name, way in ways.items() for size in sizes}
    jobs |= {("quadratic interpolation (fast, accurate)", f"{size:g} um"): partial(_quadratic, size, count)
             for size in quadratic}
    repeats = 1 if quick else REPEATS
    return {"title": f"Transfer: a front through {count} remeshes", "repeats": repeats,
            "error": "L2 of the field in the end, relative; drift: of its total, relative",
            "reference": "the field itself", "lines": measured(jobs, repeats)}


def exact(x, y):
    """From 1 to 2 across a slanted front."""
    return 1.5 + 0.5 * np.tanh((x + 0.3 * y - FRONT) / STEEP)


@cache
def _meshed(size: float, which: int):
    return meshes.rectangle(ENDS, WIDTH, size, seed=which)


@cache
def _curved(size: float, which: int):
    straight = meshes.channel(ENDS, WIDTH, size, lambda x, y: x < np.inf, seed=which)
    return Space(curved(straight, None), 2)


@cache
def _total() -> float:
    """Integral of the field, by Gauss's quadrature."""
    node, weight = np.polynomial.legendre.leggauss(60)
    x, y = 0.5 * ENDS[1] * (1 + node), 0.5 * WIDTH * (1 + node)
    return float(weight @ exact(x[:, None], y) @ weight) * 0.25 * ENDS[1] * WIDTH


def _linear(size: float, count: int, project):
    old = _meshed(size, 0)
    field = exact(*old[0].T)[:, None]
    start = _integral(*old, field)
    for which in range(1, count + 1):
        new = _meshed(size, which)
        field = project(*old, field, *new)
        old = new
    return lambda: {"error": meshes.l2_error(*old, field[:, 0], exact), "nodes": len(old[0]),
                    "drift": abs(_integral(*old, field) - start) / _total(),
                    "beyond": float(max(1.0 - field.min(), field.max() - 2.0, 0.0))}


def _integral(points, triangles, field) -> float:
    _, weight, shape = meshes.quadrature(points, triangles)
    return float(np.sum(weight * (field[triangles, 0] @ shape.T)))


def _quadratic(size: float, count: int):
    old = _curved(size, 0)
    field = exact(*old.points.T)[:, None]
    start = _weighed(old, field)
    for which in range(1, count + 1):
        new = _curved(size, which)
        field = transfer.interpolate(old.mesh.points, old.mesh.cells, field, new.points)
        old = new
    return lambda: {"error": _apart(old, field), "nodes": old.count,
                    "drift": abs(_weighed(old, field) - start) / _total(),
                    "beyond": float(max(1.0 - field.min(), field.max() - 2.0, 0.0))}


def _weighed(space, field) -> float:
    return float(np.sum(space.at.dx * space.at_points(field[:, 0])))


def _apart(space, field) -> float:
    """L2 of a quadratic field less the exact one, relative."""
    truth = exact(*space.at_points(space.points.T))
    gap = space.at_points(field[:, 0]) - truth
    return float(np.sqrt(np.sum(space.at.dx * gap**2) / np.sum(space.at.dx * truth**2)))
