"""Refinement of a mesh by bisection of longest edges (Rivara 1984).

Each new triangle, a part, lies in one triangle of the mesh and uses its map. So shape and fields
stay unchanged to round-off. A new mesh of :mod:`repro.fem.mesher` would interpolate them.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from repro.fem import elements
from repro.fem.elements import Table
from repro.fem.mesh import Mesh
from repro.fem.outline import Outline
from repro.fem.sizing import SPLIT, with_corners
from repro.fem.transfer import Located

#: A point lies on a wall or an end if it is nearer than this times the width. Points on the unit
#: triangle are the same if they differ by less than this.
ROUND_OFF = 1e-12


@dataclass(frozen=True, eq=False)
class Bisection:
    """A mesh whose triangles are parts of the triangles of another mesh, its parent.

    outlines: of the aggregates, with the nodes of ``mesh``; owner: (T,) triangle of the parent that
    contains each part; local: (T, 3, 2) corners of each part on the owner's unit triangle. The
    parent's corners have the first numbers.
    """

    parent: Mesh
    mesh: Mesh
    outlines: list[Outline]
    owner: np.ndarray
    local: np.ndarray

    def nodal(self, values: np.ndarray) -> np.ndarray:
        """Values at the nodes of the parts, from values (N, ...) at the parent's nodes."""
        return self._nodes.field(values, self.parent.cells)

    def at_corners(self, values: np.ndarray) -> np.ndarray:
        """Values at the corners of the parts, from a field (corners,) that is linear in the
        aggregates and zero in the fluid."""
        corners = self.mesh.topology.body_corners
        at = Located(self._nodes.triangle[corners], self._nodes.local[corners])
        field = np.zeros(self.mesh.corners)
        field[corners] = at.field(values, self.parent.triangles)
        return field

    def restricted(self, values: np.ndarray) -> np.ndarray:
        """(N, ...) values at the parent's nodes, from values at the nodes of the parts."""
        return values[self._parent_nodes]

    def of_each(self, amounts: Sequence[np.ndarray], weights: Sequence[np.ndarray],
                part_weights: Sequence[np.ndarray], table: Table) -> list[np.ndarray]:
        """Amounts at the quadrature points of the parts, from amounts in the parent, by aggregate.

        A linear function is fitted to the amount over weight in a triangle, and is limited to its
        range. The triangle's parts get its values, scaled so that the triangle's total stays the
        same.

        amounts, weights: for each aggregate, (t, q) in the parent; part_weights: for each
        aggregate, (t, q) in the parts; table: functions at the points of a triangle.
        """
        each = zip(amounts, weights, part_weights, strict=True)
        return [self._split(number, *one, table) for number, one in enumerate(each)]

    def _split(self, number: int, amount: np.ndarray, weight: np.ndarray,
               part_weight: np.ndarray, table: Table) -> np.ndarray:
        """:meth:`of_each` for the aggregate with index ``number``."""
        triangles = self.mesh.regions[number].triangles
        row = np.searchsorted(self.parent.regions[number].triangles, self.owner[triangles])
        density = amount / weight
        local = _within(self.local[triangles], table.linear[:, 1:])
        places = elements.values(1, local.reshape(-1, 2)).reshape(*local.shape[:2], 3)
        fitted = np.einsum("tqc,tc->tq", places, (density @ elements.linear_fit(table).T)[row])
        limits = density.min(axis=1)[row, None], density.max(axis=1)[row, None]
        parts = part_weight * np.clip(fitted, *limits)
        totals = np.bincount(row, parts.sum(axis=1))
        scale = np.divide(amount.sum(axis=1), totals, out=np.ones_like(totals), where=totals > 0)
        return parts * scale[row, None]

    @cached_property
    def _parent_nodes(self) -> np.ndarray:
        """(N,) number of each of the parent's nodes in the mesh of the parts."""
        nodes = elements.nodes(self.mesh.geometry)
        distance = np.abs(_within(self.local, nodes)[:, :, None] - nodes).max(axis=3)
        part, node, place = np.nonzero(distance < ROUND_OFF)
        numbers = np.empty(len(self.parent.points), int)
        numbers[self.parent.cells[self.owner[part], place]] = self.mesh.cells[part, node]
        return numbers

    @cached_property
    def _nodes(self) -> Located:
        """Location in the parent of each node of the parts. A node of an aggregate is located in a
        triangle of the aggregate."""
        cells = self.mesh.cells
        inside_first = np.argsort(~self.mesh.biomass, kind="stable")
        _, first = np.unique(cells[inside_first], return_index=True)
        local = _within(self.local[inside_first], elements.nodes(self.mesh.geometry))
        owner = np.repeat(self.owner[inside_first], cells.shape[1])
        return Located(owner[first], local.reshape(-1, 2)[first])


@dataclass(frozen=True, eq=False)
class _Parts:
    """Parts of the triangles of a mesh.

    points: (N, 2) um, corners; triangles: (T, 3); owner, local: as in :class:`Bisection`; middles:
    {(smaller, larger corner of a cut edge): corner in its middle}.
    """

    points: np.ndarray
    triangles: np.ndarray
    owner: np.ndarray
    local: np.ndarray
    middles: dict[tuple[int, int], int]


def refined(mesh: Mesh, outlines: Sequence[Outline],
            size: Callable[[np.ndarray], np.ndarray]) -> Bisection:
    """Bisect triangles until no edge is longer than ``SPLIT`` times the size around it.

    Parameters
    ----------
    mesh : Mesh
    outlines : sequence of Outline
        Boundaries of its aggregates.
    size : callable
        Size (K,) um at points (K, 2) um.

    Returns
    -------
    Bisection
    """
    unit = elements.nodes(1)
    parts = _Parts(mesh.points[: mesh.corners], mesh.triangles, np.arange(len(mesh.triangles)),
                   np.tile(unit, (len(mesh.triangles), 1, 1)), {})
    while (cut := _bisected(mesh, parts, size)) is not parts:
        parts = cut
    finer = []
    loops = []
    for outline, loop in zip(outlines, mesh.straight.topology.loops):
        corners, arc, t = _along(parts, loop)
        loops.append(corners)
        finer.append(with_corners(outline, arc, t))
    return Bisection(mesh, _meshed(mesh, parts, tuple(loops), finer), finer, parts.owner,
                     parts.local)


def _bisected(mesh: Mesh, parts: _Parts, size: Callable[[np.ndarray], np.ndarray]) -> _Parts:
    """Cut the longest edges of triangles that are too large, and further edges so that no node
    hangs. Returns ``parts`` itself if no triangle is too large."""
    triangles = parts.triangles
    corners = parts.points[triangles]
    lengths = np.linalg.norm(corners[:, elements.NEXT] - corners, axis=2)
    large = lengths.max(axis=1) > SPLIT * size(corners.mean(axis=1))
    if not large.any():
        return parts
    # Turn each triangle so that its longest edge is 01. Both triangles beside an edge have the same
    # length of it, to the last bit.
    turn = (lengths.argmax(axis=1)[:, None] + np.arange(3)) % 3
    rows = np.arange(len(triangles))[:, None]
    v = triangles[rows, turn]
    local = parts.local[rows, turn]
    ends = np.sort(np.stack([v, v[:, elements.NEXT]], axis=2), axis=2).reshape(-1, 2)
    keys = ends @ (len(parts.points), 1)  # one number for each edge sorts faster than two
    _, first, edge = np.unique(keys, return_index=True, return_inverse=True)
    edges = ends[first]
    edge = edge.reshape(-1, 3)
    cut = np.zeros(len(edges), bool)
    cut[edge[large, 0]] = True
    while (more := cut[edge].any(axis=1) & ~cut[edge[:, 0]]).any():
        cut[edge[more, 0]] = True
    new = np.full(len(edges), -1)
    new[cut] = len(parts.points) + np.arange(cut.sum())
    triangle, side = np.divmod(first[cut], 3)
    between = 0.5 * (local + local[:, elements.NEXT])
    added = _mapped(mesh, parts.owner[triangle], between[triangle, side])
    cut_at = dict(zip(map(tuple, edges[cut].tolist()), new[cut].tolist()))

    middle = new[edge]
    is_cut = middle >= 0
    m, k, n = range(3, 6)
    numbers = np.column_stack([v, middle])
    places = np.concatenate([local, between], axis=1)
    pieces = [(~is_cut[:, 0], (0, 1, 2)),
              (is_cut[:, 0] & ~is_cut[:, 2], (0, m, 2)),
              (is_cut[:, 0] & is_cut[:, 2], (0, m, n)), (is_cut[:, 0] & is_cut[:, 2], (n, m, 2)),
              (is_cut[:, 0] & ~is_cut[:, 1], (m, 1, 2)),
              (is_cut[:, 0] & is_cut[:, 1], (m, 1, k)), (is_cut[:, 0] & is_cut[:, 1], (m, k, 2))]
    return _Parts(np.vstack([parts.points, added]),
                  np.concatenate([numbers[chosen][:, own] for chosen, own in pieces]),
                  np.concatenate([parts.owner[chosen] for chosen, _ in pieces]),
                  np.concatenate([places[chosen][:, own] for chosen, own in pieces]),
                  parts.middles | cut_at)


def _mapped(mesh: Mesh, owner: np.ndarray, local: np.ndarray) -> np.ndarray:
    """(K, 2) um, images of points (K, 2) of the unit triangle in triangles ``owner`` (K,)."""
    return Located(owner, local).field(mesh.points, mesh.cells)


def _within(corners: np.ndarray, local: np.ndarray) -> np.ndarray:
    """(T, q, 2) images of points (q, 2) of the unit triangle in triangles with corners (T, 3, 2).
    """
    return np.einsum("qc,tci->tqi", elements.values(1, local), corners)


def _along(parts: _Parts, loop: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Corners (K,) of a loop (M,) after its edges were cut; the edge (K,) of each; t (K,) on it."""
    found = []

    def walk(a: int, b: int, edge: int, start: float, end: float) -> None:
        middle = parts.middles.get((min(a, b), max(a, b)))
        if middle is None:
            found.append((a, edge, start))
        else:
            half = 0.5 * (start + end)
            walk(a, middle, edge, start, half)
            walk(middle, b, edge, half, end)

    for edge, (a, b) in enumerate(zip(loop.tolist(), np.roll(loop, -1).tolist())):
        walk(a, b, edge, 0.0, 1.0)
    corners, edges, t = zip(*found)
    return np.array(corners), np.array(edges), np.array(t)


def _meshed(mesh: Mesh, parts: _Parts, loops: tuple[np.ndarray, ...],
            outlines: list[Outline]) -> Mesh:
    """The mesh of the parts. The nodes of its loops are the points of the outlines."""
    straight = Mesh.of(_on_lines(mesh, parts.points), parts.triangles,
                       mesh.topology.region[parts.owner], loops, mesh.walls, mesh.ends,
                       mesh.topology.method)
    fine = mesh.element.with_nodes(straight)
    points = fine.points.copy()
    local = _within(parts.local, elements.nodes(mesh.geometry))
    owner = np.repeat(parts.owner, local.shape[1])
    points[fine.cells.ravel()] = _mapped(mesh, owner, local.reshape(-1, 2))
    for loop, outline in zip(fine.topology.loops, outlines):
        points[loop] = outline.points
    return replace(fine, points=_on_lines(mesh, points))


def _on_lines(mesh: Mesh, points: np.ndarray) -> np.ndarray:
    """Points (N, 2) um; points within round-off of a wall or an end are moved onto it."""
    points = points.copy()
    near = ROUND_OFF * mesh.width
    for axis, levels in enumerate((mesh.ends, [wall.y for wall in mesh.walls])):
        for level in levels:
            points[np.abs(points[:, axis] - level) < near, axis] = level
    return points
