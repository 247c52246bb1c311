"""Quadratic and cubic fields on curved triangles."""
import numpy as np
import pytest

from repro.curved import fields, pore
from repro.fem import geometry
from repro.march.simulation import simulate
from repro.scene import Numerics, SceneError, load_scene

WHERE = np.random.default_rng(3).uniform(0, 0.5, (20, 2))


@pytest.fixture(scope="module")
def mesh():
    return pore.seeded(load_scene("base", ['numerics.preset="accurate"'])).mesh


def test_each_cubic_function_is_one_at_its_node_alone():
    """And all together are one everywhere. Mutant: nodes of an edge exchanged."""
    assert np.allclose(fields.cubic_functions(fields.THIRDS), np.eye(10), rtol=0, atol=1e-14)
    assert np.allclose(fields.cubic_functions(WHERE).sum(axis=1), 1, rtol=0, atol=1e-14)


def test_slopes_are_those_of_the_functions():
    """Central differences of cubics err by h^2 times the third derivative, 81 / 2. Mutant: L for M in a slope."""
    h = 1e-4
    for axis in (0, 1):
        step = h * np.eye(2)[axis]
        slope = (fields.cubic_functions(WHERE + step) - fields.cubic_functions(WHERE - step)) / (2 * h)
        assert np.abs(slope - fields.cubic_derivatives(WHERE)[:, :, axis]).max() < 41 * h**2


@pytest.mark.parametrize("order", [2, 3])
def test_quadratic_fields_come_back(mesh, order):
    """Of numbers and of vectors. Mutants: weights of the thirds, edges counted from the other corner."""
    here, field = fields.space(mesh, order), np.random.default_rng(5).normal(size=(len(mesh.points), 2))
    for given in (field, field[:, 0]):
        there = here.of_mesh(given)
        assert there.shape == (here.count, *given.shape[1:])
        assert np.allclose(here.to_mesh(there), given, rtol=0, atol=1e-13)


@pytest.mark.parametrize("order", [2, 3])
def test_all_triangles_agree_on_a_field(mesh, order):
    """A polynomial of the order, on straight triangles: what its nodes say is its own value and slope everywhere.
    Mutant: an edge's nodes differ between its triangles."""
    straight = mesh.moved(mesh.with_middles(mesh.points[: mesh.corners]))
    here = fields.space(straight, order)
    x, y = here.points.T / 50
    at = straight.points[straight.cells].swapaxes(1, 2) @ here.of.shape.T / 50
    found = here.at_points((x - 2 * y) ** order + x * y, here.cells)
    assert np.allclose(found, (at[:, 0] - 2 * at[:, 1]) ** order + at[:, 0] * at[:, 1], rtol=0, atol=1e-11)
    slope = np.einsum("tqka,ta->tqk", here.at.slopes, ((x - 2 * y) ** order)[here.cells])
    exact = order * (at[:, 0] - 2 * at[:, 1]) ** (order - 1) / 50
    assert np.allclose(slope, exact[..., None] * [1, -2], rtol=0, atol=1e-11)


@pytest.mark.parametrize("order", [2, 3])
def test_nodes_of_the_boundary_lie_on_it(mesh, order):
    """In turn from the lower wall up. Mutants: an edge's nodes exchanged; walls without the edges' nodes."""
    here = fields.space(mesh, order)
    for edges, end in ((here.inlet, mesh.ends[0]), (here.outlet, mesh.ends[1])):
        nodes = here.end_nodes(edges)
        assert np.abs(here.points[nodes, 0] - end).max() < 1e-9
        assert (np.diff(here.points[nodes, 1]) > 0).all() and len(nodes) == order * len(edges) + 1
    y = here.points[:, 1]
    assert set(here.walls) == set(np.flatnonzero((np.abs(y) < 1e-9) | (np.abs(y - mesh.width) < 1e-9)))


def test_the_same_area_by_both_rules(mesh):
    """Areas of curved triangles are integrals of polynomials that both rules have exactly."""
    quadratic, cubic = (fields.space(mesh, order).at.dx.sum(axis=1) for order in (2, 3))
    assert np.allclose(cubic, quadratic, rtol=1e-13)
    assert fields.space(mesh, 2).at is mesh.places


def test_functions_integrate_to_the_area(mesh):
    here = fields.space(mesh, 3)
    area = here.at.dx.sum()
    assert here.load(here.at.dx).sum() == pytest.approx(area, rel=1e-13)
    assert here.mass(here.at.dx).sum() == pytest.approx(area, rel=1e-12)
    assert np.abs(here.stiffness.sum(axis=2)).max() < 1e-12


def test_a_run_with_cubic_fields():
    """Its rows have what quadratic ones have, and nearly the same. Mutant: the order kept from the solver."""
    found = {}
    for kind in ("quadratic", "cubic"):
        scene = load_scene("base", ['numerics.preset="fast"', f'numerics.elements="{kind}"', 'growth.end="2 h"',
                                    'output.times=["2 h"]'])
        *_, last = simulate(scene)
        assert len(last.solved.concentrations.acceptor) == len(last.solved.flow.velocity) == len(last.pore.mesh.points)
        found[kind] = np.array([last.solved.flow.head_loss, last.pore.outline.area])
    apart = np.abs(found["cubic"] / found["quadratic"] - 1)
    assert (apart > 1e-9).any() and (apart < 1e-2).all()


def test_what_cubic_elements_have_one_way_of_is_refused_by_their_name():
    with pytest.raises(SceneError, match='numerics.elements = "cubic"'):
        load_scene("base", ['numerics.preset="fast"', 'numerics.elements="cubic"', 'numerics.transfer="linear"'])


def test_the_gradation_of_a_scene_is_the_meshers():
    assert Numerics().gradation == geometry.GRADATION
