"""Benchmark of a channel with semicircles on its walls: Jeong & Son (2016).

The losses belong to the semicircles alone: that of a clean channel is subtracted. They are lengths of a clean channel,
in widths. A semicircle is biomass with 10^10 times the viscosity of water. A gap of 0.02 W loses the head of 3 x 10^4
widths of a clean channel, so with 10^6 times the viscosity a fifteenth of the water would pass through the semicircle.
"""
from dataclasses import replace

import pytest

from reference import semicircle_channel
from repro.fem.space import Space
from repro.fem.walls import channel_walls
from repro.model import flow
from repro.model.resistance import Viscous
from verification.evidence.checks import at_most
from verification.problems import meshes

RIGID = 1e10
#: Of the elements. That of the preset accurate, 0.45, errs by 0.1 % of a semicircle's own loss.
REFINEMENT = 1.25
#: Width (um) at which the thinnest film, of 0.02 widths, is as thick as the thinnest one that the mesher resolves.
WIDTH = 100.0
#: Clean length (widths) on either side, over which the profile relaxes to 1e-7.
CLEAR = 2.0
RADII = {"one wall": (0.1, 0.3, 0.5, 0.8), "facing": (0.05, 0.15, 0.25, 0.4)}
def excess(radius: float, facing: bool = False, refinement: float = REFINEMENT) -> float:
    """Loss of a semicircle of a radius (widths), or of two, in addition to a clean channel, in widths of it.

    facing: a plane of symmetry is the middle of the channel, whose half is the width of the mesh.
    """
    walls = channel_walls(WIDTH, upper="symmetry" if facing else "no slip")
    whole = WIDTH * (1 + facing)
    reach = (radius + CLEAR) * whole
    grid = meshes.half_disc(radius * whole, refinement, (-reach, reach), WIDTH, geometry=2)
    space = Space(replace(grid, walls=walls, topology=replace(grid.topology)))
    return flow.unit_flow(space, Viscous(RIGID)).loss * whole / 12 - 2 * reach / whole


@pytest.mark.slow
@pytest.mark.case(
    "flow-semicircles", kind="benchmark", mutants=("viscosity-swapped", "plane-is-a-wall"),
    references=("semicircle_channel",), runs_with="2", omitted="order 1: flow-inclusion")
@pytest.mark.parametrize("walls", RADII)
def test_semicircles(walls, record):
    """A semicircle on one wall, or two that face each other, lose the head of exact solutions fitted to the walls,
    from slight protuberances to narrow gaps (Jeong & Son 2016).

    Norm: relative difference of the loss in addition to a clean channel.
    """
    for radius in RADII[walls]:
        reference, residual = semicircle_channel.excess_loss(radius, walls == "facing")
        record(at_most(f"R = {radius:g} W", abs(excess(radius, walls == "facing") / reference - 1), 1e-3,
                       "the promise of accurate"),
               at_most(f"velocity on the walls, reference, R = {radius:g} W", residual, 1e-4,
                       "a tenth of the compared difference"))
