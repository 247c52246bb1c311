"""What is told of speed follows from what was measured: the benchmark's arithmetic on made-up data, its small versions,
and the pages. No time is ever asserted."""
import json
import re

import numpy as np
import pytest

from verification import speed
from verification.bench import __main__ as bench
from verification.bench import record, told
from verification.problems import runs as problems


def lines(points):
    """A part of methods {name: points}."""
    return {"title": "t", "error": "largest", "reference": "another code", "lines": [
        {"method": method, "points": of, "failed": []} for method, of in points.items()]}


def test_errors_are_relative_but_effluents_over_the_supply():
    truth = np.array([[2.0, 80.0, 1000.0, 30.0, -30.0, 30.0, 4.0, 6.0]])
    found = truth + np.array([[0.02, 0, 0, 0, -0.6, 0, 0.5, 0]])
    assert problems.errors(found, truth)[0] == pytest.approx([0.01, 0, 0, 0, 0.02, 0, 0.05, 0])


def test_the_recorded_verdicts_follow_from_what_was_recorded():
    """What is claimed of speed is judged again from the numbers of the record; some of it does not hold."""
    bench_record = speed.records()["bench"]
    verdicts = told.judged(bench_record)
    assert verdicts == bench_record["verdicts"]
    assert {verdict["holds"] for verdict in verdicts} == {True, False}


#: Parts that take a second or two; the others solve whole scenes, and share the loop that measures.
QUICK = ("channel", "size")


@pytest.mark.parametrize("name", [
    part if part in QUICK else pytest.param(part, marks=pytest.mark.thorough) for part in bench.PARTS])
def test_a_small_version_of_every_part_runs(name, tmp_path, monkeypatch):
    """It measures something, of every method, is drawn and can be recorded; what is on record is not touched."""
    monkeypatch.setattr(record, "SHORT", 0.0)  # no run warms up
    before = record.FILE.read_bytes()
    found = bench.main(["--quick", name])
    part = found["parts"][name]
    measured = part.get("lines", ())
    assert all(line["points"] or line["failed"] for line in measured) and (measured or part["rows"])
    points = [p for line in measured for p in line["points"]]
    assert all(p["seconds"] > 0 and p["cpu"] > 0 and 0 <= p.get("error", 0) < 0.5 for p in points)
    assert sum(len(line["failed"]) for line in measured) <= 2
    json.dumps(found, allow_nan=False)
    assert all(path.stat().st_size > 1000 for path in told.draw(found["parts"], tmp_path))
    assert before == record.FILE.read_bytes()


@pytest.mark.parametrize("file", [speed.README, speed.PERFORMANCE], ids=lambda file: file.name)
def test_the_pages_tell_what_was_measured(file):
    text = file.read_text(encoding="utf-8")
    section = speed.pages_of(speed.records())[file]
    assert speed.within(text, section) == text and "| accurate |" in section
    pictures = re.findall(r"!\[[^]]*\]\(([^)]+)\)", section)
    assert pictures and all((file.parent / name).exists() for name in pictures)
