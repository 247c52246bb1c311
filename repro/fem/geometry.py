"""Geometry of the pore (paper 2, 3.1 and 2.3.3): aggregate outline, meshed extent, closing of thin films.

The channel is 0 <= y <= W, -L/2 <= x <= L/2; the origin is the centre of the seed on the lower wall. The boundary of
the aggregate is one closed polygon, counterclockwise. Each of its nodes is FREE (on the interface with the fluid),
or touches the lower (BOTTOM) or the upper wall (TOP). Lengths in um, angles in radians.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

FREE, BOTTOM, TOP = 0, 1, 2

#: Elements across half a pore's width and across the aggregate's thickness, and across the narrowest film.
ACROSS_PORE, ACROSS_AGGREGATE, ACROSS_FILM = 14.0, 10.0, 10.0
#: Growth of the element size with the distance from where it is prescribed; zero: one size everywhere.
GRADATION = 0.25
#: An interface edge is split when it is this much longer than the wanted size.
SPLIT = 1.4


@dataclass(frozen=True)
class Sizing:
    """How large the elements of a mesh are to be: width of the pore (um); refinement, by which sizes are divided; film,
    the thinnest that is resolved (um); gradation, growth of the size with the distance from where it is prescribed."""

    width: float
    refinement: float
    film: float
    gradation: float = GRADATION

    @property
    def largest(self) -> float:
        """The largest size (um): a fourteenth of the pore's width, divided by the refinement."""
        return self.width / ACROSS_PORE / self.refinement


@dataclass(frozen=True, eq=False)
class Outline:
    """Closed boundary polygon of the aggregate.

    points: (M, 2) um, counterclockwise; wall: (M,) FREE, BOTTOM or TOP; fixed: (M,) True where x is held for good;
    origin: (M, 2) um, where each node was at t = 0.
    """

    points: np.ndarray
    wall: np.ndarray
    fixed: np.ndarray
    origin: np.ndarray

    @property
    def upstream(self) -> float:
        """Smallest x (um)."""
        return float(self.points[:, 0].min())

    @property
    def downstream(self) -> float:
        """Largest x (um)."""
        return float(self.points[:, 0].max())

    @property
    def thickness(self) -> float:
        """Largest y (um): the paper's R_aggregate."""
        return float(self.points[:, 1].max())

    @property
    def area(self) -> float:
        """Area of the polygon (um2)."""
        return polygon_area(self.points)

    def edge_lengths(self) -> np.ndarray:
        """(M,) length (um) of the edge from node i to node i + 1."""
        return np.linalg.norm(np.roll(self.points, -1, axis=0) - self.points, axis=1)

    def interface_edges(self) -> np.ndarray:
        """(M,) True where the edge from node i to node i + 1 borders the fluid: its ends are not on one same wall."""
        after = np.roll(self.wall, -1)
        return (self.wall == FREE) | (self.wall != after)


def polygon_area(points: np.ndarray) -> float:
    """Signed area of a closed polygon, points (M, 2); positive counterclockwise."""
    x, y = points.T
    return float(0.5 * np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y))


def seed(radius: float, refinement: float = 1.0) -> Outline:
    """Half-disc of the given radius (um) on the lower wall, centred at the origin, which is its fixed point."""
    edges = 2 * int(np.ceil(np.pi / 2 * ACROSS_AGGREGATE * refinement))
    angle = np.linspace(0.0, np.pi, edges + 1)
    arc = radius * np.column_stack([np.cos(angle), np.sin(angle)])
    arc[[0, -1], 1] = 0.0
    half = max(2, int(np.ceil(ACROSS_AGGREGATE * refinement)))
    base = np.linspace(-radius, radius, 2 * half + 1)
    base[half] = 0.0
    points = np.vstack([np.column_stack([base, 0.0 * base]), arc[1:-1]])
    wall = np.where(np.arange(len(points)) < len(base), BOTTOM, FREE)
    fixed = np.arange(len(points)) == half
    return Outline(points, wall, fixed, points.copy())


def meshed_extent(outline: Outline | None, width: float, length: float, whole: bool = False) -> tuple[float, float]:
    """Ends (um) of the part to mesh when a mesh is generated (3.1).

    min(10 R, 1.5 W) from the aggregate on both sides, never past the pore's ends; a clean channel is meshed over 3 W.
    """
    if whole:
        return -length / 2, length / 2
    if outline is None:
        reach, first, last = 1.5 * width, 0.0, 0.0
    else:
        reach, first, last = min(10 * outline.thickness, 1.5 * width), outline.upstream, outline.downstream
    return max(first - reach, -length / 2), min(last + reach, length / 2)


def extent_too_short(outline: Outline, ends: tuple[float, float], width: float, length: float) -> bool:
    """Is the aggregate closer to an end of the mesh than min(7 R, 1.3 W), with pore left to mesh there (3.1)?"""
    reach = min(7 * outline.thickness, 1.3 * width)
    left = outline.upstream - ends[0] < reach and ends[0] > -length / 2
    right = ends[1] - outline.downstream < reach and ends[1] < length / 2
    return left or right


def interface_sizes(outline: Outline, sizing: Sizing) -> np.ndarray:
    """(M,) wanted element size (um) at each node of the outline.

    A tenth of the aggregate's thickness, a fourteenth of the pore's width, and for free nodes the film's size.
    """
    across = min(outline.thickness / ACROSS_AGGREGATE / sizing.refinement, sizing.largest)
    size = np.full(len(outline.points), across)
    return np.where(outline.wall == FREE, np.minimum(size, film_sizes(outline, sizing)), size)


def too_coarse(outline: Outline, sizing: Sizing) -> bool:
    """Is an interface edge twice longer than a new mesh would have it?"""
    sizes = interface_sizes(outline, sizing)
    wanted = 0.5 * (sizes + np.roll(sizes, -1))
    return bool((outline.interface_edges() & (outline.edge_lengths() > 2 * SPLIT * wanted)).any())


def film_sizes(outline: Outline, sizing: Sizing) -> np.ndarray:
    """(M,) wanted element size (um) in the fluid between each node and the opposite wall, while that is not touched.

    A tenth of its thickness; films thinner than the thinnest that is resolved count as that: they close.
    """
    if (outline.wall == TOP).any():
        return np.full(len(outline.points), np.inf)
    return np.maximum(sizing.width - outline.points[:, 1], sizing.film) / ACROSS_FILM / sizing.refinement


def size_sources(outline: Outline, sizing: Sizing) -> tuple[np.ndarray, np.ndarray]:
    """Where element sizes are prescribed, (K, 2) um, and how large, (K,) um.

    At the interface nodes and, across the fluid, on the opposite wall, so that a film has elements of one size.
    Interface edges that are shorter than wanted (they are never merged) are matched by what is around them.
    """
    free = outline.wall == FREE
    near, film = (find(outline, sizing)[free] for find in (interface_sizes, film_sizes))
    edge = outline.edge_lengths()
    near = np.minimum(near, SPLIT * np.maximum(edge, np.roll(edge, 1))[free])
    across = np.column_stack([outline.points[free, 0], np.full(len(near), sizing.width)])
    there = np.isfinite(film)
    return np.vstack([outline.points[free], across[there]]), np.concatenate([near, film[there]])


def graded_size(where: np.ndarray, sources: np.ndarray, sizes: np.ndarray, sizing: Sizing) -> np.ndarray:
    """Wanted element size (um) at points (K, 2): grows from the sizes (M,) of the sources (M, 2), up to the largest."""
    if len(sources) == 0:
        return np.full(len(where), sizing.largest)
    distance = np.hypot(where[:, None, 0] - sources[None, :, 0], where[:, None, 1] - sources[None, :, 1])
    return np.minimum(sizing.largest, (sizes + sizing.gradation * distance).min(axis=1))


def refine_outline(outline: Outline, sizes: np.ndarray, sizing: Sizing) -> Outline:
    """The same polygon with nodes spaced for a new mesh, as the sizes (M,) at its nodes (um) ask.

    Interface edges are split into equal parts, which keeps the area exactly, and never merged. Contact surfaces are
    straight, so their nodes are placed anew, but for their ends and the fixed points.
    """
    pieces = []
    for first, last in runs(outline):
        keep = np.arange(first, last + 1) % len(outline.points)
        on_wall = outline.wall[keep[0]] != FREE and outline.wall[keep[0]] == outline.wall[keep[-1]]
        t = _spread(outline, keep, sizes, sizing) if on_wall else split_parameters(outline, keep, sizes)
        pieces.append(_resample(outline, keep, t[:-1]))
    return Outline(*(np.concatenate(columns) for columns in zip(*pieces)))


def runs(outline: Outline) -> list[tuple[int, int]]:
    """Pieces (first, last) of the loop: single interface edges, and stretches of wall between ends or fixed points."""
    count = len(outline.points)
    free_edge = outline.interface_edges()
    breaks = free_edge | np.roll(free_edge, 1) | outline.fixed
    starts = np.flatnonzero(breaks)
    return list(zip(starts, np.append(starts[1:], starts[0] + count)))


def split_parameters(outline: Outline, keep: np.ndarray, sizes: np.ndarray) -> np.ndarray:
    """Parameters 0..1 along one interface edge."""
    length = np.linalg.norm(outline.points[keep[1]] - outline.points[keep[0]])
    wanted = 0.5 * (sizes[keep[0]] + sizes[keep[1]])
    return np.linspace(0.0, 1.0, max(1, int(np.ceil(length / (SPLIT * wanted)))) + 1)


def _spread(outline: Outline, keep: np.ndarray, sizes: np.ndarray, sizing: Sizing) -> np.ndarray:
    """Parameters 0..len - 1 along a stretch of wall, graded from the interface nodes."""
    free = outline.wall == FREE
    line = graded_line(outline.points[keep[0]], outline.points[keep[-1]], outline.points[free], sizes[free], sizing)
    x = outline.points[keep, 0]
    sign = np.sign(x[-1] - x[0])
    t = np.interp(sign * line[:, 0], sign * x, np.arange(len(keep)))
    t[[0, -1]] = 0, len(keep) - 1
    return t


def _resample(outline: Outline, keep: np.ndarray, t: np.ndarray) -> tuple[np.ndarray, ...]:
    """Points, wall, fixed and origin at parameters t along the nodes ``keep``: places linear between them, origins too
    or, between nodes of the seed's arc, on that arc: a straight edge of today's outline was round at t = 0, and what
    the material remembers makes it round again at the next update."""
    low = np.minimum(t.astype(int), len(keep) - 2)
    part = (t - low)[:, None]
    first, second = keep[low], keep[low + 1]
    mix = [a[first] + part * (a[second] - a[first]) for a in (outline.points, outline.origin)]
    on_node = part[:, 0] == 0
    same = outline.wall[first] == outline.wall[second]
    wall = np.where(on_node | same, outline.wall[first], FREE)
    return mix[0], wall, on_node & outline.fixed[first], _on_arc(mix[1], outline.origin[first], outline.origin[second])


def _on_arc(places: np.ndarray, first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Places (K, 2) between two points each, moved to their arc around the origin where both are as far from it."""
    radius, now = np.hypot(*first.T), np.hypot(*places.T)
    arc = np.isclose(radius, np.hypot(*second.T), rtol=1e-9, atol=0) & (places[:, 1] > 0)
    return places * np.where(arc, radius / np.where(arc, now, 1.0), 1.0)[:, None]


def graded_line(start, end, sources: np.ndarray, sizes: np.ndarray, sizing: Sizing) -> np.ndarray:
    """(K, 2) nodes from start to end, spaced as :func:`graded_size` asks; both ends included."""
    start, end = np.asarray(start, float), np.asarray(end, float)
    length = np.linalg.norm(end - start)
    s = np.linspace(0.0, 1.0, 401)
    density = length / graded_size(start + s[:, None] * (end - start), sources, sizes, sizing)
    count = np.concatenate([[0.0], np.cumsum(0.5 * (density[1:] + density[:-1]) * np.diff(s))])
    parts = max(1, int(np.ceil(count[-1] - 0.3)))
    t = np.interp(np.linspace(0.0, count[-1], parts + 1), count, s)
    t[[0, -1]] = 0.0, 1.0
    return start + t[:, None] * (end - start)


def closing_nodes(outline: Outline, width: float, film: float, angle: float) -> np.ndarray:
    """(M,) wall that each node must join next: FREE where none (2.3.3).

    A layer of fluid thinner than ``film`` to the opposite wall closes, and so does a wedge of fluid beside a contact
    surface whose angle is under ``angle``. Beside contact both say: the gap must not be less than the smaller of film
    and tan(angle) times the distance from the contact line. Nodes between closing ones close too: no fluid is trapped.
    """
    joins = np.full(len(outline.points), FREE)
    for wall, gap in ((BOTTOM, outline.points[:, 1]), (TOP, width - outline.points[:, 1])):
        lines = contact_lines(outline, wall)
        if wall == TOP and not lines:
            joins[(outline.wall == FREE) & (gap < film)] = TOP
        for line, step in lines:
            joins[_closing_run(outline, gap, line, step, film, np.tan(angle))] = wall
    return joins


def contact_lines(outline: Outline, wall: int) -> list[tuple[int, int]]:
    """(node, direction) of each end of a contact surface: the next node in that direction is not on the wall."""
    on = outline.wall == wall
    if not on.any():
        return []
    last = on & ~np.append(on[1:], on[0])
    first = on & ~np.append(on[-1], on[:-1])
    return [(int(i), 1) for i in np.flatnonzero(last)] + [(int(i), -1) for i in np.flatnonzero(first)]


def _closing_run(outline: Outline, gap: np.ndarray, line: int, step: int, film: float, slope: float) -> np.ndarray:
    """Free nodes from a contact line outwards, up to the last one with too little fluid between it and the wall."""
    count = len(gap)
    walk = (line + step * np.arange(1, count)) % count
    reach = np.flatnonzero(outline.wall[walk] != FREE)[0]
    walk, other = walk[:reach], walk[reach]  # the free nodes end there: on the same wall, the nearer line takes a node
    x, gaps = outline.points[:, 0], gap[walk]
    apart = x[walk] - x[line]
    nearer = (outline.wall[other] != outline.wall[line]) | (np.abs(apart) <= np.abs(x[walk] - x[other]))
    along = np.sign(x[line] - x[line - step]) * apart
    thin = (nearer & (gaps < 0)) | (gaps < np.minimum(film, slope * along))
    return walk[: np.flatnonzero(thin)[-1] + 1] if thin.any() else walk[:0]
