"""The verification can fail: verdicts follow from numbers, orders have bounds on both sides, and records and pages are
merged from all workers of a session. A part of a hard case that stops with an error is refused only with a reason."""
import json
import math
import os
import re
import subprocess
import sys
from dataclasses import replace
from unittest.mock import Mock
from xml.etree import ElementTree

import numpy as np
import pytest

from repro.errors import SimulationError, TransportError
from repro.scene.keys import PRESETS
from verification.evidence import cases, matrix, pages, writing
from verification.evidence.cases import STAGES
from verification.evidence.checks import at_least, at_most, between, study
from verification.mutants import runner
from verification.problems import hard
from verification.problems.hard import REFUSED, WRONG

SIZES = 0.5 ** np.arange(4)


@pytest.mark.parametrize("build, bounds, inside, outside", [
    (at_most, [1.0], [0.0, 1.0], [1.1, -0.1, math.inf, math.nan]), (at_least, [1.0], [1.0], [0.5, math.nan]),
    (between, [1.0, 2.0], [1.0, 2.0], [0.9, 2.5, math.nan])])
def test_a_number_holds_only_in_its_range(build, bounds, inside, outside):
    assert all(build("x", value, *bounds, "").holds for value in inside)
    assert not any(build("x", value, *bounds, "").holds for value in outside)


@pytest.mark.parametrize("errors, ceiling, holds", [
    (SIZES**2.2, 1, True), (SIZES**1.8, 1, True), (SIZES**1.6, 1, False), (SIZES**2.4, 1, False),
    (SIZES**2 * [1, 1, 4, 1], 1, False), (SIZES**2, 0.02, True), (SIZES**2, 0.01, False),
    *((np.where(np.arange(4) == k, bad_error, SIZES**2), 1, False)
      for k in range(4) for bad_error in (math.nan, math.inf, 0.0, -1.0))])
def test_a_wrong_order_is_caught_on_both_sides(errors, ceiling, holds):
    """One bad pair suffices, or a last error that is too large. Fewer than four sizes are refused."""
    assert study("error", SIZES, errors, 2, "", ceiling=ceiling).holds is holds
    with pytest.raises(ValueError, match="4 or more falling sizes"):
        study("error", SIZES[:3], errors[:3], 2, "")


def test_the_matrix_has_no_orphan_and_is_written(monkeypatch):
    """Every case, mutant, reference and claim is in a line of the modules, and every line has cases. One in no line is
    reported."""
    assert matrix.orphans() == [] and matrix.unexplained() == []
    lost = replace(cases.cases()["flow-plug"], mutants=("none",), runs_with="1", omitted="")
    monkeypatch.setitem(cases.cases(), "flow-plug", lost)
    assert matrix.orphans() == ["case flow-plug"] and matrix.unexplained() == ["flow-plug"]


def test_exact_has_the_elements_and_the_order_of_accurate():
    """Stages that run with accurate alone rely on this: exact has only other sizes and steps."""
    differing = {key for key, value in PRESETS["exact"].items() if value != PRESETS["accurate"].get(key)}
    assert differing == {"refinement", "tolerance", "contact_elements"}


def test_pages_are_those_of_the_records_and_short_enough_for_a_browser():
    """The records of mutants become stale with the code, so their pages are not compared."""
    texts = pages.texts(pages.recorded())
    for name in (*(f"{stage}.md" for stage in STAGES), "matrix.md"):
        assert (writing.REPORT / name).read_text(encoding="utf-8") == texts[name], name
    assert {path.name for path in writing.REPORT.glob("*.md")} == {*texts, "pores.md", "sampled.md"}
    assert max(path.stat().st_size for path in writing.REPORT.glob("*.md")) <= 60_000


CASES = '''
import pytest
from verification.evidence.cases import parametrize
from verification.evidence.checks import at_most

def mark(id):
    return pytest.mark.case(id, kind="exact", claim="c", norm="n", mutants=("saddle-sign",), runs_with="1", omitted="o")

@mark("flow-made-good")
@parametrize("value, *rest", {f"v = {k}": (k, k, k) for k in range(4)})
def test_made_good(value, rest, record):
    record([at_most("q", value, 3.0, "theory")], at_most("r", len(rest), 2.0, "theory"))

@mark("flow-made-short")
@pytest.mark.parametrize("value", ["one", "three"])
def test_made_short(value, record):
    record(at_most("q", len(value), 4.0, "theory"))

@mark("flow-made-stopped")
@pytest.mark.parametrize("value", [0, 2])
def test_made_stopped(value, record):
    import numpy
    record(at_most("q", numpy.ones(1)[0] / value, 1.0, "theory"))

@pytest.mark.slow
@mark("flow-made-empty")
def test_made_empty(record):
    pass
'''


@pytest.mark.thorough
def test_a_parallel_session_records_all_its_cases():
    """A copy of the project has four more cases: one passes, one fails in a variant, a floating-point error stops a
    variant of the third, and the last measures nothing. The registry has the variants that pytest runs."""
    with runner.copied() as folder:
        (folder / "verification/cases/flow_made.py").write_text(CASES)
        before = json.loads((folder / "verification/report/evidence.json").read_text())
        session = subprocess.run([sys.executable, "-m", "pytest", "verification/cases/flow_made.py", "-n2", "-k",
                               "flow-made", "--pages", "--junitxml=report.xml"], cwd=folder, capture_output=True,
                              text=True, env={**os.environ, "PYTHONPATH": str(folder)})
        report = folder / "verification" / "report"
        records, measured = (writing.load(report / name) for name in ("evidence.json", "live/measured.json"))
        page, tests = (report / "flow.md").read_text(), ElementTree.parse(folder / "report.xml").findall(".//testcase")
    assert session.returncode == 1, session.stdout
    assert "q: 5; expected at most 4 (theory)" in session.stdout and "nothing was measured" in session.stdout
    assert re.match(r"3 failed, 6 passed(, \d+ warnings?)? in [\d.]+s", session.stdout.strip().splitlines()[-1])
    assert len(tests) == 9 and sum(bool(test.findall("failure")) for test in tests) == 3
    new_records = {id: records.pop(id) for id in [*records] if id.startswith("flow-made")}
    assert records == before
    assert {id: record["verdict"] == "passes" for id, record in new_records.items()} == {
        "flow-made-good": True, "flow-made-short": False, "flow-made-stopped": False, "flow-made-empty": False}
    assert new_records["flow-made-good"]["numbers"] == 8 and new_records["flow-made-short"]["numbers"] == 2
    assert new_records["flow-made-stopped"]["errors"][0].startswith("0: FloatingPointError")
    assert "| q, three (5) | at most 4 | theory | NO |" in page and "Stopped by an error: 0: FloatingPointError" in page
    assert measured["cases"]["flow-made-good"]["measured"]["r, v = 3"] == "2"


# ---------------------------------------------------------------- hard cases


@pytest.mark.parametrize("error, verdict, excerpt", [
    (SimulationError("try another"), REFUSED, "try another"),
    (TransportError("the Peclet number is 1e-12, under 1e-9"), REFUSED, "under 1e-9"),
    (SimulationError("stopped"), WRONG, "without a reason: stopped"), (ValueError("try again"), WRONG, "ValueError"),
    ([[]], WRONG, "nothing was measured")])
def test_an_error_refuses_a_part_only_with_a_reason(error, verdict, excerpt):
    """A part that measures nothing is wrong, too."""
    part = hard.run_part("a part", Mock(side_effect=error), "fast")
    assert part.verdict == verdict and excerpt in part.message
