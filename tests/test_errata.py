"""reference/ERRATA.md has every erratum with current numbers."""
import re

import pytest

from verification.errata import ERRATA
from verification.errata.__main__ import REPORT, load

IDS = load()
QUICK = [id for id in IDS if ERRATA[id].quick]


@pytest.fixture(scope="module")
def report():
    return REPORT.read_text(encoding="utf-8")


def test_the_report_has_every_entry_once_and_in_order_and_no_number_is_missing(report):
    assert re.findall(r"^## (E\d+)\. ", report, re.M) == IDS
    assert IDS[:13] == [f"E{number}" for number in range(1, 14)]
    assert re.findall(r"\{\w*\}|\bnan\b|\binf\b", report) == []


def section(text, id):
    """Return one entry of the report, up to the next title."""
    return text[text.index(f"## {id}. "):].split("\n## ")[0]


def words_and_numbers(text):
    """Return a text without its numbers and line ends, and the numbers."""
    number = r"(?<![A-Za-z\d_.])[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?"
    return re.sub(number, "#", " ".join(text.split())), [float(digits) for digits in re.findall(number, text)]


@pytest.mark.parametrize("id", QUICK)
def test_a_quick_entry_prints_the_same_numbers(report, id):
    """They agree to their spread or a last digit: processors round differently, and the mesher may choose another
    triangle."""
    words, numbers = words_and_numbers(section(report, id))
    again, computed = words_and_numbers(section(ERRATA[id].markdown(), id))
    assert again == words
    assert len(computed) == len(numbers)
    assert computed == pytest.approx(numbers, rel=ERRATA[id].spread, abs=0.02)
