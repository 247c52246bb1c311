"""Newton's method: when its derivative is factorised anew, and when it stops."""
from dataclasses import dataclass

import pytest

from repro.fem.newton import ENOUGH, STALLED, Newton

TOLERANCE, ROUND_OFF = 1e-12, 1e-8


@dataclass(frozen=True)
class Told:
    """An iterate of which only the defect is known; its number."""

    defect: float
    number: int
    complete: bool = True


class Script:
    """A system whose iterates have given defects, told one after the other; what was asked of it."""

    def __init__(self, defects):
        self.told = [Told(defect, k) for k, defect in enumerate(defects)]
        self.factorised, self.fresh = [], []

    def factored(self, iterate):
        self.factorised.append(iterate.number)
        return f"of {iterate.number}"

    def advanced(self, iterate, factors, fresh):
        assert factors == f"of {self.factorised[-1]}"
        self.fresh.append(fresh)
        return self.told[iterate.number + 1]


def run(script, reused=False, most=20):
    return Newton(TOLERANCE, ROUND_OFF, most, reused).solve(script, script.told[0])


def visits(reused, defects):
    """Whether each iterate with these defects asks for a new factorisation; the last one has converged."""
    script = Script([*defects, 0.0])
    run(script, reused)
    assert script.fresh == [k in script.factorised for k in range(len(defects))]
    return script.fresh


def test_fresh_derivatives_are_made_for_every_iterate():
    assert visits(False, [1.0, 1e-3, 1e-6]) == [True, True, True]


def test_a_derivative_is_used_again_while_it_does_enough():
    """The first is made, then one wherever the defect has fallen by less than ENOUGH."""
    slow, quick = 2 * ENOUGH, ENOUGH / 2
    assert visits(True, [1.0, slow, slow * quick, slow * quick**2, slow**2 * quick**2]) == [
        True, True, False, False, True]


@pytest.mark.parametrize("defects, count, converged", [
    ([1.0, 1e-13], 1, True),
    ([1e-13], 0, True),
    ([1.0, 1e-9, 5e-10], 2, True),
    ([1.0, 1e-9, 5e-11, 1e-13], 3, True),
    ([1.0, 1e-7, 5e-8, 1e-13], 3, True),
    ([1.0, 2.0, 3.0, 4.0], 3, False),
])
def test_when_it_stops(defects, count, converged):
    """Under the tolerance; or where round-off keeps a defect that is small enough from falling."""
    assert STALLED == 0.1
    last, steps, done = run(Script(defects), most=4 if converged else 3)
    assert (last.number, steps, done) == (count, count, converged)
