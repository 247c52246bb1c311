"""Element sizes, the extent of the mesh (3.1), and the nodes of an outline on a new mesh."""
import json
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given

from repro.fem import sizing as of
from repro.fem.outline import Outline, half_disc, polygon
from repro.fem.sizing import Sizing
from repro.fem.walls import BOTTOM, FREE, TOP, Seat, channel_walls
from repro.model import meshing
from repro.model.contact_lines import surface_ends
from repro.model.meshing import initial_outlines, resolution
from repro.scene import Numerics, load_scene
from tests import oracles
from tests.strategies import attached_aggregates, lengths, outlines, refinements, widths

EVERY_GEOMETRY = pytest.mark.parametrize("geometry", [1, 2])
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
    sizing = Sizing(channel_walls(width), refinement, FILM)
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


@EVERY_GEOMETRY
def test_a_new_node_of_a_seed_has_its_material_on_the_seeds_arc(geometry):
    """Straight edges stand for arcs of the circle. The parts of an arc stay on it: at t = 0 the new nodes are their own
    origin, within the sag of the arc from the circle."""
    seed = half_disc(20.0, 4.0, geometry)
    fine = of.split(seed, Sizing(channel_walls(50.0), 2.0, FILM))
    free = fine.wall == FREE
    assert len(fine.points) > 1.5 * len(seed.points) and (fine.fixed.sum(), fine.points[fine.fixed].tolist()) == (
        1, [[0.0, 0.0]])
    on_circle = np.abs(np.hypot(*fine.origin[free].T) - 20.0).max()
    assert on_circle < 1e-12 if geometry == 1 else (fine.origin == fine.points).all() and on_circle > 1e-6


@EVERY_GEOMETRY
def test_a_drawn_aggregate_has_one_fixed_node_on_each_wall(geometry):
    """It is a corner in the middle of the contact surface."""
    drawn = polygon([(-9.0, 0.0), (-3.0, 20.0), (1.0, 20.0), (7.0, 0.0)], channel_walls(20.0), geometry)
    assert drawn.points[drawn.fixed].tolist() == [[-1.0, 0.0], [-1.0, 20.0]]
    assert drawn.fixed[::geometry].sum() == 2


@given(outlines(width=widths), lengths)
def test_the_meshed_extent_follows_section_3_1(drawn, length):
    """Each side has min(10 R, 1.5 W) of fluid, or the rest of the pore, for any aggregate at any position."""
    outline, width = drawn
    extent = of.meshed_extent(outline, width, length)
    assert extent == pytest.approx(oracles.extent(outline.points, width, length), rel=1e-12)
    assert -length / 2 <= extent[0] and extent[1] <= length / 2
    assert of.meshed_extent(outline, width, length, full=True) == (-length / 2, length / 2)
    assert np.ptp(of.meshed_extent(None, width, length)) == pytest.approx(min(3 * width, length), rel=1e-15)


@pytest.mark.exact_lengths
def test_the_mesher_gets_the_sizes_of_the_scene():
    """The mesher gets the scene's sizes. An outline, unlike a half-disc, has no arc for new nodes."""
    assert Numerics().gradation == of.GRADATION
    changes = ["numerics.preset=paper", "pore.width=80 um", "numerics.refinement=0.7", "growth.minimum_film=0.5 um",
            "numerics.gradation=0.2", "numerics.contact_elements=4"]
    outline = json.dumps([["-5 um", "0 um"], ["0 um", "4 um"], ["5 um", "0 um"]])
    for seed, seat in (('position="3 um"', Seat(BOTTOM, 3.0)), ('wall="upper"', Seat(TOP, 0.0)),
                       (f"outline={outline}", Seat(BOTTOM))):
        scene = load_scene("base", [*changes, f"aggregate={{{seed}}}"])
        sizes = replace(meshing.sized(scene), front=2.0)
        assert sizes == Sizing(channel_walls(80.0), 0.7, 0.5, 0.2, 2.0, 0.125, 0.7)
        assert [each.seat for each in initial_outlines(scene)] == [seat]


@pytest.mark.parametrize("key, unit", [("mean_velocity", "m/day"), ("head", "um")])
def test_meshes_are_fine_enough_for_the_fastest_later_flow(key, unit):
    """Curved elements under a table are as fine as under its largest value from the start."""
    course = f'[["0 h", "2 {unit}"], ["1 h", "160 {unit}"], ["2 h", "3 {unit}"]]'
    changes = [["numerics.preset=fast", f"flow.{key}={value}"] for value in (f"2 {unit}", f"160 {unit}", course)]
    slow, fast, over_time = (resolution(load_scene("base", each, unset=["flow.head"])) for each in changes)
    assert over_time == fast > 1.5 * slow


def test_boundary_layers_do_not_refine_films():
    """In a fast flow all elements are finer than in a slow flow, except those in a film."""
    slow, fast = (meshing.sized(load_scene("base", ["numerics.preset=fast", f"flow.mean_velocity={speed} m/day"],
                                        unset=["flow.head"])) for speed in (2, 160))
    assert slow.refinement == slow.film_refinement == fast.film_refinement == 0.2
    assert fast.refinement > 2 * slow.refinement
    tip = np.array([[-3.0, 0.0], [3.0, 0.0], [0.0, slow.width - FILM]])
    outline = Outline(tip, np.array([BOTTOM, BOTTOM, FREE]), np.zeros(3, bool), tip)
    sizes = [of.film_sizes(outline, sizing)[2] for sizing in (slow, fast)]
    assert sizes == pytest.approx([FILM / 10 / 0.2] * 2)


WALLS = pytest.mark.parametrize("wall", [BOTTOM, TOP])
DIRECTIONS = pytest.mark.parametrize("direction", [1, -1])


def rolled(wall, direction, geometry, width=50.0):
    """A tower that spans the pore, after the edge beyond one of its contact lines has joined the wall."""
    tower = np.array([[-25.0, 0.0], [-15.0, width], [15.0, width], [25.0, 0.0]])
    start = of.split(polygon(tower, channel_walls(width), geometry), Sizing(channel_walls(width), 0.7, FILM))
    line, step = next(end for end in surface_ends(start, wall) if end[1] == direction)
    joined = (line + step * np.arange(1, geometry + 1)) % len(start.points)
    points, walls = start.points.copy(), start.wall.copy()
    outwards = np.sign(points[line, 0] - points[line - step, 0])
    points[joined] = points[line] + np.outer(np.arange(1, geometry + 1), [outwards, 0.0])
    walls[joined] = wall
    return replace(start, points=points, wall=walls), start.points[line]


@EVERY_GEOMETRY
@WALLS
@DIRECTIONS
def test_a_corner_of_the_shape_at_t_0_keeps_its_node_on_either_wall(wall, direction, geometry):
    """Its contact line has moved on, and the elements are coarse. Without the node, the area at t = 0 would shrink."""
    outline, corner = rolled(wall, direction, geometry)
    coarse = of.split(outline, Sizing(channel_walls(50.0), 0.3, FILM))
    assert corner.tolist() in coarse.origin.tolist()
    before, after = (replace(each, points=each.origin).area for each in (outline, coarse))
    assert after == pytest.approx(before, rel=1e-12)


@EVERY_GEOMETRY
@pytest.mark.parametrize("degrees, kept", [(59.0, False), (61.0, True)])
def test_only_a_corner_by_more_than_sixty_degrees_keeps_its_node(degrees, kept, geometry):
    """On either side of the corner lies straight contact."""
    x = np.linspace(-10.0, 10.0, 9)
    y = np.maximum(x, 0.0) * np.tan(np.radians(degrees))
    base = np.column_stack([x, 0.0 * x])
    apex = np.array([[0.0, 20.0]])
    points, origin = np.vstack([base, apex]), np.vstack([np.column_stack([x, y]), apex])
    wall = np.array([BOTTOM] * 9 + [FREE])
    corners = Outline(points, wall, np.zeros(10, bool), origin)
    outline = corners if geometry == 1 else replace(
        corners, **{name: np.insert(value, np.arange(1, 11), between, axis=0) for name, value, between in (
            ("points", points, 0.5 * (points + np.roll(points, -1, axis=0))),
            ("origin", origin, 0.5 * (origin + np.roll(origin, -1, axis=0))),
            ("wall", wall, np.where(np.arange(10) < 8, BOTTOM, FREE)),
            ("fixed", np.zeros(10, bool), np.zeros(10, bool)))}, geometry=2)
    assert outline.corners_at_start[4] == kept
    starts = [first for first, _ in of.runs(outline)]
    assert (4 in starts) == kept
