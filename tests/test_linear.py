"""Sparse solves: right answers, a known order, and an error where there is no answer."""
import numpy as np
import pytest
import scipy.sparse as sp
from hypothesis import given
from hypothesis import strategies as st

from repro.errors import LinearError
from repro.fem import linear
from tests.strategies import meshed


def saddle(size, seed):
    """A symmetric indefinite system like Stokes': positive, then negative definite blocks."""
    rng = np.random.default_rng(seed)
    a = sp.random_array((size, size), density=0.2, rng=rng)
    b = sp.random_array((size // 2, size), density=0.3, rng=rng)
    return sp.block_array([[a @ a.T + sp.eye_array(size), b.T], [b, -0.01 * sp.eye_array(size // 2)]], format="csc")


@given(st.integers(4, 40), st.integers(0, 1000))
def test_a_saddle_point_system_is_solved(size, seed):
    """Against the dense solution. Mutant: the permutation inverted on one side, refinement with the sign turned."""
    matrix = saddle(size, seed)
    right = np.random.default_rng(seed).normal(size=matrix.shape[0])
    dense = matrix.toarray()
    bound = 1e-13 * np.linalg.cond(dense) * max(1.0, np.abs(np.linalg.solve(dense, right)).max())
    assert linear.solve(matrix, right) == pytest.approx(np.linalg.solve(dense, right), rel=1e-9, abs=bound)


def test_one_factorisation_serves_many_right_hand_sides():
    """Mutant: the solver keeps its first solution."""
    matrix = saddle(30, 5)
    solver = linear.Solver(matrix)
    for seed in range(3):
        exact = np.random.default_rng(seed).normal(size=45)
        assert solver.solve(matrix @ exact) == pytest.approx(exact, abs=1e-8)


def test_a_zero_pivot_is_got_round():
    """Without pivots the factorisation stops, with them it does not. Mutant: no second attempt with partial
    pivoting."""
    matrix = sp.csc_array(np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 2.0]]))
    assert linear.solve(matrix, np.array([3.0, 5.0, 4.0])) == pytest.approx([5.0, 3.0, 2.0], rel=1e-15)


def test_tiny_pivots_do_not_spoil_the_answer():
    """Elimination in order loses all digits, beyond repair by refinement; the residual says so. Mutant: the residual
    not looked at."""
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
    """Pure Neumann problems among them, whose factors are not exactly singular. Mutant: what SuperLU leaves is
    returned."""
    with pytest.raises(LinearError, match="singular|residual"):
        linear.solve(sp.csc_array(np.array(matrix)), np.arange(1.0, len(matrix) + 1))


def test_a_node_order_is_a_permutation_that_saves_fill():
    """Every node once; the factor of a Laplacian has under half of the entries that the mesher's order gives.

    Mutant: the inverse permutation, the mesher's order itself.
    """
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


@pytest.fixture
def default():
    """What is chosen for other tests afterwards."""
    yield
    linear.use("superlu", "degree")


@pytest.mark.parametrize("solver, ordering, package", [("pardiso", "degree", "pypardiso"),
                                                       ("superlu", "metis", "pymetis")])
def test_optional_packages_give_the_same_or_are_named(solver, ordering, package, default):
    """The same solution by both, to round-off; one clear error where the package is not there. Mutants: METIS' inverse
    permutation in place of the order, a missing package passed over in silence."""
    try:
        __import__(package)
    except ImportError:
        with pytest.raises(LinearError, match=f"package {package} is not installed"):
            linear.use(solver, ordering)
        return
    grid = meshed(None, 50.0, 0.6)[0]
    elements, right = grid.triangles, np.ones(60)
    matrix = saddle(40, 3)
    expected, plain = linear.solve(matrix, right), linear.node_order(len(grid.points), elements)
    linear.use(solver, ordering)
    assert linear.solve(matrix, right) == pytest.approx(expected, rel=1e-9, abs=1e-9)
    fill = [_fill(grid, order) for order in (plain, linear.node_order(len(grid.points), elements))]
    assert fill[1] <= 1.3 * fill[0]


def _fill(grid, order):
    """Entries of the factor of the mesh's Laplacian, its nodes in this order."""
    rows, columns = np.repeat(grid.triangles, 3, axis=1).ravel(), np.tile(grid.triangles, (1, 3)).ravel()
    graph = sp.csc_array((np.ones(len(rows)), (rows, columns)), shape=2 * (len(grid.points),))
    matrix = sp.csc_matrix((graph + sp.diags_array(graph.sum(axis=0) + 1.0))[order][:, order])
    return sp.linalg.splu(matrix, permc_spec="NATURAL", diag_pivot_thresh=0.0, options={"SymmetricMode": True}).nnz
