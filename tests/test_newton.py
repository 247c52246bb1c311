"""Newton's method: when its derivative is factorised anew, and when it stops."""
from dataclasses import dataclass

import pytest

from repro.fem.newton import STALLED, Newton

TOLERANCE, ROUND_OFF = 1e-12, 1e-8


@dataclass(frozen=True)
class FakeIterate:
    """A Newton iterate with a prescribed defect and its number."""

    defect: float
    number: int
    complete: bool = True


class Script:
    """A system whose iterates have prescribed defects. It records the factorisations and the fresh derivatives."""

    def __init__(self, defects):
        self.iterates = [FakeIterate(defect, k) for k, defect in enumerate(defects)]
        self.factorised, self.fresh = [], []

    def factored(self, iterate):
        self.factorised.append(iterate.number)
        return f"of {iterate.number}"

    def advanced(self, iterate, factors, fresh):
        assert factors == f"of {self.factorised[-1]}"
        self.fresh.append(fresh)
        return self.iterates[iterate.number + 1]


def run(script, modified_newton=False, most=20):
    return Newton(TOLERANCE, ROUND_OFF, most, modified_newton).solve(script, script.iterates[0])


def factorisations(modified_newton, defects):
    """Whether each iterate with these defects makes a new factorisation; the last iterate has converged."""
    script = Script([*defects, 0.0])
    run(script, modified_newton)
    assert script.fresh == [k in script.factorised for k in range(len(defects))]
    return script.fresh


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
    last, steps, done = run(Script(defects), most=4 if converged else 3)
    assert (last.number, steps, done) == (count, count, converged)
