"""Flow past two aggregates that do not act on each other.

Between two aggregates that are four widths apart the flow is Poiseuille's: what an aggregate adds to it decays like
exp(-4.2 x / W), to 5e-8 over that distance. So the resistances that the two add to the pore add up.
"""
from functools import cache

import pytest

from repro import solve
from verification.evidence.cases import combined, parametrize
from verification.evidence.checks import at_most

WIDTH, APART = 50.0, 4.0
#: Radius (um) and place (um) of both, upstream first.
FIRST, SECOND = (20.0, -APART / 2 * WIDTH), (30.0, APART / 2 * WIDTH)
WALLS = {"one wall": "lower", "both walls": "upper"}
#: Presets and the largest relative difference: the errors that they promise, and 1 % for the paper's.
PRESETS = {"paper": ("paper", 1e-2), "fast": ("fast", 1e-2), "accurate": ("accurate", 1e-3), "exact": ("exact", 1e-4)}


@pytest.mark.case(
    "flow-additivity", kind="property", runs_with="1 2",
    mutants=("second-aggregate-is-water", "mesh-ends-behind-the-first"))
@parametrize("accuracy, wall", combined(PRESETS, WALLS))
def test_additivity(accuracy, wall, record):
    """Two half-discs 4 W apart, on one wall or on both, add their resistances.

    Norm: head loss that both add to that of the clean pore, over the sum of those that each adds alone, minus one.
    """
    preset, bound = accuracy
    clean = _loss(preset)
    alone = [_loss(preset, (*FIRST, "lower")), _loss(preset, (*SECOND, wall))]
    both = _loss(preset, (*FIRST, "lower"), (*SECOND, wall))
    error = abs((both - clean) / (sum(alone) - 2 * clean) - 1)
    record(at_most("added head loss", error, bound, "the error that the preset promises"))


@cache
def _loss(preset: str, *bodies: tuple[float, float, str]) -> float:
    """Head loss (cm) of a pore with half-discs: radius, position (um) and wall of each."""
    tables = {"pore": {"width": f"{WIDTH} um", "length": f"{18 * WIDTH} um"}, "flow": {"mean_velocity": "2.9 m/day"},
              "numerics": {"preset": preset}}
    if bodies:
        tables["aggregate"] = [{"radius": f"{radius} um", "position": f"{position} um", "wall": wall}
                               for radius, position, wall in bodies]
    return float(solve(tables)["head_loss_cm"][0])
