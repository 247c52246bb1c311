"""The aggregate's boundary (2.3.3): a closed chain of straight edges or of parabolic arcs.

The channel is 0 <= y <= W, -L/2 <= x <= L/2. Nodes run counterclockwise. Each node is FREE (on the
interface with the fluid), touches a wall, or is welded (:mod:`repro.fem.walls`). If edges are arcs,
corners and middles alternate: arc k has the nodes 2 k, 2 k + 1 and 2 k + 2.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from math import inf

import numpy as np
import shapely
from shapely.ops import substring

from repro.errors import OutsidePore
from repro.fem.brief import brief
from repro.fem.elements import ELEMENTS, ON_ARC, Element, parabola
from repro.fem.walls import (
    FREE,
    Seat,
    Wall,
    Walls,
    channel_walls,
    numbers_at,
    on_any,
    touched,
)

#: A corner of the shape at t = 0 keeps its node if the boundary turns there by more than this. The
#: samples of a spline turn by up to 47 degrees at a tip (member 11 of the hostile scenes).
SHARP = np.pi / 3


@brief
@dataclass(frozen=True, eq=False)
class Outline:
    """Boundary of the aggregate.

    points: (M, 2) um; wall: (M,) number of the wall that each node touches or of its weld, or FREE;
    fixed: (M,) True where x is always fixed; origin: (M, 2) um, position of each node's material at
    t = 0; geometry: 1 for straight edges, 2 for arcs; seat: position of its seed.
    """

    points: np.ndarray
    wall: np.ndarray
    fixed: np.ndarray
    origin: np.ndarray
    geometry: int = 1
    seat: Seat = Seat()

    @property
    def element(self) -> Element:
        """Nodes and functions of the triangles beside it."""
        return ELEMENTS[self.geometry]

    @property
    def upstream(self) -> float:
        """Smallest x (um)."""
        return float(self._extreme_points[:, 0].min())

    @property
    def downstream(self) -> float:
        """Largest x (um)."""
        return float(self._extreme_points[:, 0].max())

    @property
    def thickness(self) -> float:
        """Largest distance (um) of the boundary from its seed's wall: the paper's R_aggregate."""
        first = np.flatnonzero(self.touches(self.seat.wall))[0]
        return float(np.abs(self._extreme_points[:, 1] - self.points[first, 1]).max())

    def touches(self, wall: int) -> np.ndarray:
        """(M,) True at the nodes on a wall; wall: its number."""
        return touched(self.wall) == wall

    def welded(self, weld: int) -> np.ndarray:
        """(M,) True at the nodes of a weld; weld: its number."""
        return self.wall - touched(self.wall) == weld

    def free_walk(self, node: int, direction: int) -> np.ndarray:
        """Nodes from the end of a contact surface or of a weld over the free surface to the next
        one; direction: 1 or -1, along the loop."""
        count = len(self.points)
        walk = (node + direction * np.arange(count)) % count
        return walk[: 2 + np.flatnonzero(self.wall[walk[1:]] != FREE)[0]]

    def nearest(self, wall: Wall) -> tuple[float, float]:
        """Least thickness (um) of the film at a wall, and x (um) of its thinnest point."""
        points = self._extreme_points
        point = points[np.argmin(wall.normal * points[:, 1])]
        return float(wall.film(point)), float(point[0])

    def untouched(self, walls: Walls) -> Walls:
        """The walls that no node touches; the nearest wall comes first."""
        free = [wall for wall in walls if not self.touches(wall.number).any()]
        return tuple(sorted(free, key=lambda wall: self.nearest(wall)[0]))

    def gap(self, walls: Walls) -> float:
        """Least thickness (um) of the films at walls without contact; infinite if all are touched.
        """
        return min((self.nearest(wall)[0] for wall in self.untouched(walls)), default=inf)

    def distances(self, points: np.ndarray) -> np.ndarray:
        """(M,) um, distances of points (M, 2) from the curve."""
        return shapely.distance(shapely.points(points), self._ring)

    def film(self, other: Outline) -> tuple[float, np.ndarray]:
        """Least thickness (um) of the film to another aggregate, zero if they touch; and (2,) um,
        the middle of the film there."""
        line = shapely.shortest_line(shapely.Polygon(self._ring), shapely.Polygon(other._ring))
        return float(line.length), shapely.get_coordinates(line).mean(axis=0)

    def mouth(self, thick: float) -> tuple[float, np.ndarray]:
        """The film of the surface with itself that separates water from the pore: its least
        thickness (um), and its middle (2,) um. It is infinite if there is none.

        thick: um. The film is thinner, and a circle of this diameter fits into the water behind it.
        In a notch or a crease, films become thicker from the line on, so they separate no water.
        """
        ring = shapely.get_coordinates(self._ring)[:-1]
        on_wall = np.flatnonzero(self.wall != FREE)[0]
        ring = np.roll(ring, -on_wall * (len(ring) // len(self.points)), axis=0)
        film, middle = inf, np.zeros(2)
        # Two points face each other across water that is wider behind them only if the line turns
        # to the right, where the water is, by more than half a turn.
        turned = np.unwrap(np.arctan2(*np.diff(ring, axis=0).T[::-1]))
        if (np.maximum.accumulate(turned) - turned).max() <= np.pi:
            return film, middle
        line = shapely.LineString(ring)
        for pocket in shapely.Polygon(ring).buffer(thick / 2, quad_segs=ON_ARC).interiors:
            if line.distance(shapely.Polygon(pocket).representative_point()) < thick / 2:
                continue  # smaller than the error of the arcs
            beside = shapely.line_locate_point(line, shapely.points(pocket.coords))
            first, second = beside.min(), beside.max()
            sides = [substring(line, 0.0, first), substring(line, second, line.length)]
            points = [line.interpolate(first), line.interpolate(second)]
            apart = inf
            while (length := points[0].distance(points[1])) < apart:
                apart = length
                for k in (1, 0):  # to the point of this side that is nearest to the other side's
                    points[k] = sides[k].interpolate(sides[k].project(points[1 - k]))
            if apart < film:
                film, middle = apart, shapely.get_coordinates(points).mean(axis=0)
        return film, middle

    @cached_property
    def _ring(self) -> shapely.LinearRing:
        """The curve, with straight lines in place of an arc."""
        t = np.arange(self.element.lines) / self.element.lines
        points = np.einsum("ta,kai->kti", parabola(t), self.arcs(self.points))
        return shapely.LinearRing(points.reshape(-1, 2))

    @property
    def is_simple(self) -> bool:
        """Does the curve not cross itself?"""
        return bool(self._ring.is_simple)

    def same_contact(self, other: Outline) -> bool:
        """Does each node touch the same wall in both outlines?"""
        return np.array_equal(self.wall, other.wall)

    @cached_property
    def area(self) -> float:
        """Area inside (um2): of the corners' polygon, and between the arcs and their chords."""
        return polygon_area(self.points[::self.geometry]) + _lenses(self.arcs(self.points))

    @cached_property
    def corners(self) -> Outline:
        """The polygon through the corners, without middles."""
        at = slice(None, None, self.geometry)
        return replace(self, points=self.points[at], wall=self.wall[at], fixed=self.fixed[at],
                       origin=self.origin[at], geometry=1)

    @property
    def edge_wall(self) -> np.ndarray:
        """Number of the wall or weld on which each edge lies; FREE where it borders the fluid."""
        first, middle, last = self.arcs(self.wall).T
        return np.where((first == middle) | (last == middle), middle, FREE).astype(int)

    def edges_on(self, wall: int) -> np.ndarray:
        """(e, 2 or 3) numbers of the nodes of each edge on a wall, along the loop."""
        start = self.geometry * np.flatnonzero(self.edge_wall == wall)
        return (start[:, None] + np.arange(self.geometry + 1)) % len(self.points)

    def contact_length(self, wall: Wall) -> float:
        """Length (um) of the contact surface with a wall."""
        ends = self.points[self.edges_on(wall.number)[:, [0, -1]], 0]
        return float(np.abs(ends[:, 1] - ends[:, 0]).sum())

    @property
    def contact_ends(self) -> np.ndarray:
        """(M,) True at the ends of the contact surfaces."""
        on = self.wall != FREE
        return on & ~(np.roll(on, 1) & np.roll(on, -1))

    @property
    def corners_at_start(self) -> np.ndarray:
        """(edges,) True where the shape of t = 0 turns by more than SHARP at an edge's start."""
        first, second = arc_derivatives(self.arcs(self.origin))
        before = np.roll(first + second, 1, axis=0)
        lengths = np.linalg.norm(before, axis=1) * np.linalg.norm(first, axis=1)
        return np.sum(before * first, axis=1) < np.cos(SHARP) * lengths

    def edge_lengths(self) -> np.ndarray:
        """Length (um) of the straight line from each node to the next."""
        return np.linalg.norm(np.roll(self.points, -1, axis=0) - self.points, axis=1)

    def interface_edges(self) -> np.ndarray:
        """(M,) True where the line from node i to node i + 1 borders the fluid.

        Such a line does not have both ends on one wall or weld.
        """
        wall = touched(self.wall)
        weld = self.wall - wall
        along = [(each != FREE) & (each == np.roll(each, -1)) for each in (wall, weld)]
        return ~np.any(along, axis=0)

    def arcs(self, values: np.ndarray) -> np.ndarray:
        """(edges, 3, ...) of nodal values (M, ...), at the start, middle and end of each edge."""
        return self.element.arcs(values)

    @cached_property
    def _extreme_points(self) -> np.ndarray:
        """(K, 2) um, points that include the extremes of x and of y: the nodes, and the points
        within an arc at which x or y is stationary.

        With t from -1 to 1, an arc is m + t (b - a) / 2 + t^2 (a - 2 m + b) / 2.
        """
        a, m, b = self.arcs(self.points).transpose(1, 0, 2)
        along = b - a
        bend = a - 2 * m + b
        arc, axis = np.nonzero(np.abs(along) < 2 * np.abs(bend))
        t = (-0.5 * along[arc, axis] / bend[arc, axis])[:, None]
        peaks = m[arc] + 0.5 * t * along[arc] + 0.5 * t**2 * bend[arc]
        return np.concatenate([peaks, self.points])


def polygon_area(points: np.ndarray) -> float:
    """Signed area of a closed polygon, points (M, 2); positive counterclockwise."""
    x, y = points.T
    return float(0.5 * np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y))


def area_beside_chord(points: np.ndarray) -> float:
    """Signed area (um2) between consecutive arcs with nodes (2 k + 1, 2) um and the line between
    their ends."""
    arcs = np.stack([points[:-2:2], points[1:-1:2], points[2::2]], axis=1)
    return polygon_area(points[::2]) + _lenses(arcs)


def _lenses(arcs: np.ndarray) -> float:
    """Signed area between arcs with nodes (k, 3, 2) and their chords: two thirds of chord times
    height."""
    a, m, b = np.moveaxis(arcs, 1, 0)
    chord = b - a
    bow = m - 0.5 * (a + b)
    lens = bow[:, 0] * chord[:, 1] - bow[:, 1] * chord[:, 0]
    return float(2 / 3 * np.sum(lens))


def arc_derivatives(nodes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """First derivative by t at t = 0 and second derivative of arcs with nodes (M, 3, ...)."""
    first, middle, last = np.moveaxis(nodes, 1, 0)
    return -3 * first + 4 * middle - last, 4 * (first - 2 * middle + last)


def half_disc(radius: float, across: float, geometry: int = 1, middle: float = 0.0,
              wall: Wall | None = None) -> Outline:
    """Half-disc of a radius (um) on a wall. Its centre x = ``middle`` (um) is its fixed point.

    across: number of elements over the radius; wall: the lower wall, y = 0, by default.
    """
    wall = wall or channel_walls(inf)[0]
    edges = geometry * max(6, 2 * int(np.ceil(np.pi / 2 * across)))
    angle = np.linspace(0.0, np.pi, edges + 1)
    arc = radius * np.column_stack([np.cos(angle), np.sin(angle)])
    arc[[0, -1], 1] = 0.0
    half = geometry * max(2, int(np.ceil(across)))
    base = np.linspace(-radius, radius, 2 * half + 1)
    base[half] = 0.0
    points = np.vstack([np.column_stack([base, 0.0 * base]), arc[1:-1]])
    points = points * [1.0, wall.normal] + [middle, wall.y]
    counterclockwise = int(wall.normal) * np.arange(len(points))
    points = points[counterclockwise]
    wall_numbers = np.where(np.arange(len(points)) < len(base), wall.number, FREE)
    fixed = np.arange(len(points)) == half
    return Outline(points, wall_numbers[counterclockwise], fixed[counterclockwise], points.copy(),
                   geometry, Seat(wall.number, middle))


def polygon(corners: np.ndarray, walls: Walls, geometry: int = 1, smooth: bool = False,
            at_tips: float = inf, bends: bool = False) -> Outline:
    """The outline of an aggregate on the first wall, through points (K, 2) um.

    corners: from the upstream to the downstream end; points on the second wall are contact.
    smooth: a natural cubic spline replaces the straight line between two points, unless both are
    contact. at_tips: length (um) of the edges at tips; edges grow away from tips. bends: does the
    flow bend the aggregate about its contact lines? They then count as tips. The middle of each
    contact surface is its fixed point, if its wall keeps one. Raises OutsidePore if the curve
    leaves the pore.
    """
    first, *_ = walls
    if first.normal < 0:
        level = sum(wall.y for wall in walls)
        below = [replace(wall, y=level - wall.y, normal=-wall.normal) for wall in walls]
        drawn = polygon(_upside_down(corners, level), tuple(below), geometry, smooth, at_tips,
                        bends)
        back = -np.arange(len(drawn.points))
        points = _upside_down(drawn.points, level)[back]
        return Outline(points, drawn.wall[back], drawn.fixed[back], points.copy(), geometry,
                       drawn.seat)
    # Counterclockwise: from the downstream end over the top to the upstream end.
    rim = np.asarray(corners, float)[::-1]
    if smooth:
        rim = _splined(rim, walls)
    rim = _graded_to_corners(rim, walls, at_tips, bends)
    base = np.column_stack([np.linspace(rim[-1, 0], rim[0, 0], 3), np.zeros(3)])
    points = np.vstack([base, rim[1:-1]])
    if any(wall.gap(points).min() < 0 for wall in walls):
        raise OutsidePore("the spline through the points of the outline leaves the pore")
    for wall in walls:
        points = _with_contact_middle(points, wall)
    wall_numbers = numbers_at(walls, points)
    fixed = _middles(points, walls)
    points, wall_numbers, fixed = _with_nodes(ELEMENTS[geometry], points, wall_numbers, fixed)
    return Outline(points, wall_numbers, fixed, points.copy(), geometry, Seat(first.number))


def _upside_down(points: np.ndarray, level: float) -> np.ndarray:
    """Points (K, 2) um mirrored at y = level / 2 (um)."""
    return np.asarray(points, float) * [1.0, -1.0] + [0.0, level]


#: Corners that turn by more than this angle have smaller edges beside them.
CORNER = np.radians(30.0)
#: Ratio of the edge length at a notch to that at a tip. A tip juts into the water.
AT_NOTCH = 3.0
#: Ratio of successive distances from a corner to the nodes beside it.
CORNER_RATIO = 3.0


def _graded_to_corners(rim: np.ndarray, walls: Walls, least: float, bends: bool) -> np.ndarray:
    """Points (M, 2) um on the lines between points (K, 2) um, denser towards each corner.

    least: length (um) of the edges at tips. At a sharp tip the velocity gradient of the water grows
    as the distance to the power of -1/2, and the error of the head loss is of first order in the
    element size there. Strain in a notch grows in the same way.

    Contact lines count as tips in two cases. If the aggregate spans the pore, the water passes
    through it. If the aggregate bends, as in the traction form, the velocity beside a contact line
    with 55 to 150 degrees of biomass grows as the distance to the power of 0.85 to 0.52 (viscosity
    ratio 2000; 0.595 at 90 degrees). In the Laplacian form this power is above 1 up to 95 degrees.
    """
    way = np.diff(rim, axis=0)
    angle = np.arctan2(way[:, 1], way[:, 0])
    turn = (np.diff(angle, prepend=angle[0], append=angle[-1]) + np.pi) % (2 * np.pi) - np.pi
    near = np.where(turn > CORNER, least, np.where(turn < -CORNER, AT_NOTCH * least, inf))
    _, *opposite = walls
    touching = on_any(opposite, rim)
    near[touching] = least
    if bends or touching.any():
        near[[0, -1]] = least
    shares = [_shares(length, *near[k: k + 2])
              for k, length in enumerate(np.linalg.norm(way, axis=1))]
    pieces = [start + share[:, None] * step for start, share, step in zip(rim, shares, way)]
    return np.vstack([*pieces, rim[-1]])


def _shares(length: float, first: float, last: float) -> np.ndarray:
    """Positions, in [0, 1), of the nodes on a line of a length (um).

    first, last: lengths (um) of the edges at its ends, infinite where these are no corners.
    """
    return np.concatenate([[0.0], _ladder(first / length), 1 - _ladder(last / length)[::-1]])


def _ladder(least: float) -> np.ndarray:
    """Numbers from ``least`` to at most a third; each is CORNER_RATIO times the one before."""
    count = int(np.log(max(1.0, 1 / least)) / np.log(CORNER_RATIO))
    return least * CORNER_RATIO ** np.arange(count)


#: Points on a spline for each interpolated point, and the largest number of points on all of it.
BETWEEN = 8
MOST_SPLINED = 1000


def _splined(rim: np.ndarray, walls: Walls) -> np.ndarray:
    """Points (M, 2) um on a spline through points (K, 2) um. Along a wall the spline is straight.
    """
    from scipy.interpolate import CubicSpline  # its import takes 0.25 s; few scenes need it

    length = np.sqrt(np.linalg.norm(np.diff(rim, axis=0), axis=1))
    knots = np.concatenate([[0.0], np.cumsum(length)])
    curve = CubicSpline(knots, rim, bc_type="natural")
    between = min(BETWEEN, max(1, MOST_SPLINED // len(rim)))
    pieces = []
    for k, start in enumerate(rim[:-1]):
        flat = any(wall.holds(rim[k: k + 2]).all() for wall in walls)
        t = np.linspace(knots[k], knots[k + 1], between + 1)[:-1]
        pieces.append(start[None] if flat else np.vstack([start, curve(t[1:])]))
    return np.vstack([*pieces, rim[-1]])


def _with_contact_middle(points: np.ndarray, wall: Wall) -> np.ndarray:
    """Insert a node in the middle of the contact surface with a wall, if there is one."""
    on = np.flatnonzero(wall.holds(points))
    if len(on) == 0:
        return points
    x = points[on, 0]
    middle = 0.5 * (x.min() + x.max())
    if np.isclose(x, middle).any():
        return points
    after = on[np.searchsorted(wall.normal * x, wall.normal * middle)]
    return np.insert(points, after, [middle, points[after, 1]], axis=0)


def _middles(points: np.ndarray, walls: Walls) -> np.ndarray:
    """(M,) True at the node in the middle of each contact surface that keeps a point."""
    fixed = np.zeros(len(points), bool)
    for wall in walls:
        on = np.flatnonzero(wall.holds(points))
        if len(on) and wall.keeps_point:
            x = points[on, 0]
            fixed[on[np.argmin(np.abs(x - 0.5 * (x.min() + x.max())))]] = True
    return fixed


def _with_nodes(element: Element, points: np.ndarray, wall: np.ndarray,
                fixed: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The loop with all nodes of an element on its straight edges: points (n, 2) um, walls (n,),
    fixed (n,)."""
    between = np.where(wall == np.roll(wall, -1), wall, FREE)
    inside = np.arange(element.parts) > 0
    walls = np.where(inside, between[:, None], wall[:, None]).ravel()
    nodes = element.along(points, np.roll(points, -1, axis=0)).reshape(-1, 2)
    return nodes, walls, (fixed[:, None] & ~inside).ravel()
