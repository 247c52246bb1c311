"""The pore of the flow and transport parts: a half-disc of biomass that leaves a film of 10 um, and scenes of it; and
what linear elements are called, with the [numerics] of those of the flow."""

from __future__ import annotations

from functools import cache

import numpy as np

from reference.whole_run import Pore as Constants
from reference.whole_run_grid import grid
from reference.whole_run_pore import Section
from repro.scene import parse_scene

WIDTH, LENGTH, RADIUS, RATIO = 50.0, 600.0, 40.0, 2000.0
PAPER = "linear elements (paper)"
FLOW_ELEMENTS = {PAPER: {"preset": "paper"}, "linear with a bubble": {"preset": "paper", "flow_element": "bubble"}}
#: The meshed part ends 1.5 W from the aggregate (3.1), for all methods; m/d.
ENDS, SPEED = (-RADIUS - 1.5 * WIDTH, RADIUS + 1.5 * WIDTH), 2.9


def scene(**numerics):
    """The pore with Table 1's substrates and a mean velocity, solved as ``numerics`` say."""
    tables = {"pore": {"width": f"{WIDTH} um", "length": f"{LENGTH} um"}, "aggregate": {"radius": f"{RADIUS} um"},
              "flow": {"mean_velocity": f"{SPEED} m/day", "viscosity_ratio": RATIO}, "substrates": {},
              "numerics": numerics}
    return parse_scene(tables, "half disc", "half_disc.toml")


def constants() -> Constants:
    """Table 1, as the references take it."""
    return Constants(width=WIDTH, length=LENGTH, radius=RADIUS, ratio=RATIO)


def section(rings: int) -> Section:
    """The reference's curved mesh of the half-disc."""
    made = topology(rings)
    return Section(made, made.around(RADIUS * made.seed, WIDTH, ENDS), WIDTH, ENDS)


@cache
def topology(rings: int):
    """The reference's triangles, which know no place."""
    return grid(rings)


def outside_loss() -> float:
    """Loss (1/um) of the pore beyond the mesh, at mean velocity one: 12 L / W^2."""
    return 12 * (LENGTH - (ENDS[1] - ENDS[0])) / WIDTH**2


def largest(found, wanted, scale) -> float:
    """Largest difference over the scale."""
    return float(np.max(np.abs(np.asarray(found) - wanted) / scale))
