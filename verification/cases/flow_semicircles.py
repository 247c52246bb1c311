"""Benchmarks of a channel with semicircles on its walls: Jeong & Son (2016), and lubrication in a narrow gap.

The losses belong to the semicircles alone: that of a clean channel is subtracted. They are lengths of a clean channel,
in widths. A semicircle is biomass with 10^10 times the viscosity of water. A gap of 0.02 W loses the head of 3 x 10^4
widths of a clean channel, so with 10^6 times the viscosity a fifteenth of the water would pass through the semicircle.
"""
from dataclasses import replace

import numpy as np
import pytest

from reference import semicircle_channel
from repro.fem.space import Space
from repro.fem.walls import channel_walls
from repro.model import flow
from repro.model.resistance import Viscous
from verification.evidence.checks import at_most, between, study
from verification.problems import meshes

RIGID = 1e10
#: Of the elements. That of the preset accurate, 0.45, errs by 0.1 % of a semicircle's own loss.
REFINEMENT = 1.25
#: Width (um) at which the thinnest film, of 0.02 widths, is as thick as the thinnest one that the mesher resolves.
WIDTH = 100.0
#: Clean length (widths) on either side, over which the profile relaxes to 1e-7.
CLEAR = 2.0
RADII = {"one wall": (0.1, 0.3, 0.5, 0.8), "facing": (0.05, 0.15, 0.25, 0.4)}
GAPS = (0.08, 0.056, 0.04, 0.028, 0.02)


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
    references=("semicircle_channel",), runs_with="2", omitted="order 1: flow-half-disc")
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


@pytest.mark.slow
@pytest.mark.case(
    "flow-lubrication", kind="benchmark", mutants=("viscosity-swapped",), references=("semicircle_channel",),
    runs_with="2", omitted="order 1: its own error exceeds the second term")
def test_lubrication(record):
    """The loss in the gap between a semicircle and a wall tends to that of lubrication theory with the first power of
    the gap over the radius, and its coefficient is that of extended lubrication theory and of the circle.

    Norm: loss in addition to a clean channel, over (3 pi / 8) (2 R)^(1/2) / e^(5/2), less one; gaps of 0.08 to 0.02 W.
    """
    gaps = np.array(GAPS)
    radii = 1 - gaps
    losses = np.array([excess(radius) for radius in radii])
    above = losses / [semicircle_channel.film(*pair, terms=1) for pair in zip(radii, gaps)] - 1
    record(study("loss above its limit", gaps / radii, above, 1, "the next term of lubrication theory"),
           between("coefficient over 17/60, the narrowest gap", above[-1] / (17 / 60 * gaps[-1] / radii[-1]), 0.9, 1.1,
                   "the term after it is (e / R)^(3/2) of it"),
           at_most("loss over extended lubrication, the narrowest gap",
                   abs(losses[-1] / semicircle_channel.film(radii[-1], gaps[-1]) - 1), 1e-3, "the promise of accurate"))
