"""Recession of an outline of arcs along its normal.

A node of a free surface moves against the outward normal n by a distance d. A corner of two arcs
moves by -d (n1 + n2) / (1 + n1 . n2), to the intersection of their receded tangents. A contact line
moves along the wall by d over the sine of the contact angle, to the intersection of the receded
surface with the wall. Nodes of a contact surface keep their order between its ends. Its fixed point
stays in place until a contact line passes it.

Arcs at convex corners and beside contact lines with an acute angle shrink as the surface recedes.
If they shrink too much, they join a neighbour before the surface recedes (:func:`merged`).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from repro.errors import ContactEroded, ErosionError
from repro.fem.elements import ON_ARC
from repro.fem.outline import Outline, arc_derivatives, parabola
from repro.fem.walls import FREE, Walls

#: An arc joins a neighbour if the recession leaves less than this part of one of its halves. The
#: middle of each other arc then lies between 1/3 and 2/3 of its chord; outside 1/4 to 3/4 an arc
#: folds.
KEPT = 0.5
#: The middle of an arc moves along the arc to the middle of the chord if its distance from there is
#: above this part of the chord.
CENTRED = 0.1


def normals(outline: Outline) -> np.ndarray:
    """(E, 3, 2) outward unit normals at start, middle and end of each arc."""
    first, second = arc_derivatives(outline.arcs(outline.points))
    x, y = np.stack([first + t * second for t in (0.0, 0.5, 1.0)], axis=1).transpose(2, 0, 1)
    return np.stack([y, -x], axis=-1) / np.hypot(x, y)[..., None]


def directions(outline: Outline) -> np.ndarray:
    """(M, 2) um, moves of the nodes if the surface recedes by 1 um; zero within contact surfaces.
    """
    starts, middles, ends = np.moveaxis(normals(outline), 1, 0)
    free = outline.edge_wall == FREE
    before = np.roll(free, 1)
    n1 = np.where(before[:, None], np.roll(ends, 1, axis=0), starts)
    n2 = np.where(free[:, None], starts, n1)
    corners = -(n1 + n2) / (1 + np.sum(n1 * n2, axis=1, keepdims=True))
    at_line = before != free
    corners[at_line] = np.column_stack([-1 / n1[at_line, 0], np.zeros(at_line.sum())])
    corners[~(before | free)] = 0.0
    moves = np.zeros_like(outline.points)
    moves[::2] = corners
    moves[1::2] = np.where(free[:, None], -middles, 0.0)
    return moves


def swept(outline: Outline, speeds: np.ndarray) -> float:
    """um2/h, area that the free surface passes per time; speeds: (M,) um/h at the nodes.

    Contact lines add nothing: they only follow the surface.
    """
    first, second = arc_derivatives(outline.arcs(outline.points))
    lengths = np.stack([np.hypot(*(first + t * second).T) for t in (0.0, 0.5, 1.0)], axis=1)
    over_arcs = (outline.arcs(speeds) * lengths) @ (1 / 6, 2 / 3, 1 / 6)  # Simpson's rule
    return float(over_arcs[outline.edge_wall == FREE].sum())


def moved(outline: Outline, moves: np.ndarray) -> Outline:
    """The outline after moves (M, 2) um of its free nodes and contact lines. Nodes between contact
    lines follow. Raises ContactEroded if a contact surface vanishes."""
    points = outline.points + moves
    on = outline.wall != FREE
    points[on, 1] = outline.points[on, 1]
    for number in np.unique(outline.wall[on]):
        surface = np.flatnonzero(outline.wall == number)
        points[surface, 0] = _between_lines(outline, surface, points[:, 0])
    return _centred(replace(outline, points=points))


def _between_lines(outline: Outline, surface: np.ndarray, x: np.ndarray) -> np.ndarray:
    """(k,) um, x of the nodes ``surface`` (k,) of a contact surface after its lines have moved.

    x: (M,) um, of all nodes, with the new positions of the lines.
    """
    ends = surface[outline.contact_ends[surface]]
    low, high = x[ends].min(), x[ends].max()
    before = outline.points[surface, 0]
    in_order = x[ends[np.argsort(outline.points[ends, 0])]]
    if not in_order[0] < in_order[-1]:
        raise ContactEroded(f"a contact surface at y = {outline.points[surface[0], 1]:.4g} um")
    fixed = before[outline.fixed[surface]]
    fixed = fixed[(low < fixed) & (fixed < high)]
    knots = np.sort(np.concatenate([[before.min(), before.max()], fixed]))
    return np.interp(before, knots, np.sort(np.concatenate([[low, high], fixed])))


def merged(outline: Outline, moves: np.ndarray) -> Outline | None:
    """The outline after the arc that shrinks most under moves (M, 2) um has joined a neighbour.

    It joins the neighbour with the smoother corner. Returns None if all arcs keep KEPT of both
    halves. Raises ErosionError if too few arcs are left.
    """
    before = _halves(outline.points)
    kept = np.sum(before * _halves(outline.points + moves), axis=1) / np.sum(before**2, axis=1)
    kept = kept.reshape(-1, 2).min(axis=1)
    free = outline.edge_wall == FREE
    worst = int(np.argmin(np.where(free, kept, np.inf)))
    if kept[worst] >= KEPT:
        return None
    starts, _, ends = np.moveaxis(normals(outline), 1, 0)
    turns = np.sum(np.roll(ends, 1, axis=0) * starts, axis=1)
    joints = [joint % len(free) for joint in (worst, worst + 1)
              if free[joint % len(free)] and free[joint - 1]]
    if not joints or free.sum() < 4:
        raise ErosionError("a surface of a few arcs is eroded in one step")
    return _joined(outline, max(joints, key=lambda joint: turns[joint]))


def _halves(points: np.ndarray) -> np.ndarray:
    """(M, 2) um, from each node to the next."""
    return np.roll(points, -1, axis=0) - points


def _centred(outline: Outline) -> Outline:
    """The outline with the middle of each free arc moved near the middle of its chord."""
    arcs = outline.arcs(outline.points)
    chords = arcs[:, 2] - arcs[:, 0]
    part = np.sum((arcs[:, 1] - arcs[:, 0]) * chords, axis=1) / np.sum(chords**2, axis=1)
    t = 1 / (4 * part - 1 + np.sqrt(1 + 4 * (2 * part - 1) ** 2))  # projects to half the chord
    far = (np.abs(part - 0.5) > CENTRED) & (outline.edge_wall == FREE)
    points = outline.points.copy()
    points[1::2][far] = np.einsum("ea,eai->ei", parabola(t[far]), arcs[far])
    return replace(outline, points=points, origin=points)


def _joined(outline: Outline, joint: int) -> Outline:
    """The outline with one arc in place of the two arcs that meet at corner ``joint``.

    The middle of the new arc halves their total length.
    """
    nodes = np.arange(2 * joint - 2, 2 * joint + 3) % len(outline.points)
    pair = outline.points[nodes]
    t = np.arange(ON_ARC + 1) / ON_ARC
    line = np.concatenate([parabola(t) @ pair[:3], parabola(t[1:]) @ pair[2:]])
    along = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1)))
    place = np.interp(along[-1] / 2, along, np.arange(len(line)) / ON_ARC)
    arc = int(place >= 1)
    points = outline.points.copy()
    points[nodes[1]] = parabola(place - arc) @ pair[2 * arc: 2 * arc + 3]
    kept = np.isin(np.arange(len(points)), nodes[2:4], invert=True)
    return replace(outline, points=points[kept], wall=outline.wall[kept],
                   fixed=outline.fixed[kept], origin=points[kept])


def refuse_invalid(outline: Outline, walls: Walls) -> None:
    """Raise ErosionError if a receded outline crosses itself or a wall."""
    free = outline.wall == FREE
    beyond = any((wall.gap(outline.points[free]) <= 0).any() for wall in walls)
    if beyond or not outline.is_simple:
        raise ErosionError("the surface crosses itself in one step")
