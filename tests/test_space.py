"""Linear functions on straight triangles and quadratic ones on curved triangles: quadrature rules and nodes of the
boundary. The cases of flow, transport and growth test their use."""
import numpy as np
import pytest

from repro.fem import elements
from repro.fem.mesh import Mesh, curved
from repro.fem.space import Space
from repro.fem.walls import channel_walls
from repro.model.meshing import seeded
from repro.scene import load_scene
from tests.strategies import bent_inside


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


def test_ends_and_walls_of_a_minimal_mesh_have_their_nodes():
    """A channel of two triangles, whose ends join both walls and whose walls join both ends."""
    corners = np.array([[0.0, 0.0], [3.0, 0.0], [3.0, 1.0], [0.0, 1.0]])
    none = np.zeros(2, bool)
    mesh = Mesh.of(corners, np.array([[0, 1, 2], [0, 2, 3]]), none, (), channel_walls(1.0), (0.0, 3.0))
    for grid in (mesh, curved(mesh, None)):
        space = Space(grid)
        y = space.points[:, 1]
        assert sorted(space.dofs.walls) == np.flatnonzero((y < 1e-12) | (y > 1 - 1e-12)).tolist()
        for nodes in (*space.dofs.inlet, *space.dofs.outlet):
            assert y[nodes] == pytest.approx(np.linspace(y[nodes[0]], y[nodes[-1]], space.order + 1), abs=1e-12)
