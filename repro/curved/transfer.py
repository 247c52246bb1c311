"""From one curved mesh to another: where a place lies in the old triangles, and what the fields are there (3.5)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely

from repro.curved import elements
from repro.errors import TransferError
from repro.timing import timed

NEWTON_STEPS = 12
#: A triangle's map to t = 0 is taken as folded where its determinant falls under this part of its largest.
FOLD = 0.02
#: Where that is checked: at the nodes and where it is integrated.
CHECKED = np.concatenate([elements.AT_NODES, elements.DERIVATIVES])


def locate(nodes: np.ndarray, where: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Triangle (K,) of those with nodes (T, 6, 2) that holds, or is nearest to, each place (K, 2) um; and the place on
    the unit triangle (K, 2).

    Newton's method on x(s, t) in every triangle whose box holds the place; the one in which it lies deepest is taken.
    """
    size = np.ptp(nodes, axis=1).max(axis=1)
    low, high = nodes.min(axis=1) - 0.1 * size[:, None], nodes.max(axis=1) + 0.1 * size[:, None]
    place, cell = shapely.STRtree(shapely.box(*low.T, *high.T)).query(shapely.points(where))
    local = _inverted(nodes[cell], where[place])
    depth = elements.linear_functions(local).min(axis=1)
    best = np.lexsort((-depth, place))
    first = best[np.unique(place[best], return_index=True)[1]]
    if len(first) < len(where):
        x, y = where[np.setdiff1d(np.arange(len(where)), place)[0]]
        raise TransferError(f"x = {x:.4g}, y = {y:.4g} um of the new mesh is not in the old one; "
                            "try a shorter growth.time_step")
    return cell[first], local[first]


def _inverted(nodes: np.ndarray, where: np.ndarray) -> np.ndarray:
    """(K, 2) on the unit triangle for places (K, 2) in triangles (K, 6, 2); far outside where it does not converge."""
    local, rest = np.full((len(where), 2), 1 / 3), np.arange(len(where))
    for _ in range(NEWTON_STEPS):
        now, there = local[rest], nodes[rest]
        apart = (elements.functions(now)[:, None] @ there)[:, 0] - where[rest]
        J = np.swapaxes(there, 1, 2) @ elements.derivatives(now)
        det = elements.determinant(J)
        det = np.where(np.abs(det) > 1e-12 * np.abs(det).max(), det, np.inf)
        step = np.stack([J[:, 1, 1] * apart[:, 0] - J[:, 0, 1] * apart[:, 1],
                         J[:, 0, 0] * apart[:, 1] - J[:, 1, 0] * apart[:, 0]], axis=1) / det[:, None]
        local[rest] = np.clip(now - step, -2.0, 3.0)
        rest = rest[np.abs(step).max(axis=1) >= 1e-12]
        if len(rest) == 0:
            break
    apart = np.einsum("ka,kai->ki", elements.functions(local), nodes) - where
    lost = np.hypot(*apart.T) > 1e-6 * np.ptp(nodes, axis=(1, 2))
    return np.where(lost[:, None], 99.0, local)


@dataclass(frozen=True, eq=False)
class Located:
    """Places in old triangles. nodes: (K, 6) of the triangle of each; local: (K, 2) on the unit triangle."""

    nodes: np.ndarray
    local: np.ndarray

    def quadratic(self, fields: np.ndarray) -> np.ndarray:
        """(K, m) of fields (N, m) at all nodes."""
        return np.einsum("ka,kam->km", elements.functions(self.local), fields[self.nodes])

    def linear(self, field: np.ndarray) -> np.ndarray:
        """(K,) of a field (corners,)."""
        return np.einsum("ka,ka->k", elements.linear_functions(self.local), field[self.nodes[:, :3]])


@timed("transfer")
def located(points: np.ndarray, cells: np.ndarray, where: np.ndarray) -> Located:
    """Places (K, 2) in triangles (T, 6); one outside by a little is moved to the edge of the nearest."""
    cell, local = locate(points[cells], where)
    return Located(cells[cell], _inside(local))


def interpolate(points: np.ndarray, cells: np.ndarray, fields: np.ndarray, where: np.ndarray) -> np.ndarray:
    """(K, m) quadratic fields (N, m) at places (K, 2)."""
    return located(points, cells, where).quadratic(fields)


def _inside(local: np.ndarray) -> np.ndarray:
    """Places on the unit triangle, those outside moved to its edge."""
    L = np.clip(elements.linear_functions(local), 0.0, None)
    return (L / L.sum(axis=1, keepdims=True))[:, 1:]


def unfolded(mesh, origin: np.ndarray) -> np.ndarray:
    """Places at t = 0 (N, 2) that no triangle of the aggregate turns over: where the interpolated ones would, middles
    go half way between their corners. Raises TransferError where that is not enough."""
    cells = mesh.cells[mesh.biomass]
    for _ in range(3):
        det = elements.determinant(elements.jacobian(origin[cells], CHECKED))
        bad = cells[det.min(axis=1) <= FOLD * det.max(axis=1)]
        if len(bad) == 0:
            return origin
        origin = origin.copy()
        origin[bad[:, 3:]] = 0.5 * (origin[bad[:, :3]] + origin[bad[:, [1, 2, 0]]])
    if det.min() <= 0:
        x, y = mesh.points[bad[0]].mean(axis=0)
        raise TransferError(f"after a remesh the places at t = 0 fold near x = {x:.4g}, y = {y:.4g} um; "
                            "try a larger numerics.refinement")
    return origin
