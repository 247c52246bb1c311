"""Sparse solves: right answers, a known order, and an error where there is no answer."""
import numpy as np
import pytest
import scipy.sparse as sp
from hypothesis import given
from hypothesis import strategies as st

from repro.errors import LinearError
from repro.fem import linear
from repro.fem.linear import DEFAULT, Method
from tests import faults
from tests.strategies import meshed

METIS, PARDISO = Method("superlu", "metis"), Method("pardiso", "degree")
OPTIONAL = pytest.mark.parametrize("method, package", [(PARDISO, "pypardiso"), (METIS, "pymetis")])


def solve(matrix, right, method=DEFAULT):
    """x of A x = right."""
    return linear.factorised(matrix, method).solve(right)


def saddle(size, seed):
    """A symmetric indefinite system like Stokes': positive, then negative definite blocks."""
    rng = np.random.default_rng(seed)
    a = sp.random_array((size, size), density=0.2, rng=rng)
    b = sp.random_array((size // 2, size), density=0.3, rng=rng)
    return sp.block_array([[a @ a.T + sp.eye_array(size), b.T], [b, -0.01 * sp.eye_array(size // 2)]], format="csc")


@given(st.integers(4, 40), st.integers(0, 1000))
def test_a_saddle_point_system_is_solved(size, seed):
    """Against the dense solution."""
    matrix = saddle(size, seed)
    right = np.random.default_rng(seed).normal(size=matrix.shape[0])
    dense = matrix.toarray()
    bound = 1e-13 * np.linalg.cond(dense) * max(1.0, np.abs(np.linalg.solve(dense, right)).max())
    assert solve(matrix, right) == pytest.approx(np.linalg.solve(dense, right), rel=1e-9, abs=bound)


def test_one_factorisation_serves_many_right_hand_sides():
    matrix = saddle(30, 5)
    solver = linear.Solver(matrix)
    for seed in range(3):
        exact = np.random.default_rng(seed).normal(size=45)
        assert solver.solve(matrix @ exact) == pytest.approx(exact, abs=1e-8)


def test_a_zero_pivot_is_got_round():
    """Without pivots the factorisation stops, with them it does not."""
    matrix = sp.csc_array(np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 2.0]]))
    assert solve(matrix, np.array([3.0, 5.0, 4.0])) == pytest.approx([5.0, 3.0, 2.0], rel=1e-15)


def test_tiny_pivots_do_not_spoil_the_answer():
    """Elimination in order loses all digits, beyond repair by refinement; the residual says so."""
    rng = np.random.default_rng(3)
    dense = rng.normal(size=(60, 60))
    np.fill_diagonal(dense, 1e-17)
    dense, exact = dense + dense.T, rng.normal(size=60)
    solver = linear.Solver(sp.csc_array(dense))
    assert solver.solve(dense @ exact) == pytest.approx(exact, abs=1e-13 * np.linalg.cond(dense))
    assert solver.pivoted


@pytest.mark.parametrize("matrix", [[[1.0, 1.0], [1.0, 1.0]], [[0.0, 0.0], [0.0, 1.0]],
                                    [[2.0, -1.0, -1.0], [-1.0, 2.0, -1.0], [-1.0, -1.0, 2.0]]])
def test_a_singular_system_is_refused(matrix):
    """Pure Neumann problems among them, whose factors are not exactly singular."""
    with pytest.raises(LinearError, match="singular|residual"):
        solve(sp.csc_array(np.array(matrix)), np.arange(1.0, len(matrix) + 1))


def test_a_node_order_is_a_permutation_that_saves_fill():
    """Every node once; the factor of a Laplacian has under half of the entries that the mesher's order gives."""
    grid, _ = meshed(None)
    count = len(grid.points)
    order = linear.node_order(count, grid.triangles)
    assert np.sort(order).tolist() == list(range(count))
    pairs = np.repeat(grid.triangles, 3, axis=1).ravel(), np.tile(grid.triangles, (1, 3)).ravel()
    graph = sp.csc_array((np.ones(len(pairs[0])), pairs), shape=(count, count)) + sp.diags_array(np.full(count, 20.0))
    fills = [fill(graph[p][:, p]) for p in (order, np.argsort(order), np.arange(count))]
    assert fills[0] < 0.5 * min(fills[1:])


def fill(matrix):
    return sp.linalg.splu(sp.csc_matrix(matrix), permc_spec="NATURAL", diag_pivot_thresh=0.0,
                          options={"SymmetricMode": True}).nnz


def check_alike(method):
    """A method gives the default's solution to round-off, and orders nodes nearly as well."""
    grid = meshed(None, 50.0, 0.6)[0]
    matrix, right = saddle(40, 3), np.ones(60)
    assert solve(matrix, right, method) == pytest.approx(solve(matrix, right), rel=1e-9, abs=1e-9)
    orders = [linear.node_order(len(grid.points), grid.triangles, m) for m in (DEFAULT, method)]
    assert np.sort(orders[1]).tolist() == list(range(len(grid.points)))
    fills = [_fill(grid, order) for order in orders]
    assert fills[1] <= 1.3 * fills[0]


def _fill(grid, order):
    """Entries of the factor of the mesh's Laplacian, its nodes in this order."""
    rows, columns = np.repeat(grid.triangles, 3, axis=1).ravel(), np.tile(grid.triangles, (1, 3)).ravel()
    graph = sp.csc_array((np.ones(len(rows)), (rows, columns)), shape=2 * (len(grid.points),))
    return fill((graph + sp.diags_array(graph.sum(axis=0) + 1.0))[order][:, order])


@OPTIONAL
def test_optional_packages_give_the_same_or_are_named(method, package):
    """The same solution by both, to round-off; one clear error where the package is not there."""
    try:
        __import__(package)
    except ImportError:
        with pytest.raises(LinearError, match=f"package {package} is not installed"):
            method.checked()
        return
    assert method.checked() is method
    check_alike(method)


@OPTIONAL
def test_an_absent_package_is_named_wherever_it_is_asked_for(method, package, monkeypatch):
    """Whether it is installed here or not; the default asks for none."""
    for name in ("pypardiso", "pymetis"):
        faults.absent_package(monkeypatch, name)
    asked = {"pypardiso": lambda: linear.factorised(sp.eye_array(2, format="csc"), method),
             "pymetis": lambda: linear.node_order(3, np.array([[0, 1, 2]]), method)}
    for ask in (method.checked, asked[package]):
        with pytest.raises(LinearError, match=f"package {package} is not installed; pip install {package}"):
            ask()
    assert DEFAULT.checked() is DEFAULT and solve(saddle(4, 1), np.ones(6)).shape == (6,)


@OPTIONAL
def test_what_a_package_does_is_used_as_it_is_meant(method, package, monkeypatch):
    """With a stand-in that does what the package says: it is called, orders are permutations from new to old, and the
    solution is the same."""
    made = faults.stand_in_package(monkeypatch, package)
    matrix, right = saddle(40, 3), np.ones(60)
    assert method.checked() is method
    assert solve(matrix, right, method) == pytest.approx(solve(matrix, right), rel=1e-9, abs=1e-9)
    grid = meshed(None, 50.0, 0.6)[0]
    order = linear.node_order(len(grid.points), grid.triangles, method)
    assert np.sort(order).tolist() == list(range(len(grid.points))) and len(made.calls) == 1
    if package == "pymetis":
        graph, = made.calls
        rows = np.repeat(np.arange(len(grid.points)), np.diff(graph.indptr))
        assert (rows != graph.indices).all() and len(rows) == 2 * len(grid.topology.edges)
        assert _fill(grid, order) < 0.8 * _fill(grid, np.random.default_rng(1).permutation(order))
        assert np.array_equal(order, np.asarray(made.nested_dissection(graph)[0]))
