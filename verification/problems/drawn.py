"""Bounds of the concentrations in scenes drawn at random: `python -m verification.problems.drawn [COUNT] [SEED]`.

For each order of elements, print how many scenes are refused at t = 0 although the elements at the aggregate are halved
twice. For the other scenes, print the median, the 95th percentile and the largest excess of concentrations over the
supply.
"""
import sys

import numpy as np

from repro.errors import StageError
from repro.model import remeshing
from repro.model.pore import seeded, solve
from repro.scene import parse_scene

ELEMENTS = ("linear", "quadratic", "cubic")


def draw_scene(random, elements):
    """A pore with a seed: 0.05 to 100 m/day, supplies over three decades and half saturations over five."""
    def between(least, most):
        return float(np.exp(random.uniform(np.log(least), np.log(most))))

    width = between(20.0, 150.0)
    both = {name: {"supply": f"{between(0.1, 100.0)} mg/L", "half_saturation": f"{between(1e-4, 10.0)} mg/L"}
            for name in ("acceptor", "donor")}
    return parse_scene({
        "pore": {"width": f"{width} um", "length": f"{8 * width} um"},
        "aggregate": {"radius": f"{random.uniform(0.05, 0.9) * width} um"},
        "flow": {"mean_velocity": f"{between(0.05, 100.0)} m/day"},
        "substrates": both, "kinetics": {"maximum_density": f"{between(1e3, 3e5)} mg/L"},
        "numerics": {"preset": "paper", "elements": elements, "transfer": "conserving",
                     "refinement": random.uniform(0.25, 0.5)}}, "drawn", "drawn")


def overshoot(scene):
    """The largest concentration over its supply, less one. None if the scene is refused."""
    pore = seeded(scene)
    while pore:
        try:
            with np.errstate(all="raise", under="ignore"):
                state = solve(scene, pore).concentrations
        except StageError:
            pore = remeshing.grade(scene, pore)
            continue
        kinds = scene.substrates.acceptor, scene.substrates.donor
        return max(field.max() / kind.supply - 1 for field, kind in zip((state.acceptor, state.donor), kinds))
    return None


def measure(count, seed):
    """{elements: overshoots}; each kind of elements has a third of the scenes."""
    random = np.random.default_rng(seed)
    overshoots = {elements: [] for elements in ELEMENTS}
    for k in range(count):
        elements = ELEMENTS[k % len(ELEMENTS)]
        overshoots[elements].append(overshoot(draw_scene(random, elements)))
    return overshoots


if __name__ == "__main__":
    count, seed = map(int, (*sys.argv[1:3], 300, 1)[:2]) if len(sys.argv) == 3 else (300, 1)
    for elements, parts in measure(count, seed).items():
        solved = [part for part in parts if part is not None]
        print(f"{elements}: {len(parts) - len(solved)} of {len(parts)} refused; over the supply by "
              + ", ".join(f"{part:.2g}" for part in np.quantile(solved, (0.5, 0.95, 1.0))))
