"""How large elements are, how far the mesh reaches (3.1), and where an outline's nodes go for a new mesh."""
import json
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from repro.fem import sizing as of
from repro.fem.outline import BOTTOM, FREE, TOP
from repro.fem.sizing import Sizing
from repro.model import pore
from repro.scene import Numerics, load_scene
from tests import oracles
from tests.strategies import attached_aggregates, lengths, outlines, refinements, widths

FILM = 2.0
#: Of straight edges, or of arcs.
either = attached_aggregates(width=widths) | attached_aggregates(width=widths, geometry=2)


@given(either | outlines(width=widths), refinements)
def test_refining_an_outline_keeps_its_shape_exactly(drawn, refinement):
    """Area, extremes and places at t = 0 to round-off; interface nodes and fixed points to the last bit; nodes of
    walls on them, where they are sought by y == W; sizes of a tenth of the thickness, or a fourteenth of the width, of
    which no edge is too coarse."""
    outline, width = drawn
    outline = replace(outline, origin=outline.points * [0.5, 0.7])
    sizing = Sizing(width, refinement, FILM)
    sizes, corners = of.interface_sizes(outline.corners, sizing), outline.corners
    assert (sizes * refinement).max() <= min(outline.thickness / 10, width / 14) * (1 + 1e-12)
    fine = of.split(outline, sizing)
    assert fine.area == pytest.approx(outline.area, rel=1e-13)
    assert fine.geometry == outline.geometry
    assert fine.origin == pytest.approx(fine.points * [0.5, 0.7], rel=1e-12, abs=1e-12)
    found, wanted = ((one.upstream, one.downstream, one.thickness) for one in (fine, outline))
    assert found == pytest.approx(wanted, rel=1e-13)
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
    """On each side min(10 R, 1.5 W) of fluid, or all that the pore has, for any aggregate anywhere in it."""
    outline, width = drawn
    found = of.meshed_extent(outline, width, length)
    assert found == pytest.approx(oracles.extent(outline.points, width, length), rel=1e-12)
    assert -length / 2 <= found[0] and found[1] <= length / 2
    assert of.meshed_extent(outline, width, length, whole=True) == (-length / 2, length / 2)
    assert np.ptp(of.meshed_extent(None, width, length)) == pytest.approx(min(3 * width, length), rel=1e-15)


@given(outlines(width=widths), lengths, st.floats(0.0, 1.2), st.booleans())
def test_the_mesh_is_extended_once_the_aggregate_is_too_close_to_its_end(drawn, length, part, right):
    """Too short under min(7 R, 1.3 W), never as it was made, and never where the pore has no more to mesh."""
    outline, width = drawn
    ends = list(of.meshed_extent(outline, width, length))
    assert not of.extent_too_short(outline, tuple(ends), width, length)
    least = min(7 * outline.thickness, 1.3 * width)
    ends[right] = outline.downstream + part * least if right else outline.upstream - part * least
    more = ends[right] < length / 2 if right else ends[right] > -length / 2
    if abs(part - 1) > 1e-9:
        assert of.extent_too_short(outline, tuple(ends), width, length) == (part < 1 and more)
    assert not of.extent_too_short(outline, (-length / 2, length / 2), width, length)


def test_sizes_of_a_scene_are_the_meshers():
    """Those that it says; an outline is no half-disc, whose new nodes would lie on its arc."""
    assert Numerics().gradation == of.GRADATION
    said = ["numerics.preset=paper", "pore.width=80 um", "numerics.refinement=0.7", "growth.minimum_film=0.5 um",
            "numerics.gradation=0.2", "numerics.contact_elements=4"]
    outline = json.dumps([["-5 um", "0 um"], ["0 um", "4 um"], ["5 um", "0 um"]])
    for seed, middle in (('position="3 um"', 3.0), (f"outline={outline}", None)):
        found = pore.sized(load_scene("base", [*said, f"aggregate={{{seed}}}"]), 2.0)
        assert found == Sizing(80.0, 0.7, 0.5, 0.2, 2.0, 0.125, middle)
