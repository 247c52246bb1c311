"""reference/ERRATA.md: every erratum is there, and what can be computed quickly still gives the numbers printed."""
import re
from pathlib import Path

import pytest

from verification.errata import ERRATA, filled
from verification.errata.__main__ import REPORT, load

IDS = load()
REQUIRED = [f"E{number}" for number in range(1, 14)]
QUICK = [id for id in IDS if ERRATA[id].quick]


@pytest.fixture(scope="module")
def report():
    return REPORT.read_text(encoding="utf-8")


def test_the_report_has_every_entry_once_and_in_order(report):
    assert re.findall(r"^## (E\d+)\. ", report, re.M) == IDS
    assert IDS[: len(REQUIRED)] == REQUIRED


def test_no_number_is_missing(report):
    assert re.findall(r"\{\w*\}|\bnan\b|\binf\b", report) == []


def section(text, id):
    """One entry of the report, from its title to the next one's."""
    return text[text.index(f"## {id}. "):].split("\n## ")[0]


def words_and_numbers(text):
    """The text without its numbers and table rules, and the numbers; line ends do not count."""
    number = r"(?<![A-Za-z\d_.])[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?"
    return re.sub(number, "#", " ".join(text.split())), [float(found) for found in re.findall(number, text)]


@pytest.mark.parametrize("id", QUICK)
def test_a_quick_entry_prints_the_same_numbers(report, id):
    """To 5 % or a last digit: another processor rounds otherwise, and the mesher may then choose another triangle."""
    words, numbers = words_and_numbers(section(report, id))
    again, found = words_and_numbers(section(ERRATA[id].markdown(), id))
    assert again == words
    assert found == pytest.approx(numbers, rel=0.05, abs=0.02)


@pytest.mark.parametrize("id", [id for id in IDS if id not in QUICK])
def test_the_text_of_a_slow_entry_is_the_programs(report, id):
    """Its numbers are not computed here; the words around them must be those of the program."""
    entry = ERRATA[id]
    found = " ".join(report.split(f"## {id}. ")[1].split("\n## ")[0].split())
    for text in (entry.printed, entry.reading, *re.split(r"\{\w+\}", entry.consequence)):
        assert " ".join(text.split()) in found


def test_paragraphs_are_filled_and_tables_are_not():
    row = "| " + "cell " * 40 + "|"
    assert filled("word " * 50 + "\n\n" + row).splitlines()[-1] == row
    assert max(map(len, filled("word " * 50).splitlines())) <= 120


def test_the_report_names_no_machine(report):
    assert not re.search(r"(?<![\w.])/(?:home|tmp|work|usr)\b", report)
    assert Path(REPORT).name == "ERRATA.md"
