"""The walls of the pore (2.1): their positions and their boundary conditions, as data.

The channel is 0 <= y <= W, and a pore has a list of two walls. A stage reads the conditions from a
wall and does not distinguish walls otherwise. Each aggregate has its own order of the walls: first
the wall of its seed, then the opposite wall. Nodes and contact lines refer to a wall by its number;
FREE means no wall. The number of a node also says to which weld of two aggregates it belongs.

No substrate flows through a wall. This is the natural condition of the weak form (11)-(12), so the
transport needs no data of the walls.

A plane of symmetry is the middle plane of a pore of twice the width. The mirror image of the
channel lies beyond it. The water slips along the plane, and biomass slides along it without a fixed
point. A film at the plane is half of the film between the aggregate and its mirror image.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np

FREE = 0
BOTTOM = 1
TOP = 2
#: Number of the first weld: a surface that two aggregates share. Numbers of further welds are
#: multiples of it. A node on a wall and a weld has the sum of both numbers.
WELD = 3


@dataclass(frozen=True)
class Wall:
    """A straight wall along the pore.

    number: of the wall; y: its coordinate (um); normal: y component of its unit normal into the
    pore, 1 or -1. An aggregate's boundary runs counterclockwise. Along a wall it therefore runs in
    the direction of x if the normal is 1, and against it if the normal is -1.

    no_slip: is the tangential velocity zero too (5)? bonded: is an aggregate fixed to the wall of
    its seed? It slides otherwise (2.3.3). keeps_point: does the middle of a new contact surface
    keep its x (2.3.3)? mirrors: is the wall a plane of symmetry?
    """

    number: int
    y: float
    normal: float
    no_slip: bool = True
    bonded: bool = False
    keeps_point: bool = True
    mirrors: bool = False

    @property
    def part(self) -> float:
        """Fraction of a film or a channel on this side of the wall: 1/2 at a plane of symmetry."""
        return 0.5 if self.mirrors else 1.0

    def gap(self, points: np.ndarray) -> np.ndarray:
        """(...,) um, distances of points (..., 2) from the wall, negative beyond it."""
        return self.normal * (points[..., 1] - self.y)

    def film(self, points: np.ndarray) -> np.ndarray:
        """(...,) um, thickness of the film between points (..., 2) and the wall; at a plane of
        symmetry, between the points and their mirror images."""
        return self.gap(points) / self.part

    def holds(self, points: np.ndarray) -> np.ndarray:
        """(...,) True for points (..., 2) exactly on the wall."""
        return points[..., 1] == self.y


#: The two walls of a pore. In the order of an aggregate, the wall of its seed comes first.
Walls: TypeAlias = tuple[Wall, ...]


@dataclass(frozen=True)
class Seat:
    """Position of an aggregate's seed.

    wall: number of its wall; middle: x (um) of a half-disc's centre, None for another shape.
    """

    wall: int = BOTTOM
    middle: float | None = None

    def walls(self, walls: Walls) -> Walls:
        """The wall of the seed, then the opposite wall. The aggregate slides along the latter."""
        own = numbered(walls, self.wall)
        return own, *(replace(wall, bonded=False) for wall in walls if wall != own)


#: {condition in a scene: attributes of the wall}.
CONDITIONS: dict[str, dict[str, bool]] = {
    "no slip": {},
    "symmetry": {"no_slip": False, "keeps_point": False, "mirrors": True}}


def channel_walls(width: float, bonded: bool = False, upper: str = "no slip") -> Walls:
    """The walls of the channel 0 <= y <= ``width`` (um).

    bonded: is each aggregate bonded to the wall of its seed? upper: condition on the upper wall, a
    key of ``CONDITIONS``.
    """
    return (Wall(BOTTOM, 0.0, 1.0, bonded=bonded),
            Wall(TOP, width, -1.0, **{"bonded": bonded, **CONDITIONS[upper]}))


def touched(numbers: np.ndarray) -> np.ndarray:
    """(M,) number of the wall that each node touches, or FREE, from :attr:`Outline.wall`."""
    return numbers % WELD


def numbered(walls: Walls, number: int) -> Wall:
    """The wall with a number."""
    return next(wall for wall in walls if wall.number == number)


def width_between(walls: Walls) -> float:
    """W (um), the distance between the two walls of a channel."""
    first, opposite = walls
    return abs(opposite.y - first.y)


def whole_width(walls: Walls) -> float:
    """Width (um) of the pore: W, or 2 W if one wall is a plane of symmetry."""
    width = width_between(walls)
    for wall in walls:
        width /= wall.part
    return width


def on_any(walls: Iterable[Wall], points: np.ndarray) -> np.ndarray:
    """(M,) True for points (M, 2) on one of the walls."""
    return np.any([wall.holds(points) for wall in walls], axis=0)


def numbers_at(walls: Iterable[Wall], points: np.ndarray) -> np.ndarray:
    """(M,) number of the wall on which each of points (M, 2) lies; FREE if it lies on none."""
    numbers = np.full(len(points), FREE)
    for wall in walls:
        numbers[wall.holds(points)] = wall.number
    return numbers
