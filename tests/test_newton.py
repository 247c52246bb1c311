"""Newton's method: when it stops. The case coupling-jacobian-reused tests when it factorises anew."""
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
    """A system whose iterates have prescribed defects."""

    def __init__(self, defects):
        self.iterates = [FakeIterate(defect, k) for k, defect in enumerate(defects)]

    def factored(self, iterate):
        return None

    def advanced(self, iterate, factors, fresh):
        return self.iterates[iterate.number + 1]


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
    last, steps, done = Newton(TOLERANCE, ROUND_OFF, most, False).solve(script, script.iterates[0])
    assert (last.number, steps, done) == (count, count, converged)


@pytest.mark.parametrize("defects, count, converged", [
    ([1.0, 0.9, 0.8, 1e-13], 2, False),
    ([1.0, 0.9, 0.1, 0.05, 1e-13], 4, True),
    ([1.0, 1e-13], 1, True),
])
def test_newton_gives_up_if_its_defect_stays_large(defects, count, converged):
    """After two iterations the defect has to be 0.5 at most."""
    script = Script(defects)
    last, steps, done = Newton(TOLERANCE, ROUND_OFF, 10, early=(2, 0.5)).solve(script, script.iterates[0])
    assert (last.number, steps, done) == (count, count, converged)
