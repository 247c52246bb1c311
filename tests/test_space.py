"""Functions of order 1, 2 and 3 on straight and on curved triangles: nodes of the boundary, rules.

Values, gradients, masses, loads and the reaction are held to scikit-fem's in `test_weak_forms.py`.
"""
import numpy as np
import pytest

from repro.fem import elements
from repro.fem.mesh import Mesh, curved
from repro.fem.space import Space
from repro.model import pore
from repro.scene import load_scene
from tests.strategies import bent_inside

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


@orders
@kinds
def test_products_of_two_functions_are_integrated_exactly(meshes, kind, order):
    """Beside arcs too, where the determinant of the map is not constant: as by a rule of degree 14, to round-off."""
    mesh = meshes[kind]
    space, finer = Space(mesh, order), elements.table(order, mesh.geometry, 14)
    dx = elements.points(mesh.points[mesh.cells], finer).dx
    exact = np.einsum("tq,qa,qb->tab", dx, finer.values, finer.values)
    assert np.abs(space.mass(space.at.dx) - exact).max() < 1e-13 * exact.max()


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


def test_tables_and_points_are_worked_out_once(meshes):
    """Points for gradients are those for products where rules agree."""
    for order in (2, 3):
        assert elements.table(order, 1, 5) is elements.table(order, 1, 5)
        for kind in KINDS:
            space = Space(meshes[kind], order)
            assert space.gradients_at is space.at
    assert Space(meshes["straight"], 1).gradients_at.dx.shape[1] == 1
    assert Space(meshes["bent"], 1).gradients_at.dx.shape[1] > 1


def test_degrees_that_are_integrated():
    """Products of two functions and a linear coefficient on straight triangles; over edges those of two functions and
    a speed."""
    for order in (1, 2, 3):
        assert elements.EDGE_DEGREES[order] >= (3 * order if order > 1 else 2)
        assert elements.DEGREES[order] >= 2 * order + (order == 2)
        assert elements.GRADIENT_DEGREES[order] >= (1 if order == 1 else 2 * (order - 1) + 1)
