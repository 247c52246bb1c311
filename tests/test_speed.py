"""What is told of speed, hard cases and assumptions follows from what was measured, in all places that tell it."""
import re

import pytest

from verification import speed

POINT = {"label": "as it is", "seconds": 0.5, "cpu": 0.5, "error": 0.005, "errors": [0.005] * 8}
PAPER = {**POINT, "label": speed.PAPER_AS_IT_IS, "seconds": 5.0}
BENCH = {"machine": {"cores": 2, "processor": "a <processor>", "python": "3.11"},
         "parts": {"base": {"title": "base", "error": "largest", "reference": "another code", "lines": [
             {"method": speed.runs.PRESET_PAPER, "points": [PAPER], "failed": []},
             {"method": speed.runs.FAST, "points": [POINT], "failed": []},
             {"method": speed.runs.ACCURATE, "points": [{**POINT, "seconds": 2.0}], "failed": []}]}},
         "verdicts": [{"claim": "fast", "wanted": "5 times", "measured": "2 times", "holds": False}]}
HARD = {"cases": [{"number": 4, "title": "Fast", "right_is": "the balance", "cells": {
    name: {"verdict": verdict, "message": "too | fast" if verdict != "right" else "", "checks": []}
    for name, verdict in (("paper", "right"), ("fast", "wrong"), ("accurate", "refused"))}}]}
AUDIT = {"method": "one changed at a time", "rows": [{
    "choice": "inlet", "default": "u_x", "alternative": "u_ave", "cost_ratio": 1.0, "note": "[E4]",
    "effect": {"velocity": -1e-4, "area": 2e-5, "acceptor leaving": 3e-4}, "one_state": {}}]}


@pytest.fixture
def told():
    """Blocks of made-up records."""
    return list(speed.blocks({"bench": BENCH, "hard_cases": HARD, "audit": AUDIT}))


@pytest.mark.parametrize("file", [speed.README, speed.PERFORMANCE], ids=lambda file: file.name)
def test_the_pages_tell_what_was_measured(file):
    text = file.read_text(encoding="utf-8")
    section = speed.pages_of(speed.records())[file]
    assert speed.within(text, section) == text and "| accurate |" in section
    pictures = re.findall(r"!\[[^]]*\]\(([^)]+)\)", section)
    assert pictures and all((file.parent / name).exists() for name in pictures)


def test_the_record_has_every_hard_case():
    rows = [case["number"] for case in speed.records()["hard_cases"]["cases"]]
    assert rows == list(range(1, 23))


def test_presets_are_told_with_ratio_and_errors(told):
    text = speed.markdown(told)
    assert "| fast | 0.50 | 10.0 times | 0.5 % |" in text and "| accurate | 2.00 | 2.5 times |" in text


def test_what_does_not_hold_is_told(told):
    assert "| fast | 5 times | 2 times | does not hold |" in speed.markdown(told)
    assert speed.page(told).count("class='no'") == 2


def test_a_change_is_told_in_percent_with_its_sign(told):
    assert "| -0.01 % | +0.002 % | +0.03 % | +0.03 % (acceptor leaving) |" in speed.markdown(told)


def test_text_is_escaped(told):
    assert "a &lt;processor&gt;" in speed.page(told) and "too | fast" in speed.page(told)
    assert "| x \\| y |" in speed.markdown([speed.Block("table", rows=(("a",), ("x | y",)))])


def test_without_records_nothing_is_told():
    assert list(speed.blocks({"bench": {}, "hard_cases": {}, "audit": {}})) == []


def test_the_section_replaces_the_one_before():
    """Text around the marks stays."""
    text = f"before\n{speed.BEGIN}\nold\n{speed.END}\nafter\n"
    once = speed.within(text, "new")
    assert "old" not in once and once.startswith("before\n") and once.endswith(f"{speed.END}\nafter\n")
    assert speed.within(once, "new") == once
