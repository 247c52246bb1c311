"""The triangulation (3.1): coverage, prescribed nodes, bent triangles, splines and quadrature. The case mesh_motion-
criterion tests when a mesh is acceptable, `test_sizing.py` its element sizes, and the cases of the stage mesh_motion
where moved nodes go."""
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from scipy.interpolate import CubicSpline
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import Delaunay

from repro.errors import MeshError
from repro.fem import elements
from repro.fem import outline as of
from repro.fem.mesh import Mesh, curved, triangle_areas
from repro.fem.mesher import unlocked
from repro.fem.space import Space
from repro.fem.walls import channel_walls
from repro.model.meshing import seeded
from repro.scene import load_scene
from tests import strategies
from tests.strategies import LENGTH, attached_aggregates, bent_inside, meshed, scene, seed, widths

both = pytest.mark.parametrize("geometry", [1, 2])


def fluid_regions(grid):
    """Number of pieces of the fluid that are connected through edges."""
    edge = grid.topology.cell_edges[~grid.biomass]
    owner = np.repeat(np.arange(len(edge)), 3)
    link = coo_array((np.ones(edge.size), (owner, edge.ravel()))).tocsr()
    return connected_components(link @ link.T)[0]


@settings(max_examples=20)
@given(attached_aggregates(width=widths) | attached_aggregates(width=widths, geometry=2))
def test_the_mesh_of_any_outline_keeps_its_nodes_and_edges_exactly(drawn):
    """The loop is the refined outline, bit for bit. Each of its edges is an edge of the mesh with biomass on its left.
    The fluid is one piece, every node belongs to a triangle, and no triangle is poor."""
    outline, width = drawn
    grid, fine = meshed(outline, width)
    assert (grid.points[grid.loop] == fine.points).all()
    edges = {(a, b) for t in grid.triangles[grid.biomass] for a, b in zip(t, np.roll(t, -1))}
    corners = grid.straight.loop
    assert {(a, b) for a, b in zip(corners, np.roll(corners, -1))} <= edges
    assert grid.areas.sum() == pytest.approx(np.ptp(grid.ends) * width, rel=1e-12)
    assert grid.area() == pytest.approx(outline.area, rel=1e-12)
    assert fluid_regions(grid) == 1 and len(np.unique(grid.cells)) == len(grid.points) and grid.acceptable()


@both
def test_an_impossible_outline_is_refused_with_its_place(geometry):
    start = seed(5.0, 1.0, geometry)
    crossed = start.points.copy()
    crossed[[-3 * geometry, -2 * geometry]] = crossed[[-2 * geometry, -3 * geometry]]
    with pytest.raises(MeshError, match="crosses itself"):
        meshed(replace(start, points=crossed))
    for ends in ((-4.0, 50.0), (-50.0, 4.0)):
        with pytest.raises(MeshError, match="leaves the meshed part"):
            meshed(start, ends=ends)
    with pytest.raises(MeshError, match="passes the wall y = 4.9 um at x = .*, y = 5 um"):
        meshed(start, width=4.9, ends=(-LENGTH / 2, LENGTH / 2))
    with pytest.raises(MeshError, match="passes the wall y = 0 um at x = .*, y = -0.1 um"):
        meshed(replace(start, points=start.points - [0.0, 0.1]), ends=(-LENGTH / 2, LENGTH / 2))


def test_only_triangles_at_the_aggregate_are_bent():
    """The others are straight in a new mesh, as ``acceptable`` assumes. A bent triangle that is turned over is
    refused. The case mesh_motion-criterion tests how far one may be bent."""
    grid = seeded(scene("20 um", numerics={"preset": "fast"})).mesh
    straight, unbent = grid.moved(grid.with_middles(grid.points[: grid.corners])), np.ones(len(grid.cells), bool)
    bent = grid.topology.bent
    unbent[bent] = False
    assert np.allclose(grid.points[grid.cells[unbent]], straight.points[grid.cells[unbent]], rtol=0, atol=1e-12)
    distance = np.abs(grid.points[grid.cells] - straight.points[grid.cells]).max(axis=(1, 2))
    assert not grid.biomass[bent[distance[bent] > 0.01]].all() and grid.acceptable()
    points = grid.points.copy()
    middle = grid.loop[np.flatnonzero(points[grid.loop, 1] > 10)[0] // 2 * 2 + 1]
    points[middle, 1] += 10.0
    assert not grid.moved(points).acceptable()
    with pytest.raises(MeshError, match="a triangle near .* is turned over"):
        grid.moved(points).checked()


@pytest.mark.parametrize("biomass", [False, True])
@pytest.mark.parametrize("first", [0, 1, 2])
def test_cornered_triangles_are_freed_in_either_region_for_any_first_node(biomass, first):
    """Two of the four corners of a square belong to one triangle only."""
    points = np.array([[x, y] for y in range(3) for x in range(3)], float)
    corner = np.array([0, 1, 3, 4])[:, None]
    triangles = np.roll(np.vstack([corner + [0, 1, 4], corner + [0, 4, 3]]), first, axis=1)
    grid = Mesh.of(points, triangles, np.full(8, biomass), (), channel_walls(2.0), (0.0, 2.0))
    assert strategies.boundary_edge_counts(grid.triangles) == [0, 0, 1, 1, 1, 1, 2, 2]
    freed = unlocked(grid)
    assert strategies.boundary_edge_counts(freed.triangles) == [1] * 8
    assert triangle_areas(points, freed.triangles) == pytest.approx(np.full(8, 0.5))


# ---------------------------------------------------------------- nodes of the ends and of the walls


@both
@pytest.mark.parametrize("across", [1, 3])
def test_ends_and_walls_have_the_nodes_that_lie_on_them(geometry, across):
    """Their coordinates give them: those of an end from the lower wall up, each once. If a single edge crosses the
    pore, its middle is on no wall."""
    x, y = np.meshgrid(np.linspace(-2.0, 2.0, 4), np.linspace(0.0, 1.0, across + 1))
    points = np.column_stack([x.ravel(), y.ravel()])
    triangles = Delaunay(points).simplices[::-1]
    grid = Mesh.of(points, triangles, np.zeros(len(triangles), bool), (), channel_walls(1.0), (-2.0, 2.0))
    space = Space(grid if geometry == 1 else curved(grid, None))
    x, y = space.points.T
    for end, at in ((space.inlet, -2.0), (space.outlet, 2.0)):
        nodes = np.flatnonzero(x == at)
        assert end.nodes.tolist() == nodes[np.argsort(y[nodes])].tolist()
    assert sorted(space.dofs.walls) == np.flatnonzero((y == 0.0) | (y == 1.0)).tolist()


# ---------------------------------------------------------------- splines


@pytest.mark.parametrize("contact", [False, True])
def test_a_smooth_seed_is_a_natural_spline_through_its_points(contact):
    """Knots are spaced as the square roots of the chords, and each piece has eight edges. Between two points on the
    upper wall the outline is straight, with a node in the middle."""
    top = [(-3.0, 20.0), (2.0, 20.0)] if contact else [(-3.0, 17.0), (2.0, 12.0)]
    given = np.array([(-16.0, 0.0), (-14.0, 9.0), *top, (4.0, 11.0), (11.0, 0.0)])
    knots = np.cumsum([0.0, *np.linalg.norm(np.diff(given, axis=0), axis=1) ** 0.5])
    spline = CubicSpline(knots, given, bc_type="natural")
    pieces = [spline(np.linspace(start, end, 9)[:-1]) for start, end in zip(knots, knots[1:])]
    if contact:
        pieces[2] = [top[0], (-0.5, 20.0)]
    loop = of.polygon(given, channel_walls(20.0), smooth=True).points
    assert np.vstack([loop[2:], loop[:1]])[::-1] == pytest.approx(np.vstack([*pieces, given[-1]]), abs=1e-12)


# ---------------------------------------------------------------- quadrature


@pytest.fixture(scope="module")
def meshes():
    """One triangulation around a half-disc: of linear functions, and of quadratic ones with straight sides, as a scene
    makes it, and with bent inner edges."""
    overrides = ["numerics.preset=accurate", "numerics.refinement=0.5", "aggregate.radius=20 um"]
    curved_mesh = seeded(load_scene("base", overrides)).mesh
    straight = curved_mesh.straight
    return {"linear": straight, "straight sides": curved(straight, None), "made": curved_mesh,
            "bent": bent_inside(curved_mesh)}


@pytest.mark.parametrize("kind", ["linear", "straight sides", "made", "bent"])
def test_products_of_two_functions_are_integrated_exactly(meshes, kind):
    """They agree with a rule of degree 14 to round-off, also beside arcs, where the map's determinant is not constant.
    """
    mesh = meshes[kind]
    space, finer = Space(mesh), elements.table(mesh.geometry, 14)
    dx = elements.weights(mesh.points[mesh.cells], finer)
    exact = np.einsum("tq,qa,qb->tab", dx, finer.values, finer.values)
    assert np.abs(space.at.mass(space.at.dx) - exact).max() < 1e-13 * exact.max()


@pytest.mark.parametrize("kind", ["linear", "straight sides", "made", "bent"])
def test_products_of_two_gradients_are_integrated(meshes, kind):
    """Exactly on straight sides. On curved ones they are no polynomials, and err by less than 0.01 %, the error that
    the preset exact promises."""
    mesh = meshes[kind]
    dx, gradients = elements.mapped(mesh.points[mesh.cells], elements.table(mesh.geometry, 14))
    exact = np.einsum("tq,tqka,tqkb->tab", dx, gradients, gradients)
    bound = 1e-12 if kind in ("linear", "straight sides") else 1e-4
    assert np.abs(Space(mesh).stiffness - exact).max() < bound * np.abs(exact).max()
