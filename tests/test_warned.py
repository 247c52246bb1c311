"""A run repeats the warnings of `check` on standard error, in run.json, and at the head of its page."""

import html
import io
import json
import re
from contextlib import redirect_stdout
from types import SimpleNamespace
from unittest.mock import Mock

import pytest

from repro.cli import main
from repro.march import loop
from repro.march.simulation import simulate, steps
from repro.march.step_control import StepControl
from repro.preflight import simplifications
from repro.results import read_table
from repro.runs import execution
from repro.runs.execution import resume, run
from repro.scene import load_scene
from tests import pages
from tests.pages import Page, text_of
from tests.shell import flags, interrupt_run, read_record

CHANGES = ("numerics.preset=fast", "growth.time_step=0.6 h", "growth.end=1 h", "pore.length=100 um",
           "aggregate.radius=16 um", "output.every=0.5 h")


@pytest.fixture(scope="module")
def checked():
    """The warnings of `repro check`."""
    with redirect_stdout(io.StringIO()) as printed:
        assert main(["check", "wide", *flags(*CHANGES), "--json"]) == 0
    warnings = json.loads(printed.getvalue())["warnings"]
    assert warnings, "else nothing is tested"
    return warnings


@pytest.mark.parametrize("options", [[], ["--quiet"], ["--json"]])
def test_a_run_gives_the_warnings_of_check(tmp_path, capsys, checked, options):
    """Keys and texts are the same, once each, for every kind of output. The exit status does not change."""
    folder = pages.run(tmp_path, "wide", *CHANGES, options=options)
    out, err = capsys.readouterr()
    lines = [line for line in err.splitlines() if "warning" in line]
    assert lines == [f"repro: warning: {warning['key']}: {warning['text']}" for warning in checked]
    assert read_record(folder)["warnings"] == checked
    events = [json.loads(line) for line in out.splitlines()] if options == ["--json"] else []
    keys = [event["key"] for event in events if event["event"] == "warning"]
    assert keys == [warning["key"] for warning in checked if events]


def test_the_page_has_the_warnings_at_its_head(tmp_path, checked, recwarn):
    """They stand before the fields. A script gets no warnings of simplifications; run.json has them."""
    run(load_scene("wide", CHANGES), tmp_path)
    assert not recwarn.list
    text = text_of(tmp_path)
    Page(text)
    head, rest = text.split("</header>")
    items = [html.unescape(re.sub("<.*?>", "", item)) for item in re.findall("<li>(Warning.*?)</li>", head)]
    assert items == [f"Warning: {warning['key']}: {warning['text']}" for warning in checked]
    assert "warnings" not in rest.partition("Also recorded")[2]


def test_a_run_without_warnings_has_an_empty_list(tmp_path, capsys):
    assert read_record(pages.run(tmp_path, "flow_only"))["warnings"] == []
    assert "warning" not in capsys.readouterr().err
    assert "aria-label=\"warnings\"" not in text_of(tmp_path / "run")


def test_a_failure_of_the_warnings_ends_no_run(tmp_path, monkeypatch):
    monkeypatch.setattr(simplifications.numbers, "numbers", Mock(side_effect=OverflowError("math range error")))
    run(load_scene("flow_only"), tmp_path)
    (warning,) = read_record(tmp_path)["warnings"]
    assert warning["key"] == "scene" and "math range error" in warning["text"]


#: The error of the shortest step, 1 h / 1000, is 4e-11. The last step is cut, and rows lie within steps.
STRICT = ("numerics.preset=fast", "growth.end=0.0205 h", "growth.time_step=1 h",
          'output.times=["4.2e-3 h", "0.0205 h"]')
MISSED, MET = (*STRICT, "numerics.tolerance=1e-12"), (*STRICT, "numerics.tolerance=1e-4")


def missed_tolerance(record):
    """The warnings about the tolerance in run.json or from `repro check`."""
    return [warning["text"] for warning in record["warnings"] if warning["key"] == "numerics.tolerance"]


@pytest.mark.parametrize("options", [
    [], *(pytest.param([option], marks=pytest.mark.thorough) for option in ("--json", "--quiet"))])
def test_a_missed_tolerance_is_reported_with_the_largest_estimate(tmp_path, capsys, options):
    """The warning, once on standard error, in run.json and on the page, has the number of these steps and their largest
    estimate."""
    folder = pages.run(tmp_path, "base", *MISSED, options=options)
    messages = missed_tolerance(read_record(folder))
    assert len(messages) == 1
    (text,) = messages
    (line,) = [line for line in capsys.readouterr().err.splitlines() if "tolerance" in line]
    assert line == f"repro: warning: numerics.tolerance: {text}"
    assert html.escape(text) in text_of(folder)
    match = re.fullmatch(r"1e-12 was not met in (\d+) of (\d+) steps: the smallest allowed step, growth.time_step / "
                        r"1000, errs by (\S+) \(estimate\)", text)
    scene = load_scene("base", MISSED)
    states = [state for state, _ in steps(scene)]
    ends = {state.pore.time: state.step_control for state in states if 0 < state.pore.time < scene.growth.end}
    short = [step_control.estimate for step_control in ends.values() if step_control.duration <= 1e-3 * 1.0001]
    count = len(read_table(folder / "ledger.csv")["start_h"])
    assert all(step_control.duration >= 1e-3 for step_control in ends.values()), "no shorter step is tried"
    assert [int(part) for part in match.groups()[:2]] == [len(short), count] and count > len(short) > 15
    assert float(match[3]) == pytest.approx(max(short), rel=0.06)


@pytest.mark.parametrize("sets, count", [(MISSED, 1), (MET, 0)])
def test_check_reports_first_steps_that_miss_the_tolerance(capsys, sets, count):
    """No warning if the steps can meet it."""
    assert main(["check", "base", *flags(*sets), "--json"]) == 0
    messages = missed_tolerance(json.loads(capsys.readouterr().out))
    assert len(messages) == count
    assert all(text.startswith("1e-12 was not met in the first steps: the smallest") for text in messages)


def test_the_worst_step_that_misses_the_tolerance_is_reported(tmp_path):
    recorder = execution.Recorder(load_scene("base", ["numerics.tolerance=0.01"]), tmp_path)
    for estimate in (0.0, 0.03, 0.5, 0.04, 0.001):
        recorder.add(SimpleNamespace(step_control=StepControl(1.0, 1.0, estimate), missing=(), ledgers=(),
                                     pore=SimpleNamespace(contact=False)), None)
    assert recorder.history.missed == 3 and not recorder.contact
    assert "errs by 0.5 (estimate)" in recorder.warnings_so_far()[0].text


def test_a_row_that_is_left_out_is_reported(tmp_path, capsys, monkeypatch):
    """Once on standard error and in run.json, at the end, with the reason. The run completes. A run that resumes within
    the step reports the same, and `simulate` warns of each row."""
    monkeypatch.setattr(loop, "_row_within", lambda *_: (None, "no rest"))
    changes = "growth.end=0.4 h", 'output.times=["0.05 h", "0.13 h", "0.4 h"]'
    folder = pages.run(tmp_path, "base", *changes)
    record = read_record(folder)
    text = ("the run has no row at 0.05, 0.13 h, because the state at this time could not be computed; at 0.05 h: "
            "no rest")
    assert record["status"] == "completed" and record["rows"] == 2
    assert [entry["text"] for entry in record["warnings"] if entry["key"] == "output.times"] == [text]
    assert capsys.readouterr().err.count(f"output.times: {text}") == 1
    interrupt_run(load_scene("base", changes), tmp_path / "resumed", after=2)
    assert "0.05 h, because" in read_record(tmp_path / "resumed")["warnings"][-1]["text"]
    resume(tmp_path / "resumed")
    assert read_record(tmp_path / "resumed")["warnings"] == record["warnings"]
    with pytest.warns(UserWarning, match=r"no row at t = 0\.(05|13) h, since .*: no rest"):
        assert [report.pore.time for report in simulate("base", changes)] == [0, 0.4]
