"""Statements about speed follow from the recorded measurements, and the pages show them. No test asserts a time."""
import re

import pytest

from verification import speed
from verification.bench import report


def test_the_recorded_verdicts_follow_from_the_recorded_numbers():
    """The verdicts on speed are derived again from the numbers of the record; some do not hold."""
    bench_record = speed.records()["bench"]
    verdicts = report.judged(bench_record)
    assert verdicts == bench_record["verdicts"]
    assert {verdict["holds"] for verdict in verdicts} == {True, False}


@pytest.mark.parametrize("file", [speed.README, speed.PERFORMANCE], ids=lambda file: file.name)
def test_the_pages_have_the_measured_numbers(file):
    text = file.read_text(encoding="utf-8")
    section = speed.pages_of(speed.records())[file]
    assert speed.within(text, section) == text and "| accurate |" in section
    pictures = re.findall(r"!\[[^]]*\]\(([^)]+)\)", section)
    assert pictures and all((file.parent / name).exists() for name in pictures)
