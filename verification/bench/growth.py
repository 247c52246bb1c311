"""One growth step: a half-disc that slides on a wall goes from one uneven theta(R) to a half more, in closed form.

theta = a + c (R / R_0)^2 from 12 to 36; every method starts from the exact places and pressure under two thirds of it.
"""

from __future__ import annotations

from functools import cache, partial

import numpy as np

from reference import neo_hookean, quadratic_growth
from repro.fem.outline import FREE
from repro.model import growth, pore
from repro.model.contact import constrained
from verification.bench import pores
from verification.bench.clock import measured

REPEATS = 5
#: um; a and c at the end of the step; theta at its start over theta at its end.
RADIUS, THETA, BEFORE = 20.0, (12.0, 24.0), 2 / 3
LINEAR, QUADRATIC, RINGS = (0.5, 0.7, 1.0, 1.4, 2.0, 2.8), (0.15, 0.25, 0.45, 0.7, 1.0, 1.6), (2, 4, 8, 16)


def run(quick: bool) -> dict:
    """The part."""
    linear, quadratic, rings = ((0.5, 1.0), (0.25, 0.45), (4,)) if quick else (LINEAR, QUADRATIC, RINGS)
    jobs = {(pores.PAPER, f"refinement {r:g}"): partial(_ours, "paper", r) for r in linear}
    jobs |= {("order 2 on curved triangles (fast, accurate)", f"refinement {r:g}"): partial(_ours, "accurate", r)
             for r in quadratic}
    jobs |= {("scikit-fem: quadratic elements", f"{n} rings"): partial(_skfem, n) for n in rings}
    repeats = 1 if quick else REPEATS
    return {"title": "Growth: a step of an aggregate with theta from 12 to 36; assembly and solution",
            "error": "places of the outline over the radius, the largest error", "repeats": repeats,
            "reference": "closed form of the growing half-cylinder", "lines": measured(jobs, repeats)}


def exact(points: np.ndarray, part: float = 1.0) -> np.ndarray:
    """(n, 2) places under ``part`` of theta of the material that was at points (n, 2)."""
    R = np.maximum(np.hypot(*points.T), 1e-12)
    return points * (neo_hookean.cylinder_radius(R, *(part * t for t in THETA), RADIUS) / R)[:, None]


def pressure(points: np.ndarray, part: float) -> np.ndarray:
    """(n,) P / mu_L there; the middle takes what is beside it."""
    R = np.maximum(np.hypot(*points.T), 1e-6 * RADIUS)
    return neo_hookean.cylinder_pressure(R, *(part * t for t in THETA), RADIUS)


def theta(x, y):
    """The expansion at the end of the step."""
    return THETA[0] + THETA[1] * (x**2 + y**2) / RADIUS**2


def _apart(found: np.ndarray, rim: np.ndarray) -> float:
    """Largest distance of the outline (m, 2) from where its nodes (m, 2) of t = 0 should be, over the radius."""
    wanted = exact(rim)
    return float(np.hypot(*(found - wanted).T).max() / np.hypot(*wanted.T).max())


@cache
def _seeded(refinement: float, preset: str):
    now = pore.seeded(pores.scene(preset=preset, refinement=refinement))
    return now, constrained(len(now.mesh.body), now.mesh.topology.body_loop, now.wall, now.fixed)


def _ours(preset: str, refinement: float):
    now, held = _seeded(refinement, preset)
    points = now.mesh.points[now.mesh.body] * RADIUS / pores.RADIUS
    body = growth.Body(now.body.shape, points)
    whole = theta(*(body.shape.table.values @ points[body.shape.cells]).transpose(2, 0, 1))
    start = exact(points, BEFORE)
    found = growth.equilibrium(body, whole, start, pressure(points[: body.shape.corners], BEFORE), held, start)
    return partial(_judged, now, points, found.position)


def _judged(now, points, found) -> dict:
    rim = now.mesh.topology.body_loop
    rim = rim[now.wall == FREE]
    return {"error": _apart(found[rim], points[rim]), "nodes": len(points)}


@cache
def _meshed(rings: int):
    return quadratic_growth.half_disc(RADIUS, rings)


class _Start:
    """The exact state at the start of the step, asked for as that of a solution on another mesh is."""

    @staticmethod
    def at(x, y):
        """Places (n, 2) and pressure (n,)."""
        points = np.column_stack([x, y])
        return exact(points, BEFORE), pressure(points, BEFORE)


def _skfem(rings: int):
    mesh = _meshed(rings)
    found = quadratic_growth.grow(mesh, theta, sum(THETA), start=_Start)
    points = mesh.doflocs.T
    rim = np.isclose(np.hypot(*points.T), RADIUS, rtol=1e-9)
    return lambda: {"error": _apart(found.place.T[rim], points[rim]), "nodes": len(points)}
