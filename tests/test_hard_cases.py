"""Hard cases: a cell is right, refused or wrong for the right reason, and a few of the real ones are right."""
import json
import math
from itertools import count
from multiprocessing.reduction import ForkingPickler

import numpy as np
import pytest

from repro.errors import SimulationError, TransportError
from repro.scene import load_scene
from verification import hard, hard_cases
from verification.hard import common
from verification.hard.common import PRESETS, REFUSED, RIGHT, WRONG, HardCase
from verification.kernel import case
from verification.kernel.case import Check, Outcome, Result, at_least, at_most, between, outcome
from verification.kernel.writing import plain

GOOD, BAD = at_most("good", 0.5, 1.0, ""), at_most("bad", 2.0, 1.0, "")
KNOWN = {case.number: case for case in hard.CASES}


def a_case(verdicts, **more):
    """A case whose parts have these verdicts with every preset."""
    made = {RIGHT: lambda preset: [GOOD], WRONG: lambda preset: [BAD], REFUSED: refuse}
    parts = {f"{verdict} {k}": made[verdict] for k, verdict in enumerate(verdicts)}
    return HardCase(99, "made-up", "Made up", "Right", "Wrong", parts, mutants=("m",), **more)


def refuse(preset):
    raise SimulationError("try another mesh")


def stopped(error):
    """A part that an error stops."""
    def function(preset):
        raise error
    return function


@pytest.mark.parametrize("function, verdict, told", [
    (lambda preset: [GOOD], RIGHT, ""), (lambda preset: [GOOD, BAD], WRONG, "bad 2 (expected at most 1)"),
    (lambda preset: [], WRONG, "nothing was measured"),
    (lambda preset: [at_most("q", math.nan, 1.0, "")], WRONG, "q nan"),
    (refuse, REFUSED, "try another mesh"), (stopped(SimulationError("stopped")), WRONG, "without a reason: stopped"),
    (stopped(TransportError("the Peclet number is 1e-12, under 1e-9")), REFUSED, "under 1e-9"),
    (stopped(ValueError("try again")), WRONG, "ValueError"),
    (lambda preset: [at_most("q", np.zeros(1) / 0, 1.0, "")], WRONG, "FloatingPointError"),
    (lambda preset: sum(1 for _ in count()), WRONG, "not done after 0.2 s"),
])
def test_a_part_is_right_refused_or_wrong(function, verdict, told):
    found = common.run_part("a part", function, "fast", 0.2)
    assert found.verdict == verdict and told in found.message


@pytest.mark.parametrize("verdicts, worst", [
    ([RIGHT, REFUSED], REFUSED), ([WRONG, REFUSED, RIGHT], WRONG), ([], WRONG)])
def test_a_cell_is_as_its_worst_part(verdicts, worst):
    assert common.run_cell(a_case(verdicts), "fast").verdict == worst


@pytest.mark.parametrize("verdict, preset, more, fine", [
    (RIGHT, "fast", {}, True), (REFUSED, "fast", {}, False), (REFUSED, "paper", {}, True), (WRONG, "paper", {}, False),
    (WRONG, "fast", {"refusable": ("wrong 0",)}, False), (REFUSED, "fast", {"refusable": ("refused 0",)}, True),
    (REFUSED, "fast", {"refusable": ("refused 1",)}, False),
])
def test_what_is_accepted(verdict, preset, more, fine):
    """A verification case holds if it is so with all presets."""
    chosen = a_case([verdict, RIGHT], **more)
    cells = {name: common.run_cell(chosen, name) for name in PRESETS}
    accepted = {name: not cell.unaccepted for name, cell in cells.items()}
    assert accepted[preset] is fine
    found = outcome(common.measured(cell) for cell in cells.values())
    assert Result("hard-99", found, "", 0.0).holds is all(accepted.values()) and len(found.notes) == len(PRESETS)


@pytest.mark.parametrize("check, value", [
    (at_most("q", 0.5, 2.0, ""), 0.25), (at_least("q", 4.0, 2.0, ""), 0.5), (at_least("q", -0.5, -1.0, ""), 0.5),
    (between("q", 1.25, 1.0, 2.0, ""), 0.5), (at_most("q", 3.0, 2.0, ""), math.inf),
    (Check("q", math.nan, 0.0, 1.0, ""), math.inf)])
def test_what_a_check_uses_of_its_tolerance(check, value):
    assert check.used == pytest.approx(value)


def test_there_are_twenty_two_verification_cases_and_only_some_may_refuse():
    assert sorted(KNOWN) == list(range(1, 23)) and KNOWN[4].refusable == ("velocity x 1000",)
    assert {number for number, one in KNOWN.items() if one.refusable} <= {3, 4, 5, 15, 17, 19, 22}
    assert {one.full_id for one in KNOWN.values()} == {id for id, c in case.CASES.items() if c.stage == "hard"}
    for one in KNOWN.values():
        assert set(one.refusable) <= set(one.parts)
        assert one.mutants and one.title and one.right_is and one.failure_is
        assert {*case.CASES[one.full_id].over} == {*PRESETS}
        again = ForkingPickler.loads(ForkingPickler.dumps(one))  # as it goes from process to process
        assert again.full_id == one.full_id and again.parts.keys() == one.parts.keys()


def test_the_matrix_is_told_and_written(tmp_path, monkeypatch):
    cells = [common.run_cell(a_case([RIGHT, REFUSED]), preset) for preset in PRESETS]
    monkeypatch.setattr(hard_cases, "RECORD", tmp_path / "report" / "hard_cases.json")
    hard_cases.record([Result("hard-99", Outcome(notes=tuple(cells)), "", 0.0), Result("other", Outcome(), "", 0.0)])
    kept, live = (json.loads((hard_cases.RECORD.parent / folder / hard_cases.RECORD.name).read_text())
                  for folder in (".", "live"))
    assert [line["number"] for line in kept["cases"]] == [99]
    verdicts, measured = (found["cases"][0]["cells"] for found in (kept, live))
    assert set(verdicts) == set(PRESETS) and verdicts["paper"]["accepted"]
    assert verdicts["fast"] == {"verdict": REFUSED, "accepted": False}
    assert "try another mesh" in measured["paper"]["message"]
    told = plain(hard_cases.blocks(live))
    assert "refused!" in told


def test_a_wrong_run_is_seen():
    """Numbers that are not finite, balances, concentrations and densities out of bounds."""
    made = load_scene("wide", ("numerics.preset=fast", 'growth.end="0 h"', 'aggregate.radius="40 um"'))
    found = common.ran(made)
    assert all(check.holds for check in common.sound(found))
    for column, value in (("acceptor_balance", 1e-6), ("biomass_density_min", 0.5), ("inert_fraction", -0.1),
                          ("head_loss_cm", math.nan), ("biomass_balance", 1e-3)):
        line = {**found.rows[0], column: value}
        spoilt = common.Run(made, found.instants * 2, [line, found.rows[0]])
        assert not all(check.holds for check in common.sound(spoilt)), column
    found.instants[0].solved.concentrations.donor[3] = 10.5
    assert not all(check.holds for check in common.sound(found))


@pytest.mark.parametrize("number, preset", [
    (1, "fast"), (2, "fast"), (5, "fast"), (6, "fast"), (9, "paper"), (10, "fast"), (12, "accurate"), (18, "paper"),
    (19, "fast")])
def test_a_cheap_cell_is_what_it_must_be(number, preset):
    cell = common.run_cell(KNOWN[number], preset)
    assert not cell.unaccepted, cell.message
