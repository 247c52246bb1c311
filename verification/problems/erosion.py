"""Aggregates that grow uniformly and erode: half-discs, and flat layers in the middle of a wide bonded aggregate.

The uptake of zero order gives active biomass without decay the same growth everywhere. A bonded layer cannot spread,
and its ends reach no farther than a few thicknesses: after 4 h without erosion the middle is 1e-5 um too thin if the
ends are 90 um away.
"""
from dataclasses import replace

import numpy as np

from repro.fem.walls import FREE
from repro.march import eroding
from repro.march.balance import Ledger
from repro.model.meshing import seeded
from repro.model.pore import Pore
from repro.model.stages import Stages
from repro.scene import Scene, load_scene

#: mu (1/h), and the half length of a layer (um).
MU, REACH = 0.1, 100.0
UNIFORM = ("numerics.preset=fast", "kinetics.law=zero order", f'kinetics.maximum_utilization_rate="{2 * MU} 1/h"',
           "kinetics.yield_coefficient=0.5", 'kinetics.decay_coefficient="0 1/h"',
           'kinetics.maximum_density="300 mg/L"',
           "growth.new_biomass=stress_free", 'growth.end="50 h"', "numerics.extent=full")
LAWS = {"constant": 'law="constant", speed="{} um/h"',
        "thickness squared": 'law="thickness squared", thickness_coefficient="{} 1/um/h"',
        "shear": 'law="shear", shear_coefficient="{} um/h/Pa"'}


def erosion(law: str, number: float, more: str = "") -> str:
    """The change of a scene to a law with its coefficient; more: further keys."""
    return f"growth.erosion={{{LAWS[law].format(number)}{more}}}"


def half_disc(radius: float, *changes: str, wall: str = "lower") -> Scene:
    """A half-disc (um) on a sliding wall, in water at rest."""
    return shaped(f'aggregate.radius="{radius} um"', f"aggregate.wall={wall}", *changes)


def shaped(*changes: str) -> Scene:
    """An aggregate of any shape on a sliding wall, in water at rest."""
    return load_scene("base", [*UNIFORM, 'pore.length="200 um"', *changes], unset=["flow", "aggregate.radius"])


def layer(thickness: float, *changes: str, unset: tuple[str, ...] = ("flow",), length: float = 2.5 * REACH) -> Scene:
    """A layer of a thickness (um) on a bonded wall, with slopes at its ends."""
    points = ((-REACH, 0.0), (-REACH + thickness, thickness), (REACH - thickness, thickness), (REACH, 0.0))
    outline = [[f"{x} um", f"{y} um"] for x, y in points]
    return load_scene("base", [*UNIFORM, f'pore.length="{length} um"', f"aggregate.outline={outline}".replace("'", '"'),
                               "growth.wall=bonded", *changes], unset=["aggregate.radius", *unset])


def advance(scene: Scene, end: float, steps: int) -> tuple[Pore, list[Ledger]]:
    """The pore after equal steps to a time (h), and their ledgers."""
    stages = Stages.of(scene)
    pore, solved = stages.grading.solve(seeded(scene))
    ledgers = []
    for number in range(steps):
        pore = replace(pore, concentrations=solved.concentrations)
        step = eroding.attempt(stages, pore, solved, end / steps).step
        ledgers.append(step.ledger)
        pore, solved = stages.grading.solve(replace(step.pore, time=end * (number + 1) / steps))
    return pore, ledgers


def middle_thickness(pore: Pore) -> float:
    """Thickness (um) of a layer at the free node nearest to x = 0."""
    outline = pore.boundary
    free = np.flatnonzero(outline.wall == FREE)
    x, y = outline.points[free[np.argmin(np.abs(outline.points[free, 0]))]]
    own, *_ = pore.walls
    return float(own.gap(np.array([x, y])))
