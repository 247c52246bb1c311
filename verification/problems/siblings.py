"""Pores with two to five seeds, drawn by number like the pores of :mod:`verification.problems.family`.

    python -m verification.problems.siblings 17 18     # these pores; all of them without numbers
    python -m verification.problems.siblings pairs 3   # pairs that face each other and weld

A quarter of them are bonded, and another quarter has the forces of the water. Both let an aggregate go that detaches.
"""

import json
import math
import sys
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from repro.scene import Scene, load_scene
from verification.problems import family

SEED, SIBLINGS = 46, 60
#: Processor time (s) of one run. It was 150 s until 35 and 38 were seen to need more: both are bonded, and every trial
#: of a detachment makes new meshes with small arcs at the edges of the wall.
LIMIT = 400.0
#: Radius of a seed, its place and the gap between two seeds, over the width.
RADII, PLACES, GAP = (0.06, 0.2), (-3.0, 3.0), 0.15
LETS_GO = ('growth.bonding_strength="6 kPa"', "growth.after_detachment=continue")
#: Changes of a quarter of the pores each.
KINDS = ((), ("growth.wall=bonded", *LETS_GO), ("growth.fluid_forces=included", *LETS_GO), ())


@dataclass(frozen=True)
class Sibling:
    """A pore: its number, width (um), supply of both substrates (mg/L), drive, and changes of its kind.

    seeds: radius and place (um) of each, and its wall.
    """

    number: int
    width: float
    supply: float
    drive: str
    seeds: tuple[tuple[float, float, str], ...]
    kind: tuple[str, ...]

    @cached_property
    def member(self) -> family.Member:
        """The pore with its largest seed alone, which sets the end of the run."""
        return family.Member(self.number, self.width, max(radius for radius, *_ in self.seeds), self.supply, self.drive)

    def scene(self, *changes: str) -> Scene:
        """The scene with changes."""
        seeds = ", ".join(f'{{radius="{radius:.5g} um", position="{x:.5g} um", wall="{wall}"}}'
                          for radius, x, wall in self.seeds)
        sets = [change for change in self.member.sets if not change.startswith("aggregate.")]
        return load_scene("wide", [*sets, f"aggregate=[{seeds}]", *self.kind, *changes],
                          unset=["flow.mean_velocity"] if self.drive == "head" else [])


def draw_sibling(number: int) -> Sibling:
    """The pore with a number. It does not depend on the other ones."""
    draw = np.random.default_rng([SEED, number])
    width = 25 * 8 ** draw.uniform()
    supply = 0.28 * (100 / 0.28) ** draw.uniform()
    drive = family.DRIVES[draw.integers(3)]
    count, seeds = int(draw.integers(2, 6)), []
    while len(seeds) < count:
        radius, x = width * draw.uniform(*RADII), width * draw.uniform(*PLACES)
        wall = ("lower", "upper")[draw.integers(2)]
        if all(math.hypot(x - place, 0 if wall == beside else width) > radius + other + GAP * width
               for other, place, beside in seeds):
            seeds.append((radius, x, wall))
    return Sibling(number, width, supply, drive, tuple(seeds), KINDS[draw.integers(4)])


#: Pairs that face each other: their number, the sum of both radii and that of the smaller one over the width and the
#: sum, and the shift along the pore over the smaller radius.
PAIR_SEED, PAIRS = 47, 8
FILLED, SMALLER, SHIFT = (0.55, 0.9), (0.3, 0.5), (0.0, 1.0)


def draw_pair(number: int) -> Sibling:
    """Two seeds on opposite walls that weld. It does not depend on the other ones."""
    draw = np.random.default_rng([PAIR_SEED, number])
    width = 25 * 4 ** draw.uniform()
    supply = 0.28 * (100 / 0.28) ** draw.uniform()
    radii = width * draw.uniform(*FILLED)
    smaller = radii * draw.uniform(*SMALLER)
    seeds = ((smaller, smaller * draw.uniform(*SHIFT), "upper"), (radii - smaller, 0.0, "lower"))
    return Sibling(number, width, supply, family.DRIVES[draw.integers(3)], seeds, ())


def run_sibling(sibling: Sibling) -> dict:
    """Run a pore, and judge its end."""
    row = family.run_scene(sibling.scene, sibling.member.duration, LIMIT)
    return {"number": sibling.number, "seeds": len(sibling.seeds), "kind": " ".join(sibling.kind), **row}


if __name__ == "__main__":
    pairs = sys.argv[1:2] == ["pairs"]
    draw, count = (draw_pair, PAIRS) if pairs else (draw_sibling, SIBLINGS)
    for each in [int(text) for text in sys.argv[1 + pairs:]] or range(count):
        print(json.dumps(run_sibling(draw(each))), flush=True)
