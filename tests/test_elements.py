"""Elements of order 1, 2 and 3 and their quadratures; and the curved mesh, whose middles are nodes of its own."""
from math import factorial

import numpy as np
import pytest

from repro.errors import MeshError
from repro.fem import elements
from repro.fem.mesh import Mesh, curved, triangle_areas
from repro.fem.mesher import unlocked
from repro.model import pore
from tests.strategies import bent_inside, meshed, scene, seed

ORDERS = pytest.mark.parametrize("order", [1, 2, 3])
WHERE = np.random.default_rng(2).uniform(0, 0.5, (20, 2))
#: Places of the nodes on the unit triangle: corners, then the edges 01, 12 and, of order 3, from 0 to 2, the centre.
NODES = {1: [[0, 0], [1, 0], [0, 1]],
         2: [[0, 0], [1, 0], [0, 1], [1 / 2, 0], [1 / 2, 1 / 2], [0, 1 / 2]],
         3: [[0, 0], [1, 0], [0, 1], [1 / 3, 0], [2 / 3, 0], [2 / 3, 1 / 3], [1 / 3, 2 / 3], [0, 1 / 3], [0, 2 / 3],
             [1 / 3, 1 / 3]]}


@pytest.fixture(scope="module")
def made():
    """Around a half-disc, as it was made."""
    return pore.seeded(scene("20 um", numerics={"preset": "fast"})).mesh


@pytest.fixture(scope="module")
def grid(made):
    """The same, its inner edges bent too."""
    return bent_inside(made)


@ORDERS
def test_nodes_are_where_they_are_taken_to_be(order):
    assert np.allclose(elements.nodes(order), NODES[order], rtol=0, atol=1e-15)
    along = elements.nodes(order)[elements.ON_EDGE[order]]
    assert np.allclose(along, np.column_stack([np.linspace(0, 1, order + 1), np.zeros(order + 1)]), rtol=0, atol=1e-15)


@ORDERS
def test_nodal_functions(order):
    """One at their node, zero at the others; their sum is one, the sum of their derivatives zero."""
    count = (order + 1) * (order + 2) // 2
    assert np.allclose(elements.values(order, elements.nodes(order)), np.eye(count), rtol=0, atol=1e-14)
    N, dN = elements.values(order, WHERE), elements.derivatives(order, WHERE)
    assert N.shape == (20, count) and dN.shape == (20, count, 2)
    assert np.allclose(N.sum(axis=1), 1, atol=1e-14) and np.allclose(dN.sum(axis=1), 0, atol=1e-13)


@pytest.mark.parametrize("order, step, bound", [(1, 0.25, 1e-13), (2, 0.25, 1e-13), (3, 1e-4, 41e-8)])
def test_derivatives_are_those_of_the_functions(order, step, bound):
    """Central differences are exact of quadratic functions; of cubic ones they err by the step squared times the third
    derivative, 81 / 2."""
    found = elements.derivatives(order, WHERE)
    for axis in (0, 1):
        move = step * np.eye(2)[axis]
        central = (elements.values(order, WHERE + move) - elements.values(order, WHERE - move)) / (2 * step)
        assert np.abs(found[:, :, axis] - central).max() < bound


@pytest.mark.parametrize("order, degree", [*elements.DEGREES.items(), *elements.GRADIENT_DEGREES.items()])
def test_the_quadrature_is_exact_to_its_degree(order, degree):
    """Integral of s^a t^b over the unit triangle: a! b! / (a + b + 2)!."""
    of = elements.table(order, 1, degree)
    s, t = of.linear[:, 1:].T
    for power in range(degree + 1):
        for a in range(power + 1):
            exact = factorial(a) * factorial(power - a) / factorial(power + 2)
            assert of.weights @ (s**a * t**(power - a)) == pytest.approx(exact, rel=1e-13)


@ORDERS
def test_the_quadrature_of_edges_is_exact_to_its_degree(order):
    """Of products of two functions of the order and a speed of the same; nodes of the edge 01 in turn."""
    along, weights = elements.edge_table(order)
    s = along @ np.linspace(0, 1, order + 1)
    assert elements.EDGE_DEGREES[order] >= (3 * order if order > 1 else 2)
    for power in range(elements.EDGE_DEGREES[order] + 1):
        assert weights @ s**power == pytest.approx(1 / (power + 1), rel=1e-13)
    assert np.allclose(along.sum(axis=1), 1, rtol=0, atol=1e-14)


@ORDERS
def test_tables_are_made_once_and_hold_what_they_say(order):
    for geometry in (1, 2):
        of = elements.table(order, geometry, elements.DEGREES[order])
        assert of is elements.table(order, geometry, elements.DEGREES[order])
        where = of.linear[:, 1:]
        assert np.array_equal(of.values, elements.values(order, where))
        assert np.array_equal(of.shape, elements.values(geometry, where))
        assert np.array_equal(of.bends, elements.derivatives(geometry, where))
        assert np.array_equal(elements.values_on(1, of), of.linear)
        pairs = np.einsum("qa,qb->qab", of.values, of.values).reshape(len(where), -1)
        assert np.array_equal(of.products, pairs)


def test_points_elsewhere_than_in_the_quadrature(grid):
    """With the derivatives at the nodes, gradients of x and y are the unit vectors there."""
    where = elements.nodes(2)
    parts = (elements.values(2, where), elements.derivatives(2, where)) * 2
    of = elements.Table(np.ones(6), *parts, elements.values(1, where))
    at = elements.points(grid.points[grid.cells], of)
    unit = at.slopes @ grid.points[grid.cells][:, None]
    assert at.dx.shape == (len(grid.cells), 6) and np.allclose(unit, np.eye(2), atol=1e-12)
    assert np.array_equal(at.dx, elements.weights(grid.points[grid.cells], of))


def test_inverse_and_determinant_of_small_matrices():
    """Against NumPy's."""
    matrix = np.random.default_rng(6).standard_normal((7, 3, 2, 2)) + 3 * np.eye(2)
    det = elements.determinant(matrix)
    assert np.allclose(det, np.linalg.det(matrix), rtol=1e-13)
    assert np.allclose(elements.inverse_transpose(matrix, det), np.swapaxes(np.linalg.inv(matrix), 2, 3), rtol=1e-12)


def test_middles_belong_to_one_edge_each():
    """Two triangles share the node of their edge; those given are on the outline."""
    made = pore.seeded(scene("20 um", numerics={"preset": "fast"}))
    grid = made.mesh
    edges = np.sort(grid.cells[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    owner = {}
    for pair, node in zip(map(tuple, edges), grid.cells[:, 3:].ravel()):
        assert owner.setdefault(pair, node) == node
    assert len(set(owner.values())) == len(owner) == len(grid.points) - grid.corners
    free = made.wall == 0
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
    areas = triangle_areas(freed.points, freed.triangles)
    assert areas.min() > 0 and areas.sum() == pytest.approx(triangle_areas(grid.points, grid.triangles).sum())
    assert areas[freed.biomass].sum() == pytest.approx(triangle_areas(grid.points, grid.triangles)[grid.biomass].sum())
    edges = np.sort(freed.triangles[:, [[0, 1], [1, 2], [2, 0]]], axis=2)
    keys = [(tuple(edge), bool(b)) for three, b in zip(edges, freed.biomass) for edge in three]
    alone = np.array([keys.count(key) == 1 for key in keys]).reshape(-1, 3).sum(axis=1)
    assert (alone < 2).all()


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


def test_a_clean_channel_has_no_aggregate():
    made = pore.seeded(scene("20 um", numerics={"preset": "fast"})).mesh
    none = np.zeros(len(made.cells), bool)
    straight = Mesh.of(made.points[: made.corners], made.triangles, none, np.empty(0, int), 50.0, made.ends)
    for bare in (straight, curved(straight, None)):
        assert bare.area() == 0 and len(bare.body) == 0 and len(bare.loop) == 0
