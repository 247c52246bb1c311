"""Element sizes, extent and outline nodes of a new mesh (3.1).

Lengths in um.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from math import inf

import numpy as np
from numpy.typing import ArrayLike

from repro.fem.outline import Outline, arc_derivatives, parabola
from repro.fem.walls import FREE, WELD, Walls, numbered, touched, whole_width, width_between

#: Number of elements across the pore's width, across the aggregate's thickness and across a film.
ACROSS_PORE = 14.0
ACROSS_AGGREGATE = 10.0
ACROSS_FILM = 10.0
#: Element size beside the contact lines of a new mesh, over the size at the end of a step. In
#: ``fast`` contact lengths err by 0.23, 0.02, 0.04 and 0.02 % with 3, by 0.29, 0.10, 0.06 and 0.12
#: % with 2, and by 2.4, 0.6, 0.8 and 0.5 % without smaller triangles (``growth-gold-contact``).
PARTS_OF_CONTACT = 3.0
#: The aggregate's thickness sets at most this number of elements along the interface, at refinement
#: 1. A half-disc has 31. A body more than 60 times longer than thick reaches the limit. With 200 or
#: 400, runs with a sliver fail at their first new mesh; with 4000, a step takes minutes.
ALONG_INTERFACE = 600.0
#: Growth of the element size with the distance from its source; zero: one size everywhere.
GRADATION = 0.25
#: In a mesh with contact lines on the opposite wall the sizes grow faster by this factor, because
#: the sizes at the lines decide the errors. In ``fast`` lengths err by 0.19, 0.00, 0.05 and 0.01 %
#: with 2, by 0.28, 0.02, 0.05 and 0.00 % with 3, and an aggregate has two thirds of the nodes that
#: it has with 1 (four contact elements, 2026-11-30).
CONTACT_GROWTH = 2.0
#: An interface edge is split if it is longer than the element size by this factor.
SPLIT = 1.4
#: Largest number of distances between points and sources in memory at once.
DISTANCES = 2**20


@dataclass(frozen=True)
class Sizing:
    """Element sizes of a mesh.

    walls: of the pore; refinement: divisor of the sizes; film: thickness (um) of the thinnest
    resolved film; gradation: growth of the size with the distance from its source; front: further
    divisor of the sizes at the aggregate, for a sharp front of the substrates; contact: size (um)
    beside the contact lines with the opposite wall, infinite if there is no limit; film_refinement:
    divisor of the sizes in films, ``refinement`` by default; others: outlines of the other
    aggregates.
    """

    walls: Walls
    refinement: float
    film: float
    gradation: float = GRADATION
    front: float = 1.0
    contact: float = inf
    film_refinement: float | None = None
    others: tuple[Outline, ...] = ()

    @property
    def width(self) -> float:
        """W, from wall to wall (um)."""
        return width_between(self.walls)

    @property
    def whole_width(self) -> float:
        """Width (um) of the pore: W, or 2 W if one wall is a plane of symmetry."""
        return whole_width(self.walls)

    def middle(self, outline: Outline) -> np.ndarray | None:
        """(2,) um, centre of an aggregate that was a half-disc at t = 0; None for another shape."""
        seat = outline.seat
        if seat.middle is None:
            return None
        return np.array([seat.middle, numbered(self.walls, seat.wall).y])

    @property
    def moving_lines(self) -> float:
        """Size (um) beside the contact lines with the opposite wall at the end of a step; infinite
        if ``contact`` is."""
        return self.contact / PARTS_OF_CONTACT

    @property
    def largest(self) -> float:
        """The largest size (um): a fourteenth of the pore's width, divided by the refinement."""
        return self.width / ACROSS_PORE / self.refinement


def meshed_extent(outline: Outline | None, width: float, length: float,
                  full: bool = False) -> tuple[float, float]:
    """x (um) of both ends of a new mesh (3.1).

    A mesh extends min(10 R, 1.5 W) beyond the aggregate on both sides, but not beyond the pore. A
    clean channel is meshed over 3 W. width: W (um) as :attr:`Sizing.whole_width`; length: of the
    pore (um); full: mesh the entire pore?
    """
    if full:
        return -length / 2, length / 2
    first, last = (0.0, 0.0) if outline is None else (outline.upstream, outline.downstream)
    reach = 1.5 * width if outline is None else min(10 * outline.thickness, 1.5 * width)
    return max(first - reach, -length / 2), min(last + reach, length / 2)


def extent_too_short(outline: Outline, ends: tuple[float, float], width: float,
                     length: float) -> bool:
    """Is the aggregate closer than min(7 R, 1.3 W) to an end of the mesh within the pore (3.1)?"""
    reach = min(7 * outline.thickness, 1.3 * width)
    left = outline.upstream - ends[0] < reach and ends[0] > -length / 2
    right = ends[1] - outline.downstream < reach and ends[1] < length / 2
    return left or right


def interface_sizes(outline: Outline, sizing: Sizing) -> np.ndarray:
    """(M,) element size (um) at each node of the outline.

    It is the smallest of these sizes: a tenth of the aggregate's thickness (or the length of the
    interface over ``ALONG_INTERFACE``, if larger), a fourteenth of the pore's width, the size for
    the film at free nodes, and the size beside contact lines with the opposite wall.
    """
    length = outline.edge_lengths()[outline.interface_edges()].sum()
    size = max(outline.thickness / ACROSS_AGGREGATE, length / ALONG_INTERFACE)
    across = min(size / sizing.refinement, sizing.largest)
    size = np.full(len(outline.points), across / sizing.front)
    size = np.minimum(size, _contact_sizes(outline, sizing))
    return np.where(outline.wall == FREE, np.minimum(size, film_sizes(outline, sizing)), size)


def _contact_sizes(outline: Outline, sizing: Sizing) -> np.ndarray | float:
    """(M,) size (um), growing with the distance from the contact lines with the opposite wall.

    Infinite without these lines.
    """
    on = _on_opposite(outline)
    if sizing.contact == inf or not on.any():
        return inf
    lines = outline.points[on & ~(np.roll(on, 1) & np.roll(on, -1))]
    distance = np.linalg.norm(outline.points[:, None] - lines, axis=2).min(axis=1)
    return sizing.contact + CONTACT_GROWTH * GRADATION * distance


def _on_opposite(outline: Outline) -> np.ndarray:
    """(M,) True for nodes on the opposite wall."""
    wall = touched(outline.wall)
    return (wall != FREE) & (wall != outline.seat.wall)


def with_contact_gradation(outlines: Sequence[Outline], sizing: Sizing) -> Sizing:
    """The sizes of a mesh around outlines, with the gradation of a mesh in contact if one of them
    touches the opposite wall."""
    if sizing.contact == inf or not any(_on_opposite(outline).any() for outline in outlines):
        return sizing
    return replace(sizing, gradation=CONTACT_GROWTH * sizing.gradation)


def too_coarse(outline: Outline, sizing: Sizing) -> bool:
    """Is an interface edge more than twice as long as in a new mesh?"""
    sizes = interface_sizes(outline, sizing)
    size = 0.5 * (sizes + np.roll(sizes, -1))
    return bool((outline.interface_edges() & (outline.edge_lengths() > 2 * SPLIT * size)).any())


def film_sizes(outline: Outline, sizing: Sizing) -> np.ndarray:
    """(M,) element size (um) of the films between each node and the walls without contact or the
    other aggregates.

    It is a tenth of the film's thickness over the films' refinement, but at least the size in the
    thinnest resolved film, because thinner films close.
    """
    films = [wall.film(outline.points) for wall in outline.untouched(sizing.walls)]
    films += [other.distances(outline.points) for other in sizing.others]
    sizes = [_film_sizes(film, sizing) for film in films]
    return np.min([np.full(len(outline.points), inf), *sizes], axis=0)


def _film_sizes(film: np.ndarray, sizing: Sizing) -> np.ndarray:
    """(M,) element size (um) in films of a thickness (M,) um."""
    size = np.maximum(film, sizing.film) / ACROSS_FILM
    return size / (sizing.film_refinement or sizing.refinement)


def each_beside(outlines: Sequence[Outline], sizing: Sizing) -> Iterator[tuple[Outline, Sizing]]:
    """Each outline with its element sizes, which depend on the corners of the other outlines."""
    for outline in outlines:
        others = tuple(other.corners for other in outlines if other is not outline)
        yield outline, replace(sizing, others=sizing.others + others)


def size_sources(outline: Outline, sizing: Sizing) -> tuple[np.ndarray, np.ndarray]:
    """Points (K, 2) um with prescribed element sizes, and the sizes (K,) um.

    The points are the interface nodes and the opposite points on walls without contact, so that
    elements have the same size on both sides of a film. Short interface edges are never merged, so
    the elements around them are small too.
    """
    free = touched(outline.wall) == FREE
    near = interface_sizes(outline, sizing)[free]
    edge = outline.edge_lengths()
    near = np.minimum(near, SPLIT * np.maximum(edge, np.roll(edge, 1))[free])
    sources = [outline.points[free]]
    sizes = [near]
    for wall in outline.untouched(sizing.walls):
        sources.append(np.column_stack([outline.points[free, 0], np.full(len(near), wall.y)]))
        sizes.append(_film_sizes(wall.film(outline.points), sizing)[free])
    return np.vstack(sources), np.concatenate(sizes)


def graded_size(where: np.ndarray, sources: np.ndarray, sizes: np.ndarray,
                sizing: Sizing) -> np.ndarray:
    """Element size (um) at points (K, 2).

    It grows from the sizes (M,) at the sources (M, 2), up to the largest size.
    """
    if len(sources) == 0:
        return np.full(len(where), sizing.largest)
    parts = max(1, len(where) * len(sources) // DISTANCES)
    grown = [_nearest_size(part, sources, sizes, sizing) for part in np.array_split(where, parts)]
    return np.minimum(sizing.largest, np.concatenate(grown))


def _nearest_size(where: np.ndarray, sources: np.ndarray, sizes: np.ndarray,
                  sizing: Sizing) -> np.ndarray:
    """(N,) um: the smallest of the sizes that grow from the sources."""
    x, y = where.T
    distance = np.hypot(x[:, None] - sources[:, 0], y[:, None] - sources[:, 1])
    return (sizes + sizing.gradation * distance).min(axis=1)


def split(outline: Outline, sizing: Sizing) -> Outline:
    """The same curve with corners spaced by :func:`interface_sizes`.

    Interface edges are split into equal parts and never merged, so shape and area stay unchanged.
    Contact surfaces are straight: they keep only their ends and fixed points, and get new nodes.
    """
    polygon = outline.corners
    sizes = interface_sizes(polygon, sizing)
    edge_wall = outline.edge_wall
    pieces = []
    for first, last in runs(outline):
        keep = np.arange(first, last + 1) % len(polygon.points)
        if edge_wall[keep[0]] >= WELD:  # both aggregates share the nodes of a weld
            halves = np.arange(outline.geometry) / outline.geometry
            pieces.append((np.repeat(keep[:-1], len(halves)), np.tile(halves, len(keep) - 1)))
        elif edge_wall[keep[0]] != FREE:
            pieces.append(_on_the_wall(outline, keep, sizes, sizing))
        else:
            parts = outline.geometry * split_count(polygon, keep, sizes)
            pieces.append((np.full(parts, keep[0]), np.arange(parts) / parts))
    edges, t = zip(*pieces)
    return placed(outline, np.concatenate(edges), np.concatenate(t),
                  sizing.middle(outline))


def cut(outline: Outline, places: Sequence[tuple[int, float]]) -> Outline:
    """The same curve with further corners; places: (edge, t) with t in (0, 1)."""
    if not places:
        return outline
    edges = len(outline.points) // outline.geometry
    edge, t = zip(*sorted([*((edge, 0.0) for edge in range(edges)), *places]))
    return with_corners(outline, np.array(edge), np.array(t))


def with_corners(outline: Outline, edge: np.ndarray, t: np.ndarray) -> Outline:
    """The same curve with corners (K,), each at t in [0, 1) of an edge, and with the middles of its
    arcs.

    edge: (K,) numbers of edges, ascending. Each edge begins with a corner, at t = 0.
    """
    after = np.append(t[1:], 0.0)
    places = outline.element.along(t, np.where(after > t, after, 1.0))
    return placed(outline, np.repeat(edge, outline.geometry), places.ravel())


def runs(outline: Outline) -> list[tuple[int, int]]:
    """Pieces (first, last corner) of the loop: single interface edges, and stretches of contact.

    Stretches end at contact lines, fixed points and sharp corners of the shape at t = 0.
    """
    polygon = outline.corners
    count = len(polygon.points)
    free_edge = polygon.interface_edges()
    breaks = free_edge | np.roll(free_edge, 1) | polygon.fixed | outline.corners_at_start
    starts = np.flatnonzero(breaks)
    return list(zip(starts, np.append(starts[1:], starts[0] + count)))


def split_count(outline: Outline, keep: np.ndarray, sizes: np.ndarray) -> int:
    """Number of equal parts of the edge between the two nodes ``keep``, for sizes (M,) um."""
    length = np.linalg.norm(outline.points[keep[1]] - outline.points[keep[0]])
    size = 0.5 * (sizes[keep[0]] + sizes[keep[1]])
    return max(1, int(np.ceil(length / (SPLIT * size))))


def _on_the_wall(outline: Outline, keep: np.ndarray, sizes: np.ndarray,
                 sizing: Sizing) -> tuple[np.ndarray, np.ndarray]:
    """Edge and t of each new node along a stretch of contact, without the stretch's last node.

    The nodes are graded from the interface.
    """
    polygon = outline.corners
    free = polygon.wall == FREE
    ends = polygon.points[keep[[0, -1]]]
    x = graded_line(ends[0], ends[1], polygon.points[free], sizes[free], sizing)[:, 0]
    x = np.append(outline.element.along(x[:-1], x[1:]), x[-1])
    sign = np.sign(x[-1] - x[0])
    place = np.searchsorted(sign * polygon.points[keep, 0], sign * x, side="right") - 1
    edge = keep[np.clip(place, 0, len(keep) - 2)]
    t = _parameters(outline.arcs(outline.points)[edge, :, 0], x)
    return edge[:-1], t[:-1]


def _parameters(nodes: np.ndarray, x: np.ndarray) -> np.ndarray:
    """(K,) t in [0, 1] at which arcs along the wall have the coordinates x (K,); the first is zero.

    nodes: (K, 3) um, x of the arcs' nodes.
    """
    t = (x - nodes[:, 0]) / (nodes[:, 2] - nodes[:, 0])
    first, second = arc_derivatives(nodes)
    for _ in range(6):
        t = t - (np.einsum("ka,ka->k", parabola(t), nodes) - x) / (first + second * t)
    t = np.clip(t, 0.0, 1.0)
    t[0] = 0.0
    return t


def placed(outline: Outline, edge: np.ndarray, t: np.ndarray,
           seed: np.ndarray | None = None) -> Outline:
    """Place nodes (K,), each at t in [0, 1) of an edge; t = 0 is the edge's first corner.

    edge: (K,) numbers of edges; seed: as :meth:`Sizing.middle`. If an edge was straight at t = 0
    between two points of the seed's arc, a new node gets an origin on this arc: the edge stands for
    the arc, and the elastic stress makes it round at the next update.
    """
    first = t == 0
    corner = outline.geometry * edge
    arcs = outline.arcs(outline.origin)[edge]
    points, origin = (np.einsum("ka,kai->ki", parabola(t), nodes)
                      for nodes in (outline.arcs(outline.points)[edge], arcs))
    if seed is not None:
        a, middle, b = arcs.transpose(1, 0, 2)
        straight = (middle == 0.5 * (a + b)).all(axis=1)[:, None]
        origin = np.where(straight, seed + _on_arc(origin - seed, a - seed, b - seed), origin)
    wall = np.where(first, outline.wall[corner], outline.edge_wall[edge])
    on = touched(wall) != FREE
    points[on, 1] = outline.points[corner[on], 1]
    points[first] = outline.points[corner[first]]
    origin[first] = outline.origin[corner[first]]
    return replace(outline, points=points, wall=wall, fixed=first & outline.fixed[corner],
                   origin=origin)


def _on_arc(places: np.ndarray, first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Move each of points (K, 2) to the arc around (0, 0) through its neighbours.

    first, second: (K, 2) neighbours. A point does not move if it is on the wall, or if its
    neighbours have different distances from (0, 0).
    """
    radius = np.hypot(*first.T)
    distance = np.hypot(*places.T)
    arc = np.isclose(radius, np.hypot(*second.T), rtol=1e-9, atol=0) & (places[:, 1] != 0)
    return places * np.where(arc, radius / np.where(arc, distance, 1.0), 1.0)[:, None]


def graded_line(start: ArrayLike, end: ArrayLike, sources: np.ndarray, sizes: np.ndarray,
                sizing: Sizing) -> np.ndarray:
    """(K, 2) nodes from start to end, spaced by :func:`graded_size`; both ends included."""
    first = np.asarray(start, float)
    way = np.asarray(end, float) - first
    s = np.linspace(0.0, 1.0, 401)
    size = graded_size(first + s[:, None] * way, sources, sizes, sizing)
    density = np.linalg.norm(way) / size
    count = np.concatenate([[0.0], np.cumsum(0.5 * (density[1:] + density[:-1]) * np.diff(s))])
    parts = max(1, int(np.ceil(count[-1] - 0.3)))
    t = np.interp(np.linspace(0.0, count[-1], parts + 1), count, s)
    t[[0, -1]] = 0.0, 1.0
    return first + t[:, None] * way
