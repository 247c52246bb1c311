"""Geometry of the pore (2.3.3, 3.1): the outline, the meshed extent, and which nodes must close a film."""
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from repro.fem import geometry
from repro.fem.geometry import BOTTOM, FREE, TOP, Outline
from repro.march import coupling
from repro.model import remeshing
from tests import oracles
from tests.strategies import (
    attached_aggregates,
    lengths,
    mirrored,
    outlines,
    plug,
    refinements,
    scenes,
    share,
    widths,
)

FILM, ANGLE = 2.0, np.radians(16.7)


@pytest.mark.parametrize("refinement", [0.5, 1.0, 2.5])
def test_the_seed_is_a_half_disc_on_the_wall_centred_at_its_fixed_point(refinement):
    """Mutant: an arc of radius R (1 + 1e-3), a base off the wall, a fixed point beside the origin."""
    seed = geometry.seed(5.0, refinement)
    free = seed.wall == FREE
    assert np.hypot(*seed.points[free].T) == pytest.approx(5.0, rel=1e-15)
    assert (seed.points[free, 1] > 0).all() and (seed.points[~free, 1] == 0).all()
    assert (seed.wall[~free] == BOTTOM).all()
    assert (seed.upstream, seed.downstream, seed.thickness) == (-5.0, 5.0, 5.0)
    assert (seed.points[seed.fixed] == 0).all() and seed.fixed.sum() == 1
    assert (seed.origin == seed.points).all()


def test_the_seed_has_the_area_of_the_polygon_inscribed_in_the_half_disc():
    """n chords cut a half-disc to n R^2 sin(pi/n) / 2. Mutant: clockwise nodes, a node repeated, a node left out."""
    seed = geometry.seed(5.0)
    chords = int((seed.wall == FREE).sum()) + 1
    assert seed.area == pytest.approx(chords * 12.5 * np.sin(np.pi / chords), rel=1e-14)
    assert seed.area == pytest.approx(np.pi * 12.5, rel=3e-3)


def test_the_interface_is_what_borders_the_fluid():
    """Mutant: an edge counted as interface when *either* end is on a wall, or never between two different walls."""
    sides = plug(50.0, -10.0, 10.0)
    assert sides.interface_edges().tolist() == [False, False, True, False, False, True]
    seed = geometry.seed(5.0)
    assert seed.interface_edges().sum() == (seed.wall == FREE).sum() + 1


@given(attached_aggregates(width=widths), refinements)
def test_refining_an_outline_keeps_its_shape_exactly(drawn, refinement):
    """Area to round-off; interface nodes, ends of contact and fixed points to the last bit; walls straight.

    Mutant: short interface edges merged, an edge's middle moved onto a smooth curve, the fixed point resampled away.
    """
    outline, width = drawn
    sizing = geometry.Sizing(width, refinement, FILM)
    sizes = geometry.interface_sizes(outline, sizing)
    fine = geometry.refine_outline(outline, sizes, sizing)
    assert fine.area == pytest.approx(outline.area, rel=1e-13)
    kept = {tuple(p) for p in fine.points}
    assert {tuple(p) for p in outline.points[outline.wall == FREE]} <= kept
    assert {tuple(p) for p in outline.points[[0, 10]]} <= kept
    assert fine.points[fine.fixed].tolist() == outline.points[outline.fixed].tolist()
    assert (fine.points[fine.wall == BOTTOM, 1] == 0).all() and (fine.points[fine.wall == FREE, 1] > 0).all()
    edge = np.linalg.norm(np.roll(fine.points, -1, axis=0) - fine.points, axis=1)[fine.interface_edges()]
    assert edge.max() <= geometry.SPLIT * sizes.max() * (1 + 1e-12)


@given(st.floats(1.5, 4.0))
def test_new_nodes_of_a_grown_seed_remember_its_arc(stretch):
    """Between nodes that were on the half-circle at t = 0 the material was on it too; on the wall it was on the wall.
    Mutant: origins on the chord, or drawn to the arc on the wall as well."""
    old = geometry.seed(5.0, 0.5)
    grown = Outline(old.points * [stretch, 1.1 * stretch], old.wall, old.fixed, old.origin)
    fine = geometry.refine_outline(grown, np.full(len(old.points), 0.5), geometry.Sizing(14.0, 1.0, FILM))
    free = fine.wall == FREE
    assert free.sum() > (old.wall == FREE).sum()
    assert np.hypot(*fine.origin[free].T) == pytest.approx(5.0, rel=1e-9)
    assert fine.origin[~free] * [stretch, 1.0] == pytest.approx(fine.points[~free], abs=1e-12)
    assert fine.area == pytest.approx(grown.area, rel=1e-13)


@given(widths, st.floats(-20.0, 20.0))
def test_refining_leaves_contact_nodes_exactly_on_their_wall(width, lean):
    """Walls are found by y == W: a node one round-off beside it would slip. Mutant: (1 - t) a + t b in _resample."""
    outline = plug(width, -0.3 * width, 0.4 * width, lean)
    sizing = geometry.Sizing(width, 1.0, FILM)
    fine = geometry.refine_outline(outline, geometry.interface_sizes(outline, sizing), sizing)
    assert (fine.points[fine.wall == TOP, 1] == width).all() and (fine.points[fine.wall == BOTTOM, 1] == 0).all()
    assert ((fine.points[fine.wall == FREE, 1] > 0) & (fine.points[fine.wall == FREE, 1] < width)).all()
    assert fine.area == pytest.approx(outline.area, rel=1e-13)
    assert fine.fixed.sum() == 2 and (fine.wall == FREE).sum() > 0


@given(attached_aggregates(width=widths), refinements)
def test_an_outline_is_too_coarse_where_an_edge_is_twice_what_is_wanted(drawn, refinement):
    """Never as a new mesh has it; of the same outline, from the refinement on at which its longest interface edge is
    2 x 1.4 times the mean of the sizes wanted at its ends. Mutants: edges on the wall counted too, once for twice, one
    end's size for the mean."""
    outline, width = drawn
    sizing = geometry.Sizing(width, refinement, FILM)
    fine = geometry.refine_outline(outline, geometry.interface_sizes(outline, sizing), sizing)
    assert not geometry.too_coarse(fine, sizing)
    sizes, first = geometry.interface_sizes(fine, sizing), np.flatnonzero(fine.interface_edges())
    second = (first + 1) % len(fine.points)
    length = np.hypot(*(fine.points[first] - fine.points[second]).T)
    longest = (length / (0.5 * (sizes[first] + sizes[second]))).max()
    for part, wanted in ((0.999, False), (1.001, True)):
        finer = replace(sizing, refinement=part * refinement * 2.8 / longest)
        assert geometry.too_coarse(fine, finer) == wanted


@given(outlines(width=widths), lengths)
def test_the_meshed_extent_follows_section_3_1(drawn, length):
    """On each side min(10 R, 1.5 W) of fluid, or all that the pore has, for any aggregate anywhere in it. Mutant: 10 R
    alone, max for min, one end's cap, the thickness of the other side, the length in place of its half."""
    outline, width = drawn
    found = geometry.meshed_extent(outline, width, length)
    assert found == pytest.approx(oracles.extent(outline.points, width, length), rel=1e-12)
    assert -length / 2 <= found[0] and found[1] <= length / 2
    assert geometry.meshed_extent(outline, width, length, whole=True) == (-length / 2, length / 2)


@given(outlines(width=widths), lengths, st.floats(0.0, 1.2), st.booleans())
def test_the_mesh_is_extended_once_the_aggregate_is_too_close_to_its_end(drawn, length, part, right):
    """Too short under min(7 R, 1.3 W), never as it was made, and never where the pore has no more to mesh. Mutant: only
    one end looked at, 1.5 W for 1.3 W, the pore's end taken for too short."""
    outline, width = drawn
    ends = list(geometry.meshed_extent(outline, width, length))
    assert not geometry.extent_too_short(outline, tuple(ends), width, length)
    least = min(7 * outline.thickness, 1.3 * width)
    ends[right] = outline.downstream + part * least if right else outline.upstream - part * least
    more = ends[right] < length / 2 if right else ends[right] > -length / 2
    if abs(part - 1) > 1e-9:
        assert geometry.extent_too_short(outline, tuple(ends), width, length) == (part < 1 and more)
    assert not geometry.extent_too_short(outline, (-length / 2, length / 2), width, length)


@share(0.4)
@given(scenes())
def test_the_mesh_of_a_run_has_the_extent_of_section_3_1(made):
    """Whenever a mesh is made; and later, however it has moved, never under min(7 R, 1.3 W) where there is pore left.
    Mutant: a remesh that keeps the old ends, the aggregate's ends of t = 0."""
    width, length = made.pore.width, made.pore.length
    for instant in coupling.simulate(made):
        now, reach = instant.pore, min(7 * instant.pore.outline.thickness, 1.3 * width)
        assert now.outline.upstream - now.mesh.ends[0] >= reach or now.mesh.ends[0] == -length / 2
        assert now.mesh.ends[1] - now.outline.downstream >= reach or now.mesh.ends[1] == length / 2
        again = remeshing.remesh(made, now, now, instant.solved).mesh
        assert again.ends == pytest.approx(oracles.extent(now.outline.points, width, length), rel=1e-12)
        assert (again.points[:, 0].min(), again.points[:, 0].max()) == again.ends


def test_the_extents_of_the_paper():
    """110 um at first (C07), 2 (30 + 75) = 210 um with a half-width of 30 um (C08), the whole pore, 3 W without
    biomass."""
    assert np.ptp(geometry.meshed_extent(geometry.seed(5.0), 50.0, 600.0)) == 110.0
    assert np.ptp(geometry.meshed_extent(geometry.seed(30.0), 50.0, 600.0)) == 210.0
    assert geometry.meshed_extent(geometry.seed(5.0), 50.0, 80.0) == (-40.0, 40.0)
    assert np.ptp(geometry.meshed_extent(None, 50.0, 600.0)) == 150.0


@given(attached_aggregates(width=widths), refinements)
def test_element_sizes_resolve_aggregate_pore_and_film(drawn, refinement):
    """A tenth of the thickness, a fourteenth of the width, a tenth of the film. Mutant: no film term, film under a
    plug."""
    outline, width = drawn
    sizing = geometry.Sizing(width, refinement, FILM)
    size = geometry.interface_sizes(outline, sizing) * refinement
    assert size.max() <= min(outline.thickness / 10, width / 14) * (1 + 1e-12)
    film = np.maximum(width - outline.points[:, 1], FILM)
    assert (size <= np.where(outline.wall == FREE, film / 10, np.inf) * (1 + 1e-12)).all()
    across = plug(width, -0.1 * width, 0.1 * width)
    size = geometry.interface_sizes(across, sizing) * refinement
    assert size == pytest.approx(width / 14, rel=1e-14)


def beside_contact(along, gap, then=(30.0, 20.0), width=100.0):
    """Lower contact from x = -40 to 10 um; the next node is ``gap`` over the wall, ``along`` beyond the contact
    line."""
    points = np.array([[-40.0, 0.0], [0.0, 0.0], [10.0, 0.0], [10.0 + along, gap], then, (-30.0, 30.0)])
    wall = np.array([BOTTOM] * 3 + [FREE] * 3)
    return Outline(points, wall, np.arange(6) == 1, points.copy())


def joins(outline, width=100.0):
    return geometry.closing_nodes(outline, width, FILM, ANGLE).tolist()


NONE = [FREE] * 6


@pytest.mark.parametrize("name, outline, wanted", [
    ("a wedge of 11 degrees closes", beside_contact(1.0, 0.2), [0, 0, 0, BOTTOM, 0, 0]),
    ("a wedge of 16.6 degrees closes", beside_contact(1.0, np.tan(np.radians(16.6))), [0, 0, 0, BOTTOM, 0, 0]),
    ("a wedge of 16.8 degrees stays", beside_contact(1.0, np.tan(np.radians(16.8))), NONE),
    ("a gap over 2 um stays whatever its angle", beside_contact(10.0, 2.1), NONE),
    ("a thin gap far from contact closes", beside_contact(10.0, 1.9), [0, 0, 0, BOTTOM, 0, 0]),
    ("a node through the wall closes", beside_contact(1.0, -0.01), [0, 0, 0, BOTTOM, 0, 0]),
    ("so does one that leans back over the contact", beside_contact(-1.0, -0.01), [0, 0, 0, BOTTOM, 0, 0]),
    ("a steep side stays", beside_contact(-1.0, 0.5), NONE),
    ("no fluid is trapped behind a closing node", beside_contact(1.0, 3.0, (18.0, 1.5)), [0, 0, 0, BOTTOM, BOTTOM, 0]),
])
def test_what_closes_beside_a_contact_surface(name, outline, wanted):
    """Minimum angle 16.7 degrees, minimum film 2 um (Table 1). Mutant: only the film, only the angle, no look
    behind."""
    assert joins(outline) == wanted
    assert joins(mirrored(outline)) == wanted[::-1]


@pytest.mark.parametrize("gap, closes", [(2.01, False), (1.99, True), (0.0, True), (-0.5, True)])
def test_a_film_under_2_um_to_the_opposite_wall_closes(gap, closes):
    """Mutant: film > gap turned round, all free nodes closed, the width forgotten."""
    outline = beside_contact(5.0, 30.0, (0.0, 100.0 - gap))
    assert joins(outline) == ([0, 0, 0, 0, TOP, 0] if closes else NONE)


def test_a_wedge_beside_the_upper_contact_closes():
    """With contact on top the film alone no longer closes, the wedge rule does. Mutant: the top's wedges not looked
    at."""
    outline = plug(100.0, -10.0, 10.0)
    points = np.insert(outline.points, 3, [[12.0, 99.8]], axis=0)
    wall, fixed = np.insert(outline.wall, 3, FREE), np.insert(outline.fixed, 3, False)
    near = Outline(points, wall, fixed, points)
    assert joins(near) == [0, 0, 0, TOP, 0, 0, 0]
    assert joins(mirrored(near)) == joins(near)[::-1]
    far = Outline(points - [0, 1.0] * (wall == FREE)[:, None], wall, fixed, points)
    assert joins(far) == [FREE] * 7


@given(st.floats(5.0, 97.9))
def test_a_half_disc_with_a_film_closes_nothing(radius):
    """It meets the wall at 90 degrees. Mutant: an absolute distance to the lower wall closes the nodes beside
    contact."""
    assert not geometry.closing_nodes(geometry.seed(radius), 100.0, FILM, ANGLE).any()


@given(attached_aggregates(thickest=1.02))
def test_closing_is_the_same_in_a_mirror(drawn):
    """Mutant: the contact line followed in one direction only, the sign of the direction lost."""
    outline, width = drawn
    found = geometry.closing_nodes(outline, width, FILM, ANGLE)
    assert geometry.closing_nodes(mirrored(outline), width, FILM, ANGLE).tolist() == found[::-1].tolist()
    assert ((found == FREE) | (outline.wall == FREE)).all()
    over = (outline.wall == FREE) & (width - outline.points[:, 1] < FILM)
    assert (found[over] == TOP).all() and not (found[~over] == TOP).any()


@given(st.floats(0.05, 5.0), st.floats(0.05, 5.0), st.floats(5.0, 50.0))
def test_a_graded_line_spaces_its_nodes_as_asked(near, far, length):
    """From ``near`` at its source up to at most ``far``. Mutant: gradation ignored, ends moved, spacing twice too
    wide."""
    sizing = geometry.Sizing(far * geometry.ACROSS_PORE, 1.0, FILM)
    line = geometry.graded_line((0.0, 3.0), (length, 3.0), np.array([[0.0, 3.0]]), np.array([near]), sizing)
    assert line[0].tolist() == [0.0, 3.0] and line[-1].tolist() == [length, 3.0] and (line[:, 1] == 3.0).all()
    step = np.diff(line[:, 0])
    wanted = np.minimum(far, near + geometry.GRADATION * line[1:, 0])
    assert (step > 0).all()
    if len(step) > 3:
        assert (step <= 1.35 * wanted).all() and (step >= 0.6 * np.minimum(far, near)).all()
