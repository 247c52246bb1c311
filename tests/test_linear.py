"""Sparse systems from element matrices of one kind or several, with prescribed unknowns: solutions, node order, and
errors for singular systems. When Newton's method stops."""
from dataclasses import dataclass

import numpy as np
import pytest
import scipy.sparse as sp

from repro.errors import LinearError
from repro.fem import linear
from repro.fem.linear import DEFAULT, Method
from repro.fem.newton import STALLED, Newton
from tests import faults
from tests.strategies import meshed


def solve(matrix, right, method=DEFAULT):
    """x of A x = right."""
    return linear.factorised(matrix, method).solve(right)


def test_tiny_pivots_do_not_spoil_the_answer():
    """Elimination without pivoting loses all digits, and refinement cannot repair it; the residual reveals it."""
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
    """The factors of a pure Neumann problem are not exactly singular. The message ends with the cause, because the
    stage appends its advice."""
    with pytest.raises(LinearError, match="is singular$|residual"):
        solve(sp.csc_array(np.array(matrix)), np.arange(1.0, len(matrix) + 1))


#: As large as Gear's matrices for steps of a microsecond, and well conditioned.
STEEP = 3e7 * sp.diags_array([-1.0, 2.5, -1.0], offsets=[-1, 0, 1], shape=(60, 60), format="csc")


def test_a_solution_that_underflows_is_accepted():
    """The substrate is used up: unknowns of 2^-1063 to 2^-1062 have ten of their 53 bits left. The error of each is at
    most the rounding error of a sum of these numbers times |A^-1| |A|, which is 9."""
    exact = np.random.default_rng(5).uniform(1, 2, 60)
    computed = solve(STEEP, np.ldexp(STEEP @ exact, -1063))
    assert np.abs(computed - np.ldexp(exact, -1063)).max() <= 9 * 2.0**-1074
    assert not solve(STEEP, np.zeros(60)).any()


@pytest.mark.parametrize("size", [1.0, 1e-290, 1e-300, 1e-313])
def test_a_wrong_solution_is_refused_at_any_size(size):
    """The factors double the solution. 1e-313 is 5e-6 of the smallest number with all its digits."""
    solver, right = linear.factorised(STEEP), np.full(60, 3e7 * size)
    assert solver.solve(right).max() == pytest.approx(2 * size, rel=1e-8)
    solver.factor, solver.pivoted = linear.factorised(STEEP / 2).factor, True
    with pytest.raises(LinearError, match="leaves a residual"):
        solver.solve(right)


@pytest.mark.parametrize("installed", [False, True])
def test_another_package_solves(installed, monkeypatch):
    """Tested with a stand-in for the package, and with the package if it is installed."""
    pytest.importorskip("pypardiso") if installed else faults.replace_package(monkeypatch, "pypardiso")
    method, right = Method("pardiso"), np.arange(60.0)
    assert method.checked() is method
    assert solve(STEEP, right, method) == pytest.approx(solve(STEEP, right), rel=1e-12)


def test_every_node_has_one_place_in_the_order():
    grid, _ = meshed(None)
    order = linear.node_order(len(grid.points), grid.triangles)
    assert np.sort(order).tolist() == list(range(len(grid.points)))


# ---------------------------------------------------------------- Newton's method


TOLERANCE, ROUND_OFF = 1e-12, 1e-8  # of a script


@dataclass(frozen=True)
class FakeIterate:
    """A Newton iterate with a prescribed defect and its number."""

    defect: float
    number: int
    complete: bool = True


class Script:
    """A system whose iterates have prescribed defects."""

    def __init__(self, defects):
        self.iterates = [FakeIterate(defect, k) for k, defect in enumerate(defects)]

    def factored(self, iterate):
        return None

    def advanced(self, iterate, factors, fresh):
        return self.iterates[iterate.number + 1]

    def at_round_off(self, iterate):
        return iterate.defect <= ROUND_OFF


@pytest.mark.parametrize("defects, count, converged", [
    ([1.0, 1e-13], 1, True),
    ([1e-13], 0, True),
    ([1.0, 1e-9, 5e-10], 2, True),
    ([1.0, 1e-9, 5e-11, 1e-13], 3, True),
    ([1.0, 1e-7, 5e-8, 1e-13], 3, True),
    ([1.0, 2.0, 3.0, 4.0], 3, False),
])
def test_newton_stops_at_the_tolerance_or_at_round_off(defects, count, converged):
    """Iteration stops below the tolerance, or once round-off keeps a small defect from falling."""
    assert STALLED == 0.1
    script, most = Script(defects), 4 if converged else 3
    last, steps, done = Newton(TOLERANCE, most, False).solve(script, script.iterates[0])
    assert (last.number, steps, done) == (count, count, converged)


@pytest.mark.parametrize("defects, count, converged", [
    ([1.0, 0.9, 0.8, 1e-13], 2, False),
    ([1.0, 0.9, 0.1, 0.05, 1e-13], 4, True),
    ([1.0, 1e-13], 1, True),
])
def test_newton_gives_up_if_its_defect_stays_large(defects, count, converged):
    """After two iterations the defect has to be 0.5 at most."""
    script = Script(defects)
    last, steps, done = Newton(TOLERANCE, 10, early=(2, 0.5)).solve(script, script.iterates[0])
    assert (last.number, steps, done) == (count, count, converged)
