"""An aggregate that grows unevenly through many updates and remeshes: what must hold after each of them."""

from __future__ import annotations

import numpy as np

from repro.fem.mesh import triangle_areas
from verification.case import Outcome, Profile, at_least, at_most, case
from verification.reprojection import bodies, grids

UPDATES, RADIUS = 30, 8.0
#: Remesh where more than six triangles are under 0.6 (3.5), or nearer to an end than min(7 R, 1.3 W) (3.1).
POOR, ALLOWED, REACH, WIDEST = 0.6, 6, 7.0, 1.3


@case("reprojection-growing", kind="property",
      norm="biomass less what was made, relative; theta over J less the density over X_m; triangles, and um, by which "
           "the criteria are missed; all updates",
      claim="An aggregate that grows sixfold, seven times faster in front than behind, keeps its biomass to round-off "
            "through every remesh, restarts theta at J times the density over X_m, and is remeshed in time",
      mutants=("theta-without-density", "remeshed-too-late", "linear-transfer", "curved-mass-lost"))
def growing() -> Outcome:
    kept, paper = {order: _grown("conserving", order) for order in bodies.ORDERS}, _grown("linear", 1)
    checks = [check for order, rows in kept.items() for check in _judged(rows, bodies.ORDERS[order])]
    checks.append(at_least("drift of the biomass by the paper's transfer", np.abs(paper["drift"]).max(), 1e-4,
                           "not conserving [E8]: the case would see it"))
    return Outcome(tuple(checks), (), (_drifts(kept[1]["drift"], paper["drift"]),))


def _judged(rows: dict[str, np.ndarray], name: str) -> list:
    """Checks of the updates with one kind of elements."""
    return [at_most(f"biomass, {name}", np.abs(rows["drift"]).max(), 1e-12, "round-off"),
            at_most(f"theta after a remesh, {name}", rows["restart"].max(), 1e-12, "J times the density over X_m"),
            at_most(f"triangles under 0.6, {name}", rows["poor"].max(), ALLOWED, "remesh criterion (3.5)"),
            at_most(f"missing reach (um), {name}", rows["missing"].max(), 1e-9, "remesh criterion (3.1)"),
            at_least(f"remeshes, {name}", np.count_nonzero(rows["anew"]), 3, "else nothing is tested")]


def _drifts(kept: np.ndarray, paper: np.ndarray) -> Profile:
    update = np.arange(1, UPDATES + 1)
    return Profile("biomass less what was made", "update", "relative",
                   (("conserving", "ours", update, kept), ("linear", "ours", update, paper),
                    ("exact", "exact", update, 0.0 * update)))


def _grown(transfer: str, order: int) -> dict[str, np.ndarray]:
    """A row of numbers of every update."""
    given = bodies.scene(f'numerics.transfer="{transfer}"', order=order)
    now, rows = bodies.seed(RADIUS, order=order), []
    wanted = now.mass
    for _ in range(UPDATES):
        made = _faster_in_front(now)
        wanted += float((now.active * made).sum())
        now, anew = bodies.updated(given, now, made)
        rows.append((now.mass / wanted - 1, _restart(now) if anew else 0.0, _poor(now), _missing(now), anew))
    return dict(zip(("drift", "restart", "poor", "missing", "anew"), np.array(rows).T))


def _faster_in_front(now) -> np.ndarray:
    """(r, q) increase of X_A in an update: 15 % at the upstream tip, 2 % at the other."""
    outline, x = now.outline, bodies.places(now.space)[0]
    return 0.15 * np.exp(-2 * (x - outline.upstream) / (outline.downstream - outline.upstream))


def _restart(now) -> float:
    """Largest relative difference of theta from J times the density over X_m: of straight triangles the mean of their
    nodes, of curved ones that in each point."""
    mesh = now.mesh
    cells = mesh.cells[mesh.biomass]
    density = sum(bodies.densities(now)) / bodies.DENSITY
    if now.space.order == 1:
        J = triangle_areas(mesh.points, cells) / triangle_areas(now.origin, cells)
        mean = density[np.searchsorted(mesh.body, cells), 0].mean(axis=1)
        return float(np.abs(now.theta[:, 0] / (J * mean) - 1).max())
    table = now.space.table
    present, first = (grids.curved_weights(where[cells], table.linear, table.weights)
                      for where in (mesh.points, now.origin))
    return float(np.abs(now.theta / (present / first * density) - 1).max())


def _poor(now) -> int:
    """Triangles of quality under 0.6, from their sides alone."""
    corner = now.mesh.points[now.mesh.triangles]
    sides = np.linalg.norm(corner - np.roll(corner, 1, axis=1), axis=2)
    half = sides.sum(axis=1) / 2
    area = np.sqrt(half * np.prod(half[:, None] - sides, axis=1))
    return int(np.count_nonzero(4 * np.sqrt(3) * area / np.sum(sides**2, axis=1) < POOR))


def _missing(now) -> float:
    """um of fluid that are missing beside the aggregate."""
    outline, (left, right) = now.outline, now.mesh.ends
    reach = min(REACH * outline.thickness, WIDEST * bodies.WIDTH)
    return max(0.0, reach - (outline.upstream - left), reach - (right - outline.downstream))
