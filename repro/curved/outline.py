"""The aggregate's boundary as a chain of parabolic arcs: nodes are corners and middles in turn.

Arc k of the 2 M nodes has the nodes 2 k, 2 k + 1, 2 k + 2. New nodes are placed on the
arcs themselves, so that a split changes neither shape nor area.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from repro.fem import geometry
from repro.fem.geometry import FREE, Outline, Sizing, polygon_area


def shape(t: np.ndarray) -> np.ndarray:
    """(..., 3) the quadratic functions of corner, middle, corner at t in [0, 1]."""
    return np.stack([(1 - t) * (1 - 2 * t), 4 * t * (1 - t), t * (2 * t - 1)], axis=-1)


@dataclass(frozen=True, eq=False)
class Arcs(Outline):
    """An outline of parabolic arcs: extremes and area are those of the arcs, not of the polygon of its nodes."""

    @property
    def upstream(self) -> float:
        """Smallest x (um)."""
        return self._extremes[0]

    @property
    def downstream(self) -> float:
        """Largest x (um)."""
        return self._extremes[1]

    @property
    def thickness(self) -> float:
        """Largest y (um)."""
        return self._extremes[2]

    @property
    def highest(self) -> float:
        """x of the largest y (um)."""
        return self._extremes[3]

    @property
    def area(self) -> float:
        """Area inside (um2): the polygon of the corners, and two thirds of chord times height for each arc."""
        a, m, b = np.moveaxis(arcs(self.points), 1, 0)
        chord, bow = b - a, m - 0.5 * (a + b)
        return polygon_area(self.points[::2]) + float(2 / 3 * np.sum(bow[:, 0] * chord[:, 1] - bow[:, 1] * chord[:, 0]))

    @cached_property
    def _extremes(self) -> tuple[float, float, float, float]:
        nodes = arcs(self.points)
        slope, bend = slopes(nodes)
        flat = np.abs(bend) <= 1e-12 * np.ptp(self.points)
        t = np.clip(np.where(flat, 0.0, -slope / np.where(flat, 1.0, bend)), 0.0, 1.0).T[..., None]
        peaks = nodes[:, 0] + t * (slope + 0.5 * t * bend)
        x, y = np.concatenate([*peaks, self.points]).T
        return float(x.min()), float(x.max()), float(y.max()), float(x[y.argmax()])


def seed(radius: float, refinement: float) -> Arcs:
    """Half-disc of a radius (um) on the lower wall: middles on the arc too; its centre is fixed."""
    edges = max(6, 2 * int(np.ceil(np.pi / 2 * geometry.ACROSS_AGGREGATE * refinement)))
    angle = np.linspace(0.0, np.pi, 2 * edges + 1)
    arc = radius * np.column_stack([np.cos(angle), np.sin(angle)])
    arc[[0, -1], 1] = 0.0
    half = 2 * max(2, int(np.ceil(geometry.ACROSS_AGGREGATE * refinement)))
    base = np.linspace(-radius, radius, 2 * half + 1)
    base[half] = 0.0
    points = np.vstack([np.column_stack([base, 0.0 * base]), arc[1:-1]])
    wall = np.where(np.arange(len(points)) < len(base), geometry.BOTTOM, FREE)
    return Arcs(points, wall, np.arange(len(points)) == half, points.copy())


def corners(outline: Outline) -> Outline:
    """The polygon of the corners alone."""
    return Outline(*(part[::2] for part in (outline.points, outline.wall, outline.fixed, outline.origin)))


def arcs(values: np.ndarray) -> np.ndarray:
    """(M, 3, ...) nodes of each arc from values (2 M, ...) at all nodes."""
    ends = np.concatenate([values[2::2], values[:1]])
    return np.stack([values[::2], values[1::2], ends], axis=1)


def slopes(nodes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """First derivative by t at t = 0, and the second one, (M, ...) each, on arcs with nodes (M, 3, ...)."""
    first, middle, last = nodes[:, 0], nodes[:, 1], nodes[:, 2]
    return -3 * first + 4 * middle - last, 4 * (first - 2 * middle + last)


def split(outline: Outline, sizing: Sizing) -> Arcs:
    """The same curve with corners spaced as :func:`repro.fem.geometry.interface_sizes` wants them, and their middles.

    Arcs at the fluid are split into equal parts of their parameter, and never merged; straight contact surfaces get
    new nodes, but for their ends and the fixed points.
    """
    polygon = corners(outline)
    sizes, count = geometry.interface_sizes(polygon, sizing), len(polygon.points)
    pieces = []
    for first, last in geometry.runs(polygon):
        keep = np.arange(first, last + 1) % count
        if outline.wall[2 * keep[0] + 1] != FREE:
            pieces.append(_on_the_wall(outline, polygon, keep, sizes, sizing))
        else:
            parts = 2 * (len(geometry.split_parameters(polygon, keep, sizes)) - 1)
            pieces.append((np.full(parts, keep[0]), np.arange(parts) / parts))
    return _placed(outline, *(np.concatenate(columns) for columns in zip(*pieces)))


def halved(outline: Outline, which: np.ndarray) -> Arcs:
    """The same curve with some of its arcs, ``which`` (M,), cut at their middles."""
    parts = np.where(which, 4, 2)
    arc = np.repeat(np.arange(len(which)), parts)
    return _placed(outline, arc, (np.arange(len(arc)) - (np.cumsum(parts) - parts)[arc]) / parts[arc])


def _on_the_wall(outline: Outline, polygon: Outline, keep: np.ndarray, sizes: np.ndarray,
                 sizing: Sizing) -> tuple[np.ndarray, np.ndarray]:
    """Arc and t on it of corners and middles along a stretch of wall, but for its end."""
    free = polygon.wall == FREE
    ends = polygon.points[keep[[0, -1]]]
    x = geometry.graded_line(ends[0], ends[1], polygon.points[free], sizes[free], sizing)[:, 0]
    x = np.insert(x, np.arange(1, len(x)), 0.5 * (x[1:] + x[:-1]))
    sign = np.sign(x[-1] - x[0])
    arc = np.clip(np.searchsorted(sign * polygon.points[keep, 0], sign * x, side="right") - 1, 0, len(keep) - 2)
    nodes = arcs(outline.points)[keep[arc], :, 0]
    t = (x - nodes[:, 0]) / (nodes[:, 2] - nodes[:, 0])
    slope, bend = slopes(nodes)
    for _ in range(6):
        t = t - (np.einsum("ka,ka->k", shape(t), nodes) - x) / (slope + bend * t)
    t = np.clip(t, 0.0, 1.0)
    t[0] = 0.0
    return keep[arc[:-1]], t[:-1]


def _placed(outline: Outline, arc: np.ndarray, t: np.ndarray) -> Arcs:
    """New nodes (K,), each at t in [0, 1) of an arc: where t is zero the arc's own first corner."""
    first, corner, weight = t == 0, 2 * arc, shape(t)
    points, origin = (np.einsum("ka,kai->ki", weight, arcs(part)[arc]) for part in (outline.points, outline.origin))
    wall = np.where(first, outline.wall[corner], outline.wall[corner + 1])
    on = wall != FREE
    points[on, 1] = outline.points[corner[on], 1]
    points[first], origin[first] = outline.points[corner[first]], outline.origin[corner[first]]
    return Arcs(points, wall, first & outline.fixed[corner], origin)


def closing(outline: Arcs, width: float, film: float, angle: float) -> np.ndarray:
    """(2 M,) wall that each node must join next, FREE where none (2.3.3).

    Contact with the opposite wall begins over the film's least thickness to both sides of the highest place, as the
    paper's nodes make it: a single point could not hold the aggregate, whatever is enforced there. From then on each
    contact line that must advance does so by one arc: what joins pulls its neighbours along, and where it ends must not
    depend on how many are taken at once. A middle joins with both corners of its arc, never alone.
    """
    joins = geometry.closing_nodes(outline, width, film, angle)
    if (joins == FREE).all():
        return joins
    if (outline.wall == geometry.TOP).any() or not (joins == geometry.TOP).any():
        joins = _next_arcs(outline, joins)
    else:
        x, y = outline.points.T
        joins[(np.abs(x - outline.highest) <= film) & (width - y < 2 * film)] = geometry.TOP
    return _with_middles(outline, joins, width)


def _next_arcs(outline: Arcs, joins: np.ndarray) -> np.ndarray:
    """Of the nodes that must join, the first arc beside each contact line."""
    first = np.full(len(joins), FREE)
    for wall in (geometry.BOTTOM, geometry.TOP):
        for line, step in geometry.contact_lines(outline, wall):
            beside = (line + step * np.arange(1, 3)) % len(joins)
            if joins[beside[0]] == wall:
                first[beside] = np.where(outline.wall[beside] == FREE, wall, FREE)
    return first


def _with_middles(outline: Arcs, joins: np.ndarray, width: float) -> np.ndarray:
    """Middles join where both corners of their arc are on the wall; one that is too near brings its nearer corner."""
    gap = np.minimum(outline.points[:, 1], width - outline.points[:, 1])
    for middle in np.flatnonzero(joins[1::2] != FREE) * 2 + 1:
        ends = np.array([middle - 1, (middle + 1) % len(joins)])
        ends = ends[outline.wall[ends] == FREE]
        if len(ends):
            joins[ends[np.argmin(gap[ends])]] = joins[middle]
    joins[1::2] = FREE
    wall = np.where(joins != FREE, joins, outline.wall)
    both = wall[::2] == np.roll(wall, -2)[::2]
    joins[1::2] = np.where(both & (outline.wall[1::2] == FREE), wall[::2], FREE)
    return joins
