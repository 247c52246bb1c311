"""Functions of order 1, 2 and 3 on straight and on curved triangles: the order and the geometry are independent."""
import numpy as np
import pytest

from repro.fem import elements
from repro.fem.mesh import Mesh, curved
from repro.fem.space import Space
from repro.model import pore
from repro.scene import load_scene
from tests.strategies import bent_inside, meshed, plug

#: Triangles with three nodes; with six on straight edges; as a scene makes them; and with all inner edges bent.
KINDS = ("straight", "flat", "made", "bent")
orders = pytest.mark.parametrize("order", [1, 2, 3])
kinds = pytest.mark.parametrize("kind", KINDS)
DISC = 20.0


def flattened(mesh):
    """A curved mesh with its middles half way along straight edges."""
    return mesh.moved(mesh.with_middles(mesh.points[: mesh.corners]))


@pytest.fixture(scope="module")
def meshes():
    """One triangulation around a half-disc, of every kind."""
    overrides = ['numerics.preset="accurate"', "numerics.refinement=0.5", f'aggregate.radius="{DISC} um"']
    made = pore.seeded(load_scene("base", overrides)).mesh
    return {"straight": made.straight, "flat": flattened(made), "made": made, "bent": bent_inside(made)}


def polynomial(order, x, y):
    """A polynomial of the order with all its terms, and its gradient; of numbers about one."""
    along = 1 + x - 2 * y
    value = along**order + 0.3 * x**order
    slope = order * along ** (order - 1)
    return value, np.stack([slope + 0.3 * order * x ** (order - 1), -2 * slope])


def at_quadrature(mesh, of):
    """(T, q) x and y of the points of a table."""
    where = np.einsum("qa,tai->tqi", of.shape, mesh.points[mesh.cells])
    return where[..., 0], where[..., 1]


@orders
@pytest.mark.parametrize("kind", ["straight", "flat"])
def test_a_polynomial_of_the_order_is_its_own_interpolant(meshes, kind, order):
    """On straight edges, told by three nodes or by six: what the nodes say is its own value and gradient everywhere,
    so that all triangles agree on their edges."""
    mesh = meshes[kind]
    space = Space(mesh, order)
    nodal = polynomial(order, *space.points.T / 50)[0]
    x, y = at_quadrature(mesh, space.table)
    exact, slope = polynomial(order, x / 50, y / 50)
    assert np.allclose(space.at_points(nodal), exact, rtol=0, atol=1e-11)
    found = np.einsum("tqia,ta->itq", space.at.slopes, nodal[space.cells])
    assert np.allclose(found, slope / 50, rtol=0, atol=1e-11)
    x, y = at_quadrature(mesh, space.gradient_table)
    found = np.einsum("tqia,ta->itq", space.gradients_at.slopes, nodal[space.cells])
    assert np.allclose(found, polynomial(order, x / 50, y / 50)[1] / 50, rtol=0, atol=1e-11)


@orders
@kinds
def test_linear_and_constant_fields_are_exact_on_any_triangle(meshes, kind, order):
    """A curved map holds places themselves where the order is the geometry's or more; with linear functions on curved
    triangles constants alone."""
    mesh = meshes[kind]
    space = Space(mesh, order)
    assert np.allclose(space.at_points(np.full(space.count, 3.0)), 3.0, rtol=0, atol=1e-14)
    assert np.abs(space.at.slopes.sum(axis=3)).max() < 1e-12
    if order >= mesh.geometry:
        field = 3 + 0.7 * space.points[:, 0] - 1.9 * space.points[:, 1]
        x, y = at_quadrature(mesh, space.table)
        assert np.allclose(space.at_points(field), 3 + 0.7 * x - 1.9 * y, rtol=0, atol=1e-11)
        slope = np.einsum("tqia,ta->tqi", space.at.slopes, field[space.cells])
        assert np.allclose(slope, [0.7, -1.9], rtol=0, atol=1e-10)


@orders
@kinds
def test_areas_are_integrated_exactly(meshes, kind, order):
    """The channel is ends x width whatever lies inside; the aggregate is a half-disc as its arcs are, or the polygon of
    its corners. Loads, masses and stiffness are scikit-fem's in `test_weak_forms.py`."""
    mesh = meshes[kind]
    space = Space(mesh, order)
    channel = np.ptp(mesh.ends) * mesh.width
    for dx in (space.at.dx, space.gradients_at.dx):
        assert dx.min() > 0 and dx.sum() == pytest.approx(channel, rel=1e-13)
        assert dx[mesh.biomass].sum() == pytest.approx(mesh.area(), rel=1e-12)
    if order > 1 or mesh.geometry == 1:
        assert space.reaction.dx.sum() == pytest.approx(mesh.area(), rel=1e-12)


@orders
@kinds
def test_products_of_two_functions_are_integrated_exactly(meshes, kind, order):
    """Beside arcs too, where the determinant of the map is not constant: as by a rule of degree 14, to round-off."""
    mesh = meshes[kind]
    space, finer = Space(mesh, order), elements.table(order, mesh.geometry, 14)
    dx = elements.points(mesh.points[mesh.cells], finer).dx
    exact = np.einsum("tq,qa,qb->tab", dx, finer.values, finer.values)
    assert np.abs(space.mass(space.at.dx) - exact).max() < 1e-13 * exact.max()


@pytest.mark.parametrize("kind, error", [("straight", 2e-2), ("made", 1e-5)])
def test_the_aggregate_is_the_half_disc(meshes, kind, error):
    """Arcs come closer than chords."""
    disc = np.pi / 2 * DISC**2
    assert error / 20 < abs(meshes[kind].area() / disc - 1) < error


@orders
@kinds
def test_nodes_of_the_boundary_lie_on_it(meshes, kind, order):
    """In turn from the lower wall up, order + 1 on each edge and one edge after the other."""
    mesh = meshes[kind]
    space = Space(mesh, order)
    for edges, end in ((space.dofs.inlet, mesh.ends[0]), (space.dofs.outlet, mesh.ends[1])):
        nodes = space.end_nodes(edges)
        assert np.abs(space.points[nodes, 0] - end).max() < 1e-9
        assert (np.diff(space.points[nodes, 1]) > 0).all() and len(nodes) == order * len(edges) + 1
        assert edges.shape[1] == order + 1 and (edges[1:, 0] == edges[:-1, -1]).all()
        assert space.points[nodes[[0, -1]], 1].tolist() == [0.0, mesh.width]
    y = space.points[:, 1]
    on_walls = np.flatnonzero((np.abs(y) < 1e-9) | (np.abs(y - mesh.width) < 1e-9))
    assert sorted(space.dofs.walls) == on_walls.tolist(), "each once"
    assert sorted(space.dofs.elimination) == list(range(space.count))


@orders
@kinds
def test_means_of_an_end(meshes, kind, order):
    """Of a parabola that leans to a wall, where the order holds it (else of a straight line). Loads and masses of ends
    are scikit-fem's in `test_weak_forms.py`."""
    mesh = meshes[kind]
    space, W = Space(mesh, order), mesh.width
    y = space.points[:, 1]
    speed, mean = (y, W / 2) if order == 1 else (y * (2 * W - y), 2 * W**2 / 3)
    for edges in (space.dofs.inlet, space.dofs.outlet):
        assert space.end_lengths(edges).sum() == pytest.approx(W, rel=1e-13)
        assert space.mean_over(edges, speed) == pytest.approx(mean, rel=1e-12)


@orders
@kinds
def test_the_triangle_of_each_edge_of_an_end(meshes, kind, order):
    """The one that holds all its nodes, and where they are among its own."""
    mesh = meshes[kind]
    space = Space(mesh, order)
    dofs = space.dofs
    for edges, (owner, place) in ((dofs.inlet, dofs.beside_inlet), (dofs.outlet, dofs.beside_outlet)):
        assert np.array_equal(np.take_along_axis(space.cells[owner], place, axis=1), edges)
        for one, nodes in zip(owner, edges):
            holding = np.isin(space.cells, nodes).sum(axis=1) == order + 1
            assert np.flatnonzero(holding).tolist() == [one]


@orders
def test_ends_and_walls_of_one_edge_each(order):
    """A channel of two triangles, whose ends join both walls and whose walls join both ends."""
    corners = np.array([[0.0, 0.0], [3.0, 0.0], [3.0, 1.0], [0.0, 1.0]])
    none = np.zeros(2, bool)
    mesh = Mesh.of(corners, np.array([[0, 1, 2], [0, 2, 3]]), none, np.empty(0, int), 1.0, (0.0, 3.0))
    for grid in (mesh, curved(mesh, None)):
        space = Space(grid, order)
        y = space.points[:, 1]
        assert sorted(space.dofs.walls) == np.flatnonzero((y < 1e-12) | (y > 1 - 1e-12)).tolist()


@orders
@kinds
def test_fields_of_the_mesh_come_back(meshes, kind, order):
    """Of numbers and of vectors, where the order holds what the mesh's nodes say."""
    mesh = meshes[kind]
    if order < mesh.geometry:
        return
    space, field = Space(mesh, order), np.random.default_rng(5).normal(size=(len(mesh.points), 2))
    for given in (field, field[:, 0]):
        there = space.of_mesh(given)
        assert there.shape == (space.count, *given.shape[1:])
        assert np.allclose(space.to_mesh(there), given, rtol=0, atol=1e-13)


def test_points_for_gradients_are_those_for_products_where_rules_agree(meshes):
    """They are worked out once."""
    for order in (2, 3):
        for kind in KINDS:
            space = Space(meshes[kind], order)
            assert space.gradients_at is space.at
    assert Space(meshes["straight"], 1).gradients_at.dx.shape[1] == 1
    assert Space(meshes["bent"], 1).gradients_at.dx.shape[1] > 1


def test_functions_of_one_order_at_points_of_another(meshes):
    quadratic, cubic = (Space(meshes["made"], order) for order in (2, 3))
    field = np.random.default_rng(7).normal(size=quadratic.count)
    found = field[quadratic.cells] @ quadratic.values_at(cubic.table).T
    assert np.allclose(found, cubic.at_points(cubic.of_mesh(field)), rtol=0, atol=1e-13)


@orders
def test_the_reaction_is_taken_in_the_biomass_alone(meshes, order):
    """At the nodes of the aggregate, lumped, with linear functions; at the quadrature points of its triangles else."""
    mesh = meshes["straight" if order == 1 else "made"]
    space = Space(mesh, order)
    pieces = space.reaction
    if order == 1:
        assert np.array_equal(pieces.cells[:, 0], mesh.body) and pieces.values.tolist() == [[1.0]]
        thirds = np.bincount(mesh.triangles[mesh.biomass].ravel(), np.repeat(mesh.areas[mesh.biomass] / 3, 3))
        assert pieces.dx[:, 0] == pytest.approx(thirds[thirds > 0], rel=1e-13)
    else:
        assert np.array_equal(pieces.cells, space.cells[mesh.biomass])
        assert np.array_equal(pieces.values, space.table.values)
        assert np.array_equal(pieces.dx, space.at.dx[mesh.biomass])


@pytest.mark.parametrize("geometry", [1, 2])
def test_a_plug_from_wall_to_wall_has_its_nodes_on_both(geometry):
    mesh = meshed(plug(50.0, -20.0, 15.0, 5.0))[0]
    mesh = mesh if geometry == 1 else curved(mesh, None)
    for order in (1, 2, 3):
        space = Space(mesh, order)
        inside = np.intersect1d(space.dofs.walls, space.cells[mesh.biomass])
        y = space.points[inside, 1]
        assert np.abs(y).min() < 1e-9 and np.abs(y - 50).min() < 1e-9 and len(inside) > 10 * order


def test_degrees_that_are_integrated():
    """Products of two functions and a linear coefficient on straight triangles."""
    for order in (1, 2, 3):
        assert elements.DEGREES[order] >= 2 * order + (order == 2)
        assert elements.GRADIENT_DEGREES[order] >= (1 if order == 1 else 2 * (order - 1) + 1)
