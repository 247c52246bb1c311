"""What `check` warns of is told by a run too: aside, in run.json, and at the head of its page."""

import html
import json
import re

import pytest

from repro.check import simplifications
from repro.cli import main
from repro.march.simulation import simulate
from repro.run import running
from repro.run.running import resume, run
from repro.scene import load_scene
from tests.pages import Page, text_of
from tests.shell import flags, lasting, stopped, told

SETS = ("numerics.preset=fast", "growth.time_step=0.6 h", "growth.end=1 h", "pore.length=100 um",
        "aggregate.radius=16 um")
COMMAND = ["wide", *flags(*SETS)]


@pytest.fixture
def checked(capsys):
    """The warnings of `repro check`."""
    assert main(["check", *COMMAND, "--json"]) == 0
    found = json.loads(capsys.readouterr().out)["warnings"]
    assert found, "else nothing is tested"
    return found


@pytest.mark.parametrize("options", [[], ["--quiet"], ["--json"]])
def test_a_run_warns_of_what_check_warns_of(tmp_path, capsys, checked, options):
    """The same keys and words, once each, however it is told what happens, and the exit status is that of a run
    without."""
    assert main(["run", *COMMAND, "--out", str(tmp_path / "run"), *options]) == 0
    out, err = capsys.readouterr()
    lines = [line for line in err.splitlines() if "warning" in line]
    assert lines == [f"repro: warning: {one['key']}: {one['text']}" for one in checked]
    assert told(tmp_path / "run")["warnings"] == checked
    events = [json.loads(line) for line in out.splitlines()] if options == ["--json"] else []
    assert [one["key"] for one in events if one["event"] == "warning"] == [one["key"] for one in checked if events]


def test_the_page_tells_them_at_its_head(tmp_path, checked, recwarn):
    """Before the fields; a script is not warned of the scene's simplifications, which are in run.json."""
    run(load_scene("wide", SETS), tmp_path)
    assert not recwarn.list
    text = text_of(tmp_path)
    head = text[: text.index("</header>")]
    shown = [html.unescape(re.sub("<.*?>", "", item)) for item in re.findall("<li>(.*?)</li>", head)]
    assert shown == [f"Warning: {one['key']}: {one['text']}" for one in checked]
    Page(text)
    assert "Also recorded" not in text or "warnings" not in text[text.index("Also recorded"):]


def test_a_run_without_any_has_an_empty_list(tmp_path, capsys):
    assert main(["run", "flow_only", "--out", str(tmp_path / "run")]) == 0
    assert told(tmp_path / "run")["warnings"] == [] and capsys.readouterr().err == ""
    assert "aria-label=\"warnings\"" not in text_of(tmp_path / "run")


def test_a_resume_keeps_them(tmp_path, checked):
    """Without working them out again."""
    stopped(load_scene("wide", SETS), tmp_path / "parts", after=2)
    resume(tmp_path / "parts")
    run(load_scene("wide", SETS), tmp_path / "whole")
    assert told(tmp_path / "parts")["warnings"] == checked
    assert lasting(tmp_path / "parts") == lasting(tmp_path / "whole")


def test_numbers_that_cannot_be_worked_out_end_no_run(monkeypatch):
    def fails(*_):
        raise OverflowError("math range error")

    scene = load_scene("flow_only")
    monkeypatch.setattr(simplifications, "warnings", fails)
    (warned,) = running.warned(scene, next(simulate(scene)).solved.flow.mean_velocity)
    assert warned.key == "scene" and "math range error" in warned.text
