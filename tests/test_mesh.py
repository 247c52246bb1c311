"""The triangulation (3.1): what it covers, how fine and how good it is, that prescribed nodes stay; and the curved
mesh, whose middles are nodes of its own. When a mesh is acceptable is the case mesh_motion-criterion."""
from dataclasses import replace

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from repro.errors import MeshError
from repro.fem import mesh
from repro.fem.mesh import Mesh, curved, triangle_areas
from repro.fem.mesher import unlocked
from repro.fem.outline import TOP
from repro.model import pore
from tests.strategies import (
    LENGTH,
    attached_aggregates,
    bent_inside,
    meshed,
    on_the_boundary,
    plug,
    scene,
    seed,
    widths,
)

both = pytest.mark.parametrize("geometry", [1, 2])


def fluid_regions(grid):
    """Number of pieces of fluid that hang together through edges."""
    edge = grid.topology.cell_edges[~grid.biomass]
    owner = np.repeat(np.arange(len(edge)), 3)
    link = coo_array((np.ones(edge.size), (owner, edge.ravel()))).tocsr()
    return connected_components(link @ link.T)[0]


@both
@pytest.mark.parametrize("radius, width, refinement", [(5, 50, 1), (5, 100, 1), (25, 50, 0.5), (42, 50, 1), (48, 50, 1),
                                                       (27, 50, 2), (98, 100, 1)])
def test_a_new_mesh_is_good(radius, width, refinement, geometry):
    """No triangle under the criterion (measured: 0.63 and up), one piece of fluid, and no node to spare."""
    grid, outline = meshed(seed(float(radius), refinement, geometry), float(width), refinement)
    assert grid.areas.min() > 0 and grid.quality.min() >= mesh.POOR and grid.acceptable()
    assert grid.areas[grid.biomass].sum() == pytest.approx(outline.corners.area, rel=1e-12)
    assert fluid_regions(grid) == 1
    assert len(np.unique(grid.triangles)) == grid.corners and len(np.unique(grid.cells)) == len(grid.points)


@settings(max_examples=20)
@given(attached_aggregates(width=widths) | attached_aggregates(width=widths, geometry=2))
def test_any_outline_keeps_its_nodes_to_the_last_bit_and_its_edges(drawn):
    """The loop is the refined outline, bit for bit; every edge of it is an edge of the mesh, biomass on its left."""
    outline, width = drawn
    grid, fine = meshed(outline, width)
    assert (grid.points[grid.loop] == fine.points).all()
    edges = {(a, b) for t in grid.triangles[grid.biomass] for a, b in zip(t, np.roll(t, -1))}
    corners = grid.straight.loop
    assert {(a, b) for a, b in zip(corners, np.roll(corners, -1))} <= edges
    assert grid.areas.sum() == pytest.approx(np.ptp(grid.ends) * width, rel=1e-12)
    assert grid.area() == pytest.approx(outline.area, rel=1e-12)


@settings(max_examples=5)
@given(widths)
def test_nothing_of_the_rim_is_beside_its_line(width):
    """Nodes of walls, inlet and outlet are known by y == 0, y == W, x == end."""
    grid, _ = meshed(plug(width, -0.3 * width, 0.2 * width, 0.1 * width), width)
    rim = grid.fem.boundary_nodes()
    ends = grid.topology.inlet, grid.topology.outlet
    on = np.isin(rim, np.concatenate([grid.topology.walls, *ends]))
    assert on.all()
    for nodes, x in zip(ends, grid.ends):
        assert (grid.points[nodes, 0] == x).all() and (np.diff(grid.points[nodes, 1]) > 0).all()
        assert grid.points[nodes[[0, -1]], 1].tolist() == [0.0, width]


def test_contact_splits_the_fluid_in_two():
    grid, outline = meshed(plug(50.0, -20.0, 15.0, 5.0))
    assert fluid_regions(grid) == 2
    assert grid.areas[grid.biomass].sum() == pytest.approx(35 * 50, rel=1e-12)
    assert (outline.wall == TOP).sum() > 2 and grid.quality.min() >= mesh.POOR


@pytest.mark.parametrize("film", [25.0, 10.0, 5.0, 2.0])
def test_at_least_six_elements_lie_across_the_film(film):
    """Lines across the film cross 11 to 16 triangles (measured), about two in each layer of nodes; none spans a
    fourth of it."""
    grid, _ = meshed(seed(50.0 - film))
    for x in (-0.11, -0.05, 0.0137, 0.07, 0.13):
        pieces = chords(grid, x)
        assert pieces.sum() == pytest.approx(film, rel=1e-2)
        assert len(pieces) >= 10 and pieces.max() <= film / 4


def chords(grid, x):
    """Lengths of the pieces that the triangles of the fluid hold of the vertical line at x."""
    fluid = shapely.polygons(grid.points[grid.triangles[~grid.biomass]])
    pieces = shapely.length(shapely.intersection(fluid, shapely.LineString([(x, 0.0), (x, grid.width)])))
    return pieces[pieces > 0]


@both
def test_the_same_mesh_twice_is_the_same_bit_for_bit(geometry):
    first, second = (meshed(seed(27.0, 1.0, geometry))[0] for _ in range(2))
    assert first.points.tobytes() == second.points.tobytes()
    assert first.cells.tobytes() == second.cells.tobytes()
    assert first.biomass.tobytes() == second.biomass.tobytes() and first.loop.tobytes() == second.loop.tobytes()


@pytest.mark.parametrize("refinement", [0.5, 1.0, 2.0])
def test_a_finer_mesh_has_quadratically_more_nodes(refinement):
    """Element sizes are divided by the refinement."""
    count = len(meshed(None, refinement=refinement)[0].points)
    assert count == pytest.approx(720 * refinement**2, rel=0.15)


@both
def test_an_impossible_outline_is_refused_with_its_place(geometry):
    start = seed(5.0, 1.0, geometry)
    crossed = start.points.copy()
    crossed[[-3 * geometry, -2 * geometry]] = crossed[[-2 * geometry, -3 * geometry]]
    with pytest.raises(MeshError, match="crosses itself"):
        meshed(replace(start, points=crossed))
    with pytest.raises(MeshError, match="leaves the meshed part"):
        meshed(start, ends=(-4.0, 50.0))
    with pytest.raises(MeshError, match="leaves the meshed part"):
        meshed(start, width=4.9, ends=(-LENGTH / 2, LENGTH / 2))


@pytest.fixture(scope="module")
def made(seeded):
    """Around a half-disc, as a scene makes it."""
    return seeded.mesh


@pytest.fixture(scope="module")
def seeded():
    """Its pore."""
    return pore.seeded(scene("20 um", numerics={"preset": "fast"}))


@pytest.fixture(scope="module")
def grid(made):
    """The same, its inner edges bent too."""
    return bent_inside(made)


def test_middles_belong_to_one_edge_each(seeded):
    """Two triangles share the node of their edge; those given are on the outline."""
    grid = seeded.mesh
    edges = np.sort(grid.cells[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    owned = np.unique(np.column_stack([edges, grid.cells[:, 3:].ravel()]), axis=0)
    for columns in (owned[:, :2], owned[:, 2]):
        assert len(np.unique(columns, axis=0)) == len(owned) == len(grid.points) - grid.corners
    free = seeded.wall == 0
    assert np.allclose(np.hypot(*grid.points[grid.loop][free].T), 20.0, rtol=1e-13)
    ends = 0.5 * (grid.points[grid.loop[::2]] + grid.points[np.roll(grid.loop, -2)[::2]])
    assert (np.hypot(*(grid.points[grid.loop[1::2]] - ends).T) < 1.0).all()


def test_edges_and_their_numbers(made):
    """Each edge once, the same on a straight mesh as on a curved one of the same triangles but for their order; found
    again by its ends, in either order."""
    for topology in (made.topology, made.straight.topology):
        ends = topology.triangles[:, [[0, 1], [1, 2], [2, 0]]]
        assert np.array_equal(np.sort(topology.edges[topology.cell_edges]), np.sort(ends))
        a, b = topology.edges.T
        for first, second in ((a, b), (b, a)):
            assert np.array_equal(topology.edge_numbers(first, second), np.arange(len(topology.edges)))
    both = (np.unique(np.sort(t.edges), axis=0) for t in (made.topology, made.straight.topology))
    assert np.array_equal(*both)


def test_no_triangle_has_two_edges_on_the_boundary_of_its_region():
    """Such a corner's pressure would lock it; others stay as they were, and areas too."""
    grid, _ = meshed(seed(20.0, 0.3, 2).corners, refinement=0.3)
    freed = unlocked(grid)
    before, after = (triangle_areas(one.points, one.triangles) for one in (grid, freed))
    assert after.min() > 0 and after.sum() == pytest.approx(before.sum())
    assert after[freed.biomass].sum() == pytest.approx(before[grid.biomass].sum())
    for region in (freed.biomass, ~freed.biomass):
        assert max(on_the_boundary(freed.triangles[region])) < 2


def test_a_middle_lies_between_the_ends_of_its_edge(grid, made):
    """``edges`` are in the order of the middles' nodes: a linear field keeps its values at straight middles."""
    straight = grid.with_middles(grid.points[: grid.corners])
    inner = np.setdiff1d(np.arange(len(grid.points)), grid.loop)
    assert np.allclose(straight[inner], made.points[inner], rtol=0, atol=1e-12)
    assert np.allclose(grid.with_middles(straight[: grid.corners] @ [2.0, -3.0]), straight @ [2.0, -3.0])


def test_only_triangles_at_the_aggregate_are_bent(made):
    """In a mesh that was made, the others are straight, which ``acceptable`` stands on; and a bent one that is turned
    over is found."""
    straight, others = made.moved(made.with_middles(made.points[: made.corners])), np.ones(len(made.cells), bool)
    bent = made.topology.bent
    others[bent] = False
    assert np.allclose(made.points[made.cells[others]], straight.points[made.cells[others]], rtol=0, atol=1e-12)
    apart = np.abs(made.points[made.cells] - straight.points[made.cells]).max(axis=(1, 2))
    assert not made.biomass[bent[apart[bent] > 0.01]].all() and made.acceptable()
    points = made.points.copy()
    middle = made.loop[np.flatnonzero(points[made.loop, 1] > 10)[0] // 2 * 2 + 1]
    points[middle, 1] += 10.0
    assert not made.moved(points).acceptable()


def test_a_triangle_that_is_turned_over_is_refused(grid):
    """A middle pulled across its triangle; of a straight mesh, a corner."""
    assert not grid.turned_over().any()
    points = grid.points.copy()
    middle = grid.cells[0, 3]
    points[middle] = points[grid.cells[0, 2]]
    with pytest.raises(MeshError, match="a triangle near .* is turned over"):
        grid.moved(points).checked()
    assert triangle_areas(points, grid.cells[:, :3]).min() > 0
    straight = grid.straight.points.copy()
    a, b, c = grid.triangles[0]
    straight[c] = straight[a] + straight[b] - straight[c]
    assert grid.straight.checked() is grid.straight
    with pytest.raises(MeshError, match="a triangle near .* is turned over"):
        grid.straight.moved(straight).checked()


def test_a_clean_channel_has_no_aggregate(made):
    none = np.zeros(len(made.cells), bool)
    straight = Mesh.of(made.points[: made.corners], made.triangles, none, np.empty(0, int), 50.0, made.ends)
    for bare in (straight, curved(straight, None)):
        assert bare.area() == 0 and len(bare.body) == 0 and len(bare.loop) == 0
