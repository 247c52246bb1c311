"""Element sizes, the extent of the mesh (3.1), and the nodes of an outline on a new mesh."""
import json
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from repro.fem import sizing
from repro.fem import sizing as of
from repro.fem.outline import BOTTOM, FREE, TOP, half_disc
from repro.fem.sizing import Sizing, split
from repro.model import pore
from repro.model.pore import resolution
from repro.scene import Numerics, load_scene
from tests import oracles, strategies
from tests.strategies import attached_aggregates, lengths, outlines, refinements, widths

FILM = 2.0
#: Aggregates of straight edges, or of arcs.
either = attached_aggregates(width=widths) | attached_aggregates(width=widths, geometry=2)


@given(either | outlines(width=widths), refinements)
def test_refining_an_outline_keeps_its_shape_exactly(drawn, refinement):
    """Area, extremes and coordinates at t = 0 stay to round-off. Interface nodes, fixed points and nodes of walls
    (sought by y == W) stay to the last bit. Sizes are at most a tenth of the thickness and a fourteenth of the width,
    and no edge is too coarse."""
    outline, width = drawn
    outline = replace(outline, origin=outline.points * [0.5, 0.7])
    sizing = Sizing(width, refinement, FILM)
    sizes, corners = of.interface_sizes(outline.corners, sizing), outline.corners
    assert (sizes * refinement).max() <= min(outline.thickness / 10, width / 14) * (1 + 1e-12)
    fine = of.split(outline, sizing)
    assert fine.area == pytest.approx(outline.area, rel=1e-13)
    assert fine.geometry == outline.geometry
    assert fine.origin == pytest.approx(fine.points * [0.5, 0.7], rel=1e-12, abs=1e-12)
    computed, expected = ((one.upstream, one.downstream, one.thickness) for one in (fine, outline))
    assert computed == pytest.approx(expected, rel=1e-13)
    ends = corners.interface_edges() | np.roll(corners.interface_edges(), 1)
    assert {*map(tuple, corners.points[ends])} <= {*map(tuple, fine.corners.points)}
    assert fine.points[fine.fixed].tolist() == outline.points[outline.fixed].tolist()
    y = fine.points[:, 1]
    assert (y[fine.wall == BOTTOM] == 0).all() and (y[fine.wall == TOP] == width).all()
    assert ((y > 0) & (y < width))[fine.wall == FREE].all() and (fine.wall == FREE).any()
    unequal = 1.0 if outline.geometry == 1 else 1.35  # parts of an arc are equal in t
    edges = fine.corners.edge_lengths()[fine.corners.interface_edges()]
    assert edges.max() <= unequal * of.SPLIT * sizes.max() * (1 + 1e-12)
    assert not of.too_coarse(fine.corners, sizing)


@given(outlines(width=widths), lengths)
def test_the_meshed_extent_follows_section_3_1(drawn, length):
    """Each side has min(10 R, 1.5 W) of fluid, or the rest of the pore, for any aggregate at any position."""
    outline, width = drawn
    extent = of.meshed_extent(outline, width, length)
    assert extent == pytest.approx(oracles.extent(outline.points, width, length), rel=1e-12)
    assert -length / 2 <= extent[0] and extent[1] <= length / 2
    assert of.meshed_extent(outline, width, length, full=True) == (-length / 2, length / 2)
    assert np.ptp(of.meshed_extent(None, width, length)) == pytest.approx(min(3 * width, length), rel=1e-15)


@given(outlines(width=widths), lengths, st.floats(0.0, 1.2), st.booleans())
def test_the_mesh_is_extended_once_the_aggregate_is_too_close_to_its_end(drawn, length, part, right):
    """The extent is too short under min(7 R, 1.3 W), but not when new, and not at the end of the pore."""
    outline, width = drawn
    ends = list(of.meshed_extent(outline, width, length))
    assert not of.extent_too_short(outline, tuple(ends), width, length)
    least = min(7 * outline.thickness, 1.3 * width)
    ends[right] = outline.downstream + part * least if right else outline.upstream - part * least
    can_extend = ends[right] < length / 2 if right else ends[right] > -length / 2
    if abs(part - 1) > 1e-9:
        assert of.extent_too_short(outline, tuple(ends), width, length) == (part < 1 and can_extend)
    assert not of.extent_too_short(outline, (-length / 2, length / 2), width, length)


def test_the_mesher_gets_the_sizes_of_the_scene():
    """The mesher gets the scene's sizes. An outline, unlike a half-disc, has no arc for new nodes."""
    assert Numerics().gradation == of.GRADATION
    changes = ["numerics.preset=paper", "pore.width=80 um", "numerics.refinement=0.7", "growth.minimum_film=0.5 um",
            "numerics.gradation=0.2", "numerics.contact_elements=4"]
    outline = json.dumps([["-5 um", "0 um"], ["0 um", "4 um"], ["5 um", "0 um"]])
    for seed, middle in (('position="3 um"', 3.0), (f"outline={outline}", None)):
        sizes = replace(pore.sized(load_scene("base", [*changes, f"aggregate={{{seed}}}"])), front=2.0)
        assert sizes == Sizing(80.0, 0.7, 0.5, 0.2, 2.0, 0.125, middle)


@pytest.mark.parametrize("key, unit", [("mean_velocity", "m/day"), ("head", "um")])
def test_meshes_are_fine_enough_for_the_fastest_later_flow(key, unit):
    """Curved elements under a table are as fine as under its largest value from the start."""
    course = f'[["0 h", "2 {unit}"], ["1 h", "160 {unit}"], ["2 h", "3 {unit}"]]'
    changes = [["numerics.preset=fast", f"flow.{key}={value}"] for value in (f"2 {unit}", f"160 {unit}", course)]
    slow, fast, over_time = (resolution(load_scene("base", each, unset=["flow.head"])) for each in changes)
    assert over_time == fast > 1.5 * slow


@pytest.mark.parametrize("seed", [0.0, -30.0])
def test_a_seed_anywhere_was_round_at_its_start(seed):
    """New nodes on straight edges have initial positions on the seed's arc, to round-off."""
    outline = half_disc(8.0, 4.0, 1, seed)
    finer = split(outline, Sizing(50.0, 1.0, 2.0, seed=seed))
    free = finer.wall == FREE
    assert free.sum() > 1.5 * (outline.wall == FREE).sum()
    assert np.hypot(*(finer.origin[free] - [seed, 0]).T) == pytest.approx(8.0, rel=1e-12)
    assert np.hypot(*(finer.points[free] - [seed, 0]).T).min() < 7.99


def test_elements_are_small_beside_the_upper_wall_s_contact_lines_alone():
    """They grow with the distance from the contact lines."""
    plug_outline = strategies.plug(50.0, -20.0, 15.0, 3.0)
    sizes = sizing.interface_sizes(plug_outline, sizing.Sizing(50.0, 1.0, 1.0, contact=0.1))
    lower, upper = plug_outline.wall == BOTTOM, plug_outline.wall == TOP
    ends = np.array([15.0 + 3.0, -20.0 + 3.0])
    distance = np.abs(plug_outline.points[upper, :1] - ends).min(axis=1)
    assert sizes[upper] == pytest.approx(np.minimum(50.0 / 14, 0.1 + sizing.GRADATION * distance))
    assert sizes[upper].min() == 0.1 and (sizes[lower] == 50.0 / 14).all()
