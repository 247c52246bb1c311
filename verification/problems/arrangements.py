"""Arrangements of seeds with the same total area in the pore of Base, which a figure and the validation compare."""

import math
from collections.abc import Iterable

#: Places of the seeds (um), and their walls.
ARRANGEMENTS = {
    "one": ((0, "lower"),),
    "two facing": ((0, "lower"), (0, "upper")),
    "two staggered": ((-50, "lower"), (50, "upper")),
    "four in facing pairs": ((-75, "lower"), (-75, "upper"), (75, "lower"), (75, "upper")),
    "eight alternating": tuple((-175 + 50 * k, ("lower", "upper")[k % 2]) for k in range(8))}
#: Total area over W^2 at which the arrangements are compared.
COMPARED = 0.6


def seeds(places: Iterable[tuple[float, str]], radius: float = 10.0) -> str:
    """The change of a scene that sets seeds at places, with the total area of one of ``radius`` (um)."""
    places = tuple(places)
    each = radius / math.sqrt(len(places))
    listed = ", ".join(f'{{radius="{each:.6g} um", position="{x} um", wall="{wall}"}}' for x, wall in places)
    return f"aggregate=[{listed}]"
