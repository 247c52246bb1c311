"""Sparse systems: from element matrices of one kind or several, some unknowns prescribed; right answers, a known order,
and an error where there is no answer."""
import numpy as np
import pytest
import scipy.sparse as sp

from repro.errors import LinearError
from repro.fem import linear
from repro.fem.linear import DEFAULT, Method
from tests import faults
from tests.strategies import meshed

LINE = np.column_stack([np.arange(9), np.arange(1, 10)])
#: Of the first kind all pieces of a line, of the second one piece with another far away.
KINDS = LINE, np.column_stack([LINE[:4], LINE[5:]])
_ROUGH = [np.random.default_rng(3).standard_normal((*kind.shape, kind.shape[1])) for kind in KINDS]
ELEMENTS = tuple(part @ np.swapaxes(part, 1, 2) + np.eye(part.shape[1]) for part in _ROUGH)


def dense():
    found = np.zeros((10, 10))
    for kind, elements in zip(KINDS, ELEMENTS):
        for unknowns, element in zip(kind, elements):
            found[np.ix_(unknowns, unknowns)] += element
    return found


def solve(matrix, right, method=DEFAULT):
    """x of A x = right."""
    return linear.factorised(matrix, method).solve(right)


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


#: As large as Gear's matrices for steps of a microsecond, and well conditioned.
STEEP = 3e7 * sp.diags_array([-1.0, 2.5, -1.0], offsets=[-1, 0, 1], shape=(60, 60), format="csc")


def test_a_solution_that_underflows_is_one():
    """A substrate that is used up: unknowns of 2^-1063 to 2^-1062 have the last ten of their 53 bits left, and each
    comes out to the eps t that any sum of such numbers errs by, times |A^-1| |A|, which is 9."""
    exact = np.random.default_rng(5).uniform(1, 2, 60)
    found = solve(STEEP, np.ldexp(STEEP @ exact, -1063))
    assert np.abs(found - np.ldexp(exact, -1063)).max() <= 9 * 2.0**-1074
    assert not solve(STEEP, np.zeros(60)).any()


@pytest.mark.parametrize("size", [1.0, 1e-290, 1e-300, 1e-313])
def test_a_wrong_solution_is_told_however_small_it_is(size):
    """Of factors that give twice what they should: 1e-313 of unknown is 5e-6 of the smallest with all its digits."""
    solver, right = linear.factorised(STEEP), np.full(60, 3e7 * size)
    assert solver.solve(right).max() == pytest.approx(2 * size, rel=1e-8)
    solver.factor, solver.pivoted = linear.factorised(STEEP / 2).factor, True
    with pytest.raises(LinearError, match="leaves a residual"):
        solver.solve(right)


@pytest.mark.parametrize("installed", [False, True])
def test_other_packages_order_and_solve(installed, monkeypatch):
    """Stand-ins that do what the packages say, and the packages where they are installed."""
    for package in ("pypardiso", "pymetis"):
        pytest.importorskip(package) if installed else faults.stand_in_package(monkeypatch, package)
    method, right = Method("pardiso", "metis"), np.arange(60.0)
    grid, _ = meshed(None)
    assert method.checked() is method
    assert solve(STEEP, right, method) == pytest.approx(solve(STEEP, right), rel=1e-12)
    order = linear.node_order(len(grid.points), grid.triangles, method)
    assert np.sort(order).tolist() == list(range(len(grid.points)))
