"""Quadratic triangles against scikit-fem's, on curved meshes too; the mesh that carries them."""
import numpy as np
import pytest
from skfem import Basis, BilinearForm, ElementTriP1, ElementTriP2, LinearForm, MeshTri2

from repro.curved import elements, pore
from repro.curved.fields import space
from repro.curved.mesh import curved, unlocked
from repro.errors import MeshError
from repro.fem.assembly import local
from repro.fem.mesh import triangle_areas
from tests.strategies import meshed, scene


@pytest.fixture(scope="module")
def made():
    """Around a half-disc, as it was made."""
    return pore.seeded(scene("20 um", numerics={"preset": "fast"})).mesh


@pytest.fixture(scope="module")
def grid(made):
    """The same, its inner edges bent too."""
    points, random = made.points.copy(), np.random.default_rng(1)
    outer = np.concatenate([made.inlet, made.outlet, made.walls, made.loop])
    inner = np.setdiff1d(np.arange(made.corners, len(points)), outer)
    points[inner] += random.uniform(-0.2, 0.2, (len(inner), 2))
    return made.moved(points).checked()


@pytest.fixture(scope="module")
def theirs(grid):
    """scikit-fem's basis on the same triangles, and its own map of six nodes, with our order of nodes."""
    mesh = MeshTri2(grid.points.T.copy(), grid.cells[:, :3].T.copy(), sort_t=False)
    plain = Basis(mesh, ElementTriP2())
    doflocs = np.empty((2, plain.N))
    doflocs[:, plain.element_dofs] = grid.points[grid.cells].T
    return Basis(MeshTri2(doflocs, grid.cells[:, :3].T.copy(), sort_t=False), ElementTriP2(), intorder=elements.DEGREE)


def same(ours, others):
    """To 1e-13 of the largest."""
    return np.abs(ours - others).max() <= 1e-13 * np.abs(others).max()


@BilinearForm
def stiffness(u, v, w):
    return u.grad[0] * v.grad[0] + u.grad[1] * v.grad[1]


@BilinearForm
def mass(u, v, w):
    return w.x[0] * u * v


def test_matrices_are_those_of_scikit_fem(grid, theirs):
    """Stiffness, mass with a coefficient that varies, load and areas, on curved triangles. Mutants: the inverse of the
    Jacobian transposed, the middles in the order 12, 20, 01, weights without the determinant."""
    at = grid.places
    assert same(elements.stiffness(at), local(stiffness, theirs))
    x = elements.at_points(grid.points[:, 0], grid.cells)
    assert same(space(grid, 2).mass(x * at.dx), local(mass, theirs))
    load = LinearForm(lambda v, w: v).coo_data(theirs).data.reshape(6, -1).T
    assert same(elements.load(at.dx), load)
    assert same(at.dx.sum(axis=1), theirs.dx.sum(axis=1))


@pytest.mark.parametrize("axis", [0, 1])
def test_the_divergence_is_that_of_scikit_fem(grid, theirs, axis):
    """(q, u_,i) for linear q and quadratic u. Mutant: SLOPES of the wrong function."""
    form = BilinearForm(lambda u, q, w: u.grad[axis] * q)
    ours = elements.LINEAR.T @ (grid.places.dx[:, :, None] * grid.places.slopes[:, :, axis])
    assert same(ours, local(form, theirs, theirs.with_element(ElementTriP1())))


@pytest.mark.parametrize("power", range(elements.DEGREE + 1))
def test_the_quadrature_is_exact_to_its_degree(power):
    """Integral of s^a t^b over the unit triangle: a! b! / (a + b + 2)!. Mutant: DEGREE of the rule one less."""
    from math import factorial
    for a in range(power + 1):
        b = power - a
        s, t = elements.POINTS.T
        exact = factorial(a) * factorial(b) / factorial(power + 2)
        assert elements.WEIGHTS @ (s**a * t**b) == pytest.approx(exact, rel=1e-13)


def test_nodal_functions():
    """One at their node, zero at the others; their sum is one, the sum of their derivatives zero; derivatives are those
    of a quadratic function, to round-off. Mutants: 2 L for 4 L L', derivatives by t and s exchanged."""
    assert np.array_equal(elements.functions(elements.NODES), np.eye(6))
    where = np.random.default_rng(2).uniform(0, 0.5, (20, 2))
    N, dN = elements.functions(where), elements.derivatives(where)
    assert np.allclose(N.sum(axis=1), 1, atol=1e-14) and np.allclose(dN.sum(axis=1), 0, atol=1e-14)
    for k in (0, 1):
        step = np.zeros(2)
        step[k] = 0.25
        central = (elements.functions(where + step) - elements.functions(where - step)) / 0.5
        assert np.allclose(dN[:, :, k], central, atol=1e-13)


def test_places_elsewhere_than_in_the_quadrature(grid):
    """With the derivatives at the nodes, gradients of x and y are the unit vectors there. Mutant: slopes of the
    quadrature's points used all the same."""
    at = elements.places(grid.points[grid.cells], elements.AT_NODES, elements.AT_NODES, np.ones(6))
    unit = at.slopes @ grid.points[grid.cells][:, None]
    assert at.dx.shape == (len(grid.cells), 6) and np.allclose(unit, np.eye(2), atol=1e-12)


def test_middles_belong_to_one_edge_each():
    """Two triangles share the node of their edge; those given are on the outline. Mutant: middles by triangle, given
    middles in another order."""
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


def test_no_triangle_has_two_edges_on_the_boundary_of_its_region():
    """Such a corner's pressure would lock it; others stay as they were, and areas too. Mutants: unlocked does nothing,
    a flip that turns a triangle over."""
    grid, _ = meshed(pore.outline.corners(pore.outline.seed(20.0, 0.3)), refinement=0.3)
    freed = unlocked(grid)
    areas = triangle_areas(freed.points, freed.triangles)
    assert areas.min() > 0 and areas.sum() == pytest.approx(triangle_areas(grid.points, grid.triangles).sum())
    assert areas[freed.biomass].sum() == pytest.approx(triangle_areas(grid.points, grid.triangles)[grid.biomass].sum())
    edges = np.sort(freed.triangles[:, [[0, 1], [1, 2], [2, 0]]], axis=2)
    keys = [(tuple(edge), bool(b)) for three, b in zip(edges, freed.biomass) for edge in three]
    alone = np.array([keys.count(key) == 1 for key in keys]).reshape(-1, 3).sum(axis=1)
    assert (alone < 2).all()


def test_a_middle_lies_between_the_ends_of_its_edge(grid, made):
    """``edge_ends`` are in the order of the middles' nodes: a linear field keeps its values at straight middles.
    Mutants: the edges of a triangle in another order than its middles, middles at one of the ends."""
    straight = grid.with_middles(grid.points[: grid.corners])
    inner = np.setdiff1d(np.arange(len(grid.points)), grid.loop)
    assert np.allclose(straight[inner], made.points[inner], rtol=0, atol=1e-12)
    assert np.allclose(grid.with_middles(straight[: grid.corners] @ [2.0, -3.0]), straight @ [2.0, -3.0])


def test_only_triangles_at_the_aggregate_are_bent(made):
    """In a mesh that was made, the others are straight, which ``acceptable`` stands on; and a bent one that is turned
    over is found. Mutants: those of the biomass alone, those of the fluid."""
    straight, others = made.moved(made.with_middles(made.points[: made.corners])), np.ones(len(made.cells), bool)
    others[made.bent] = False
    assert np.allclose(made.points[made.cells[others]], straight.points[made.cells[others]], rtol=0, atol=1e-12)
    apart = np.abs(made.points[made.cells] - straight.points[made.cells]).max(axis=(1, 2))
    assert not made.biomass[made.bent[apart[made.bent] > 0.01]].all() and made.acceptable()
    points = made.points.copy()
    middle = made.loop[np.flatnonzero(points[made.loop, 1] > 10)[0] // 2 * 2 + 1]
    points[middle, 1] += 10.0
    assert not made.moved(points).acceptable()


def test_a_triangle_that_is_turned_over_is_refused(grid):
    """A middle pulled across its triangle. Mutant: only the corners' area looked at."""
    assert not grid.turned_over().any()
    points = grid.points.copy()
    middle = grid.cells[0, 3]
    points[middle] = points[grid.cells[0, 2]]
    with pytest.raises(MeshError, match="a curved triangle near .* is turned over"):
        grid.moved(points).checked()
    assert triangle_areas(points, grid.cells[:, :3]).min() > 0


def test_a_clean_channel_has_no_aggregate():
    """Mutant: an outline of no nodes."""
    made = pore.seeded(scene("20 um", numerics={"preset": "fast"}))
    bare = curved(made.mesh.straight.__class__(made.mesh.points[:made.mesh.corners], made.mesh.cells[:, :3],
                                               0 * made.mesh.biomass > 0, np.empty(0, int), 50.0, made.mesh.ends), None)
    assert bare.area() == 0 and len(bare.body) == 0 and len(bare.loop) == 0
