"""Hard cases: verdicts of parts that stop with an error. The mutants of the hard cases show that a part with failed
checks is wrong."""
from unittest.mock import Mock

import pytest

from repro.errors import SimulationError, TransportError
from verification.problems import hard
from verification.problems.hard import REFUSED, WRONG


@pytest.mark.parametrize("error, verdict, excerpt", [
    (SimulationError("try another"), REFUSED, "try another"),
    (TransportError("the Peclet number is 1e-12, under 1e-9"), REFUSED, "under 1e-9"),
    (SimulationError("stopped"), WRONG, "without a reason: stopped"), (ValueError("try again"), WRONG, "ValueError"),
    ([[]], WRONG, "nothing was measured")])
def test_an_error_refuses_a_part_only_with_a_reason(error, verdict, excerpt):
    """A part that measures nothing is wrong, too."""
    part = hard.run_part("a part", Mock(side_effect=error), "fast")
    assert part.verdict == verdict and excerpt in part.message
