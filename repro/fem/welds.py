"""Welded aggregates: their boundaries share the nodes of the weld.

Nodes of a weld have its number in both outlines, and the same coordinates to the last bit. The
first weld has the number WELD. An aggregate may have several welds (:func:`pairs`). Each outline
keeps its own coordinates at t = 0. An end of the weld is a line where the free surfaces of
both aggregates meet and form a notch, or the wall of both aggregates if they share it. The corners
of the two surfaces are opposite: the k-th corner from the line on one surface is at about the same
arc length as the k-th corner on the other surface. A new mesh gives both surfaces these corners
(:func:`matched`), so that the weld can advance by nodes.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import combinations

import numpy as np

from repro.errors import MeshError
from repro.fem import sizing as sizes_of
from repro.fem.elements import ON_ARC
from repro.fem.outline import Outline, area_beside_chord, parabola
from repro.fem.sizing import Sizing, cut, placed
from repro.fem.walls import FREE, WELD, Wall, touched

#: Corners of the two surfaces are opposite if their arc lengths from the line differ by at most
#: this part of the shortest edge beside them. Below 1/2, no corner has two opposite corners.
OPPOSITE = 0.3
#: The same part for corners that a new mesh has made opposite. It is larger because their arc
#: lengths change with growth.
STILL_OPPOSITE = 0.6
#: A new mesh makes corners opposite where the film is thinner than this times the least film.
MATCHED_FILMS = 3.0
#: Least element size beside the line, over the least film. With 1/80, ``exact`` finds no
#: equilibrium.
FINEST = 0.125
#: A point counts as the corner if its distance from it is less than this part of the arc.
AT_CORNER = 0.05
#: Rounds of the search for the nearest points of two outlines. Each round divides the interval by
#: four.
ROUNDS = 12


def welds_of(wall: np.ndarray) -> set[int]:
    """Numbers of the welds of an aggregate; wall: (M,) as :attr:`Outline.wall`."""
    return set((wall - touched(wall)).tolist()) - {FREE}


def pairs(walls: Sequence[np.ndarray]) -> list[tuple[int, int]]:
    """Indices of the two aggregates of each weld; walls: (M,) :attr:`Outline.wall` of each."""
    of = [welds_of(wall) for wall in walls]
    return [(first, second) for first, second in combinations(range(len(of)), 2)
            if of[first] & of[second]]


def common(first: Outline, second: Outline) -> int:
    """Number of the weld of two outlines."""
    weld, = welds_of(first.wall) & welds_of(second.wall)
    return weld


def shared_points(outlines: Sequence[Outline]) -> tuple[np.ndarray, list[np.ndarray]]:
    """(K, 2) um, the points of all outlines, with the points of a weld once; and for each outline,
    (M,) indices of its points."""
    numbers: dict[tuple[float, ...], int] = {}
    own = [np.array([numbers.setdefault(tuple(point), len(numbers))
                     for point in outline.points.tolist()]) for outline in outlines]
    return np.array(list(numbers)), own


def united(outlines: Sequence[Outline],
           own: Sequence[np.ndarray]) -> tuple[list[Outline], list[np.ndarray]]:
    """Replace each two welded outlines by the outline around both; others stay unchanged.

    own: as :func:`shared_points` returns it. Returns the outlines, and ``own`` for them. Raises
    MeshError if two aggregates share more than one chain of nodes.
    """
    left = dict(enumerate(zip(outlines, own)))
    part_of = list(left)
    for first, second in pairs([outline.wall for outline in outlines]):
        if np.isin(own[first], own[second]).any():  # not if they have just met
            whole, part = sorted([part_of[first], part_of[second]])
            left[whole] = _around(left[whole], left.pop(part))
            part_of = [whole if each == part else each for each in part_of]
    return [outline for outline, _ in left.values()], [nodes for _, nodes in left.values()]


def around(outlines: Sequence[Outline]) -> Outline:
    """The outline around an aggregate, or around all aggregates that are welded to each other."""
    (outline,), _ = united(outlines, shared_points(outlines)[1])
    return outline


def _around(one: tuple[Outline, np.ndarray],
            other: tuple[Outline, np.ndarray]) -> tuple[Outline, np.ndarray]:
    """The outline around two welded ones, each with the indices (M,) of its points."""
    first, first_own = one
    second, second_own = other
    weld = np.isin(first_own, second_own)
    starts = np.flatnonzero(weld & ~np.roll(weld, 1))
    if len(starts) != 1:
        raise MeshError("two aggregates touch at several places; a weld joins them at one place")
    size = int(weld.sum())
    around = (starts[0] + size - 1 + np.arange(len(weld) - size + 2)) % len(weld)
    of_second = np.isin(second_own, first_own)
    begin = int(np.flatnonzero(of_second & ~np.roll(of_second, 1))[0]) + size
    beyond = (begin + np.arange(len(of_second) - size)) % len(of_second)
    wall = np.concatenate([first.wall[around], second.wall[beyond]])
    both = Outline(np.concatenate([first.points[around], second.points[beyond]]),
                   touched(wall),
                   np.concatenate([first.fixed[around], second.fixed[beyond]]),
                   np.concatenate([first.origin[around], second.origin[beyond]]),
                   first.geometry, first.seat)
    return both, np.concatenate([first_own[around], second_own[beyond]])


def ends_of(outline: Outline, weld: int) -> tuple[int, int]:
    """The first and the last node of one of an outline's welds, along its loop."""
    on = outline.welded(weld)
    first = np.flatnonzero(on & ~np.roll(on, 1))[0]
    last = np.flatnonzero(on & ~np.roll(on, -1))[0]
    return int(first), int(last)


def notches(first: Outline, second: Outline) -> list[tuple[np.ndarray, np.ndarray]]:
    """For each end of a weld off the walls, the free nodes (k,) of either outline beyond the line.

    The node of the line comes first.
    """
    weld = common(first, second)
    start, end = ends_of(first, weld)
    begin, last = ends_of(second, weld)
    both = [(_free_from(first, end, 1), _free_from(second, begin, -1)),
            (_free_from(first, start, -1), _free_from(second, last, 1))]
    return [walks for walks in both if all(len(walk) > 1 for walk in walks)]


def _free_from(outline: Outline, node: int, direction: int) -> np.ndarray:
    """The node, and the free nodes after it in a direction along the loop, up to a corner."""
    walk = outline.free_walk(node, direction)[:-1]
    return walk[: len(walk) - (len(walk) - 1) % outline.geometry]


def lengths_from(outline: Outline, walk: np.ndarray) -> np.ndarray:
    """(c,) um, arc length from the first of the consecutive nodes ``walk`` to each corner."""
    return _lengths(outline, walk)[::ON_ARC]


def _lengths(outline: Outline, walk: np.ndarray) -> np.ndarray:
    """(p,) um, arc length from the first of the consecutive nodes ``walk`` to ON_ARC points on each
    arc. The last of these points is the arc's end."""
    nodes = outline.points[walk]
    arcs = np.stack([nodes[:-2:2], nodes[1:-1:2], nodes[2::2]], axis=1)
    points = np.einsum("ta,kai->kti", parabola(np.linspace(0, 1, ON_ARC + 1)), arcs)
    pieces = np.linalg.norm(np.diff(points, axis=1), axis=2)
    return np.concatenate([[0.0], np.cumsum(pieces)])


def opposite(one: np.ndarray, other: np.ndarray, part: float = OPPOSITE) -> np.ndarray:
    """(c, d) True where a corner of one surface is opposite a corner of the other surface.

    one, other: (c,) and (d,) um, arc lengths of the corners from the line; part: like OPPOSITE.
    """
    apart = np.abs(one[:, None] - other)
    return apart <= part * np.minimum(_shortest(one)[:, None], _shortest(other))


def _shortest(lengths: np.ndarray) -> np.ndarray:
    """(c,) um, the shorter of the edges beside each corner."""
    edges = np.concatenate([[np.inf], np.diff(lengths), [np.inf]])
    return np.minimum(edges[:-1], edges[1:])


def _of_each_pair(change: Callable[[Sequence[Outline], Sizing], Sequence[Outline]],
                  outlines: Sequence[Outline], sizing: Sizing) -> list[Outline]:
    """The outlines after a ``change`` of each two that are welded."""
    changed = list(outlines)
    for pair in pairs([outline.wall for outline in outlines]):
        others = tuple(each.corners for k, each in enumerate(changed) if k not in pair)
        welded = change([changed[k] for k in pair], replace(sizing, others=others))
        for k, outline in zip(pair, welded):
            changed[k] = outline
    return changed


def matched(outlines: Sequence[Outline], sizing: Sizing) -> list[Outline]:
    """The same curves with opposite corners beyond each weld, and short edges at its ends."""
    return _of_each_pair(_matched, outlines, sizing)


def _matched(outlines: Sequence[Outline], sizing: Sizing) -> list[Outline]:
    """:func:`matched` for two welded outlines."""
    return _with_opposite(_refined(outlines, sizing), sizing.film)


def coarsened(outlines: Sequence[Outline], sizing: Sizing) -> list[Outline]:
    """The outlines of welded aggregates with fewer corners along each weld and beyond its ends.

    A corner leaves if the edge without it needs no split, or if it is too close to another one.
    Opposite corners leave together. Element sizes grow from the lines to the size of an interface.
    Corners of the shapes at t = 0 stay. The middle of a longer arc is a point of the curve.
    Outlines that have just met have a weld of one node, and stay unchanged.
    """
    return _of_each_pair(_coarsened, outlines, sizing)


def _coarsened(outlines: Sequence[Outline], sizing: Sizing) -> list[Outline]:
    """:func:`coarsened` for two welded outlines."""
    if np.count_nonzero(outlines[0].welded(common(*outlines))) == 1:
        return list(outlines)
    outlines = _matched(outlines, sizing)
    for place in range(len(notches(*outlines))):
        walks = in_notch(outlines, notches(*outlines)[place], sizing.film)
        lengths = lengths_from(outlines[0], walks[0])
        merged = _without_small_edges(outlines, walks, np.maximum(lengths - sizing.film, 0.0),
                                      sizing)
        if _opens(notches(*merged)[place], merged):
            outlines = merged
    along = _along_weld(*outlines)
    s = lengths_from(outlines[0], along[0])
    first, second = _without_small_edges(outlines, along, np.minimum(s, s[-1] - s), sizing)
    on_first, on_second = _along_weld(first, second)
    points = second.points.copy()
    points[on_second] = first.points[on_first]
    return [first, replace(second, points=points)]


def _opens(walks: Sequence[np.ndarray], outlines: Sequence[Outline]) -> bool:
    """Do the first arcs of a notch leave the line without crossing? Arcs that replace several may
    cross there, because their directions differ from those of the old ones."""
    chords, directions = [], []
    for outline, walk in zip(outlines, walks):
        line, middle, end = outline.points[walk[:3]]
        chords.append(end - line)
        directions.append(4 * middle - 3 * line - end)
    return bool(np.linalg.det(chords) * np.linalg.det(directions) > 0)


def _without_small_edges(outlines: Sequence[Outline], walks: Sequence[np.ndarray],
                         from_line: np.ndarray, sizing: Sizing) -> list[Outline]:
    """The outlines without small edges along ``walks``, nodes of opposite corners and middles.

    from_line: (c,) um, distances of these corners from the line.
    """
    if len(from_line) < 3:
        return list(outlines)
    corners = [walk[::2] // 2 for walk in walks]
    own = [sizes_of.interface_sizes(outline.corners, beside)[at]
           for at, (outline, beside) in zip(corners, sizes_of.each_beside(outlines, sizing))]
    sizes = np.min([_line_size(sizing) + sizes_of.GRADATION * from_line, *own], axis=0)
    sharp = np.any([outline.corners_at_start[at] for outline, at in zip(outlines, corners)], axis=0)
    kept = _kept(lengths_from(outlines[0], walks[0]), sizes, sharp)
    return [_merged(*each, kept) for each in zip(outlines, walks)]


def _along_weld(first: Outline, second: Outline) -> tuple[np.ndarray, np.ndarray]:
    """(n,) nodes of the weld in either outline, in the order of the first one's loop."""
    weld = common(first, second)
    start, end = ends_of(first, weld)
    _, last = ends_of(second, weld)
    steps = np.arange((end - start) % len(first.points) + 1)
    return (start + steps) % len(first.points), (last - steps) % len(second.points)


def _kept(lengths: np.ndarray, sizes: np.ndarray, sharp: np.ndarray) -> list[int]:
    """Numbers of the corners of a weld that stay.

    lengths: (c,) um, arc lengths of the corners from the first one; sizes: (c,) um; sharp: (c,)
    True where a corner must stay.
    """
    kept = [0]
    for number in range(1, len(lengths) - 1):
        size = 0.5 * (sizes[kept[-1]] + sizes[number + 1])
        before, edge = lengths[[number, number + 1]] - lengths[kept[-1]]
        small = edge <= sizes_of.SPLIT * size or before < OPPOSITE * size
        if sharp[number] or not small:
            kept.append(number)
    return [*kept, len(lengths) - 1]


def _merged(outline: Outline, walk: np.ndarray, kept: Sequence[int]) -> Outline:
    """The outline with those corners of the consecutive nodes ``walk`` that have the numbers
    ``kept``. A longer arc has the area of the arcs that it replaces."""
    lengths = lengths_from(outline, walk)
    edge, half = np.divmod(np.arange(len(outline.points)), 2)
    t = half / 2
    stays = np.ones(len(edge), bool)
    longer = {}
    for first, last in zip(kept, kept[1:]):
        if last > first + 1:
            old = outline.points[walk[2 * first: 2 * last + 1]]
            middle, *others = walk[2 * first + 1: 2 * last]
            stays[others] = False
            half_way = lengths[[first, last]].mean(keepdims=True)
            (edge[middle], t[middle]), = _places(outline, walk, half_way)
            longer[middle] = old
    merged = placed(outline, edge[stays], t[stays])
    points = merged.points.copy()
    for middle, old in longer.items():
        new = np.count_nonzero(stays[:middle])
        chord = old[-1] - old[0]
        arc = np.array([old[0], points[new], old[-1]])
        missing = (area_beside_chord(old) - area_beside_chord(arc)) / (chord @ chord)
        points[new] += 1.5 * missing * np.array([chord[1], -chord[0]])
    return replace(merged, points=points)


def _with_opposite(outlines: Sequence[Outline], film: float) -> list[Outline]:
    """The same curves with opposite corners beyond a weld; film: the least film, um."""
    cuts: tuple[list, list] = ([], [])
    for walks in notches(*outlines):
        lengths = [lengths_from(outline, walk) for outline, walk in zip(outlines, walks)]
        reach = _reach(outlines, walks, lengths, MATCHED_FILMS * film)
        pairs = opposite(lengths[0], lengths[1])
        for number, missing in enumerate([~pairs.any(axis=0), ~pairs.any(axis=1)]):
            s = lengths[1 - number][missing]
            s = s[(s <= reach) & (s < lengths[number][-1])]
            cuts[number].extend(_places(outlines[number], walks[number], s))
    return [cut(outline, places) for outline, places in zip(outlines, cuts)]


def _refined(outlines: Sequence[Outline], sizing: Sizing) -> list[Outline]:
    """The same curves with the edges beyond a weld divided into equal parts.

    Up to the length of the least film from the line, parts are at most as long as
    :func:`_line_size`. From there on they grow.
    """
    cuts: tuple[list, list] = ([], [])
    for walks in notches(*outlines):
        for outline, walk, cut_at in zip(outlines, walks, cuts):
            lengths = lengths_from(outline, walk)
            beyond = np.maximum(lengths - sizing.film, 0.0)
            sizes = _line_size(sizing) + sizes_of.GRADATION * beyond
            size = 0.5 * (sizes[:-1] + sizes[1:])
            parts = np.maximum(1, np.ceil(np.diff(lengths) / (sizes_of.SPLIT * size))).astype(int)
            for start, end, count in zip(lengths, lengths[1:], parts):
                cut_at.extend(_places(outline, walk, np.linspace(start, end, count + 1)[1:-1]))
    return [cut(outline, places) for outline, places in zip(outlines, cuts)]


def _line_size(sizing: Sizing) -> float:
    """Size (um) of the elements beside the ends of a weld."""
    return max(sizing.contact, FINEST * sizing.film)


def in_notch(outlines: Sequence[Outline], walks: Sequence[np.ndarray],
             film: float) -> list[np.ndarray]:
    """The first nodes of ``walks`` on both outlines. They end where corners are no longer opposite,
    or where the film between them exceeds MATCHED_FILMS times ``film`` (um), the least one."""
    lengths = [lengths_from(outline, walk) for outline, walk in zip(outlines, walks)]
    reach = _reach(outlines, walks, lengths, MATCHED_FILMS * film)
    count = min(opposite_corners(*lengths), int(np.count_nonzero(lengths[0] <= reach)))
    return [walk[: 2 * count - 1] for walk in walks]


def opposite_corners(one: np.ndarray, two: np.ndarray) -> int:
    """Number of consecutive pairs of opposite corners; the line is the first pair.

    one, two: (c,) and (d,) um, arc lengths of the corners of both surfaces from the line.
    """
    count = min(len(one), len(two))
    pairs = np.diagonal(opposite(one, two, STILL_OPPOSITE))[:count]
    return count if pairs.all() else int(np.argmin(pairs))


def _reach(outlines: Sequence[Outline], walks: Sequence[np.ndarray],
           lengths: Sequence[np.ndarray], thick: float) -> float:
    """Arc length (um) from the line at which the film becomes thicker than ``thick`` (um)."""
    one, two = (outline.points[walk[:: outline.geometry]]
                for outline, walk in zip(outlines, walks))
    beside = np.column_stack([np.interp(lengths[0], lengths[1], two[:, axis]) for axis in (0, 1)])
    apart = np.linalg.norm(one - beside, axis=1)
    wide = (apart > thick) | (lengths[0] > lengths[1][-1])
    return float(lengths[0][np.argmax(wide)] if wide.any() else lengths[0][-1])


def _places(outline: Outline, walk: np.ndarray, s: np.ndarray) -> list[tuple[int, float]]:
    """(arc, t) of the points at arc lengths s (k,) um from the first of the nodes ``walk``."""
    lengths = _lengths(outline, walk)
    corners = walk[::2] // 2
    arcs = len(outline.points) // 2
    forward = (corners[1] - corners[0]) % arcs == 1
    places = np.interp(s, lengths, np.arange(len(lengths)) / ON_ARC)
    t, k = np.modf(places)
    return [(int(corners[each]), part) if forward else (int(corners[each] - 1) % arcs, 1 - part)
            for each, part in zip(k.astype(int), t.tolist())]


def facing(first: Outline, second: Outline, reach: float, weld: int = WELD,
           wall: int = FREE) -> list[Outline]:
    """The same curves with new corners: one at the point nearest to the other curve, marked as a
    weld with the number ``weld``, and one at the arc length ``reach`` (um) on each side of it.

    wall: number of a wall that both aggregates touch. The points are then the contact lines with
    this wall that face each other.
    """
    places = _nearest(first, second) if wall == FREE else (
        [_line_beside(first, second, wall), _line_beside(second, first, wall)])
    outlines = []
    for outline, place in zip((first, second), places):
        outline, node = _with_corner(outline, place)
        numbers = outline.wall.copy()
        numbers[node] += weld
        outlines.append(_with_sides(replace(outline, wall=numbers), node, reach))
    return outlines


def landing(outline: Outline, wall: Wall, reach: float) -> tuple[Outline, np.ndarray]:
    """The same curve with new corners: one at the point nearest to a wall, and one at the arc
    length ``reach`` (um) on each side of it. Also returns this point (2,) um."""
    t = np.linspace(0, 1, 65)
    film = wall.film(np.einsum("ta,kai->kti", parabola(t), outline.arcs(outline.points)))
    edge, part = np.unravel_index(np.argmin(film), film.shape)
    outline, node = _with_corner(outline, (int(edge), float(t[part])))
    return _with_sides(outline, node, reach), outline.points[node]


def _with_corner(outline: Outline, place: tuple[int, float]) -> tuple[Outline, int]:
    """The same curve with a corner at (edge, t), and its node."""
    edge, t = place
    if AT_CORNER < t < 1 - AT_CORNER:
        return cut(outline, [place]), outline.geometry * (edge + 1)
    edges = len(outline.points) // outline.geometry
    return outline, outline.geometry * ((edge + round(t)) % edges)


def _with_sides(outline: Outline, node: int, reach: float) -> Outline:
    """The same curve with a corner at the arc length ``reach`` (um) on each side of a node."""
    sides = [_free_from(outline, node, direction) for direction in (1, -1)]
    return cut(outline, [place for walk in sides if len(walk) > 1
                         for place in _places(outline, walk, np.array([reach]))])


def _line_beside(outline: Outline, other: Outline, wall: int) -> tuple[int, float]:
    """(edge, t) of the contact line with a wall that is nearest to another outline."""
    on = np.flatnonzero(outline.touches(wall))
    apart = np.abs(outline.points[on, 0] - other.points[other.touches(wall), 0].mean())
    return int(on[np.argmin(apart)]) // outline.geometry, 0.0


def _nearest(first: Outline, second: Outline) -> list[tuple[int, float]]:
    """(edge, t) of the point of each outline that is nearest to the other one."""
    arcs = [outline.arcs(outline.points) for outline in (first, second)]
    t = np.linspace(0, 1, 17)
    one, two = (np.einsum("ta,kai->kti", parabola(t), each).reshape(-1, 2) for each in arcs)
    apart = np.linalg.norm(one[:, None] - two, axis=2)
    numbers = [int(number) for number in np.unravel_index(np.argmin(apart), apart.shape)]
    edges = [number // len(t) for number in numbers]
    middle = np.array([t[number % len(t)] for number in numbers])
    width = 1 / 16
    for _ in range(ROUNDS):
        trials = np.clip(middle[:, None] + width * np.linspace(-1, 1, 17), 0, 1)
        one, two = (parabola(trial) @ each[edge]
                    for trial, each, edge in zip(trials, arcs, edges))
        apart = np.linalg.norm(one[:, None] - two, axis=2)
        place = np.unravel_index(np.argmin(apart), apart.shape)
        middle = trials[[0, 1], place]
        width /= 4
    return [(edge, float(part)) for edge, part in zip(edges, middle)]
