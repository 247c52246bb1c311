"""Hard cases: a cell is right, refused or wrong for the right reason, and a few of the real ones are right."""
import json
import math
import os
from itertools import count
from multiprocessing.reduction import ForkingPickler

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from repro.errors import SimulationError, TransportError
from repro.scene import load_scene
from repro.scene.units import SceneError
from verification import hard_cases
from verification.hard import common, runs
from verification.hard.common import PRESETS, REFUSED, RIGHT, WRONG, HardCase
from verification.kernel.case import Check, Outcome, Result, at_least, at_most, between, outcome
from verification.kernel.writing import plain

GOOD, BAD = at_most("good", 0.5, 1.0, ""), at_most("bad", 2.0, 1.0, "")
KNOWN = {case.number: case for case in hard_cases.CASES}
MAY_REFUSE = {3, 4, 5, 15, 17, 19, 22}


def part(*items, limit=common.LIMIT):
    """The verdict of a part that returns items, or raises the first where it is an error."""
    def function(preset):
        if items and isinstance(items[0], Exception):
            raise items[0]
        return list(items)
    return common.run_part("a part", function, "fast", limit)


def a_case(verdicts, **more):
    """A case whose parts have these verdicts with every preset."""
    made = {RIGHT: lambda preset: [GOOD], WRONG: lambda preset: [BAD], REFUSED: refuse}
    parts = {f"{verdict} {k}": made[verdict] for k, verdict in enumerate(verdicts)}
    return HardCase(99, "made-up", "Made up", "Right", "Wrong", parts, mutants=("m",), **more)


def refuse(preset):
    raise SimulationError("try another mesh")


@pytest.mark.parametrize("items, verdict", [
    ((GOOD,), RIGHT), ((GOOD, BAD), WRONG), ((), WRONG), ((at_most("q", math.nan, 1.0, ""),), WRONG),
    ((SimulationError("stopped: try a larger numerics.refinement"),), REFUSED),
    ((TransportError("the Peclet number is 1e-12, under 1e-9"),), REFUSED),
    ((SceneError("greater than zero is needed"),), REFUSED),
    ((SimulationError("stopped"),), WRONG), ((ValueError("try again"),), WRONG),
    ((FloatingPointError("overflow"),), WRONG), ((KeyError("try"),), WRONG),
])
def test_a_part_is_right_refused_or_wrong(items, verdict):
    assert part(*items).verdict == verdict


def test_a_message_says_what_fell_short():
    assert "bad 2 (expected at most 1)" in part(GOOD, BAD).message
    assert part(GOOD).message == "" and "without a reason: stopped" in part(SimulationError("stopped")).message


def test_floating_point_errors_are_no_results():
    assert common.run_part("p", lambda preset: [at_most("q", np.zeros(1) / 0, 1.0, "")], "fast").verdict == WRONG


def test_a_part_that_does_not_end_is_stopped():
    found = common.run_part("p", lambda preset: sum(1 for _ in count()), "fast", limit=0.2)
    assert found.verdict == WRONG and "not done after 0.2 s" in found.message
    assert part(GOOD).verdict == RIGHT


@pytest.mark.parametrize("verdicts, worst", [([RIGHT], RIGHT), ([RIGHT, REFUSED], REFUSED), ([REFUSED, WRONG], WRONG),
                                             ([WRONG, RIGHT], WRONG), ([], WRONG)])
def test_a_cell_is_as_its_worst_part(verdicts, worst):
    assert common.run_cell(a_case(verdicts), "fast").verdict == worst


@pytest.mark.parametrize("verdict, preset, more, fine", [
    (RIGHT, "fast", {}, True), (REFUSED, "fast", {}, False), (REFUSED, "accurate", {}, False),
    (REFUSED, "paper", {}, True), (WRONG, "paper", {}, False), (WRONG, "fast", {"refusable": ("wrong 0",)}, False),
    (REFUSED, "fast", {"refusable": ("refused 0",)}, True), (REFUSED, "fast", {"refusable": ("refused 1",)}, False),
])
def test_what_is_accepted(verdict, preset, more, fine):
    assert (not common.run_cell(a_case([verdict], **more), preset).unaccepted) is fine


@pytest.mark.parametrize("verdicts, more, holds", [
    ([RIGHT], {}, True), ([RIGHT, WRONG], {}, False), ([RIGHT, REFUSED], {}, False),
    ([RIGHT, REFUSED], {"refusable": ("refused 1",)}, True)])
def test_a_verification_case_holds_if_its_verdicts_are_accepted(verdicts, more, holds):
    found = outcome(common.measured(common.run_cell(a_case(verdicts, **more), preset)) for preset in PRESETS)
    assert Result("hard-99", found, "", 0.0).holds is holds and len(found.notes) == len(PRESETS)


@pytest.mark.parametrize("check, value", [
    (at_most("q", 0.5, 2.0, ""), 0.25), (at_least("q", 4.0, 2.0, ""), 0.5), (at_least("q", -0.5, -1.0, ""), 0.5),
    (at_least("q", 3.0, -1.0, ""), 0.0), (between("q", 1.25, 1.0, 2.0, ""), 0.5), (at_most("q", 0, 0, ""), 0.0),
    (at_most("q", 3.0, 2.0, ""), math.inf), (Check("q", math.nan, 0.0, 1.0, ""), math.inf)])
def test_what_a_check_uses_of_its_tolerance(check, value):
    assert check.used == pytest.approx(value)


def test_there_are_twenty_two_and_only_some_may_refuse():
    assert sorted(KNOWN) == list(range(1, 23))
    assert {case.number for case in hard_cases.CASES if case.refusable} <= MAY_REFUSE
    assert KNOWN[4].refusable == ("velocity x 1000",)
    for case in hard_cases.CASES:
        assert set(case.refusable) <= set(case.parts) and case.mutants
        assert case.title and case.right_is and case.failure_is


def test_the_matrix_is_told_and_written(tmp_path, monkeypatch):
    cells = [common.run_cell(a_case([RIGHT, REFUSED]), preset) for preset in PRESETS]
    monkeypatch.setattr(hard_cases, "RECORD", tmp_path / "report" / "hard_cases.json")
    hard_cases.record([Result("hard-99", Outcome(notes=tuple(cells)), "", 0.0), Result("other", Outcome(), "", 0.0)])
    kept, live = (json.loads((hard_cases.RECORD.parent / folder / hard_cases.RECORD.name).read_text())
                  for folder in (".", "live"))
    (line,), (measured,) = kept["cases"], live["cases"]
    assert line["number"] == 99 and set(line["cells"]) == set(PRESETS) and live["machine"]
    assert line["cells"]["fast"] == {"verdict": REFUSED, "accepted": False} and "machine" not in kept
    assert line["cells"]["paper"]["accepted"] and "try another mesh" in measured["cells"]["paper"]["message"]
    assert measured["cells"]["fast"]["checks"][0]["quantity"] == "good"
    told = plain(hard_cases.blocks(live))
    assert "refused!" in told and "99    fast      refused 1: try another mesh" in told


def test_the_exit_status_is_the_verdict(monkeypatch, tmp_path, capsys):
    monkeypatch.setattr(hard_cases, "RECORD", tmp_path / "hard_cases.json")
    for verdict, status in ((RIGHT, 0), (WRONG, 1)):
        monkeypatch.setattr(hard_cases, "CASES", (a_case([verdict]),))
        assert hard_cases.main(["--preset", "fast"]) == status
    assert not hard_cases.RECORD.exists()
    hard_cases.main([])
    assert hard_cases.RECORD.exists()


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


def test_units_scale_and_draws_are_scenes():
    made = load_scene("base", ("numerics.preset=fast",))
    there = runs.scaled(runs.scaled(made, 2.0**10, 2.0**-3), 2.0**-10, 2.0**3)
    assert there == made and runs.scaled(made, 2.0, 1.0).pore.width == 100.0
    assert runs.scaled(made, 1.0, 2.0).kinetics.decay_coefficient == made.kinetics.decay_coefficient / 2
    for end in (0.0, 1.0):
        assert runs.drawn(dict.fromkeys(runs.RANGES, end), "paper").numerics.preset == "paper"


@pytest.mark.skipif(os.environ.get("HYPOTHESIS_PROFILE") != "thorough", reason="a run of seconds for each example")
@settings(max_examples=60)
@given(st.fixed_dictionaries({key: st.floats(0.0, 1.0) for key in runs.RANGES}), st.sampled_from(PRESETS))
def test_a_run_of_any_parameters_ends_right_or_refuses(shares, preset):
    """Case 22 with what hypothesis draws."""
    found = common.run_part("drawn", lambda chosen: [runs.run_drawn(shares, chosen)], preset)
    assert found.verdict in (RIGHT, REFUSED), found.message


def test_every_hard_case_is_a_verification_case():
    from verification.kernel import case
    assert {one.full_id for one in hard_cases.CASES} == {id for id, c in case.CASES.items() if c.stage == "hard"}
    assert all({*case.CASES[one.full_id].over} == {*PRESETS} for one in hard_cases.CASES)


def test_every_case_goes_from_process_to_process():
    """`make verify` runs them side by side."""
    for one in hard_cases.CASES:
        again = ForkingPickler.loads(ForkingPickler.dumps(one))
        assert again.full_id == one.full_id and again.parts.keys() == one.parts.keys()
