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
from tests.strategies import (
    attached_aggregates,
    lengths,
    outlines,
    plug,
    refinements,
    widths,
)

FILM = 2.0
#: Of straight edges, or of arcs.
either = attached_aggregates(width=widths) | attached_aggregates(width=widths, geometry=2)


@given(either, refinements)
def test_refining_an_outline_keeps_its_shape_exactly(drawn, refinement):
    """Area, extremes and places at t = 0 to round-off; interface nodes, ends of contact and fixed points to the last
    bit; walls straight."""
    outline, width = drawn
    outline = replace(outline, origin=outline.points * [0.5, 0.7])
    sizing = Sizing(width, refinement, FILM)
    sizes, corners = of.interface_sizes(outline.corners, sizing), outline.corners
    fine = of.split(outline, sizing)
    assert fine.area == pytest.approx(outline.area, rel=1e-13)
    assert fine.geometry == outline.geometry
    assert fine.origin == pytest.approx(fine.points * [0.5, 0.7], rel=1e-12, abs=1e-12)
    found, wanted = ((one.upstream, one.downstream, one.thickness) for one in (fine, outline))
    assert found == pytest.approx(wanted, rel=1e-13)
    kept = {tuple(p) for p in fine.corners.points}
    assert {tuple(p) for p in corners.points[corners.wall == FREE]} <= kept
    assert {tuple(p) for p in corners.points[[0, 10]]} <= kept
    assert fine.points[fine.fixed].tolist() == outline.points[outline.fixed].tolist()
    assert (fine.points[fine.wall == BOTTOM, 1] == 0).all() and (fine.points[fine.wall == FREE, 1] > 0).all()
    fine = fine.corners
    edge = np.linalg.norm(np.roll(fine.points, -1, axis=0) - fine.points, axis=1)[fine.interface_edges()]
    unequal = 1.0 if outline.geometry == 1 else 1.35  # parts of an arc are equal in t
    assert edge.max() <= unequal * of.SPLIT * sizes.max() * (1 + 1e-12)


@given(widths, st.floats(-20.0, 20.0))
def test_refining_leaves_contact_nodes_exactly_on_their_wall(width, lean):
    """Walls are found by y == W: a node one round-off beside it would slip."""
    outline = plug(width, -0.3 * width, 0.4 * width, lean)
    sizing = Sizing(width, 1.0, FILM)
    fine = of.split(outline, sizing)
    assert (fine.points[fine.wall == TOP, 1] == width).all() and (fine.points[fine.wall == BOTTOM, 1] == 0).all()
    assert ((fine.points[fine.wall == FREE, 1] > 0) & (fine.points[fine.wall == FREE, 1] < width)).all()
    assert fine.area == pytest.approx(outline.area, rel=1e-13)
    assert fine.fixed.sum() == 2 and (fine.wall == FREE).sum() > 0


@given(either, refinements)
def test_an_outline_is_too_coarse_where_an_edge_is_twice_what_is_wanted(drawn, refinement):
    """Never as a new mesh has it; of the same outline, from the refinement on at which its longest interface edge is
    2 x 1.4 times the mean of the sizes wanted at its ends."""
    outline, width = drawn
    sizing = Sizing(width, refinement, FILM)
    fine = of.split(outline, sizing).corners
    assert not of.too_coarse(fine, sizing)
    sizes, first = of.interface_sizes(fine, sizing), np.flatnonzero(fine.interface_edges())
    second = (first + 1) % len(fine.points)
    length = np.hypot(*(fine.points[first] - fine.points[second]).T)
    longest = (length / (0.5 * (sizes[first] + sizes[second]))).max()
    for part, wanted in ((0.999, False), (1.001, True)):
        finer = replace(sizing, refinement=part * refinement * 2.8 / longest)
        assert of.too_coarse(fine, finer) == wanted


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


@given(attached_aggregates(width=widths), refinements)
def test_element_sizes_resolve_aggregate_pore_and_film(drawn, refinement):
    """A tenth of the thickness, a fourteenth of the width, a tenth of the film."""
    outline, width = drawn
    sizing = Sizing(width, refinement, FILM)
    size = of.interface_sizes(outline, sizing) * refinement
    assert size.max() <= min(outline.thickness / 10, width / 14) * (1 + 1e-12)
    film = np.maximum(width - outline.points[:, 1], FILM)
    assert (size <= np.where(outline.wall == FREE, film / 10, np.inf) * (1 + 1e-12)).all()
    across = plug(width, -0.1 * width, 0.1 * width)
    size = of.interface_sizes(across, sizing) * refinement
    assert size == pytest.approx(width / 14, rel=1e-14)


@given(st.floats(0.05, 5.0), st.floats(0.05, 5.0), st.floats(5.0, 50.0))
def test_a_graded_line_spaces_its_nodes_as_asked(near, far, length):
    """From ``near`` at its source up to at most ``far``."""
    sizing = Sizing(far * of.ACROSS_PORE, 1.0, FILM)
    line = of.graded_line((0.0, 3.0), (length, 3.0), np.array([[0.0, 3.0]]), np.array([near]), sizing)
    assert line[0].tolist() == [0.0, 3.0] and line[-1].tolist() == [length, 3.0] and (line[:, 1] == 3.0).all()
    step = np.diff(line[:, 0])
    wanted = np.minimum(far, near + of.GRADATION * line[1:, 0])
    assert (step > 0).all()
    if len(step) > 3:
        assert (step <= 1.35 * wanted).all() and (step >= 0.6 * np.minimum(far, near)).all()


def test_sizes_of_a_scene_are_the_meshers():
    """Those that it says; an outline is no half-disc, whose new nodes would lie on its arc."""
    assert Numerics().gradation == of.GRADATION
    said = ["numerics.preset=paper", "pore.width=80 um", "numerics.refinement=0.7", "growth.minimum_film=0.5 um",
            "numerics.gradation=0.2", "numerics.contact_elements=4"]
    outline = json.dumps([["-5 um", "0 um"], ["0 um", "4 um"], ["5 um", "0 um"]])
    for seed, middle in (('position="3 um"', 3.0), (f"outline={outline}", None)):
        found = pore.sized(load_scene("base", [*said, f"aggregate={{{seed}}}"]), 2.0)
        assert found == Sizing(80.0, 0.7, 0.5, 0.2, 2.0, 0.125, middle)
