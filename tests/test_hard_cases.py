"""Hard cases: a cell is right, refused or wrong, and for the right reason."""
import math
from itertools import count

import numpy as np
import pytest

from repro.errors import SimulationError, TransportError
from verification.cases import hard_family
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


@pytest.mark.parametrize("message, works, wrong", [
    ("too coarse; numerics.refinement = 0.3 resolves this state", {"refinement": 0.3}, 0),
    ("too coarse; numerics.refinement = 0.3 resolves this state", {}, 1), ("it stopped", {}, 1),
    ('too coarse; numerics.elements = "linear" with numerics.refinement = 1 resolves it', {"elements": "linear"}, 0),
    ("a defect; try a shorter growth.time_step", {"time_step": "0.05 h"}, 0),
    ("a defect; try a shorter growth.time_step", {"time_step": "0.2 h"}, 1),
    ("too coarse; no setting helps", {}, 0), ("two\nlines; no setting helps", {}, 1),
    ("no setting helps; fields of t = 0 h: fields/fields_0009.vtu", {}, 1)])
def test_a_refusal_is_right_where_its_advice_works(message, works, wrong, tmp_path, monkeypatch):
    """It is also right if it says that no setting helps. It is one line and names existing files."""
    def runs(tables, folder):
        values = {**tables["growth"], **tables["numerics"]}
        return any(values.get(key) == value for key, value in works.items())

    monkeypatch.setattr(hard_family, "_is_right", runs)
    tables = {"aggregate": {}, "flow": {"head": "1e-3 cm"}, "substrates": {}, "growth": {"end": "1 h"}, "numerics": {}}
    checks = [*hard_family._checks(hard_family.Outcome(None, message), tables, tmp_path)]
    assert sum(not check.holds for check in checks) == wrong
