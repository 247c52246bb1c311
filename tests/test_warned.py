"""What `check` warns of is told by a run too: aside, in run.json, and at the head of its page."""

import html
import json
import re
from unittest.mock import Mock

import pytest

from repro.cli import main
from repro.march.simulation import steps
from repro.preflight import simplifications
from repro.results import read_table
from repro.runs import running
from repro.runs.running import resume, run
from repro.scene import load_scene
from tests import pages
from tests.pages import Page, text_of, whole_of
from tests.shell import flags, lasting, stopped, told

SETS = ("numerics.preset=fast", "growth.time_step=0.6 h", "growth.end=1 h", "pore.length=100 um",
        "aggregate.radius=16 um")


@pytest.fixture
def checked(capsys):
    """The warnings of `repro check`."""
    assert main(["check", "wide", *flags(*SETS), "--json"]) == 0
    found = json.loads(capsys.readouterr().out)["warnings"]
    assert found, "else nothing is tested"
    return found


@pytest.mark.parametrize("options", [[], ["--quiet"], ["--json"]])
def test_a_run_warns_of_what_check_warns_of(tmp_path, capsys, checked, options):
    """The same keys and words, once each, however it is told what happens, and the exit status is that of a run
    without."""
    folder = pages.run(tmp_path, "wide", *SETS, options=options)
    out, err = capsys.readouterr()
    lines = [line for line in err.splitlines() if "warning" in line]
    assert lines == [f"repro: warning: {one['key']}: {one['text']}" for one in checked]
    assert told(folder)["warnings"] == checked
    events = [json.loads(line) for line in out.splitlines()] if options == ["--json"] else []
    assert [one["key"] for one in events if one["event"] == "warning"] == [one["key"] for one in checked if events]


def test_the_page_tells_them_at_its_head(tmp_path, checked, recwarn):
    """Before the fields; a script is not warned of the scene's simplifications, which are in run.json."""
    run(load_scene("wide", SETS), tmp_path)
    assert not recwarn.list
    text = text_of(tmp_path)
    Page(text)
    head, rest = text.split("</header>")
    shown = [html.unescape(re.sub("<.*?>", "", item)) for item in re.findall("<li>(.*?)</li>", head)]
    assert shown == [f"Warning: {one['key']}: {one['text']}" for one in checked]
    assert "warnings" not in rest.partition("Also recorded")[2]


def test_a_run_without_any_has_an_empty_list(tmp_path, capsys):
    assert told(pages.run(tmp_path, "flow_only"))["warnings"] == [] and capsys.readouterr().err == ""
    assert "aria-label=\"warnings\"" not in text_of(tmp_path / "run")


def test_a_resume_keeps_them(tmp_path, checked):
    """Without working them out again."""
    scene = load_scene("wide", SETS)
    stopped(scene, tmp_path, after=2)
    resume(tmp_path)
    assert told(tmp_path)["warnings"] == checked and lasting(tmp_path) == lasting(whole_of(scene))


def test_numbers_that_cannot_be_worked_out_end_no_run(monkeypatch):
    monkeypatch.setattr(simplifications, "warnings", Mock(side_effect=OverflowError("math range error")))
    (warned,) = running.warned(load_scene("flow_only"), 1.0)
    assert warned.key == "scene" and "math range error" in warned.text


#: The shortest step, 1 h / 1000, errs by 4e-11. The last step is cut, and rows lie within steps.
STRICT = ("numerics.preset=fast", "growth.end=0.0205 h", "growth.time_step=1 h",
          'output.times=["4.2e-3 h", "0.0205 h"]')
MISSED, MET = (*STRICT, "numerics.tolerance=1e-12"), (*STRICT, "numerics.tolerance=1e-4")


def not_met(told):
    """What the warnings of run.json, or of `repro check`, say of the tolerance."""
    return [one["text"] for one in told["warnings"] if one["key"] == "numerics.tolerance"]


@pytest.mark.parametrize("options", [[], ["--json"], ["--quiet"]])
def test_a_tolerance_that_no_step_can_meet_is_told_with_what_is_reached(tmp_path, capsys, options):
    """Once, aside, in run.json and on the page: in how many of the run's steps, and the largest of their estimates."""
    folder = pages.run(tmp_path, "base", *MISSED, options=options)
    found = not_met(told(folder))
    assert len(found) == 1
    (text,) = found
    (line,) = [line for line in capsys.readouterr().err.splitlines() if "tolerance" in line]
    assert line == f"repro: warning: numerics.tolerance: {text}"
    assert html.escape(text) in text_of(folder)
    said = re.fullmatch(r"1e-12 was not met in (\d+) of (\d+) steps: the smallest allowed step, growth.time_step / "
                        r"1000, errs by (\S+) \(estimate\)", text)
    made = load_scene("base", MISSED)
    states = [state for state, _ in steps(made)]
    ends = {state.pore.time: state.pace for state in states if 0 < state.pore.time < made.growth.end}
    short = [pace.estimate for pace in ends.values() if pace.duration <= 1e-3 * 1.0001]
    count = len(read_table(folder / "ledger.csv")["start_h"])
    assert all(pace.duration >= 1e-3 for pace in ends.values()), "no shorter step is tried"
    assert [int(part) for part in said.groups()[:2]] == [len(short), count] and count > len(short) > 15
    assert float(said[3]) == pytest.approx(max(short), rel=0.06)


def test_a_run_that_goes_on_counts_the_steps_before(tmp_path):
    scene = load_scene("base", MISSED)
    stopped(scene, tmp_path, after=9)
    before = not_met(told(tmp_path))
    resume(tmp_path)
    assert lasting(tmp_path) == lasting(whole_of(scene)) and before not in ([], not_met(told(tmp_path)))


@pytest.mark.parametrize("sets, count", [(MISSED, 1), (MET, 0)])
def test_check_tells_where_the_first_steps_cannot_meet_the_tolerance(capsys, sets, count):
    """And neither it nor a run where they can."""
    assert main(["check", "base", *flags(*sets), "--json"]) == 0
    found = not_met(json.loads(capsys.readouterr().out))
    assert len(found) == count == len(not_met(told(whole_of(load_scene("base", sets)))))
    assert all(text.startswith("1e-12 was not met in the first steps: the smallest") for text in found)
