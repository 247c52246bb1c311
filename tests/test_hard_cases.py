"""Hard cases: a cell is right, refused or wrong, and for the right reason."""
import math
from itertools import count

import numpy as np
import pytest

from repro.errors import SimulationError, TransportError
from verification.evidence.checks import at_most
from verification.problems import hard
from verification.problems.hard import REFUSED, RIGHT, WRONG

GOOD, BAD = at_most("good", 0.5, 1.0, ""), at_most("bad", 2.0, 1.0, "")


def raising(error):
    """Return a part that an error stops."""
    def function(preset):
        raise error
    return function


PARTS = {RIGHT: lambda preset: [GOOD], WRONG: lambda preset: [BAD], REFUSED: raising(SimulationError("try another"))}


@pytest.mark.parametrize("function, verdict, excerpt", [
    (PARTS[RIGHT], RIGHT, ""), (lambda preset: [GOOD, BAD], WRONG, "bad 2 (expected at most 1)"),
    (lambda preset: [], WRONG, "nothing was measured"),
    (lambda preset: [at_most("q", math.nan, 1.0, "")], WRONG, "q nan"),
    (PARTS[REFUSED], REFUSED, "try another"), (raising(SimulationError("stopped")), WRONG, "without a reason: stopped"),
    (raising(TransportError("the Peclet number is 1e-12, under 1e-9")), REFUSED, "under 1e-9"),
    (raising(ValueError("try again")), WRONG, "ValueError"),
    (lambda preset: [at_most("q", np.zeros(1) / 0, 1.0, "")], WRONG, "FloatingPointError"),
    (lambda preset: sum(1 for _ in count()), WRONG, "not done after 0.2 s")])
def test_a_part_is_right_refused_or_wrong(function, verdict, excerpt):
    cell = hard.run_part("a part", function, "fast", 0.2)
    assert cell.verdict == verdict and excerpt in cell.message
