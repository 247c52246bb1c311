"""Statements about speed follow from measurements: the benchmark's arithmetic on made-up data, its small versions and
the pages. No test asserts a time."""
import json
import re

import pytest

from verification import speed
from verification.bench import __main__ as bench
from verification.bench import record, report


def test_the_recorded_verdicts_follow_from_the_recorded_numbers():
    """The verdicts on speed are derived again from the numbers of the record; some do not hold."""
    bench_record = speed.records()["bench"]
    verdicts = report.judged(bench_record)
    assert verdicts == bench_record["verdicts"]
    assert {verdict["holds"] for verdict in verdicts} == {True, False}


#: Parts that take a second or two; the others solve whole scenes, and share the loop that measures.
QUICK = ("channel", "size")


@pytest.mark.parametrize("name", [
    part if part in QUICK else pytest.param(part, marks=pytest.mark.thorough) for part in bench.PARTS])
def test_a_small_version_of_every_part_runs(name, tmp_path, monkeypatch):
    """It measures every method, and its results can be drawn and recorded. The committed record stays unchanged."""
    monkeypatch.setattr(record, "SHORT", 0.0)  # no run warms up
    before = record.FILE.read_bytes()
    quick_record = bench.main(["--quick", name])
    part = quick_record["parts"][name]
    measured = part.get("lines", ())
    assert all(line["points"] or line["failed"] for line in measured) and (measured or part["rows"])
    points = [point for line in measured for point in line["points"]]
    assert all(point["seconds"] > 0 and point["cpu"] > 0 and 0 <= point.get("error", 0) < 0.5 for point in points)
    assert sum(len(line["failed"]) for line in measured) <= 2
    json.dumps(quick_record, allow_nan=False)
    assert all(path.stat().st_size > 1000 for path in report.draw(quick_record["parts"], tmp_path))
    assert before == record.FILE.read_bytes()


@pytest.mark.parametrize("file", [speed.README, speed.PERFORMANCE], ids=lambda file: file.name)
def test_the_pages_have_the_measured_numbers(file):
    text = file.read_text(encoding="utf-8")
    section = speed.pages_of(speed.records())[file]
    assert speed.within(text, section) == text and "| accurate |" in section
    pictures = re.findall(r"!\[[^]]*\]\(([^)]+)\)", section)
    assert pictures and all((file.parent / name).exists() for name in pictures)
