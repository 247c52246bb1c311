"""The walls of the pore (2.1), as data: where they are, and what they do.

A stage asks a wall; no stage knows which one it is. The channel is 0 <= y <= W, and a pore has a
list of two walls. An aggregate sees them from its seat: first the wall of its seed, then the
opposite one. Nodes and contact lines name their wall by its number; FREE is no wall.

No substrate flows through a wall. This is the natural condition of the weak form (11)-(12), so the
transport asks nothing.

A plane of symmetry is the middle of a pore of twice the width. Its mirror image lies beyond it. The
water slips along the plane, biomass slides along it without a fixed point, and a film that ends
there is half of the film between the aggregate and its mirror image.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np

FREE = 0
BOTTOM = 1
TOP = 2
#: Number of no wall: the surface of another aggregate, to which an aggregate is welded.
WELD = 3


@dataclass(frozen=True)
class Wall:
    """A straight wall along the pore.

    number: of the wall; y: its place (um); normal: y component of its unit normal into the pore, 1
    or -1. An aggregate's boundary runs counterclockwise, so along a wall it runs in the direction
    of x if the normal is 1, else against it.

    no_slip: is the velocity along the wall zero, too (5)? bonded: does an aggregate whose seed sat
    on the wall keep its place there, or slide along it (2.3.3)? keeps_point: does the middle of a
    new contact surface keep its x (2.3.3)? mirrors: is it a plane of symmetry?
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
        """The part of a film or a channel on this side of the wall: half at a plane of symmetry."""
        return 0.5 if self.mirrors else 1.0

    def gap(self, points: np.ndarray) -> np.ndarray:
        """(...,) um, distances of points (..., 2) from the wall, negative beyond it."""
        return self.normal * (points[..., 1] - self.y)

    def film(self, points: np.ndarray) -> np.ndarray:
        """(...,) um, thickness of a film between points (..., 2) and the wall, or between them and
        their mirror images."""
        return self.gap(points) / self.part

    def holds(self, points: np.ndarray) -> np.ndarray:
        """(...,) True for points (..., 2) exactly on the wall."""
        return points[..., 1] == self.y


#: The walls of a pore, or those that an aggregate sees: first that of its seed.
Walls: TypeAlias = tuple[Wall, ...]


@dataclass(frozen=True)
class Seat:
    """Where the seed of an aggregate sat.

    wall: number of its wall; middle: x (um) of the middle of the half-disc, None for another shape.
    """

    wall: int = BOTTOM
    middle: float | None = None

    def walls(self, walls: Walls) -> Walls:
        """The walls that the aggregate sees: its own one, then the opposite one, along which it
        slides."""
        own = numbered(walls, self.wall)
        return own, *(replace(wall, bonded=False) for wall in walls if wall != own)


#: What a wall does, by its word in a scene.
CONDITIONS: dict[str, dict[str, bool]] = {
    "no slip": {},
    "symmetry": {"no_slip": False, "keeps_point": False, "mirrors": True}}


def channel_walls(width: float, bonded: bool = False, upper: str = "no slip") -> Walls:
    """The walls of the channel 0 <= y <= ``width`` (um).

    bonded: each aggregate to the wall of its seed? upper: condition on the upper one, of
    ``CONDITIONS``.
    """
    return (Wall(BOTTOM, 0.0, 1.0, bonded=bonded),
            Wall(TOP, width, -1.0, **{"bonded": bonded, **CONDITIONS[upper]}))


def touches_wall(numbers: np.ndarray) -> np.ndarray:
    """True where a node touches a wall, from the numbers in its outline: it is neither free nor
    welded."""
    return (numbers != FREE) & (numbers != WELD)


def numbered(walls: Walls, number: int) -> Wall:
    """The wall with a number."""
    return next(wall for wall in walls if wall.number == number)


def width_between(walls: Walls) -> float:
    """W (um), the distance between the two walls of a channel."""
    first, opposite = walls
    return abs(opposite.y - first.y)


def whole_width(walls: Walls) -> float:
    """Width (um) of the pore. With a plane of symmetry it is that of the pore and its mirror image.
    """
    width = width_between(walls)
    for wall in walls:
        width /= wall.part
    return width


def on_any(walls: Iterable[Wall], points: np.ndarray) -> np.ndarray:
    """(M,) True for points (M, 2) on one of the walls."""
    return np.any([wall.holds(points) for wall in walls], axis=0)


def numbers_at(walls: Iterable[Wall], points: np.ndarray) -> np.ndarray:
    """(M,) number of the wall on which each of points (M, 2) lies, FREE on none."""
    numbers = np.full(len(points), FREE)
    for wall in walls:
        numbers[wall.holds(points)] = wall.number
    return numbers
